/* Where the scene lies: from the coordinates of a layout into the box of the models. docs/data.md gives the reasons. */
#include "src/scene/capture.h"
#include "src/scene/vec.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define BLENDER_SCALE 0.8 /* torch-ngp */
#define ORBIT 1.32        /* mean distance of cameras from what they look at: 4 * 0.33, instant-ngp's and torch-ngp's */
#define NEAR_FACTOR 0.75  /* of the nearest depth: NeRF's bd_factor */
#define SPREAD_MAX 1000.0 /* nearest depths from the mean position: farther off, NDC leaves the range of floats */
enum { BOUND_MAX = 16 };

/* world = scale * turn * (p - centre) */
typedef struct move {
  double turn[9], centre[3], scale;
} move;
static const move stay = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0}, 1};

static void apply(const move *m, const double p[3], double out[3])
{
  double d[3];
  for (int i = 0; i < 3; i++) d[i] = p[i] - m->centre[i];
  for (int i = 0; i < 3; i++) out[i] = m->scale * vec_dot(m->turn + 3 * i, d);
}

static void move_all(sf_dataset *data, sf_capture *c, const move *m)
{
  for (int i = 0; i < 3; i++) {
    for (int k = 0; k < 3; k++) data->world[4 * i + k] = m->scale * m->turn[3 * i + k];
    data->world[4 * i + 3] = 0 - m->scale * vec_dot(m->turn + 3 * i, m->centre);
  }
  if (!memcmp(m, &stay, sizeof stay)) return;
  for (int f = 0; f < c->count; f++) {
    double *pose = c->frame[f].to_world, column[3], turned[3];
    const move rotation = {.turn = {m->turn[0], m->turn[1], m->turn[2], m->turn[3], m->turn[4], m->turn[5], m->turn[6],
                                    m->turn[7], m->turn[8]},
                           .scale = 1};
    for (int k = 0; k < 4; k++) {
      for (int i = 0; i < 3; i++) column[i] = pose[4 * i + k];
      apply(k < 3 ? &rotation : m, column, turned);
      for (int i = 0; i < 3; i++) pose[4 * i + k] = turned[i];
    }
  }
  for (int i = 0; i < c->points; i++) apply(m, c->point[i], c->point[i]);
}

/* ---- what the poses have in common ---- */

static void column(const sf_frame *frame, int k, double out[3])
{
  for (int i = 0; i < 3; i++) out[i] = frame->to_world[4 * i + k];
}

static void mean_column(const sf_capture *c, int k, double out[3])
{
  const int n = sf_capture_guides(c);
  memset(out, 0, 3 * sizeof *out);
  for (int f = 0; f < n; f++)
    for (int i = 0; i < 3; i++) out[i] += c->frame[f].to_world[4 * i + k] / n;
}

/* The picture at distance 1: its middle from the optical axis, x right, y up, and half its width and height. */
typedef struct extent {
  double middle[2], half[2];
} extent;

static extent view_extent(const sf_lens *lens, const sf_sight *sight)
{
  extent e;
  double w = lens->width > 0 ? lens->width : sight->width, h = lens->height > 0 ? lens->height : sight->height;
  if (lens->width > 0 && !(lens->height > 0) && sight->width) h *= w / sight->width;
  if (lens->height > 0 && !(lens->width > 0) && sight->height) w *= h / sight->height;
  double *half = e.half;
  half[0] = lens->fl_x > 0 ? 0.5 * w / lens->fl_x : tan(0.5 * lens->angle_x);
  half[1] = lens->fl_y > 0 ? 0.5 * h / lens->fl_y : half[0];
  if (lens->fl_y <= 0 && w > 0 && h > 0) half[1] *= h / w;
  for (int i = 0; i < 2; i++)
    if (!(half[i] > 0)) half[i] = 1; /* a size that nobody states: anything up to 45 degrees may be seen */
  e.middle[0] = lens->has_cx && w > 0 ? half[0] * (1 - 2 * lens->cx / w) : 0;
  e.middle[1] = lens->has_cy && h > 0 ? half[1] * (2 * lens->cy / h - 1) : 0;
  return e;
}

/* Through the picture at x, y, each -1..1, not of unit length. */
static void picture_ray(const sf_frame *frame, const extent *e, double x, double y, double direction[3])
{
  const double *m = frame->to_world, right = e->middle[0] + x * e->half[0], up = e->middle[1] + y * e->half[1];
  for (int i = 0; i < 3; i++) direction[i] = m[4 * i] * right + m[4 * i + 1] * up - m[4 * i + 2];
}

/* Of the ray through the picture's middle; 1 on the optical axis. */
static double middle_length(const extent *e)
{
  return sqrt(1 + e->middle[0] * e->middle[0] + e->middle[1] * e->middle[1]);
}

static bool looks_ahead(const sf_frame *frame, const double back[3])
{
  const double half_turn = 0.7071067811865476; /* at most 45 degrees off the mean direction */
  double axis[3], direction[3];
  extent e;
  column(frame, 2, axis);
  if (!(vec_dot(axis, back) > half_turn)) return false;
  e = view_extent(&frame->lens, &(sf_sight){0});
  for (int k = 0; k < 4; k++) {
    picture_ray(frame, &e, k & 1 ? 1 : -1, k & 2 ? 1 : -1, direction);
    if (!(vec_dot(direction, back) < -0.05 * vec_length(direction))) return false;
  }
  return true;
}

bool sf_forward_facing(const sf_capture *capture)
{
  double back[3], up[3], right[3], middle[3], at[3];
  mean_column(capture, 1, up);
  mean_column(capture, 2, back);
  mean_column(capture, 3, middle);
  vec_cross(up, back, right);
  if (!(vec_length(back) > 0.5 && vec_length(right) > 0.1)) return false;
  vec_normalise(back);
  for (int f = 0; f < capture->count; f++) {
    if (!looks_ahead(&capture->frame[f], back)) return false;
    column(&capture->frame[f], 3, at);
    for (int i = 0; i < 3; i++) at[i] -= middle[i];
    if (!(-vec_dot(at, back) < NEAR_FACTOR * capture->near)) return false;
    if (!(vec_length(at) < SPREAD_MAX * capture->near)) return false;
  }
  return true;
}

/* The point nearest to the middle rays of all pictures, held to the mean position where they are parallel. */
static void look_at(const sf_capture *c, const sf_sight *sight, double point[3])
{
  const int n = sf_capture_guides(c);
  const double hold = 1e-3 * n;
  double a[9] = {hold, 0, 0, 0, hold, 0, 0, 0, hold}, b[3];
  mean_column(c, 3, b);
  for (int i = 0; i < 3; i++) b[i] *= hold;
  for (int f = 0; f < n; f++) {
    double axis[3], at[3];
    extent e;
    e = view_extent(&c->frame[f].lens, sight);
    picture_ray(&c->frame[f], &e, 0, 0, axis);
    column(&c->frame[f], 3, at);
    for (int i = 0; i < 3; i++) axis[i] /= middle_length(&e);
    const double along = vec_dot(axis, at);
    for (int i = 0; i < 3; i++) {
      b[i] += at[i] - axis[i] * along;
      for (int k = 0; k < 3; k++) a[3 * i + k] += (i == k) - axis[i] * axis[k];
    }
  }
  vec_solve(a, b, point);
}

/* The turn that lays the mean up direction on z; none where the cameras have no common one. */
static void turn_up(const sf_capture *c, double turn[9])
{
  double up[3], x[3] = {1, 0, 0}, y[3];
  mean_column(c, 1, up);
  memcpy(turn, stay.turn, sizeof stay.turn);
  if (!(vec_length(up) > 0.1)) return;
  vec_normalise(up);
  if (fabs(up[0]) > 0.9) x[0] = 0, x[1] = 1;
  const double along = vec_dot(x, up);
  for (int i = 0; i < 3; i++) x[i] -= along * up[i];
  vec_normalise(x);
  vec_cross(up, x, y);
  memcpy(turn, x, sizeof x), memcpy(turn + 3, y, sizeof y), memcpy(turn + 6, up, sizeof up);
}

/* ---- the ways to place ---- */

static void set_scale(sf_dataset *data, const sf_dataset_options *options, double own)
{
  data->own_scale = (float)own;
  data->scale = options->scale > 0 ? options->scale : data->own_scale;
}

/* NeRF's recentring, its scale and its NDC: what every view sees lies in [-1, 1]^3. */
static void place_ndc(sf_dataset *data, sf_capture *c, const sf_dataset_options *options)
{
  move m = {.scale = 1 / (NEAR_FACTOR * c->near)};
  double back[3], up[3], right[3], most = 1;
  extent e;
  mean_column(c, 2, back), mean_column(c, 1, up), mean_column(c, 3, m.centre);
  vec_normalise(back);
  vec_cross(up, back, right);
  vec_normalise(right);
  vec_cross(back, right, up);
  memcpy(m.turn, right, sizeof right), memcpy(m.turn + 3, up, sizeof up), memcpy(m.turn + 6, back, sizeof back);
  move_all(data, c, &m);
  e = view_extent(&c->frame[0].lens, &(sf_sight){0});
  data->ndc = true, data->ndc_near = 1;
  for (int i = 0; i < 2; i++) data->ndc_focal[i] = (float)(1 / e.half[i]);
  for (int n = 0; n < 4 * c->count; n++) {
    const sf_frame *frame = &c->frame[n / 4];
    double d[3], at[3];
    e = view_extent(&frame->lens, &(sf_sight){0});
    picture_ray(frame, &e, n & 1 ? 1 : -1, n & 2 ? 1 : -1, d);
    column(frame, 3, at);
    const double t = (1 + at[2]) / -d[2];
    for (int i = 0; i < 2; i++) {
      most = fmax(most, (double)data->ndc_focal[i] * fabs(at[i] + t * d[i]));
      most = fmax(most, (double)data->ndc_focal[i] * fabs(d[i] / d[2]));
    }
  }
  set_scale(data, options, 1 / most);
}

/* instant-ngp's own words: the middle of its unit cube is the origin, its box the scene box. */
static void place_cube(sf_dataset *data, sf_capture *c, const sf_dataset_options *options)
{
  const double grow = c->aabb_scale > 1 ? 1 : 2; /* torch-ngp's units: the unit cube is [-0.5, 0.5]^3 in the box */
  data->bound = c->aabb_scale > 1 ? c->aabb_scale / 2 : 1;
  set_scale(data, options, grow * c->box_scale);
  for (int i = 0; i < 3; i++) data->offset[i] = (float)(data->scale / c->box_scale * (c->box_offset[i] - 0.5));
  move_all(data, c, &stay);
}

/* The smallest power of two whose box holds nearly all of what is known. */
static int32_t find_bound(const sf_capture *c, double scale, double farthest)
{
  const double most = 0.97;
  int32_t bound = 2;
  if (!c->points) {
    while (bound < BOUND_MAX && bound < 4 * farthest * scale) bound *= 2;
    return bound;
  }
  for (bound = 1; bound < BOUND_MAX; bound *= 2) {
    int inside = 0;
    for (int n = 0; n < c->points; n++) {
      const double *p = c->point[n];
      inside += fmax(fmax(fabs(p[0]), fabs(p[1])), fabs(p[2])) * scale <= bound;
    }
    if (inside >= most * c->points) break;
  }
  return bound;
}

/* Cameras about a scene: it stands at the point they look at. */
static sf_status place_orbit(sf_dataset *data, sf_capture *c, const sf_dataset_options *options, const sf_sight *sight)
{
  move m = stay;
  const int n = sf_capture_guides(c);
  double *reach = malloc((size_t)n * sizeof *reach), mean = 0, farthest = 0;
  if (!reach) return sf_fail(SF_E_MEMORY, "%s: no memory for %d views", c->list, n);
  look_at(c, sight, m.centre);
  turn_up(c, m.turn);
  move_all(data, c, &m);
  for (int f = 0; f < n; f++) {
    double at[3];
    extent e;
    column(&c->frame[f], 3, at);
    e = view_extent(&c->frame[f].lens, sight);
    const double distance = vec_length(at);
    mean += distance / n, farthest = fmax(farthest, distance);
    reach[f] = distance / middle_length(&e) * fmin(e.half[0], e.half[1]);
  }
  qsort(reach, (size_t)n, sizeof *reach, sf_ascending);
  /* An object on nothing fills the box as far as the middle one of its views sees it. */
  double scale = sight->transparent ? 1 / reach[n / 2] : ORBIT / mean;
  if (!(scale < 1e9) || !(scale > 1e-9)) scale = 1; /* all from one point */
  set_scale(data, options, scale);
  data->bound = sight->transparent ? 1 : find_bound(c, (double)data->scale, farthest);
  free(reach);
  return sf_ok();
}

/* ---- whether it is seen ---- */

/* Slabs; a ray that starts inside hits. */
static bool hits_box(const double o[3], const double d[3], double bound)
{
  double enter = 0, leave = INFINITY;
  for (int i = 0; i < 3; i++) {
    const double t0 = (-bound - o[i]) / d[i], t1 = (bound - o[i]) / d[i];
    if (d[i] == 0 && fabs(o[i]) > bound) return false;
    if (d[i] == 0) continue;
    enter = fmax(enter, fmin(t0, t1)), leave = fmin(leave, fmax(t0, t1));
  }
  return enter < leave;
}

static void model_position(const sf_dataset *data, const sf_frame *frame, double at[3])
{
  for (int i = 0; i < 3; i++) at[i] = frame->to_world[4 * i + 3] * (double)data->scale + (double)data->offset[i];
}

static bool turns_back(const sf_dataset *data, const sf_frame *frame)
{
  double at[3], back[3];
  model_position(data, frame, at);
  column(frame, 2, back);
  return vec_dot(at, back) < 0;
}

static bool sees_box(const sf_dataset *data, const sf_frame *frame, const sf_sight *sight)
{
  double at[3], d[3];
  extent e;
  e = view_extent(&frame->lens, sight);
  model_position(data, frame, at);
  for (int n = 0; n < 81; n++) {
    picture_ray(frame, &e, n % 9 / 4.0 - 1, n / 9 / 4.0 - 1, d);
    if (hits_box(at, d, data->bound)) return true;
  }
  return false;
}

sf_status sf_check_sight(sf_dataset *data, const sf_capture *c, const sf_sight *sight)
{
  const int n = c->count - c->first;
  int away = 0, back = 0, first = 0;
  if (data->ndc) return sf_ok();
  for (int f = c->first; f < c->count; f++) back += turns_back(data, &c->frame[f]);
  const bool inward = 4 * back < n; /* cameras about the scene, not amid it: one that turns its back is wrong */
  for (int f = c->count - 1; f >= c->first; f--)
    if (!sees_box(data, &c->frame[f], sight) || (inward && turns_back(data, &c->frame[f]))) away++, first = f;
  if (away == n)
    return sf_fail(SF_E_RANGE, "%s: no view looks at the scene: none of %d sees the box [-%d, %d]^3 at scale %g",
                   c->list, n, data->bound, data->bound, (double)data->scale);
  if (!inward)
    SF_TRY(sf_warn(data, "%s: %d of %d cameras turn their backs to the middle of the scene: are the axes OpenCV's?",
                   c->list, back, n));
  if (!away) return sf_ok();
  return sf_warn(data, "%s: %d of %d views do not look at the scene, the first is %s", c->list, away, n,
                 c->frame[first].file_path);
}

static sf_status keep_points(sf_dataset *data, const sf_capture *c)
{
  if (!c->points) return sf_ok();
  data->point = malloc((size_t)c->points * 3 * sizeof *data->point);
  if (!data->point) return sf_fail(SF_E_MEMORY, "%s: no memory for %d points", c->list, c->points);
  data->points = c->points;
  for (int n = 0; n < c->points; n++)
    for (int i = 0; i < 3; i++)
      data->point[3 * n + i] = (float)(c->point[n][i] * (double)data->scale) + data->offset[i];
  return sf_ok();
}

/* Left-handed axes show a scene that is not the pictures': a sign is wrong in what wrote them. */
static sf_status warn_mirrored(sf_dataset *data, const sf_capture *c)
{
  int mirrored = 0, first = 0;
  for (int f = c->count - 1; f >= c->first; f--) {
    double right[3], up[3], back[3], out[3];
    column(&c->frame[f], 0, right), column(&c->frame[f], 1, up), column(&c->frame[f], 2, back);
    vec_cross(right, up, out);
    if (vec_dot(out, back) < 0) mirrored++, first = f;
  }
  if (!mirrored) return sf_ok();
  return sf_warn(data,
                 "%s: %d of %d poses are mirrored (determinant -1), the first is %s: are x, y and z right, up, back?",
                 c->list, mirrored, c->count - c->first, c->frame[first].file_path);
}

sf_status sf_place(sf_dataset *data, sf_capture *capture, const sf_dataset_options *options, const sf_sight *sight)
{
  data->layout = capture->layout, data->bound = 1;
  SF_TRY(warn_mirrored(data, capture));
  if (capture->layout == SF_LAYOUT_LLFF && sf_forward_facing(capture)) {
    place_ndc(data, capture, options);
    return sf_ok();
  }
  if (capture->layout == SF_LAYOUT_BLENDER) {
    set_scale(data, options, BLENDER_SCALE);
    move_all(data, capture, &stay);
  } else if (capture->placed) {
    place_cube(data, capture, options);
  } else {
    SF_TRY(place_orbit(data, capture, options, sight));
  }
  return keep_points(data, capture);
}
