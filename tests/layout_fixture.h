/* Writers of the layouts that the readers of src/scene take, for tests and for the seeds of fuzzing. A rig of cameras
 * goes in; what is written is made from the formats' own pages, not from the readers. */
#ifndef SF_TESTS_LAYOUT_FIXTURE_H
#define SF_TESTS_LAYOUT_FIXTURE_H
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

enum { LAYOUT_VIEWS = 64, LAYOUT_BYTES = 1 << 16 };

typedef struct layout_lens {
  int id, model; /* COLMAP's number */
  const char *name;
  int width, height, params;
  double param[8];
} layout_lens;

typedef struct layout_view {
  char name[64];
  double to_world[12]; /* OpenGL axes */
  int lens;            /* id */
} layout_view;

typedef struct layout_rig {
  layout_lens lens[4];
  layout_view view[LAYOUT_VIEWS];
  double point[64][3];
  int lenses, views, points;
} layout_rig;

typedef struct layout_file {
  char bytes[LAYOUT_BYTES];
  size_t size;
} layout_file;

static inline void layout_put(layout_file *f, uint64_t value, int bytes)
{
  for (int i = 0; i < bytes && f->size < LAYOUT_BYTES; i++) f->bytes[f->size++] = (char)(value >> (8 * i));
}

static inline void layout_real(layout_file *f, double value)
{
  uint64_t bits;
  memcpy(&bits, &value, sizeof bits);
  layout_put(f, bits, 8);
}

static inline void layout_text(layout_file *f, const char *text)
{
  const size_t n = strlen(text);
  if (f->size + n > LAYOUT_BYTES) return;
  memcpy(f->bytes + f->size, text, n);
  f->size += n;
}

/* World to camera with OpenCV axes: q = w, x, y, z by Shepperd's method, t. */
static inline void layout_pose(const layout_view *view, double q[4], double t[3])
{
  double r[9], best = -1;
  int k = 0;
  for (int i = 0; i < 3; i++) {
    r[i] = view->to_world[4 * i], r[3 + i] = -view->to_world[4 * i + 1], r[6 + i] = -view->to_world[4 * i + 2];
  }
  for (int a = 0; a < 3; a++) {
    t[a] = 0;
    for (int i = 0; i < 3; i++) t[a] -= r[3 * a + i] * view->to_world[4 * i + 3];
  }
  const double square[4] = {1 + r[0] + r[4] + r[8], 1 + r[0] - r[4] - r[8], 1 - r[0] + r[4] - r[8],
                            1 - r[0] - r[4] + r[8]};
  for (int i = 0; i < 4; i++)
    if (square[i] > best) best = square[i], k = i;
  const double s = 2 * sqrt(best), all[4][4] = {{s * s / 4, r[7] - r[5], r[2] - r[6], r[3] - r[1]},
                                                {r[7] - r[5], s * s / 4, r[1] + r[3], r[2] + r[6]},
                                                {r[2] - r[6], r[1] + r[3], s * s / 4, r[5] + r[7]},
                                                {r[3] - r[1], r[2] + r[6], r[5] + r[7], s * s / 4}};
  for (int i = 0; i < 4; i++) q[i] = all[k][i] / s;
}

static inline void layout_cameras(layout_file *f, const layout_rig *rig, int text)
{
  char line[400];
  f->size = 0;
  if (text)
    layout_text(f, "# Camera list with one line of data per camera:\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n");
  if (!text) layout_put(f, (uint64_t)rig->lenses, 8);
  for (int i = 0; i < rig->lenses; i++) {
    const layout_lens *lens = &rig->lens[i];
    if (text) {
      int n = snprintf(line, sizeof line, "%d %s %d %d", lens->id, lens->name, lens->width, lens->height);
      for (int k = 0; k < lens->params; k++) n += snprintf(line + n, sizeof line - (size_t)n, " %.17g", lens->param[k]);
      layout_text(f, line), layout_text(f, "\n");
      continue;
    }
    layout_put(f, (uint64_t)lens->id, 4), layout_put(f, (uint64_t)lens->model, 4);
    layout_put(f, (uint64_t)lens->width, 8), layout_put(f, (uint64_t)lens->height, 8);
    for (int k = 0; k < lens->params; k++) layout_real(f, lens->param[k]);
  }
}

/* Each image has one point of its picture, the first none. */
static inline void layout_images(layout_file *f, const layout_rig *rig, int text)
{
  char line[600];
  f->size = 0;
  if (text) layout_text(f, "# Image list with two lines of data per image:\n");
  if (!text) layout_put(f, (uint64_t)rig->views, 8);
  for (int i = 0; i < rig->views; i++) {
    const layout_view *view = &rig->view[i];
    double q[4], t[3];
    layout_pose(view, q, t);
    if (text) {
      snprintf(line, sizeof line, "%d %.17g %.17g %.17g %.17g %.17g %.17g %.17g %d %s\n%s\n", i + 1, q[0], q[1], q[2],
               q[3], t[0], t[1], t[2], view->lens, view->name, i ? "1.5 2.5 -1" : "");
      layout_text(f, line);
      continue;
    }
    layout_put(f, (uint64_t)(i + 1), 4);
    for (int k = 0; k < 4; k++) layout_real(f, q[k]);
    for (int k = 0; k < 3; k++) layout_real(f, t[k]);
    layout_put(f, (uint64_t)view->lens, 4);
    layout_text(f, view->name), layout_put(f, 0, 1);
    layout_put(f, i > 0, 8);
    if (i) layout_real(f, 1.5), layout_real(f, 2.5), layout_put(f, UINT64_MAX, 8);
  }
}

static inline void layout_points(layout_file *f, const layout_rig *rig, int text)
{
  char line[300];
  f->size = 0;
  if (!text) layout_put(f, (uint64_t)rig->points, 8);
  for (int i = 0; i < rig->points; i++) {
    const double *p = rig->point[i];
    if (text) {
      snprintf(line, sizeof line, "%d %.17g %.17g %.17g 255 128 0 0.5 1 0 2 0\n", i + 1, p[0], p[1], p[2]);
      layout_text(f, line);
      continue;
    }
    layout_put(f, (uint64_t)(i + 1), 8);
    for (int k = 0; k < 3; k++) layout_real(f, p[k]);
    layout_put(f, 0x0080ff, 3), layout_real(f, 0.5), layout_put(f, 2, 8);
    for (int k = 0; k < 4; k++) layout_put(f, (uint64_t)k, 4);
  }
}

/* The dictionary and its padding, version 1. */
static inline void layout_npy_header(layout_file *f, const char *descr, const char *order, const char *shape)
{
  char text[200];
  f->size = 0;
  const int n = snprintf(text, sizeof text, "{'descr': '%s', 'fortran_order': %s, 'shape': %s, }", descr, order, shape);
  const int padded = (10 + n + 1 + 63) / 64 * 64 - 10;
  layout_put(f, 0x93, 1), layout_text(f, "NUMPY"), layout_put(f, 1, 2), layout_put(f, (uint64_t)padded, 2);
  layout_text(f, text);
  for (int i = n; i < padded - 1; i++) layout_put(f, ' ', 1);
  layout_put(f, '\n', 1);
}

/* Of the first lens; single: as <f4. */
static inline void layout_npy(layout_file *f, const layout_rig *rig, int single, double near, double far)
{
  char shape[40];
  snprintf(shape, sizeof shape, "(%d, 17)", rig->views);
  layout_npy_header(f, single ? "<f4" : "<f8", "False", shape);
  for (int i = 0; i < rig->views; i++) {
    const double *m = rig->view[i].to_world;
    const layout_lens *lens = &rig->lens[0];
    const double hwf[3] = {lens->height, lens->width, lens->param[0]};
    double row[17] = {[15] = near, [16] = far};
    for (int k = 0; k < 3; k++) {
      row[5 * k] = -m[4 * k + 1], row[5 * k + 1] = m[4 * k], row[5 * k + 2] = m[4 * k + 2];
      row[5 * k + 3] = m[4 * k + 3], row[5 * k + 4] = hwf[k];
    }
    for (int k = 0; k < 17; k++) {
      const float narrow = (float)row[k];
      uint32_t bits;
      memcpy(&bits, &narrow, sizeof bits);
      if (single)
        layout_put(f, bits, 4);
      else
        layout_real(f, row[k]);
    }
  }
}
#endif
