/* Fine-tuning of a TensoRF model for few bits: what it trains is what the exporter writes. */
#include "ck_run.h"
#include "base/io.h"
#include "quant/quant.h"
#include "render/vm_ray.h"
#include "snn/plif.h"
#include "sweep/sweep.h"
#include "train/vm.h"
#include "train_fixture.h"
#include <omp.h>

enum { BITS = 4, GRID_BITS = 5, LEAK_BITS = 6, TUNING = CK_AMOUNT(80, 24) };

static sf_model base, narrow; /* trained for a moment; scales settled: weights alone, and every width */

static void settle(sf_model *m, sf_quant_widths widths)
{
  OWNED(fx_scene) scene;
  sf_quant_report report;
  ck_ok(sf_quantise_report(&scene, m, "base", &(sf_quant_options){.widths = widths}, &report));
  m->scales = report.scales;
}

static void set_up(void)
{
  open_scene(6);
  sf_train_options o = sf_train_defaults_tensorf(&data);
  o.config.hidden = 32;
  o.config.steps = 2;
  o.config.occ_res = 16;
  o.voxels = 20;
  o.rays = 128;
  o.samples = 2048;
  o.stage1 = 40;
  o.stage2 = 80;
  sf_trainer *t = start(&data, &o, NULL);
  steps(t, o.stage1 + o.stage2);
  ck_ok(sf_trainer_save(t, in("base.safetensors"), false));
  sf_trainer_free(t);
  ck_ok(sf_model_load(&base, in("base.safetensors")));
  ck_ok(sf_model_load(&narrow, in("base.safetensors")));
  settle(&base, (sf_quant_widths){.weight_bits = BITS});
  settle(&narrow, (sf_quant_widths){.weight_bits = BITS, .grid_bits = GRID_BITS, .leak_bits = LEAK_BITS});
}

static void tear_down(void)
{
  sf_model_free(&base);
  sf_model_free(&narrow);
  close_scene();
}

static sf_train_options tuning_run(const sf_model *from)
{
  sf_train_options o = sf_train_defaults_tensorf(&data);
  o.start = from;
  o.rays = 128;
  o.samples = 2048;
  o.stage2 = TUNING;
  return o;
}

/* A number of the model against its integer: differing ones are counted, so that a test can see that it would. */
static int differs(float value, int q, double step)
{
  return value != (float)(q * step);
}

/* Weights and biases of the layers, the basis matrix. */
static int wrong_weights(const sf_model *m, const fx_scene *scene)
{
  static const sf_param_id weights[3] = {SF_P_C1, SF_P_C2, SF_P_C3},
                           bias[3] = {SF_P_C1_BIAS, SF_P_C2_BIAS, SF_P_C3_BIAS};
  const struct sf_lsb *lsb = &m->scales.lsb;
  int wrong = 0;
  for (int l = 0; l < 3; l++) {
    const sf_param *p = &m->param[weights[l]];
    const fx_layer *layer = &scene->net.layer[2 + l];
    const int n_in = (int)p->shape[1];
    for (int out = 0; out < p->shape[0]; out++) {
      for (int i = 0; i < n_in; i++)
        wrong += differs(m->value[p->offset + (size_t)(out * n_in + i)], layer->w[i * SF_LANES + out],
                         lsb->current[2 + l] / sf_scales_input(m, 2 + l, i));
      wrong += differs(sf_model_param(m, bias[l])[out], layer->w[n_in * SF_LANES + out],
                       lsb->current[2 + l] / (l == 0 ? (double)lsb->bias : 1));
    }
  }
  const sf_param *p = &m->param[SF_P_BASIS];
  for (int f = 0; f < p->shape[0]; f++)
    for (int c = 0; c < p->shape[1]; c++)
      wrong += differs(m->value[p->offset + (size_t)(f * p->shape[1] + c)],
                       scene->tensorf.basis[c * FX_APPEARANCE_MAX + f], lsb->basis / (lsb->product[1][c] / 2.0));
  return wrong;
}

/* Entries of all planes and lines. */
static int wrong_entries(const sf_model *m, const fx_scene *scene)
{
  int wrong = 0;
  for (int app = 0; app < 2; app++) {
    const fx_factors *to = app ? &scene->tensorf.appearance : &scene->tensorf.density;
    for (int mode = 0, first = 0; mode < 3; first += to->components[mode++])
      for (int line = 0; line < 2; line++) {
        const sf_param *p = &m->param[(app ? SF_P_APP_PLANE : SF_P_DENSITY_PLANE) + 3 * line + mode];
        const int8_t *q = line ? to->line[mode] : to->plane[mode];
        for (size_t i = 0; i < p->size; i++) {
          const size_t c = (size_t)first + i % (size_t)to->components[mode];
          const double plane = m->scales.lsb.plane[app][c], product = m->scales.lsb.product[app][c];
          wrong += differs(m->value[p->offset + i], q[i], line ? product / plane : plane);
        }
      }
  }
  return wrong;
}

static int moved(const fx_scene *a, const fx_scene *b)
{
  int count = 0;
  for (int l = 2; l < SF_LAYERS; l++)
    for (int i = 0; i < fx_layer_rows(&a->net.layer[l]) * SF_LANES; i++)
      count += a->net.layer[l].w[i] != b->net.layer[l].w[i];
  return count;
}

static void check_thresholds(const sf_model *m, const fx_scene *scene)
{
  for (int l = 2; l < 4; l++) {
    const float lsb = ldexpf(m->scales.lsb.current[l], l == 3 ? -SF_AC_FRAC : 0);
    ck_assert_float_eq(m->config.theta[l - 1], lsb * (float)scene->net.layer[l].theta);
  }
}

TEST(export_reproduces_the_rounded_numbers)
{
  const sf_model *const from[2] = {&base, &narrow};
  const sf_quant_options as_recorded = {.background = {1, 1, 1}};
  for (int i = 0; i < 2; i++) {
    const sf_train_options o = tuning_run(from[i]);
    OWNED(trainer) t = start(&data, &o, NULL);
    OWNED(fx_scene) before, after, loaded;
    OWNED(sf_model) m;
    ck_ok(sf_quantise(&before, from[i], "base", &as_recorded));
    const sf_train_stats stats = steps(t, o.stage2);
    ck_assert_int_eq(stats.stage, 3);
    ck_assert_int_eq(stats.t_r, base.t_r);
    ck_assert_int_eq(memcmp(t->model.occupancy, base.occupancy, 16 * 16 * 16 / 8), 0);
    ck_ok(sf_trainer_save(t, in("tuned.safetensors"), false));
    ck_ok(sf_model_load(&m, in("tuned.safetensors")));
    ck_assert_int_eq(memcmp(&m.scales, &from[i]->scales, sizeof m.scales), 0);
    ck_ok(sf_quantise(&after, &m, "tuned", &as_recorded));
    ck_assert_int_gt(moved(&before, &after), 50); /* it has learned */
    ck_assert_int_eq(wrong_weights(&m, &after), 0);
    check_thresholds(&m, &after);
    ck_assert_double_eq(after.units.feature_scale[0], m.scales.lsb.feature[0]);
    ck_assert_double_eq(after.units.dir_scale, m.scales.lsb.direction);
    const int wrong = wrong_entries(&m, &after);
    if (i) ck_assert_int_eq(wrong, 0);
    if (!i) ck_assert_int_gt(wrong, 1000); /* entries as wide as the core's stay real numbers */
    for (int l = 2; l < SF_LAYERS && i; l++)
      ck_assert_float_eq_tol(1 / (1 + expf(-sf_model_param(&m, SF_P_LEAK)[l])),
                             (float)after.net.layer[l].k / (1 << SF_LEAK_FRAC), 1e-6f);
    for (int l = 2; l < SF_LAYERS && i; l++)
      ck_assert_int_eq(after.net.layer[l].k % (1 << (SF_LEAK_FRAC - LEAK_BITS)), 0);
    sf_model_param(&m, SF_P_C2_BIAS)[3] += m.scales.lsb.current[3]; /* and what is not so is seen */
    sf_model_param(&m, SF_P_BASIS)[5] *= 1.001f;
    ck_assert_int_ge(wrong_weights(&m, &after), 1);
  }
}

/* While it trains: what the kernels read are numbers that the exporter would write. */
TEST(forward_pass_sees_rounded_numbers)
{
  const sf_model *const from[2] = {&base, &narrow};
  for (int i = 0; i < 2; i++) {
    const sf_train_options o = tuning_run(from[i]);
    OWNED(trainer) t = start(&data, &o, NULL);
    OWNED(fx_scene) scene;
    steps(t, 8);
    sf_model seen = sf_tuning_nets(t);
    const sf_decoder_view *view = &t->vm->decoder->view;
    ck_assert_ptr_eq(view->basis, sf_model_param(&seen, SF_P_BASIS));
    ck_assert_ptr_eq(view->b1, sf_model_param(&seen, SF_P_C1_BIAS));
    ck_assert_ptr_eq(view->net.w5, sf_model_param(&seen, SF_P_C3));
    ck_assert_ptr_eq(t->vm->density.line[2], sf_model_param(i ? &seen : &t->model, SF_P_DENSITY_LINE + 2));
    ck_assert_ptr_eq(t->vm->appearance.plane[1], sf_model_param(i ? &seen : &t->model, SF_P_APP_PLANE + 1));
    if (!i) memcpy(seen.value, t->model.value, seen.param[SF_P_BASIS].offset * sizeof *seen.value);
    ck_ok(sf_quantise(&scene, &seen, "seen", &(sf_quant_options){0}));
    ck_assert_int_eq(wrong_weights(&seen, &scene), 0);
    if (i) ck_assert_int_eq(wrong_entries(&seen, &scene), 0);
    ck_assert_int_eq(memcmp(view->net.k + 2,
                            (float[3]){sf_sigmoid(sf_model_param(&seen, SF_P_LEAK)[2]),
                                       sf_sigmoid(sf_model_param(&seen, SF_P_LEAK)[3]),
                                       sf_sigmoid(sf_model_param(&seen, SF_P_LEAK)[4])},
                            3 * sizeof(float)),
                     0);
  }
}

static void tune(const sf_model *from, const char *path, int threads)
{
  const sf_train_options o = tuning_run(from);
  const int before = omp_get_max_threads();
  omp_set_num_threads(threads);
  OWNED(trainer) t = start(&data, &o, NULL);
  steps(t, o.stage2);
  ck_ok(sf_trainer_save(t, path, false));
  omp_set_num_threads(before);
}

TEST(threads_do_not_matter)
{
  OWNED(sf_model) one, three;
  tune(&narrow, in("one.safetensors"), 1);
  tune(&narrow, in("three.safetensors"), 3);
  ck_ok(sf_model_load(&one, in("one.safetensors")));
  ck_ok(sf_model_load(&three, in("three.safetensors")));
  ck_assert_int_eq(memcmp(one.value, three.value, one.size * sizeof *one.value), 0);
}

TEST(resume_continues_bit_identically)
{
  const sf_train_options o = tuning_run(&narrow);
  sf_train_options again = o;
  again.start = NULL;
  again.config.backbone = SF_TENSORF;
  ck_resume(&o, &again, 17, o.stage2 - 17);
}

static double psnr(const char *path, sf_quant_widths widths)
{
  char scene[256];
  sf_point point;
  snprintf(scene, sizeof scene, "%s", in("scene"));
  const sf_point_options o = {
      .model = path, .data = scene, .split = "train", .every = 1, .quant = {.background = {1, 1, 1}, .widths = widths}};
  ck_ok(sf_point_measure(&point, &o));
  return point.figure[SF_POINT_PSNR_TRUTH];
}

/* In integers, against the picture. */
LONG_TEST(tuned_loses_less)
{
  static const sf_quant_widths widths[2] = {{.weight_bits = 3}, {.weight_bits = 8, .grid_bits = 3}};
  for (int i = 0; i < 2; i++) {
    char before[256], after[256];
    snprintf(before, sizeof before, "%s", in("base.safetensors"));
    snprintf(after, sizeof after, "%s", in("few.safetensors"));
    OWNED(sf_model) few;
    ck_ok(sf_model_load(&few, before));
    settle(&few, widths[i]);
    tune(&few, after, 2);
    const double untuned = psnr(before, widths[i]), tuned = psnr(after, widths[i]),
                 by_default = psnr(after, (sf_quant_widths){0});
    ck_assert_msg(tuned > untuned + 0.1, "set %d: %g dB tuned, %g dB untuned", i, tuned, untuned);
    ck_assert_double_eq(by_default, tuned); /* the widths that it was tuned for are its own */
  }
}

/* The kernels against the scalar decoder on inputs that are rounded one by one. */
TEST(kernels_round_inputs_as_the_oracle)
{
  sf_model m = base;
  const sf_tensorf *f = &m.config.tensorf;
  const sf_decoder_view view = sf_decoder_view_of(&m);
  const sf_kernels *kernels = sf_kernels_select(NULL);
  sf_decoder_words *words = sf_aligned_alloc(sizeof *words);
  sf_decoder_block *block = sf_aligned_alloc(sizeof *block);
  sf_net_scratch *scratch = sf_aligned_alloc(sizeof *scratch);
  ck_assert_float_eq(view.feature_step, m.scales.lsb.feature[0]);
  ck_assert_float_eq(view.encoding_step, m.scales.lsb.direction);
  memset(block, 0, sizeof *block);
  for (int i = 0; i < SF_BLOCK * view.products; i++) block->product[i] = sf_random_float(8, 1, (uint64_t)i) - 0.5f;
  kernels->decoder_prepare(&view, words);
  kernels->decoder_forward(words, block, 1, 1, scratch);
  int coarse = 0;
  for (int lane = 0; lane < SF_BLOCK; lane++) {
    float features[SF_APPEARANCE_MAX], in[SF_DECODER_MAX], direction[3] = {0, 0, 0};
    for (int o = 0; o < f->features; o++) {
      features[o] = 0;
      for (int c = 0; c < view.columns; c++)
        features[o] += view.basis[o * view.columns + c] * block->product[lane * view.products + c];
    }
    sf_tensorf_encode(f, features, direction, in);
    for (int i = 0; i < view.inputs; i++) {
      const double step = sf_scales_input(&m, 2, i), q = nearbyint(in[i] / step);
      const double expected = step * fmax(-2047, fmin(2047, q)), seen = block->in[i * SF_BLOCK + lane];
      if (i >= f->features && i < f->features + 3) continue; /* the caller's */
      if (i >= f->features + 3 + 2 * f->features * f->feature_freqs) continue;
      ck_assert_msg(fabs(seen - expected) <= 1.001 * step, "input %d: %g, expected %g", i, seen, expected);
      ck_assert_double_eq_tol(seen / step, nearbyint(seen / step), 1e-3);
      coarse += fabs(in[i] - seen) > 1e-4 * step; /* it is rounded indeed */
    }
  }
  ck_assert_int_gt(coarse, 1000);
  free(words);
  free(block);
  free(scratch);
}

TEST(direction_is_rounded)
{
  const float d[3] = {0.36f, 0.48f, -0.8f};
  const sf_vm_direction raw = sf_vm_encode_direction(&(sf_model){.config = base.config}, d),
                        seen = sf_vm_encode_direction(&base, d);
  const double step = base.scales.lsb.direction;
  for (int i = 0; i < 3 + 6 * base.config.tensorf.view_freqs; i++)
    ck_assert_double_eq(seen.value[i], step * fmin(2047, nearbyint(raw.value[i] / step)));
}

TEST(damaged_scales_are_refused)
{
  const sf_train_options o = tuning_run(&narrow);
  OWNED(trainer) t = start(&data, &o, NULL);
  t->model.scales.grid_bits = 9;
  ck_refused(t, "grid_bits", "9");
  t->model.scales.grid_bits = GRID_BITS;
  t->model.scales.leak_bits = 3;
  ck_refused(t, "leak_bits", "3");
  t->model.scales.leak_bits = LEAK_BITS;
  t->model.scales.lsb.basis = -1;
  ck_refused(t, "scales", "-1");
}

int ck_timeout = 300;
ck_options ck_program = {.set_up_all = set_up, .tear_down_all = tear_down, .one_process = true};
