/* TensoRF's vector kernels against the oracles, and their gradients. */
#include "ck_run.h"
#include "tensorf_fixture.h"
#include "base/memory.h"
#include "render/view.h"
#include <math.h>

static const char *const exact[] = {"portable", "avx2", "avx512"};

enum { N = 2 * SF_BLOCK };

static void positions(float *x)
{
  for (int i = 0; i < 3 * N; i++) x[i] = sf_random_float(5, 1, i);
  for (int i = 0; i < 8; i++) /* the corners of the box, as marching clamps them */
    for (int a = 0; a < 3; a++) x[3 * i + a] = i >> a & 1 ? 0x1.fffffep-1f : 0;
}

/* Bounds: contracted multiply-adds over 3 x 16 components; the activation's fit, 2 ulp. */
TEST(density_equals_oracle)
{
  float x[3 * N], sigma[N], slope[N];
  positions(x);
  for (int i = 0; i < 3; i++)
    for (int ndc = 0; ndc < 2; ndc++) {
      const sf_kernels *k = sf_kernels_select(exact[i]);
      if (!k) continue;
      OWNED(sf_model) m = test_tensorf(SF_NET_SNN, ndc, 16, 2);
      if (!ndc) m.config.tensorf.shift = -1; /* both ends of the softplus */
      for (size_t j = 0; !ndc && j < m.param[SF_P_DENSITY_PLANE].size; j++) m.value[j] *= 60;
      const sf_vm_field field = sf_vm_field_of(&m, false);
      k->vm_density(&field, x, N, sigma, slope);
      for (int s = 0; s < N; s++) {
        const float feature = sf_tensorf_density_feature(&m, x + 3 * s);
        const float expected = sf_tensorf_sigma(&m.config.tensorf, feature), h = 1e-2f;
        ck_assert_float_eq_tol(sigma[s], expected, 2e-5f * (fabsf(expected) + m.config.tensorf.distance_scale));
        const float up = sf_tensorf_sigma(&m.config.tensorf, feature + h),
                    down = sf_tensorf_sigma(&m.config.tensorf, feature - h);
        if (!ndc || fabsf(feature) > h) ck_assert_float_eq_tol(slope[s], (up - down) / (2 * h), 0.05f);
      }
    }
}

/* Small densities keep their relative accuracy: they decide what the alpha mask drops. */
TEST(thin_density_is_accurate)
{
  const sf_kernels *k = sf_kernels_select(NULL);
  float x[3 * N], sigma[N], slope[N];
  positions(x);
  OWNED(sf_model) m = test_tensorf(SF_NET_SNN, 0, 16, 2);
  const sf_vm_field field = sf_vm_field_of(&m, false);
  k->vm_density(&field, x, N, sigma, slope);
  for (int s = 0; s < N; s++) {
    const float expected = sf_tensorf_sigma(&m.config.tensorf, sf_tensorf_density_feature(&m, x + 3 * s));
    ck_assert_float_eq_tol(sigma[s], expected, 1e-5f * expected);
  }
}

/* The density feature is bilinear in planes and lines: <g, feature(P + P', L)> - <g, feature(P, L)> = <dP, P'>, and so
 * for lines; g = the gradient of the products, or one per sample. */
static void check_adjoint(const char *isa, int ndc, bool appearance)
{
  const sf_kernels *k = sf_kernels_select(isa);
  if (!k) return;
  static float x[3 * N], g[N * SF_DECODER_MAX], product[N * SF_DECODER_MAX];
  positions(x);
  OWNED(sf_model) m = test_tensorf(SF_NET_SNN, ndc, 16, 2);
  const int first = appearance ? SF_P_APP_PLANE : SF_P_DENSITY_PLANE, ld = 160;
  const sf_vm_field f = sf_vm_field_of(&m, appearance);
  for (int i = 0; i < N * ld; i++) g[i] = test_random(1u << 26 | i);
  float *grad = calloc(m.size, sizeof *grad);
  for (int mode = 0, at = 0; mode < 3; at += f.channels[mode++])
    for (int c = 0; c < f.channels[mode]; c += 16)
      k->vm_backward(&f, mode, c, f.channels[mode] - c < 16 ? f.channels[mode] - c : 16, x, N,
                     appearance ? g + at + c : g, appearance ? ld : 0, grad + m.param[first + mode].offset,
                     grad + m.param[first + 3 + mode].offset);
  k->vm_products(&f, x, N, product, ld);
  const int all = f.channels[0] + f.channels[1] + f.channels[2];
  double left = 0, planes = 0, lines = 0;
  for (int s = 0; s < N; s++) {
    for (int c = 0; c < all; c++) left += (double)product[s * ld + c] * (appearance ? g[s * ld + c] : g[s]);
    for (int c = all; c < ld; c++) ck_assert_float_eq(product[s * ld + c], 0);
  }
  for (int i = 0; i < 3; i++) {
    const sf_param *p = &m.param[first + i], *l = &m.param[first + 3 + i];
    for (size_t j = p->offset; j < p->offset + p->size; j++) planes += (double)grad[j] * m.value[j];
    for (size_t j = l->offset; j < l->offset + l->size; j++) lines += (double)grad[j] * m.value[j];
  }
  /* float sums of at most 128 terms of size 0.1 */
  ck_assert_double_eq_tol(left, planes, 1e-3);
  ck_assert_double_eq_tol(left, lines, 1e-3);
  free(grad);
}

TEST(backward_is_the_adjoint)
{
  for (int i = 0; i < 3; i++)
    for (int ndc = 0; ndc < 2; ndc++)
      for (int appearance = 0; appearance < 2; appearance++) check_adjoint(exact[i], ndc, appearance);
}

typedef struct rig {
  sf_model model;
  sf_decoder_words *words;
  sf_decoder_block *block;
  sf_net_scratch *scratch;
  sf_decoder_grad *grad;
  float *dproduct;
} rig;

static void directions(rig *r)
{
  const sf_tensorf *f = &r->model.config.tensorf;
  for (int l = 0; l < SF_BLOCK; l++) {
    float d[3] = {test_random(3 * l + 50), test_random(3 * l + 51), test_random(3 * l + 52)}, in[SF_DECODER_MAX],
          features[SF_APPEARANCE_MAX] = {0};
    const float length = sqrtf(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    for (int a = 0; a < 3; a++) d[a] /= length;
    sf_tensorf_encode(f, features, d, in);
    for (int i = f->features; i < sf_tensorf_inputs(f); i++) r->block->in[i * SF_BLOCK + l] = in[i];
  }
}

static rig rig_make(sf_net_kind kind, sf_input_mode mode, int ndc, int hidden, int steps, float gain)
{
  rig r = {.model = test_tensorf(kind, ndc, hidden, steps)};
  r.model.config.mode = mode;
  r.words = sf_aligned_alloc(sizeof *r.words);
  r.block = sf_aligned_alloc(sizeof *r.block);
  r.scratch = sf_aligned_alloc(sizeof *r.scratch);
  r.grad = sf_aligned_alloc(sizeof *r.grad);
  r.dproduct = sf_aligned_alloc(SF_BLOCK * SF_DECODER_MAX * sizeof(float));
  for (size_t i = 0; i < r.model.param[SF_P_C1].size; i++) sf_model_param(&r.model, SF_P_C1)[i] *= gain;
  const int all = sf_tensorf_products(&r.model.config.tensorf), ld = (all + 15) / 16 * 16;
  for (int l = 0; l < SF_BLOCK; l++)
    for (int c = 0; c < all; c++) r.block->product[l * ld + c] = test_random(1u << 22 | (l * ld + c));
  directions(&r);
  return r;
}

static void rig_forward(rig *r, const sf_kernels *k, int keep)
{
  const sf_decoder_view view = sf_decoder_view_of(&r->model);
  k->decoder_prepare(&view, r->words);
  k->decoder_forward(r->words, r->block, r->model.config.steps, keep ? r->model.config.steps : 0, r->scratch);
}

static void rig_free(rig *r)
{
  sf_model_free(&r->model);
  free(r->words);
  free(r->block);
  free(r->scratch);
  free(r->grad);
  free(r->dproduct);
}

static void oracle(const rig *r, int lane, float *colour)
{
  const sf_tensorf *f = &r->model.config.tensorf;
  const int all = sf_tensorf_products(f), ld = (all + 15) / 16 * 16, rest = f->features;
  float features[SF_APPEARANCE_MAX] = {0}, in[SF_DECODER_MAX];
  const float *basis = sf_model_param(&r->model, SF_P_BASIS);
  for (int o = 0; o < f->features; o++)
    for (int c = 0; c < all; c++) features[o] += basis[o * all + c] * r->block->product[lane * ld + c];
  const float direction[3] = {r->block->in[rest * SF_BLOCK + lane], r->block->in[(rest + 1) * SF_BLOCK + lane],
                              r->block->in[(rest + 2) * SF_BLOCK + lane]};
  sf_tensorf_encode(f, features, direction, in);
  sf_net_sample(&r->model, in, NULL, r->model.config.steps, NULL, colour, NULL);
}

/* Kernels against the oracles. A current within rounding of the threshold may fire in one and not in the other: a few
 * samples may differ altogether, the others agree within `bound`. Gains: events below 25 % firing, dense above. */
static void compare(const char *isa, sf_net_kind kind, sf_input_mode mode, int ndc, float gain, float bound,
                    int allowed)
{
  const sf_kernels *k = sf_kernels_select(isa);
  if (!k) return;
  OWNED(rig) r = rig_make(kind, mode, ndc, 48, 8, gain);
  for (int keep = 0; keep < 2; keep++) {
    int wrong = 0;
    rig_forward(&r, k, keep);
    for (int l = 0; l < SF_BLOCK; l++) {
      float colour[3 * SF_T_MAX];
      int bad = 0;
      oracle(&r, l, colour);
      for (int t = 0; t < r.model.config.steps; t++)
        for (int c = 0; c < 3; c++)
          bad |= !(fabsf(r.block->net.colour[t][c * SF_BLOCK + l] - colour[3 * t + c]) <= bound);
      wrong += bad;
    }
    ck_assert_msg(wrong <= allowed, "%s, ndc %d: %d of 64 samples differ", k->name, ndc, wrong);
  }
}

TEST(decoder_equals_oracle)
{
  for (int i = 0; i < 3; i++)
    for (int ndc = 0; ndc < 2; ndc++) {
      for (int mode = SF_HYBRID; mode <= SF_RADIX; mode++) {
        compare(exact[i], SF_NET_SNN, mode, ndc, 0.3f, 1e-4f, 3);
        compare(exact[i], SF_NET_SNN, mode, ndc, 3, 1e-4f, 3);
      }
      compare(exact[i], SF_NET_ANN, SF_HYBRID, ndc, 1, 1e-4f, 0);
    }
}

/* The twin rounds every operand to bfloat16: 2^-9 through four layers. */
TEST(bfloat16_decoder_near_oracle)
{
  for (int ndc = 0; ndc < 2; ndc++) {
    compare("avx512bf16", SF_NET_ANN, SF_HYBRID, ndc, 1, 3e-2f, 0);
    compare("amx", SF_NET_ANN, SF_HYBRID, ndc, 1, 3e-2f, 0);
  }
}

/* Where the kernels put the gradient of entry i. */
static float grad_at(const rig *r, int id, size_t i)
{
  const sf_tensorf *f = &r->model.config.tensorf;
  const size_t inputs = (size_t)sf_tensorf_inputs(f), rows = (inputs + 1 + 15) / 16 * 16,
               all = (size_t)sf_tensorf_products(f), hidden = (size_t)r->model.config.hidden;
  switch (id) {
  case SF_P_BASIS:
    return r->grad->basis[i / all * ((all + 15) / 16 * 16) + i % all];
  case SF_P_C1:
    return r->grad->w1[i / inputs * rows + i % inputs];
  case SF_P_C1_BIAS:
    return r->grad->w1[i * rows + inputs];
  case SF_P_C2:
    return r->grad->net.w4[i] + r->grad->net.w4t[i % hidden * hidden + i / hidden];
  case SF_P_C2_BIAS:
    return r->grad->b2[i];
  case SF_P_C3:
    return r->grad->net.w5[i];
  case SF_P_C3_BIAS:
    return r->grad->b3[i];
  default:
    return r->grad->net.leak[i];
  }
}

static void random_gradient(float *dcolour)
{
  for (int i = 0; i < SF_T_MAX * 3 * SF_BLOCK; i++) dcolour[i] = test_random(1u << 25 | i);
}

/* The same forward pass, the backward passes compared; in the second round firing is charged, too. */
TEST(backward_of_every_isa_agrees)
{
  static float dc[SF_T_MAX * 3 * SF_BLOCK];
  const sf_kernels *portable = sf_kernels_select("portable");
  random_gradient(dc);
  for (int kind = SF_NET_SNN; kind <= SF_NET_ANN; kind++)
    for (int i = 0; i < 4; i++)
      for (int g = 0; g < 2; g++) {
        const sf_kernels *k = sf_kernels_select(backward_bounds[i].isa);
        if (!k) continue;
        const int steps = kind == SF_NET_ANN ? 1 : 8;
        rig a = rig_make(kind, SF_HYBRID, 0, 48, steps, g ? 3 : 0.3f), b = rig_make(kind, SF_HYBRID, 0, 48, steps, 1);
        memcpy(b.model.value, a.model.value, a.model.size * sizeof(float));
        rig_forward(&a, portable, 1);
        const sf_decoder_view view = sf_decoder_view_of(&b.model);
        k->decoder_prepare(&view, b.words);
        memcpy(b.block, a.block, sizeof *a.block);
        a.block->net.lanes = b.block->net.lanes = 50;
        for (int l = 1; l < 3; l++)
          a.words->net.view.charge[l] = b.words->net.view.charge[l] = g ? 0.2f * (float)(l + 1) : 0;
        portable->decoder_backward(a.words, a.block, steps, dc, a.dproduct, a.grad, a.scratch);
        k->decoder_backward(b.words, b.block, steps, dc, b.dproduct, b.grad, b.scratch);
        for (int id = SF_P_BASIS; id < SF_P_LEAK; id++) {
          if (!sf_model_has(&a.model, id)) continue;
          const size_t n = a.model.param[id].size;
          float *x = malloc(2 * n * sizeof *x);
          for (size_t j = 0; j < n; j++) x[j] = grad_at(&b, id, j), x[n + j] = grad_at(&a, id, j);
          const float far = distance(x, x + n, n);
          ck_assert_msg(far <= backward_bounds[i].bound, "%s: %s differs by %g", k->name, a.model.param[id].name,
                        (double)far);
          free(x);
        }
        ck_assert_float_le(distance(b.dproduct, a.dproduct, SF_BLOCK * 144), backward_bounds[i].bound);
        rig_free(&a);
        rig_free(&b);
      }
}

int ck_timeout = 120;
