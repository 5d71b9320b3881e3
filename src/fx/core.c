#include "src/fx/core.h"
#include "base/memory.h"
#include <stdlib.h>
#include <string.h>
#include "src/fx/nofloat.h"

static void pair_rows(int16_t (*to)[SF_LANES][2], int first, const int8_t *w, int rows)
{
  for (int i = 0; i < rows; i++)
    for (int o = 0; o < SF_LANES; o++) to[(first + i) / 2][o][(first + i) % 2] = w[(size_t)i * SF_LANES + o];
}

/* Where output o of a row of c2 is kept. */
static int unpacked(int o, int bytes)
{
  const int block = o / bytes * bytes, half = o % bytes / (bytes / 2), at = o % (bytes / 2);
  return block + at / 8 * 16 + half * 8 + at % 8;
}

static void arrange_biases(fx_words *words, const fx_net *net, int bytes)
{
  const fx_layer *c1 = &net->layer[FX_C1], *c2 = &net->layer[FX_C2], *c3 = &net->layer[FX_C3];
  for (int o = 0; o < SF_LANES; o++) {
    if (c1->bias) words->c1_bias[o] = c1->bias * c1->w[(size_t)c1->n_in * SF_LANES + (size_t)o];
    if (c2->bias)
      words->c2[FX_BIAS_ROW][unpacked(o, bytes)] = c2->w[(size_t)c2->n_in * SF_LANES + (size_t)o],
                                         words->c2_bias[o] = words->c2[FX_BIAS_ROW][unpacked(o, bytes)];
    if (c3->bias && o < SF_OUT_MAX) words->c3_bias[o] = c3->w[(size_t)c3->n_in * SF_LANES + (size_t)o];
  }
}

/* The upper half of its binary32: exact up to 8 bits. */
static uint16_t bfloat16(int x)
{
  if (x == 0) return 0;
  const uint32_t magnitude = (uint32_t)(x < 0 ? -x : x);
  const int exponent = 31 - __builtin_clz(magnitude);
  return (uint16_t)((uint32_t)(x < 0) << 15 | (uint32_t)(exponent + 127) << 7 | (magnitude << (7 - exponent) & 0x7f));
}

static void arrange_tiles(fx_words *words, const fx_net *net)
{
  const fx_layer *d1 = &net->layer[FX_D1], *c1 = &net->layer[FX_C1], *c2 = &net->layer[FX_C2];
  const int8_t *h = c1->w + (size_t)fx_net_constants(net) * SF_LANES;
  for (int o = 0; o < SF_LANES; o++) {
    const int group = o / 16, at = o % 16;
    for (int i = 0; i < d1->n_in; i++)
      for (int part = 0; part < 2; part++) words->d1_twice[group][i][at][part] = bfloat16(d1->w[i * SF_LANES + o]);
    for (int i = 0; i < fx_net_h(net); i++)
      for (int part = 0; part < 2; part++) words->c1_h_twice[group][i + 1][at][part] = bfloat16(h[i * SF_LANES + o]);
    for (int i = 0; i < c2->n_in; i++) words->c2_tiles[group][i / 4][at][i % 4] = c2->w[i * SF_LANES + o];
  }
}

static void arrange(fx_words *words, const fx_net *net, int bytes)
{
  const fx_layer *layer = net->layer;
  const int n_constant = fx_net_constants(net);
  pair_rows(words->d1, 0, layer[FX_D1].w, layer[FX_D1].n_in);
  if (fx_net_constants_per_sample(net)) pair_rows(words->c1_constant, 0, layer[FX_C1].w, n_constant);
  pair_rows(words->c1_h, 1, layer[FX_C1].w + (size_t)n_constant * SF_LANES, fx_net_h(net));
  arrange_tiles(words, net);
  arrange_biases(words, net, bytes);
  for (int i = 0; i < SF_LANES; i++)
    for (int o = 0; o < SF_LANES; o++) {
      const size_t at = (size_t)i * SF_LANES + (size_t)o;
      if (i < layer[FX_C2].n_in)
        words->c2[i][unpacked(o, bytes)] = words->c2_quads[i / 4][o][i % 4] = layer[FX_C2].w[at];
      if (o >= SF_OUT_MAX) continue;
      if (i < layer[FX_D2].n_in) words->d2[i][o] = words->d2_quads[i / 4][o][i % 4] = layer[FX_D2].w[at];
      if (i < layer[FX_C3].n_in) words->c3_inputs[o][i] = words->c3_quads[i / 4][o][i % 4] = layer[FX_C3].w[at];
    }
}

sf_status fx_core_open(fx_core **core, const fx_scene *scene, const char *kernels)
{
  const fx_kernels *chosen = fx_kernels_select(kernels);
  *core = NULL;
  if (!chosen)
    return sf_fail(SF_E_UNSUPPORTED, "kernels '%.40s': not on this machine; expected portable, avx2, avx512vnni or amx",
                   kernels);
  SF_TRY(fx_scene_check(scene, "scene"));
  fx_core *c = sf_aligned_alloc(sizeof *c);
  if (!c) return sf_fail(SF_E_MEMORY, "no memory for the core's tables");
  c->scene = scene;
  c->kernels = chosen;
  arrange(&c->words, &scene->net, chosen->unpack_bytes);
  *core = c;
  return sf_ok();
}

void fx_core_close(fx_core *core)
{
  free(core);
}

const char *fx_core_kernels(const fx_core *core)
{
  return core->kernels->name;
}

int32_t fx_core_march(const fx_core *core, const fx_ray *ray, int32_t n, uint32_t pos[3], fx_counts *counts)
{
  const int32_t found = core->kernels->march(core->scene, ray, n);
  if (counts && n < ray->count) counts->march_steps += (uint64_t)(found - n + (found < ray->count));
  if (found >= ray->count) return -1;
  for (int axis = 0; axis < 3; axis++)
    pos[axis] = (uint32_t)(fx_ray_at(core->scene, ray, found, axis) >> (FX_RAY_FRAC - SF_POS_FRAC));
  return found;
}

void fx_block_account(const fx_core *core, const fx_block *b, int i, fx_counts *counts, fx_cost *cost)
{
  const fx_layer *layer = core->scene->net.layer;
  for (int l = 0; l < SF_LAYERS; l++) {
    counts->saturated[l] += b->saturated[l][i];
    counts->saturated_samples[l] += b->saturated[l][i] != 0;
  }
  if (!cost) return;
  const uint64_t d1 = b->fired[0][i], c1 = b->fired[1][i], c2 = b->fired[2][i];
  cost->macs += fx_macs_of_sample(&core->scene->net);
  cost->spikes += d1 + c1 + c2;
  cost->sops +=
      d1 * (uint64_t)layer[FX_D2].n_out + c1 * (uint64_t)layer[FX_C2].n_out + c2 * (uint64_t)layer[FX_C3].n_out;
}
