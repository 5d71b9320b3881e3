/* Quantiser: fixed against float per block, refusals, determinism. */
#include "ck_run.h"
#include "quant/quant.h"
#include "base/rng.h"
#include "src/fx/unit.h"
#include "src/quant/internal.h"
#include <math.h>
#include <omp.h>

static float normal(uint64_t stream, uint64_t i)
{
  float sum = 0;
  for (uint64_t n = 0; n < 12; n++) sum += sf_random_float(4, stream, i * 12 + n);
  return sum - 6;
}

static void fill(sf_model *m, sf_param_id id, float scale)
{
  float *value = sf_model_param(m, id);
  for (size_t i = 0; i < m->param[id].size; i++) value[i] = scale * normal((uint64_t)id, i);
}

/* Currents of the size of theta, finer levels with smaller entries, as training leaves them. */
static sf_model make_model(int hidden, int levels, int mode)
{
  sf_config config = sf_config_default();
  sf_model m;
  config.hidden = hidden, config.levels = levels, config.mode = mode;
  config.steps = 4, config.log2_hash = 12, config.finest_res = 256, config.occ_res = 16, config.lattice = 256;
  ck_ok(sf_model_create(&m, &config));
  fill(&m, SF_P_GRID, 1);
  for (int l = 0; l < levels; l++)
    for (size_t i = 2 * m.level[l].offset; i < 2 * (m.level[l].offset + m.level[l].entries); i++)
      sf_model_param(&m, SF_P_GRID)[i] *= 0.8f / (float)(1 + l);
  fill(&m, SF_P_D1, 1.2f);
  fill(&m, SF_P_D2, 0.5f);
  fill(&m, SF_P_C1, 0.5f);
  fill(&m, SF_P_C2, 0.3f);
  fill(&m, SF_P_C3, 0.3f);
  fill(&m, SF_P_LEAK, 0.5f);
  m.t_r = 3;
  m.t_star = 3.2f;
  for (size_t i = 0; i < 512; i++) m.occupancy[i] = (uint8_t)sf_random_u64(1, 2, i);
  return m;
}

static const sf_quant_options plain = {.background = {1, 1, 1}, .seed = 1};

static void quantise(const sf_model *m, fx_scene *scene, sf_quant_report *report)
{
  ck_ok(sf_quantise_report(scene, m, "model", &plain, report));
}

static void assert_refused(const sf_model *m, const sf_quant_options *options, sf_code code, const char *place)
{
  fx_scene scene;
  const sf_status status = sf_quantise(&scene, m, "dir/model.safetensors", options);
  ck_assert_msg(status.code == code, "code %d: '%s' where '%s' should be refused", status.code, status.message, place);
  ck_assert_msg(strstr(status.message, "dir/model.safetensors") && strstr(status.message, place),
                "'%s' does not name '%s'", status.message, place);
  ck_assert_ptr_null(scene.owner);
}

static void draw(uint64_t sample, uint32_t pos[3], float x[3], float sh[16])
{
  float d[3], length = 0;
  for (uint64_t a = 0; a < 3; a++) {
    pos[a] = (uint32_t)sf_random_below(99, a, sample, 1 << 24);
    x[a] = (float)pos[a] * 0x1p-24f;
    d[a] = normal(50 + a, sample);
    length += d[a] * d[a];
  }
  for (int a = 0; a < 3; a++) d[a] /= sqrtf(length);
  sf_sh4(d, sh);
}

/* Largest error of a table entry of one level, in units of the features; its range of values too. */
static double entry_error(const sf_model *m, const fx_scene *scene, int level, double *range)
{
  const double lsb = scene->units.feature_scale[level] * ldexp(1, 16 - scene->grid.shift[level]);
  const float *value = sf_model_param(m, SF_P_GRID);
  double worst = 0, low = 0, high = 0;
  for (size_t i = 2 * m->level[level].offset; i < 2 * (m->level[level].offset + m->level[level].entries); i++) {
    worst = fmax(worst, fabs(value[i] - lsb * scene->grid.table[i]));
    low = fmin(low, value[i]), high = fmax(high, value[i]);
  }
  *range = high - low;
  return worst;
}

/* A position rounded to 1/256 of a cell moves the value by at most 3/512 of the largest difference of two entries; then
 * the largest error of an entry, half an LSB of the feature, and what lies beyond its rails. */
TEST(features_against_float)
{
  OWNED(sf_model) m = make_model(128, 16, SF_HYBRID);
  OWNED(fx_scene) scene;
  sf_quant_report report;
  double entry[16], range[16];
  quantise(&m, &scene, &report);
  for (int l = 0; l < 16; l++) entry[l] = entry_error(&m, &scene, l, &range[l]);
  for (uint64_t sample = 0; sample < 2000; sample++) {
    uint32_t pos[3];
    float x[3], sh[16], f[32];
    int16_t q[32];
    draw(sample, pos, x, sh);
    sf_grid_features(&m, x, f);
    fx_grid_features(&scene.grid, pos, q, NULL);
    for (int i = 0; i < 32; i++) {
      const double lsb = scene.units.feature_scale[i / 2], beyond = fmax(0, fabs(f[i]) - 2047 * lsb);
      const double bound = range[i / 2] * 3 / 512 + entry[i / 2] + lsb * 0.51 + beyond;
      ck_assert_msg(fabs(f[i] - q[i] * lsb) <= bound + 1e-4, "feature %d: %g, float %g, bound %g", i, q[i] * lsb,
                    (double)f[i], bound);
    }
  }
  printf("features: relative RMS error %.3f %%\n", 100 * report.feature_error);
  ck_assert(report.feature_error < 0.02);
}

typedef struct tally {
  double current_error[SF_LAYERS], current_energy[SF_LAYERS];
  double colour_error, colour, colour_square, log_error, log, log_square;
  int n;
} tally;

static void add_currents(tally *sum, const fx_scene *scene, const fx_trace *fixed, const sf_net_trace *real, int t)
{
  for (int l = 0; l < SF_LAYERS; l++)
    for (int o = 0; o < scene->net.layer[l].n_out; o++) {
      const double exact = real->current[l][t][o], d = fixed->current[l][t][o] * scene->units.current_scale[l] - exact;
      sum->current_error[l] += d * d, sum->current_energy[l] += exact * exact;
    }
}

static void add_sample(tally *sum, const fx_scene *scene, const sf_model *m, uint64_t sample, fx_trace *fixed,
                       sf_net_trace *real)
{
  uint32_t pos[3];
  float x[3], sh[16], f[32], sigma[SF_T_MAX], colour[SF_T_MAX * 3];
  int16_t q[32], dir[16];
  int32_t base[SF_LANES];
  fx_out out;
  draw(sample, pos, x, sh);
  sf_grid_features(m, x, f);
  sf_net_sample(m, f, sh, scene->net.steps, sigma, colour, real);
  fx_grid_features(&scene->grid, pos, q, NULL);
  for (int i = 0; i < 16; i++) dir[i] = (int16_t)nearbyint(sh[i] / scene->units.dir_scale);
  fx_net_direction(&scene->net, dir, base, NULL);
  fx_net_sample(&scene->net, q, base, &out, fixed, NULL);
  const int last = scene->net.steps - 1;
  for (int t = 0; t <= last; t++) add_currents(sum, scene, fixed, real, t);
  for (int o = 0; o < 3; o++) {
    const double c = colour[last * 3 + o];
    sum->colour += c / 3, sum->colour_square += c * c / 3;
    sum->colour_error += pow(sf_fx_colour_value(out.colour[o]) - c, 2) / 3;
  }
  const double s = log(sigma[last]);
  sum->log += s, sum->log_square += s * s;
  sum->log_error += pow(log(fmax(sf_fx_sigma_value(scene, out.sigma), 1e-6)) - s, 2);
  sum->n++;
}

static double deviation(double sum, double square, int n)
{
  return sqrt(fmax(0, square / n - sum / n * (sum / n)));
}

/* Bounds. With the float nets' own spikes as inputs every layer's currents are within 4 % (the report, held-out
 * samples); D1's, whose input is the grid, within 3 %. Behind D1 a neuron near its threshold may flip: the outputs must
 * still follow the float nets, with an error below 3/4 (colour) and 1/2 (log density) of their spread over the samples.
 */
static void check_model(int hidden, int levels, int mode)
{
  OWNED(sf_model) m = make_model(hidden, levels, mode);
  OWNED(fx_scene) scene;
  sf_quant_report report;
  tally sum = {0};
  fx_trace *fixed = malloc(sizeof *fixed);
  sf_net_trace *real = malloc(sizeof *real);
  quantise(&m, &scene, &report);
  for (uint64_t sample = 0; sample < 300; sample++) add_sample(&sum, &scene, &m, sample, fixed, real);
  printf("hidden %d levels %d mode %d: current error (its report)", hidden, levels, mode);
  for (int l = 0; l < SF_LAYERS; l++)
    printf(" %.2f %% (%.2f)", 100 * sqrt(sum.current_error[l] / sum.current_energy[l]), 100 * report.layer[l].error);
  const double colour = sqrt(sum.colour_error / sum.n), spread = deviation(sum.colour, sum.colour_square, sum.n);
  const double density = sqrt(sum.log_error / sum.n), density_spread = deviation(sum.log, sum.log_square, sum.n);
  printf("; colour %.4f of %.4f, log density %.4f of %.4f\n", colour, spread, density, density_spread);
  for (int l = 0; l < SF_LAYERS; l++) ck_assert(report.layer[l].error < 0.04);
  ck_assert(sqrt(sum.current_error[0] / sum.current_energy[0]) < 0.03);
  ck_assert(spread > 0.001 && colour < 0.75 * spread);
  ck_assert(density_spread > 0.001 && density < 0.5 * density_spread);
  free(fixed), free(real);
}

TEST(nets_against_float)
{
  check_model(128, 16, SF_HYBRID);
  check_model(128, 16, SF_NODECAY);
  check_model(64, 8, SF_DECAY);
  check_model(16, 1, SF_HYBRID);
}

/* Every D2 and C3 current through the tables against exp and the logistic function of the current it stands for: the
 * argument is rounded to 2^-13 (and 16 bits of factor: 2^-17 of up to 16) and the table adds 1e-6; half an LSB at the
 * end. */
TEST(output_functions_have_the_right_units)
{
  OWNED(sf_model) m = make_model(64, 4, SF_HYBRID);
  OWNED(fx_scene) scene;
  sf_quant_report report;
  quantise(&m, &scene, &report);
  const fx_net *net = &scene.net;
  for (int32_t c = -16256; c <= 16256; c++) {
    const double i = c * scene.units.current_scale[FX_D2], j = c * scene.units.current_scale[FX_C3];
    const double sigma = sf_fx_sigma_value(&scene, fx_exp2(fx_exp2_argument(c, &net->exp_in)));
    const double colour = sf_fx_colour_value(fx_sigmoid(fx_sigmoid_argument(c, &net->sigmoid_in)));
    if (i < 10) ck_assert_double_eq_tol(sigma, exp(i), 2.2e-4 * exp(i) + 0x1p-14 + 1e-9);
    ck_assert_double_eq_tol(colour, 1 / (1 + exp(-j)), fabs(j) < 8 ? 1e-4 : 4e-4);
  }
}

/* The fit keeps what it knows to be true of a solvable case: weights that are multiples of a unit come back. */
TEST(fit_recovers_exact_weights)
{
  enum { ROWS = 2000, IN = 12, OUT = 5 };
  int16_t *x = malloc(ROWS * IN * sizeof *x);
  float *target = calloc(ROWS * OUT, sizeof *target), w[OUT * IN];
  double lsb[IN];
  int8_t q[IN * SF_LANES] = {0};
  for (int i = 0; i < IN; i++) lsb[i] = i < 6 ? 0.25 : 0.5;
  for (int i = 0; i < OUT * IN; i++)
    w[i] = (float)(0.125 * (int)(sf_random_below(1, 1, (uint64_t)i, 255) - 127) / lsb[i % IN]);
  w[0] = (float)(0.125 * 127 / lsb[0]);
  for (int r = 0; r < ROWS; r++)
    for (int i = 0; i < IN; i++) {
      x[r * IN + i] = (int16_t)(sf_random_below(1, 2, (uint64_t)(r * IN + i), 2001) - 1000);
      for (int o = 0; o < OUT; o++) target[r * OUT + o] += w[o * IN + i] * (float)(x[r * IN + i] * lsb[i]);
    }
  const sf_fit_data data = {ROWS, IN, OUT, x, target};
  const sf_fit_weights weights = {w, IN, lsb, 1e-9, 127, 0};
  sf_quant_layer result;
  ck_ok(sf_fit_layer(&data, &weights, true, q, &result));
  ck_assert_double_eq_tol(result.unit, 0.125, 1e-9);
  ck_assert(result.error < 1e-6 && result.clipped == 0);
  for (int i = 0; i < IN; i++)
    for (int o = 0; o < OUT; o++) ck_assert_int_eq(q[i * SF_LANES + o], (int)lround(w[o * IN + i] * lsb[i] / 0.125));
  free(x), free(target);
}

/* Spikes of a real layer are correlated; letting rounding errors cancel must pay on samples outside the fit. */
TEST(refinement_lowers_the_held_out_error)
{
  OWNED(sf_model) m = make_model(128, 16, SF_HYBRID);
  OWNED(sf_calibration) c;
  ck_ok(sf_calibrate(&c, &m, 3, 5));
  const int rows = c.samples * 3;
  int16_t *x = malloc((size_t)rows * 128 * sizeof *x);
  int8_t q[128 * SF_LANES];
  double ones[SF_LANES];
  for (int i = 0; i < SF_LANES; i++) ones[i] = 1;
  for (int i = 0; i < rows * 128; i++) x[i] = c.spikes[FX_C1][i];
  const sf_fit_data data = {rows, 128, 128, x, c.target[FX_C2]};
  const sf_fit_weights weights = {sf_model_param(&m, SF_P_C2), 128, ones, 1e-9, 127, 0};
  sf_quant_layer rounded, refined;
  ck_ok(sf_fit_layer(&data, &weights, false, q, &rounded));
  ck_ok(sf_fit_layer(&data, &weights, true, q, &refined));
  printf("C2 held-out error: rounded %.3f %%, refined %.3f %%\n", 100 * rounded.error, 100 * refined.error);
  ck_assert(refined.error < rounded.error);
  free(x);
}

TEST(same_seed_same_bits_any_threads)
{
  OWNED(sf_model) m = make_model(64, 8, SF_HYBRID);
  OWNED(fx_scene) a, b;
  sf_quant_report report;
  omp_set_num_threads(1);
  quantise(&m, &a, &report);
  omp_set_num_threads(3);
  quantise(&m, &b, &report);
  ck_assert_mem_eq(a.grid.table, b.grid.table, (size_t)a.grid.entries * 2);
  for (int l = 0; l < SF_LAYERS; l++) {
    ck_assert_mem_eq(a.net.layer[l].w, b.net.layer[l].w, (size_t)a.net.layer[l].n_in * SF_LANES);
    ck_assert(a.units.current_scale[l] == b.units.current_scale[l] && a.net.layer[l].theta == b.net.layer[l].theta);
  }
}

TEST(refuses_what_it_cannot_represent)
{
  static const float bad[] = {NAN, INFINITY, -INFINITY};
  OWNED(sf_model) m = make_model(32, 4, SF_HYBRID);
  for (int id = 0; id < SF_P_COUNT; id++)
    for (int i = 0; i < 3 && sf_model_has(&m, id); i++) {
      float *value = sf_model_param(&m, id) + m.param[id].size - 1, kept = *value;
      *value = bad[i];
      assert_refused(&m, &plain, SF_E_RANGE, m.param[id].name);
      *value = kept;
    }
  m.config.net = SF_NET_ANN;
  assert_refused(&m, &plain, SF_E_UNSUPPORTED, "ANN");
  m.config.net = SF_NET_SNN;
  m.config.hidden = 144;
  assert_refused(&m, &plain, SF_E_UNSUPPORTED, "density.w1");
  m.config.hidden = 32;
  for (int i = 0; i < 3; i++) {
    static const char *const tensor[] = {"density.w1", "colour.w3", "colour.w4"};
    m.config.theta[i] = 1e-6f;
    assert_refused(&m, &plain, SF_E_UNSUPPORTED, tensor[i]);
    m.config.theta[i] = NAN;
    assert_refused(&m, &plain, SF_E_RANGE, "theta");
    m.config.theta[i] = 1;
  }
  m.t_r = 0;
  assert_refused(&m, &plain, SF_E_RANGE, "t_r");
  m.t_r = 5;
  assert_refused(&m, &plain, SF_E_RANGE, "t_r");
  m.t_r = 3;
  assert_refused(&m, &(sf_quant_options){.steps = 5}, SF_E_RANGE, "5 steps");
  assert_refused(&m, &(sf_quant_options){.background = {0, NAN, 0}}, SF_E_RANGE, "background[1]");
}

TEST(steps_and_leaks)
{
  OWNED(sf_model) m = make_model(32, 4, SF_DECAY);
  fx_scene scene;
  float *leak = sf_model_param(&m, SF_P_LEAK);
  leak[0] = 0, leak[1] = 100, leak[2] = -100, leak[3] = 1, leak[4] = -1;
  for (int steps = 0; steps <= 4; steps++) {
    ck_ok(sf_quantise(&scene, &m, "model", &(sf_quant_options){.steps = steps}));
    ck_assert_int_eq(scene.net.steps, steps ? steps : 3);
    ck_assert_int_eq(scene.net.mode, FX_DECAY);
    static const int32_t k[SF_LAYERS] = {2048, 4096, 0, 2994, 1102};
    for (int l = 0; l < SF_LAYERS; l++) ck_assert_int_eq(scene.net.layer[l].k, k[l]);
    ck_assert_int_eq(scene.step_q24, lround(sqrt(3.0) / 256 * 16777216));
    fx_scene_free(&scene);
  }
}

static int largest(const int8_t *value, size_t n)
{
  int most = 0;
  for (size_t i = 0; i < n; i++) most = abs(value[i]) > most ? abs(value[i]) : most;
  return most;
}

/* |h| when exactly the neurons fire that push one way: no spikes can give more. */
static int worst_h(const fx_layer *d2)
{
  int worst = 0;
  for (int sign = -1; sign <= 1; sign += 2)
    for (int o = 1; o < d2->n_out; o++) {
      int current = 0;
      for (int i = 0; i < d2->n_in; i++) current += sign * d2->w[i * SF_LANES + o] > 0 ? d2->w[i * SF_LANES + o] : 0;
      const int h = abs(current >> SF_H_SHIFT);
      worst = h > worst ? h : worst;
    }
  return worst;
}

/* Nothing that hardware of these widths would have to clip: weights, entries, leaks; features by the largest entry of
 * their level (interpolation is convex) and measured; harmonics; h. At the core's own width features may saturate. */
static void assert_widths_hold(const fx_scene *scene, const sf_quant_widths *w)
{
  const int input_max = (1 << (w->feature_bits - 1)) - 1;
  for (int l = 0; l < SF_LAYERS; l++) {
    const fx_layer *layer = &scene->net.layer[l];
    ck_assert_int_lt(largest(layer->w, (size_t)layer->n_in * SF_LANES), 1 << (w->weight_bits - 1));
    ck_assert_int_eq(layer->k & ((1 << (SF_LEAK_FRAC - w->leak_bits)) - 1), 0);
  }
  const int entry = largest(scene->grid.table, (size_t)scene->grid.entries * 2);
  ck_assert_int_lt(entry, 1 << (w->grid_bits - 1));
  ck_assert_int_le(worst_h(&scene->net.layer[FX_D2]), input_max);
  for (int l = 0; l < scene->grid.levels && w->feature_bits < SF_INPUT_BITS; l++)
    ck_assert_int_le((int)lround(ldexp(entry, 16 - scene->grid.shift[l])), input_max);
  for (uint64_t sample = 0; sample < 500; sample++) {
    uint32_t pos[3];
    int16_t f[32];
    fx_counts counts = {0};
    fx_ray ray;
    const float o[3] = {0, 0, 3};
    float d[3] = {normal(1, sample), normal(2, sample), normal(3, sample)};
    for (int a = 0; a < 3; a++) pos[a] = (uint32_t)sf_random_below(77, (uint64_t)a, sample, 1 << 24);
    if (sample < 3) d[0] = d[1] = 0, d[2] = sample == 0 ? 1 : -1; /* where harmonic 12 is largest */
    fx_grid_features(&scene->grid, pos, f, &counts);
    for (int i = 0; i < 2 * scene->grid.levels; i++) ck_assert_int_le(abs(f[i]), input_max);
    if (w->feature_bits < SF_INPUT_BITS) ck_assert_uint_eq(counts.saturated_features, 0);
    ck_ok(sf_fx_ray_make(scene, o, d, &ray));
    for (int i = 0; i < FX_SH; i++) ck_assert_int_le(abs(ray.dir[i]), input_max);
  }
}

static void assert_same_scene(const fx_scene *a, const fx_scene *b)
{
  ck_assert_mem_eq(a->grid.table, b->grid.table, (size_t)a->grid.entries * 2);
  ck_assert_mem_eq(a->grid.shift, b->grid.shift, sizeof a->grid.shift);
  ck_assert(a->units.dir_scale == b->units.dir_scale);
  for (int l = 0; l < SF_LAYERS; l++) {
    const fx_layer *x = &a->net.layer[l], *y = &b->net.layer[l];
    ck_assert_mem_eq(x->w, y->w, (size_t)x->n_in * SF_LANES);
    ck_assert(x->k == y->k && x->theta == y->theta && a->units.current_scale[l] == b->units.current_scale[l]);
  }
}

TEST(widths)
{
  static const struct {
    size_t offset;
    int low, high;
  } field[] = {{offsetof(sf_quant_widths, weight_bits), 2, SF_WEIGHT_BITS},
               {offsetof(sf_quant_widths, feature_bits), 8, SF_INPUT_BITS},
               {offsetof(sf_quant_widths, leak_bits), 4, SF_LEAK_FRAC},
               {offsetof(sf_quant_widths, grid_bits), 2, SF_GRID_BITS}};
  OWNED(sf_model) m = make_model(32, 4, SF_HYBRID);
  fx_scene whole, scene;
  sf_quant_report report;
  quantise(&m, &whole, &report);
  const int64_t packed = report.packed_bytes;
  assert_widths_hold(&whole, &report.widths);
  for (int i = 0; i < 4; i++)
    for (int bits = field[i].low; bits <= field[i].high; bits++) {
      sf_quant_options options = plain;
      *(int *)((char *)&options.widths + field[i].offset) = bits;
      ck_ok(sf_quantise_report(&scene, &m, "model", &options, &report));
      ck_assert_int_eq(*(int *)((char *)&report.widths + field[i].offset), bits);
      assert_widths_hold(&scene, &report.widths);
      if (bits == field[i].high) assert_same_scene(&whole, &scene);
      ck_assert(i % 3 || bits == field[i].high ? report.packed_bytes <= packed : report.packed_bytes < packed);
      fx_scene_free(&scene);
      *(int *)((char *)&options.widths + field[i].offset) = bits == field[i].low ? bits - 1 : field[i].high + 1;
      assert_refused(&m, &options, SF_E_RANGE, "bits asked for");
    }
  const sf_quant_options narrow = {.background = {1, 1, 1}, .seed = 1, .widths = {4, 8, 4, 4}};
  ck_ok(sf_quantise_report(&scene, &m, "model", &narrow, &report));
  assert_widths_hold(&scene, &report.widths);
  fx_scene_free(&scene);
  fx_scene_free(&whole);
}

/* A model whose calibration does not show how wide its inputs get: 128 equal weights, so that h could be 128 * 127 / 8
 * = 2032; a field that is 20 times larger outside the only occupied cell; directions that matter to no neuron, so that
 * no search avoids a fine LSB. */
TEST(narrow_inputs_never_clip)
{
  OWNED(sf_model) m = make_model(128, 2, SF_HYBRID);
  fx_scene scene;
  sf_quant_report report;
  float *w3 = sf_model_param(&m, SF_P_C1), *grid = sf_model_param(&m, SF_P_GRID);
  memset(m.occupancy, 0, 512);
  m.occupancy[0] = 1; /* the first of 16^3 cells: the first 4 points of level 0 along every axis hold it */
  for (uint32_t i = 0; i < 2 * m.level[0].entries; i++) grid[i] *= 20;
  for (uint32_t i = 0; i < 64; i++) {
    const uint32_t entry = (i % 4 ^ i / 4 % 4 * 2654435761u ^ i / 16 * 805459861u) % m.level[0].entries;
    grid[2 * entry] = grid[2 * entry + 1] = 0.5f;
  }
  for (size_t i = 0; i < m.param[SF_P_D2].size; i++) sf_model_param(&m, SF_P_D2)[i] = 0.5f;
  for (size_t i = 0; i < m.param[SF_P_C1].size; i++)
    if (i % (SF_DIR_FEATURES + SF_GEO_FEATURES) < SF_DIR_FEATURES) w3[i] = 0;
  quantise(&m, &scene, &report);
  ck_assert_int_gt(worst_h(&scene.net.layer[FX_D2]), 1023);
  fx_scene_free(&scene);
  for (int bits = 8; bits < SF_INPUT_BITS; bits++) {
    const sf_quant_options options = {.seed = 1, .widths.feature_bits = bits};
    ck_ok(sf_quantise_report(&scene, &m, "model", &options, &report));
    assert_widths_hold(&scene, &report.widths);
    fx_scene_free(&scene);
  }
}

/* Models at the edge of sense still give a scene that passes its check, and scales that a model's file may hold. */
TEST(extreme_models)
{
  static const float scales[] = {0, 1e-42f, 1e-20f, 1e-4f, 1};
  for (int i = 0; i < 5; i++)
    for (int part = 0; part < SF_P_LEAK; part++) {
      sf_model m = make_model(16, 3, SF_HYBRID);
      fx_scene scene;
      sf_quant_report report;
      float *value = sf_model_param(&m, part);
      if (!sf_model_has(&m, part)) {
        sf_model_free(&m);
        continue;
      }
      if (scales[i] != 1)
        for (size_t n = 0; n < m.param[part].size; n++) value[n] *= scales[i];
      if (scales[i] == 1) m.config.theta[part % 3] = 1e6f, memset(m.occupancy, 0, 512);
      if (scales[i] == 1e-4f && part == SF_P_GRID)
        memset(value, 0, m.param[part].size / 16 * sizeof *value); /* a level, too */
      m.config.scale = i % 2 ? 1e-6f : 1e6f;
      const sf_status status = sf_quantise_report(&scene, &m, "model", &plain, &report);
      ck_assert_msg(status.code == SF_OK, "part %d scale %g: %s", part, (double)scales[i], status.message);
      for (int n = 0; n < SF_SCALES; n++) {
        const float lsb = ((const float *)&report.scales.lsb)[n];
        ck_assert_msg(lsb > 1e-30f && lsb < 1e30f, "part %d scale %g: LSB %d is %g", part, (double)scales[i], n,
                      (double)lsb);
      }
      fx_scene_free(&scene);
      sf_model_free(&m);
    }
}

int ck_timeout = 300;
