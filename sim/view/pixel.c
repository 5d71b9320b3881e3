/* A pixel of the picture: its story, and its samples for sf_cosim. */
#include "sim/view/internal.h"
#include "quant/quant.h"
#include "base/clock.h"
#include <stdlib.h>
#include <string.h>

static sf_status tell(sf_viewer *v, const sf_view_ask *ask, sf_sight *sight, sf_story *story)
{
  fx_ray ray;
  *story = (sf_story){.layer = ask->layer >= 0 ? ask->layer : FX_C2, .neuron = ask->neuron >= 0 ? ask->neuron : 0};
  SF_TRY(sf_sight_of(v, ask, sight));
  const fx_scene *scene = &v->at[sight->steps - 1];
  if (ask->x < 0 || ask->y < 0 || ask->x >= sight->view.camera.width || ask->y >= sight->view.camera.height)
    return sf_fail(SF_E_USAGE, "x, y: outside the picture of %d x %d pixels", sight->view.camera.width,
                   sight->view.camera.height);
  if (story->neuron >= scene->net.layer[story->layer].n_out) story->neuron = 0;
  SF_TRY(sf_pixel_ray(scene, &sight->data, &sight->view, ask->x, ask->y, &ray));
  return sf_story_tell(story, scene, &ray);
}

static void add_pixel(cJSON *json, const sf_story *s)
{
  uint32_t rgba[4];
  fx_pixel_rgba(&s->pixel, rgba);
  cJSON *values = cJSON_AddArrayToObject(json, "rgba");
  for (int c = 0; c < 4; c++) cJSON_AddItemToArray(values, cJSON_CreateNumber(rgba[c]));
  cJSON_AddNumberToObject(json, "samples", s->pixel.samples);
  cJSON_AddNumberToObject(json, "transmittance", s->pixel.transmittance / 1048576.0);
  sf_json_add_u64(json, "spikes", sf_event_total(&s->counts, SF_EVENT_SPIKES));
  sf_json_add_u64(json, "sops", sf_event_total(&s->counts, SF_EVENT_SOP));
  sf_json_add_u64(json, "macs", sf_event_total(&s->counts, SF_EVENT_MAC));
  sf_json_add_u64(json, "energy_fj", sf_energy_fj(&s->counts));
}

/* The sample that is asked about, else the one that the pixel shows most. */
static int chosen(const sf_story *s, int wanted)
{
  int most = 0;
  if (wanted >= 0 && wanted < s->count) return wanted;
  for (int i = 1; i < s->count; i++)
    if (s->sample[i].weight > s->sample[most].weight) most = i;
  return most;
}

static void add_sample(cJSON *json, const sf_story *s, int i)
{
  if (i >= s->count) return;
  const sf_story_sample *p = &s->sample[i];
  cJSON *one = cJSON_AddObjectToObject(json, "sample");
  cJSON_AddNumberToObject(one, "index", i);
  cJSON_AddBoolToObject(one, "decoded", p->decoded);
  cJSON_AddNumberToObject(one, "density", sf_fx_sigma_value(s->scene, p->sigma));
  cJSON_AddNumberToObject(one, "weight", p->weight / 1048576.0);
  cJSON_AddNumberToObject(one, "transmittance", p->left / 1048576.0);
  cJSON *colour = cJSON_AddArrayToObject(one, "colour"), *steps = cJSON_AddArrayToObject(one, "steps");
  for (int c = 0; c < 3; c++) cJSON_AddItemToArray(colour, cJSON_CreateNumber(sf_fx_colour_value(p->colour[c])));
  for (int t = 0; t < s->scene->net.steps; t++) {
    cJSON *step = cJSON_CreateObject();
    cJSON_AddNumberToObject(step, "current", p->current[t]);
    cJSON_AddNumberToObject(step, "membrane", p->membrane[t]);
    cJSON_AddBoolToObject(step, "fires", p->spikes[s->layer][t][s->neuron / 64] >> s->neuron % 64 & 1);
    cJSON_AddItemToArray(steps, step);
  }
}

static sf_status story_json(const sf_story *s, const sf_sight *sight, const sf_view_ask *ask, cJSON *json)
{
  const int sample = chosen(s, ask->sample);
  cJSON_AddNumberToObject(json, "x", ask->x), cJSON_AddNumberToObject(json, "y", ask->y);
  cJSON_AddNumberToObject(json, "steps", sight->steps);
  add_pixel(json, s);
  cJSON_AddStringToObject(json, "layer", fx_layer_name(s->layer));
  cJSON_AddNumberToObject(json, "neuron", s->neuron);
  cJSON *decoded = cJSON_AddArrayToObject(json, "decoded");
  for (int i = 0; i < s->count; i++)
    if (s->sample[i].decoded) cJSON_AddItemToArray(decoded, cJSON_CreateNumber(i));
  add_sample(json, s, sample);
  return sf_story_draw(s, sample, cJSON_AddObjectToObject(json, "drawings"));
}

SF_VIEWER_ANSWER(story)
{
  sf_sight sight;
  sf_story story;
  const double start = sf_seconds();
  cJSON *json = cJSON_CreateObject();
  sf_status status = tell(user, ask, &sight, &story);
  if (status.code == SF_OK) status = story_json(&story, &sight, ask, json);
  sf_story_free(&story);
  cJSON_AddNumberToObject(json, "milliseconds", 1000 * (sf_seconds() - start));
  if (status.code == SF_OK) return sf_view_reply_json(reply, json);
  cJSON_Delete(json);
  return status;
}

/* The last samples where there are more than a file takes: the first one of these brings the direction along. */
static sf_status fill_replay(const sf_story *story, const sf_view_ask *ask, int width, sf_replay *replay)
{
  int decoded = 0, skip;
  for (int i = 0; i < story->count; i++) decoded += story->sample[i].decoded;
  if (decoded == 0) return sf_fail(SF_E_RANGE, "pixel %d, %d has no samples", ask->x, ask->y);
  skip = decoded > SF_REPLAY_MAX ? decoded - SF_REPLAY_MAX : 0;
  replay->seed = 1;
  for (int i = 0, n = 0; i < story->count; i++) {
    const sf_story_sample *from = &story->sample[i];
    if (!from->decoded || n++ < skip) continue;
    sf_replay_sample *to = &replay->sample[replay->count];
    *to = (sf_replay_sample){.ray = (uint64_t)ask->y * (uint64_t)width + (uint64_t)ask->x,
                             .sample = (uint64_t)(n - 1),
                             .first = replay->count == 0};
    memcpy(to->dir, story->ray.dir, sizeof to->dir);
    memcpy(to->f, from->f, sizeof to->f);
    replay->count++;
  }
  return sf_ok();
}

SF_VIEWER_ANSWER(replay)
{
  sf_viewer *v = user;
  sf_sight sight;
  sf_story story;
  cJSON *json = NULL;
  sf_replay *replay = calloc(1, sizeof *replay);
  if (!replay) return sf_fail(SF_E_MEMORY, "no memory for a replay");
  sf_status status = tell(v, ask, &sight, &story);
  /* sf_cosim runs the steps that the scene's file says. */
  if (status.code == SF_OK && sight.steps != v->file_steps)
    status = sf_fail(SF_E_RANGE, "a replay runs the %d steps of the scene's file: move t_r there", v->file_steps);
  if (status.code == SF_OK) status = fill_replay(&story, ask, sight.view.camera.width, replay);
  sf_story_free(&story);
  if (status.code == SF_OK) status = sf_replay_json(replay, v->options.scene, NULL, &json);
  free(replay);
  if (status.code != SF_OK) return status;
  reply->file = "sf_cosim-replay.json";
  return sf_view_reply_json(reply, json);
}
