/* Events times prices. A ledger is one list of prices per row and part, laid over the counts of the spiking net or of
 * its twin; everything else (savings, break-even, sensitivity) follows from these products. */
#include "energy/energy.h"
#include "base/saturate.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

const char *sf_row_name(int row)
{
  return row < SF_LAYERS ? fx_layer_name(row) : row == SF_ROW_FIELD ? "field" : "ray";
}

const char *const sf_part_names[SF_PARTS] = {"mac",   "sop",    "weight",  "state",   "lookup", "fill",
                                             "frame", "neuron", "special", "product", "place"};
const char *const sf_part_titles[SF_PARTS] = {"MAC",
                                              "SOP",
                                              "weight rows",
                                              "register files",
                                              "field look-ups",
                                              "field lines from DRAM",
                                              "frame writes",
                                              "neuron updates",
                                              "special functions",
                                              "field and ray products",
                                              "places and harmonics"};

const sf_ledger_text sf_ledger_texts[SF_LEDGERS] = {
    {"paper", "paper", "MAC and SOP at the prices of fp32 operations, nothing else", SF_LEDGER_ANN},
    {"width", "width-correct", "MAC and SOP at integer prices for the widths of the hardware", SF_LEDGER_INT},
    {"memory", "+ memory", "and every access: rows of weights, membranes, the field's cache and DRAM, the frame",
     SF_LEDGER_INT_MEMORY},
    {"neuron", "everything", "and neurons, special functions, the arithmetic of field and ray", SF_LEDGER_INT_ALL},
    {"shared", "16 samples share", "and everything, but 16 samples share a read of a row of weights",
     SF_LEDGER_INT_SHARED},
    {"ann_fp32", "fp32 ReLU twin", "the ReLU net of the same sizes on the same samples: every synapse an fp32 MAC", -1},
    {"ann_int", "integer ReLU twin", "the same in int8 x int8 + int32, the direction's products once per ray", -1},
    {"ann_int_memory", "ReLU twin + memory", "and every access, activations in place of membranes", -1},
    {"ann_int_all", "ReLU twin, all", "and ReLU, requantisation, special functions, the arithmetic of field and ray",
     -1},
    {"ann_int_shared", "ReLU twin, shared", "and everything, but 16 samples share a read of a row of weights", -1}};

static bool shares_rows(int ledger)
{
  return ledger == SF_LEDGER_SHARED || ledger == SF_LEDGER_INT_SHARED;
}

/* ---- events ---- */

/* Events by row, step and part: what the prices multiply. */
typedef uint64_t event_table[SF_ROWS][SF_T_MAX][SF_PARTS];

enum { WORD_BYTES = 8 };

static void add_traffic(const sf_traffic *traffic, event_table e)
{
  e[SF_ROW_FIELD][0][SF_PART_LOOKUP] = traffic->lookups;
  e[SF_ROW_FIELD][0][SF_PART_FILL] = traffic->misses;
  e[SF_ROW_FIELD][0][SF_PART_PRODUCT] = traffic->products;
  e[SF_ROW_FIELD][0][SF_PART_PLACE] = traffic->places;
  e[SF_ROW_FIELD][0][SF_PART_SPECIAL] = traffic->special;
  e[SF_ROW_RAY][0][SF_PART_SPECIAL] = e[SF_ROW_RAY][0][SF_PART_PRODUCT] = traffic->exp_neg;
  e[SF_ROW_RAY][0][SF_PART_PLACE] = traffic->harmonics;
  e[SF_ROW_RAY][0][SF_PART_FRAME] = traffic->frame_bytes / WORD_BYTES;
}

/* Whole rows are read, so the bytes are a multiple of a row's. */
static uint64_t rows_of(const fx_layer *layer, uint64_t bytes)
{
  return layer->n_out ? bytes / (uint64_t)layer->n_out : 0;
}

/* Updates that also read their state: all but the first one of a sample. */
static uint64_t states_read(const fx_layer_counts *c, int t)
{
  return c->updates[t] ? c->state_r[t] / (c->state_w[t] / c->updates[t]) : 0;
}

static void spiking_events(const sf_counted *counted, event_table e)
{
  memset(e, 0, sizeof(event_table));
  for (int l = 0; l < SF_LAYERS; l++)
    for (int t = 0; t < SF_T_MAX; t++) {
      const fx_layer_counts *c = &counted->counts->layer[l];
      e[l][t][SF_PART_MAC] = c->mac[t];
      e[l][t][SF_PART_SOP] = c->sop[t];
      e[l][t][SF_PART_WEIGHT] = rows_of(&counted->scene->net.layer[l], c->weight[t]);
      e[l][t][SF_PART_STATE] = sf_add_u64(c->updates[t], states_read(c, t));
      e[l][t][SF_PART_NEURON] = c->updates[t];
      e[l][t][SF_PART_SPECIAL] = c->special[t];
    }
  add_traffic(counted->traffic, e);
}

/* Evaluations of a layer's function in one step: all steps have as many, or none. */
static uint64_t special_once(const fx_layer_counts *c)
{
  uint64_t most = 0;
  for (int t = 0; t < SF_T_MAX; t++)
    if (c->special[t] > most) most = c->special[t];
  return most;
}

/* The twin does in one step what the net does in t_r: each synapse a MAC, each hidden activation written and read once
 * as a byte, then requantised; the special functions of one step. hoisted: the direction's products once per ray. */
static void twin_events(const sf_counted *counted, bool hoisted, event_table e)
{
  const fx_net *net = &counted->scene->net;
  const fx_counts *counts = counted->counts;
  const int n_h = fx_net_h(net);
  memset(e, 0, sizeof(event_table));
  for (int l = 0; l < SF_LAYERS; l++) {
    const fx_layer *size = &net->layer[l];
    const uint64_t n_in = (uint64_t)size->n_in, n_out = (uint64_t)size->n_out;
    const uint64_t once = hoisted && l == FX_C1 ? (uint64_t)fx_net_harmonics(net) : 0;
    const uint64_t products = sf_add_u64(sf_multiply_u64((n_in - once) * n_out, counts->samples),
                                         sf_multiply_u64(once * n_out, counts->rays));
    const uint64_t hidden = sf_multiply_u64(l == FX_C3 ? 0 : l == FX_D2 ? (uint64_t)n_h : n_out, counts->samples);
    e[l][0][SF_PART_MAC] = products;
    e[l][0][SF_PART_WEIGHT] = rows_of(size, products);
    e[l][0][SF_PART_STATE] = sf_multiply_u64(hidden, 2);
    e[l][0][SF_PART_NEURON] = hidden;
    e[l][0][SF_PART_SPECIAL] = special_once(&counts->layer[l]);
  }
  add_traffic(counted->traffic, e);
}

/* A row that values need is read once for each group of samples, the direction's once for as many rays; of spikes the
 * rows that were counted, and the biases. dense: every row. */
static void share_rows(const sf_counted *counted, bool dense, event_table e)
{
  const fx_net *net = &counted->scene->net;
  const uint64_t groups = counted->memory->groups, rays = (counted->counts->rays + FX_SHARED - 1) / FX_SHARED;
  for (int l = 0; l < SF_LAYERS; l++) {
    const fx_layer *layer = &net->layer[l];
    const uint64_t of_ray = l == FX_C1 ? (uint64_t)fx_net_harmonics(net) : 0, bias = !dense && layer->bias;
    uint64_t rows = sf_multiply_u64((uint64_t)layer->n_in - of_ray, groups);
    if (!dense && fx_layer_reads_spikes(l))
      for (int s = 0; s < FX_SPIKING; s++)
        if (fx_spiking_layers[s] == fx_layer_table[l].spikes_of) rows = counted->memory->rows[s];
    for (int t = 0; t < SF_T_MAX; t++) e[l][t][SF_PART_WEIGHT] = 0;
    if (!layer->n_out) continue;
    e[l][0][SF_PART_WEIGHT] = rows + of_ray * rays + bias * (of_ray ? rays : groups);
  }
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

uint64_t sf_ledger_fj(const sf_technology *technology, const sf_counted *counted, int ledger)
{
  event_table events = {{{0}}};
  uint64_t total = 0;
  spiking_events(counted, events);
  if (shares_rows(ledger)) share_rows(counted, false, events);
  for (int r = 0; r < SF_ROWS; r++)
    for (int p = 0; p < SF_PARTS; p++) {
      const uint64_t fj = sf_unit_price_of(technology, counted, ledger, r, p).fj;
      for (int t = 0; t < SF_T_MAX; t++) total = sf_add_u64(total, sf_multiply_u64(events[r][t][p], fj));
    }
  return total;
}

typedef enum { NET, NET_SHARED, TWIN, TWIN_HOISTED, TWIN_SHARED, TABLES } table_id;
typedef struct book {
  sf_counted counted;
  event_table events[TABLES];
} book;

static const uint64_t (*events_of(const book *b, int ledger))[SF_T_MAX][SF_PARTS]
{
  const bool shared = shares_rows(ledger);
  table_id table = shared ? NET_SHARED : NET;
  if (sf_ledger_is_twin(ledger)) table = shared ? TWIN_SHARED : ledger == SF_LEDGER_ANN ? TWIN : TWIN_HOISTED;
  return (const uint64_t(*)[SF_T_MAX][SF_PARTS])b->events[table];
}

static void open_book(book *b, const sf_counted *counted)
{
  b->counted = *counted;
  spiking_events(counted, b->events[NET]);
  spiking_events(counted, b->events[NET_SHARED]);
  twin_events(counted, false, b->events[TWIN]);
  twin_events(counted, true, b->events[TWIN_HOISTED]);
  twin_events(counted, true, b->events[TWIN_SHARED]);
  share_rows(counted, false, b->events[NET_SHARED]);
  share_rows(counted, true, b->events[TWIN_SHARED]);
}

static bool price_all(const book *b, const sf_technology *tech, sf_ledgers *to)
{
  bool fits = true;
  for (int g = 0; g < SF_LEDGERS; g++) {
    for (int r = 0; r < SF_ROWS; r++)
      for (int p = 0; p < SF_PARTS; p++) to->unit[g][r][p] = sf_unit_price_of(tech, &b->counted, g, r, p);
    fits = price_ledger(to, g, events_of(b, g)) && fits;
  }
  for (int g = 0; g < SF_LEDGERS; g++) {
    const int baseline = sf_ledger_texts[g].baseline;
    to->saving[g] = baseline < 0 ? NAN : sf_saving_percent(to->total[g], to->total[baseline]);
  }
  return fits;
}

/* What spikes cost at `scale` times the measured rate: SOPs and rows of weights grow with it. A row is read once for a
 * sample, however often its neuron fires, so rows are at most all of them. */
static double spikes_cost(const book *b, const sf_ledgers *l, int ledger, double scale)
{
  double fj = scale * (double)l->part[ledger][SF_PART_SOP];
  for (int r = 0; r < SF_LAYERS; r++) {
    double rows = 0;
    if (!fx_layer_reads_spikes(r)) continue;
    for (int t = 0; t < SF_T_MAX; t++) rows += (double)b->events[NET][r][t][SF_PART_WEIGHT];
    const double all = fmax((double)b->events[TWIN][r][0][SF_PART_WEIGHT], rows); /* a bias is one more */
    fj += fmin(scale * rows, all) * (double)l->unit[ledger][r][SF_PART_WEIGHT].fj;
  }
  return fj;
}

/* The scale at which spikes cost so much: the cost grows, and between rows that are all read evenly. */
static double scale_of(const book *b, const sf_ledgers *l, int ledger, double fj)
{
  double low = 0, high = 1;
  if ((double)l->part[ledger][SF_PART_SOP] <= 0) return NAN;
  while (spikes_cost(b, l, ledger, high) < fj) high *= 2;
  for (int i = 0; i < 200 && low < high; i++) {
    const double middle = 0.5 * (low + high);
    *(spikes_cost(b, l, ledger, middle) < fj ? &low : &high) = middle;
  }
  return high;
}

static void break_even(const book *b, sf_ledgers *l)
{
  for (int i = 0; i < SF_BREAK_EVENS; i++) {
    const bool last = i == SF_OWN_BREAK_EVENS;
    sf_break_even *e = &l->break_even[i];
    e->ledger = last ? SF_LEDGER_NEURON : i;
    e->twin = last ? SF_LEDGER_ANN : sf_ledger_texts[i].baseline;
    const double spikes = spikes_cost(b, l, e->ledger, 1);
    const double rest = (double)l->total[e->twin] - ((double)l->total[e->ledger] - spikes);
    e->rate = rest >= 0 ? l->rate * scale_of(b, l, e->ledger, rest) : NAN;
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

sf_status sf_ledgers_make(const sf_technology *technology, const sf_counted *counted, sf_ledgers *ledgers)
{
  book *b = calloc(1, sizeof *b);
  sf_ledgers *scratch = calloc(1, sizeof *scratch);
  bool fits = false, memory = b && scratch;
  if (memory) {
    open_book(b, counted);
    memset(ledgers, 0, sizeof *ledgers);
    ledgers->technology = *technology, ledgers->steps = counted->scene->net.steps;
    ledgers->rate = firing_rate(counted->counts);
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
                   technology->name, (unsigned long long)counted->counts->samples);
  return sf_ok();
}
