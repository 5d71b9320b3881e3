/* Exact ray intersections, in each shape's own axes. */
#include "src/scene/stage.h"
#include "src/scene/vec.h"
#include <math.h>

void sf_shape_place(sf_shape *shape, sf_shape_kind kind, const double centre[3], const double size[3], double yaw,
                    double tilt)
{
  double cy = cos(yaw), sy = sin(yaw), ct = cos(tilt), st = sin(tilt);
  const double axes[9] = {cy, sy, 0, -sy * ct, cy * ct, st, sy * st, -cy * st, ct};
  shape->kind = kind;
  for (int i = 0; i < 3; i++) shape->centre[i] = centre[i], shape->size[i] = size[i];
  for (int i = 0; i < 9; i++) shape->axes[i] = axes[i];
  switch (kind) {
  case SF_SPHERE:
    shape->bound = size[0];
    break;
  case SF_BOX:
    shape->bound = sqrt(vec_dot(size, size));
    break;
  case SF_CYLINDER:
    shape->bound = hypot(size[0], size[1]);
    break;
  case SF_TORUS:
    shape->bound = size[0] + size[1];
    break;
  }
}

bool sf_shape_near(const sf_shape *shape, const sf_stage_ray *ray, double spread)
{
  double to[3];
  for (int i = 0; i < 3; i++) to[i] = shape->centre[i] - ray->origin[i];
  double along = vec_dot(to, ray->direction), away2 = vec_dot(to, to) - along * along;
  double reach = shape->bound + spread * (fmax(along, 0) + shape->bound);
  return along > -shape->bound && away2 <= reach * reach;
}

/* ---- in local axes: o + t d, candidate roots are offered in increasing t ---- */

typedef struct local_ray {
  double o[3], d[3];
  double near, far; /* accepted: near < t < far */
} local_ray;

static bool accepts(const local_ray *ray, double t)
{
  return t > ray->near && t < ray->far;
}

static double point(const local_ray *ray, double t, double p[3])
{
  for (int i = 0; i < 3; i++) p[i] = ray->o[i] + t * ray->d[i];
  return t;
}

static bool sphere_span(const local_ray *ray, double radius, double *enter, double *leave)
{
  double b = vec_dot(ray->o, ray->d), c = vec_dot(ray->o, ray->o) - radius * radius, disc = b * b - c;
  if (disc <= 0) return false;
  double root = sqrt(disc);
  *enter = -b - root, *leave = -b + root;
  return true;
}

static bool box_span(const local_ray *ray, const double half[3], double *enter, double *leave, int *enter_axis,
                     int *leave_axis)
{
  *enter = -INFINITY, *leave = INFINITY;
  *enter_axis = *leave_axis = 0;
  for (int i = 0; i < 3; i++) {
    if (fabs(ray->d[i]) < 1e-14) {
      if (fabs(ray->o[i]) > half[i]) return false;
      continue;
    }
    double a = (-half[i] - ray->o[i]) / ray->d[i], b = (half[i] - ray->o[i]) / ray->d[i];
    if (fmin(a, b) > *enter) *enter = fmin(a, b), *enter_axis = i;
    if (fmax(a, b) < *leave) *leave = fmax(a, b), *leave_axis = i;
  }
  return *enter < *leave;
}

static bool hit_sphere(const local_ray *ray, const double size[3], double *t, double normal[3])
{
  double enter, leave;
  if (!sphere_span(ray, size[0], &enter, &leave)) return false;
  if (!accepts(ray, *t = enter) && !accepts(ray, *t = leave)) return false;
  point(ray, *t, normal);
  for (int i = 0; i < 3; i++) normal[i] /= size[0];
  return true;
}

static bool hit_box(const local_ray *ray, const double size[3], double *t, double normal[3])
{
  double enter, leave, p[3];
  int first, last;
  if (!box_span(ray, size, &enter, &leave, &first, &last)) return false;
  int axis = first;
  if (!accepts(ray, *t = enter)) {
    axis = last;
    if (!accepts(ray, *t = leave)) return false;
  }
  point(ray, *t, p);
  normal[0] = normal[1] = normal[2] = 0;
  normal[axis] = p[axis] > 0 ? 1 : -1;
  return true;
}

/* The cylinder is the common part of an endless tube and a slab: its span is the common span. */
static bool hit_cylinder(const local_ray *ray, const double size[3], double *t, double normal[3])
{
  const double *o = ray->o, *d = ray->d;
  double enter = -INFINITY, leave = INFINITY;
  bool enter_cap = false, leave_cap = false;
  double a = d[0] * d[0] + d[1] * d[1], b = o[0] * d[0] + o[1] * d[1];
  double c = o[0] * o[0] + o[1] * o[1] - size[0] * size[0];
  if (a > 1e-20) {
    double disc = b * b - a * c;
    if (disc <= 0) return false;
    enter = (-b - sqrt(disc)) / a, leave = (-b + sqrt(disc)) / a;
  } else if (c > 0) {
    return false;
  }
  if (fabs(d[2]) > 1e-14) {
    double low = (-size[1] - o[2]) / d[2], high = (size[1] - o[2]) / d[2];
    if (fmin(low, high) > enter) enter = fmin(low, high), enter_cap = true;
    if (fmax(low, high) < leave) leave = fmax(low, high), leave_cap = true;
  } else if (fabs(o[2]) > size[1]) {
    return false;
  }
  if (enter >= leave) return false;
  bool cap = enter_cap;
  if (!accepts(ray, *t = enter)) {
    cap = leave_cap;
    if (!accepts(ray, *t = leave)) return false;
  }
  double p[3];
  point(ray, *t, p);
  normal[0] = cap ? 0 : p[0] / size[0], normal[1] = cap ? 0 : p[1] / size[0];
  normal[2] = !cap ? 0 : p[2] > 0 ? 1 : -1;
  return true;
}

/* ---- torus: the smallest root of a quartic ---- */

static double evaluate(const double *c, int degree, double x)
{
  double y = c[degree];
  for (int i = degree - 1; i >= 0; i--) y = y * x + c[i];
  return y;
}

/* A root between a and b, where the polynomial changes sign: bisection sped up by Newton steps that stay inside. */
static double bracketed_root(const double *c, const double *derivative, int degree, double a, double b)
{
  bool rising = evaluate(c, degree, a) < 0;
  double x = (a + b) / 2;
  for (int i = 0; i < 100 && b - a > 1e-13; i++) {
    double y = evaluate(c, degree, x);
    if (y == 0) return x;
    if ((y < 0) == rising)
      a = x;
    else
      b = x;
    double next = x - y / evaluate(derivative, degree - 1, x);
    if (!(next > a && next < b))
      next = (a + b) / 2;
    else if (fabs(next - x) < 1e-14)
      return next;
    x = next;
  }
  return x;
}

/* Roots in [a, b] in increasing order, at most `degree`: between two neighbouring extrema there is at most one. */
static int roots(const double *c, int degree, double a, double b, double *root)
{
  if (degree == 1) {
    root[0] = -c[0] / c[1];
    return c[1] != 0 && root[0] >= a && root[0] <= b;
  }
  double derivative[4], extremum[3];
  for (int i = 1; i <= degree; i++) derivative[i - 1] = i * c[i];
  int n = roots(derivative, degree - 1, a, b, extremum), found = 0;
  for (int i = 0; i <= n; i++) {
    double from = i ? extremum[i - 1] : a, to = i < n ? extremum[i] : b;
    double at_from = evaluate(c, degree, from), at_to = evaluate(c, degree, to);
    if ((at_from < 0) != (at_to < 0)) root[found++] = bracketed_root(c, derivative, degree, from, to);
  }
  return found;
}

/* The part of the ray that can touch the ring: inside the bounding sphere, inside the slab |z| <= tube radius, and
 * not all within the hole. */
static bool torus_span(const local_ray *ray, const double size[3], double *enter, double *leave)
{
  const double *o = ray->o, *d = ray->d;
  double from[3], to[3], hole = size[0] - size[1];
  if (!sphere_span(ray, size[0] + size[1], enter, leave)) return false;
  if (fabs(d[2]) > 1e-14) {
    double low = (-size[1] - o[2]) / d[2], high = (size[1] - o[2]) / d[2];
    *enter = fmax(*enter, fmin(low, high)), *leave = fmin(*leave, fmax(low, high));
  } else if (fabs(o[2]) >= size[1]) {
    return false;
  }
  if (fmax(*enter, ray->near) >= fmin(*leave, ray->far)) return false;
  /* The distance from the axis is convex along the ray: its largest value is at an end. */
  point(ray, *enter, from), point(ray, *leave, to);
  return fmax(from[0] * from[0] + from[1] * from[1], to[0] * to[0] + to[1] * to[1]) > hole * hole;
}

static bool hit_torus(const local_ray *ray, const double size[3], double *t, double normal[3])
{
  double enter, leave, r2 = size[0] * size[0], p[3];
  if (!torus_span(ray, size, &enter, &leave)) return false;
  /* (|p|^2 + R^2 - r^2)^2 = 4 R^2 (x^2 + y^2), from the middle of the span: small numbers, little cancellation. */
  double middle = (enter + leave) / 2;
  point(ray, middle, p);
  const double *d = ray->d;
  double b = vec_dot(p, d), k = vec_dot(p, p) + r2 - size[1] * size[1];
  double c[5] = {k * k - 4 * r2 * (p[0] * p[0] + p[1] * p[1]), 4 * b * k - 8 * r2 * (p[0] * d[0] + p[1] * d[1]),
                 4 * b * b + 2 * k - 4 * r2 * (d[0] * d[0] + d[1] * d[1]), 4 * b, 1};
  double root[4];
  int n = roots(c, 4, enter - middle - 1e-9, leave - middle + 1e-9, root);
  for (int i = 0; i < n; i++) {
    if (!accepts(ray, *t = root[i] + middle)) continue;
    point(ray, *t, p);
    double ring = hypot(p[0], p[1]);
    if (ring == 0) continue;
    for (int j = 0; j < 3; j++) normal[j] = (p[j] - (j < 2 ? p[j] * size[0] / ring : 0)) / size[1];
    return true;
  }
  return false;
}

static void to_local(const sf_shape *shape, const sf_stage_ray *ray, local_ray *local)
{
  double from[3];
  for (int i = 0; i < 3; i++) from[i] = ray->origin[i] - shape->centre[i];
  for (int i = 0; i < 3; i++) {
    local->o[i] = vec_dot(shape->axes + 3 * i, from);
    local->d[i] = vec_dot(shape->axes + 3 * i, ray->direction);
  }
}

bool sf_shape_hit(const sf_shape *shape, const sf_stage_ray *ray, double near, sf_hit *hit)
{
  local_ray local = {.near = near, .far = hit->t};
  double t = 0, normal[3];
  bool found = false;
  to_local(shape, ray, &local);
  switch (shape->kind) {
  case SF_SPHERE:
    found = hit_sphere(&local, shape->size, &t, normal);
    break;
  case SF_BOX:
    found = hit_box(&local, shape->size, &t, normal);
    break;
  case SF_CYLINDER:
    found = hit_cylinder(&local, shape->size, &t, normal);
    break;
  case SF_TORUS:
    found = hit_torus(&local, shape->size, &t, normal);
    break;
  }
  if (!found) return false;
  hit->t = point(&local, t, hit->local);
  for (int i = 0; i < 3; i++)
    hit->normal[i] = shape->axes[i] * normal[0] + shape->axes[3 + i] * normal[1] + shape->axes[6 + i] * normal[2];
  return true;
}

bool sf_shape_interval(const sf_shape *shape, const sf_stage_ray *ray, double *enter, double *leave)
{
  local_ray local;
  int first, last;
  to_local(shape, ray, &local);
  if (shape->kind == SF_SPHERE) return sphere_span(&local, shape->size[0], enter, leave);
  return box_span(&local, shape->size, enter, leave, &first, &last);
}
