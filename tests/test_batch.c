/* Packing of rays into bundles of blocks, and compaction against the naive transmittance. */
#include "along_fixture.h"
#include "ck_run.h"
#include "render/composite.h"
#include "train_fixture.h"

static void check_layout(const sf_batch *b)
{
  int rays = 0, blocks = 0;
  for (int i = 0; i < b->bundles; i++) {
    const sf_bundle *bundle = &b->bundle[i];
    int lanes = 0;
    ck_assert_int_eq(bundle->ray, rays);
    ck_assert_int_eq(bundle->block, blocks);
    ck_assert_int_gt(bundle->rays, 0);
    for (int r = bundle->ray; r < bundle->ray + bundle->rays; r++) {
      ck_assert_int_eq(b->ray[r].first, lanes);
      ck_assert_int_eq(b->ray[r].lane, blocks * SF_BLOCK + lanes);
      lanes += b->ray[r].count;
    }
    ck_assert(bundle->rays == 1 || lanes <= BUNDLE_FILL);
    ck_assert_int_eq(bundle->blocks, (lanes + SF_BLOCK - 1) / SF_BLOCK);
    ck_assert_int_le(bundle->blocks, BUNDLE_BLOCKS);
    rays += bundle->rays;
    blocks += bundle->blocks;
  }
  ck_assert_int_eq(rays, b->rays);
  ck_assert_int_eq(blocks, b->blocks);
}

/* Where samples leave there may be more blocks, but no more than there is room for. */
TEST(fewer_samples_may_take_more_blocks)
{
  static const int count[] = {384, 128, 2, 510};
  OWNED(sf_batch) b;
  ck_ok(sf_batch_create(&b, 1 << 14, 8));
  b.rays = 4;
  for (int r = 0; r < 4; r++) b.ray[r].count = count[r];
  sf_batch_pack(&b);
  ck_assert_int_eq(b.blocks, 16);
  b.ray[1].count--;
  sf_batch_pack(&b);
  ck_assert_int_eq(b.blocks, 17);
  for (uint64_t seed = 0; seed < 3000; seed++) {
    const uint64_t longest = seed % 2 ? 1025 : 2 + seed / 2 % 600;
    int samples = 0;
    b.rays = 1 + (int)sf_random_below(seed, 1, 0, 60);
    for (int r = 0; r < b.rays; r++) samples += b.ray[r].count = (int)sf_random_below(seed, 2, r, longest);
    sf_batch_pack(&b);
    ck_assert_int_le(b.blocks, sf_batch_blocks(samples));
  }
}

static double empty_lanes(const sf_batch *b)
{
  double used = 0;
  for (int r = 0; r < b->rays; r++) used += b->ray[r].count;
  return 1 - used / ((double)b->blocks * SF_BLOCK);
}

TEST(every_ray_is_in_one_bundle)
{
  OWNED(sf_batch) b;
  ck_ok(sf_batch_create(&b, 1 << 14, 8));
  for (uint64_t seed = 0; seed < 60; seed++) {
    const uint64_t longest = seed % 4 == 0 ? 1025 : seed % 4 == 1 ? 2 : 40; /* long, nearly empty, usual rays */
    b.rays = 1 + (int)sf_random_below(seed, 1, 0, 2000);
    for (int r = 0; r < b.rays; r++) b.ray[r].count = (int)sf_random_below(seed, 2, r, longest);
    sf_batch_pack(&b);
    check_layout(&b);
    /* Of a dozen ray boundaries one is near the end of a block: a few empty lanes, not 32 of 512. */
    if (longest == 40 && b.rays > 500) ck_assert_double_lt(empty_lanes(&b), 0.02);
  }
  for (int r = 0; r < b.rays; r++) b.ray[r].count = 0;
  sf_batch_pack(&b);
  check_layout(&b);
}

/* Samples of ray r that light reaches in a composited prefix, one by one with the oracle. x: of the first. */
static int reached(const sf_trainer *t, const sf_loss_plan *plan, int r, float *x0)
{
  const sf_batch *b = &t->batch;
  naive along = {.m = &t->model};
  double depth[T] = {0};
  for (int s = 0; s < b->ray[r].count; s++) {
    const int lane = b->ray[r].lane + s;
    float x[3], f[32], sh[16] = {0}, sigma[T], colour[3 * T];
    bool lit = false;
    for (int a = 0; a < 3; a++) x[a] = b->x[((size_t)(lane / SF_BLOCK) * 3 + a) * SF_BLOCK + lane % SF_BLOCK];
    if (s == 0) *x0 = x[0];
    for (int p = 0; p < plan->steps; p++) lit |= plan->weight[p] > 0 && depth[p] < -(double)plan->stop;
    if (!lit) return s;
    sf_grid_features(&t->model, x, f);
    if (t->model.config.along)
      naive_sample(&along, f, sh, sigma, colour);
    else
      sf_net_sample(&t->model, f, sh, plan->steps, sigma, colour, NULL);
    for (int p = 0; p < plan->steps; p++) depth[p] += (double)sigma[p] * b->delta[lane];
  }
  return b->ray[r].count;
}

/* Lanes without a sample whose features are not zero. Kernels count the spikes of all lanes when they choose between
 * events and dense products, so what lies there decides about rounding. */
static int used_empty_lanes(const sf_batch *b, int features)
{
  bool *sample = calloc((size_t)b->blocks * SF_BLOCK, sizeof *sample);
  int empty = 0, used = 0;
  for (int r = 0; r < b->rays; r++)
    for (int s = 0; s < b->ray[r].count; s++) sample[b->ray[r].lane + s] = true;
  for (int lane = 0; lane < b->blocks * SF_BLOCK; lane++) {
    if (sample[lane]) continue;
    empty++;
    bool zero = true;
    for (int i = 0; i < features; i++)
      zero &= b->f[((size_t)(lane / SF_BLOCK) * features + i) * SF_BLOCK + lane % SF_BLOCK] == 0;
    used += !zero;
  }
  free(sample);
  ck_assert_int_gt(empty, 0);
  return used;
}

/* Features of samples that are not those of their place, bit for bit. */
static int wrong_features(const sf_trainer *t)
{
  const sf_batch *b = &t->batch;
  const int levels = t->model.config.levels;
  const float *table = sf_model_param(&t->model, SF_P_GRID);
  int wrong = 0;
  for (int r = 0; r < b->rays; r++)
    for (int s = 0; s < b->ray[r].count; s++) {
      const int lane = b->ray[r].lane + s;
      for (int level = 0; level < levels; level++) {
        float out[2 * SF_BLOCK];
        t->kernels->grid_forward(&t->model.level[level], table, b->x + (size_t)(lane / SF_BLOCK) * 3 * SF_BLOCK, out);
        const float *f = b->f + ((size_t)(lane / SF_BLOCK) * levels + level) * 2 * SF_BLOCK;
        wrong += f[lane % SF_BLOCK] != out[lane % SF_BLOCK];
        wrong += f[SF_BLOCK + lane % SF_BLOCK] != out[SF_BLOCK + lane % SF_BLOCK];
      }
    }
  return wrong;
}

/* After some iterations on the simple scene: what compaction keeps is what composites to a transmittance above 1e-4 in
 * front of it in a composited prefix, sample by sample with the oracle, and nothing else of the batch changes. Of nets
 * that take steps at every sample, and of nets along rays. */
LOOP_TEST(compaction_keeps_what_light_reaches, 2)
{
  sf_train_options o = small_run();
  o.stage1 = 110;
  if (_i) o.config.steps = o.config.along = 1, o.config.mode = SF_HYBRID;
  OWNED(trainer) t = start(&data, &o, NULL);
  steps(t, 100);
  t->kernels = sf_kernels_select(NULL); /* those that do not round */
  ck_ok(sf_batch_draw(t));
  sf_batch *b = &t->batch;
  const int rays = b->rays;
  for (int i = 0; i < b->blocks * SF_BLOCK; i++) /* light ends, sample by sample */
    b->delta[i] *= 5 + 40 * sf_random_float(9, 0, (uint64_t)i);
  int *expected = calloc((size_t)rays, sizeof *expected), dropped = 0, longest = 0;
  float *first_x = calloc((size_t)rays, sizeof *first_x);
  const sf_loss_plan many = {.steps = T,
                             .regular_at = 3,
                             .weight = {[1] = 0.5f, [2] = 0.5f, [T - 1] = 1},
                             .stop = (float)log(t->model.config.stop)},
                     one = {.steps = 1, .regular_at = 1, .weight = {1}, .stop = many.stop}, *plan = _i ? &one : &many;
  for (int r = 0; r < rays; r++) {
    expected[r] = reached(t, plan, r, &first_x[r]);
    dropped += b->ray[r].count - expected[r];
    longest = expected[r] > longest ? expected[r] : longest;
  }
  ck_assert_int_gt(dropped, 50);
  ck_assert_int_gt(longest, 16); /* more than two rounds see */
  sf_loss_sums mean = {0};
  double firing[3];
  ck_assert_int_le(sf_batch_blocks(b->marched), b->block_capacity);
  sf_gradient_run(t, plan, &mean, firing);
  check_layout(b);
  ck_assert_int_eq(used_empty_lanes(b, 2 * t->model.config.levels), 0);
  ck_assert_int_eq(wrong_features(t), 0);
  int differ = 0, samples = 0;
  for (int r = 0; r < rays; r++) {
    differ += b->ray[r].count != expected[r];
    samples += b->ray[r].count;
    if (b->ray[r].count)
      ck_assert_float_eq(b->x[(size_t)(b->ray[r].lane / SF_BLOCK) * 3 * SF_BLOCK + b->ray[r].lane % SF_BLOCK],
                         first_x[r]);
  }
  ck_assert_int_eq(samples, b->samples);
  ck_assert_int_le(differ, 1); /* float sums of another order at the limit */
  free(expected);
  free(first_x);
}

/* Three sixteenths of the samples, within 1536 and 4096, are few rays; three times as many are many. Of TensoRF, whose
 * rays have a limit, 512 are few. */
TEST(few_rays_make_the_lattice_coarser)
{
  static const struct {
    int samples, limit, few, many; /* many: 0 where the limit lies below */
  } cases[] = {{256, 0, 1536, 4608},      {8192, 0, 1536, 4608},      {16384, 0, 3072, 9216}, {24576, 0, 4096, 12288},
               {1 << 20, 0, 4096, 12288}, {1 << 15, 4096, 512, 1536}, {1 << 15, 400, 400, 0}};
  sf_train_options o = small_run();
  OWNED(trainer) t = start(&data, &o, NULL);
  for (int i = 0; i < COUNT(cases); i++) {
    const int few = cases[i].few, many = cases[i].many ? cases[i].many : cases[i].limit;
    const struct {
      int rays, stride;
    } turns[] = {{few - 1, 4}, {few, 2}, {many, 2}, {many + 1, cases[i].many ? 1 : 2}};
    t->options.samples = cases[i].samples, t->options.rays = cases[i].limit;
    for (int k = 0; k < COUNT(turns); k++) {
      t->rays = turns[k].rays, t->stride = 2, t->batch.samples = t->options.samples;
      sf_batch_adapt(t);
      ck_assert_msg(t->stride == turns[k].stride, "%d samples, %d rays: stride %d", t->options.samples, turns[k].rays,
                    t->stride);
    }
  }
}

static void set_up(void)
{
  open_scene(4);
}

ck_options ck_program = {.set_up_all = set_up, .tear_down_all = close_scene, .one_process = true};
