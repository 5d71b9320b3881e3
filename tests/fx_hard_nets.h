/* The hard cases of single samples: see fx_hard_cases.h. */
#ifndef SF_TESTS_FX_HARD_NETS_H
#define SF_TESTS_FX_HARD_NETS_H
#include "quant/quant.h"
#include "tests/float_fixture.h"
#include "tests/fx_fixture.h"
#include <math.h>

typedef struct hard {
  fx_scene scene;
  int16_t f[SF_FEATURE_MAX];
  fx_ray ray; /* ray.dir are the direction features of a HARD_NET case */
} hard;

typedef struct hard_seen {
  const fx_trace *trace; /* HARD_NET */
  fx_out out;            /* HARD_NET */
  fx_pixel pixel;        /* HARD_RAY */
  fx_counts counts;
} hard_seen;

typedef enum { HARD_NET, HARD_RAY, HARD_REFUSED } hard_kind;
typedef struct hard_case {
  const char *name;
  hard_kind kind;
  int variants;
  void (*make)(hard *h, int variant);
  void (*expect)(const hard *h, const hard_seen *seen, int variant);
} hard_case;

enum { HARD_STEP_Q24 = 1 << 20, HARD_ALL = 8 * SF_LANES }; /* 16 samples per box edge; spikes of 8 full steps */

/* A net like a trained one, eight steps. A ray case instead sees uniform fog, one per box edge, in a full box. */
static inline void hard_begin(hard *h, const hard_case *c, int variant)
{
  fixture_sizes sizes = fixture_ingp;
  sizes.steps = c->kind == HARD_RAY ? 1 : SF_T_MAX;
  memset(h, 0, sizeof *h);
  h->scene = fixture_scene(&sizes, 11);
  fixture_inputs(12, 0, h->f, SF_FEATURE_MAX, 700);
  fixture_inputs(13, 0, h->ray.dir, FX_SH, 1024);
  if (c->kind == HARD_RAY) {
    memset(h->scene.occupancy, 0xff, 64);
    h->scene.net.exp_in = (fx_scale){0, 0, 0};
    h->scene.step_q24 = HARD_STEP_Q24;
  }
  c->make(h, variant);
  if (c->kind == HARD_REFUSED) return;
  ck_ok(fx_scene_check(&h->scene, c->name));
}

static inline void hard_end(hard *h)
{
  fx_scene_free(&h->scene);
}

static inline int hard_spikes(const hard_seen *seen, int layer)
{
  int sum = 0;
  for (int t = 0; t < SF_T_MAX; t++)
    sum +=
        __builtin_popcountll(seen->trace->spikes[layer][t][0]) + __builtin_popcountll(seen->trace->spikes[layer][t][1]);
  return sum;
}

static inline bool hard_fired(const hard_seen *seen, int layer, int t, int neuron)
{
  return seen->trace->spikes[layer][t][neuron / 64] >> neuron % 64 & 1;
}

static inline void hard_weights(fx_net *net, int8_t even, int8_t odd)
{
  for (int l = 0; l < SF_LAYERS; l++)
    for (int i = 0; i < net->layer[l].n_in; i++)
      for (int o = 0; o < net->layer[l].n_out; o++) {
        const int w = (i + o) % 2 ? odd : even, rail = fixture_rail(l, o);
        net->layer[l].w[i * SF_LANES + o] = (int8_t)(w > rail ? rail : w < -rail ? -rail : w);
      }
}

static inline void hard_theta(fx_net *net, int32_t theta)
{
  net->layer[FX_D1].theta = net->layer[FX_C1].theta = net->layer[FX_C2].theta = theta;
}

/* Thresholds of radix end earlier. */
static inline void hard_mode(hard *h, int32_t mode)
{
  h->scene.net.mode = mode;
  for (int l = 0; mode == FX_RADIX && l < SF_LAYERS; l++)
    if (h->scene.net.layer[l].theta > FX_MEMBRANE_MAX / 2) h->scene.net.layer[l].theta = FX_MEMBRANE_MAX / 2;
}

static inline void hard_inputs(hard *h, int16_t f, int16_t dir)
{
  for (int i = 0; i < SF_FEATURE_MAX; i++) h->f[i] = f;
  for (int i = 0; i < FX_SH; i++) h->ray.dir[i] = dir;
}

/* ---- leak ---- */

static const int32_t hard_leak[] = {4096, 4095, 1, 0};

static inline void make_leak(hard *h, int variant)
{
  for (int l = 0; l < SF_LAYERS; l++) h->scene.net.layer[l].k = hard_leak[variant];
}

/* D1's current I is constant. Leaky membranes lie between 0 and I; without leak the charge of step 0 is spent in whole
 * thresholds (hybrid) or never arrives (decay); with k = 1 every step is the first one. */
static inline void expect_leak(const hard *h, const hard_seen *seen, int variant)
{
  const int32_t mode = h->scene.net.mode, k = hard_leak[variant], theta = h->scene.net.layer[FX_D1].theta;
  for (int o = 0; o < SF_LANES; o++) {
    const int32_t current = seen->trace->current[FX_D1][0][o];
    int fired = 0;
    for (int t = 0; t < SF_T_MAX; t++) {
      const int32_t v = seen->trace->membrane[FX_D1][t][o];
      fired += hard_fired(seen, FX_D1, t, o);
      if (mode < FX_NODECAY) ck_assert(current < 0 ? v <= 0 && v >= current : v >= 0 && v <= current);
    }
    const int whole = current < 0 ? 0 : current / theta;
    if (k == 0 && mode == FX_HYBRID) ck_assert_int_eq(fired, whole < SF_T_MAX ? whole : SF_T_MAX);
    if (k == 0 && mode == FX_DECAY) ck_assert_int_eq(fired, 0);
    if (k == 4096 && mode == FX_NODECAY) ck_assert_int_eq(fired, current >= theta ? SF_T_MAX : 0);
  }
}

/* ---- threshold ---- */

static inline void make_theta_one(hard *h, int variant)
{
  (void)variant;
  hard_theta(&h->scene.net, 1);
}

static inline void expect_theta_one(const hard *h, const hard_seen *seen, int variant)
{
  (void)variant;
  if (h->scene.net.mode != FX_HYBRID) return;
  for (int o = 0; o < SF_LANES; o++)
    ck_assert_int_eq(hard_fired(seen, FX_D1, 0, o), seen->trace->current[FX_D1][0][o] > 0);
}

static inline void make_silent(hard *h, int variant)
{
  (void)variant;
  hard_theta(&h->scene.net, FX_MEMBRANE_MAX);
  h->scene.net.exp_in.bias = 0;
}

/* Outputs are those of zero currents, and no synaptic operation is counted. (The other modes may add up to the
 * threshold.) */
static inline void expect_silent(const hard *h, const hard_seen *seen, int variant)
{
  (void)variant;
  if (h->scene.net.mode >= FX_NODECAY) return;
  for (int l = 0; l < SF_LAYERS; l++) {
    ck_assert_int_eq(hard_spikes(seen, l), 0);
    for (int t = 0; t < SF_T_MAX; t++) ck_assert_uint_eq(seen->counts.layer[l].sop[t], 0);
  }
  if (h->scene.net.mode != FX_HYBRID) return;
  ck_assert_uint_eq(seen->out.sigma, 4096);
  for (int o = 0; o < 3; o++) ck_assert_uint_eq(seen->out.colour[o], 32768);
}

static inline void make_all_fire(hard *h, int variant)
{
  (void)variant;
  hard_weights(&h->scene.net, 127, 127);
  hard_theta(&h->scene.net, 1);
  hard_inputs(h, 2047, 2047);
}

static inline void expect_all_fire(const hard *h, const hard_seen *seen, int variant)
{
  (void)h, (void)variant;
  for (int l = FX_D1; l <= FX_C2; l++)
    if (l != FX_D2) ck_assert_int_eq(hard_spikes(seen, l), HARD_ALL);
  for (int t = 0; t < SF_T_MAX; t++) {
    ck_assert_int_eq(seen->trace->current[FX_D2][t][15], SF_LANES * fixture_rail(FX_D2, 15));
    ck_assert_uint_eq(seen->counts.layer[FX_C2].sop[t], SF_LANES * SF_LANES);
  }
}

/* variant = layer * 3 + (off + 1): the current of one neuron is 1000 (768 in C2) and theta `off` less. */
static const int hard_spiking[] = {FX_D1, FX_C1, FX_C2};

static inline void make_at_threshold(hard *h, int variant)
{
  fx_layer *l = h->scene.net.layer;
  hard_weights(&h->scene.net, 0, 0);
  hard_inputs(h, 0, 0);
  h->scene.net.steps = 1;
  l[FX_D1].w[0] = l[FX_C1].w[0] = 1, l[FX_C2].w[0] = 3;
  h->f[0] = h->ray.dir[0] = 1000;
  l[FX_D1].theta = l[FX_C1].theta = 1000, l[FX_C2].theta = 3 << SF_AC_FRAC;
  l[hard_spiking[variant / 3]].theta -= variant % 3 - 1;
}

static inline void expect_at_threshold(const hard *h, const hard_seen *seen, int variant)
{
  const int layer = hard_spiking[variant / 3], off = variant % 3 - 1;
  if (h->scene.net.mode != FX_HYBRID) return;
  ck_assert_int_eq(seen->trace->membrane[layer][0][0] - h->scene.net.layer[layer].theta, off);
  ck_assert_uint_eq(seen->trace->spikes[layer][0][0], off >= 0);
  ck_assert_uint_eq(seen->trace->spikes[layer][0][1], 0);
}

/* ---- weights and inputs ---- */

static const int8_t hard_even[] = {127, -127, 127, -127, 0}, hard_odd[] = {127, -127, -127, 127, 0};

static inline void make_rails(hard *h, int variant)
{
  const int sign = variant % 2 ? -1 : 1;
  hard_weights(&h->scene.net, hard_even[variant / 2], hard_odd[variant / 2]);
  hard_inputs(h, (int16_t)(2047 * sign), (int16_t)(-2047 * sign));
}

/* The widest sums are exact; alternating weights cancel, so that D1 fires as one or not at all. */
static inline void expect_rails(const hard *h, const hard_seen *seen, int variant)
{
  const int sign = variant % 2 ? -1 : 1, pair = hard_even[variant / 2] + hard_odd[variant / 2];
  const bool fires = sign * pair > 0;
  for (int o = 0; o < SF_LANES; o++) ck_assert_int_eq(seen->trace->current[FX_D1][0][o], sign * 16 * 2047 * pair);
  if (h->scene.net.mode == FX_HYBRID) ck_assert_uint_eq(seen->trace->spikes[FX_D1][0][1], fires ? UINT64_MAX : 0);
  if (!fires) ck_assert_int_eq(hard_spikes(seen, FX_D1), 0);
  if (pair == 0 && hard_even[variant / 2] == 0) ck_assert_int_eq(hard_spikes(seen, FX_C2), 0);
}

static inline void make_alternating(hard *h, int variant)
{
  (void)variant;
  hard_weights(&h->scene.net, 127, -127);
  for (int i = 0; i < SF_FEATURE_MAX; i++) h->f[i] = (int16_t)(i % 2 ? 2047 : -2047);
}

static inline void expect_alternating(const hard *h, const hard_seen *seen, int variant)
{
  (void)variant;
  for (int o = 0; o < SF_LANES; o++)
    ck_assert_int_eq(seen->trace->current[FX_D1][0][o], (o % 2 ? 1 : -1) * 32 * 2047 * 127);
  if (h->scene.net.mode == FX_HYBRID) ck_assert_uint_eq(seen->trace->spikes[FX_D1][0][0], 0xaaaaaaaaaaaaaaaau);
}

/* ---- steps ---- */

static inline void make_steps(hard *h, int variant)
{
  h->scene.net.steps = variant ? SF_T_MAX : 1;
}

static inline void expect_steps(const hard *h, const hard_seen *seen, int variant)
{
  (void)variant;
  for (int t = 0; t < SF_T_MAX; t++)
    for (int l = 0; l < SF_LAYERS; l++) {
      const bool radix = h->scene.net.mode == FX_RADIX, twice = radix && l == FX_C2 && t + 1 < h->scene.net.steps;
      const uint64_t units = (l == FX_D2 && !radix ? 1 : (uint64_t)h->scene.net.layer[l].n_out) << twice;
      if (t >= h->scene.net.steps) ck_assert_uint_eq(seen->trace->spikes[l][t][0] | seen->trace->spikes[l][t][1], 0);
      ck_assert_uint_eq(seen->counts.layer[l].updates[t], t < h->scene.net.steps ? units : 0);
    }
}

/* ---- density ---- */

static inline void make_exp_ends(hard *h, int variant)
{
  hard_theta(&h->scene.net, 1);
  hard_weights(&h->scene.net, 127, 127);
  hard_inputs(h, 100, 100);
  h->scene.net.layer[FX_D1].k = 4096;
  for (int i = 0; i < SF_LANES; i++) h->scene.net.layer[FX_D2].w[i * SF_LANES] = variant ? 127 : -127;
  h->scene.net.exp_in = (fx_scale){65535, 0, 0};
}

static inline void expect_exp_ends(const hard *h, const hard_seen *seen, int variant)
{
  ck_assert_int_eq(seen->trace->current[FX_D2][0][0], (variant ? 1 : -1) * SF_LANES * 127);
  if (h->scene.net.mode == FX_HYBRID) ck_assert_uint_eq(seen->out.sigma, variant ? (1u << SF_SIGMA_BITS) - 1 : 0);
}

/* Upwards and downwards. */
static inline void make_nodecay(hard *h, int variant)
{
  make_all_fire(h, 0);
  if (variant) hard_weights(&h->scene.net, -127, -127);
  for (int l = 0; l < SF_LAYERS; l++) h->scene.net.layer[l].k = 0;
  h->scene.net.exp_in = (fx_scale){65535, 0, 0};
}

/* D1's membranes saturate at all steps but the first. Where they fire so does 2^y at every step, and its sum at all but
 * the first; where they do not, eight times 2^0 is added up. */
static inline void expect_nodecay(const hard *h, const hard_seen *seen, int variant)
{
  if (h->scene.net.mode != FX_NODECAY) return;
  ck_assert_uint_eq(seen->out.sigma, variant ? 8 << SF_SIGMA_FRAC : (1u << SF_SIGMA_BITS) - 1);
  ck_assert_uint_eq(seen->counts.saturated[FX_D2], variant ? 0 : SF_T_MAX + SF_T_MAX - 1);
  ck_assert_uint_eq(seen->counts.saturated[FX_D1], (SF_T_MAX - 1) * SF_LANES);
}

/* ---- radix ---- */

/* Weights of the largest h, of either sign. */
static inline int8_t digits_weight(int neuron, int h)
{
  const int w = fixture_rail(FX_D2, 1) - (7 * neuron + 13 * h) % 28;
  return (int8_t)(h % 2 ? w : -w);
}

/* Currents of 0 to 8190 in steps of 130 against a threshold of 4096 (D1, C1), with an output of one weight each. C1's
 * current shows h. */
static inline void make_digits(hard *h, int variant)
{
  fx_layer *l = h->scene.net.layer;
  hard_weights(&h->scene.net, 0, 0);
  hard_theta(&h->scene.net, 4096);
  hard_inputs(h, 0, 0);
  h->f[0] = 130;
  h->scene.net.steps = variant + 1;
  for (int o = 0; o < SF_LANES; o++) l[FX_D1].w[o] = (int8_t)(o % 64);
  for (int i = 0; i < SF_LANES; i++) l[FX_D2].w[i * SF_LANES] = (int8_t)(i % 64 == 63 ? 100 : -1);
  for (int i = 0; i < SF_LANES; i++)
    for (int j = 0; j < fx_net_h(&h->scene.net); j++) l[FX_D2].w[i * SF_LANES + 1 + j] = digits_weight(i, j);
  for (int j = 0; j < fx_net_h(&h->scene.net); j++)
    l[FX_C1].w[(fx_net_constants(&h->scene.net) + j) * SF_LANES + j] = 1;
  h->scene.net.exp_in = (fx_scale){4096, 4, 0};
}

/* h of a sum of digits: its mean, rounded to 2^-T by a factor of 17 bits, then down by H_SHIFT. */
static inline int64_t digits_h(int64_t sum, int steps)
{
  const double factor = floor(ldexp(1, 15 + steps) / ((1 << steps) - 1) + 0.5);
  const double mean = floor(ldexp((double)sum * factor, -15) + 0.5);
  return (int64_t)floor(ldexp(mean, -SF_H_SHIFT - steps));
}

/* The digits of a current I < 2 theta: 2 theta * sum of 2^(t-s) spike(s) + what is left = 2^(t+1) I. So the membrane
 * tells the digits before it; and 2^y is asked once, of the sum of currents. */
static inline void expect_digits(const hard *h, const hard_seen *seen, int variant)
{
  const int steps = variant + 1;
  const int64_t theta = h->scene.net.layer[FX_D1].theta;
  if (h->scene.net.mode != FX_RADIX) return;
  int64_t sum = 0, of_h[SF_OUT_MAX] = {0};
  for (int o = 0; o < SF_LANES; o++) {
    const int64_t current = 130 * (o % 64);
    int64_t digits = 0;
    for (int t = 0; t < steps; t++) {
      digits *= 2;
      ck_assert_int_eq(seen->trace->membrane[FX_D1][t][o], ((int64_t)current << t) - theta * digits);
      digits += hard_fired(seen, FX_D1, t, o);
    }
    sum += digits * (o % 64 == 63 ? 100 : -1);
    for (int j = 0; j < fx_net_h(&h->scene.net); j++) of_h[j] += digits * digits_weight(o, j);
    if (current == 0) ck_assert_int_eq(digits, 0);
  }
  for (int j = 0; j < fx_net_h(&h->scene.net); j++)
    ck_assert_int_eq(seen->trace->current[FX_C1][0][j], digits_h(of_h[j], steps));
  const fx_scale *s = &h->scene.net.exp_in;
  const double y = sum * ldexp(s->mul, -s->shift) / ((1 << steps) - 1), near = 1 + fabs(y) / 65536;
  ck_assert_uint_ge(seen->out.sigma, fx_exp2((int32_t)floor(y - near)));
  ck_assert_uint_le(seen->out.sigma, fx_exp2((int32_t)ceil(y + near)));
  for (int t = 0; t < steps; t++) ck_assert_uint_eq(seen->counts.layer[FX_D2].special[t], t == steps - 1);
}

/* ---- checkpoints ---- */

static inline void make_denormals(hard *h, int variant)
{
  sf_model m = test_model(SF_NET_SNN, SF_HYBRID, 32, 4, 1);
  const float denormal = variant ? -1e-45f : 1e-42f;
  for (int id = SF_P_GRID; id < SF_P_LEAK; id++)
    for (size_t i = 0; i < m.param[id].size; i++) sf_model_param(&m, (sf_param_id)id)[i] = denormal;
  m.t_r = 4;
  fx_scene_free(&h->scene);
  const sf_status status = sf_quantise(&h->scene, &m, "denormal", &(sf_quant_options){.seed = 1});
  ck_assert_msg(status.code == SF_OK, "%s", status.message);
  sf_model_free(&m);
}

/* Nothing fires: density e^0 per model unit (2 per box edge), grey. */
static inline void expect_denormals(const hard *h, const hard_seen *seen, int variant)
{
  (void)variant;
  for (int l = 0; l < SF_LAYERS; l++) ck_assert_int_eq(hard_spikes(seen, l), 0);
  if (h->scene.net.mode != FX_HYBRID) return;
  ck_assert_uint_eq(seen->out.sigma, 2 << SF_SIGMA_FRAC);
  for (int o = 0; o < 3; o++) ck_assert_uint_eq(seen->out.colour[o], 32768);
}

enum { HARD_PARAMS = 7 };
static inline void make_not_finite(hard *h, int variant)
{
  static const sf_param_id params[HARD_PARAMS] = {SF_P_GRID, SF_P_D1, SF_P_D2, SF_P_C1, SF_P_C2, SF_P_C3, SF_P_LEAK};
  static const float bad[] = {NAN, INFINITY, -INFINITY};
  const sf_param_id id = params[variant / 3];
  sf_model m = test_model(SF_NET_SNN, SF_HYBRID, 32, 4, 1);
  m.t_r = 4;
  sf_model_param(&m, id)[m.param[id].size / 2] = bad[variant % 3];
  fx_scene_free(&h->scene);
  const sf_status status = sf_quantise(&h->scene, &m, "model.safetensors", &(sf_quant_options){.seed = 1});
  ck_assert_int_eq(status.code, SF_E_RANGE);
  ck_assert_msg(strstr(status.message, m.param[id].name), "'%s' does not name the tensor", status.message);
  ck_assert_ptr_null(h->scene.owner);
  sf_model_free(&m);
}
#endif
