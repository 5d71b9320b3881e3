/* Quantiser: fixed against float per block, refusals, determinism. */
#include "ck_run.h"
#include "folder_fixture.h"
#include "src/fx/unit.h"
#include "src/quant/internal.h"
#include "tests/quant_fixture.h"
#include <math.h>
#include <omp.h>

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

static double largest_feature(const sf_calibration *c)
{
  double largest = 0;
  for (size_t i = 0; i < (size_t)c->samples * (size_t)c->features; i++) largest = fmax(largest, fabs((double)c->f[i]));
  return largest;
}

/* The LSB of features: the power of two of the least squared error, of four that clip more and more. A level's own is
 * that times less than two. The largest feature is this times the largest that a power of two holds. */
LOOP_TEST(the_best_power_of_two, 3)
{
  static const double beyond[] = {0.999, 1.0005, 1.5};
  OWNED(sf_model) m = make_model(32, 4, SF_HYBRID);
  OWNED(sf_calibration) c;
  OWNED(fx_scene) scene;
  sf_quant_report report;
  ck_ok(sf_calibrate(&c, &m, m.t_r, plain.seed));
  const double factor = beyond[_i] * ldexp(2047, -9) / largest_feature(&c);
  for (size_t i = 0; i < m.param[SF_P_GRID].size; i++) sf_model_param(&m, SF_P_GRID)[i] *= (float)factor;
  sf_calibration_free(&c);
  ck_ok(sf_calibrate(&c, &m, m.t_r, plain.seed));
  ck_assert_double_eq_tol(largest_feature(&c), beyond[_i] * ldexp(2047, -9), 1e-5);
  double least = INFINITY;
  int best = 0;
  for (int e = _i ? -8 : -9, trial = 0; trial < 4; trial++, e--) {
    double error = 0;
    for (size_t i = 0; i < (size_t)c.samples * (size_t)c.features; i++) {
      const double kept = fmin(fmax(nearbyint(ldexp((double)c.f[i], -e)), -2047), 2047);
      error += pow((double)c.f[i] - ldexp(kept, e), 2);
    }
    if (error < least) least = error, best = e;
  }
  ck_assert_int_eq(best, _i < 2 ? -9 : -8);
  quantise(&m, &scene, &report);
  for (int l = 0; l < 4; l++) {
    ck_assert_int_gt(scene.grid.shift[l], 0);
    ck_assert_int_lt(scene.grid.shift[l], 31);
    ck_assert_int_eq((int)floor(log2(scene.units.feature_scale[l])), best);
  }
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
      const int digits = l == FX_C2 && scene->net.mode == FX_RADIX ? scene->net.steps : 0; /* one of all steps */
      const double exact = real->current[l][t][o];
      const double d = ldexp(fixed->current[l][t][o] * scene->units.current_scale[l], -digits) - exact;
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
  check_model(64, 8, SF_RADIX);
  check_model(16, 1, SF_HYBRID);
}

/* Root mean square error of the colours with the integer weights of C3 and the float net's own spikes, on other samples
 * than the quantiser's. */
static double colour_error(const sf_model *m, const fx_scene *scene)
{
  sf_net_trace *real = malloc(sizeof *real);
  const bool behind = m->config.mode == SF_RADIX;
  double error = 0;
  for (uint64_t sample = 0; sample < 300; sample++) {
    uint32_t pos[3];
    float x[3], sh[16], f[32], sigma[SF_T_MAX], colour[SF_T_MAX * 3];
    draw(sample, pos, x, sh);
    sf_grid_features(m, x, f);
    sf_net_sample(m, f, sh, scene->net.steps, sigma, colour, real);
    double exact[3] = {0}, found[3] = {0};
    const double weights = behind ? 1 : scene->net.steps;
    for (int t = 0; t < scene->net.steps; t++) {
      for (int o = 0; o < 3; o++) {
        int current = 0;
        for (int i = 0; i < m->config.hidden; i++)
          current += real->spike[FX_C2][t][i] ? scene->net.layer[FX_C3].w[i * SF_LANES + o] : 0;
        const double j[2] = {real->current[FX_C3][t][o], current * scene->units.current_scale[FX_C3]};
        exact[o] += behind ? ldexp(j[0], -t - 1) : 1 / (1 + exp(-j[0]));
        found[o] += behind ? ldexp(j[1], -t - 1) : 1 / (1 + exp(-j[1]));
      }
    }
    for (int o = 0; o < 3; o++) {
      const double mean[2] = {exact[o] / weights, found[o] / weights};
      error += behind ? pow(1 / (1 + exp(-mean[0])) - 1 / (1 + exp(-mean[1])), 2) : pow(mean[0] - mean[1], 2);
    }
  }
  free(real);
  return sqrt(error / 900);
}

/* Training makes a weight of C3 large where a colour is black or full. Its unit would be five times too coarse for the
 * others. Weights of an ordinary size are as they were: nothing limits them. */
LOOP_TEST(one_large_weight_does_not_coarsen_the_others, 2)
{
  OWNED(sf_model) m = make_model(64, 4, _i ? SF_RADIX : SF_HYBRID);
  float *large = sf_model_param(&m, SF_P_C3) + 2 * 64 + 7;
  double error[2], unit[2];
  for (int i = 0; i < 2; i++) {
    OWNED(fx_scene) scene;
    sf_quant_report report;
    *large = i ? (_i ? -200 : -20) : *large; /* the last digit counts little */
    quantise(&m, &scene, &report);
    error[i] = colour_error(&m, &scene);
    unit[i] = report.layer[FX_C3].unit;
    ck_assert_int_eq(report.layer[FX_C3].clipped > 0, i);
  }
  printf("C3: units %.4f, %.4f, colours off by %.5f, %.5f\n", unit[0], unit[1], error[0], error[1]);
  ck_assert_double_lt(error[1], _i ? 0.03 : 0.005);
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

/* A ray ends where the model says: floor(stop 2^20). A file that does not say means 1e-4. */
TEST(where_rays_end)
{
  static const struct {
    double stop;
    bool said;
    int expected;
  } cases[] = {{0.01, true, 10485}, {1e-4, false, 104}, {SF_STOP_MIN, true, 1}, {SF_STOP_MAX, true, 52428}};
  OWNED(sf_model) m = make_model(32, 4, SF_HYBRID);
  for (int i = 0; i < COUNT(cases); i++) {
    OWNED(sf_model) back = {0};
    OWNED(fx_scene) scene = {0};
    OWNED(sf_tensors) set = {0};
    m.config.stop = cases[i].stop;
    ck_ok(sf_model_save(&m, in("stop.safetensors")));
    ck_ok(sf_tensors_load(&set, in("stop.safetensors")));
    ck_assert_ptr_nonnull(sf_tensors_meta(&set, "stop"));
    if (!cases[i].said) cJSON_DeleteItemFromObjectCaseSensitive(set.metadata, "stop");
    ck_ok(sf_tensors_save(set.tensor, set.count, set.metadata, in("edited.safetensors")));
    ck_ok(sf_model_load(&back, in("edited.safetensors")));
    ck_assert_double_eq(back.config.stop, cases[i].stop);
    ck_ok(sf_quantise(&scene, &back, "model", &plain));
    ck_assert_int_eq(scene.trans_stop, cases[i].expected);
  }
  m.config.stop = 2 * SF_STOP_MAX;
  ck_bad(sf_config_check(&m.config), SF_E_RANGE, "stop", "outside 1e-06..0.05");
}

/* Weights so small that theta is at the end of its range: of radix half of that of the others. */
TEST(largest_thresholds)
{
  for (int mode = SF_HYBRID; mode <= SF_RADIX; mode++) {
    OWNED(sf_model) m = make_model(32, 4, mode);
    OWNED(fx_scene) scene;
    sf_quant_report report;
    for (int s = 0; s < 3; s++) m.config.theta[s] = 5000;
    quantise(&m, &scene, &report);
    const int32_t limit = (1 << (mode == SF_RADIX ? 22 : 23)) - 1;
    for (int s = 0; s < FX_SPIKING; s++) {
      const int32_t theta = scene.net.layer[fx_spiking_layers[s]].theta;
      ck_assert_msg(theta <= limit && theta > limit - limit / 50, "mode %d: theta %d of %d", mode, theta, limit);
    }
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

int ck_timeout = 300;
ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};
