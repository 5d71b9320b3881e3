/* The story of a ray: the portable core walks it once more, and every sample is kept. */
#include "sim/view/internal.h"
#include <stdlib.h>
#include <string.h>

/* NULL: no memory. */
static sf_story_sample *new_sample(sf_story *s)
{
  if (s->count == s->room) {
    const int room = s->room ? 2 * s->room : 64;
    sf_story_sample *grown = realloc(s->sample, (size_t)room * sizeof *grown);
    if (!grown) return NULL;
    s->sample = grown, s->room = room;
  }
  memset(&s->sample[s->count], 0, sizeof *s->sample);
  return &s->sample[s->count++];
}

static void composite(sf_story *s, sf_story_sample *sample)
{
  const int32_t at = sample->at;
  sample->weight =
      fx_composite_weight(&s->light, sample->sigma, fx_delta(s->scene, at), fx_distance(s->scene, &s->ray, at));
  sample->left = s->light.transmittance;
  s->behind = s->light.transmittance <= (uint32_t)s->scene->trans_stop;
}

/* The field is read at the next occupied point of the ray. */
static void read(void *user, fx_read what, const uint32_t pos[3])
{
  sf_story *s = user;
  uint32_t own[3];
  if (what == FX_READ_APPEARANCE) {
    while (s->next < s->count && memcmp(s->sample[s->next].pos, pos, sizeof own) != 0) s->next++;
    return;
  }
  if (s->behind) return;
  s->at = fx_march_next(s->scene, &s->ray, s->at + 1, own, NULL);
  sf_story_sample *sample = new_sample(s);
  if (!sample) return;
  sample->at = s->at;
  memcpy(sample->pos, pos, sizeof own);
  if (what == FX_READ_GRID) s->next = s->count - 1;
  if (what != FX_READ_DENSITY) return;
  sample->sigma = fx_tensorf_density(&s->scene->tensorf, pos, NULL);
  composite(s, sample);
}

static sf_status decode(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  sf_story *s = user;
  const fx_net *net = &s->scene->net;
  fx_counts counts = {0};
  if (s->next >= s->count) return sf_fail(SF_E_MEMORY, "no memory for the samples of a ray");
  sf_story_sample *sample = &s->sample[s->next];
  fx_net_next(net, ray->dir, first, f, s->base, out, &s->trace, &counts);
  sample->decoded = true;
  memcpy(sample->f, f, (size_t)fx_net_inputs(net) * sizeof *f);
  memcpy(sample->colour, out->colour, sizeof out->colour);
  memcpy(sample->spikes, s->trace.spikes, sizeof sample->spikes);
  for (int t = 0; t < net->steps; t++) {
    sample->membrane[t] = s->trace.membrane[s->layer][t][s->neuron];
    sample->current[t] = s->trace.current[s->layer][t][s->neuron];
  }
  sample->cost = sf_cost_of(&counts);
  fx_counts_add(&s->counts, &counts);
  if (s->scene->backbone == FX_TENSORF) return s->next++, sf_ok();
  sample->sigma = out->sigma;
  composite(s, sample);
  return sf_ok();
}

sf_status sf_story_tell(sf_story *s, const fx_scene *scene, const fx_ray *ray)
{
  const fx_watch watch = {read, s};
  s->scene = scene, s->ray = *ray, s->at = -1;
  fx_composite_begin(&s->light);
  return fx_render_watched(scene, &s->ray, decode, s, &watch, &s->pixel, NULL);
}

void sf_story_free(sf_story *s)
{
  free(s->sample);
  s->sample = NULL, s->count = s->room = 0;
}
