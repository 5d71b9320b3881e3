/* TensoRF's planes and lines, forward and backward, sample by sample with the components side by side in a vector:
 * channels last, so that a corner is one or a few cache lines. Oracle: src/field/tensorf.c.
 * Included by kernels_isa.c only. */
#ifndef SF_SNN_VM_ISA_H
#define SF_SNN_VM_ISA_H
#include "snn/forward_isa.h"

/* 16 components are WIDE vectors of this instruction set: one type of 64 bytes is taken apart through the stack where
 * the registers are shorter. */
enum { WIDE = 16 / VL };
typedef float v4 __attribute__((vector_size(16), aligned(4), may_alias));

/* Cell and place in it along the three axes. */
typedef struct vm_place {
  int low[3];
  float part[3];
} vm_place;

static inline vm_place vm_locate(const int *resolution, const float *x)
{
  vm_place p;
  for (int a = 0; a < 3; a++) {
    const float at = x[a] * (float)(resolution[a] - 1);
    const int cell = (int)at, last = resolution[a] - 2;
    p.low[a] = cell < last ? cell : last;
    p.part[a] = at - (float)p.low[a];
  }
  return p;
}

/* Offsets (in floats) and weights of the four corners on the plane and the two points on the line of one mode. */
typedef struct vm_corners {
  size_t plane, row, line; /* first corner; distance of the second row; first point */
  float w[4], l[2];        /* weights: low/low, low/high column, second row alike */
} vm_corners;

static inline __attribute__((always_inline)) vm_corners vm_find(const sf_vm_field *f, int mode, const vm_place *p)
{
  static const int axis[3][3] = {{0, 1, 2}, {0, 2, 1}, {1, 2, 0}};
  const int u = axis[mode][0], v = axis[mode][1], w = axis[mode][2];
  const size_t n = (size_t)f->channels[mode], width = (size_t)f->resolution[u];
  const float a = p->part[u], b = p->part[v], c = p->part[w];
  return (vm_corners){.plane = ((size_t)p->low[v] * width + (size_t)p->low[u]) * n,
                      .row = width * n,
                      .line = (size_t)p->low[w] * n,
                      .w = {(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b},
                      .l = {1 - c, c}};
}

/* Samples whose corners are asked for before the first of them is worked on: planes are larger than the near caches. */
enum { AHEAD = 16 };

/* components: of the plane, 16 to a line of the cache. */
static inline __attribute__((always_inline)) void vm_ask(const float *plane, const vm_corners *at, size_t n,
                                                         int components)
{
  for (const float *p = plane + at->plane, *end = p + components; p < end; p += 16) {
    __builtin_prefetch(p);
    __builtin_prefetch(p + n);
    __builtin_prefetch(p + at->row);
    __builtin_prefetch(p + at->row + n);
  }
}

/* Finds and asks for what the samples need from s on, at most AHEAD. */
static inline __attribute__((always_inline)) void vm_look(const sf_vm_field *f, const float *x, int s, int n,
                                                          vm_corners corners[AHEAD][3])
{
  for (int i = s; i < n && i < s + AHEAD; i++) {
    const vm_place place = vm_locate(f->resolution, x + 3 * i);
    for (int m = 0; m < 3; m++) {
      corners[i - s][m] = vm_find(f, m, &place);
      vm_ask(f->plane[m], &corners[i - s][m], (size_t)f->channels[m], f->channels[m]);
    }
  }
}

/* The interpolated plane and line of `type` components from `c` on. */
#define VM_VALUE(type, name)                                                                                           \
  static inline __attribute__((always_inline)) void name(const float *plane, const float *line, const vm_corners *at,  \
                                                         size_t n, type *on_plane, type *on_line)                      \
  {                                                                                                                    \
    const float *p = plane + at->plane, *q = p + at->row, *l = line + at->line;                                        \
    *on_plane = at->w[0] * *(const type *)p + at->w[1] * *(const type *)(p + n) + at->w[2] * *(const type *)q +        \
                at->w[3] * *(const type *)(q + n);                                                                     \
    *on_line = at->l[0] * *(const type *)l + at->l[1] * *(const type *)(l + n);                                        \
  }
VM_VALUE(vf, vm_value_lanes)
VM_VALUE(v4, vm_value4)

static inline float vm_sum(const vf wide[WIDE], const v4 *narrow)
{
  v4 sum = *narrow;
  for (int i = 0; i < 4; i++) sum += ((const v4 *)wide)[i];
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

/* feature[n] at x[n][3]. */
static void vm_feature(const sf_vm_field *f, const float *x, int n, float *feature)
{
  vm_corners corners[AHEAD][3];
  for (int s = 0; s < n; s++) {
    if (s % AHEAD == 0) vm_look(f, x, s, n, corners);
    vf wide[WIDE] = {{0}};
    v4 narrow = {0};
    for (int m = 0; m < 3; m++) {
      const vm_corners at = corners[s % AHEAD][m];
      const int channels = f->channels[m];
      int c = 0;
      for (; c + 16 <= channels; c += 16)
        for (int i = 0; i < WIDE; i++) {
          const int lane = c + i * VL;
          vf a, b;
          vm_value_lanes(f->plane[m] + lane, f->line[m] + lane, &at, (size_t)channels, &a, &b);
          wide[i] += a * b;
        }
      for (; c < channels; c += 4) {
        v4 a, b;
        vm_value4(f->plane[m] + c, f->line[m] + c, &at, (size_t)channels, &a, &b);
        narrow += a * b;
      }
    }
    feature[s] = vm_sum(wide, &narrow);
  }
}

/* log(1 + e) for e >= 0; Cephes' polynomial, and the series where 1 + e has no digits left. */
static inline float fast_log1p(float e)
{
  union {
    float f;
    uint32_t i;
  } m = {.f = 1 + e};
  const uint32_t bits = m.i - 0x3F3504F3u; /* mantissa to sqrt(1/2)..sqrt(2) */
  const float exponent = (float)((int32_t)bits >> 23);
  m.i = (bits & 0x007FFFFFu) + 0x3F3504F3u;
  const float x = m.f - 1, z = x * x;
  float p = 7.0376836292e-2f;
  p = p * x - 1.1514610310e-1f;
  p = p * x + 1.1676998740e-1f;
  p = p * x - 1.2420140846e-1f;
  p = p * x + 1.4249322787e-1f;
  p = p * x - 1.6668057665e-1f;
  p = p * x + 2.0000714765e-1f;
  p = p * x - 2.4999993993e-1f;
  p = p * x + 3.3333331174e-1f;
  const float log = x + (x * z * p - 0.5f * z) + exponent * 0.693147181f;
  return e < 0.01f ? e * (1 - e * (0.5f - e * 0.333333333f)) : log;
}

/* sigma[n] per model unit, and its slope, of density features. */
static void vm_activate(const sf_vm_field *f, int n, const float *restrict feature, float *restrict sigma,
                        float *restrict slope)
{
  const float shift = f->shift, scale = f->distance_scale;
  if (f->relu)
    for (int i = 0; i < n; i++) {
      const float x = feature[i] + shift;
      sigma[i] = x > 0 ? scale * x : 0;
      slope[i] = x > 0 ? scale : 0;
    }
  else
    for (int i = 0; i < n; i++) {
      const float x = feature[i] + shift, e = fast_exp(x > 20 ? 20 : x);
      const float soft = fast_log1p(e);
      sigma[i] = scale * (x > 20 ? x : soft);
      slope[i] = scale * e / (1 + e);
    }
}

static void vm_density(const sf_vm_field *f, const float *x, int n, float *sigma, float *slope)
{
  float feature[SF_BLOCK];
  for (int i = 0; i < n; i += SF_BLOCK) {
    const int m = n - i < SF_BLOCK ? n - i : SF_BLOCK;
    vm_feature(f, x + 3 * i, m, feature);
    vm_activate(f, m, feature, sigma + i, slope + i);
  }
}

/* product[n][ld] = plane * line, component by component, mode after mode; zeros up to ld. */
static void vm_products(const sf_vm_field *f, const float *x, int n, float *product, int ld)
{
  const int all = f->channels[0] + f->channels[1] + f->channels[2];
  vm_corners corners[AHEAD][3];
  for (int s = 0; s < n; s++) {
    if (s % AHEAD == 0) vm_look(f, x, s, n, corners);
    float *out = product + (size_t)s * ld;
    for (int m = 0; m < 3; m++) {
      const vm_corners at = corners[s % AHEAD][m];
      const int channels = f->channels[m];
      int c = 0;
      for (; c + VL <= channels; c += VL) {
        vf a, b;
        vm_value_lanes(f->plane[m] + c, f->line[m] + c, &at, (size_t)channels, &a, &b);
        *(vf *)(out + c) = a * b;
      }
      for (; c < channels; c += 4) {
        v4 a, b;
        vm_value4(f->plane[m] + c, f->line[m] + c, &at, (size_t)channels, &a, &b);
        *(v4 *)(out + c) = a * b;
      }
      out += channels;
    }
    for (int c = all; c < ld; c++) product[(size_t)s * ld + c] = 0;
  }
}

#define VM_ADD(type, name, value)                                                                                      \
  static inline __attribute__((always_inline)) void name(const float *plane, const float *line, const vm_corners *at,  \
                                                         size_t n, type g, float *dplane, float *dline)                \
  {                                                                                                                    \
    type a, b;                                                                                                         \
    value(plane, line, at, n, &a, &b);                                                                                 \
    float *p = dplane + at->plane, *q = p + at->row, *l = dline + at->line;                                            \
    a *= g;                                                                                                            \
    b *= g;                                                                                                            \
    *(type *)p += at->w[0] * b;                                                                                        \
    *(type *)(p + n) += at->w[1] * b;                                                                                  \
    *(type *)q += at->w[2] * b;                                                                                        \
    *(type *)(q + n) += at->w[3] * b;                                                                                  \
    *(type *)l += at->l[0] * a;                                                                                        \
    *(type *)(l + n) += at->l[1] * a;                                                                                  \
  }
VM_ADD(vf, vm_add_lanes, vm_value_lanes)
VM_ADD(v4, vm_add4, vm_value4)

/* Adds the gradient of `count` components of one mode from `first` on, at most 16, samples in order. g: [n][ld], the
 * first of them at g[0]; ld = 0: one gradient per sample, of the sum of all components. */
static void vm_backward(const sf_vm_field *f, int mode, int first, int count, const float *x, int n, const float *g,
                        int ld, float *dplane, float *dline)
{
  const float *plane = f->plane[mode] + first, *line = f->line[mode] + first;
  const size_t channels = (size_t)f->channels[mode];
  vm_corners corners[AHEAD];
  for (int s = 0; s < n; s++) {
    if (s % AHEAD == 0)
      for (int i = s; i < n && i < s + AHEAD; i++) {
        const vm_place place = vm_locate(f->resolution, x + 3 * i);
        corners[i - s] = vm_find(f, mode, &place);
        vm_ask(plane, &corners[i - s], channels, count);
        vm_ask(dplane + first, &corners[i - s], channels, count);
      }
    if (!ld && g[s] == 0) continue;
    const vm_corners at = corners[s % AHEAD];
    if (count == 16) {
      for (int c = 0; c < 16; c += VL) {
        vf own = (vf){0};
        own = ld ? *(const vf *)(g + (size_t)s * ld + c) + own : own + g[s];
        vm_add_lanes(plane + c, line + c, &at, channels, own, dplane + first + c, dline + first + c);
      }
    } else
      for (int c = 0; c < count; c += 4) {
        v4 own = (v4){0};
        own = ld ? *(const v4 *)(g + (size_t)s * ld + c) + own : own + g[s];
        vm_add4(plane + c, line + c, &at, channels, own, dplane + first + c, dline + first + c);
      }
  }
}
#endif
