/* The twin's own samples, from its float rendering. */
#include "energy/energy.h"
#include "snn/model.h"
#include "base/saturate.h"
#include <stdlib.h>

enum { CHUNK = 4096 };

typedef struct chunk {
  float origin[CHUNK][3], direction[CHUNK][3], rgb[CHUNK][3], samples[CHUNK];
} chunk;

static sf_status count_samples(const sf_twin_job *job, const sf_model *model, chunk *c, uint64_t *samples)
{
  static const float background[3] = {1, 1, 1};
  for (uint64_t first = 0; first < job->rays; first += CHUNK) {
    const uint64_t n = job->rays - first < CHUNK ? job->rays - first : CHUNK;
    for (uint64_t i = 0; i < n; i++) job->ray(job->user, first + i, c->origin[i], c->direction[i]);
    SF_TRY(sf_render_rays(model, c->origin[0], c->direction[0], n, 1, background, c->rgb[0], NULL, NULL, c->samples));
    for (uint64_t i = 0; i < n; i++) *samples += (uint64_t)c->samples[i];
    if (job->tick && !job->tick(job->user, first + n))
      return sf_fail(SF_E_STOPPED, "stopped after %llu of %llu rays of the twin", (unsigned long long)(first + n),
                     (unsigned long long)job->rays);
  }
  return sf_ok();
}

static uint64_t synapses(const sf_model *model)
{
  uint64_t sum = 0;
  for (int l = 0; l < SF_LAYERS; l++) sum += model->param[sf_layer_weights[l]].size;
  return sum;
}

sf_status sf_twin_count(const sf_twin_job *job, sf_twin *twin)
{
  sf_model model;
  *twin = (sf_twin){.path = job->path};
  SF_TRY(sf_model_load(&model, job->path));
  chunk *c = malloc(sizeof *c);
  sf_status status = sf_ok();
  if (model.config.net != SF_NET_ANN)
    status = sf_fail(SF_E_UNSUPPORTED, "%s: a spiking net, expected a ReLU twin (sf_train --net ann)", job->path);
  else if (!c)
    status = sf_fail(SF_E_MEMORY, "audit: out of memory");
  else
    status = count_samples(job, &model, c, &twin->samples);
  if (!status.code) twin->macs = synapses(&model);
  free(c);
  sf_model_free(&model);
  return status;
}

sf_status sf_twin_price(const sf_technology *technology, uint64_t spiking_fj, sf_twin *twin)
{
  twin->fj = sf_multiply_u64(sf_multiply_u64(twin->macs, twin->samples), technology->price[SF_PRICE_FP32_MAC].fj);
  if (twin->fj == UINT64_MAX)
    return sf_fail(SF_E_RANGE, "audit: the energy of the twin does not fit in 64 bits of fJ; audit fewer views");
  twin->saving_percent = sf_saving_percent(spiking_fj, twin->fj);
  return sf_ok();
}
