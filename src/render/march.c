#include "render/march.h"
#include <math.h>

static const float near_plane = 0.2f; /* torch-ngp's min_near */

sf_lattice sf_ray_lattice(const sf_config *config, const float origin[3], const float direction[3])
{
  float enter = near_plane, leave = INFINITY;
  for (int a = 0; a < 3; a++) {
    if (direction[a] == 0) {
      if (fabsf(origin[a]) >= 1) return (sf_lattice){0};
      continue;
    }
    float t0 = (-1 - origin[a]) / direction[a], t1 = (1 - origin[a]) / direction[a];
    enter = fmaxf(enter, fminf(t0, t1));
    leave = fminf(leave, fmaxf(t0, t1));
  }
  sf_lattice lattice = {.step = 2 * 1.7320508f / (float)config->lattice};
  if (!(leave > enter)) return lattice;
  lattice.first = enter + lattice.step / 2;
  /* The box holds no more, but far from it the distances have no precision left. */
  lattice.count = (int32_t)fminf(floorf((leave - enter) / lattice.step), (float)config->lattice);
  return lattice;
}

sf_march sf_march_begin(const sf_model *model, const float origin[3], const float direction[3], int stride,
                        float jitter)
{
  sf_march m = {.occupancy = model->occupancy, .res = model->config.occ_res};
  for (int a = 0; a < 3; a++) {
    m.origin[a] = origin[a];
    m.direction[a] = direction[a];
  }
  m.lattice = sf_ray_lattice(&model->config, origin, direction);
  m.lattice.first -= m.lattice.step / 2;
  m.lattice.count /= stride;
  m.lattice.step *= (float)stride;
  m.lattice.first += m.lattice.step * jitter;
  return m;
}

void sf_march_at(const sf_march *m, int n, float x[3])
{
  const float t = sf_march_distance(m, n);
  for (int a = 0; a < 3; a++) {
    const float at = (m->origin[a] + t * m->direction[a]) * 0.5f + 0.5f; /* fminf would be a call */
    x[a] = !(at > 0) ? 0 : at > 0x1.fffffep-1f ? 0x1.fffffep-1f : at;
  }
}

int sf_march_next(const sf_march *m, int n, float x[3])
{
  const float res = (float)m->res;
  while (n < m->lattice.count) {
    int cell[3];
    sf_march_at(m, n, x);
    for (int a = 0; a < 3; a++) cell[a] = (int)(x[a] * res);
    const size_t bit = ((size_t)cell[2] * m->res + cell[1]) * m->res + cell[0];
    if (m->occupancy[bit / 8] >> (bit % 8) & 1) return n;
    float ahead = INFINITY; /* distance to the cell's exit */
    for (int a = 0; a < 3; a++) {
      if (m->direction[a] == 0) continue;
      float face = (float)(cell[a] + (m->direction[a] > 0)) / res;
      const float exit = (face - x[a]) * 2 / m->direction[a];
      ahead = exit < ahead ? exit : ahead;
    }
    int skip = (int)ceilf((ahead < 4 ? ahead : 4) / m->lattice.step - 1e-3f);
    n += skip > 1 ? skip : 1;
  }
  return -1;
}
