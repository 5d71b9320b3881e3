/* The story of a difference: the samples that sf_cosim kept, what core and accelerator had, and where to look in the
 * waveform. */
#include "sim/activity/wave.h"
#include "sim/lockstep.h"
#include "sim/view/internal.h"
#include "page/draw.h"
#include "base/clock.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

sf_status sf_viewer_load_difference(sf_viewer *v)
{
  cJSON *json;
  v->replay = calloc(1, sizeof *v->replay);
  if (!v->replay) return sf_fail(SF_E_MEMORY, "no memory for a replay");
  SF_TRY(sf_replay_load(v->replay, &v->scene_path, v->options.replay));
  if (!v->options.scene) v->options.scene = v->scene_path;
  SF_TRY(sf_json_load(v->options.replay, &json));
  v->difference = cJSON_DetachItemFromObject(json, "difference");
  cJSON_Delete(json);
  if (!cJSON_IsObject(v->difference)) cJSON_Delete(v->difference), v->difference = cJSON_CreateObject();
  const char *data = sf_json_text(v->difference, "data"), *split = sf_json_text(v->difference, "split");
  if (!v->options.data && data && !access(data, R_OK)) v->options.data = data;
  if (!v->options.split && split) v->options.split = split;
  return sf_ok();
}

/* -1: not told, or outside. */
static int told(const sf_viewer *v, const char *key, int most)
{
  const double value = sf_json_number(v->difference, key);
  return value >= 0 && value <= most && value == floor(value) ? (int)value : -1;
}

/* ---- what the core had ---- */

typedef struct core_run {
  fx_trace *trace; /* [count] */
  fx_counts counts;
} core_run;

static sf_status run_core(const sf_viewer *v, core_run *run)
{
  const sf_replay *r = v->replay;
  const fx_net *net = &v->at[v->file_steps - 1].net;
  int32_t base[SF_LANES];
  fx_out out;
  *run = (core_run){.trace = calloc((size_t)r->count, sizeof *run->trace)};
  if (!run->trace) return sf_fail(SF_E_MEMORY, "no memory for a replay");
  for (int i = 0; i < r->count; i++)
    fx_net_next(net, r->sample[i].dir, r->sample[i].first || i == 0, r->sample[i].f, base, &out, &run->trace[i],
                &run->counts);
  return sf_ok();
}

/* The neuron over the steps of all samples; what the accelerator had in its place stands as a bar of its own. */
static sf_status draw(const sf_viewer *v, const core_run *run, int layer, int neuron, cJSON *json)
{
  const int steps = v->file_steps, n = v->replay->count * steps, at = told(v, "at", v->replay->count - 1);
  const int step = told(v, "step", steps - 1);
  const char *wire = sf_json_text(v->difference, "wire");
  char *text = NULL, title[80];
  size_t size;
  double *space = malloc((size_t)n * 5 * sizeof *space);
  if (!space) return sf_fail(SF_E_MEMORY, "no memory for a drawing");
  double *x = space, *current = x + n, *membrane = current + n, *spikes = membrane + n, *actual = spikes + n;
  for (int i = 0; i < n; i++) {
    const fx_trace *t = &run->trace[i / steps];
    x[i] = i / steps + (double)(i % steps) / steps;
    current[i] = t->current[layer][i % steps][neuron], membrane[i] = t->membrane[layer][i % steps][neuron];
    spikes[i] = (double)(t->spikes[layer][i % steps][neuron / 64] >> neuron % 64 & 1);
    actual[i] = NAN;
  }
  const int mark = at >= 0 && step >= 0 ? at * steps + step : -1;
  if (mark >= 0) actual[mark] = sf_json_number(v->difference, "actual");
  snprintf(title, sizeof title, "Accelerator: %s", wire ? wire : "no value");
  const html_axis axis = {x, n, "sample of the replay, with its steps", mark};
  const html_row row[] = {{"Core: current", "", "l0", current, false, 0, 0},
                          {"Core: membrane before it fires", "", "l2", membrane, false, 0, 0},
                          {"Core: spikes", "", "l3", spikes, true, 0, 1},
                          {title, "", "l4", actual, true, 0, 0}};
  FILE *out = open_memstream(&text, &size);
  if (out) html_rows(out, "svg-difference", "The neuron that differs", &axis, row, mark >= 0 ? 4 : 3);
  free(space);
  if (!out || fclose(out)) return sf_fail(SF_E_MEMORY, "no memory for a drawing");
  cJSON_AddStringToObject(json, "drawing", text);
  free(text);
  return sf_ok();
}

/* Layer, step and neuron with what both had: the neurons around the one that differs, as the core has them. */
static void add_neurons(const sf_viewer *v, const core_run *run, int layer, int neuron, cJSON *json)
{
  const int at = told(v, "at", v->replay->count - 1), step = told(v, "step", v->file_steps - 1);
  const int n = v->at[0].net.layer[layer].n_out, first = neuron > 3 ? neuron - 3 : 0;
  cJSON *list = cJSON_AddArrayToObject(json, "neurons");
  for (int o = first; at >= 0 && step >= 0 && o < n && o < first + 7; o++) {
    const fx_trace *t = &run->trace[at];
    cJSON *one = cJSON_CreateObject();
    cJSON_AddNumberToObject(one, "neuron", o);
    cJSON_AddNumberToObject(one, "current", t->current[layer][step][o]);
    cJSON_AddNumberToObject(one, "membrane", t->membrane[layer][step][o]);
    cJSON_AddBoolToObject(one, "fires", t->spikes[layer][step][o / 64] >> o % 64 & 1);
    cJSON_AddItemToArray(list, one);
  }
}

static void wave_path(const sf_viewer *v, char path[4096])
{
  const char *wave = sf_json_text(v->difference, "wave");
  char *whole = wave ? realpath(wave, NULL) : NULL;
  snprintf(path, 4096, "%s", whole ? whole : "");
  free(whole);
}

/* The same samples through this program's accelerator. */
static void add_here(const sf_viewer *v, cJSON *json)
{
  sf_replayed replayed;
  char text[200] = "";
  const sf_status status = sf_replay_run(v->replay, &v->at[v->file_steps - 1].net, NULL, &replayed);
  if (status.code == SF_OK && replayed.differs && replayed.what.wire) sf_difference_text(&replayed.what, text);
  sf_json_add_text(json, "here",
                   status.code != SF_OK ? status.message
                   : !replayed.differs  ? "no difference"
                   : replayed.what.wire ? text
                                        : replayed.message);
}

SF_VIEWER_ANSWER(difference)
{
  sf_viewer *v = user;
  core_run run;
  char wave[4096];
  (void)ask;
  if (!v->replay) return sf_fail(SF_E_RANGE, "there is no difference: start sf_view with --replay");
  const int layer = told(v, "layer", SF_LAYERS - 1);
  const int neuron = layer < 0 ? -1 : told(v, "neuron", v->at[0].net.layer[layer].n_out - 1);
  cJSON *json = cJSON_CreateObject();
  sf_status status = run_core(v, &run);
  cJSON_AddItemToObject(json, "file", cJSON_Duplicate(v->difference, true));
  cJSON_AddNumberToObject(json, "samples", v->replay->count);
  if (layer >= 0) cJSON_AddStringToObject(json, "layer_name", fx_layer_name(layer));
  if (status.code == SF_OK && layer >= 0) status = draw(v, &run, layer, neuron < 0 ? 0 : neuron, json);
  if (status.code == SF_OK && layer >= 0) add_neurons(v, &run, layer, neuron < 0 ? 0 : neuron, json);
  if (status.code == SF_OK)
    cJSON_AddItemToObject(json, "counts", sf_counts_json(&v->at[v->file_steps - 1].net, &run.counts));
  free(run.trace);
  pthread_mutex_lock(&v->rtl_turn);
  if (status.code == SF_OK) add_here(v, json);
  pthread_mutex_unlock(&v->rtl_turn);
  wave_path(v, wave);
  if (wave[0]) sf_json_add_text(json, "wave", wave);
  if (status.code == SF_OK) return sf_view_reply_json(reply, json);
  cJSON_Delete(json);
  return status;
}

/* ---- for GTKWave ---- */

enum { BEFORE = 40 /* cycles */, SIGNALS = 160 };

static void put_instance(FILE *out, const sf_wave *wave, int i)
{
  if (i < 0) return;
  put_instance(out, wave, wave->instance[i].parent);
  fprintf(out, "%s.", wave->instance[i].name);
}

/* Ports of the top, and everything in the layer's own instance. */
static bool matters(const sf_wave *wave, const sf_wave_net *net, const char *layer)
{
  const char *name = wave->instance[net->instance].name;
  const bool top = !strcmp(name, "sf_top"), tap = !strncmp(net->name, "tap", 3);
  if (top)
    return tap || !strncmp(net->name, "s_axis", 6) || !strncmp(net->name, "m_axis", 6) || !strcmp(net->name, "clk_i");
  if (!layer) return !strcmp(name, "u_counters");
  if (!strcmp(name, "u_neurons")) return !strcmp(layer, "D1") || layer[0] == 'C';
  char own[16];
  snprintf(own, sizeof own, "u_%c%c", layer[0] | 32, layer[1]);
  return !strncmp(name, own, 4);
}

static void put_signals(FILE *out, const sf_viewer *v, const sf_wave *wave, const char *path)
{
  const int layer = told(v, "layer", SF_LAYERS - 1);
  const double cycle = sf_json_real(sf_json_get(v->difference, "cycle"));
  const double from = cycle > BEFORE ? 2 * (cycle - BEFORE) : 0; /* two units of time a cycle */
  int count = 0;
  fprintf(out, "[*] sf_view: what matters for the difference\n[dumpfile] \"%s\"\n[timestart] %.0f\n", path, from);
  fprintf(out, "*-5.000000 %.0f\n@22\n", 2 * cycle);
  for (int i = 0; i < wave->nets && count < SIGNALS; i++) {
    const sf_wave_net *net = &wave->net[i];
    if (!matters(wave, net, layer >= 0 ? fx_layer_name(layer) : NULL)) continue;
    put_instance(out, wave, net->instance);
    fprintf(out, net->vector ? "%s[%d:%d]\n" : "%s\n", net->name, net->msb, net->lsb);
    count++;
  }
}

SF_VIEWER_ANSWER(signals)
{
  sf_viewer *v = user;
  char path[4096], *text = NULL;
  sf_wave wave = {0};
  (void)ask;
  if (!v->replay) return sf_fail(SF_E_RANGE, "there is no difference: start sf_view with --replay");
  wave_path(v, path);
  if (!path[0]) return sf_fail(SF_E_RANGE, "the waveform of the difference is not there any more");
  SF_TRY(sf_wave_open(&wave, path, 0));
  FILE *out = open_memstream(&text, &reply->size);
  if (out) put_signals(out, v, &wave, path);
  sf_wave_free(&wave);
  if (!out || fclose(out)) return free(text), sf_fail(SF_E_MEMORY, "no memory for a reply");
  reply->data = text, reply->type = "text/plain; charset=utf-8", reply->file = "difference.gtkw";
  return sf_ok();
}
