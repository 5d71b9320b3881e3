/* The golden model behind DPI-C: one core, one ray at a time, everything of the last sample. */
#include "spikefield/sf_golden_dpi.h"
#include "src/lib/internal.h"
#include <stdlib.h>
#include <string.h>

enum { BEAT_VALUES = 4, PACKET_VALUES = SF_DIR_MAX + SF_FEATURE_MAX };

typedef struct golden {
  spikefield_scene *owner;
  fx_scene scene; /* the owner's with the time steps asked for */
  spikefield_status status;
  bool open, have_direction, have_sample;
  int32_t base[SF_LANES];
  fx_out out;
  fx_trace trace;
  fx_counts counts;
  int16_t packet[PACKET_VALUES]; /* of the sample that is coming in */
  int values;
  bool first;
} golden;

void *sf_golden_open(const char *scene, int steps)
{
  golden *g = calloc(1, sizeof *g);
  const spikefield_options options = {.steps = steps};
  if (!g) return NULL;
  g->status = spikefield_scene_open(&g->owner, scene);
  if (g->status.code == SPIKEFIELD_OK) g->status = lib_status(lib_view(g->owner, &options, &g->scene));
  g->open = g->status.code == SPIKEFIELD_OK;
  return g;
}

void sf_golden_close(void *handle)
{
  golden *g = handle;
  if (!g) return;
  spikefield_scene_close(g->owner);
  free(g);
}

const char *sf_golden_error(void *handle)
{
  golden *g = handle;
  return g ? g->status.message : "no memory for a golden model";
}

/* ---- sizes ---- */

static const fx_layer *layer_of(const golden *g, int layer)
{
  return g && g->open && layer >= 0 && layer < SF_LAYERS ? &g->scene.net.layer[layer] : NULL;
}

int sf_golden_steps(void *handle)
{
  const golden *g = handle;
  return g && g->open ? g->scene.net.steps : 0;
}

int sf_golden_inputs(void *handle, int layer)
{
  const fx_layer *l = layer_of(handle, layer);
  return l ? l->n_in : 0;
}

int sf_golden_outputs(void *handle, int layer)
{
  const fx_layer *l = layer_of(handle, layer);
  return l ? l->n_out : 0;
}

/* ---- samples ---- */

static int directions(const golden *g)
{
  return fx_net_constants(&g->scene.net);
}

static sf_status check_values(const char *what, const int16_t *value, int n)
{
  const int32_t limit = 1 << (SF_INPUT_BITS - 1);
  for (int i = 0; i < n; i++)
    if (value[i] >= limit || value[i] < -limit)
      return sf_fail(SF_E_RANGE, "%s %d is %d, expected -%d..%d", what, i, value[i], limit, limit - 1);
  return sf_ok();
}

/* direction NULL: the ray goes on. */
static sf_status evaluate(golden *g, const int16_t *direction, const int16_t *features, bool beats)
{
  const fx_net *net = &g->scene.net;
  if (!beats && fx_net_constants_per_sample(net)) return sf_fail(SF_E_USAGE, "a decoder's samples come as beats");
  if (!direction && !g->have_direction) return sf_fail(SF_E_USAGE, "a sample before the first direction");
  SF_TRY(check_values("feature", features, net->layer[FX_D1].n_in));
  if (direction) SF_TRY(check_values("harmonic", direction, directions(g)));
  if (direction) fx_net_direction(net, direction, g->base, &g->counts);
  fx_net_sample(net, features, g->base, &g->out, &g->trace, &g->counts);
  g->have_direction = g->have_sample = true;
  return sf_ok();
}

static int finish(golden *g, sf_status status, int good)
{
  g->status = lib_status(status);
  return status.code == SF_OK ? good : -1;
}

static void unpack(const uint32_t *word, int16_t *value, int n)
{
  for (int i = 0; i < n; i++) value[i] = (int16_t)(word[i / 2] >> (16 * (i % 2)));
}

int sf_golden_sample(void *handle, int first, const uint32_t direction[8], const uint32_t features[16])
{
  golden *g = handle;
  int16_t d[FX_SH], f[SF_FEATURE_MAX];
  if (!g || !g->open) return -1;
  unpack(direction, d, FX_SH);
  unpack(features, f, SF_FEATURE_MAX);
  return finish(g, evaluate(g, first ? d : NULL, f, false), 1);
}

/* Direction and features are each padded to whole beats. */
static int padded(int values)
{
  return (values + BEAT_VALUES - 1) / BEAT_VALUES * BEAT_VALUES;
}

static sf_status take_beat(golden *g, const int16_t *value, bool user, bool last, bool *whole)
{
  if (g->values == 0) g->first = user;
  if (!g->first && fx_net_constants_per_sample(&g->scene.net))
    return sf_fail(SF_E_FORMAT, "a decoder's sample without tuser");
  const int n_direction = g->first ? padded(directions(g)) : 0;
  const int n = n_direction + padded(g->scene.net.layer[FX_D1].n_in);
  SF_TRY(check_values("value", value, BEAT_VALUES));
  memcpy(g->packet + g->values, value, BEAT_VALUES * sizeof *value);
  g->values += BEAT_VALUES;
  *whole = g->values == n;
  if (*whole != last)
    return sf_fail(SF_E_FORMAT, "packet of %d values, expected %d: %s", g->values, n, last ? "too short" : "too long");
  return *whole ? evaluate(g, g->first ? g->packet : NULL, g->packet + n_direction, true) : sf_ok();
}

int sf_golden_beat(void *handle, uint64_t data, int user, int last)
{
  golden *g = handle;
  bool whole = false;
  int16_t value[BEAT_VALUES];
  if (!g || !g->open) return -1;
  for (int i = 0; i < BEAT_VALUES; i++) value[i] = (int16_t)(data >> (16 * i));
  const sf_status status = take_beat(g, value, user, last, &whole);
  if (whole || status.code != SF_OK) g->values = 0;
  return finish(g, status, whole);
}

/* ---- results ---- */

static const golden *sampled(void *handle)
{
  const golden *g = handle;
  return g && g->have_sample ? g : NULL;
}

static const golden *sampled_at(void *handle, int layer, int step)
{
  const golden *g = sampled(handle);
  return g && layer_of(g, layer) && step >= 0 && step < g->scene.net.steps ? g : NULL;
}

uint32_t sf_golden_density(void *handle)
{
  const golden *g = sampled(handle);
  return g ? g->out.sigma : 0;
}

uint32_t sf_golden_colour(void *handle, int channel)
{
  const golden *g = sampled(handle);
  return g && channel >= 0 && channel < 3 ? g->out.colour[channel] : 0;
}

static void put_bits(const uint64_t bits[SF_SPIKE_WORDS], uint32_t to[SF_GOLDEN_WORDS])
{
  for (int i = 0; i < SF_GOLDEN_WORDS; i++)
    to[i] = i < 2 * SF_SPIKE_WORDS ? (uint32_t)(bits[i / 2] >> (32 * (i % 2))) : 0;
}

void sf_golden_spikes(void *handle, int layer, int step, uint32_t spikes[SF_GOLDEN_WORDS])
{
  const golden *g = sampled_at(handle, layer, step);
  put_bits(g ? g->trace.spikes[layer][step] : (uint64_t[SF_SPIKE_WORDS]){0}, spikes);
}

void sf_golden_rows(void *handle, int layer, int step, uint32_t rows[SF_GOLDEN_WORDS])
{
  const golden *g = sampled_at(handle, layer, step);
  uint64_t any[SF_SPIKE_WORDS] = {0};
  if (g) lib_rows(&g->scene.net, (lib_spikes)g->trace.spikes, layer, step, any);
  put_bits(any, rows);
}

int sf_golden_membrane(void *handle, int layer, int step, int neuron)
{
  const golden *g = sampled_at(handle, layer, step);
  return g ? lib_membrane(&g->scene.net, (lib_spikes)g->trace.spikes, (lib_membranes)g->trace.membrane, layer, step,
                          neuron)
           : 0;
}

int sf_golden_current(void *handle, int layer, int step, int neuron)
{
  const golden *g = sampled_at(handle, layer, step);
  return g && neuron >= 0 && neuron < g->scene.net.layer[layer].n_out ? g->trace.current[layer][step][neuron] : 0;
}

/* ---- counters ---- */

uint64_t sf_golden_counter(void *handle, int at)
{
  const golden *g = handle;
  return g ? lib_counter(&g->counts, at) : 0;
}

void sf_golden_clear_counters(void *handle)
{
  golden *g = handle;
  if (g) memset(&g->counts, 0, sizeof g->counts);
}
