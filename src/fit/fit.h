/* Models only what a scene needs: searches the smallest trim (quant.h) of a quantised scene whose pictures of the
 * training views lose at most a stated number of decibels. */
#ifndef SF_FIT_FIT_H
#define SF_FIT_FIT_H
#include "energy/energy.h"
#include "energy/ledger.h"
#include "quant/quant.h"

/* Rays through random pixels of a data set's views and the colours that they should have. */
typedef struct sf_fit_rays {
  uint64_t count;
  double pixels;             /* mean pixels of a view: a frame */
  float *origin, *direction; /* [count][3] model units, owned */
  uint32_t *target;          /* [count][3] Q0.16, 65535 = 1.0, over the background; owned */
} sf_fit_rays;
/* background: of the scene, Q0.16. Refuses a view without a picture, naming it. */
sf_status sf_fit_rays_draw(sf_fit_rays *rays, const sf_dataset *data, const int32_t background[3], uint64_t count,
                           uint64_t seed);
/* Whole tiles of the views, FX_TILE^2 rays each, row by row; pixels beyond a picture's edge are its last ones. No
 * targets.
 */
sf_status sf_fit_tiles_draw(sf_fit_rays *rays, const sf_dataset *data, uint64_t tiles, uint64_t seed);
void sf_fit_rays_free(sf_fit_rays *rays);

/* Rays begin..end-1 through the core on all threads. Integer sums: they do not depend on the threads.
 * picture: [end - begin][3] Q0.16, or NULL. */
typedef struct sf_fit_sum {
  uint64_t error; /* squared difference from the targets, Q0.32, all channels */
  fx_counts counts;
} sf_fit_sum;
sf_status sf_fit_measure(const fx_scene *scene, const sf_fit_rays *rays, uint64_t begin, uint64_t end,
                         uint32_t *picture, sf_fit_sum *sum);
/* What whole tiles read of the field: counts and look-ups of rays of sf_fit_tiles_draw, misses[i] in a cache of
 * shapes[i]. */
typedef struct sf_fit_field {
  fx_counts counts;
  uint64_t lookups;
} sf_fit_field;
sf_status sf_fit_measure_field(const fx_scene *scene, const sf_fit_rays *tiles, const fx_cache_shape *shapes, int n,
                               sf_fit_field *field, uint64_t *misses);
/* Adds what rays begin..end-1 use. places false: in the nets alone; the loss of leaving places out can then be measured
 * on these rays. */
sf_status sf_fit_observe(const fx_scene *scene, const sf_fit_rays *rays, uint64_t begin, uint64_t end, bool places,
                         sf_trim_use *use);

typedef struct sf_fit_job {
  const fx_scene *const
      *candidate; /* of any field: quantisations of one model; [0] is the reference, then narrower and narrower */
  const sf_quant_widths *widths; /* [candidates], no zeros */
  int candidates;                /* the last one that loses at most half of loss_db is trimmed */
  const sf_fit_rays *rays, *tiles;
  const sf_technology *technology; /* its prices, everything counted, say what a cut saves */
  double loss_db;                  /* >= 0; 0: only what changes no bit on the rays */
  const char *name;
  bool (*tick)(void *user, const char *what, int done,
               int total); /* false stops; what is NULL between reports; may be NULL */
  void *user;
} sf_fit_job;

/* Before the fit: candidate[0] with a field that takes at most `bytes` in a memory, with the least loss that the search
 * finds. A hash grid has two bytes for each entry; TensoRF planes, lines and the basis matrix. */
typedef struct sf_fit_tables {
  uint64_t bound, bytes_before, bytes_after, checked; /* checked: rays that the loss was measured on */
  bool planes;                                        /* TensoRF's; else a hash grid */
  int dropped, smaller, rounds;                       /* levels, tables; of planes components, axes with fewer points */
  double psnr_before, psnr_after, loss_db;
} sf_fit_tables;
/* job->loss_db: how much it may lose. SF_E_RANGE, with the best that it reached, where that is not enough. */
sf_status sf_fit_to_bytes(fx_scene *small, const sf_fit_job *job, uint64_t bytes, sf_fit_tables *report);
void sf_fit_tables_print(FILE *out, const sf_fit_tables *report);
cJSON *sf_fit_tables_json(const sf_fit_tables *report);

/* A scene's sizes, and what the checking rays cost and lose. */
typedef struct sf_fit_state {
  int32_t n_in[SF_LAYERS], n_out[SF_LAYERS];
  bool planes; /* TensoRF's; else a hash grid */
  int32_t levels, directions, steps, trans_stop;
  int32_t components[SF_FACTORS]; /* of all pairs */
  int32_t features, feature_freqs, view_freqs, points[3], weight_stop;
  double box[3], distance; /* edges of the box, distance of samples, model units */
  sf_quant_widths widths;
  int64_t entries, zero_entries, cells; /* of planes and lines: numbers */
  uint64_t bytes;                       /* the field, weights, occupancy: what a memory has to hold */
  uint64_t cycles, energy_fj; /* of sum; energy: everything that the audit counts, with the cache that is built */
  double lookups, misses;     /* of the field, per sample of the nets */
  sf_fit_sum sum;
  double psnr; /* dB against the pictures */
} sf_fit_state;
/* sum: of `rays` checking rays; lookups, misses and energy_fj are the caller's. */
void sf_fit_describe(const fx_scene *scene, const sf_quant_widths *widths, const sf_fit_sum *sum, uint64_t rays,
                     sf_fit_state *state);

/* A size of the field's cache, with the ways that are built. */
enum { SF_FIT_CACHES = 7 }; /* FX_CACHE_BYTES_MIN to FX_CACHE_BYTES_MAX */
typedef struct sf_fit_cache {
  fx_cache_shape shape;
  double misses;      /* per look-up */
  uint64_t energy_fj; /* as sf_fit_state's, after */
} sf_fit_cache;

typedef struct sf_fit_report {
  int chosen;                                /* candidate */
  sf_fit_tables tables;                      /* of sf_fit_to_bytes, set by its caller; bound 0: none */
  uint64_t observed, first_checked, checked; /* rays whose use was observed; those that the loss was measured on */
  double pixels;                             /* of a frame */
  double bound_db, loss_db; /* loss_db: reference against result, negative where the result is better */
  sf_fit_state before, after;
  int silent[SF_LAYERS], dropped[SF_LAYERS]; /* neurons without effect on the observed rays; further ones, at a loss */
  int idle_levels, dropped_levels, smaller_tables;
  int idle_components[SF_FACTORS], dropped_components[SF_FACTORS];
  sf_fit_cache cache[SF_FIT_CACHES];
  int cache_chosen; /* the smallest within a hundredth of the least energy */
} sf_fit_report;
sf_status sf_fit(fx_scene *fitted, const sf_fit_job *job, sf_fit_report *report);
void sf_fit_print(FILE *out, const sf_fit_report *report);
cJSON *sf_fit_json(const sf_fit_report *report);
#endif
