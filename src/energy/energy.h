/* Events to energy. Integer femtojoules, so energies are compared for equality, never with a tolerance. */
#ifndef SF_ENERGY_ENERGY_H
#define SF_ENERGY_ENERGY_H
#include "fx/memory.h"
#include "image/image.h"
#include "energy/ledger.h"
#include "ranks/ranks.h"
#include "scene/scene.h"
#include "base/json.h"
#include <stdio.h>

/* Paper ledger: MAC * SF_MAC_FJ + SOP * SF_SOP_FJ, nothing else. UINT64_MAX stands for "does not fit in 64 bits". */
uint64_t sf_energy_fj(const fx_counts *counts);
uint64_t sf_cost_fj(const fx_cost *cost); /* the same of one ray */
fx_cost sf_cost_of(const fx_counts *counts);
/* The ReLU twin of the same layer sizes on the same samples: every synapse a MAC, once. UINT64_MAX as above. */
uint64_t sf_energy_ann_fj(const fx_net *net, uint64_t samples);

/* Recount of mac, sop, spikes, updates, weight bytes, state bytes, special functions of one sample from its spike
 * bitmaps alone, added to *counts; samples and rays too. Shares no code with src/fx. All 128 bits of a bitmap count:
 * a spike in a lane that the layer does not have is a difference to be seen, not one to be masked away. */
void sf_recount_sample(const fx_net *net, const uint64_t spikes[SF_LAYERS][SF_T_MAX][SF_SPIKE_WORDS], bool first_of_ray,
                       fx_counts *counts);

/* The same of memory: positions at which the field is read, and spike bitmaps, in the order of a list of rays. */
typedef struct sf_cache_slot {
  uint64_t line, time; /* of its last use; 0: empty */
} sf_cache_slot;
typedef struct sf_memory_recount {
  const fx_scene *scene;
  fx_cache_shape shape;
  fx_memory_counts counts;
  sf_cache_slot *slot; /* owned */
  uint64_t slots, clock, tile, samples;
  bool begun, fired[FX_SPIKING][64 * SF_SPIKE_WORDS];
} sf_memory_recount;
sf_status sf_memory_recount_open(sf_memory_recount *m, const fx_scene *scene, const fx_cache_shape *shape);
void sf_memory_recount_close(sf_memory_recount *m);
void sf_memory_recount_begin(sf_memory_recount *m);              /* a list */
void sf_memory_recount_ray(sf_memory_recount *m, uint64_t tile); /* as fx_memory_ray */
void sf_memory_recount_read(sf_memory_recount *m, fx_read what, const uint32_t pos[3]);
void sf_memory_recount_sample(sf_memory_recount *m, const uint64_t spikes[SF_LAYERS][SF_T_MAX][SF_SPIKE_WORDS]);
/* SF_E_DIFFERENCE names the first count that differs. */
sf_status sf_memory_compare(const fx_memory_counts *a, const char *a_name, const fx_memory_counts *b,
                            const char *b_name);

/* Equality of two counts over the layers' events and samples (not rays/grid/march/saturation). On a difference names
 * event, layer, step and both values. */
sf_status sf_counts_compare(const fx_counts *a, const char *a_name, const fx_counts *b, const char *b_name);
cJSON *sf_counts_json(const fx_net *net, const fx_counts *counts);

/* What event.def says of each event, by sf_event_id. */
typedef struct sf_event {
  const char *name, *title; /* "state_r", "state bytes read" */
} sf_event;
extern const sf_event sf_events[SF_EVENTS];
extern const sf_event sf_traffic_events[SF_TRAFFIC_EVENTS];  /* of what is outside the nets, by sf_traffic_id */
uint64_t sf_event_total(const fx_counts *counts, int event); /* over layers and steps */

/* One price list, several readings of what is a MAC. All in fJ. */
typedef struct sf_ledger {
  uint64_t mac_fj, sop_fj, spiking_fj; /* paper ledger: every counted MAC, the product of h(t) at every step included */
  uint64_t h_once_fj;      /* reading R = D1 + C1: the product of h counted once per sample, as if h were constant */
  uint64_t h_spikes_fj;    /* reading R = D1: each product of h is a SOP that happens at the net's mean firing rate */
  uint64_t ann_fj;         /* twin: every synapse a MAC once per sample, the direction's too */
  uint64_t ann_hoisted_fj; /* twin with the direction's products once per ray, as the spiking net has them */
} sf_ledger;
/* Fails with SF_E_RANGE when a total does not fit in 64 bits. */
sf_status sf_ledger_make(const fx_net *net, const fx_counts *counts, sf_ledger *ledger);
/* 100 * (1 - spiking / ann); NaN when ann is 0. */
double sf_saving_percent(uint64_t spiking_fj, uint64_t ann_fj);
cJSON *sf_ledger_json(const sf_ledger *ledger);

/* Tables for a person. */
void sf_counts_print(FILE *out, const fx_net *net, const fx_counts *counts);
/* views: how many views the counts cover (a fraction for a sample of rays), for the figures per view. */
void sf_ledger_print(FILE *out, const sf_ledger *ledger, double views);
/* What is not modelled, and what the metric is criticised for: in every report. */
void sf_limits_print(FILE *out);
void sf_limits_json(cJSON *object); /* adds "not_modelled" and "criticism" */

/* The same rays counted by the core (a), the accelerator's own counters (b) and from the spike bitmaps (c). What lies
 * outside the nets is counted by (a) as it happens, by (b) at the ports of the accelerator that marches no more than
 * the core did (requests of its grid's memory, pixels that left it, the samples that it composited), by (c) from the
 * samples alone. */
typedef struct sf_three_counts {
  int wanted, rays; /* rays asked for; rays run */
  fx_counts core, rtl, recount;
  sf_traffic core_traffic, rtl_traffic, recount_traffic;
  int rtl_events; /* of the traffic that the accelerator sees: SF_TRAFFIC_AT_PORTS, or fewer with another cache than it
                     has */
  fx_memory_counts core_memory, recount_memory; /* rays: a list */
  uint64_t cycles, busy, stalls;
  sf_status agreement; /* SF_E_DIFFERENCE names the first difference */
} sf_three_counts;

/* Traffic of these counts and so many pixels, as the core counted it. */
sf_traffic sf_traffic_of(const fx_scene *scene, const fx_counts *counts, const fx_memory_counts *memory,
                         uint64_t pixels);
/* The same from the number of recounted samples and the shape of the field alone. field_samples: positions at which
 * TensoRF's density was asked, which leave no spikes; not looked at for INGP. */
sf_traffic sf_traffic_recount(const fx_scene *scene, const fx_counts *recount, const fx_memory_counts *memory,
                              uint64_t field_samples, uint64_t pixels);
/* SF_E_DIFFERENCE names the first of the first `events` that differs. */
sf_status sf_traffic_compare(const sf_traffic *a, const char *a_name, const sf_traffic *b, const char *b_name,
                             int events);
/* Bytes of the field's tables: what chooses the price of a read. */
uint64_t sf_table_size(const fx_scene *scene);

/* The paper's published energies, recomputed: E = 4.6 pJ R + 0.9 pJ fr T (F - R) per sample, samples from the ANN row,
 * one rate fr per backbone, data and reading of R (the mean of the rates its rows imply). And once more with two rates,
 * one of the first time step and one of the later ones, fr T = first + later (T - 1): in hybrid mode the first step
 * charges a membrane with the whole current, so neurons fire more often then. Least squares of the relative residuals.
 */
typedef struct sf_published_row {
  const char *backbone, *data, *beta; /* beta NULL: the ANN */
  const char *reading;                /* how R is read */
  double macs, real_macs;             /* F and R per sample at this row's T */
  double steps, published_mj;         /* steps 0: the ANN */
  double samples;                     /* per view */
  double rate, mean_rate;             /* implied by this row; of the group */
  double recomputed_mj, residual_percent;
  double first_rate, later_rate, two_rates_mj, two_rates_residual_percent; /* NAN: the ANN */
  double saving_percent, published_saving_percent;                         /* NaN where the paper prints none */
} sf_published_row;
enum { SF_PUBLISHED_MAX = 48 };
int sf_published_rows(sf_published_row rows[SF_PUBLISHED_MAX]);
void sf_published_print(FILE *out);
cJSON *sf_published_json(void);

/* One ray through the core under observation; see sf_observer_net. Zero it, then set net. */
typedef struct sf_observer {
  const fx_net *net;
  fx_trace *trace;   /* where not NULL, every sample is recounted from its spike bitmaps and compared */
  fx_counts core;    /* (a) */
  fx_counts recount; /* (c), from trace */
  uint64_t sample;   /* of this ray, from 0; sf_observer_begin resets it */
  fx_memory *memory; /* both or none: (a) and (c) of what is asked of memory, over all rays */
  sf_memory_recount *lines;
  int32_t base[SF_LANES];
} sf_observer;
void sf_observer_begin(sf_observer *observer); /* clears everything but net, trace, memory and lines */
/* sf_observer_begin, then the ray under observation of memory and lines. eval: sf_observer_net, or calls it. */
sf_status sf_observer_ray(sf_observer *observer, const fx_scene *scene, const fx_ray *ray, uint64_t tile,
                          fx_net_fn eval, void *user, fx_pixel *pixel);
/* fx_net_fn; user is the sf_observer. Pass &observer->core to fx_render_ray too: it counts grid and march there. */
sf_status sf_observer_net(void *observer, const fx_ray *ray, bool first, const int16_t *f, fx_out *out);

/* The ray through the centre of a pixel. */
sf_status sf_pixel_ray(const fx_scene *scene, const sf_dataset *data, const sf_view *view, int x, int y, fx_ray *ray);

/* Rays 0..rays-1 through the vector core on all threads; the sums do not depend on the threads. */
typedef struct sf_measure_job {
  const fx_scene *scene;
  uint64_t rays;
  sf_status (*ray)(void *user, uint64_t index, fx_ray *ray); /* called from many threads */
  bool (*tick)(void *user, uint64_t done); /* from one thread at a time, now and then; false stops. May be NULL */
  void *user;
  uint64_t seed;
  uint64_t check;       /* at most so many rays, seeded, of those with samples are also counted by the portable core and
                           recounted from its spike bitmaps; UINT64_MAX: all */
  fx_cache_shape cache; /* of the field; zeros: sf_cache_built */
  uint64_t (*tile)(void *user, uint64_t index); /* of a ray, see fx_memory_ray; NULL: each ray has its own */
  sf_ranks *ranks; /* who counts, or NULL; the callbacks give the same on each, and rank 0 alone gets the sums */
} sf_measure_job;
/* The cache that the accelerator has here: CACHE_BYTES and CACHE_WAYS of arch.def. */
static const fx_cache_shape sf_cache_built = {SF_CACHE_BYTES, SF_CACHE_WAYS};
typedef struct sf_measure {
  fx_counts core; /* all rays, vector core */
  uint64_t rays;  /* all, with or without samples */
  uint8_t *hit;   /* bit i: ray i has samples; owned, sf_measure_free */
  uint64_t checked;
  fx_counts checked_core, recount; /* of the checked rays: portable core = vector core, recount */
  fx_memory_counts memory;         /* of all rays, as a list */
  fx_memory_counts checked_memory; /* of the checked rays, as a list: vector core = portable core = recount */
} sf_measure;
/* Of the checked rays, portable core and recount are compared sample by sample: a difference names ray, sample, layer,
 * step and event; the sums of the vector core are compared with theirs: a difference names ray, layer, step, event. */
sf_status sf_measure_rays(const sf_measure_job *job, sf_measure *measure);
void sf_measure_free(sf_measure *measure);
/* At most `limit` of the rays with samples, drawn by seed and stream, in index[limit], ascending.
 * *count says how many. Does not depend on the threads. */
sf_status sf_measure_choose(const sf_measure *measure, uint64_t seed, uint64_t stream, uint64_t limit, uint64_t *index,
                            uint64_t *count);

/* A ReLU twin that was trained by itself: it takes samples of its own, which its float rendering of the same rays
 * counts: every synapse of its nets (TensoRF: of its decoder) an fp32 MAC, once per sample. */
typedef struct sf_twin_job {
  const char *path; /* model.safetensors */
  uint64_t rays;
  void (*ray)(void *user, uint64_t index, float origin[3], float direction[3]); /* world units */
  bool (*tick)(void *user, uint64_t done);                                      /* false stops; may be NULL */
  void *user;
} sf_twin_job;
typedef struct sf_twin {
  const char *path; /* NULL: there is none */
  uint64_t samples, macs, fj;
  double saving_percent; /* of the spiking net in the paper ledger */
} sf_twin;
/* SF_E_UNSUPPORTED when the model is no ReLU net. */
sf_status sf_twin_count(const sf_twin_job *job, sf_twin *twin);
/* Sets fj and saving_percent. SF_E_RANGE when the energy does not fit in 64 bits. */
sf_status sf_twin_price(const sf_technology *technology, uint64_t spiking_fj, sf_twin *twin);

/* Everything one audit found. views: how many whole views the rays amount to. */
typedef struct sf_audit_report {
  const char *scene, *data, *split, *sha256;
  const fx_net *net;
  uint64_t rays, seed;
  double views, seconds;
  bool random_rays;
  fx_cache_shape cache; /* of the field */
  uint64_t entries;     /* of a hash grid that the samples read; 0 of TensoRF */
  sf_measure measure;
  sf_three_counts three;
  sf_ledger ledger; /* the paper's metric and its readings, at 4.6 and 0.9 pJ */
  sf_traffic traffic;
  sf_ledgers ledgers; /* all, at the prices of a technology */
  sf_twin twin;
} sf_audit_report;
void sf_report_print(FILE *out, const sf_audit_report *report);
/* By share/schema/energy_audit.schema.json; "format" is SF_AUDIT_FORMAT. */
#define SF_AUDIT_FORMAT "spikefield-audit-2"
/* Reports before it: memories priced by the byte, no cache, no arithmetic of field and ray. --compare reads them. */
#define SF_AUDIT_FORMAT_1 "spikefield-audit-1"
cJSON *sf_report_json(const sf_audit_report *report);
/* One row per layer and step, then field and ray: events, fJ of every spiking ledger. */
void sf_report_csv(FILE *out, const sf_audit_report *report);

/* Two audits as sf_report_json gives them (or read back): settings that differ, energies per view of every ledger by
 * kind, layer and step, events; each list with its largest change first. SF_E_FORMAT names a side that is no audit. The
 * caller deletes *comparison. */
sf_status sf_audits_compare(const cJSON *a, const char *a_name, const cJSON *b, const char *b_name, cJSON **comparison);
void sf_comparison_print(FILE *out, const cJSON *comparison);

/* Saturation that the number formats rule out: membranes and colour in the modes whose state is a convex combination.
 * Density may saturate: alpha is 1 long before. Writes "none" or a comma-separated list of layers. */
bool sf_saturation_unexpected(const fx_net *net, const uint64_t saturated[SF_LAYERS], char *list, size_t size);
/* "none", or "D2 12 samples, 3 features": samples with a saturation per layer, grid features that were clipped. */
void sf_saturation_census(const uint64_t samples[SF_LAYERS], uint64_t features, char *text, size_t size);
#endif
