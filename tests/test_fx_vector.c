/* Vector kernels against the portable core, bit for bit: nets, grid, marching, whole rays with their counts, on random
 * scenes of every size and mode. SF_FX_SAMPLES: samples through the nets for each instruction set (default 40 000). */
#include "ck_run.h"
#include "base/memory.h"
#include "fx_hard_cases.h"
#include "src/fx/core.h"
#include "src/fx/net.h"

static const char *const instruction_sets[] = {"avx2", "avx512vnni", "amx"};

static long samples_wanted(void)
{
  const char *text = getenv("SF_FX_SAMPLES");
  const long wanted = text ? atol(text) : 40000;
  ck_assert_msg(wanted > 0, "SF_FX_SAMPLES=%s: at least one", text);
  return wanted;
}

static int64_t pick(uint64_t seed, uint64_t what, int64_t low, int64_t high)
{
  return fixture_pick(seed, 100, what, low, high);
}

/* Thresholds from 'always fires' over typical to 'never', so that C2 meets events and dense rows; every third scene has
 * its weights at the rails. */
static fx_scene random_net_scene(uint64_t seed, bool decodes)
{
  fixture_sizes sizes = seed % 2 ? fixture_random_sizes(seed) : fixture_ingp;
  if (decodes) sizes = seed % 2 ? fixture_random_decoder(seed) : fixture_decoder;
  sizes.mode = (int)(seed / 2 % 4), sizes.steps = (int)pick(seed, 0, 1, SF_T_MAX);
  fx_scene s = fixture_scene(&sizes, seed);
  for (int l = 0; l < SF_LAYERS; l++) {
    fx_layer *layer = &s.net.layer[l];
    if (layer->theta)
      layer->theta = (int32_t)pick(seed, 1 + (uint64_t)l, 0, 3) * 25000 * (l == FX_C2 ? 4 : 1) +
                     (int32_t)pick(seed, 6 + (uint64_t)l, 1, 30000);
    if (seed % 16 == 5 && layer->theta) layer->theta = FX_MEMBRANE_MAX >> (sizes.mode == FX_RADIX);
    for (int i = 0; seed % 3 == 0 && i < fx_layer_rows(layer) * SF_LANES; i++)
      layer->w[i] = (int8_t)(((layer->w[i] > 0) - (layer->w[i] < 0)) * fixture_rail(l, i % SF_LANES));
    if (seed % 5 == 0) layer->k = (int32_t[]){0, 1, 4095, 4096}[pick(seed, 12 + (uint64_t)l, 0, 3)];
  }
  s.net.exp_in = (fx_scale){(int32_t)pick(seed, 20, 0, 65535), (int32_t)pick(seed, 21, 0, 31),
                            (int32_t)pick(seed, 22, -131072, 131071)};
  if (seed % 4) s.net.exp_in.shift = (int32_t)pick(seed, 23, 12, 18);
  s.net.sigmoid_in = (fx_scale){(int32_t)pick(seed, 24, 0, 65535), (int32_t)pick(seed, 25, 0, 31), 0};
  for (int l = 0; l < s.grid.levels; l++) s.grid.shift[l] = (int32_t)pick(seed, 30 + (uint64_t)l, 0, 24);
  s.trans_stop = (int32_t)pick(seed, 50, 0, 1 << 19);
  s.max_samples = (int32_t)pick(seed, 51, 1, 80);
  const fx_scene *check = &s;
  ck_ok(fx_scene_check(check, "random scene"));
  return s;
}

static fx_scene random_scene(uint64_t seed)
{
  return random_net_scene(seed, false);
}

static fx_core *open_core(const fx_scene *scene, const char *name)
{
  fx_core *core;
  ck_ok(fx_core_open(&core, scene, name));
  ck_assert_str_eq(fx_core_kernels(core), name);
  return core;
}

static void compare_sample(const fx_net *net, const fx_block *b, int i, const char *name, uint64_t seed)
{
  fx_events events;
  fx_out out;
  int32_t base[SF_LANES];
  if (fx_net_decodes(net)) fx_net_direction(net, b->constant[i], base, NULL);
  fx_net_events(net, b->f[i], fx_net_decodes(net) ? base : b->base[i], &out, &events, NULL);
  for (int t = 0; t < net->steps; t++)
    for (int l = 0; l < FX_SPIKING; l++)
      ck_assert_msg(!memcmp(events.spikes[fx_spiking_layers[l]][t], b->spikes[l][t][i], sizeof b->spikes[l][t][i]),
                    "%s, scene %llu, sample %d of %d: spikes of layer %d at step %d", name, (unsigned long long)seed, i,
                    b->n, fx_spiking_layers[l], t);
  ck_assert_msg(!memcmp(&out, &b->out[i], sizeof out), "%s, scene %llu, sample %d of %d: output", name,
                (unsigned long long)seed, i, b->n);
  for (int l = 0; l < SF_LAYERS; l++)
    ck_assert_msg(events.saturated[l] == b->saturated[l][i],
                  "%s, scene %llu, sample %d: layer %d saturated %u, not %llu", name, (unsigned long long)seed, i, l,
                  b->saturated[l][i], (unsigned long long)events.saturated[l]);
}

/* The events of a whole block are the sum of its samples'. */
static void compare_events(const fx_net *net, const fx_block *b)
{
  fx_counts sum = {0}, block = {0};
  for (int i = 0; i < b->n; i++) {
    int32_t base[SF_LANES];
    fx_out out;
    if (fx_net_decodes(net)) fx_net_direction(net, b->constant[i], base, &sum);
    fx_net_sample(net, b->f[i], fx_net_decodes(net) ? base : b->base[i], &out, NULL, &sum);
  }
  fx_count_firing(&block, net, &b->firing);
  memcpy(block.saturated, sum.saturated, sizeof sum.saturated); /* compared sample by sample */
  memcpy(block.saturated_samples, sum.saturated_samples, sizeof sum.saturated_samples);
  assert_same_counts(&block, &sum);
}

/* Inputs over the whole range in half of the scenes. */
static long compare_block(const fx_core *core, fx_block *b, fx_scratch *scratch, int n, const char *name, uint64_t seed,
                          uint64_t block)
{
  const fx_net *net = &core->scene->net;
  int32_t base[FX_BLOCK][SF_LANES];
  b->n = n;
  for (int i = 0; i < n; i++) {
    int16_t dir[FX_SH];
    fixture_inputs(seed, block * FX_BLOCK + (uint64_t)i, b->f[i], net->layer[FX_D1].n_in, seed / 3 % 2 ? 2047 : 700);
    fixture_inputs(seed + 1, block * FX_BLOCK + (uint64_t)i, dir, FX_SH, 2047);
    if (!fx_net_decodes(net)) fx_net_direction(net, dir, base[i], NULL);
    b->base[i] = base[i];
    fixture_inputs(seed + 2, block * FX_BLOCK + (uint64_t)i, b->constant[i], SF_DIR_MAX, seed / 3 % 2 ? 2047 : 700);
    if (seed % 7 == 3) /* all at the rails: currents saturate */
      for (int j = 0; j < SF_DIR_MAX; j++) b->constant[i][j] = 2047;
  }
  core->kernels->nets(core, b, scratch);
  for (int i = 0; i < n; i++) compare_sample(net, b, i, name, seed);
  compare_events(net, b);
  return n;
}

/* Blocks of every length. */
static long compare_nets(const char *name, uint64_t seed, bool decodes)
{
  enum { BLOCKS = 4 };
  fx_scene scene = random_net_scene(seed, decodes);
  fx_core *core = open_core(&scene, name);
  fx_block *b = sf_aligned_alloc(sizeof *b);
  fx_scratch *scratch = sf_aligned_alloc(sizeof *scratch);
  long samples = 0;
  for (uint64_t i = 0; i < BLOCKS; i++)
    samples += compare_block(core, b, scratch, (int)((seed + i * 7) % FX_BLOCK) + 1, name, seed, i);
  free(b), free(scratch);
  fx_core_close(core);
  fx_scene_free(&scene);
  return samples;
}

static long compare_grid(const char *name, uint64_t seed)
{
  fx_scene scene = random_scene(seed);
  fx_core *core = open_core(&scene, name);
  fx_block *b = sf_aligned_alloc(sizeof *b);
  b->n = (int)(seed % FX_BLOCK) + 1;
  for (int i = 0; i < b->n; i++)
    for (int axis = 0; axis < 3; axis++) {
      const int64_t rail = pick(seed, 60 + (uint64_t)(3 * i + axis), 0, 9);
      b->pos[axis][i] = rail == 0   ? 0
                        : rail == 1 ? (1 << 24) - 1
                                    : (uint32_t)pick(seed, 200 + (uint64_t)(3 * i + axis), 0, (1 << 24) - 1);
    }
  const uint64_t saturated = core->kernels->features(&scene.grid, b);
  fx_counts counts = {0};
  for (int i = 0; i < b->n; i++) {
    int16_t f[SF_FEATURE_MAX] = {0};
    fx_grid_features(&scene.grid, (uint32_t[3]){b->pos[0][i], b->pos[1][i], b->pos[2][i]}, f, &counts);
    for (int l = 0; l < 2 * scene.grid.levels; l++)
      ck_assert_msg(f[l] == b->f[i][l], "%s, scene %llu, sample %d: feature %d is %d, not %d", name,
                    (unsigned long long)seed, i, l, b->f[i][l], f[l]);
  }
  ck_assert_uint_eq(saturated, counts.saturated_features);
  const int n = b->n;
  free(b);
  fx_core_close(core);
  fx_scene_free(&scene);
  return n;
}

static fx_ray random_ray(uint64_t seed, uint64_t index)
{
  fx_ray ray = {.count = (int32_t)fixture_pick(seed, 8, index, 0, 300), .first_q16 = 12345};
  for (uint64_t a = 0; a < 3; a++) {
    const int64_t from = fixture_pick(seed, 5, index * 3 + a, 0, ((int64_t)1 << 31) - 1) << 9;
    const int64_t to = fixture_pick(seed, 6, index * 3 + a, 0, ((int64_t)1 << 31) - 1) << 9;
    ray.origin[a] = from, ray.step[a] = (to - from) / 300;
  }
  fixture_inputs(seed, 1000 + index, ray.dir, FX_SH, 1024);
  return ray;
}

/* More rays than a block has slots, so that they are replaced as they end. */
static long compare_rays(const char *name, uint64_t seed)
{
  enum { RAYS = 50 };
  fx_scene scene = random_scene(seed);
  for (int i = 0; i < 64; i++) scene.occupancy[i] &= (uint8_t)pick(seed, 400 + (uint64_t)i, 0, 255);
  fx_core *core = open_core(&scene, name);
  fx_ray ray[RAYS];
  fx_pixel pixel[RAYS];
  fx_cost cost[RAYS];
  fx_counts all = {0}, sum = {0};
  for (uint64_t i = 0; i < RAYS; i++) ray[i] = random_ray(seed, i);
  ck_ok(fx_render_rays(core, ray, RAYS, pixel, cost, &all));
  for (int i = 0; i < RAYS; i++) {
    fx_pixel one;
    fx_counts counts = {0};
    ck_ok(fx_render_ray(&scene, &ray[i], NULL, NULL, &one, &counts));
    fx_counts_add(&sum, &counts);
    ck_assert_msg(!memcmp(&one, &pixel[i], sizeof one), "%s, scene %llu: pixel of ray %d", name,
                  (unsigned long long)seed, i);
    uint64_t macs = 0, sops = 0, spikes = 0;
    for (int l = 0; l < SF_LAYERS; l++)
      for (int t = 0; t < SF_T_MAX; t++)
        macs += counts.layer[l].mac[t], sops += counts.layer[l].sop[t], spikes += counts.layer[l].spikes[t];
    ck_assert_uint_eq(cost[i].macs, macs);
    ck_assert_uint_eq(cost[i].sops, sops);
    ck_assert_uint_eq(cost[i].spikes, spikes);
  }
  assert_same_counts(&all, &sum);
  fx_core_close(core);
  fx_scene_free(&scene);
  return (long)sum.samples;
}

static void campaign(const char *name, long (*compare)(const char *name, uint64_t seed), long wanted)
{
  if (!fx_kernels_select(name)) {
    printf("%s: not on this machine\n", name);
    return;
  }
  for (uint64_t seed = 1; wanted > 0; seed++) wanted -= compare(name, seed);
}

static long compare_density_nets(const char *name, uint64_t seed)
{
  return compare_nets(name, seed, false);
}

static long compare_decoders(const char *name, uint64_t seed)
{
  return compare_nets(name, seed, true);
}

LOOP_TEST(nets_equal_portable, 3)
{
  campaign(instruction_sets[_i], compare_density_nets, samples_wanted());
}

LOOP_TEST(decoders_equal_portable, 3)
{
  campaign(instruction_sets[_i], compare_decoders, samples_wanted());
}

TEST(portable_block_equals_single_samples)
{
  campaign("portable", compare_density_nets, 500);
  campaign("portable", compare_decoders, 500);
}

LOOP_TEST(grid_equals_portable, 3)
{
  campaign(instruction_sets[_i], compare_grid, samples_wanted());
}

LOOP_TEST(rays_equal_portable, 3)
{
  campaign(instruction_sets[_i], compare_rays, samples_wanted());
}

/* ---- the hard cases ---- */

static void hard_net(hard *h, const char *name, int variant)
{
  fx_block *b = sf_aligned_alloc(sizeof *b);
  fx_scratch *scratch = sf_aligned_alloc(sizeof *scratch);
  int32_t base[SF_LANES];
  b->n = 1;
  b->base[0] = base;
  memcpy(b->f[0], h->f, (size_t)h->scene.net.layer[FX_D1].n_in * sizeof *h->f);
  fx_net_direction(&h->scene.net, h->ray.dir, base, NULL);
  for (int32_t mode = FX_HYBRID; mode <= FX_RADIX; mode++) {
    hard_mode(h, mode);
    fx_core *core = open_core(&h->scene, name);
    core->kernels->nets(core, b, scratch);
    compare_sample(&h->scene.net, b, 0, name, (uint64_t)variant);
    fx_core_close(core);
  }
  free(b), free(scratch);
}

static void hard_ray(hard *h, const char *name)
{
  fx_core *core = open_core(&h->scene, name);
  fx_pixel one, wave;
  fx_counts a = {0}, b = {0};
  ck_ok(fx_render_ray(&h->scene, &h->ray, NULL, NULL, &one, &a));
  ck_ok(fx_render_rays(core, &h->ray, 1, &wave, NULL, &b));
  ck_assert_mem_eq(&one, &wave, sizeof one);
  assert_same_counts(&a, &b);
  fx_core_close(core);
}

HARD_TEST(hard_cases_equal_portable)
{
  const hard_case *c = &hard_cases[_i];
  for (int variant = 0; variant < c->variants; variant++)
    for (int set = 0; set < 3; set++) {
      hard h;
      if (!fx_kernels_select(instruction_sets[set])) continue;
      hard_begin(&h, c, variant);
      if (c->kind == HARD_NET) hard_net(&h, instruction_sets[set], variant);
      if (c->kind == HARD_RAY) hard_ray(&h, instruction_sets[set]);
      hard_end(&h);
    }
}

TEST(portable_waves_equal_single_rays)
{
  campaign("portable", compare_rays, samples_wanted() / 2);
}

TEST(unknown_kernels_are_refused)
{
  OWNED(fx_scene) scene = fixture_scene(&fixture_ingp, 1);
  fx_core *core;
  ck_bad(fx_core_open(&core, &scene, "mmx"), SF_E_UNSUPPORTED, "mmx", "");
  ck_assert_ptr_null(core);
}

/* Made in memory, by nobody's reader: the kernels' tables have room for the sizes of arch.def alone. */
TEST(absurd_scenes_are_refused)
{
  fx_scene scene = fixture_scene(&fixture_ingp, 1), bad = scene;
  fx_core *core;
  bad.net.layer[FX_D1].n_in = 1 << 20;
  ck_bad(fx_core_open(&core, &bad, NULL), SF_E_RANGE, "scene: D1.n_in is 1048576", "");
  ck_assert_ptr_null(core);
  bad = scene, bad.net.steps = SF_T_MAX + 1;
  ck_assert_int_eq(fx_core_open(&core, &bad, NULL).code, SF_E_RANGE);
  bad = scene, bad.net.layer[FX_C2].w = NULL;
  ck_assert_int_eq(fx_core_open(&core, &bad, NULL).code, SF_E_FORMAT);
  fx_scene_free(&scene);
}

int ck_timeout = 24 * 3600; /* make vector-campaign */
