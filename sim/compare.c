#include "sim/compare.h"
#include "sim/cover.h"
#include "energy/energy.h"

typedef struct comparison {
  const fx_net *net;
  const fx_trace *core;
  const fx_out *core_out;
  const sf_dut_result *result;
  const sf_dut_trace *trace;
  sf_difference *difference;
} comparison;

static bool differs(const comparison *c, int layer, int step, int neuron, const char *wire, int64_t expected,
                    int64_t actual, uint64_t cycle)
{
  *c->difference = (sf_difference){layer, step, neuron, wire, expected, actual, cycle};
  return false;
}

static bool same_bits(const comparison *c, int layer, int step, const char *wire,
                      const uint64_t expected[SF_SPIKE_WORDS], const uint64_t actual[SF_SPIKE_WORDS], uint64_t cycle)
{
  for (int word = 0; word < SF_SPIKE_WORDS; word++) {
    const uint64_t odd = expected[word] ^ actual[word];
    if (!odd) continue;
    const int bit = __builtin_ctzll(odd);
    return differs(c, layer, step, word * 64 + bit, wire, (int64_t)(expected[word] >> bit & 1),
                   (int64_t)(actual[word] >> bit & 1), cycle);
  }
  return true;
}

static bool same_neurons(const comparison *c, int layer, int step)
{
  const fx_layer *l = &c->net->layer[layer];
  const uint64_t cycle = c->result->tap_cycle[layer][step], *spikes = c->core->spikes[layer][step];
  if (!same_bits(c, layer, step, "spike", spikes, c->result->spikes[layer][step], cycle)) return false;
  for (int n = 0; c->trace && n < l->n_out; n++) {
    const int32_t expected = fx_membrane_left(c->net, c->core, layer, step, n);
    const int32_t actual = c->trace->membrane[layer][step][n];
    if (expected != actual) return differs(c, layer, step, n, "membrane", expected, actual, cycle);
  }
  return true;
}

/* D2 and C3 add up a presynaptic neuron that fired at any step, once. */
static bool same_rows_any(const comparison *c, int layer, int presynaptic, uint64_t cycle)
{
  uint64_t any[SF_SPIKE_WORDS] = {0};
  if (!c->trace) return true;
  for (int t = 0; t < c->net->steps; t++)
    for (int word = 0; word < SF_SPIKE_WORDS; word++) any[word] |= c->core->spikes[presynaptic][t][word];
  return same_bits(c, layer, 0, "row", any, c->trace->rows[layer][0], cycle);
}

static bool same_hidden_step(const comparison *c, int t)
{
  if (!same_neurons(c, FX_C1, t)) return false;
  if (c->trace && !same_bits(c, FX_C2, t, "row", c->core->spikes[FX_C1][t], c->trace->rows[FX_C2][t],
                             c->result->tap_cycle[FX_C2][t]))
    return false;
  return same_neurons(c, FX_C2, t);
}

bool sf_compare_sample(const fx_net *net, const fx_trace *core, const fx_out *core_out, const sf_dut_result *result,
                       const sf_dut_trace *trace, sf_difference *difference)
{
  const comparison c = {net, core, core_out, result, trace, difference};
  const int last = net->steps - 1;
  for (int t = 0; t < net->steps; t++)
    if (!same_neurons(&c, FX_D1, t)) return false;
  if (!same_rows_any(&c, FX_D2, FX_D1, result->tap_cycle[FX_D2][0])) return false;
  for (int t = 0; t < net->steps; t++)
    if (!same_hidden_step(&c, t)) return false;
  if (!same_rows_any(&c, FX_C3, FX_C2, result->tap_cycle[FX_C3][0])) return false;
  if (core_out->sigma != result->out.sigma)
    return differs(&c, FX_D2, last, 0, "sigma", core_out->sigma, result->out.sigma, result->cycle);
  for (int o = 0; o < 3; o++)
    if (core_out->colour[o] != result->out.colour[o])
      return differs(&c, FX_C3, last, o, "colour", core_out->colour[o], result->out.colour[o], result->cycle);
  sf_cover_sample(net, core, result);
  return true;
}

static bool same_total(const char *name, uint64_t core, uint64_t dut, uint64_t cycle, sf_difference *difference)
{
  if (core == dut) return true;
  *difference = (sf_difference){-1, -1, -1, name, (int64_t)core, (int64_t)dut, cycle};
  return false;
}

bool sf_compare_counts(const fx_counts *core, const fx_counts *dut, uint64_t cycle, sf_difference *difference)
{
  for (int l = 0; l < SF_LAYERS; l++)
    for (int t = 0; t < SF_T_MAX; t++)
      for (int e = 0; e < SF_EVENTS; e++) {
        const uint64_t expected = core->layer[l].event[e][t], actual = dut->layer[l].event[e][t];
        if (expected == actual) continue;
        *difference = (sf_difference){l, t, -1, sf_events[e].name, (int64_t)expected, (int64_t)actual, cycle};
        return false;
      }
  return same_total("samples", core->samples, dut->samples, cycle, difference) &&
         same_total("rays", core->rays, dut->rays, cycle, difference);
}

sf_status sf_compare_ray_counts(const fx_net *net, const fx_counts *core, const fx_counts *rtl)
{
  SF_TRY(sf_counts_compare(core, "core", rtl, "accelerator"));
  if (fx_net_constants_per_sample(net) || core->rays == rtl->rays) return sf_ok();
  return sf_fail(SF_E_DIFFERENCE, "rays: core %llu, accelerator %llu", (unsigned long long)core->rays,
                 (unsigned long long)rtl->rays);
}

sf_status sf_compare_pixel(const fx_pixel *core, const fx_pixel *rtl, uint64_t cycle)
{
  const struct {
    const char *name;
    uint64_t core, rtl;
  } field[] = {{"number of samples", core->samples, rtl->samples},
               {"transmittance", core->transmittance, rtl->transmittance},
               {"weight", core->weight_sum, rtl->weight_sum},
               {"red", core->colour[0], rtl->colour[0]},
               {"green", core->colour[1], rtl->colour[1]},
               {"blue", core->colour[2], rtl->colour[2]},
               {"depth", core->depth, rtl->depth}};
  for (size_t i = 0; i < sizeof field / sizeof *field; i++)
    if (field[i].core != field[i].rtl)
      return sf_fail(SF_E_DIFFERENCE, "%s is %llu in the core, %llu in the accelerator, cycle %llu", field[i].name,
                     (unsigned long long)field[i].core, (unsigned long long)field[i].rtl, (unsigned long long)cycle);
  return sf_ok();
}
