/* The portable core under observation: every sample is counted again from its spike bitmaps, every read of the field
 * from its position. */
#include "energy/energy.h"
#include <string.h>

void sf_observer_begin(sf_observer *observer)
{
  const sf_observer kept = *observer;
  *observer = (sf_observer){.net = kept.net, .trace = kept.trace, .memory = kept.memory, .lines = kept.lines};
}

static void observe_read(void *user, fx_read what, const uint32_t pos[3])
{
  const sf_observer *observer = user;
  fx_memory_read(observer->memory, what, pos);
  sf_memory_recount_read(observer->lines, what, pos);
}

sf_status sf_observer_ray(sf_observer *observer, const fx_scene *scene, const fx_ray *ray, uint64_t tile,
                          fx_net_fn eval, void *user, fx_pixel *pixel)
{
  const fx_watch watch = {observe_read, observer};
  sf_observer_begin(observer);
  if (!observer->memory) return fx_render_ray(scene, ray, eval, user, pixel, &observer->core);
  fx_memory_ray(observer->memory, tile);
  sf_memory_recount_ray(observer->lines, tile);
  return fx_render_watched(scene, ray, eval, user, &watch, pixel, &observer->core);
}

static fx_fired fired_at_all(const fx_trace *trace, int steps)
{
  fx_fired fired = {0};
  for (int s = 0; s < FX_SPIKING; s++)
    for (int t = 0; t < steps; t++)
      for (int w = 0; w < SF_SPIKE_WORDS; w++) fired.neurons[s][w] |= trace->spikes[fx_spiking_layers[s]][t][w];
  return fired;
}

static sf_status recount_memory(sf_observer *observer)
{
  const fx_fired fired = fired_at_all(observer->trace, observer->net->steps);
  fx_memory_sample(observer->memory, observer->memory->run, &fired);
  sf_memory_recount_sample(observer->lines, (const uint64_t(*)[SF_T_MAX][SF_SPIKE_WORDS])observer->trace->spikes);
  return sf_memory_compare(&observer->memory->counts, "core", &observer->lines->counts, "recount");
}

static sf_status recount_and_compare(sf_observer *observer, bool first)
{
  sf_status difference = sf_ok();
  sf_recount_sample(observer->net, (const uint64_t(*)[SF_T_MAX][SF_SPIKE_WORDS])observer->trace->spikes, first,
                    &observer->recount);
  if (memcmp(observer->core.layer, observer->recount.layer, sizeof observer->core.layer))
    difference = sf_counts_compare(&observer->core, "core", &observer->recount, "recount");
  else if (observer->memory)
    difference = recount_memory(observer);
  if (difference.code == SF_OK) return difference;
  return sf_fail(difference.code, "sample %llu: %s", (unsigned long long)observer->sample, difference.message);
}

sf_status sf_observer_net(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  sf_observer *observer = user;
  fx_net_next(observer->net, ray->dir, first, f, observer->base, out, observer->trace, &observer->core);
  if (observer->trace) SF_TRY(recount_and_compare(observer, first));
  observer->sample++;
  return sf_ok();
}
