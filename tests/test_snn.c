/* Spiking nets: equations by hand, oracle against kernels, backward passes against each other
 * (test_gradient.c proves them). */
#include "ck_run.h"
#include "float_fixture.h"
#include "base/memory.h"
#include "render/view.h"
#include "snn/plif.h"

/* Design page's neuron with theta = 1, k = 1/2 (tau = 2), current 0.8: hybrid v = .8, .8, .. (constant input is its
 * fixed point). */
TEST(plif_by_hand)
{
  ck_assert_float_eq(sf_plif_charge(SF_HYBRID, 0, 0.5f, 0, 0.8f), 0.8f);
  ck_assert_float_eq_tol(sf_plif_charge(SF_HYBRID, 1, 0.5f, 0.8f, 0.8f), 0.8f, 1e-7f);
  ck_assert_float_eq_tol(sf_plif_charge(SF_DECAY, 0, 0.5f, 0, 0.8f), 0.4f, 1e-7f);
  ck_assert_float_eq_tol(sf_plif_charge(SF_DECAY, 1, 0.25f, 0.4f, 0.8f), 0.5f, 1e-7f);
  ck_assert_float_eq_tol(sf_plif_charge(SF_NODECAY, 1, 0.25f, 0.4f, 0.8f), 1.1f, 1e-7f);
  ck_assert_float_eq(sf_plif_charge(SF_RADIX, 0, 0.25f, 0, 0.8f), 0.8f);
  ck_assert_float_eq(sf_plif_charge(SF_RADIX, 1, 0.25f, 0.4f, 0.8f), 0.8f);
}

/* The spikes of a radix neuron are the first binary digits of its current over twice the threshold, cut; below 0 there
 * are none, beyond the range all. So a shorter train is the beginning of a longer one. */
TEST(radix_spikes_are_binary_digits)
{
  for (int steps = 1; steps <= 8; steps++)
    for (int i = -200; i <= 1200; i++) {
      const float theta = 0.375f, part = (float)i / 1000, current = part * 2 * theta;
      float v = 0, worth = 0;
      for (int t = 0; t < steps; t++) {
        v = sf_plif_charge(SF_RADIX, t, 0, v, current);
        const float spike = v >= theta ? 1 : 0;
        v -= spike * theta;
        worth += spike * sf_digit(t, steps);
      }
      const float levels = (float)(1 << steps), cut = floorf(current / (2 * theta) * levels) / (levels - 1);
      ck_assert_float_eq_tol(worth, part < 0 ? 0 : part >= 1 ? 1 : cut, 1e-6f); /* a sum of digits that are rounded */
    }
}

/* The weights that a hybrid prefix gives its steps sum to 1 for every tau > 1: integrating ones gives one. */
TEST(hybrid_prefix_weights_sum_to_one)
{
  for (int i = 0; i < 1000; i++) {
    float k = 1e-4f + 0.9998f * sf_random_float(1, 2, i), o = 0;
    for (int t = 0; t < 8; t++) {
      o = sf_plif_charge(SF_HYBRID, t, k, o, 1.0f);
      ck_assert_float_eq_tol(o, 1.0f, 1e-6f); /* a few roundings of 2^-24 */
    }
  }
}

typedef struct rig {
  sf_model model;
  sf_net_words *net;
  sf_block *block;
  sf_net_scratch *scratch;
  sf_net_grad *grad;
} rig;

static rig rig_make(sf_net_kind kind, sf_input_mode mode, int hidden, int steps)
{
  rig r = {.model = test_model(kind, mode, hidden, steps, 0.5f)};
  r.net = sf_aligned_alloc(sizeof *r.net);
  r.block = sf_aligned_alloc(sizeof *r.block);
  r.scratch = sf_aligned_alloc(sizeof *r.scratch);
  r.grad = sf_aligned_alloc(sizeof *r.grad);
  for (int i = 0; i < 2 * 4 * SF_BLOCK; i++) r.block->f[i] = test_random(1u << 22 | i);
  for (int i = 0; i < SF_DIR_FEATURES * SF_BLOCK; i++) r.block->sh[i] = test_random(1u << 23 | i);
  return r;
}

static void rig_prepare(rig *r, const sf_kernels *kernels)
{
  const sf_net_view view = sf_net_view_of(&r->model);
  kernels->prepare(&view, r->net);
}

static void rig_forward(rig *r, const sf_kernels *kernels, int keep)
{
  rig_prepare(r, kernels);
  kernels->forward(r->net, r->block, r->model.config.steps, keep ? r->model.config.steps : 0, r->scratch);
}

/* Scales the input weights of C1, and with them its firing rate: kernels for AVX-512 add up events below 25 %
 * (forward) and 45 % (backward), and multiply densely above. */
static const float gains[2] = {0.45f, 6.0f};
static void drive(rig *r, float gain)
{
  for (size_t i = 0; i < r->model.param[SF_P_C1].size; i++) sf_model_param(&r->model, SF_P_C1)[i] *= gain;
}

/* Spikes per neuron of C1 at step t of the last forward pass. */
static double firing(const rig *r, int t)
{
  double spikes = 0;
  const int n = r->model.config.hidden * SF_BLOCK;
  if (r->model.config.mode == SF_RADIX) t = 0; /* the first digits, of the first prefix */
  for (int i = 0; i < n; i++) spikes += r->block->m3[t][i] >= r->model.config.theta[1];
  return spikes / n;
}

static void rig_free(rig *r)
{
  sf_model_free(&r->model);
  free(r->net);
  free(r->block);
  free(r->scratch);
  free(r->grad);
}

/* Kernels against the oracle. A current within rounding of the threshold may fire in one and not in the other, so a few
 * samples may differ altogether: at most 2 of 64 may, the others agree within 1e-4 relative (sums of 128 floats). */
static void round_to_bfloat16(float *x, size_t n)
{
  for (size_t i = 0; i < n; i++) {
    uint32_t bits;
    memcpy(&bits, &x[i], 4);
    bits = (bits + 0x8000u) & 0xFFFF0000u;
    memcpy(&x[i], &bits, 4);
  }
}

static void compare_forward(const char *isa, sf_net_kind kind, sf_input_mode mode, int hidden, float gain, float bound,
                            int allowed)
{
  const sf_kernels *kernels = sf_kernels_select(isa);
  if (!kernels) return;
  OWNED(rig) r = rig_make(kind, mode, hidden, 8);
  const int steps = r.model.config.steps;
  drive(&r, gain);
  if (!strcmp(isa, "avx512bf16") || !strcmp(isa, "amx")) { /* weights and inputs that it holds exactly */
    round_to_bfloat16(r.model.value, r.model.size);
    sf_model_param(&r.model, SF_P_LEAK)[0] = 0.25f;
    round_to_bfloat16(r.block->f, 8 * SF_BLOCK);
    round_to_bfloat16(r.block->sh, 16 * SF_BLOCK);
  }
  for (int keep = 0; keep < 2; keep++) {
    rig_forward(&r, kernels, keep);
    int wrong = 0;
    for (int l = 0; l < SF_BLOCK; l++) {
      float f[8], sh[16], sigma[8], colour[24];
      for (int i = 0; i < 8; i++) f[i] = r.block->f[i * SF_BLOCK + l];
      for (int i = 0; i < 16; i++) sh[i] = r.block->sh[i * SF_BLOCK + l];
      sf_net_sample(&r.model, f, sh, steps, sigma, colour, NULL);
      int bad = 0;
      for (int t = 0; t < steps; t++) {
        bad |= fabsf(r.block->sigma[t][l] - sigma[t]) > bound * (1 + fabsf(sigma[t]));
        for (int c = 0; c < 3; c++) bad |= fabsf(r.block->colour[t][c * SF_BLOCK + l] - colour[3 * t + c]) > bound;
      }
      wrong += bad;
    }
    ck_assert_msg(wrong <= allowed, "%s: %d of 64 samples differ", kernels->name, wrong);
  }
  if (kind == SF_NET_SNN && gain != 1) ck_assert_msg((firing(&r, 1) < 0.2) == (gain < 1), "firing %g", firing(&r, 1));
}

TEST(kernels_equal_oracle)
{
  static const char *const isa[] = {"portable", "avx2", "avx512"};
  for (int i = 0; i < 3; i++) {
    for (int mode = SF_HYBRID; mode <= SF_RADIX; mode++)
      for (int g = 0; g < 2; g++) compare_forward(isa[i], SF_NET_SNN, mode, 48, gains[g], 1e-4f, 2);
    for (int hidden = 16; hidden <= SF_LANES; hidden += 16) /* words of spikes, whole and in part */
      compare_forward(isa[i], SF_NET_SNN, SF_HYBRID, hidden, 1, 1e-4f, 2);
    compare_forward(isa[i], SF_NET_ANN, SF_HYBRID, 48, 1, 1e-4f, 2);
  }
}

/* Weights that bfloat16 holds and spikes are exact; h(t), rounded to 2^-9, moves a membrane across the threshold in
 * more samples. The twin rounds every activation: 2^-9 through four layers. */
TEST(bfloat16_kernels_near_oracle)
{
  static const char *const isa[] = {"avx512bf16", "amx"};
  for (int i = 0; i < 2; i++) {
    for (int mode = SF_HYBRID; mode <= SF_RADIX; mode++)
      for (int g = 0; g < 2; g++) compare_forward(isa[i], SF_NET_SNN, mode, 48, gains[g], 1e-2f, 16);
    compare_forward(isa[i], SF_NET_ANN, SF_HYBRID, 48, 1, 3e-2f, 0);
  }
}

static const char *const every_isa[] = {"portable", "avx2", "avx512", "avx512bf16", "amx"};

LOOP_TEST(density_equals_forward, 2)
{
  for (int isa = 0; isa < 5; isa++) {
    const sf_kernels *kernels = sf_kernels_select(every_isa[isa]);
    if (!kernels) continue;
    OWNED(rig) r = rig_make(SF_NET_SNN, _i ? SF_RADIX : SF_HYBRID, 80, 5);
    float sigma[SF_BLOCK];
    rig_forward(&r, kernels, 1);
    memcpy(sigma, r.block->sigma[4], sizeof sigma);
    kernels->density(r.net, r.block, 5, r.scratch);
    ck_assert_mem_eq(sigma, r.block->sigma[4], sizeof sigma);
  }
}

/* However few steps are kept for backward: the same prefixes, and those steps' membranes. */
TEST(kept_steps_are_the_same)
{
  enum { HIDDEN = 80 };
  for (int isa = 0; isa < 5; isa++) {
    const sf_kernels *kernels = sf_kernels_select(every_isa[isa]);
    if (!kernels) continue;
    OWNED(rig) whole = rig_make(SF_NET_SNN, SF_HYBRID, HIDDEN, 8), r = rig_make(SF_NET_SNN, SF_HYBRID, HIDDEN, 8);
    rig_forward(&whole, kernels, 1);
    for (int keep = 0; keep < 8; keep++) {
      rig_prepare(&r, kernels);
      kernels->forward(r.net, r.block, 8, keep, r.scratch);
      ck_assert_mem_eq(r.block->sigma, whole.block->sigma, sizeof r.block->sigma);
      ck_assert_mem_eq(r.block->colour, whole.block->colour, sizeof r.block->colour);
      for (int t = 0; t < keep; t++) {
        ck_assert_mem_eq(r.block->m1[t], whole.block->m1[t], HIDDEN * SF_BLOCK * sizeof(float));
        ck_assert_mem_eq(r.block->m3[t], whole.block->m3[t], HIDDEN * SF_BLOCK * sizeof(float));
        ck_assert_mem_eq(r.block->m4[t], whole.block->m4[t], HIDDEN * SF_BLOCK * sizeof(float));
        ck_assert_mem_eq(r.block->s3[t], whole.block->s3[t], HIDDEN * sizeof(uint64_t));
      }
    }
  }
}

/* Radix mode: a prefix that is asked for alone is that of all, and so is its gradient. */
TEST(a_prefix_alone_is_the_same)
{
  enum { HIDDEN = 80 };
  static float ds[SF_T_MAX * SF_BLOCK], dc[SF_T_MAX * 3 * SF_BLOCK], df[2][32 * SF_BLOCK];
  for (int isa = 0; isa < 5; isa++)
    for (int steps = 1; steps <= SF_T_MAX; steps++) {
      const sf_kernels *kernels = sf_kernels_select(every_isa[isa]);
      if (!kernels) continue;
      memset(ds, 0, sizeof ds), memset(dc, 0, sizeof dc);
      for (int l = 0; l < SF_BLOCK; l++) ds[(steps - 1) * SF_BLOCK + l] = test_random((uint64_t)l);
      for (int l = 0; l < 3 * SF_BLOCK; l++) dc[(steps - 1) * 3 * SF_BLOCK + l] = test_random(1u << 20 | (uint64_t)l);
      OWNED(rig)
      whole = rig_make(SF_NET_SNN, SF_RADIX, HIDDEN, steps), r = rig_make(SF_NET_SNN, SF_RADIX, HIDDEN, steps);
      rig_forward(&whole, kernels, 1);
      r.block->from = steps - 1;
      rig_forward(&r, kernels, 1);
      ck_assert_mem_eq(r.block->sigma[steps - 1], whole.block->sigma[steps - 1], sizeof r.block->sigma[0]);
      ck_assert_mem_eq(r.block->colour[steps - 1], whole.block->colour[steps - 1], sizeof r.block->colour[0]);
      kernels->backward(whole.net, whole.block, steps, ds, dc, df[0], whole.grad, whole.scratch);
      kernels->backward(r.net, r.block, steps, ds, dc, df[1], r.grad, r.scratch);
      ck_assert_mem_eq(r.grad, whole.grad, sizeof *r.grad);
      ck_assert_mem_eq(df[0], df[1], 8 * SF_BLOCK * sizeof(float));
    }
}

static void random_output_gradient(float *dsigma, float *dcolour)
{
  for (int i = 0; i < SF_T_MAX * SF_BLOCK; i++) dsigma[i] = test_random(1u << 24 | i);
  for (int i = 0; i < SF_T_MAX * 3 * SF_BLOCK; i++) dcolour[i] = test_random(1u << 25 | i);
}

/* The gradients of D2 and C2, which have two parts. */
static void whole_gradient(const rig *r, int hidden)
{
  for (int m = 0; m < hidden; m++) {
    for (int n = 0; n < SF_DENSITY_OUT; n++) r->grad->w2[n * hidden + m] += r->grad->w2t[m * SF_DENSITY_OUT + n];
    for (int n = 0; n < hidden; n++) r->grad->w4[n * hidden + m] += r->grad->w4t[m * hidden + n];
  }
}

/* The same spikes, only the backward pass is compared; in the second round firing is charged, too. */
TEST(backward_of_every_isa_agrees)
{
  static float ds[SF_T_MAX * SF_BLOCK], dc[SF_T_MAX * 3 * SF_BLOCK], df[2][32 * SF_BLOCK];
  const sf_kernels *portable = sf_kernels_select("portable");
  random_output_gradient(ds, dc);
  for (int run = 0; run < 3; run++) /* hybrid, radix, the twin */
    for (int i = 0; i < 4; i++) {
      const sf_net_kind kind = run == 2 ? SF_NET_ANN : SF_NET_SNN;
      const sf_input_mode mode = run == 1 ? SF_RADIX : SF_HYBRID;
      const sf_kernels *kernels = sf_kernels_select(backward_bounds[i].isa);
      const int steps = kind == SF_NET_ANN ? 1 : 8;
      if (!kernels) continue;
      for (int g = 0; g < 2; g++) {
        OWNED(rig) a = rig_make(kind, mode, 48, steps), b = rig_make(kind, mode, 48, steps);
        drive(&a, gains[g]);
        drive(&b, gains[g]);
        rig_forward(&a, portable, 1);
        memcpy(b.block, a.block, sizeof *a.block);
        a.block->lanes = b.block->lanes = 50;
        rig_prepare(&b, kernels);
        for (int l = 0; l < 3; l++) a.net->view.charge[l] = b.net->view.charge[l] = g ? 0.2f * (float)(l + 1) : 0;
        portable->backward(a.net, a.block, steps, ds, dc, df[0], a.grad, a.scratch);
        kernels->backward(b.net, b.block, steps, ds, dc, df[1], b.grad, b.scratch);
        const float bound = backward_bounds[i].bound;
        whole_gradient(&a, 48), whole_gradient(&b, 48);
        ck_assert_float_le(distance(b.grad->w1, a.grad->w1, 48 * 16), bound);
        ck_assert_float_le(distance(b.grad->w2, a.grad->w2, 16 * 48), bound);
        for (int r = 0; r < 48; r++) b.grad->w3[32 * r + 16] = a.grad->w3[32 * r + 16]; /* scratch column */
        ck_assert_float_le(distance(b.grad->w3, a.grad->w3, 48 * 32), bound);
        ck_assert_float_le(distance(b.grad->w4, a.grad->w4, 48 * 48), bound);
        ck_assert_float_le(distance(b.grad->w5, a.grad->w5, 3 * 48), bound);
        if (run == 0) ck_assert_float_le(distance(b.grad->leak, a.grad->leak, SF_LAYERS), bound);
        ck_assert_float_le(distance(df[1], df[0], 8 * SF_BLOCK), bound);
      }
    }
}

/* The first bias-corrected step is lr sign(g); of the second m = 0.045 - 0.05 = -0.005, / 0.19, and v = 0.002475 +
 * 0.0025 = 0.004975, / 0.0199: + 0.1 * 0.0263158 / 0.5. */
TEST(adam_by_hand)
{
  for (int isa = 0; isa < 5; isa++) {
    const sf_kernels *kernels = sf_kernels_select(every_isa[isa]);
    if (!kernels) continue;
    float value = 1, grad = 0.5f, m = 0, v = 0;
    sf_adam adam = {0.1, 0.9, 0.99, 1e-15, 1, 0};
    kernels->adam(&adam, 1, &value, &grad, &m, &v);
    ck_assert_float_eq_tol(value, 0.9f, 1e-6f);
    ck_assert_float_eq_tol(m, 0.05f, 1e-7f);
    ck_assert_float_eq_tol(v, 0.0025f, 1e-8f);
    ck_assert_float_eq(grad, 0);
    grad = -0.5f;
    adam.step = 2;
    kernels->adam(&adam, 1, &value, &grad, &m, &v);
    ck_assert_float_eq_tol(value, 0.9f + 0.1f * 0.0263158f / 0.5f, 1e-6f);
  }
}

/* Sixteen at a time with a rest: of 83 every third has a gradient, but none of 16..47; the others keep value and
 * moments. Bound: the rounding of ten operations. With l1 all but zeros have one. */
TEST(adam_of_every_isa_skips_what_has_no_gradient)
{
  enum { N = 83 };
  for (int isa = 0; isa < 5; isa++)
    for (int l1 = 0; l1 < 2; l1++) {
      const sf_kernels *kernels = sf_kernels_select(every_isa[isa]);
      if (!kernels) continue;
      float x[4][N];
      const sf_adam adam = {0.01, 0.9, 0.99, 1e-15, 7, l1 ? 0.125f : 0};
      const double c1 = 1 - pow(0.9, 7), c2 = 1 - pow(0.99, 7);
      double wanted[3][N];
      for (int i = 0; i < N; i++) {
        for (int a = 0; a < 4; a++) x[a][i] = sf_random_float(3, a, i) + (a == 1 ? 1.0f : 0.0f);
        if (i % 5 == 4) x[0][i] = 0;
        if (i % 3 || (i >= 16 && i < 48)) x[1][i] = i % 2 ? -0.0f : 0.0f;
        const double g = (double)x[1][i] + (l1 && x[0][i] > 0 ? 0.125 : 0);
        const double m = g != 0 ? 0.9 * x[2][i] + 0.1 * g : x[2][i],
                     v = g != 0 ? 0.99 * x[3][i] + 0.01 * g * g : x[3][i];
        wanted[0][i] = x[0][i] - (g != 0 ? 0.01 * m / c1 / (sqrt(v / c2) + 1e-15) : 0);
        wanted[1][i] = m, wanted[2][i] = v;
      }
      kernels->adam(&adam, N, x[0], x[1], x[2], x[3]);
      for (int i = 0; i < N; i++) {
        ck_assert_float_eq(x[1][i], 0);
        ck_assert_double_eq_tol(x[0][i], wanted[0][i], 1e-6);
        ck_assert_double_eq_tol(x[2][i], wanted[1][i], 1e-6);
        ck_assert_double_eq_tol(x[3][i], wanted[2][i], 1e-6);
      }
    }
}
