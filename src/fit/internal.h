/* Inside src/fit. */
#ifndef SF_FIT_INTERNAL_H
#define SF_FIT_INTERNAL_H
#include "fit/fit.h"
#include <math.h>

/* ---- kinds of cuts: what can go, as data ---- */

typedef struct sf_cut_kind {
  bool large; /* few and far from the optimum that training reached: judged by the error on the checking rays */
  bool bytes; /* it makes the field's memory smaller: what sf_fit_to_bytes may cut */
  int (*places)(const fx_scene *scene); /* how many cuts of this kind there may be; 0: not of this field */
  /* One of them more: false where it is not possible, or not any more. */
  bool (*apply)(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim, int place);
} sf_cut_kind;
extern const sf_cut_kind sf_cut_kinds[];
extern const int sf_cut_kind_count;

typedef struct sf_cut {
  int kind, place;
  bool ranked;         /* possible, and measured in this round */
  double loss, saving; /* relative: of the squared error; of energy plus of bytes */
} sf_cut;

/* ---- the search ---- */

typedef struct sf_measured {
  uint64_t error, energy, bytes;
} sf_measured;

/* What a byte of the field that a sample uses asks of its cache, on the tiles. */
typedef struct sf_field_cost {
  double lookups, misses;
} sf_field_cost;

typedef struct sf_fit_search {
  const sf_fit_job *job;
  const fx_scene *scene; /* the chosen candidate */
  const sf_quant_widths *widths;
  sf_trim_use use;
  sf_trim trim;                    /* what stays, so far */
  sf_fit_sum reference;            /* on the checking rays */
  sf_measured check, rank_now;     /* the trim so far on the checking and on the ranking rays */
  sf_field_cost field_now;         /* of the trim so far */
  sf_fit_rays rank;                /* rays with the pictures of the trim so far as targets */
  uint32_t *picture;               /* [rank_end][3] */
  uint64_t rank_end, check_end;    /* rays 0..rank_end-1 rank, then come those that check */
  sf_cut *cuts;                    /* [room] */
  int room, count, ranked, checks; /* ranked: the first of cuts */
} sf_fit_search;

sf_status sf_fit_search_tick(const sf_fit_search *s, const char *what, int done, int total);
/* sf_fit_measure in pieces, so that an interruption is heard. */
sf_status sf_fit_search_measure(const sf_fit_search *s, const fx_scene *scene, const sf_fit_rays *rays, uint64_t begin,
                                uint64_t end, uint32_t *picture, sf_fit_sum *sum);
sf_status sf_fit_search_field(const sf_fit_search *s, const fx_scene *scene, sf_field_cost *cost, sf_fit_field *whole);
sf_field_cost sf_field_cost_of(const sf_fit_field *field, uint64_t misses);
/* Everything that the audit counts: rays one by one for the nets, tiles for the field. */
uint64_t sf_fit_search_energy(const sf_fit_search *s, const fx_scene *scene, const fx_counts *counts, uint64_t rays,
                              const sf_field_cost *field, const fx_cache_shape *cache);
/* The error on the checking rays that a share of the bound allows. */
double sf_fit_search_allowed(const sf_fit_search *s, double share);
/* From the trim that changes nothing to the smallest within the bound. */
sf_status sf_fit_search_rounds(sf_fit_search *s);

static inline double sf_fit_ratio(uint64_t a, uint64_t b)
{
  return b ? (double)a / (double)b : a ? INFINITY : 1;
}
#endif
