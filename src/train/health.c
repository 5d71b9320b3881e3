/* Keeps the neurons in the range where they can learn: leaks stay apart from 0 and 1, a layer that does not
 * fire, or always fires, is brought back to the threshold as at the start of the run. */
#include "train/internal.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { WINDOW = 64, CENSUS = 64 }; /* iterations between two counts; probes of a count */

static const double dead = 1e-4, saturated = 0.95; /* spikes per neuron and step */

static const int spiking[3] = {0, 2, 3}; /* D1, C1, C2 among the layers */

/* At both ends k is still 4 units of the hardware's 12 bits away from 0 and 1, where a neuron would forget or ignore
 * its input, and where the logit's gradient k (1-k) no longer brings it back. */
void sf_health_leaks(sf_trainer *t)
{
  float *leak = sf_model_param(&t->model, SF_P_LEAK);
  for (int l = 0; l < SF_LAYERS; l++) {
    if (leak[l] > SF_LEAK_LIMIT) leak[l] = SF_LEAK_LIMIT; /* not fminf: a NaN must stay one, to be found */
    if (leak[l] < -SF_LEAK_LIMIT) leak[l] = -SF_LEAK_LIMIT;
  }
}

typedef struct census {
  double firing; /* spikes per neuron and step */
  int quiet;     /* neurons without a spike */
} census;

/* Of the first CENSUS probes; a function of the parameters alone, as the decisions that hang on it must be. */
static void count(const sf_trainer *t, const sf_probes *probes, census c[3])
{
  const int steps = t->model.config.steps, hidden = t->model.config.hidden;
  int spikes[3][SF_LANES] = {{0}};
  for (int i = 0; i < CENSUS; i++) {
    sf_probe(&t->model, probes, i, steps);
    for (int l = 0; l < 3; l++)
      for (int s = 0; s < steps; s++)
        for (int n = 0; n < hidden; n++) spikes[l][n] += probes->trace->spike[spiking[l]][s][n];
  }
  for (int l = 0; l < 3; l++) {
    c[l] = (census){0};
    for (int n = 0; n < hidden; n++) {
      c[l].firing += spikes[l][n] / ((double)CENSUS * steps * hidden);
      c[l].quiet += spikes[l][n] == 0;
    }
  }
}

static void forget(sf_trainer *t, size_t first, size_t count)
{
  memset(t->moment1 + first, 0, count * sizeof(float));
  memset(t->moment2 + first, 0, count * sizeof(float));
}

/* A bias beyond the threshold would decide alone, whatever the scale of the weights. */
static void clear_bias(sf_trainer *t, int layer)
{
  if (sf_layer_bias[layer] < 0) return;
  const sf_param *b = &t->model.param[sf_layer_bias[layer]];
  memset(t->model.value + b->offset, 0, b->size * sizeof(float));
  forget(t, b->offset, b->size);
}

/* What the layer learned is kept if its scale was all that was wrong. Snapshots of before are of another model. */
static void revive(sf_trainer *t, int l, const sf_probes *probes)
{
  const int layer = spiking[l];
  const sf_param *w = &t->model.param[sf_layer_weights[layer]];
  const size_t leak = t->model.param[SF_P_LEAK].offset + (size_t)layer;
  census now[3];
  t->model.value[leak] = 0;
  t->averaged = 0;
  clear_bias(t, layer);
  sf_layer_scale(t, layer, probes);
  count(t, probes, now);
  if (!(now[l].firing > 100 * dead && now[l].firing < saturated)) {
    sf_layer_redraw(t, layer, RNG_REVIVE);
    sf_layer_scale(t, layer, probes);
  }
  forget(t, w->offset, w->size);
  forget(t, leak, 1);
}

/* Counts in a row: of silence (negative) or of saturation (positive). */
static int next_run(int run, double firing)
{
  if (firing < dead) return run < 0 ? run - 1 : -1;
  if (firing > saturated) return run > 0 ? run + 1 : 1;
  return 0;
}

sf_status sf_health_check(sf_trainer *t, int event[3])
{
  sf_health *h = &t->health;
  memset(event, 0, 3 * sizeof *event);
  if (t->model.config.net == SF_NET_ANN || sf_tuning(t) || (t->iteration + 1) % WINDOW) return sf_ok();
  sf_probes probes;
  census now[3];
  SF_TRY(sf_probes_create(&probes, t));
  sf_probes_draw(t, RNG_PROBE, CENSUS, &probes);
  count(t, &probes, now);
  for (int l = 0; l < 3; l++) {
    if (!sf_model_has(&t->model, sf_layer_weights[spiking[l]])) continue;
    h->quiet[l] = now[l].quiet;
    h->run[l] = next_run(h->run[l], now[l].firing);
  }
  for (int l = 0; l < 3; l++) {
    if (abs(h->run[l]) < 2 + h->revived[l]) continue; /* a scene may want a quiet layer: ever more patience */
    event[l] = h->run[l] < 0 ? -1 : 1;
    sf_probes_draw(t, RNG_PROBE, PROBES, &probes);
    revive(t, l, &probes);
    h->revived[l]++;
    memset(h->run, 0, sizeof h->run); /* the layers behind see new spikes */
    break;
  }
  sf_probes_free(&probes);
  return sf_ok();
}

sf_status sf_parameters_check(const sf_trainer *t)
{
  for (int i = SF_P_NETS; i < SF_P_COUNT; i++)
    for (size_t j = 0; j < t->model.param[i].size; j++) {
      const float value = t->model.value[t->model.param[i].offset + j];
      if (!(fabsf(value) < 1e6f))
        return sf_fail(SF_E_RANGE, "train: iteration %lld: '%s' has diverged: %g at index %zu", (long long)t->iteration,
                       t->model.param[i].name, value, j);
    }
  return sf_ok();
}
