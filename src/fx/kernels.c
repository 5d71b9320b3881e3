/* Choice of the instruction set at run time, and the portable kernels: the oracle, sample by sample. */
#include "src/fx/kernels.h"
#include "src/fx/net.h"
#include "base/amx.h"
#include "base/cpu.h"
#include <string.h>
#include "src/fx/nofloat.h"

#if defined(__x86_64__)
extern const fx_kernels fx_kernels_avx2, fx_kernels_avx512vnni, fx_kernels_amx;
#endif

static void nets(const fx_core *core, fx_block *b, fx_scratch *scratch)
{
  const bool decodes = fx_net_constants_per_sample(&core->scene->net);
  (void)scratch;
  for (int i = 0; i < b->n; i++) {
    fx_events events;
    int32_t constant[SF_LANES];
    if (decodes) fx_net_direction(&core->scene->net, b->constant[i], constant, NULL);
    fx_net_events(&core->scene->net, b->f[i], decodes ? constant : b->base[i], &b->out[i], &events, NULL);
    for (int s = 0; s < FX_SPIKING; s++)
      for (int t = 0; t < core->scene->net.steps; t++)
        memcpy(b->spikes[s][t][i], events.spikes[fx_spiking_layers[s]][t], sizeof b->spikes[s][t][i]);
    for (int l = 0; l < SF_LAYERS; l++) b->saturated[l][i] = (uint32_t)events.saturated[l];
  }
  fx_block_count(b, core->scene->net.steps);
}

static uint64_t features(const fx_grid *grid, fx_block *b)
{
  fx_counts counts = {0};
  for (int i = 0; i < b->n; i++) {
    const uint32_t pos[3] = {b->pos[0][i], b->pos[1][i], b->pos[2][i]};
    fx_grid_features(grid, pos, b->f[i], &counts);
  }
  return counts.saturated_features;
}

static int32_t march(const fx_scene *scene, const fx_ray *ray, int32_t n)
{
  uint32_t pos[3];
  const int32_t found = fx_march_next(scene, ray, n, pos, NULL);
  return found < 0 ? ray->count : found;
}

static int lines(const fx_places *places, const uint32_t pos[3], uint32_t list[FX_LOOKUPS_ROOM])
{
  return fx_grid_lines(places->grid, pos, list);
}

static const fx_kernels portable = {"portable", 16, nets, features, march, &fx_vm_portable, lines, fx_cache_look_up};

const fx_kernels *fx_kernels_select(const char *name)
{
  const fx_kernels *candidate[4];
  int n = 0;
#if defined(__x86_64__)
  __builtin_cpu_init();
  if (sf_cpu_may(SF_CPU_AVX512) && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512vnni") &&
      __builtin_cpu_supports("avx512vbmi2") && __builtin_cpu_supports("avx512vpopcntdq")) {
    if (sf_cpu_may(SF_CPU_AMX) && sf_have_amx()) candidate[n++] = &fx_kernels_amx;
    candidate[n++] = &fx_kernels_avx512vnni;
  }
  if (sf_cpu_may(SF_CPU_AVX2) && __builtin_cpu_supports("avx2")) candidate[n++] = &fx_kernels_avx2;
#endif
  candidate[n++] = &portable;
  if (!name) return candidate[0];
  for (int i = 0; i < n; i++)
    if (!strcmp(candidate[i]->name, name)) return candidate[i];
  return NULL;
}
