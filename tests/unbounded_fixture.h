/* For the tests of scenes larger than one box: their configuration, hard rays, cells found directly. */
#ifndef SF_TESTS_UNBOUNDED_FIXTURE_H
#define SF_TESTS_UNBOUNDED_FIXTURE_H
#include "ck_run.h"
#include "base/rng.h"
#include "snn/model.h"
#include <math.h>

static inline sf_config large_config(int bound, int res)
{
  sf_config c = sf_config_default();
  sf_config_bound(&c, bound);
  c.levels = 2, c.log2_hash = 8, c.finest_res = 32, c.hidden = 16, c.steps = 2, c.occ_res = res;
  return c;
}

enum { KINDS = 6 };

/* From inside, from far outside (32768 lattice steps are 110), along an axis, in the face between two cascades, along
 * its edge, and any ray. */
static inline void draw_ray(int kind, uint64_t i, float bound, float o[3], float d[3])
{
  float length = 0;
  for (int a = 0; a < 3; a++) {
    const float to = (i & 1 ? bound : 1) * (2 * sf_random_float(31, (uint64_t)a, i) - 1);
    const float far = kind == 1 ? fminf(30, 60 / bound) : kind == 0 ? (i & 2 ? 0.9f : 1 / bound) : 2;
    o[a] = far * bound * (2 * sf_random_float(32, (uint64_t)a, i) - 1);
    d[a] = to - o[a];
  }
  const int axis = (int)(i / 24 % 3);
  const float face = (i / 216 & 1 ? -1 : 1) * ldexpf(1, (int)(i / 72 % 3));
  for (int a = 0; a < 3; a++) {
    if (kind == 2 && a != axis) d[a] = 0, o[a] *= 0.4f;
    if (kind == 3 && a == axis) d[a] = 0, o[a] = face;
    if (kind == 4 && a != axis) d[a] = 0, o[a] = a == (axis + 1) % 3 ? face : -face;
    length += d[a] * d[a];
  }
  for (int a = 0; a < 3; a++) d[a] /= sqrtf(length);
}

/* The bit of a position in [0,1)^3: the finest cascade [-2^c, 2^c) that holds it, at least `least`. */
static inline size_t direct_bit(const sf_config *c, int least, const float x[3])
{
  for (int cascade = least;; cascade++) {
    const double half = ldexp(1, cascade);
    size_t place[3];
    bool in = true;
    for (int a = 0; a < 3; a++) {
      const double p = ((double)x[a] - 0.5) * 2 * c->bound;
      in = in && p >= -half && p < half;
      place[a] = in ? (size_t)floor((p / half + 1) / 2 * c->occ_res) : 0;
    }
    const size_t res = (size_t)c->occ_res;
    if (in) return (((size_t)cascade * res + place[2]) * res + place[1]) * res + place[0];
  }
}

static inline void scatter(sf_model *m, uint64_t trial)
{
  const size_t bytes = sf_config_cells(&m->config) / 8;
  for (size_t i = 0; i < bytes; i++)
    m->occupancy[i] = (uint8_t)(sf_random_u64(3, trial, i) & sf_random_u64(4, trial, i) & sf_random_u64(5, trial, i));
}

/* Of the blocks of 8 x 8 x 8 cells some three in four become empty. */
static inline void empty_blocks(sf_model *m, uint64_t trial)
{
  const size_t res = (size_t)m->config.occ_res, blocks = res / 8, bytes = sf_config_cells(&m->config) / 8;
  for (size_t i = 0; i < bytes; i++) {
    const size_t x = i % blocks, y = i / blocks % res / 8, z = i / blocks / res / 8;
    if (sf_random_u64(6, trial, (z * blocks + y) * blocks + x) % 4) m->occupancy[i] = 0;
  }
}

#endif
