/* A scene of random weights whose thresholds give a firing rate. */
#include "bench_rig.h"
#include "base/memory.h"
#include "base/rng.h"
#include <math.h>
#include <stdlib.h>

static int32_t pick(uint64_t stream, uint64_t index, int32_t limit)
{
  return (int32_t)sf_random_below(1, stream, index, 2 * (uint64_t)limit + 1) - limit;
}

static void set_sizes(fx_scene *s)
{
  static const int in[SF_LAYERS] = {32, 128, 31, 128, 128}, out[SF_LAYERS] = {128, 16, 128, 128, 3};
  const double growth = exp(log(2048.0 / 16) / 15);
  for (int l = 0; l < SF_LAYERS; l++) s->net.layer[l].n_in = in[l], s->net.layer[l].n_out = out[l];
  s->grid.levels = 16;
  for (int l = 0; l < 16; l++) {
    const double scale = 16 * pow(growth, l) - 1;
    const int64_t points = (int64_t)ceil(scale) + 2, dense = points * points * points;
    const bool hashed = dense > 1 << 19;
    s->grid.scale_q16[l] = (int32_t)(scale * 65536);
    s->grid.stride[l] = hashed ? 0 : (int32_t)points;
    s->grid.log2_size[l] = hashed ? 19 : 0;
    s->grid.offset[l] = s->grid.entries;
    s->grid.entries += hashed ? 1 << 19 : (dense + 7) / 8 * 8;
    s->grid.shift[l] = 13;
  }
  s->occ_res = 8;
}

static void fill(fx_scene *s)
{
  for (int l = 0; l < SF_LAYERS; l++) {
    fx_layer *layer = &s->net.layer[l];
    layer->k = 2000;
    layer->theta = l == FX_D2 || l == FX_C3 || !layer->n_out ? 0 : 60000;
    for (int i = 0; i < fx_layer_rows(layer); i++)
      for (int o = 0; o < layer->n_out; o++)
        layer->w[i * SF_LANES + o] = (int8_t)pick(10 + (uint64_t)l, (uint64_t)(i * SF_LANES + o), 127);
  }
  for (int64_t i = 0; i < 2 * s->grid.entries; i++) s->grid.table[i] = (int8_t)pick(20, (uint64_t)i, 127);
  s->net.steps = RIG_STEPS;
  s->net.exp_in = (fx_scale){50000, 15, 4096}, s->net.sigmoid_in = (fx_scale){50000, 13, 0};
  s->step_q24 = 30000, s->max_samples = 1024; /* from here on what no figure depends on */
  s->units.to_box_scale = 0.5, s->units.dir_scale = 0x1p-10;
  for (int l = 0; l < FX_LEVELS_MAX; l++) s->units.feature_scale[l] = 0x1p-10;
  for (int l = 0; l < SF_LAYERS; l++) s->units.current_scale[l] = 0x1p-12;
}

static double rate_of(const fx_block *b, int layer, int steps)
{
  long spikes = 0;
  for (int t = 0; t < steps; t++)
    for (int i = 0; i < b->n; i++)
      spikes += __builtin_popcountll(b->spikes[layer][t][i][0]) + __builtin_popcountll(b->spikes[layer][t][i][1]);
  return (double)spikes / (steps * b->n * SF_LANES);
}

static void choose_thresholds(rig *r, double rate)
{
  static const int spiking[] = {FX_D1, FX_C1, FX_C2};
  for (int l = fx_net_decodes(&r->scene.net); l < FX_SPIKING; l++) {
    int32_t low = 1, high = (1 << 23) - 1, *theta = &r->scene.net.layer[spiking[l]].theta;
    while (high - low > 1) {
      *theta = low + (high - low) / 2;
      r->core->kernels->nets(r->core, r->block, r->scratch);
      if (rate_of(r->block, l, r->scene.net.steps) > rate)
        low = *theta;
      else
        high = *theta;
    }
  }
}

void rig_random_positions(fx_block *b, uint64_t stream)
{
  for (int axis = 0; axis < 3; axis++)
    for (int i = 0; i < b->n; i++)
      b->pos[axis][i] = (uint32_t)sf_random_below(2 + stream, (uint64_t)axis, (uint64_t)i, 1 << 24);
}

sf_status rig_open(rig *r, const char *kernels, double rate)
{
  *r = (rig){.block = sf_aligned_alloc(sizeof *r->block), .scratch = sf_aligned_alloc(sizeof *r->scratch)};
  set_sizes(&r->scene);
  SF_TRY(fx_scene_allocate(&r->scene, "bench"));
  fill(&r->scene);
  SF_TRY(fx_core_open(&r->core, &r->scene, kernels));
  r->block->n = FX_BLOCK;
  rig_random_positions(r->block, 0);
  r->core->kernels->features(&r->scene.grid, r->block);
  for (int i = 0; i < FX_BLOCK; i++) {
    int16_t *dir = r->ray[i / RIG_RAY].dir;
    for (int d = 0; d < FX_SH; d++) dir[d] = (int16_t)pick(30, (uint64_t)(i / RIG_RAY * FX_SH + d), 1024);
    fx_net_direction(&r->scene.net, dir, r->base[i], NULL);
    r->block->base[i] = r->base[i];
  }
  choose_thresholds(r, rate);
  return sf_ok();
}

sf_status rig_open_decoder(rig *r, int inputs, int steps, double rate)
{
  *r = (rig){.block = sf_aligned_alloc(sizeof *r->block), .scratch = sf_aligned_alloc(sizeof *r->scratch)};
  const int in[SF_LAYERS] = {0, 0, inputs, 128, 128}, out[SF_LAYERS] = {0, 0, 128, 128, 3};
  for (int l = 0; l < SF_LAYERS; l++)
    r->scene.net.layer[l] = (fx_layer){.n_in = in[l], .n_out = out[l], .bias = l >= FX_C1};
  r->scene.occ_res = 8;
  SF_TRY(fx_scene_allocate(&r->scene, "bench"));
  fill(&r->scene);
  r->scene.net.steps = steps;
  SF_TRY(fx_core_open(&r->core, &r->scene, NULL));
  r->block->n = FX_BLOCK;
  for (int i = 0; i < FX_BLOCK; i++)
    for (int j = 0; j < inputs; j++) r->block->constant[i][j] = (int16_t)pick(40, (uint64_t)(i * SF_DIR_MAX + j), 1024);
  choose_thresholds(r, rate);
  return sf_ok();
}

void rig_close(rig *r)
{
  fx_core_close(r->core);
  fx_scene_free(&r->scene);
  free(r->block), free(r->scratch);
}
