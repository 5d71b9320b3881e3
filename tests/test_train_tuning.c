/* Fine-tuning for few bits: what it trains is what the exporter writes. */
#include "ck_run.h"
#include "snn/kernels.h"
#include "base/io.h"
#include "quant/quant.h"
#include "train_fixture.h"

enum { BITS = 4, LIMIT = 7 };

static const sf_param_id weights_of[SF_LAYERS] = {SF_P_D1, SF_P_D2, SF_P_C1, SF_P_C2, SF_P_C3};
static sf_model base; /* trained for a moment, its scales settled */

static void settle(sf_model *m, int bits)
{
  OWNED(fx_scene) scene;
  sf_quant_report report;
  ck_ok(sf_quantise_report(&scene, m, "base", &(sf_quant_options){.widths.weight_bits = bits}, &report));
  m->scales = report.scales;
}

static void set_up(void)
{
  open_scene(6);
  sf_train_options o = small_run();
  o.fixed_steps = 1; /* what a sample adds up over its steps is then that of the first one */
  sf_trainer *t = start(&data, &o, NULL);
  steps(t, o.stage1 + o.stage2);
  ck_ok(sf_trainer_save(t, in("base.safetensors"), false));
  sf_trainer_free(t);
  ck_ok(sf_model_load(&base, in("base.safetensors")));
  ck_assert_int_eq(base.scales.weight_bits, 0);
  settle(&base, BITS);
}

static void tear_down(void)
{
  sf_model_free(&base);
  close_scene();
}

static sf_train_options tuning_run(void)
{
  sf_train_options o = small_run();
  o.start = &base;
  o.stage2 = 40;
  return o;
}

/* Every float weight is the integer of the export times its step, to the last bit; so are the thresholds. Returns how
 * many integers differ from those of `other`, another export. */
static int same_integers(const sf_model *m, const fx_scene *scene, const fx_scene *other)
{
  int moved = 0;
  for (int l = 0; l < SF_LAYERS; l++) {
    const sf_param *p = &m->param[weights_of[l]];
    for (int in = 0; in < p->shape[1]; in++)
      for (int out = 0; out < p->shape[0]; out++) {
        const int at = in * SF_LANES + out, q = scene->net.layer[l].w[at];
        const double step = m->scales.lsb.current[l] / sf_scales_input(m, l, in);
        ck_assert_int_le(abs(q), LIMIT);
        ck_assert_float_eq(m->value[p->offset + (size_t)(out * p->shape[1] + in)], (float)(q * step));
        moved += q != other->net.layer[l].w[at];
      }
  }
  static const int spiking[3] = {0, 2, 3}, frac[3] = {0, 0, SF_AC_FRAC};
  for (int i = 0; i < 3; i++) {
    const float lsb = ldexpf(m->scales.lsb.current[spiking[i]], -frac[i]);
    ck_assert_float_eq(m->config.theta[i], lsb * (float)scene->net.layer[spiking[i]].theta);
  }
  return moved;
}

TEST(export_reproduces_the_rounded_weights)
{
  const sf_train_options o = tuning_run();
  const sf_quant_options as_recorded = {.background = {1, 1, 1}};
  OWNED(trainer) t = start(&data, &o, NULL);
  OWNED(fx_scene) before, after, loaded;
  OWNED(sf_model) m;
  ck_ok(sf_quantise(&before, &base, "base", &as_recorded));
  const sf_train_stats stats = steps(t, o.stage2);
  ck_assert_int_eq(stats.stage, 3);
  ck_assert_int_eq(stats.t_r, base.t_r);
  ck_assert_int_eq(memcmp(t->model.occupancy, base.occupancy, 16 * 16 * 16 / 8), 0);
  ck_ok(sf_quantise(&after, &t->model, "tuned", &as_recorded));
  ck_assert_int_gt(same_integers(&t->model, &after, &before), 50); /* of 3664 weights: it has learned */
  ck_ok(sf_trainer_save(t, in("tuned.safetensors"), false));
  ck_ok(sf_model_load(&m, in("tuned.safetensors")));
  ck_assert_int_eq(memcmp(&m.scales, &base.scales, sizeof m.scales), 0);
  ck_ok(sf_quantise(&loaded, &m, "tuned", &as_recorded));
  ck_assert_int_eq(same_integers(&m, &loaded, &after), 0);
  for (int l = 0; l < base.config.levels; l++) {
    ck_assert_double_eq(loaded.units.feature_scale[l], base.scales.lsb.feature[l]);
    ck_assert_int_eq(loaded.grid.shift[l], before.grid.shift[l]);
  }
  ck_assert_double_eq(loaded.units.dir_scale, base.scales.lsb.direction);
}

TEST(resume_continues_bit_identically)
{
  const sf_train_options o = tuning_run();
  sf_train_options again = o;
  again.start = NULL;
  ck_resume(&o, &again, 17, o.stage2 - 17);
}

/* The core on integers against the float nets on what they stand for, inputs on their grids: equal currents at t = 0
 * but for float sums (128 terms: 1e-5 of their size), h rounded down in both. C1's currents are so coarse that some
 * equal the threshold, where a float sum may fall short: such samples, at most 48 of 64, say nothing of C2. */
TEST(float_nets_compute_what_the_core_does)
{
  const sf_train_options o = tuning_run();
  const int F = 2 * o.config.levels;
  OWNED(trainer) t = start(&data, &o, NULL);
  steps(t, o.stage2);
  const sf_model *m = &t->model;
  const sf_scales *s = &m->scales;
  OWNED(fx_scene) scene;
  ck_ok(sf_quantise(&scene, m, "tuned", &(sf_quant_options){0}));
  fx_trace *fixed = calloc(1, sizeof *fixed);
  sf_net_trace *real = calloc(1, sizeof *real);
  int spikes = 0, rounded = 0;
  int edges = 0, ties = 0;
  for (int n = 0; n < 64; n++) {
    int16_t f[2 * FX_LEVELS_MAX], d[SF_DIR_FEATURES];
    float ff[2 * FX_LEVELS_MAX], sh[SF_DIR_FEATURES], sigma[SF_T_MAX], colour[3 * SF_T_MAX];
    int32_t c1[SF_LANES];
    fx_out out;
    for (int i = 0; i < F; i++) {
      f[i] = (int16_t)(sf_random_below(7, 1, (uint64_t)(n * F + i), 801) - 400);
      ff[i] = f[i] * s->lsb.feature[i / 2];
    }
    for (int i = 0; i < SF_DIR_FEATURES; i++) sh[i] = sf_random_float(7, 2, (uint64_t)(n * 16 + i)) - 0.5f;
    sf_scales_round_direction(s, sh, SF_DIR_FEATURES);
    for (int i = 0; i < SF_DIR_FEATURES; i++) d[i] = (int16_t)lroundf(sh[i] / s->lsb.direction);
    fx_net_direction(&scene.net, d, c1, NULL);
    fx_net_sample(&scene.net, f, c1, &out, fixed, NULL);
    sf_net_sample(m, ff, sh, 1, sigma, colour, real);
    bool edge = false, tie = false; /* at the threshold of C1, of D1, the float sum's rounding decides */
    for (int i = 0; i < m->config.hidden; i++) {
      tie |= fabsf(real->current[0][0][i] - m->config.theta[0]) < 1e-5f;
      edge |= fabsf(real->current[2][0][i] - m->config.theta[1]) < 1e-4f;
    }
    ties += tie;
    edges += edge;
    for (int l = 0; l < SF_LAYERS - 1 && !tie; l++)
      for (int i = 0; i < m->param[weights_of[l]].shape[0]; i++) {
        const double exact = (double)fixed->current[l][0][i] * s->lsb.current[l];
        const bool equal = fabs(real->current[l][0][i] - exact) <= 1e-4 * (1 + fabs(exact));
        if (l < 3 || !edge)
          ck_assert_msg(equal, "layer %d neuron %d: %g, core %g", l, i, (double)real->current[l][0][i], exact);
        spikes += real->spike[l][0][i];
        rounded += l == 1 && i && fixed->current[l][0][i] % (1 << SF_H_SHIFT);
      }
  }
  ck_assert_int_le(edges, 48);
  ck_assert_int_le(ties, 8);
  ck_assert_int_gt(spikes, 100);
  ck_assert_int_gt(rounded, 100);
  free(fixed);
  free(real);
}

/* The vector kernels round h as the scalar nets do. */
TEST(kernels_round_h_as_the_oracle)
{
  sf_model m = base;
  sf_net_view view = sf_net_view_of(&m);
  const sf_kernels *kernels = sf_kernels_select(NULL);
  sf_net_words *words = sf_aligned_alloc(sizeof *words);
  sf_block *block = sf_aligned_alloc(sizeof *block);
  sf_net_scratch *scratch = sf_aligned_alloc(sizeof *scratch);
  ck_assert_float_eq(view.h_step, ldexpf(m.scales.lsb.current[1], SF_H_SHIFT));
  for (int i = 0; i < 2 * m.config.levels * SF_BLOCK; i++) block->f[i] = sf_random_float(8, 1, (uint64_t)i) - 0.5f;
  for (int i = 0; i < SF_DIR_FEATURES * SF_BLOCK; i++) block->sh[i] = sf_random_float(8, 2, (uint64_t)i) - 0.5f;
  sf_scales_round(&m, m.value); /* currents are then multiples of their LSB, never close to a step's edge */
  kernels->prepare(&view, words);
  kernels->forward(words, block, 1, 1, scratch);
  for (int lane = 0; lane < SF_BLOCK; lane++) {
    float f[2 * FX_LEVELS_MAX], sh[SF_DIR_FEATURES], sigma, colour[3];
    for (int i = 0; i < 2 * m.config.levels; i++) f[i] = block->f[i * SF_BLOCK + lane];
    for (int i = 0; i < SF_DIR_FEATURES; i++) sh[i] = block->sh[i * SF_BLOCK + lane];
    sf_net_sample(&m, f, sh, 1, &sigma, colour, NULL);
    ck_assert_float_eq_tol(block->sigma[0][lane], sigma, 1e-4f * sigma); /* a spike more or less would show */
    for (int c = 0; c < 3; c++) ck_assert_float_eq_tol(block->colour[0][c * SF_BLOCK + lane], colour[c], 1e-4f);
  }
  free(words);
  free(block);
  free(scratch);
}

TEST(damaged_scales_are_refused)
{
  const sf_train_options o = tuning_run();
  OWNED(trainer) t = start(&data, &o, NULL);
  t->model.scales.weight_bits = 9;
  ck_refused(t, "weight_bits", "9");
  t->model.scales.weight_bits = BITS;
  t->model.scales.lsb.current[2] = 0;
  ck_refused(t, "scales", "35");
}

int ck_timeout = 180;
ck_options ck_program = {.set_up_all = set_up, .tear_down_all = tear_down, .one_process = true};
