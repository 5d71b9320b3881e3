/* Cycle model of the accelerator from positions to pixels, for TensoRF's field: the control of rtl/sf_planes.sv and
 * what stands around it, as the clock cycles of events, with the engine of cycles.h behind it. Equal to the RTL's clock
 * while the memory's latency is constant, the host sends the samples that the core reads without a gap, and each pixel
 * is taken at once (tests/test_rtl_ray_cycles.c). */
#ifndef SF_CYCLES_PLANES_H
#define SF_CYCLES_PLANES_H
#include "cycles/cycles.h"
#include "fx/cache.h"

/* A position whose density is read, or a ray without one. */
typedef struct sf_planes_read {
  uint32_t pos[3];
  bool first, last;  /* of its ray */
  bool empty;        /* the ray has no sample: first and last */
  bool decoded;      /* its appearance is read, and it goes on to the decoder */
  bool ends, behind; /* the ray ends here; it ended before */
} sf_planes_read;

/* Rays, one behind the other; zero it first. */
typedef struct sf_planes_record {
  sf_planes_read *at;
  size_t count, room;
  sf_cycle_record nets; /* of the decoded ones */
} sf_planes_record;
sf_status sf_planes_record_ray(sf_planes_record *record, const fx_scene *scene, const fx_ray *ray);
void sf_planes_record_free(sf_planes_record *record);

typedef struct sf_planes_totals {
  uint64_t rays, densities, decoded;
  uint64_t lookups, misses;
  uint64_t cycles; /* from the first beat in until the last pixel is out */
} sf_planes_totals;

/* latency: of the memory, from a request to its first beat, in cycles. */
typedef struct sf_planes_model sf_planes_model;
sf_status sf_planes_model_open(sf_planes_model **model, const fx_scene *scene, const sf_engine *engine,
                               const fx_cache_shape *cache, int latency);
/* The next rays follow the ones before without a gap. new_tile: the cache is emptied before them. */
void sf_planes_model_add(sf_planes_model *model, const sf_planes_record *record, bool new_tile);
void sf_planes_model_drain(sf_planes_model *model); /* the last pixel; nothing may follow */
const sf_planes_totals *sf_planes_model_totals(const sf_planes_model *model);
const sf_cycle_totals *sf_planes_model_engine(const sf_planes_model *model);
void sf_planes_model_close(sf_planes_model *model); /* NULL is fine */
#endif
