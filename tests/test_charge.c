/* What firing costs in training (--charge): its gradient against central differences through both nets, its counts
 * against the scalar nets, and nothing of it where it is off. */
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

/* ---- the charge as a smooth function: near the membranes of the first pass a spike is s + S(h) - S(h of that pass),
 * S the sigmoid whose slope is the surrogate. Its slope there is what backward has to find. ---- */

typedef struct smooth {
  const rig *r;
  double *value; /* the parameters */
  double h[LANES][3][STEPS][H];
  bool first; /* this pass leaves h */
} smooth;

typedef struct pass {
  double k[3], v[3][H], silent[3][H];
} pass;

static const double *weights(const smooth *s, int id)
{
  return s->value + s->r->model.param[id].offset;
}

static void multiply(const double *w, int rows, int ld, int columns, const double *x, double *y)
{
  for (int o = 0; o < rows; o++)
    for (int i = 0; i < columns; i++) y[o] += w[o * ld + i] * x[i];
}

static void fire(smooth *s, pass *p, int lane, int layer, int t, const double *current, double *spike)
{
  const sf_config *c = &s->r->model.config;
  const double theta = c->theta[layer], k = p->k[layer];
  for (int n = 0; n < H; n++) {
    double *v = &p->v[layer][n], *first = &s->h[lane][layer][t][n], h = *v + (current[n] - *v) * k;
    if (c->mode == SF_NODECAY) h = *v - *v * k + current[n];
    if (c->mode == SF_HYBRID && t == 0) h = current[n];
    if (s->first) *first = h;
    const double now = 1 / (1 + exp(-SF_SURROGATE_ALPHA * (h - theta))),
                 then = 1 / (1 + exp(-SF_SURROGATE_ALPHA * (*first - theta)));
    spike[n] = (*first >= theta) + now - then;
    *v = h - theta * spike[n];
    p->silent[layer][n] *= 1 - spike[n];
  }
}

/* The currents that are constant over the steps: of D1, of C1. */
static void constants(const smooth *s, int lane, double current1[H], double base[H])
{
  const sf_model *m = &s->r->model;
  const sf_decoder_block *b = s->r->block;
  const int columns = (int)m->param[SF_P_C1].shape[1];
  double in[SF_DECODER_MAX];
  if (sf_model_decodes(m)) {
    for (int i = 0; i < columns; i++) in[i] = b->in[i * SF_BLOCK + lane];
    memcpy(base, weights(s, SF_P_C1_BIAS), H * sizeof *base);
    multiply(weights(s, SF_P_C1), H, columns, columns, in, base);
    return;
  }
  for (int i = 0; i < FEATURES; i++) in[i] = b->net.f[i * SF_BLOCK + lane];
  multiply(weights(s, SF_P_D1), H, FEATURES, FEATURES, in, current1);
  for (int i = 0; i < SF_DIR_FEATURES; i++) in[i] = b->net.sh[i * SF_BLOCK + lane];
  multiply(weights(s, SF_P_C1), H, columns, SF_DIR_FEATURES, in, base);
}

static double cost_of(smooth *s, int lane)
{
  static const int leak[3] = {0, 2, 3};
  const bool decodes = sf_model_decodes(&s->r->model);
  const int columns = (int)s->r->model.param[SF_P_C1].shape[1];
  double current1[H] = {0}, base[H] = {0}, cost = 0;
  pass p = {0};
  constants(s, lane, current1, base);
  for (int l = 0; l < 3; l++) {
    p.k[l] = 1 / (1 + exp(-weights(s, SF_P_LEAK)[leak[l]]));
    for (int n = 0; n < H; n++) p.silent[l][n] = 1;
  }
  for (int t = 0; t < STEPS; t++) {
    double spike[H], i[SF_DENSITY_OUT] = {0}, current[H], current2[H] = {0};
    memcpy(current, base, sizeof base);
    if (!decodes) {
      fire(s, &p, lane, 0, t, current1, spike);
      multiply(weights(s, SF_P_D2), SF_DENSITY_OUT, H, H, spike, i);
      multiply(weights(s, SF_P_C1) + SF_DIR_FEATURES, H, columns, SF_GEO_FEATURES, i + 1, current);
    }
    fire(s, &p, lane, 1, t, current, spike);
    if (decodes) memcpy(current2, weights(s, SF_P_C2_BIAS), sizeof current2);
    multiply(weights(s, SF_P_C2), H, H, H, spike, current2);
    fire(s, &p, lane, 2, t, current2, spike);
  }
  for (int l = decodes ? 1 : 0; l < 3; l++)
    for (int n = 0; n < H; n++) cost += price[l] * (1 - p.silent[l][n]);
  return cost;
}

static double cost(smooth *s)
{
  double sum = 0;
  for (int lane = 0; lane < LANES; lane++) sum += cost_of(s, lane);
  return sum;
}

static double slope_at(smooth *s, double *at)
{
  const double old = *at, step = 1e-5;
  *at = old + step;
  const double up = cost(s);
  *at = old - step;
  const double down = cost(s);
  *at = old;
  return (up - down) / (2 * step);
}

/* Where the kernels put the gradient of entry i. */
static float grad_at(const rig *r, int id, int i)
{
  const sf_net_grad *g = &r->grad->net;
  const int columns = (int)r->model.param[SF_P_C1].shape[1];
  const bool decodes = sf_model_decodes(&r->model);
  switch (id) {
  case SF_P_D1:
    return g->w1[i / FEATURES * 16 + i % FEATURES];
  case SF_P_D2:
    return g->w2[i];
  case SF_P_C1:
    return decodes ? r->grad->w1[i / columns * ((columns + 1 + 15) / 16 * 16) + i % columns]
                   : g->w3[i / columns * 32 + i % columns + (i % columns >= SF_DIR_FEATURES)];
  case SF_P_C1_BIAS:
    return r->grad->w1[i * ((columns + 1 + 15) / 16 * 16) + columns];
  case SF_P_C2:
    return g->w4[i] + g->w4t[i % H * H + i / H];
  case SF_P_C2_BIAS:
    return r->grad->b2[i];
  default:
    return g->leak[i];
  }
}

/* Every third entry of the parameters that spikes hang on. Bound: the surrogate's fit, 7e-5 of its maximum, through
 * three layers and five steps; float sums over 205 products. */
static void check_slope(bool decodes, sf_input_mode mode)
{
  static const float none[SF_T_MAX * 3 * SF_BLOCK];
  static const int id[] = {SF_P_D1, SF_P_D2, SF_P_C1, SF_P_C1_BIAS, SF_P_C2, SF_P_C2_BIAS, SF_P_LEAK};
  static smooth s;
  OWNED(rig) r = rig_make(decodes, mode);
  const sf_kernels *k = sf_kernels_select("portable");
  rig_forward(&r, k);
  rig_backward(&r, k, 1, none, none);
  s = (smooth){.r = &r, .value = malloc(r.model.size * sizeof(double)), .first = true};
  for (size_t i = 0; i < r.model.size; i++) s.value[i] = r.model.value[i];
  cost(&s);
  s.first = false;
  int large = 0;
  for (int p = 0; p < COUNT(id); p++) {
    if (!sf_model_has(&r.model, id[p])) continue;
    for (size_t i = 0; i < r.model.param[id[p]].size; i += id[p] == SF_P_LEAK ? 1 : 3) {
      const double expected = slope_at(&s, s.value + r.model.param[id[p]].offset + i),
                   actual = grad_at(&r, id[p], (int)i);
      ck_assert_msg(fabs(expected - actual) <= 2e-3 * fabs(expected) + 0.02, "mode %d: %s[%zu]: slope %g, gradient %g",
                    (int)mode, r.model.param[id[p]].name, i, expected, actual);
      large += fabs(expected) > 1;
    }
  }
  free(s.value);
  ck_assert_int_gt(large, 100);
}

LOOP_TEST(gradient_is_the_slope, 2)
{
  for (int mode = SF_HYBRID; mode <= SF_NODECAY; mode++) check_slope(_i, mode);
}

/* ---- off ---- */

/* A charge too small to move a float leaves the gradient of everything else as it is, bit for bit. */
LOOP_TEST(a_charge_of_nothing_moves_no_bit, 2)
{
  static const char *const isa[] = {"portable", "avx2", "avx512", "avx512bf16", "amx"};
  static float ds[SF_T_MAX * SF_BLOCK], dc[SF_T_MAX * 3 * SF_BLOCK];
  for (int i = 0; i < COUNT(ds); i++) ds[i] = test_random(1u << 24 | i);
  for (int i = 0; i < COUNT(dc); i++) dc[i] = test_random(1u << 25 | i);
  for (int i = 0; i < COUNT(isa); i++) {
    const sf_kernels *k = sf_kernels_select(isa[i]);
    if (!k) continue;
    OWNED(rig) r = rig_make(_i, SF_HYBRID);
    rig_forward(&r, k);
    rig_backward(&r, k, 0, ds, dc);
    OWNED(rig) off = rig_make(_i, SF_HYBRID);
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

/* Neurons of the scalar nets that fire at any step. A current within rounding of the threshold may fire in one and not
 * in the other. */
TEST(fired_neurons_are_those_of_the_oracle)
{
  static sf_net_trace trace;
  OWNED(rig) r = rig_make(false, SF_HYBRID);
  sf_group g = {0};
  OWNED(sf_model) m = r.model;
  r.model = (sf_model){0};
  sf_trainer t = {.model = m};
  const sf_net_view view = sf_net_view_of(&m);
  const sf_kernels *k = sf_kernels_select("portable");
  k->prepare(&view, &r.words->net);
  k->forward(&r.words->net, &r.block->net, STEPS, STEPS, r.scratch);
  sf_count_spikes(&t, 0, STEPS, &r.block->net, LANES, &g);
  double fired[3] = {0};
  for (int lane = 0; lane < LANES; lane++) {
    float f[FEATURES], sh[SF_DIR_FEATURES], sigma[STEPS], colour[3 * STEPS];
    for (int i = 0; i < FEATURES; i++) f[i] = r.block->net.f[i * SF_BLOCK + lane];
    for (int i = 0; i < SF_DIR_FEATURES; i++) sh[i] = r.block->net.sh[i * SF_BLOCK + lane];
    sf_net_sample(&m, f, sh, STEPS, sigma, colour, &trace);
    for (int l = 0; l < 3; l++)
      for (int n = 0; n < H; n++) {
        int spikes = 0;
        for (int step = 0; step < STEPS; step++) spikes += trace.spike[(const int[]){0, 2, 3}[l]][step][n];
        fired[l] += spikes > 0;
      }
  }
  for (int l = 0; l < 3; l++) {
    ck_assert_double_eq_tol(g.fired[l], fired[l], 2);
    ck_assert(fired[l] > 50 && fired[l] < LANES * H - 50);
  }
  ck_assert_double_eq(g.lanes, LANES);
}

ck_options ck_program = {.set_up_all = set_up, .tear_down_all = close_scene, .one_process = true};
