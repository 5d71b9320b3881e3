/* Each struct below mirrors the registers of one RTL module, and each function what they become at a clock edge. */
#include "cycles/cycles.h"

#include <stdlib.h>
#include <string.h>

enum {
  RING = 32,     /* samples inside the block, and the next ones to send; a power of two */
  QUEUE = 4,     /* steps between C1 and C2 (rtl/sf_core.sv) */
  DENSITIES = 8, /* rtl/sf_readout.sv */
  COLOURS = 3
};
enum { D1, C1, C2, SPIKING }; /* who shares the neurons */

/* rtl/sf_stream_in.sv */
typedef struct input {
  uint32_t begun, beat, full; /* full: 0..2 buffers */
  uint32_t sent;              /* sample whose packet is at work */
} input;

/* rtl/sf_d1.sv, rtl/sf_c1.sv */
typedef struct multiplier {
  uint32_t index, sample, step;
  enum { START, DIRECTION, KEEP, ROWS } state;
  bool row, last, move, kept; /* a row executes; the sum is complete; it moves on; the base is kept */
} multiplier;

/* rtl/sf_c2.sv */
typedef struct adder {
  uint32_t sample, step, left;
  bool fresh, row, last, move;
} adder;

/* rtl/sf_split.sv with the rtl/sf_store.sv before it */
typedef struct splitter {
  uint32_t sample, left, taken, full;
  bool fresh, wait, ready, row, taking; /* taking: the sums were taken in the last cycle */
} splitter;

/* rtl/sf_readout.sv */
typedef struct readout {
  bool density_full, colour_full, run, colour, valid[2], is_colour[2], is_last[2], done;
  uint32_t left, room, count;
} readout;

/* rtl/sf_stream_out.sv */
typedef struct output {
  bool full, second;
} output;

struct sf_cycle_model {
  uint32_t n_feature, n_dir, n_h, steps;
  bool decodes, biased; /* C1 takes its inputs from the buffer; its biases take a row */
  sf_cycle_sample ring[RING];
  uint32_t added; /* samples given so far */
  input in;
  multiplier d1, c1;
  splitter d2, c3;
  adder c2;
  uint32_t h_full, queue_count, queue_room;
  bool reserved[SPIKING], pending[SPIKING], spikes[SPIKING];
  uint32_t step[SPIKING], spikes_step;
  readout read;
  output out;
  sf_cycle_totals totals;
};

sf_cycle_model *sf_cycle_model_create(const fx_net *net)
{
  sf_cycle_model *m = calloc(1, sizeof *m);
  if (!m) return NULL;
  m->n_feature = (uint32_t)net->layer[FX_D1].n_in;
  m->n_h = (uint32_t)fx_net_h(net);
  m->n_dir = (uint32_t)fx_net_constants(net);
  m->decodes = fx_net_constants_per_sample(net);
  m->biased = net->layer[FX_C1].bias != 0;
  m->steps = (uint32_t)net->steps;
  m->c2.fresh = m->d2.fresh = m->c3.fresh = true;
  m->queue_room = QUEUE;
  m->read.room = DENSITIES;
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

static uint8_t pairs(const uint64_t *word)
{
  const uint64_t even = 0x5555555555555555;
  int evens = 0, odds = 0;
  for (int w = 0; w < SF_SPIKE_WORDS; w++)
    evens += __builtin_popcountll(word[w] & even), odds += __builtin_popcountll(word[w] & ~even);
  return (uint8_t)(evens > odds ? evens : odds);
}

sf_cycle_sample sf_cycle_sample_make(const fx_net *net, const fx_trace *trace, bool first)
{
  sf_cycle_sample s = {.first = first};
  uint64_t d1[SF_SPIKE_WORDS] = {0}, c2[SF_SPIKE_WORDS] = {0};
  for (int t = 0; t < net->steps; t++) {
    s.c2[t] = pairs(trace->spikes[FX_C1][t]);
    for (int w = 0; w < SF_SPIKE_WORDS; w++) d1[w] |= trace->spikes[FX_D1][t][w], c2[w] |= trace->spikes[FX_C2][t][w];
  }
  s.d2 = pairs(d1), s.c3 = pairs(c2);
  return s;
}

static const sf_cycle_sample *sample(const sf_cycle_model *m, uint32_t number)
{
  return &m->ring[number % RING];
}

/* ---- one clock edge: `was` is the state before it ---- */

static bool active(const sf_cycle_model *m)
{
  const multiplier *mul[2] = {&m->d1, &m->c1};
  const splitter *split[2] = {&m->d2, &m->c3};
  bool busy = m->in.begun || m->in.full || m->out.full || m->h_full || m->queue_count;
  for (int i = 0; i < 2; i++) {
    busy =
        busy || mul[i]->state != START || mul[i]->index || mul[i]->row || mul[i]->last || mul[i]->move || mul[i]->kept;
    busy = busy || !split[i]->fresh || split[i]->wait || split[i]->ready || split[i]->taken || split[i]->taking;
  }
  for (int i = 0; i < SPIKING; i++) busy = busy || m->reserved[i] || m->spikes[i];
  busy = busy || !m->c2.fresh || m->c2.row || m->c2.last || m->c2.move;
  const readout *r = &m->read;
  return busy || r->density_full || r->colour_full || r->run || r->valid[0] || r->valid[1] || r->done || r->count;
}

static void tick_input(sf_cycle_model *m, const sf_cycle_model *was, bool done)
{
  const input *in = &was->in;
  m->in.full -= done;
  if (in->full == 2 || in->sent == was->added) return;
  const uint32_t n_dir = was->decodes || sample(was, in->sent)->first ? was->n_dir : 0;
  const uint32_t beats = (n_dir + 3) / 4 + (was->n_feature + 3) / 4;
  m->in.begun = in->beat + 1 < beats;
  m->in.beat = m->in.begun ? in->beat + 1 : 0;
  if (m->in.begun) return;
  m->in.full++;
  m->in.sent++;
}

/* True where it reads its inputs for the last time. */
static bool tick_d1(sf_cycle_model *m, const sf_cycle_model *was)
{
  const multiplier *d1 = &was->d1;
  if (was->decodes) return false;
  const uint32_t n_dir = was->in.full && sample(was, d1->sample)->first ? was->n_dir : 0, next = d1->index + 1;
  const bool last = next >= was->n_feature && next >= n_dir, go = was->in.full && (!last || !was->reserved[D1]);
  m->d1.row = go && d1->index < was->n_feature;
  m->d1.last = go && last;
  m->d1.move = d1->last;
  if (go) m->d1.index = last ? 0 : next;
  if (go && last) m->d1.sample++, m->reserved[D1] = true;
  if (d1->move) m->pending[D1] = true;
  m->totals.busy[FX_D1] += d1->row;
  return go && last;
}

/* True where it reads its inputs for the last time. */
static bool tick_c1(sf_cycle_model *m, const sf_cycle_model *was)
{
  const multiplier *c1 = &was->c1;
  const bool starts = c1->state == START, first = starts && sample(was, c1->sample)->first;
  const bool direction = was->decodes || c1->state == DIRECTION || first;
  const uint32_t rows = direction ? was->n_dir + was->biased : was->n_h;
  const bool rows_last = c1->index + 1 >= rows, ends = rows_last && (!direction || was->decodes);
  const bool last_step = was->decodes || c1->step + 1 == was->steps;
  bool issue = false, last = false;
  if (c1->state == KEEP) {
    m->c1.state = ROWS;
  } else if (!starts || (was->decodes ? was->in.full : was->h_full)) {
    last = ends && !was->reserved[C1];
    issue = !ends || last;
    if (issue) {
      m->c1.index = rows_last ? 0 : c1->index + 1;
      m->c1.state = last && last_step ? START : !direction ? ROWS : rows_last ? KEEP : DIRECTION;
    }
    if (last) m->c1.step = last_step ? 0 : c1->step + 1, m->reserved[C1] = true;
    if (last && last_step) m->c1.sample++, m->h_full -= !was->decodes;
  }
  m->c1.row = issue;
  m->c1.kept = c1->state == KEEP;
  m->c1.last = last;
  m->c1.move = c1->last;
  if (c1->move) m->pending[C1] = true;
  m->totals.busy[FX_C1] += issue && rows > 0;
  return last && was->decodes;
}

static void tick_c2(sf_cycle_model *m, const sf_cycle_model *was)
{
  const adder *c2 = &was->c2;
  const uint32_t rows = sample(was, c2->sample)->c2[c2->step], left = c2->fresh ? rows : c2->left;
  const bool last = left <= 1, go = was->queue_count && (!last || !was->reserved[C2]);
  m->c2.row = go;
  m->c2.last = go && last;
  m->c2.move = c2->last;
  if (go) m->c2.fresh = last, m->c2.left = left - !last;
  if (go && last) {
    m->reserved[C2] = true;
    m->queue_count--, m->queue_room++;
    m->c2.step = c2->step + 1 == was->steps ? 0 : c2->step + 1;
    m->c2.sample += m->c2.step == 0;
  }
  if (c2->move) m->pending[C2] = true;
  m->totals.busy[FX_C2] += go && left > 0;
}

static void tick_split(splitter *s, const splitter *was, uint32_t rows, uint64_t *busy)
{
  const uint32_t left = was->fresh ? rows : was->left;
  const bool go = was->full && !was->wait && !was->ready, last = left <= 1;
  s->row = go;
  s->wait = go && last;
  s->ready = was->wait || was->ready;
  s->taking = false;
  if (go) s->fresh = last, s->left = left - !last;
  if (go && last) s->sample++, s->full--, s->taken--;
  *busy += go && left > 0;
}

/* Who steps its neurons, or hands its sums over: the layer nearest to the output. */
static void tick_neurons(sf_cycle_model *m, const sf_cycle_model *was, bool density_ready, bool colour_ready)
{
  memset(m->spikes, 0, sizeof m->spikes);
  if (was->c3.ready && colour_ready) {
    m->c3.ready = false, m->c3.taking = true;
  } else if (was->pending[C2] && (was->step[C2] || was->c3.taken < 2)) {
    m->spikes[C2] = true;
    m->c3.taken += was->step[C2] == 0;
  } else if (was->pending[C1] && was->queue_room) {
    m->spikes[C1] = true;
    m->queue_room--;
  } else if (was->d2.ready && density_ready && was->h_full < 2 && !was->d2.taking) {
    m->d2.ready = false, m->d2.taking = true;
  } else if (was->pending[D1] && (was->step[D1] || was->d2.taken < 2)) {
    m->spikes[D1] = true;
    m->d2.taken += was->step[D1] == 0;
  }
  for (int i = 0; i < SPIKING; i++) {
    if (!m->spikes[i]) continue;
    const bool ends = was->step[i] + 1 == was->steps;
    m->spikes_step = was->step[i];
    m->step[i] = ends ? 0 : was->step[i] + 1;
    if (!ends && (i == D1 || (i == C1 && was->decodes))) continue; /* its current serves all steps */
    m->reserved[i] = m->pending[i] = false;
  }
}

/* What the spikes and sums of the last cycle fill. */
static void tick_stores(sf_cycle_model *m, const sf_cycle_model *was)
{
  const bool ends = was->spikes_step + 1 == was->steps;
  m->d2.full += was->spikes[D1] && ends;
  m->c3.full += was->spikes[C2] && ends;
  m->queue_count += was->spikes[C1];
  m->h_full += was->d2.taking;
}

static void tick_readout(sf_cycle_model *m, const sf_cycle_model *was)
{
  const readout *r = &was->read;
  const bool ends = r->run && r->left == 1, free_now = !r->run || ends;
  const bool working = (r->valid[0] && r->is_colour[0]) || (r->valid[1] && r->is_colour[1]);
  const bool colour = free_now && r->colour_full && !(r->run && r->colour) && !r->done && !working;
  const bool density = free_now && !colour && r->density_full && !(r->run && !r->colour);
  const bool ready = !was->out.full || was->out.second, waits = r->done && (r->count || was->decodes),
             out = waits && ready;
  const bool pop = out && !was->decodes, push = r->valid[1] && r->is_last[1] && !r->is_colour[1];
  readout *next = &m->read;
  if (was->d2.taking)
    next->density_full = true;
  else if (ends && !r->colour)
    next->density_full = false;
  if (was->c3.taking)
    next->colour_full = true;
  else if (ends && r->colour)
    next->colour_full = false;
  next->run = colour || density || (r->run && !ends);
  if (colour || density)
    next->colour = colour, next->left = was->steps * (colour ? COLOURS : 1);
  else
    next->left = r->left - r->run;
  next->valid[0] = r->run, next->is_colour[0] = r->colour, next->is_last[0] = ends;
  next->valid[1] = r->valid[0], next->is_colour[1] = r->is_colour[0], next->is_last[1] = r->is_last[0];
  if (r->valid[1] && r->is_last[1] && r->is_colour[1])
    next->done = true;
  else if (out)
    next->done = false;
  next->room = r->room + pop - was->d2.taking;
  next->count = r->count + push - pop;
  m->totals.samples += out;
  if (ready) m->out.full = waits;
  if (was->out.full) m->out.second = !was->out.second;
}

static uint64_t rows_issued(const sf_cycle_model *m)
{
  const uint64_t *busy = m->totals.busy;
  return busy[FX_D2] + busy[FX_C1] + busy[FX_C2] + busy[FX_C3];
}

static void tick(sf_cycle_model *m)
{
  const sf_cycle_model was = *m;
  m->totals.cycles += active(&was);
  m->totals.waits += !was.in.full && active(&was);
  const bool d1_done = tick_d1(m, &was), c1_done = tick_c1(m, &was);
  tick_input(m, &was, d1_done || c1_done);
  tick_c2(m, &was);
  tick_split(&m->d2, &was.d2, sample(&was, was.d2.sample)->d2, &m->totals.busy[FX_D2]);
  tick_split(&m->c3, &was.c3, sample(&was, was.c3.sample)->c3, &m->totals.busy[FX_C3]);
  const bool density_ready = !was.read.density_full && !was.d2.taking && was.read.room;
  const bool colour_ready = !was.read.colour_full && !was.c3.taking;
  m->totals.stalls += (was.c3.ready && !colour_ready) || (was.d2.ready && !density_ready);
  m->totals.any_busy += m->d1.row || rows_issued(m) != rows_issued(&was); /* D1's own counter is a cycle behind */
  tick_neurons(m, &was, density_ready, colour_ready);
  tick_stores(m, &was);
  tick_readout(m, &was);
}

void sf_cycle_model_add(sf_cycle_model *model, const sf_cycle_sample *next)
{
  model->ring[model->added++ % RING] = *next;
  while (model->added - model->in.sent > 2) tick(model);
}

void sf_cycle_model_drain(sf_cycle_model *model)
{
  while (model->in.sent != model->added || active(model)) tick(model);
}

uint64_t sf_cycles_least(const fx_net *net, const fx_counts *counts)
{
  static const uint64_t rows_per_cycle[SF_LAYERS] = {[FX_D1] = 1, [FX_D2] = 2, [FX_C1] = 1, [FX_C2] = 2, [FX_C3] = 2};
  uint64_t most = 0;
  for (int l = fx_net_first_layer(net); l < SF_LAYERS; l++) {
    uint64_t rows = 0;
    for (int t = 0; t < net->steps; t++) rows += counts->layer[l].weight[t] / (uint64_t)net->layer[l].n_out;
    if (net->layer[l].bias && l == FX_C2) rows -= counts->samples * (uint64_t)net->steps; /* a sum begins with them */
    if (net->layer[l].bias && l == FX_C3) rows -= counts->samples;
    rows = (rows + rows_per_cycle[l] - 1) / rows_per_cycle[l];
    if (rows > most) most = rows;
  }
  return most;
}

uint64_t sf_cycles_dense(const fx_net *net)
{
  uint64_t cycles = 0;
  for (int l = 0; l < SF_LAYERS; l++)
    cycles += ((uint64_t)net->layer[l].n_in * (uint64_t)net->layer[l].n_out + SF_LANES - 1) / SF_LANES;
  return cycles;
}
