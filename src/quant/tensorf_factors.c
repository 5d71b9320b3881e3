/* Planes and lines to int8. Only the product of a plane and a line matters, so the LSBs p of the plane and l of the
 * line of a component are free but for their product u = p l. The density has one u for all components, chosen by the
 * error of the opacity of samples; in the appearance every component uses the whole range of both, and its u goes into
 * its column of the basis matrix, which is fitted as the layers of the nets are.
 *
 * Roundings of both weigh the same in the product where p rms(line) = l rms(plane). */
#include "src/quant/internal.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { UNITS = 16, SHIFT_MAX = 40, PRODUCT_FRAC = 16, PHASE_FRAC = 16, ACTIVATION_FRAC = 20 };
static const double UNIT_STEP = 0.85, TWO_PI = 6.283185307179586;
static const double SMALLEST = 1e-12; /* LSB on file: a component of zeros has none */

typedef struct component {
  double plane_max, plane_rms, line_max, line_rms;
} component;

typedef struct factor {
  const float *value; /* [points][components] */
  size_t points;
  int components;
  int8_t *to;
} factor;

static factor factor_of(const sf_model *model, int id, int8_t *to)
{
  const sf_param *p = &model->param[id];
  const int components = (int)p->shape[p->dims - 1];
  return (factor){sf_model_param(model, id), p->size / (size_t)components, components, to};
}

static void measure(const factor *f, int c, double *largest, double *rms)
{
  double square = 0;
  *largest = 0;
  for (size_t i = 0; i < f->points; i++) {
    const double v = fabs((double)f->value[i * (size_t)f->components + (size_t)c]);
    *largest = fmax(*largest, v), square += v * v;
  }
  *rms = sqrt(square / (double)f->points);
}

static component measure_component(const factor *plane, const factor *line, int c)
{
  component m;
  measure(plane, c, &m.plane_max, &m.plane_rms);
  measure(line, c, &m.line_max, &m.line_rms);
  return m;
}

/* Entries of one component; the number that does not fit. */
static int64_t round_component(const factor *f, int c, double lsb, int limit)
{
  int64_t clipped = 0;
  for (size_t i = 0; i < f->points; i++) {
    const size_t at = i * (size_t)f->components + (size_t)c;
    const double q = lsb > 0 ? nearbyint(f->value[at] / lsb) : 0;
    clipped += fabs(q) > limit;
    f->to[at] = (int8_t)(q > limit ? limit : q < -limit ? -limit : q);
  }
  return clipped;
}

/* The plane's LSB for a given product of both: balanced, as far as neither is clipped. */
static double plane_lsb(const component *m, double unit, int limit)
{
  if (!(m->plane_rms > 0) || !(m->line_rms > 0)) return sqrt(unit);
  const double balanced = sqrt(unit * m->plane_rms / m->line_rms);
  const double low = m->plane_max / limit, high = unit * limit / m->line_max;
  return low > high ? sqrt(low * high) : fmin(fmax(balanced, low), high);
}

static void keep_lsb(sf_scales *to, int appearance, int component, double plane, double product)
{
  to->lsb.plane[appearance][component] = (float)fmax(plane, SMALLEST);
  to->lsb.product[appearance][component] = (float)fmax(product, SMALLEST * SMALLEST);
}

/* ---- density ---- */

typedef struct density {
  fx_scene *scene;
  const sf_model *model;
  const char *name;
  const sf_calibration *calibration;
  const sf_scales *settled; /* NULL: to be found */
  sf_scales *chosen;
  component component[FX_PAIRS][SF_COMPONENTS_MAX];
  int limit;
} density;

static factor density_factor(const density *d, int pair, bool line)
{
  const fx_factors *to = &d->scene->tensorf.density;
  return line ? factor_of(d->model, SF_P_DENSITY_LINE + pair, to->line[pair])
              : factor_of(d->model, SF_P_DENSITY_PLANE + pair, to->plane[pair]);
}

/* The unit that clips nothing. */
static double widest_unit(density *d)
{
  double widest = 0;
  for (int pair = 0; pair < FX_PAIRS; pair++) {
    const factor plane = density_factor(d, pair, false), line = density_factor(d, pair, true);
    for (int c = 0; c < plane.components; c++) {
      const component m = d->component[pair][c] = measure_component(&plane, &line, c);
      widest = fmax(widest, m.plane_max * m.line_max / d->limit / d->limit);
    }
  }
  return widest > 0 ? widest : 1;
}

static int64_t round_density(const density *d, double unit)
{
  int64_t clipped = 0;
  for (int pair = 0, n = 0; pair < FX_PAIRS; pair++) {
    const factor plane = density_factor(d, pair, false), line = density_factor(d, pair, true);
    for (int c = 0; c < plane.components; c++, n++) {
      const double p =
          d->settled ? (double)d->settled->lsb.plane[0][n] : plane_lsb(&d->component[pair][c], unit, d->limit);
      keep_lsb(d->chosen, 0, n, p, unit);
      clipped += round_component(&plane, c, p, d->limit) + round_component(&line, c, unit / p, d->limit);
    }
  }
  return clipped;
}

static sf_status set_density_scales(const density *d, double unit)
{
  const sf_tensorf *from = &d->model->config.tensorf;
  const double one = 1 << SF_LOG_FRAC, bias = nearbyint(from->shift * one);
  const double density = from->distance_scale / d->scene->units.to_box_scale; /* per box edge and activation */
  if (sf_quant_scale(ldexp(unit, -PRODUCT_FRAC) * one, SHIFT_MAX, (int)bias, &d->scene->tensorf.density_in) &&
      sf_quant_scale(ldexp(density, SF_SIGMA_FRAC - ACTIVATION_FRAC), SHIFT_MAX, 0, &d->scene->tensorf.sigma_out))
    return sf_ok();
  return sf_fail(SF_E_UNSUPPORTED, "%s: tensor '%s': densities are too large for the accelerator", d->name,
                 d->model->param[SF_P_DENSITY_PLANE].name);
}

/* Mean squared error of the opacity of a sample. */
static double opacity_error(const density *d)
{
  const sf_calibration *c = d->calibration;
  const double step = sf_tensorf_step(&d->model->config.tensorf);
  double error = 0;
  for (int i = 0; i < c->samples; i++) {
    const uint32_t *pos = c->pos + (size_t)i * 3;
    float x[3];
    sf_calibration_position(pos, x);
    const double exact = sf_tensorf_sigma(&d->model->config.tensorf, sf_tensorf_density_feature(d->model, x));
    const double fixed =
        ldexp(fx_tensorf_density(&d->scene->tensorf, pos, NULL), -SF_SIGMA_FRAC) * d->scene->units.to_box_scale;
    const double difference = exp(-exact * step) - exp(-fixed * step);
    error += difference * difference;
  }
  return error / c->samples;
}

static sf_status quantise_density(density *d, sf_quant_report *report)
{
  const double widest = d->settled ? (double)d->settled->lsb.product[0][0] : widest_unit(d);
  double unit = widest, best = widest, best_error = INFINITY;
  for (int i = 0; i < UNITS && !d->settled; i++, unit *= UNIT_STEP) {
    round_density(d, unit);
    SF_TRY(set_density_scales(d, unit));
    const double error = opacity_error(d);
    if (error >= best_error) break; /* clipping costs more than finer steps gain */
    best = unit, best_error = error;
  }
  report->grid_clipped += round_density(d, best);
  return set_density_scales(d, best);
}

/* ---- appearance ---- */

/* Value of one LSB of every product as the basis matrix gets it. */
static int64_t quantise_appearance(fx_scene *scene, const sf_model *model, const sf_scales *settled, int limit,
                                   sf_scales *chosen, double *lsb)
{
  const fx_factors *to = &scene->tensorf.appearance;
  int64_t clipped = 0;
  int n = 0;
  for (int pair = 0; pair < FX_PAIRS; pair++) {
    const factor plane = factor_of(model, SF_P_APP_PLANE + pair, to->plane[pair]),
                 line = factor_of(model, SF_P_APP_LINE + pair, to->line[pair]);
    for (int c = 0; c < plane.components; c++) {
      const component m = measure_component(&plane, &line, c);
      const double p = settled ? (double)settled->lsb.plane[1][n] : m.plane_max / limit;
      const double l = settled ? (double)settled->lsb.product[1][n] / p : m.line_max / limit;
      clipped += round_component(&plane, c, p, limit) + round_component(&line, c, l, limit);
      keep_lsb(chosen, 1, n, p, p * l);
      lsb[n++] = ldexp(p * l, -SF_PRODUCT_SHIFT);
    }
  }
  return clipped;
}

static double largest_feature(const sf_calibration *c)
{
  double largest = 1e-6;
  for (size_t i = 0; i < (size_t)c->samples * (size_t)c->features; i++) largest = fmax(largest, fabs((double)c->f[i]));
  return largest;
}

static sf_status set_feature_scales(fx_scene *scene, const sf_model *model, const char *name, double unit,
                                    double feature_lsb)
{
  fx_tensorf *field = &scene->tensorf;
  scene->units.feature_scale[0] = feature_lsb;
  if (sf_quant_scale(unit / feature_lsb, SHIFT_MAX, 0, &field->feature_in) &&
      sf_quant_scale(ldexp(unit / TWO_PI, PHASE_FRAC), SHIFT_MAX, 0, &field->phase_in))
    return sf_ok();
  return sf_fail(SF_E_UNSUPPORTED, "%s: tensor '%s': features are too large for the accelerator", name,
                 model->param[SF_P_BASIS].name);
}

/* Fits the basis matrix to the features that the float field has where the integer products are these. settled: its
 * unit, or 0. */
static sf_status fit_basis(fx_scene *scene, const sf_model *model, const sf_calibration *c, const double *lsb,
                           double settled, int limit, sf_quant_layer *result)
{
  const fx_tensorf *field = &scene->tensorf;
  const int n = sf_tensorf_products(&model->config.tensorf);
  int16_t *x = malloc((size_t)c->samples * (size_t)n * sizeof *x);
  int8_t *q = calloc((size_t)n, SF_LANES);
  sf_status status = x && q ? sf_ok() : sf_fail(SF_E_MEMORY, "quantiser: no memory for the basis matrix");
  if (status.code == SF_OK) {
    for (int i = 0; i < c->samples; i++) fx_tensorf_products(field, c->pos + (size_t)i * 3, x + (size_t)i * (size_t)n);
    const sf_fit_data data = {c->samples, n, field->features, x, c->f};
    const sf_fit_weights weights = {.w = sf_model_param(model, SF_P_BASIS),
                                    .stride = n,
                                    .lsb = lsb,
                                    .unit_min = 1e-30,
                                    .weight_max = limit,
                                    .unit = settled};
    status = sf_fit_layer(&data, &weights, true, q, result);
  }
  for (int i = 0; i < n && status.code == SF_OK; i++)
    memcpy(field->basis + (size_t)i * FX_APPEARANCE_MAX, q + (size_t)i * SF_LANES, FX_APPEARANCE_MAX);
  free(x), free(q);
  return status;
}

sf_status sf_quantise_factors(fx_scene *scene, const sf_model *model, const char *name,
                              const sf_calibration *calibration, sf_quant_report *report)
{
  const int limit = sf_symmetric_max(report->widths.grid_bits);
  const sf_scales *settled = sf_settled_scales(model, &report->widths);
  sf_scales *chosen = &report->scales;
  density d = {.scene = scene,
               .model = model,
               .name = name,
               .calibration = calibration,
               .settled = settled,
               .chosen = chosen,
               .limit = limit};
  double lsb[SF_PRODUCTS_MAX];
  sf_quant_layer basis;
  SF_TRY(quantise_density(&d, report));
  report->grid_clipped += quantise_appearance(scene, model, settled, limit, chosen, lsb);
  SF_TRY(fit_basis(scene, model, calibration, lsb, settled ? (double)settled->lsb.basis : 0,
                   sf_symmetric_max(report->widths.weight_bits), &basis));
  report->feature_error = basis.error;
  chosen->lsb.basis = (float)basis.unit;
  const double room = 1.1; /* between the calibration points are larger ones */
  return set_feature_scales(scene, model, name, basis.unit,
                            settled ? (double)settled->lsb.feature[0]
                                    : largest_feature(calibration) * room / sf_symmetric_max(SF_INPUT_BITS));
}
