/* The block around the engine: input and output streams, readout, and one clock edge of all. */
#include "cycles/state.h"

#include <stdlib.h>
#include <string.h>

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
  m->radix = net->mode == FX_RADIX;
  m->neurons = (uint32_t)engine->neurons;
  m->part_groups = (uint32_t)(engine->macs / engine->neurons);
  for (int s = 0; s < FX_SPIKING; s++) {
    const int last = net->layer[fx_spiking_layers[s]].n_out - 1;
    m->last_group[s] = last < 0 ? 0 : (uint32_t)(last / engine->neurons);
    m->last_part[s] = last < 0 ? 0 : (uint32_t)(last / engine->macs);
    m->banks[s] = s == C2 ? (uint32_t)engine->steps_at_once : NARROW_BANKS;
    m->turns[s] = m->steps + (s == FX_SPIKING - 1 && m->radix ? m->steps - 1 : 0);
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

/* ---- one clock edge: `was` is the state before it ---- */

static bool active(const state *s)
{
  bool busy = s->in.begun || s->in.full || s->out.full || !sf_engine_idle(s);
  const readout *r = &s->read;
  for (int i = 0; i < STAGES; i++) busy = busy || r->stage[i].valid;
  return busy || r->density_taken || r->colour_taken || r->run || r->done || r->count;
}

static void tick_input(const sf_cycle_model *m, state *s, const state *was, bool done)
{
  const input *in = &was->in;
  s->in.full -= done;
  if (in->full == 2 || in->sent == was->added) return;
  const sf_cycle_sample *next = sample(m, in->sent);
  if (next->last_beat) {
    s->in.begun = m->clock >= next->first_beat && m->clock < next->last_beat;
    s->in.full += m->clock == next->last_beat;
    s->in.sent += m->clock == next->last_beat;
    return;
  }
  const uint32_t n_dir = m->decodes || next->first ? m->n_dir : 0;
  const uint32_t beats = (n_dir + 3) / 4 + (m->n_feature + 3) / 4;
  s->in.begun = in->beat + 1 < beats;
  s->in.beat = s->in.begun ? in->beat + 1 : 0;
  if (s->in.begun) return;
  s->in.full++;
  s->in.sent++;
}

static void tick_readout(const sf_cycle_model *m, state *s, const state *was, bool density_begins, bool colour_begins,
                         bool taken, sf_cycle_totals *totals)
{
  const readout *r = &was->read;
  readout *next = &s->read;
  const uint32_t last_out = r->colour ? COLOURS - 1 : 0;
  const bool last = r->slot == last_out && r->step + 1 == m->steps, ends = r->run && last, free_now = !r->run || last;
  const bool colour = free_now && r->colour_full && !r->busy;
  const bool density = free_now && !colour && r->density_full && !(r->run && !r->colour);
  const bool ready = !was->out.full || (was->out.second && taken), waits = r->done && (r->count || m->decodes);
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
  if (was->out.full && taken) s->out.second = !was->out.second;
}

void sf_tick(sf_cycle_model *m)
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
  const bool d2_load = sf_tick_reader(m, &s->read_d2, &was.read_d2, d2_begins, &d2_last);
  const bool c3_load = sf_tick_reader(m, &s->read_c3, &was.read_c3, c3_begins, &c3_last);
  const bool load = sf_tick_neurons(m, s, &was), done = sf_tick_values(m, s, &was, load);
  tick_input(m, s, &was, done);
  sf_tick_fed(m, s, &was, D2, d2_load, d2_last);
  sf_tick_fed(m, s, &was, C2, was.neuron.load_c2, was.neuron.released);
  sf_tick_fed(m, s, &was, C3, c3_load, c3_last);
  s->h_taken += d2_begins;
  sf_tick_h(m, s, &was, was.read_d2.way[2] && was.read_d2.way_last[2]);
  const bool taken = !was.out.second || !m->takes || m->takes(m->user, m->clock);
  tick_readout(m, s, &was, d2_begins, c3_begins, taken, &m->totals);
  const bool busy[SF_LAYERS] = {s->mac.busy[0], s->sum[D2].busy, s->mac.busy[1], s->sum[C2].busy, s->sum[C3].busy};
  for (int l = 0; l < SF_LAYERS; l++) m->totals.busy[l] += busy[l];
  m->totals.any_busy += busy[0] || busy[1] || busy[2] || busy[3] || busy[4];
  m->clock++;
}

bool sf_idle(const sf_cycle_model *m)
{
  return m->now.in.sent == m->now.added && !active(&m->now);
}

void sf_cycle_model_add(sf_cycle_model *model, const sf_cycle_sample *next)
{
  model->ring[model->now.added++ % RING] = *next;
  while (model->now.added - model->now.in.sent > 2) sf_tick(model);
}

void sf_cycle_model_drain(sf_cycle_model *model)
{
  while (!sf_idle(model)) sf_tick(model);
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
