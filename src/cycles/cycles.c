/* Each struct below mirrors the registers of one RTL module, and each function what they become at a clock edge. */
#include "cycles/cycles.h"

#include <stdlib.h>
#include <string.h>

enum {
  RING = 32,     /* samples inside the block, and the next ones to send; a power of two */
  DEPTH = 6,     /* stages of the neurons (rtl/sf_neurons.sv) */
  DENSITIES = 8, /* rtl/sf_readout.sv */
  STAGES = 16,
  STEP_CYCLES = 5, /* of a step's accumulators */
  COLOURS = 3,
  NARROW_BANKS = 4 /* of D2 and C3 (rtl/sf_core.sv) */
};

/* rtl/sf_stream_in.sv */
typedef struct input {
  uint32_t begun, beat, full; /* full: 0..2 buffers */
  uint32_t sent;              /* sample whose packet is at work */
} input;

/* rtl/sf_values.sv */
typedef struct values {
  enum { NONE, FEATURES, CONSTANTS, STATES } job;
  uint32_t row, part, step, d1_sample, c1_sample;
  bool full[FX_SPIKING]; /* sums of D1, of C1 */
  bool op[3], busy[2], ray;
} values;

/* Whose neurons step (rtl/sf_core.sv), and what is on its way to them and through them (rtl/sf_neurons.sv). */
typedef struct turn {
  bool valid, last;
  uint8_t layer, step, group;
} turn;

typedef struct neurons {
  bool active, released;
  uint32_t layer, step, group, wait;
  turn way[4 + DEPTH - 1];
  bool load_c2, counted; /* the last turn loaded sums of C2; spikes are counted */
  uint32_t load_part;
} neurons;

/* rtl/sf_spikes.sv */
typedef struct spikes {
  uint32_t taken, full, group, sample; /* of the group that comes next */
  bool have, last_group, bias;
  uint64_t left; /* neurons of the group at hand */
  uint32_t at_group, at_sample;
  bool valid, item_bias, item_last; /* what is offered */
  uint8_t item_fired;
} spikes;

/* rtl/sf_sums.sv */
typedef struct sums {
  bool fresh, busy;
  uint8_t left;
  uint32_t part, full;
} sums;

/* Sums of D2 or C3 on their way out, a step per cycle (rtl/sf_core.sv). */
typedef struct reader {
  bool reading, way[3], way_last[3];
  uint32_t step;
} reader;

/* rtl/sf_readout.sv */
typedef struct readout {
  bool density_taken, colour_taken, density_full, colour_full;
  bool run, colour, busy, done;
  uint32_t step, slot, room, count;
  struct {
    bool valid, colour, last;
  } stage[STAGES];
} readout;

/* rtl/sf_stream_out.sv */
typedef struct output {
  bool full, second;
} output;

enum { D2, C2, C3, FED = FX_SPIKING }; /* layers fed by the spikes of D1, C1, C2 */

typedef struct state {
  uint32_t added; /* samples given so far */
  input in;
  values mac;
  neurons neuron;
  spikes spike[FED];
  sums sum[FED];
  reader read_d2, read_c3;
  uint32_t h_taken, h_full;
  readout read;
  output out;
} state;

struct sf_cycle_model {
  uint32_t n_feature, n_dir, n_h, steps, neurons;
  uint32_t last_group[FX_SPIKING], last_part[FX_SPIKING], part_groups;
  uint32_t banks[FED], parts[FED]; /* parts: the last one */
  bool bias[FED];
  bool decodes, biased; /* C1 takes its inputs from the buffer; its biases take a row */
  state now;
  sf_cycle_totals totals;
  sf_cycle_sample ring[RING];
};

sf_cycle_model *sf_cycle_model_create(const fx_net *net, const sf_engine *engine)
{
  sf_cycle_model *m = calloc(1, sizeof *m);
  if (!m) return NULL;
  m->n_feature = (uint32_t)net->layer[FX_D1].n_in;
  m->n_h = (uint32_t)fx_net_h(net);
  m->n_dir = (uint32_t)fx_net_constants(net);
  m->decodes = fx_net_constants_per_sample(net);
  m->biased = net->layer[FX_C1].bias != 0;
  m->steps = (uint32_t)net->steps;
  m->neurons = (uint32_t)engine->neurons;
  m->part_groups = (uint32_t)(engine->macs / engine->neurons);
  for (int s = 0; s < FX_SPIKING; s++) {
    const int last = net->layer[fx_spiking_layers[s]].n_out - 1;
    m->last_group[s] = last < 0 ? 0 : (uint32_t)(last / engine->neurons);
    m->last_part[s] = last < 0 ? 0 : (uint32_t)(last / engine->macs);
    m->banks[s] = s == C2 ? (uint32_t)engine->steps_at_once : NARROW_BANKS;
    m->bias[s] = net->layer[fx_spiking_layers[s] + 1].bias != 0;
    m->now.sum[s].fresh = true;
  }
  m->parts[C2] = m->last_part[2];
  m->now.read.room = DENSITIES;
  return m;
}

void sf_cycle_model_free(sf_cycle_model *model)
{
  free(model);
}

const sf_cycle_totals *sf_cycle_model_totals(const sf_cycle_model *model)
{
  return &model->totals;
}

sf_cycle_sample sf_cycle_sample_make(const fx_net *net, const fx_trace *trace, bool first)
{
  sf_cycle_sample s = {.first = first};
  for (int l = 0; l < FX_SPIKING; l++)
    for (int t = 0; t < net->steps; t++)
      for (int n = 0; n < net->layer[fx_spiking_layers[l]].n_out; n++)
        s.fired[l][n] |= (uint8_t)((trace->spikes[fx_spiking_layers[l]][t][n / 64] >> (n % 64) & 1) << t);
  return s;
}

static const sf_cycle_sample *sample(const sf_cycle_model *m, uint32_t number)
{
  return &m->ring[number % RING];
}

/* ---- one clock edge: `was` is the state before it ---- */

static bool values_idle(const values *v)
{
  return v->job == NONE && !v->full[0] && !v->full[1] && !v->op[0] && !v->op[1] && !v->op[2] && !v->busy[0] &&
         !v->busy[1] && !v->ray;
}

static bool active(const state *s)
{
  bool busy = s->in.begun || s->in.full || s->out.full || s->h_taken || !values_idle(&s->mac);
  for (int l = 0; l < FED; l++) {
    busy = busy || !s->sum[l].fresh || s->sum[l].part || s->sum[l].full || s->sum[l].busy;
    busy = busy || s->spike[l].taken || s->spike[l].have || s->spike[l].valid;
  }
  busy = busy || s->neuron.active || s->neuron.counted;
  for (int i = 0; i < 4 + DEPTH - 1; i++) busy = busy || s->neuron.way[i].valid;
  for (int i = 0; i < 3; i++) busy = busy || s->read_d2.way[i] || s->read_c3.way[i];
  const readout *r = &s->read;
  for (int i = 0; i < STAGES; i++) busy = busy || r->stage[i].valid;
  return busy || r->density_taken || r->colour_taken || r->run || r->done || r->count;
}

static void tick_input(const sf_cycle_model *m, state *s, const state *was, bool done)
{
  const input *in = &was->in;
  s->in.full -= done;
  if (in->full == 2 || in->sent == was->added) return;
  const uint32_t n_dir = m->decodes || sample(m, in->sent)->first ? m->n_dir : 0;
  const uint32_t beats = (n_dir + 3) / 4 + (m->n_feature + 3) / 4;
  s->in.begun = in->beat + 1 < beats;
  s->in.beat = s->in.begun ? in->beat + 1 : 0;
  if (s->in.begun) return;
  s->in.full++;
  s->in.sent++;
}

static int job_of(const sf_cycle_model *m, const state *was)
{
  const values *v = &was->mac;
  if (v->job != NONE) return v->job;
  if ((m->decodes ? was->in.full : was->h_full) && !v->full[1])
    return m->decodes || sample(m, v->c1_sample)->first ? CONSTANTS : STATES;
  return was->in.full && !m->decodes && !v->full[0] ? FEATURES : NONE;
}

/* True where D1, or a decoder's C1, reads its inputs for the last time. */
static bool tick_values(const sf_cycle_model *m, state *s, const state *was, bool load)
{
  const values *v = &was->mac;
  values *to = &s->mac;
  const int job = job_of(m, was);
  const bool go = job != NONE && !load;
  const uint32_t n_dir = job == FEATURES && sample(m, v->d1_sample)->first ? m->n_dir : 0;
  const uint32_t rows = job == FEATURES ? m->n_feature : job == CONSTANTS ? m->n_dir + m->biased : m->n_h;
  const bool is_row = v->row < rows, last_row = v->row + 1 >= rows && v->row + 1 >= n_dir;
  const bool last_part = v->part == m->last_part[job == FEATURES ? 0 : 1];
  const bool last_step = job != STATES || v->step + 1 == m->steps, last = last_row && last_part && last_step;
  const bool ends = go && last && (job != CONSTANTS || m->decodes);
  to->op[0] = go && (job != FEATURES || is_row), to->op[1] = v->op[0], to->op[2] = v->op[1];
  to->busy[0] = go && is_row && job == FEATURES, to->busy[1] = go && is_row && job != FEATURES;
  to->ray = go && last && job == CONSTANTS && !m->decodes;
  if (go) {
    to->job = !last ? job : job == CONSTANTS && !m->decodes ? STATES : NONE;
    to->step = last_step ? 0 : v->step + 1;
    if (last_step) to->part = last_part ? 0 : v->part + 1;
    if (last_step && last_part) to->row = last_row ? 0 : v->row + 1;
  }
  if (ends) to->full[job != FEATURES] = true, *(job == FEATURES ? &to->d1_sample : &to->c1_sample) += 1;
  if (ends && job == STATES) s->h_full--, s->h_taken--;
  return ends && job != STATES;
}

/* Whose neurons step: the layer nearest to the output goes first. True where sums of D1 or C1 are loaded. */
static bool tick_neurons(const sf_cycle_model *m, state *s, const state *was)
{
  const neurons *n = &was->neuron;
  neurons *to = &s->neuron;
  const bool want[FX_SPIKING] = {was->mac.full[0] && was->spike[D2].taken < 2,
                                 was->mac.full[1] && was->spike[C2].taken < 2,
                                 was->sum[C2].full && !n->released && was->spike[C3].taken < 2};
  const uint32_t layer = n->active ? n->layer : want[2] ? 2 : want[1] ? 1 : 0;
  const bool run = n->active ? n->wait == 0 : want[0] || want[1] || want[2];
  const uint32_t last_group = m->last_group[layer], part = n->group / m->part_groups;
  const bool group_ends = n->group == last_group, last_step = n->step + 1 == m->steps;
  const bool stays =
      (layer == 0 || (layer == 1 && m->decodes)) && m->last_part[layer] == 0; /* one current, all steps */
  const bool load = run && n->group % m->part_groups == 0 && !(stays && n->step);
  const bool taken = load && (last_step || stays) && part == m->last_part[layer];
  memmove(&to->way[1], &n->way[0], sizeof to->way - sizeof to->way[0]);
  to->way[0] = (turn){run, group_ends, (uint8_t)layer, (uint8_t)n->step, (uint8_t)n->group};
  to->counted = n->way[4 + DEPTH - 2].valid;
  to->released = taken && layer == 2;
  to->load_c2 = load && layer == 2;
  if (run && !n->active) s->spike[layer].taken++;
  if (taken && layer < 2) s->mac.full[layer] = false;
  if (run) {
    to->active = !(group_ends && last_step);
    to->layer = layer;
    to->group = group_ends ? 0 : n->group + 1;
    if (group_ends) to->step = last_step ? 0 : n->step + 1;
    if (group_ends && !last_step && last_group < DEPTH - 1) to->wait = DEPTH - 1 - last_group;
  } else if (n->wait) {
    to->wait = n->wait - 1;
  }
  return load && layer < 2;
}

static uint64_t fires(const sf_cycle_model *m, int l, uint32_t number, uint32_t group)
{
  uint64_t all = 0;
  for (uint32_t u = 0; u < m->neurons && group * m->neurons + u < SF_LANES; u++)
    all |= (uint64_t)(sample(m, number)->fired[l][group * m->neurons + u] != 0) << u;
  return all;
}

static void tick_spikes(const sf_cycle_model *m, state *s, const state *was, int l, bool next)
{
  const spikes *k = &was->spike[l];
  spikes *to = &s->spike[l];
  const turn *out = &was->neuron.way[4 + DEPTH - 2];
  const bool room = !k->valid || next, any = k->left != 0;
  const uint64_t rest = k->left & (k->left - 1);
  const bool worked_off = k->have && !k->bias && !rest && (room || (!any && !k->last_group));
  const bool offers = k->have && room && (k->bias || any || k->last_group);
  const bool load = k->full && (!k->have || worked_off), load_last = load && k->group == m->last_group[l];
  to->taken -= load_last;
  to->full += out->valid && out->layer == l && out->step + 1U == m->steps && out->group == m->last_group[l];
  to->full -= load_last;
  to->have = load || (k->have && !worked_off);
  to->valid = offers || (k->valid && !next);
  if (room) {
    to->item_bias = k->bias;
    to->item_last = k->last_group && !k->bias && !rest;
    to->item_fired = k->bias ? (uint8_t)((1U << m->steps) - 1) : 0;
    if (any && !k->bias)
      to->item_fired = sample(m, k->at_sample)->fired[l][k->at_group * m->neurons + (uint32_t)__builtin_ctzll(k->left)];
  }
  if (load) {
    to->left = fires(m, l, k->sample, k->group);
    to->at_group = k->group, to->at_sample = k->sample;
    to->last_group = load_last;
    to->bias = m->bias[l] && k->group == 0;
    to->group = load_last ? 0 : k->group + 1;
    to->sample += load_last;
  } else {
    if (room && !k->bias) to->left = rest;
    if (room) to->bias = false;
  }
}

/* True where what is offered is worked off. */
static bool tick_sums(const sf_cycle_model *m, state *s, const state *was, int l, bool load, bool release)
{
  const sums *a = &was->sum[l];
  sums *to = &s->sum[l];
  const spikes *item = &was->spike[l];
  const bool go = item->valid && a->full < 2 && !load, last_part = a->part == m->parts[l];
  const uint8_t steps = a->fresh ? item->item_fired : a->left;
  uint8_t left = steps;
  for (uint32_t b = 0; b < m->banks[l]; b++) {
    uint8_t bank = 0;
    for (uint32_t t = b; t < SF_T_MAX; t += m->banks[l]) bank |= (uint8_t)(1U << t);
    bank &= steps;
    left ^= bank & (uint8_t)-bank; /* the lowest step of each bank */
  }
  const bool next = go && !left && last_part;
  to->busy = go && steps;
  if (go) to->fresh = !left, to->left = left;
  if (go && !left) to->part = last_part ? 0 : a->part + 1;
  to->full += (next && item->item_last) - release;
  return next;
}

/* True where a step is loaded; *last: the sample's last. */
static bool tick_reader(const sf_cycle_model *m, reader *to, const reader *r, bool begins, bool *last)
{
  const bool load = begins || r->reading;
  *last = load && r->step + 1 == m->steps;
  to->reading = load && !*last;
  if (load) to->step = *last ? 0 : r->step + 1;
  to->way[2] = r->way[1], to->way_last[2] = r->way_last[1];
  to->way[1] = r->way[0], to->way_last[1] = r->way_last[0];
  to->way[0] = load, to->way_last[0] = *last;
  return load;
}

static void tick_readout(const sf_cycle_model *m, state *s, const state *was, bool density_begins, bool colour_begins,
                         sf_cycle_totals *totals)
{
  const readout *r = &was->read;
  readout *next = &s->read;
  const uint32_t last_out = r->colour ? COLOURS - 1 : 0;
  const bool last = r->slot == last_out && r->step + 1 == m->steps, ends = r->run && last, free_now = !r->run || last;
  const bool colour = free_now && r->colour_full && !r->busy;
  const bool density = free_now && !colour && r->density_full && !(r->run && !r->colour);
  const bool ready = !was->out.full || was->out.second, waits = r->done && (r->count || m->decodes);
  const bool out = waits && ready, pop = out && !m->decodes, writes = r->stage[STAGES - 1].valid;
  const bool writes_last = writes && r->stage[STAGES - 1].last, of_colour = r->stage[STAGES - 1].colour;
  const bool density_ends = ends && !r->colour, colour_ends = ends && r->colour;
  next->density_taken = density_begins || (r->density_taken && !density_ends);
  next->colour_taken = colour_begins || (r->colour_taken && !colour_ends);
  next->density_full = (was->read_d2.way[2] && was->read_d2.way_last[2]) || (r->density_full && !density_ends);
  next->colour_full = (was->read_c3.way[2] && was->read_c3.way_last[2]) || (r->colour_full && !colour_ends);
  memmove(&next->stage[1], &r->stage[0], sizeof r->stage - sizeof r->stage[0]);
  next->stage[0].valid = r->run && r->slot <= last_out;
  next->stage[0].colour = r->colour, next->stage[0].last = last;
  next->run = colour || density || (r->run && !last);
  if (colour || density) {
    next->colour = colour, next->step = next->slot = 0;
  } else if (r->run) {
    next->slot = r->slot + 1 == STEP_CYCLES ? 0 : r->slot + 1;
    next->step = r->step + (r->slot + 1 == STEP_CYCLES);
  }
  next->busy = colour || (r->busy && !out);
  next->done = (writes_last && of_colour) || (r->done && !out);
  next->room = r->room + pop - density_begins;
  next->count = r->count + (writes_last && !of_colour) - pop;
  totals->samples += out;
  if (ready) s->out.full = waits;
  if (was->out.full) s->out.second = !was->out.second;
}

static void tick(sf_cycle_model *m)
{
  const state was = m->now;
  state *s = &m->now;
  const bool at_work = active(&was), density_ready = !was.read.density_taken && was.read.room,
             colour_ready = !was.read.colour_taken;
  const bool d2_begins = !was.read_d2.reading && was.sum[D2].full && density_ready && was.h_taken < 2;
  const bool c3_begins = !was.read_c3.reading && was.sum[C3].full && colour_ready;
  bool d2_last, c3_last;
  m->totals.cycles += at_work;
  m->totals.waits += !was.in.full && at_work;
  m->totals.stalls += (was.sum[C3].full && !was.read_c3.reading && !colour_ready) ||
                      (was.sum[D2].full && !was.read_d2.reading && !density_ready);
  const bool d2_load = tick_reader(m, &s->read_d2, &was.read_d2, d2_begins, &d2_last);
  const bool c3_load = tick_reader(m, &s->read_c3, &was.read_c3, c3_begins, &c3_last);
  const bool load = tick_neurons(m, s, &was), done = tick_values(m, s, &was, load);
  tick_input(m, s, &was, done);
  tick_spikes(m, s, &was, D2, tick_sums(m, s, &was, D2, d2_load, d2_last));
  tick_spikes(m, s, &was, C2, tick_sums(m, s, &was, C2, was.neuron.load_c2, was.neuron.released));
  tick_spikes(m, s, &was, C3, tick_sums(m, s, &was, C3, c3_load, c3_last));
  s->h_taken += d2_begins;
  s->h_full += was.read_d2.way[2] && was.read_d2.way_last[2];
  tick_readout(m, s, &was, d2_begins, c3_begins, &m->totals);
  const bool busy[SF_LAYERS] = {s->mac.busy[0], s->sum[D2].busy, s->mac.busy[1], s->sum[C2].busy, s->sum[C3].busy};
  for (int l = 0; l < SF_LAYERS; l++) m->totals.busy[l] += busy[l];
  m->totals.any_busy += busy[0] || busy[1] || busy[2] || busy[3] || busy[4];
}

void sf_cycle_model_add(sf_cycle_model *model, const sf_cycle_sample *next)
{
  model->ring[model->now.added++ % RING] = *next;
  while (model->now.added - model->now.in.sent > 2) tick(model);
}

void sf_cycle_model_drain(sf_cycle_model *model)
{
  while (model->now.in.sent != model->now.added || active(&model->now)) tick(model);
}

uint64_t sf_cycles_least(const fx_net *net, const fx_counts *counts, const sf_engine *engine)
{
  uint64_t most = 0, products = 0;
  for (int l = fx_net_first_layer(net); l < SF_LAYERS; l++) {
    const uint64_t n_out = (uint64_t)net->layer[l].n_out, macs = (uint64_t)engine->macs;
    const uint64_t parts = l == FX_D2 || l == FX_C3 ? 1 : (n_out + macs - 1) / macs;
    uint64_t rows = 0;
    for (int t = 0; t < net->steps; t++)
      products += counts->layer[l].mac[t] / n_out * parts, rows += counts->layer[l].weight[t] / n_out * parts;
    if (rows > most) most = rows;
  }
  return products > most ? products : most;
}

uint64_t sf_cycles_dense(const fx_net *net)
{
  uint64_t cycles = 0;
  for (int l = 0; l < SF_LAYERS; l++)
    cycles += ((uint64_t)net->layer[l].n_in * (uint64_t)net->layer[l].n_out + SF_LANES - 1) / SF_LANES;
  return cycles;
}
