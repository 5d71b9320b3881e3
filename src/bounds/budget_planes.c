/* Error budget: TensoRF's planes, lines and basis matrix. Derivations: docs/fixed-point.md. */
#include "bounds/budget_small.h"
#include "src/fx/tensorf_place.h"
#include "src/fx/unit.h"
#include <stdlib.h>
#include <string.h>

enum { KINDS = 3 }; /* of small fields */

/* ---- a small field ---- */

static int8_t small_entry(int kind, uint64_t stream, uint64_t i, bool odd)
{
  if (kind == 0) return odd ? -127 : 127;
  const int64_t any = budget_pick(stream, i, -127, 127);
  return (int8_t)(kind == 1 ? any : any < 0 ? -127 : 127);
}

static void fill(int8_t *to, int width, int height, int components, int kind, uint64_t stream)
{
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++)
      for (int c = 0; c < components; c++) {
        const int i = (y * width + x) * components + c;
        to[i] = small_entry((c + kind) % 3, stream, (uint64_t)i, (x + y) & 1);
      }
}

void budget_make_planes(small_planes *s, int components, int kind)
{
  fx_tensorf *f = &s->field;
  memset(s, 0, sizeof *s);
  *f = (fx_tensorf){.res = {40, 19, 1},
                    .features = SMALL_FEATURES,
                    .feature_freqs = SMALL_FREQS,
                    .view_freqs = SMALL_FREQS,
                    .encoding_frac = SMALL_ENCODING_FRAC,
                    .basis = s->basis[0]};
  if (kind % 2) f->res[0] = 2, f->res[1] = 8, f->res[2] = 90;
  for (int pair = 0; pair < FX_PAIRS; pair++) {
    const int *axes = fx_pair_axes[pair];
    fill(s->plane[pair], f->res[axes[0]], f->res[axes[1]], components, kind, 100 + (uint64_t)pair);
    fill(s->line[pair], f->res[axes[2]], 1, components, kind, 103 + (uint64_t)pair);
    f->density.components[pair] = f->appearance.components[pair] = components;
    f->density.plane[pair] = f->appearance.plane[pair] = s->plane[pair];
    f->density.line[pair] = f->appearance.line[pair] = s->line[pair];
  }
  for (int c = 0; c < FX_PAIRS * components; c++)
    for (int o = 0; o < FX_APPEARANCE_MAX; o++)
      s->basis[c][o] = (int8_t)(o == 0 ? 127 : budget_pick(106, (uint64_t)(c * FX_APPEARANCE_MAX + o), -127, 127));
}

void budget_position(const fx_tensorf *field, uint64_t i, uint32_t pos[3])
{
  const uint32_t last = (1 << SF_POS_FRAC) - 1;
  for (uint64_t a = 0; a < 3; a++) {
    pos[a] = (uint32_t)budget_pick(110 + a, i, 0, last);
    if (i % 3 == 1 && i % 11 == a) pos[a] = i & 16 ? 0 : last;
    if (i % 3 < 2 || field->res[a] < 2) continue;
    const int64_t point = budget_pick(113 + a, i, 0, field->res[a] - 2), half = i >> a & 8 ? 1 : -1;
    const double place = (double)point + (half > 0 || point == 0 ? 0.5 : -0.5) / VM_ONE;
    const double at = ldexp(place / (field->res[a] - 1), SF_POS_FRAC);
    pos[a] = (uint32_t)fmin(i >> a & 64 ? ceil(at) : floor(at), last);
  }
}

/* ---- places, values, products ---- */

void sf_budget_place(sf_budget_row *row, uint64_t samples)
{
  for (uint64_t i = 0; row->inputs < samples; i++) {
    const int bits = (int)budget_pick(120, i, 0, 11);
    fx_tensorf field = {.res = {1 << bits, 1, FX_TENSORF_RES_MAX}};
    field.res[1] = (int32_t)budget_pick(121, i, 1, FX_TENSORF_RES_MAX);
    uint32_t pos[3];
    budget_position(&field, i, pos);
    const vm_place p = vm_find(field.res, pos);
    for (int a = 0; a < 3; a++)
      budget_add(row, p.at[a] * VM_ONE + p.g[a] - ldexp((double)pos[a] * (field.res[a] - 1), VM_FRAC - SF_POS_FRAC),
                 0.5);
  }
}

/* Plane and line of a component at a position in real numbers, in LSB of their entries, and how far the integers may be
 * from them: a place is off by 1/512 of a cell per axis and stays in its cell, the largest difference across the cell
 * says what that does, and the plane's value is rounded to 1/256. */
typedef struct real_values {
  double plane, line, plane_bound, line_bound;
} real_values;

static double between(double a, double b, double part)
{
  return (1 - part) * a + part * b;
}

static real_values real_at(const fx_tensorf *field, const fx_factors *f, int pair, int c, const uint32_t pos[3])
{
  int64_t low[3], high[3];
  double part[3];
  for (int k = 0; k < 3; k++) {
    const int axis = fx_pair_axes[pair][k], last = field->res[axis] - 1;
    const double x = ldexp((double)pos[axis] * last, -SF_POS_FRAC);
    low[k] = (int64_t)floor(x), part[k] = x - floor(x), high[k] = low[k] < last ? low[k] + 1 : low[k];
  }
  const int n = f->components[pair], width = field->res[fx_pair_axes[pair][0]];
  const int8_t *p = f->plane[pair] + c, *l = f->line[pair] + c;
  const double e00 = p[(low[1] * width + low[0]) * n], e10 = p[(low[1] * width + high[0]) * n],
               e01 = p[(high[1] * width + low[0]) * n], e11 = p[(high[1] * width + high[0]) * n], l0 = l[low[2] * n],
               l1 = l[high[2] * n];
  const double across = fmax(fabs(e10 - e00), fabs(e11 - e01)), along = fmax(fabs(e01 - e00), fabs(e11 - e10));
  return (real_values){between(between(e00, e10, part[0]), between(e01, e11, part[0]), part[1]),
                       between(l0, l1, part[2]), (across + along + 1) / 512, fabs(l1 - l0) / 512};
}

static double product_bound(const real_values *r)
{
  return fabs(r->plane) * r->line_bound + fabs(r->line) * r->plane_bound + r->plane_bound * r->line_bound;
}

/* One component, and all lines 1 or all planes 1, but 0 in the other pairs: the sum of the density is the value. */
static void value(sf_budget_row *row, uint64_t samples, bool of_plane)
{
  static int8_t one[SMALL_POINTS], zero[SMALL_POINTS];
  small_planes s[KINDS];
  memset(one, 1, sizeof one);
  for (int kind = 0; kind < KINDS; kind++) budget_make_planes(&s[kind], 1, kind);
  for (uint64_t i = 0; row->inputs < samples; i++) {
    const fx_tensorf *field = &s[i / 3 % KINDS].field;
    fx_tensorf alone = *field;
    uint32_t pos[3];
    budget_position(field, i, pos);
    const int pair = (int)(i / 9 % FX_PAIRS);
    for (int k = 0; k < FX_PAIRS; k++)
      *(of_plane ? &alone.density.line[k] : &alone.density.plane[k]) = k == pair ? one : zero;
    const real_values r = real_at(field, &field->density, pair, 0, pos);
    const double fixed = ldexp((double)fx_vm_portable.density(&alone, pos), -2 * VM_FRAC);
    budget_add(row, fixed - (of_plane ? r.plane : r.line), of_plane ? r.plane_bound : r.line_bound);
  }
}

void sf_budget_plane(sf_budget_row *row, uint64_t samples)
{
  value(row, samples, true);
}

void sf_budget_line(sf_budget_row *row, uint64_t samples)
{
  value(row, samples, false);
}

/* Each product of the appearance, in half LSBs, or their sum in the density, Q.16. */
static void products(sf_budget_row *row, uint64_t samples, bool density)
{
  small_planes s[KINDS];
  for (int kind = 0; kind < KINDS; kind++) budget_make_planes(&s[kind], density ? 1 : SMALL_COMPONENTS, kind);
  for (uint64_t i = 0; row->inputs < samples; i++) {
    const fx_tensorf *field = &s[i / 3 % KINDS].field;
    uint32_t pos[3];
    int16_t x[FX_PAIRS * FX_COMPONENTS_MAX];
    double sum = 0, bound = 0;
    budget_position(field, i, pos);
    fx_tensorf_products(field, pos, x);
    for (int pair = 0, n = 0; pair < FX_PAIRS; pair++)
      for (int c = 0; c < field->density.components[pair]; c++, n++) {
        const real_values r = real_at(field, &field->density, pair, c, pos);
        sum += r.plane * r.line, bound += product_bound(&r);
        if (!density) budget_add(row, x[n] / 2.0 - r.plane * r.line, product_bound(&r) + 0.25);
      }
    if (density) budget_add(row, ldexp((double)fx_vm_portable.density(field, pos), -2 * VM_FRAC) - sum, bound);
  }
}

void sf_budget_product(sf_budget_row *row, uint64_t samples)
{
  products(row, samples, false);
}

void sf_budget_density_sum(sf_budget_row *row, uint64_t samples)
{
  products(row, samples, true);
}

/* ---- basis matrix ---- */

/* A feature's sum against the same in double, exact to 2^53; or the feature against its sum. */
static void features(sf_budget_row *row, uint64_t samples, bool rounded)
{
  const int16_t unit[3] = {FX_UNIT_ONE, 0, 0};
  small_planes s[KINDS];
  for (int kind = 0; kind < KINDS; kind++) budget_make_planes(&s[kind], SMALL_COMPONENTS, kind);
  for (uint64_t i = 0; row->inputs < samples; i++) {
    fx_tensorf field = s[i / 3 % KINDS].field;
    uint32_t pos[3];
    int16_t x[FX_PAIRS * FX_COMPONENTS_MAX], in[SF_DIR_MAX];
    int32_t sum[FX_APPEARANCE_MAX];
    field.feature_freqs = field.view_freqs = 0;
    field.feature_in = (fx_scale){(int32_t)budget_pick(130, i, 0, 65535), (int32_t)budget_pick(131, i, 26, 40), 0};
    budget_position(&field, i, pos);
    const int n = fx_tensorf_products(&field, pos, x);
    fx_vm_portable.features(&field, pos, sum);
    if (rounded) fx_tensorf_encode(&field, pos, unit, in, NULL);
    for (int f = 0; f < field.features; f++) {
      double exact = 0;
      for (int c = 0; c < n; c++) exact += (double)x[c] * field.basis[c * FX_APPEARANCE_MAX + f];
      const double feature = ldexp((double)sum[f] * field.feature_in.mul, -field.feature_in.shift);
      if (!rounded)
        budget_add(row, sum[f] - exact, 0);
      else if (fabs(feature) <= FX_INPUT_MAX)
        budget_add(row, in[f] - feature, 0.5);
    }
  }
}

void sf_budget_basis(sf_budget_row *row, uint64_t samples)
{
  features(row, samples, false);
}

void sf_budget_appearance(sf_budget_row *row, uint64_t samples)
{
  features(row, samples, true);
}

/* ---- the weight test ---- */

/* White, or a colour that follows from the position. */
static sf_status some_colour(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  const bool white = *(const bool *)user;
  const uint32_t one = (1 << SF_COLOUR_FRAC) - 1;
  (void)ray, (void)first;
  out->colour[0] = out->colour[1] = out->colour[2] = white ? one : (uint32_t)abs(f[0]) * one / FX_INPUT_MAX;
  return sf_ok();
}

static fx_ray some_ray(uint64_t i)
{
  fx_ray ray = {.count = (int32_t)budget_pick(160, i, 1, 1024), .unit = {FX_UNIT_ONE, 0, 0}};
  for (uint64_t a = 0; a < 3; a++) {
    const int64_t from = budget_pick(161 + a, i, 0, INT32_MAX) << (FX_RAY_FRAC - 31),
                  to = budget_pick(164 + a, i, 0, INT32_MAX) << (FX_RAY_FRAC - 31);
    ray.origin[a] = from, ray.step[a] = (to - from) / ray.count;
  }
  return ray;
}

/* The same ray with all samples decoded. Half of the rays cross a fog whose samples weigh as much as the test's limit
 * or somewhat more: the weights fall below it on the way. */
void sf_budget_undecoded(sf_budget_row *row, uint64_t samples)
{
  static uint8_t all[64];
  small_planes s;
  memset(all, 0xff, sizeof all);
  budget_make_planes(&s, SMALL_COMPONENTS, 1);
  fx_scene scene = {.backbone = FX_TENSORF,
                    .tensorf = s.field,
                    .occ_res = 8,
                    .occupancy = all,
                    .step_q24 = 1 << 16, /* a density's LSB is one of Q.20 in the exponent */
                    .max_samples = 1024};
  const int32_t stop = (int32_t)floor(ldexp(SF_WEIGHT_STOP_FIRST, SF_TRANS_FRAC));
  fx_tensorf *f = &scene.tensorf;
  f->activation = FX_RELU, f->sigma_out = (fx_scale){1, FX_ACTIVATION_FRAC - SF_LOG_FRAC, 0};
  f->feature_in = (fx_scale){40000, 34, 0};
  for (uint64_t i = 0; i < samples / 64 + 1; i++) {
    const fx_ray ray = some_ray(i);
    fx_pixel part, whole;
    bool white = i & 2;
    f->density_in =
        i & 1 ? (fx_scale){0, 0, stop + (int32_t)budget_pick(168, i, 0, stop / 8)} : (fx_scale){40000, 35, 0};
    f->weight_stop = stop;
    sf_status status = fx_render_ray(&scene, &ray, some_colour, &white, &part, NULL);
    f->weight_stop = 0;
    if (status.code == SF_OK) status = fx_render_ray(&scene, &ray, some_colour, &white, &whole, NULL);
    if (status.code != SF_OK) continue;
    const double bound = (double)(whole.samples - part.samples) * stop * ((1 << SF_COLOUR_FRAC) - 1);
    budget_add(row, ldexp((double)part.colour[0] - (double)whole.colour[0], -SF_TRANS_FRAC),
               ldexp(bound, -SF_TRANS_FRAC));
  }
}
