/* What firing costs in training (--charge): its counts against the scalar nets, and nothing of it where it is off. Its
 * gradient is in test_gradient.c. */
#include "ck_run.h"
#include "tensorf_fixture.h"
#include "train_fixture.h"
#include "base/memory.h"
#include "render/view.h"
#include "snn/plif.h"

enum { STEPS = 5, H = 16, LANES = 41, FEATURES = 8 };
static const float price[3] = {0.7f, 0.4f, 1.1f};

static void set_up(void)
{
  open_scene(6);
}

/* A block of samples with its nets: of a hash grid, or a decoder. The last lanes hold no samples. */
typedef struct rig {
  sf_model model;
  sf_decoder_words *words; /* of a hash grid: words->net alone */
  sf_decoder_block *block; /* of a hash grid: block->net alone */
  sf_decoder_grad *grad;
  sf_net_scratch *scratch;
  float *slope; /* of what is before the nets */
} rig;

static rig rig_make(bool decodes, sf_input_mode mode)
{
  rig r = {.model = decodes ? test_tensorf(SF_NET_SNN, 1, H, STEPS) : test_model(SF_NET_SNN, mode, H, STEPS, 0.5f)};
  r.model.config.mode = mode;
  for (int l = 0; l < 3; l++) r.model.config.theta[l] = 0.25f;
  r.words = sf_aligned_alloc(sizeof *r.words);
  r.block = sf_aligned_alloc(sizeof *r.block);
  r.grad = sf_aligned_alloc(sizeof *r.grad);
  r.scratch = sf_aligned_alloc(sizeof *r.scratch);
  r.slope = sf_aligned_alloc(SF_BLOCK * SF_DECODER_MAX * sizeof(float));
  for (int i = 0; i < SF_BLOCK * SF_DECODER_MAX; i++) r.block->product[i] = test_random(1u << 22 | i);
  for (int i = 0; i < SF_DECODER_MAX * SF_BLOCK; i++) r.block->in[i] = test_random(1u << 21 | i);
  for (int i = 0; i < FEATURES * SF_BLOCK; i++) r.block->net.f[i] = test_random(1u << 22 | i);
  for (int i = 0; i < SF_DIR_FEATURES * SF_BLOCK; i++) r.block->net.sh[i] = test_random(1u << 23 | i);
  r.block->net.lanes = LANES;
  return r;
}

static void rig_free(rig *r)
{
  sf_model_free(&r->model);
  free(r->words);
  free(r->block);
  free(r->grad);
  free(r->scratch);
  free(r->slope);
}

static void rig_forward(rig *r, const sf_kernels *k)
{
  if (sf_model_decodes(&r->model)) {
    const sf_decoder_view view = sf_decoder_view_of(&r->model);
    k->decoder_prepare(&view, r->words);
    k->decoder_forward(r->words, r->block, STEPS, STEPS, r->scratch);
  } else {
    const sf_net_view view = sf_net_view_of(&r->model);
    k->prepare(&view, &r->words->net);
    k->forward(&r->words->net, &r->block->net, STEPS, STEPS, r->scratch);
  }
}

/* With `times` the price on every layer. */
static void rig_backward(rig *r, const sf_kernels *k, float times, const float *dsigma, const float *dcolour)
{
  for (int l = 0; l < 3; l++) r->words->net.view.charge[l] = times * price[l];
  memset(r->grad, 0, sizeof *r->grad);
  if (sf_model_decodes(&r->model))
    k->decoder_backward(r->words, r->block, STEPS, dcolour, r->slope, r->grad, r->scratch);
  else
    k->backward(&r->words->net, &r->block->net, STEPS, dsigma, dcolour, r->slope, &r->grad->net, r->scratch);
}

/* A charge too small to move a float leaves the gradient of everything else as it is, bit for bit. */
LOOP_TEST(a_charge_of_nothing_moves_no_bit, 4)
{
  static const char *const isa[] = {"portable", "avx2", "avx512", "avx512bf16", "amx"};
  static float ds[SF_T_MAX * SF_BLOCK], dc[SF_T_MAX * 3 * SF_BLOCK];
  for (int i = 0; i < COUNT(ds); i++) ds[i] = test_random(1u << 24 | i);
  for (int i = 0; i < COUNT(dc); i++) dc[i] = test_random(1u << 25 | i);
  const bool decodes = _i % 2;
  const sf_input_mode mode = _i < 2 ? SF_HYBRID : SF_RADIX;
  for (int i = 0; i < COUNT(isa); i++) {
    const sf_kernels *k = sf_kernels_select(isa[i]);
    if (!k) continue;
    OWNED(rig) r = rig_make(decodes, mode);
    rig_forward(&r, k);
    rig_backward(&r, k, 0, ds, dc);
    OWNED(rig) off = rig_make(decodes, mode);
    memcpy(off.grad, r.grad, sizeof *r.grad);
    rig_backward(&r, k, 1e-30f, ds, dc);
    ck_assert_mem_eq(r.grad, off.grad, sizeof *r.grad);
    rig_backward(&r, k, 1, ds, dc);
    ck_assert_int_ne(memcmp(r.grad, off.grad, sizeof *r.grad), 0);
  }
}

/* Up to where t_r is found, a charged run has the bits of one that is not; from there on it has others. */
TEST(the_search_is_not_charged)
{
  sf_train_options o = small_run();
  OWNED(trainer) off = start(&data, &o, NULL);
  o.charge = 1;
  OWNED(trainer) on = start(&data, &o, NULL);
  const int search = o.stage1 + o.stage2 / 2;
  steps(off, search), steps(on, search);
  same_model(off, on);
  ck_assert_double_eq(on->charge.reads, 0);
  steps(off, 4), steps(on, 4);
  ck_assert_double_gt(on->charge.reads, 0);
  ck_assert_double_eq(off->charge.reads, 0);
  for (int l = 0; l < 3; l++) ck_assert_float_eq(off->net->view.charge[l], 0);
  ck_assert_int_ne(memcmp(off->model.value, on->model.value, off->model.size * sizeof(float)), 0);
}

/* ---- prices and counts ---- */

/* Rows of D2, C2, C3 have 16, 32 and 3 weights: 2, 4 and 1 reads of 8 bytes. Every sample reads the rows of 8 features
 * for D1 and of 15 values of h for C1, 4 reads each. L = C M ln R: a read more in each of n samples costs C M / R,
 * a neuron of one sample an n-th of it. */
TEST(price_by_hand)
{
  const double all[3] = {1, 1, 1}, some[3] = {0.5, 0.25, 0}, none[3] = {0};
  const sf_train_options o = small_run();
  OWNED(trainer) t = start(&data, &o, NULL);
  sf_charge_measured(t, none);
  ck_assert_double_eq_tol(t->row_reads, 8 * 4 + 15 * 4, 1e-9);
  sf_charge_measured(t, all);
  ck_assert_double_eq_tol(t->row_reads, 8 * 4 + 15 * 4 + 32 * (2 + 4 + 1), 1e-9);
  sf_charge_measured(t, some);
  ck_assert_double_eq_tol(t->row_reads, 8 * 4 + 15 * 4 + 16 * 2 + 8 * 4, 1e-9);
  t->charge = (sf_charge){.error = 0.01, .reads = 200};
  t->batch.samples = 500;
  static const double reads[3] = {2, 4, 1};
  sf_charge_begin(t, &(sf_loss_plan){.charge = 0.5f});
  for (int l = 0; l < 3; l++)
    ck_assert_double_eq_tol(t->net->view.charge[l], 0.5 * 0.01 / (200 * 500) * reads[l], 1e-6 * 5e-8);
  sf_charge_update(t, 0.02);
  ck_assert_double_eq_tol(t->charge.error, 0.98 * 0.01 + 0.02 * 0.02, 1e-9);
  ck_assert_double_eq_tol(t->charge.reads, 0.98 * 200 + 0.02 * (8 * 4 + 15 * 4 + 16 * 2 + 8 * 4), 1e-9);
  sf_charge_begin(t, &(sf_loss_plan){.charge = 0});
  for (int l = 0; l < 3; l++) ck_assert_float_eq(t->net->view.charge[l], 0);
}

/* Spikes of the scalar nets, and neurons that fire at any step. A current within rounding of the threshold may fire in
 * one and not in the other. */
LOOP_TEST(spikes_are_those_of_the_oracle, 2)
{
  static sf_net_trace trace;
  OWNED(rig) r = rig_make(false, _i ? SF_RADIX : SF_HYBRID);
  sf_group g = {0};
  OWNED(sf_model) m = r.model;
  r.model = (sf_model){0};
  sf_trainer t = {.model = m};
  const sf_net_view view = sf_net_view_of(&m);
  const sf_kernels *k = sf_kernels_select("portable");
  k->prepare(&view, &r.words->net);
  k->forward(&r.words->net, &r.block->net, STEPS, STEPS, r.scratch);
  sf_count_spikes(&t, 0, STEPS, &r.block->net, LANES, &g);
  double fired[3] = {0}, all[3] = {0};
  for (int lane = 0; lane < LANES; lane++) {
    float f[FEATURES], sh[SF_DIR_FEATURES], sigma[STEPS], colour[3 * STEPS];
    for (int i = 0; i < FEATURES; i++) f[i] = r.block->net.f[i * SF_BLOCK + lane];
    for (int i = 0; i < SF_DIR_FEATURES; i++) sh[i] = r.block->net.sh[i * SF_BLOCK + lane];
    sf_net_sample(&m, f, sh, STEPS, sigma, colour, &trace);
    for (int l = 0; l < 3; l++)
      for (int n = 0; n < H; n++) {
        int spikes = 0;
        for (int step = 0; step < STEPS; step++) spikes += trace.spike[(const int[]){0, 2, 3}[l]][step][n];
        fired[l] += spikes > 0, all[l] += spikes;
      }
  }
  for (int l = 0; l < 3; l++) {
    ck_assert_double_eq_tol(g.fired[l], fired[l], 2);
    ck_assert_double_eq_tol(g.spikes[l], all[l], 4);
    ck_assert(fired[l] > 50 && fired[l] < LANES * H - 50);
  }
  ck_assert_double_eq(g.lanes, LANES);
}

ck_options ck_program = {.set_up_all = set_up, .tear_down_all = close_scene, .one_process = true};
