/* Samples for the cycle model, from rays through the portable core. */
#include "cycles/cycles.h"
#include <stdlib.h>

typedef struct tap {
  const fx_net *net;
  sf_cycle_record *to;
  int32_t base[SF_LANES];
  fx_trace trace;
} tap;

sf_status sf_cycle_record_add(sf_cycle_record *to, const fx_net *net, const fx_trace *trace, bool first)
{
  if (to->count == to->room) {
    const size_t room = to->room ? 2 * to->room : 1024;
    sf_cycle_sample *larger = realloc(to->at, room * sizeof *larger);
    if (!larger) return sf_fail(SF_E_MEMORY, "no memory for %zu samples", room);
    to->at = larger, to->room = room;
  }
  to->at[to->count++] = sf_cycle_sample_make(net, trace, first);
  return sf_ok();
}

static sf_status take(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  tap *t = user;
  fx_net_next(t->net, ray->dir, first, f, t->base, out, &t->trace, NULL);
  return sf_cycle_record_add(t->to, t->net, &t->trace, first);
}

sf_status sf_cycle_record_ray(sf_cycle_record *record, const fx_scene *scene, const fx_ray *ray)
{
  fx_pixel pixel;
  tap *t = malloc(sizeof *t);
  if (!t) return sf_fail(SF_E_MEMORY, "no memory for a ray");
  t->net = &scene->net, t->to = record;
  const sf_status status = fx_render_ray(scene, ray, take, t, &pixel, NULL);
  free(t);
  return status;
}

void sf_cycle_record_free(sf_cycle_record *record)
{
  free(record->at);
  *record = (sf_cycle_record){.at = NULL};
}
