/* Events times prices. A ledger is one list of prices per row and part, laid over the counts of the spiking net or of
 * its twin; everything else (savings, break-even, sensitivity) follows from these products. */
#include "energy/energy.h"
#include "base/saturate.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

const char *const sf_row_names[SF_ROWS] = {"D1", "D2", "C1", "C2", "C3", "field", "ray"};
const char *const sf_part_names[SF_PARTS] = {"mac", "sop", "weight", "state", "table", "frame", "neuron", "special"};
const char *const sf_part_titles[SF_PARTS] = {"MAC",         "SOP",         "weight bytes",   "state bytes",
                                              "field bytes", "frame bytes", "neuron updates", "special functions"};

const sf_ledger_text sf_ledger_texts[SF_LEDGERS] = {
    {"paper", "paper", "MAC and SOP at the prices of fp32 operations, nothing else", SF_LEDGER_ANN},
    {"width", "width-correct", "MAC and SOP at integer prices for the widths of the hardware", SF_LEDGER_INT},
    {"memory", "+ memory", "and the bytes of weights, membranes, field and frame", SF_LEDGER_INT_MEMORY},
    {"neuron", "+ neuron updates", "and leak, compare, reset, exp and sigmoid", SF_LEDGER_INT_ALL},
    {"ann_fp32", "fp32 ReLU twin", "the ReLU net of the same sizes on the same samples: every synapse an fp32 MAC", -1},
    {"ann_int", "integer ReLU twin", "the same in int8 x int8 + int32, the direction's products once per ray", -1},
    {"ann_int_memory", "ReLU twin + memory", "and the bytes of weights, activations, field and frame", -1},
    {"ann_int_all", "ReLU twin, all", "and ReLU, requantisation, exp and sigmoid", -1}};

/* What each ledger prices beyond MAC and SOP. */
static bool is_integer(int ledger)
{
  return ledger != SF_LEDGER_PAPER && ledger != SF_LEDGER_ANN;
}

static bool has_memory(int ledger)
{
  return ledger == SF_LEDGER_MEMORY || ledger == SF_LEDGER_NEURON || ledger == SF_LEDGER_INT_MEMORY ||
         ledger == SF_LEDGER_INT_ALL;
}

static bool has_neurons(int ledger)
{
  return ledger == SF_LEDGER_NEURON || ledger == SF_LEDGER_INT_ALL;
}

static bool is_twin(int ledger)
{
  return ledger >= SF_SPIKING_LEDGERS;
}

/* ---- events ---- */

/* Events by row, step and part: what the prices multiply. */
typedef uint64_t event_table[SF_ROWS][SF_T_MAX][SF_PARTS];

static void add_traffic(const sf_traffic *traffic, event_table e)
{
  e[SF_ROW_FIELD][0][SF_PART_TABLE] = traffic->table_bytes;
  e[SF_ROW_RAY][0][SF_PART_SPECIAL] = traffic->exp_neg;
  e[SF_ROW_RAY][0][SF_PART_FRAME] = traffic->frame_bytes;
}

static void spiking_events(const fx_counts *counts, const sf_traffic *traffic, event_table e)
{
  memset(e, 0, sizeof(event_table));
  for (int l = 0; l < SF_LAYERS; l++)
    for (int t = 0; t < SF_T_MAX; t++) {
      const fx_layer_counts *c = &counts->layer[l];
      e[l][t][SF_PART_MAC] = c->mac[t];
      e[l][t][SF_PART_SOP] = c->sop[t];
      e[l][t][SF_PART_WEIGHT] = c->weight[t];
      e[l][t][SF_PART_STATE] = sf_add_u64(c->state_r[t], c->state_w[t]);
      e[l][t][SF_PART_NEURON] = c->updates[t];
      e[l][t][SF_PART_SPECIAL] = c->special[t];
    }
  add_traffic(traffic, e);
}

/* The twin does in one step what the net does in t_r: each synapse a MAC, each hidden activation written and read once
 * as a byte, then requantised; the special functions of one step. hoisted: the direction's products once per ray. */
static void twin_events(const fx_net *net, const fx_counts *counts, const sf_traffic *traffic, bool hoisted,
                        event_table e)
{
  const int n_h = fx_net_h(net);
  memset(e, 0, sizeof(event_table));
  for (int l = 0; l < SF_LAYERS; l++) {
    const fx_layer *size = &net->layer[l];
    const uint64_t n_in = (uint64_t)size->n_in, n_out = (uint64_t)size->n_out;
    const uint64_t once = hoisted && l == FX_C1 ? (uint64_t)fx_net_harmonics(net) : 0;
    const uint64_t products = sf_add_u64(sf_multiply_u64((n_in - once) * n_out, counts->samples),
                                         sf_multiply_u64(once * n_out, counts->rays));
    const uint64_t hidden = sf_multiply_u64(l == FX_C3 ? 0 : l == FX_D2 ? (uint64_t)n_h : n_out, counts->samples);
    e[l][0][SF_PART_MAC] = e[l][0][SF_PART_WEIGHT] = products;
    e[l][0][SF_PART_STATE] = sf_multiply_u64(hidden, 2);
    e[l][0][SF_PART_NEURON] = hidden;
    e[l][0][SF_PART_SPECIAL] = counts->layer[l].special[0];
  }
  add_traffic(traffic, e);
}

/* ---- prices ---- */

static int bits_of(int n) /* ceil(log2 n) */
{
  int bits = 0;
  while (1 << bits < n) bits++;
  return bits;
}

int sf_sum_bits(const fx_layer *layer, bool of_products)
{
  return SF_WEIGHT_BITS + (of_products ? SF_INPUT_BITS - 1 : 0) + bits_of(layer->n_in);
}

/* Adding up: n adders of `bits`. */
static uint64_t adds(const sf_technology *tech, int n, int bits, bool *interpolated)
{
  return (uint64_t)n * sf_price_add(tech, bits, interpolated);
}

enum { ACTIVATION_BITS = 8, TWIN_SUM_BITS = 32, REQUANTISE_BITS = 16, K_BITS = SF_LEAK_FRAC + 1 };
enum { TABLE_ENTRIES = 257, TABLE_ENTRY_BYTES = 4, SCALE_BITS = 16, FRACTION_BITS = 12 };

/* Scale the argument, read two neighbours of the table, interpolate between them: two multiplications, two additions.
 */
static uint64_t special_fj(const sf_technology *tech, int argument_bits, int result_bits, bool *interpolated)
{
  return sf_price_multiply(tech, argument_bits, SCALE_BITS, interpolated) +
         sf_price_multiply(tech, SCALE_BITS, FRACTION_BITS, interpolated) + adds(tech, 2, result_bits, interpolated) +
         2 * TABLE_ENTRY_BYTES * sf_price_byte(tech, TABLE_ENTRIES * TABLE_ENTRY_BYTES, interpolated);
}

/* Difference from the membrane times the leak, added; compared with the threshold, which a spike takes off. The
 * integrators of D2 and C3 neither compare nor reset. */
static uint64_t neuron_fj(const sf_technology *tech, int l, bool *interpolated)
{
  const bool spiking = fx_layer_fires(l);
  const int bits = fx_layer_table[l].state_bits;
  return sf_price_multiply(tech, bits, K_BITS, interpolated) + adds(tech, spiking ? 4 : 2, bits, interpolated);
}

static uint64_t integer_fj(const sf_technology *tech, const fx_net *net, int ledger, int l, int part,
                           bool *interpolated)
{
  const fx_layer *layer = &net->layer[l];
  const bool twin = is_twin(ledger);
  const int result_bits = l == FX_D2 ? SF_SIGMA_BITS : SF_COLOUR_BITS;
  uint64_t measured;
  if (sf_operation_measured(tech, twin, l, part, &measured)) return measured;
  switch (part) {
  case SF_PART_MAC:
    if (twin)
      return sf_price_multiply(tech, ACTIVATION_BITS, SF_WEIGHT_BITS, interpolated) +
             adds(tech, 1, TWIN_SUM_BITS, interpolated);
    return sf_price_multiply(tech, SF_INPUT_BITS, SF_WEIGHT_BITS, interpolated) +
           adds(tech, 1, sf_sum_bits(layer, true), interpolated);
  case SF_PART_SOP:
    return adds(tech, 1, sf_sum_bits(layer, false), interpolated);
  case SF_PART_WEIGHT:
    return sf_price_byte(tech, (uint64_t)layer->n_in * (uint64_t)layer->n_out, interpolated);
  case SF_PART_STATE:
    return sf_price_byte(tech, (uint64_t)layer->n_out * (twin ? 1 : 4), interpolated);
  case SF_PART_NEURON:
    if (twin)
      return sf_price_multiply(tech, TWIN_SUM_BITS, REQUANTISE_BITS, interpolated) +
             adds(tech, 1, TWIN_SUM_BITS, interpolated);
    return neuron_fj(tech, l, interpolated);
  case SF_PART_SPECIAL:
    return special_fj(tech, twin ? TWIN_SUM_BITS : sf_sum_bits(layer, false), result_bits, interpolated);
  default:
    return 0;
  }
}

static uint64_t outside_fj(const sf_technology *tech, int row, int part, uint64_t table_size, bool *interpolated)
{
  if (row == SF_ROW_FIELD && part == SF_PART_TABLE) return sf_price_byte(tech, table_size, interpolated);
  if (row == SF_ROW_RAY && part == SF_PART_FRAME) return sf_price_byte(tech, UINT64_MAX, interpolated);
  uint64_t measured;
  if (row == SF_ROW_RAY && part == SF_PART_SPECIAL && sf_operation_measured(tech, false, row, part, &measured))
    return measured;
  if (row == SF_ROW_RAY && part == SF_PART_SPECIAL) return special_fj(tech, SF_TRANS_FRAC, SF_TRANS_FRAC, interpolated);
  return 0;
}

static bool priced(int ledger, int part)
{
  if (part == SF_PART_MAC || part == SF_PART_SOP) return true;
  if (part == SF_PART_NEURON || part == SF_PART_SPECIAL) return has_neurons(ledger);
  return has_memory(ledger);
}

static sf_unit_price unit_price(const sf_technology *tech, const fx_net *net, uint64_t table_size, int ledger, int row,
                                int part)
{
  sf_unit_price unit = {0, false};
  if (!priced(ledger, part)) return unit;
  if (row >= SF_LAYERS)
    unit.fj = outside_fj(tech, row, part, table_size, &unit.interpolated);
  else if (net->layer[row].n_out == 0)
    return unit;
  else if (is_integer(ledger))
    unit.fj = integer_fj(tech, net, ledger, row, part, &unit.interpolated);
  else /* these families have one price each and stand first */
    unit.fj = tech->price[part == SF_PART_MAC ? SF_PRICE_FP32_MAC : SF_PRICE_FP32_ADD].fj;
  return unit;
}

/* ---- ledgers ---- */

static bool price_ledger(sf_ledgers *to, int ledger, const event_table events)
{
  bool fits = true;
  for (int r = 0; r < SF_ROWS; r++)
    for (int t = 0; t < SF_T_MAX; t++)
      for (int p = 0; p < SF_PARTS; p++) {
        const uint64_t n = events[r][t][p], fj = sf_multiply_u64(n, to->unit[ledger][r][p].fj);
        if (n == 0) continue;
        to->cell[ledger][r][t] = sf_add_u64(to->cell[ledger][r][t], fj);
        to->part[ledger][p] = sf_add_u64(to->part[ledger][p], fj);
        to->total[ledger] = sf_add_u64(to->total[ledger], fj);
        to->interpolated[ledger] |= to->unit[ledger][r][p].interpolated;
        fits = fits && to->total[ledger] != UINT64_MAX;
      }
  return fits;
}

typedef struct book {
  const fx_net *net;
  uint64_t table_size;
  event_table spiking, twin, hoisted;
} book;

static const uint64_t (*events_of(const book *b, int ledger))[SF_T_MAX][SF_PARTS]
{
  if (!is_twin(ledger)) return (const uint64_t(*)[SF_T_MAX][SF_PARTS])b->spiking;
  return (const uint64_t(*)[SF_T_MAX][SF_PARTS])(ledger == SF_LEDGER_ANN ? b->twin : b->hoisted);
}

static bool price_all(const book *b, const sf_technology *tech, sf_ledgers *to)
{
  bool fits = true;
  for (int g = 0; g < SF_LEDGERS; g++) {
    for (int r = 0; r < SF_ROWS; r++)
      for (int p = 0; p < SF_PARTS; p++) to->unit[g][r][p] = unit_price(tech, b->net, b->table_size, g, r, p);
    fits = price_ledger(to, g, events_of(b, g)) && fits;
  }
  for (int g = 0; g < SF_LEDGERS; g++) {
    const int baseline = sf_ledger_texts[g].baseline;
    to->saving[g] = baseline < 0 ? NAN : sf_saving_percent(to->total[g], to->total[baseline]);
  }
  return fits;
}

/* What a ledger spends on spikes: the SOPs, and the weights of the layers that spikes read. */
static double spike_driven(const book *b, const sf_ledgers *l, int ledger)
{
  double fj = (double)l->part[ledger][SF_PART_SOP];
  for (int r = 0; r < SF_LAYERS; r++)
    for (int t = 0; t < SF_T_MAX && fx_layer_reads_spikes(r); t++)
      fj += (double)b->spiking[r][t][SF_PART_WEIGHT] * (double)l->unit[ledger][r][SF_PART_WEIGHT].fj;
  return fj;
}

static void break_even(const book *b, sf_ledgers *l)
{
  for (int i = 0; i < SF_BREAK_EVENS; i++) {
    const bool last = i == SF_SPIKING_LEDGERS;
    sf_break_even *e = &l->break_even[i];
    e->ledger = last ? SF_LEDGER_NEURON : i;
    e->twin = last ? SF_LEDGER_ANN : sf_ledger_texts[i].baseline;
    const double spikes = spike_driven(b, l, e->ledger);
    const double rest = (double)l->total[e->twin] - ((double)l->total[e->ledger] - spikes);
    e->rate = spikes > 0 && rest >= 0 ? l->rate * rest / spikes : NAN;
  }
}

/* A saving that is not defined does not move. */
static double change(double from, double to)
{
  return isnan(from) || isnan(to) ? 0 : fabs(to - from);
}

static bool scaled(const book *b, const sf_ledgers *base, int price, int halves, sf_ledgers *scratch,
                   double saving[SF_SPIKING_LEDGERS])
{
  memset(scratch, 0, sizeof *scratch);
  scratch->technology = base->technology;
  scratch->technology.price[price].fj = scratch->technology.price[price].fj * (uint64_t)halves / 2;
  const bool fits = price_all(b, &scratch->technology, scratch);
  memcpy(saving, scratch->saving, SF_SPIKING_LEDGERS * sizeof *saving);
  return fits;
}

static int larger_swing(const void *a, const void *b)
{
  const sf_sensitivity *x = a, *y = b;
  if (x->swing != y->swing) return x->swing < y->swing ? 1 : -1;
  return x->price - y->price;
}

static bool sensitivity(const book *b, sf_ledgers *l, sf_ledgers *scratch)
{
  bool fits = true;
  l->sensitivities = l->technology.count;
  for (int i = 0; i < l->sensitivities; i++) {
    sf_sensitivity *s = &l->sensitivity[i];
    *s = (sf_sensitivity){.price = i};
    fits = scaled(b, l, i, 1, scratch, s->less) && scaled(b, l, i, 3, scratch, s->more) && fits;
    for (int g = 0; g < SF_SPIKING_LEDGERS; g++) {
      const double swing = fmax(change(l->saving[g], s->less[g]), change(l->saving[g], s->more[g]));
      if (swing > s->swing) s->swing = swing, s->ledger = g;
    }
  }
  qsort(l->sensitivity, (size_t)l->sensitivities, sizeof *l->sensitivity, larger_swing);
  return fits;
}

static double firing_rate(const fx_counts *counts)
{
  double spikes = 0, updates = 0;
  for (int s = 0; s < FX_SPIKING; s++) {
    const fx_layer_counts *c = &counts->layer[fx_spiking_layers[s]];
    for (int t = 0; t < SF_T_MAX; t++) spikes += (double)c->spikes[t], updates += (double)c->updates[t];
  }
  return updates > 0 ? spikes / updates : 0;
}

sf_status sf_ledgers_make(const sf_technology *technology, const fx_net *net, const fx_counts *counts,
                          const sf_traffic *traffic, uint64_t table_size, sf_ledgers *ledgers)
{
  book *b = calloc(1, sizeof *b);
  sf_ledgers *scratch = calloc(1, sizeof *scratch);
  bool fits = false, memory = b && scratch;
  if (memory) {
    *b = (book){.net = net, .table_size = table_size};
    spiking_events(counts, traffic, b->spiking);
    twin_events(net, counts, traffic, false, b->twin);
    twin_events(net, counts, traffic, true, b->hoisted);
    memset(ledgers, 0, sizeof *ledgers);
    ledgers->technology = *technology, ledgers->steps = net->steps, ledgers->rate = firing_rate(counts);
    fits = price_all(b, technology, ledgers);
    break_even(b, ledgers);
    fits = sensitivity(b, ledgers, scratch) && fits;
  }
  free(b), free(scratch);
  if (!memory) return sf_fail(SF_E_MEMORY, "audit: no memory for the ledgers");
  if (!fits)
    return sf_fail(SF_E_RANGE,
                   "audit: with the prices of %s the energy of %llu samples does not fit in 64 bits of fJ; audit fewer "
                   "views",
                   technology->name, (unsigned long long)counts->samples);
  return sf_ok();
}
