/* Nets along rays: kernels and renderers beside a naive net that carries its membranes from sample to sample, what it
 * costs, training, files (test_gradient.c proves the gradients). */
#include "ck_run.h"
#include "along_fixture.h"
#include "tensorf_fixture.h"
#include "train_fixture.h"
#include "energy/along.h"
#include "quant/quant.h"
#include "render/composite.h"
#include <omp.h>

static void set_up(void)
{
  open_scene(6);
}

/* ---- kernels ---- */

enum { HIDDEN = 48, BLOCKS = 2, LANES = SF_BLOCK + 30 };

typedef struct rig {
  sf_model model;
  sf_net_words *net;
  sf_block *block; /* [BLOCKS] */
  sf_net_scratch *scratch;
  sf_net_grad *grad;
  sf_ray_state state;
} rig;

/* Rays begin at these lanes; the fourth goes on in the second block. */
static bool begins_at(int lane)
{
  return lane == 0 || lane == 1 || lane == 20 || lane == 50 || lane == SF_BLOCK + 12;
}

static rig *rig_make(sf_input_mode mode)
{
  rig *r = calloc(1, sizeof *r);
  r->model = test_model(SF_NET_SNN, mode, HIDDEN, 1, 0.6f);
  r->model.config.along = 1;
  drive(&r->model);
  r->net = sf_aligned_alloc(sizeof *r->net);
  r->block = sf_aligned_alloc(BLOCKS * sizeof *r->block);
  r->scratch = sf_aligned_alloc(sizeof *r->scratch);
  r->grad = sf_aligned_alloc(sizeof *r->grad);
  for (int b = 0; b < BLOCKS; b++) {
    sf_block *x = &r->block[b];
    x->lanes = b ? LANES - SF_BLOCK : SF_BLOCK;
    for (int i = 0; i < 8 * SF_BLOCK; i++) x->f[i] = 2 * test_random(1u << 22 | (unsigned)(b << 14 | i));
    for (int i = 0; i < SF_DIR_FEATURES * SF_BLOCK; i++) x->sh[i] = test_random(1u << 23 | (unsigned)(b << 14 | i));
    for (int l = 0; l < SF_BLOCK; l++) {
      x->state[l] = &r->state;
      x->first |= (uint64_t)begins_at(b * SF_BLOCK + l) << l;
    }
  }
  return r;
}

static void rig_free(rig **r)
{
  sf_model_free(&(*r)->model);
  free((*r)->net), free((*r)->block), free((*r)->scratch), free((*r)->grad);
  free(*r);
}
typedef rig *rig_p;
#define rig_p_free rig_free

static void rig_forward(rig *r, const sf_kernels *k)
{
  const sf_net_view view = sf_net_view_of(&r->model);
  k->prepare(&view, r->net);
  for (int b = 0; b < BLOCKS; b++) k->along_forward(r->net, &r->block[b], r->scratch);
}

/* A current within rounding of the threshold may fire in one and not in the other, and then the rest of its ray
 * differs: at most one ray may, of 5 with up to 30 samples. */
LOOP_TEST(kernels_equal_the_naive_net, 9)
{
  static const char *const isa[] = {"portable", "avx2", "avx512"};
  const sf_kernels *k = sf_kernels_select(isa[_i / 3]);
  if (!k) return;
  OWNED(rig_p) r = rig_make((sf_input_mode)(_i % 3));
  naive n = {.m = &r->model};
  int wrong_rays = 0, wrong = 0;
  rig_forward(r, k);
  for (int lane = 0; lane < LANES; lane++) {
    const sf_block *x = &r->block[lane / SF_BLOCK];
    const int l = lane % SF_BLOCK;
    float f[8], sh[SF_DIR_FEATURES], sigma, colour[3];
    if (begins_at(lane)) n.before = 0, wrong_rays += wrong, wrong = 0;
    for (int i = 0; i < 8; i++) f[i] = x->f[i * SF_BLOCK + l];
    for (int i = 0; i < SF_DIR_FEATURES; i++) sh[i] = x->sh[i * SF_BLOCK + l];
    naive_sample(&n, f, sh, &sigma, colour);
    wrong |= fabsf(x->sigma[0][l] - sigma) > 1e-4f * (1 + sigma);
    for (int c = 0; c < 3; c++) wrong |= fabsf(x->colour[0][c * SF_BLOCK + l] - colour[c]) > 1e-4f;
  }
  ck_assert_int_le(wrong_rays + wrong, 1);
  for (int l = 0; l < 3; l++) { /* it fires, and not always */
    const double rate = (double)n.spikes[l] / (LANES * HIDDEN);
    ck_assert_msg(rate > 0.02 && rate < 0.9, "layer %d fires at %g", l, rate);
  }
}

TEST(density_equals_forward)
{
  OWNED(rig_p) r = rig_make(SF_HYBRID);
  const sf_kernels *k = sf_kernels_select(NULL);
  float sigma[BLOCKS][SF_BLOCK];
  rig_forward(r, k);
  for (int b = 0; b < BLOCKS; b++) memcpy(sigma[b], r->block[b].sigma[0], sizeof sigma[b]);
  for (int b = 0; b < BLOCKS; b++) {
    memset(r->block[b].sigma[0], 0, sizeof sigma[b]);
    k->along_density(r->net, &r->block[b], r->scratch);
    ck_assert_mem_eq(sigma[b], r->block[b].sigma[0], (size_t)r->block[b].lanes * sizeof(float));
  }
}

/* The same spikes, only the backward pass is compared. Between rays nothing is carried. */
LOOP_TEST(backward_of_every_isa_agrees, 4)
{
  static float ds[BLOCKS * SF_BLOCK], dc[BLOCKS * 3 * SF_BLOCK], df[2][BLOCKS * 8 * SF_BLOCK];
  const sf_kernels *of[2] = {sf_kernels_select("portable"), sf_kernels_select(backward_bounds[_i].isa)};
  if (!of[1]) return;
  OWNED(rig_p) a = rig_make(SF_HYBRID);
  OWNED(rig_p) b = rig_make(SF_HYBRID);
  rig *r[2] = {a, b};
  const float bound = backward_bounds[_i].bound;
  for (int i = 0; i < BLOCKS * SF_BLOCK; i++) ds[i] = test_random(1u << 24 | (unsigned)i);
  for (int i = 0; i < BLOCKS * 3 * SF_BLOCK; i++) dc[i] = test_random(1u << 25 | (unsigned)i);
  rig_forward(a, of[0]);
  rig_forward(b, of[1]);
  memcpy(b->block, a->block, BLOCKS * sizeof *a->block);
  for (int s = 0; s < 2; s++)
    for (int x = BLOCKS - 1; x >= 0; x--)
      of[s]->along_backward(r[s]->net, &r[s]->block[x], ds + x * SF_BLOCK, dc + x * 3 * SF_BLOCK,
                            df[s] + x * 8 * SF_BLOCK, r[s]->grad, r[s]->scratch);
  for (int row = 0; row < HIDDEN; row++) b->grad->w3[32 * row + 16] = a->grad->w3[32 * row + 16]; /* scratch */
  ck_assert_float_le(distance(b->grad->w1, a->grad->w1, HIDDEN * 16), bound);
  ck_assert_float_le(distance(b->grad->w2, a->grad->w2, 16 * HIDDEN), bound);
  ck_assert_float_le(distance(b->grad->w3, a->grad->w3, HIDDEN * 32), bound);
  ck_assert_float_le(distance(b->grad->w4t, a->grad->w4t, HIDDEN * HIDDEN), bound);
  ck_assert_float_le(distance(b->grad->w5, a->grad->w5, 3 * HIDDEN), bound);
  ck_assert_float_le(distance(b->grad->leak, a->grad->leak, SF_LAYERS), bound);
  ck_assert_float_le(distance(df[1], df[0], BLOCKS * 8 * SF_BLOCK), bound);
  for (int l = 0; l < 3; l++)
    for (int i = 0; i < HIDDEN; i++) ck_assert_float_eq(a->scratch->carry.v[l][i], 0);
}

/* ---- rendering ---- */

enum { RAYS = 300 }; /* more than a packet */

static sf_model along_model(int planes)
{
  sf_model m = planes ? test_tensorf(SF_NET_SNN, 0, 32, 1) : test_model(SF_NET_SNN, SF_HYBRID, 32, 1, 0.6f);
  m.config.along = 1;
  m.t_r = 1, m.t_star = 1;
  if (!planes) drive(&m);
  if (planes) m.config.tensorf.shift = -2, m.config.tensorf.weight_stop = 0.008;
  return m;
}

static void make_rays(float origin[RAYS][3], float direction[RAYS][3])
{
  for (int r = 0; r < RAYS; r++) {
    float length = 0;
    for (int a = 0; a < 3; a++) {
      origin[r][a] = (a == 2 ? 2.5f : 0.5f * test_random((uint64_t)(7 * r + a)));
      direction[r][a] = 0.3f * test_random((uint64_t)(7 * r + 3 + a)) - origin[r][a];
      length += direction[r][a] * direction[r][a];
    }
    for (int a = 0; a < 3; a++) direction[r][a] /= sqrtf(length);
  }
}

/* Of a hash grid every sample is a step; of planes those that are seen. Returns the samples. */
static int naive_ray(naive *n, const sf_steps *intervals, const float *o, const float *d, float rgb[3])
{
  const sf_model *m = n->m;
  const sf_march march = sf_march_begin(m, intervals, o, d, 0.5f);
  float x[3], sh[SF_DIR_FEATURES], light = 1;
  n->before = 0;
  sf_sh4(d, sh);
  memset(rgb, 0, 3 * sizeof *rgb);
  for (int at = sf_march_next(&march, 0, x); at >= 0 && light >= m->config.stop;
       at = sf_march_next(&march, at + 1, x)) {
    float in[SF_DECODER_MAX], features[SF_APPEARANCE_MAX], sigma, colour[3] = {0};
    if (sf_model_decodes(m)) {
      sigma = sf_tensorf_sigma(&m->config.tensorf, sf_tensorf_density_feature(m, x));
      sf_tensorf_appearance(m, x, features);
      sf_tensorf_encode(&m->config.tensorf, features, d, in);
    } else
      sf_grid_features(m, x, in);
    const float length = intervals->length[at];
    const bool seen =
        !sf_model_decodes(m) || light * (1 - expf(-sigma * length)) > (float)m->config.tensorf.weight_stop;
    if (seen) naive_sample(n, in, sh, &sigma, colour);
    const float behind = light * expf(-sigma * length);
    for (int c = 0; c < 3 && seen; c++) rgb[c] += (light - behind) * colour[c];
    light = behind;
  }
  for (int c = 0; c < 3; c++) rgb[c] += light;
  return n->before;
}

LOOP_TEST(rendering_equals_the_naive_net, 2)
{
  static const float white[3] = {1, 1, 1};
  static float origin[RAYS][3], direction[RAYS][3], rgb[RAYS][3], samples[RAYS];
  OWNED(sf_model) m = along_model(_i);
  naive n = {.m = &m};
  sf_steps intervals;
  sf_ray_events events = {0};
  uint64_t all = 0, met = 0;
  int wrong = 0, longest = 0;
  make_rays(origin, direction);
  ck_ok(sf_steps_make(&intervals, &m.config, 1));
  ck_ok(sf_render_counted(&m, origin[0], direction[0], RAYS, 0, white, rgb[0], NULL, NULL, samples, &events));
  for (int r = 0; r < RAYS; r++) {
    float expected[3], bad = 0;
    const int count = naive_ray(&n, &intervals, origin[r], direction[r], expected);
    for (int c = 0; c < 3; c++) bad = fmaxf(bad, fabsf(rgb[r][c] - expected[c]));
    wrong += bad > 1e-3f || (int)samples[r] != count;
    all += (uint64_t)count, met += count > 0;
    longest = count > longest ? count : longest;
  }
  ck_assert_int_ge(longest, 8);
  ck_assert_int_le(wrong, RAYS / 50);
  ck_assert_double_le(fabs((double)events.samples - (double)all), 0.005 * (double)all);
  ck_assert_double_le(fabs((double)events.rays - (double)met), 2);
  for (int l = _i; l < 3; l++) {
    ck_assert_uint_gt(n.spikes[l], 1000);
    ck_assert_double_le(fabs((double)events.spikes[l] - (double)n.spikes[l]), 0.01 * (double)n.spikes[l]);
  }
  if (_i) ck_assert_uint_eq(events.spikes[0], 0);
}

/* A ray does not see the others, and threads do not change it. */
LOOP_TEST(each_ray_is_alone, 2)
{
  static const float white[3] = {1, 1, 1};
  static float origin[RAYS][3], direction[RAYS][3], rgb[RAYS][3], one[3];
  OWNED(sf_model) m = along_model(_i);
  sf_ray_events together = {0}, apart = {0};
  make_rays(origin, direction);
  omp_set_num_threads(3);
  ck_ok(sf_render_counted(&m, origin[0], direction[0], RAYS, 0, white, rgb[0], NULL, NULL, NULL, &together));
  omp_set_num_threads(1);
  for (int r = 0; r < RAYS; r++) {
    ck_ok(sf_render_counted(&m, origin[r], direction[r], 1, 0, white, one, NULL, NULL, NULL, &apart));
    ck_assert_mem_eq(one, rgb[r], sizeof one);
  }
  ck_assert_mem_eq(&together, &apart, sizeof apart);
}

/* ---- what it costs ---- */

TEST(the_cost_by_hand)
{
  const sf_ray_events e = {.rays = 2, .samples = 5, .spikes = {7, 11, 13}};
  OWNED(sf_model) grid = along_model(0), planes = along_model(1), twin = test_model(SF_NET_ANN, SF_HYBRID, 32, 1, 1);
  fx_cost cost = sf_float_cost(&grid, &e);
  ck_assert_uint_eq(cost.macs, 5 * 32 * (8 + 15) + 2 * 32 * 16);
  ck_assert_uint_eq(cost.sops, 7 * 16 + 11 * 32 + 13 * 3);
  ck_assert_uint_eq(cost.spikes, 31);
  ck_assert_uint_eq(sf_cost_fj(&cost), 4600 * cost.macs + 900 * cost.sops);
  cost = sf_float_cost(&planes, &e);
  ck_assert_uint_eq(cost.macs, 5 * 32 * 150);
  ck_assert_uint_eq(cost.sops, 11 * 32 + 13 * 3);
  cost = sf_float_cost(&twin, &(sf_ray_events){.rays = 2, .samples = 5});
  ck_assert_uint_eq(cost.macs, 5 * 32 * (8 + 16 + 31 + 32 + 3));
  ck_assert_uint_eq(cost.sops, 0);
}

/* ---- training ---- */

static sf_train_options along_run(int planes)
{
  sf_train_options o = small_run();
  if (planes) {
    o = sf_train_defaults_tensorf(&data);
    o.config.hidden = 32;
    o.config.occ_res = 16;
    o.voxels = 16, o.rays = 128, o.samples = 2048;
    o.stage1 = 12, o.stage2 = 28;
  }
  o.config.steps = o.config.along = 1, o.config.mode = SF_HYBRID;
  return o;
}

LOOP_TEST(same_bits_for_any_threads_and_resumed, 2)
{
  const sf_train_options o = along_run(_i);
  omp_set_num_threads(1);
  OWNED(trainer) a = start(&data, &o, NULL);
  const double first = steps(a, 4).mse, last = steps(a, 36).mse;
  ck_assert_double_lt(last, first);
  omp_set_num_threads(3);
  OWNED(trainer) b = start(&data, &o, NULL);
  steps(b, 40);
  same_model(a, b);
  ck_assert_int_eq(a->stage, 3);
  ck_resume(&o, &o, 17, 16);
}

/* ---- files, and what is refused ---- */

TEST(a_file_says_it)
{
  OWNED(sf_model) m = along_model(0), back = {0};
  ck_ok(sf_model_save(&m, in("along.safetensors")));
  ck_ok(sf_model_load(&back, in("along.safetensors")));
  ck_assert_int_eq(back.config.along, 1);
  sf_tensors set;
  OWNED(sf_model) plain = test_model(SF_NET_SNN, SF_HYBRID, 32, 2, 1);
  plain.t_r = 1, plain.t_star = 1;
  ck_ok(sf_model_save(&plain, in("plain.safetensors")));
  ck_ok(sf_tensors_load(&set, in("plain.safetensors")));
  ck_assert_ptr_null(sf_tensors_meta(&set, "along_ray")); /* files of before do not change */
  sf_tensors_free(&set);
  plain.config.along = 1;
  ck_bad(sf_config_check(&plain.config), SF_E_RANGE, "steps", "outside 1..1");
  plain.config.steps = 1, plain.config.net = SF_NET_ANN;
  ck_bad(sf_config_check(&plain.config), SF_E_RANGE, "along_ray", "outside 0..0");
}

TEST(the_accelerator_refuses_it)
{
  OWNED(sf_model) m = along_model(0);
  fx_scene scene;
  ck_bad(sf_quantise(&scene, &m, "along", &(sf_quant_options){0}), SF_E_UNSUPPORTED, "along_ray", "--steps-along-ray");
}

int ck_timeout = 60;
ck_options ck_program = {.set_up_all = set_up, .tear_down_all = close_scene, .one_process = true};
