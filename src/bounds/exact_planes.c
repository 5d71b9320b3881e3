/* TensoRF's field in double precision, each block fixed or real.
 *
 * The scene does not say what an entry's LSB is worth, and only some products of LSBs matter: in the density plane LSB
 * times line LSB, one value for all components, from which the activation's argument follows; in the appearance the
 * same times a column of the basis matrix. So the LSBs are found from the entries of both, and what error they have
 * cancels where both are real. */
#include "bounds/exact_field.h"
#include "src/fx/tensorf.h"
#include "src/fx/unit.h"
#include <stdlib.h>

enum { COMPONENTS = FX_PAIRS * FX_COMPONENTS_MAX, PLACE_ONE = 256, PRODUCT_FRAC = 16, BASIS_FRAC = 15 };

/* A plane or a line: its int8 entries, or float entries that times inverse[c] are in LSB of component c. */
typedef struct table {
  const int8_t *entry;
  const float *value;
  int components;
  bool real;
  double inverse[FX_COMPONENTS_MAX];
} table;

typedef struct factors {
  table plane[FX_PAIRS], line[FX_PAIRS];
} factors;

typedef struct sf_exact_planes {
  factors density, appearance;
  double product; /* value of the LSB of a product of the density */
  double unit;    /* value of one LSB of a feature's sum */
  double basis[COMPONENTS][FX_APPEARANCE_MAX];
} sf_exact_planes;

/* ---- LSBs ---- */

static table open_table(const sf_exact *e, int id, const int8_t *entry, bool real)
{
  const sf_param *p = &e->model->param[id];
  return (table){entry, sf_model_param(e->model, id), (int)p->shape[p->dims - 1], real, {0}};
}

/* Of the largest entry, which the quantiser rounds exactly where it clips none. */
static double lsb_of_largest(const table *t, size_t points, int c)
{
  double value = 0, entry = 0;
  for (size_t at = (size_t)c; at < points * (size_t)t->components; at += (size_t)t->components)
    value = fmax(value, fabs((double)t->value[at])), entry = fmax(entry, abs(t->entry[at]));
  return entry > 0 ? value / entry : 0;
}

/* By least squares over the entries that are not clipped. */
static double lsb_of_all(const table *t, size_t points, int c)
{
  const size_t step = (size_t)t->components, end = points * step;
  double sum = 0, squares = 0;
  int limit = 0;
  for (size_t at = (size_t)c; at < end; at += step) limit = abs(t->entry[at]) > limit ? abs(t->entry[at]) : limit;
  for (size_t at = (size_t)c; at < end; at += step)
    if (abs(t->entry[at]) < limit) {
      sum += (double)t->value[at] * t->entry[at];
      squares += (double)t->entry[at] * t->entry[at];
    }
  return squares > 0 && sum > 0 ? sum / squares : lsb_of_largest(t, points, c);
}

static size_t points_of(const sf_exact *e, int id)
{
  const sf_param *p = &e->model->param[id];
  return p->size / (size_t)p->shape[p->dims - 1];
}

static double inverse(double lsb)
{
  return lsb > 0 ? 1 / lsb : 0;
}

static void open_density(const sf_exact *e, sf_exact_planes *planes)
{
  const fx_tensorf *field = &e->scene->tensorf;
  const bool real = sf_exact_is(e, SF_EXACT_ENTRIES);
  planes->product = ldexp(field->density_in.mul, PRODUCT_FRAC - SF_LOG_FRAC - field->density_in.shift);
  for (int pair = 0; pair < FX_PAIRS; pair++) {
    const int id = SF_P_DENSITY_PLANE + pair;
    table *plane = &planes->density.plane[pair], *line = &planes->density.line[pair];
    *plane = open_table(e, id, field->density.plane[pair], real);
    *line = open_table(e, SF_P_DENSITY_LINE + pair, field->density.line[pair], real);
    for (int c = 0; c < plane->components && real; c++) {
      const double lsb = lsb_of_all(plane, points_of(e, id), c);
      plane->inverse[c] = inverse(lsb), line->inverse[c] = lsb * inverse(planes->product);
    }
  }
}

/* lsb[c]: of a product as the basis matrix gets it. */
static void open_appearance(const sf_exact *e, sf_exact_planes *planes, double *lsb)
{
  const fx_tensorf *field = &e->scene->tensorf;
  const bool real = sf_exact_is(e, SF_EXACT_APPEARANCE);
  int n = 0;
  for (int pair = 0; pair < FX_PAIRS; pair++) {
    const int plane_id = SF_P_APP_PLANE + pair, line_id = SF_P_APP_LINE + pair;
    table *plane = &planes->appearance.plane[pair], *line = &planes->appearance.line[pair];
    *plane = open_table(e, plane_id, field->appearance.plane[pair], real);
    *line = open_table(e, line_id, field->appearance.line[pair], real);
    for (int c = 0; c < plane->components; c++) {
      const double p = lsb_of_largest(plane, points_of(e, plane_id), c),
                   l = lsb_of_largest(line, points_of(e, line_id), c);
      plane->inverse[c] = inverse(p), line->inverse[c] = inverse(l);
      lsb[n++] = ldexp(p * l, BASIS_FRAC - PRODUCT_FRAC);
    }
  }
}

static void open_basis(const sf_exact *e, sf_exact_planes *planes, const double *lsb)
{
  const fx_tensorf *field = &e->scene->tensorf;
  const float *w = sf_model_param(e->model, SF_P_BASIS);
  const int n = fx_factors_components(&field->appearance);
  planes->unit = ldexp(field->feature_in.mul * e->scene->units.feature_scale[0], -field->feature_in.shift);
  for (int c = 0; c < n; c++)
    for (int f = 0; f < field->features; f++)
      planes->basis[c][f] = sf_exact_is(e, SF_EXACT_BASIS) ? (double)w[f * n + c] * lsb[c] * inverse(planes->unit)
                                                           : field->basis[c * FX_APPEARANCE_MAX + f];
}

sf_status sf_exact_planes_open(sf_exact *e)
{
  double lsb[COMPONENTS];
  sf_exact_planes *planes = e->planes = calloc(1, sizeof *planes);
  if (!planes) return sf_fail(SF_E_MEMORY, "no memory for planes and lines in double precision");
  open_density(e, planes);
  open_appearance(e, planes, lsb);
  open_basis(e, planes, lsb);
  return sf_ok();
}

void sf_exact_planes_close(sf_exact *e)
{
  free(e->planes);
  e->planes = NULL;
}

/* ---- products of planes and lines ---- */

typedef struct place {
  int32_t at[3], next[3]; /* grid points */
  double part[3];         /* of the next, 0..256 */
} place;

static place find(const sf_exact *e, const double pos[3])
{
  place p;
  for (int axis = 0; axis < 3; axis++) {
    const double real = ldexp(pos[axis] * (e->scene->tensorf.res[axis] - 1), 8 - SF_POS_FRAC);
    const double at = sf_exact_is(e, SF_EXACT_POSITION) ? real : sf_exact_round(real);
    p.at[axis] = (int32_t)floor(at / PLACE_ONE);
    p.part[axis] = at - (double)p.at[axis] * PLACE_ONE;
    p.next[axis] = p.at[axis] + (p.part[axis] > 0);
  }
  return p;
}

static double entry(const table *t, int32_t point, int c)
{
  const size_t at = (size_t)point * (size_t)t->components + (size_t)c;
  return t->real ? (double)t->value[at] * t->inverse[c] : t->entry[at];
}

/* product[components of the pair], Q.16. */
static void multiply(const sf_exact *e, const factors *f, int pair, const place *p, double *product)
{
  const int u = fx_pair_axes[pair][0], v = fx_pair_axes[pair][1], w = fx_pair_axes[pair][2];
  const int32_t width = e->scene->tensorf.res[u];
  const double g = p->part[u], h = p->part[v], k = p->part[w];
  const table *plane = &f->plane[pair], *line = &f->line[pair];
  for (int c = 0; c < plane->components; c++) {
    const double near = entry(plane, p->at[v] * width + p->at[u], c) * (PLACE_ONE - g) +
                        entry(plane, p->at[v] * width + p->next[u], c) * g;
    const double far = entry(plane, p->next[v] * width + p->at[u], c) * (PLACE_ONE - g) +
                       entry(plane, p->next[v] * width + p->next[u], c) * g;
    const double sum = (near * (PLACE_ONE - h) + far * h) / PLACE_ONE;
    product[c] = (sf_exact_is(e, SF_EXACT_PLANE) ? sum : sf_exact_round(sum)) *
                 (entry(line, p->at[w], c) * (PLACE_ONE - k) + entry(line, p->next[w], c) * k);
  }
}

/* ---- density ---- */

/* A real sum is rounded to the Q.16 that the core's is in. */
double sf_exact_planes_sigma(const sf_exact *e, const double pos[3])
{
  const sf_tensorf *model = &e->model->config.tensorf;
  const place p = find(e, pos);
  double sum = 0, product[FX_COMPONENTS_MAX];
  for (int pair = 0; pair < FX_PAIRS; pair++) {
    multiply(e, &e->planes->density, pair, &p, product);
    for (int c = 0; c < e->planes->density.plane[pair].components; c++) sum += product[c];
  }
  if (!sf_exact_is(e, SF_EXACT_ACTIVATION)) return fx_tensorf_activate(&e->scene->tensorf, llrint(sum));
  const double x = ldexp(sum, -PRODUCT_FRAC) * e->planes->product + (double)model->shift;
  const double active = model->activation == SF_RELU ? fmax(x, 0) : x > 40 ? x : log1p(exp(x));
  return ldexp((double)model->distance_scale * active / e->scene->units.to_box_scale, SF_SIGMA_FRAC);
}

/* ---- inputs of the decoder ---- */

/* A fine-tuned model rounds its inputs, too. */
static double to_input(const sf_exact *e, double x)
{
  return e->model->scales.weight_bits ? sf_exact_clamp(nearbyint(x), -FX_INPUT_MAX, FX_INPUT_MAX) : x;
}

/* x[2 * freqs * n]: sines of 2^k times value i, then cosines, in LSB. Angles in radians. */
static void real_waves(const sf_exact *e, const double *angle, int n, int freqs, double *x)
{
  const double one = ldexp(1, e->scene->tensorf.encoding_frac);
  for (int i = 0; i < n * freqs; i++) {
    const double at = ldexp(angle[i / freqs], i % freqs);
    x[i] = to_input(e, one * sin(at)), x[n * freqs + i] = to_input(e, one * cos(at));
  }
}

static double encoded(const fx_tensorf *field, uint32_t phase)
{
  const double rounded = sf_exact_round(ldexp(fx_sine(phase), field->encoding_frac - FX_UNIT_FRAC));
  return sf_exact_clamp(rounded, -FX_INPUT_MAX, FX_INPUT_MAX);
}

/* The core's, of rounded phases in turns, Q.16. */
static void fixed_waves(const fx_tensorf *field, const double *phase, int n, int freqs, double *x)
{
  for (int i = 0; i < n * freqs; i++) {
    const uint32_t at = (uint32_t)(int64_t)phase[i / freqs] << i % freqs;
    x[i] = encoded(field, at), x[n * freqs + i] = encoded(field, at + (1u << (FX_PHASE_BITS - 2)));
  }
}

int sf_exact_planes_direction(const sf_exact *e, const double unit[3], double *direction)
{
  const fx_tensorf *field = &e->scene->tensorf;
  for (int axis = 0; axis < 3; axis++) direction[axis] = to_input(e, ldexp(unit[axis], field->encoding_frac));
  real_waves(e, unit, 3, field->view_freqs, direction + 3);
  return 3 + 6 * field->view_freqs;
}

static void sum_features(const sf_exact *e, const double pos[3], double sum[FX_APPEARANCE_MAX])
{
  const place p = find(e, pos);
  const int features = e->scene->tensorf.features;
  int row = 0;
  for (int f = 0; f < features; f++) sum[f] = 0;
  for (int pair = 0; pair < FX_PAIRS; pair++) {
    double product[FX_COMPONENTS_MAX];
    multiply(e, &e->planes->appearance, pair, &p, product);
    for (int c = 0; c < e->planes->appearance.plane[pair].components; c++, row++) {
      const double x = ldexp(product[c], -BASIS_FRAC), kept = sf_exact_is(e, SF_EXACT_PRODUCT) ? x : sf_exact_round(x);
      for (int f = 0; f < features; f++) sum[f] += kept * e->planes->basis[row][f];
    }
  }
}

void sf_exact_planes_inputs(const sf_exact *e, const double pos[3], const double *direction, double *x)
{
  const fx_tensorf *field = &e->scene->tensorf;
  const int n = field->features, freqs = field->feature_freqs;
  double sum[FX_APPEARANCE_MAX], angle[FX_APPEARANCE_MAX], phase[FX_APPEARANCE_MAX];
  sum_features(e, pos, sum);
  for (int f = 0; f < n; f++) {
    const double feature = ldexp(sum[f] * field->feature_in.mul, -field->feature_in.shift);
    x[f] = sf_exact_is(e, SF_EXACT_FEATURE) ? to_input(e, feature)
                                            : sf_exact_clamp(sf_exact_round(feature), -FX_INPUT_MAX, FX_INPUT_MAX);
    angle[f] = sum[f] * e->planes->unit;
    phase[f] = sf_exact_round(ldexp(sum[f] * field->phase_in.mul, -field->phase_in.shift));
  }
  for (int i = 0; i < 3; i++) x[n + i] = direction[i];
  if (sf_exact_is(e, SF_EXACT_WAVES))
    real_waves(e, angle, n, freqs, x + n + 3);
  else
    fixed_waves(field, phase, n, freqs, x + n + 3);
  for (int i = 0; i < 6 * field->view_freqs; i++) x[n + 3 + 2 * n * freqs + i] = direction[3 + i];
}
