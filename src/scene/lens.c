#include "src/scene/lens.h"
#include <math.h>

bool sf_lens_bends(const sf_camera *camera)
{
  return camera->k1 != 0 || camera->k2 != 0 || camera->p1 != 0 || camera->p2 != 0;
}

/* jacobian: d x / d x, d x / d y = d y / d x, d y / d y. */
static void bend(const sf_camera *c, const double s[2], double bent[2], double jacobian[3])
{
  const double k1 = c->k1, k2 = c->k2, p1 = c->p1, p2 = c->p2, x = s[0], y = s[1], r2 = x * x + y * y;
  const double gain = 1 + r2 * (k1 + r2 * k2), slope = 2 * k1 + 4 * k2 * r2;
  bent[0] = x * gain + 2 * p1 * x * y + p2 * (r2 + 2 * x * x);
  bent[1] = y * gain + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
  jacobian[0] = gain + x * x * slope + 2 * p1 * y + 6 * p2 * x;
  jacobian[1] = x * y * slope + 2 * p1 * x + 2 * p2 * y;
  jacobian[2] = gain + y * y * slope + 6 * p1 * y + 2 * p2 * x;
}

void sf_lens_bend(const sf_camera *camera, const double straight[2], double bent[2])
{
  double jacobian[3];
  bend(camera, straight, bent, jacobian);
}

void sf_lens_straighten(const sf_camera *camera, const double bent[2], double straight[2])
{
  straight[0] = bent[0], straight[1] = bent[1];
  for (int i = 0; i < 20; i++) {
    double at[2], j[3];
    bend(camera, straight, at, j);
    const double dx = bent[0] - at[0], dy = bent[1] - at[1], det = j[0] * j[2] - j[1] * j[1];
    if (!(fabs(det) > 1e-9)) return;
    straight[0] += (j[2] * dx - j[1] * dy) / det, straight[1] += (j[0] * dy - j[1] * dx) / det;
    if (dx * dx + dy * dy < 1e-24) return;
  }
}

/* Found again, and not folded anywhere on the way from the centre. */
static bool has_one_ray(const sf_camera *camera, double px, double py)
{
  const double bent[2] = {(px - camera->cx) / camera->fx, (py - camera->cy) / camera->fy};
  double straight[2], again[2], j[3];
  sf_lens_straighten(camera, bent, straight);
  sf_lens_bend(camera, straight, again);
  if (!(hypot((again[0] - bent[0]) * camera->fx, (again[1] - bent[1]) * camera->fy) < 1e-4)) return false;
  for (int i = 0; i <= 16; i++) {
    bend(camera, (double[2]){straight[0] * i / 16, straight[1] * i / 16}, again, j);
    if (!(j[0] + j[2] > 0 && j[0] * j[2] - j[1] * j[1] > 0)) return false;
  }
  return true;
}

sf_status sf_lens_check(const sf_camera *camera, const char *where)
{
  enum { STEPS = 16 };
  if (!sf_lens_bends(camera)) return sf_ok();
  for (int i = 0; i < (STEPS + 1) * (STEPS + 1); i++) {
    const double px = (double)camera->width * (i % (STEPS + 1)) / STEPS;
    const double py = (double)camera->height * (i / (STEPS + 1)) / STEPS;
    if (!has_one_ray(camera, px, py))
      return sf_fail(SF_E_RANGE, "%s: the lens (k1 %g, k2 %g, p1 %g, p2 %g) cannot be undone at pixel (%g, %g)", where,
                     (double)camera->k1, (double)camera->k2, (double)camera->p1, (double)camera->p2, px, py);
  }
  return sf_ok();
}
