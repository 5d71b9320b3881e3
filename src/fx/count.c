#include "src/fx/count.h"
#include "src/fx/nofloat.h"

enum { MEMBRANE_BYTES = (SF_MEMBRANE_BITS + 7) / 8, INTEGRATOR_BYTES = 4 };

/* Every member of fx_layer_counts is an array of SF_T_MAX 64-bit sums, so both structs are flat arrays of them. */
_Static_assert(sizeof(fx_counts) % sizeof(uint64_t) == 0, "fx_counts holds only 64-bit counters");

void fx_counts_add(fx_counts *sum, const fx_counts *more)
{
  uint64_t *to = (uint64_t *)sum;
  const uint64_t *from = (const uint64_t *)more;
  for (size_t i = 0; i < sizeof *sum / sizeof *to; i++) to[i] += from[i];
}

static uint64_t popcount(const uint64_t bits[2])
{
  return (uint64_t)(__builtin_popcountll(bits[0]) + __builtin_popcountll(bits[1]));
}

void fx_count_direction(fx_counts *counts, const fx_net *net)
{
  const int n_dir = net->layer[FX_C1].n_in - (net->layer[FX_D2].n_out - 1);
  const uint64_t macs = (uint64_t)n_dir * (uint64_t)net->layer[FX_C1].n_out;
  counts->rays++;
  counts->layer[FX_C1].mac[0] += macs;
  counts->layer[FX_C1].weight[0] += macs;
}

static void count_updates(fx_layer_counts *c, int t, uint64_t updates, uint64_t bytes)
{
  c->updates[t] += updates;
  c->state_w[t] += updates * bytes;
  if (t > 0) c->state_r[t] += updates * bytes;
}

/* A layer fed by spikes. C2 reads a row for every spike; D2 and C3 keep a row's currents: one read per sample. */
static void count_synapses(fx_layer_counts *c, const fx_layer *layer, int t, const uint64_t now[2], uint64_t rows_read)
{
  const uint64_t fan_out = (uint64_t)layer->n_out;
  c->sop[t] += popcount(now) * fan_out;
  c->weight[t] += rows_read * fan_out;
}

static uint64_t first_time(uint64_t seen[2], const uint64_t now[2])
{
  const uint64_t fresh[2] = {now[0] & ~seen[0], now[1] & ~seen[1]};
  seen[0] |= now[0], seen[1] |= now[1];
  return popcount(fresh);
}

void fx_count_sample(fx_counts *counts, const fx_net *net, const uint64_t spikes[SF_LAYERS][SF_T_MAX][2])
{
  const fx_layer *layer = net->layer;
  fx_layer_counts *c = counts->layer;
  const uint64_t d1_macs = (uint64_t)layer[FX_D1].n_in * (uint64_t)layer[FX_D1].n_out;
  const uint64_t h_macs = (uint64_t)(layer[FX_D2].n_out - 1) * (uint64_t)layer[FX_C1].n_out;
  uint64_t seen_d1[2] = {0}, seen_c2[2] = {0};
  counts->samples++;
  c[FX_D1].mac[0] += d1_macs;
  c[FX_D1].weight[0] += d1_macs;
  for (int t = 0; t < net->steps; t++) {
    const uint64_t *d1 = spikes[FX_D1][t], *c1 = spikes[FX_C1][t], *c2 = spikes[FX_C2][t];
    for (int l = 0; l < SF_LAYERS; l++) c[l].spikes[t] += l == FX_D2 || l == FX_C3 ? 0 : popcount(spikes[l][t]);
    c[FX_C1].mac[t] += h_macs;
    c[FX_C1].weight[t] += h_macs;
    count_synapses(&c[FX_D2], &layer[FX_D2], t, d1, first_time(seen_d1, d1));
    count_synapses(&c[FX_C2], &layer[FX_C2], t, c1, popcount(c1));
    count_synapses(&c[FX_C3], &layer[FX_C3], t, c2, first_time(seen_c2, c2));
    count_updates(&c[FX_D1], t, (uint64_t)layer[FX_D1].n_out, MEMBRANE_BYTES);
    count_updates(&c[FX_C1], t, (uint64_t)layer[FX_C1].n_out, MEMBRANE_BYTES);
    count_updates(&c[FX_C2], t, (uint64_t)layer[FX_C2].n_out, MEMBRANE_BYTES);
    count_updates(&c[FX_D2], t, 1, INTEGRATOR_BYTES);
    count_updates(&c[FX_C3], t, (uint64_t)layer[FX_C3].n_out, INTEGRATOR_BYTES);
    c[FX_D2].special[t]++;
    c[FX_C3].special[t] += (uint64_t)layer[FX_C3].n_out;
  }
}
