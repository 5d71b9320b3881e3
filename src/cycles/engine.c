/* The engine at a clock edge. Each function mirrors one module of the RTL. */
#include "cycles/state.h"

#include <string.h>

static bool values_idle(const values *v)
{
  return v->job == NONE && !v->full[0] && !v->full[1] && !v->op[0] && !v->op[1] && !v->op[2] && !v->busy[0] &&
         !v->busy[1] && !v->ray;
}

bool sf_engine_idle(const state *s)
{
  bool busy = s->h_taken || !values_idle(&s->mac) || s->neuron.active || s->neuron.counted;
  for (int l = 0; l < FED; l++) {
    busy = busy || !s->sum[l].fresh || s->sum[l].part || s->sum[l].full || s->sum[l].busy;
    busy = busy || s->spike[l].taken || s->spike[l].have || s->spike[l].valid;
  }
  for (int i = 0; i < 4 + DEPTH - 1; i++) busy = busy || s->neuron.way[i].valid;
  for (int i = 0; i < 3; i++) busy = busy || s->read_d2.way[i] || s->read_c3.way[i];
  return !busy;
}

/* h of a sample whose sums are complete: in radix mode behind its means, a value per cycle and three on the way. */
void sf_tick_h(const sf_cycle_model *m, state *s, const state *was, bool complete)
{
  enum { VALUES = 15 };
  const bool works = was->h_waiting > 0, last = works && was->h_at == VALUES - 1;
  s->h_full += m->radix ? was->h_way[2] : complete;
  s->h_waiting += m->radix && complete;
  s->h_waiting -= last;
  if (works) s->h_at = last ? 0 : was->h_at + 1;
  s->h_way[0] = last, s->h_way[1] = was->h_way[0], s->h_way[2] = was->h_way[1];
}

static int job_of(const sf_cycle_model *m, const state *was)
{
  const values *v = &was->mac;
  if (v->job != NONE) return v->job;
  if ((m->decodes ? was->in.full : was->h_full) && !v->full[1])
    return m->decodes || sample(m, v->c1_sample)->first ? CONSTANTS : STATES;
  return was->in.full && !m->decodes && !v->full[0] ? FEATURES : NONE;
}

bool sf_tick_values(const sf_cycle_model *m, state *s, const state *was, bool load)
{
  const values *v = &was->mac;
  values *to = &s->mac;
  const int job = job_of(m, was);
  const bool go = job != NONE && !load;
  const uint32_t n_dir = job == FEATURES && sample(m, v->d1_sample)->first ? m->n_dir : 0;
  const uint32_t rows = job == FEATURES ? m->n_feature : job == CONSTANTS ? m->n_dir + m->biased : m->n_h;
  const bool is_row = v->row < rows, last_row = v->row + 1 >= rows && v->row + 1 >= n_dir;
  const bool last_part = v->part == m->last_part[job == FEATURES ? 0 : 1];
  const bool last_step = job != STATES || m->radix || v->step + 1 == m->steps;
  const bool last = last_row && last_part && last_step;
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

bool sf_tick_neurons(const sf_cycle_model *m, state *s, const state *was)
{
  const neurons *n = &was->neuron;
  neurons *to = &s->neuron;
  const bool want[FX_SPIKING] = {was->mac.full[0] && was->spike[D2].taken < 2,
                                 was->mac.full[1] && was->spike[C2].taken < 2,
                                 was->sum[C2].full && !n->released && was->spike[C3].taken < 2};
  const uint32_t layer = n->active ? n->layer : want[2] ? 2 : want[1] ? 1 : 0;
  const bool run = n->active ? n->wait == 0 : want[0] || want[1] || want[2];
  const uint32_t last_group = m->last_group[layer], part = n->group / m->part_groups;
  const bool group_ends = n->group == last_group, last_turn = n->turn + 1 == m->turns[layer];
  const bool constant = layer == 0 || (layer == 1 && m->decodes); /* one current, all steps */
  const bool once = m->radix ? layer < 2 : constant && m->last_part[layer] == 0;
  const bool load = run && n->group % m->part_groups == 0 && n->turn < (once ? 1 : m->steps);
  const bool taken = load && (n->turn + 1 == m->steps || once) && part == m->last_part[layer];
  memmove(&to->way[1], &n->way[0], sizeof to->way - sizeof to->way[0]);
  to->way[0] = (turn){run, group_ends, (uint8_t)layer, (uint8_t)n->turn, (uint8_t)n->group};
  to->counted = n->way[4 + DEPTH - 2].valid;
  to->released = taken && layer == 2;
  to->load_c2 = load && layer == 2;
  if (run && !n->active) s->spike[layer].taken++;
  if (taken && layer < 2) s->mac.full[layer] = false;
  if (run) {
    to->active = !(group_ends && last_turn);
    to->layer = layer;
    to->group = group_ends ? 0 : n->group + 1;
    if (group_ends) to->turn = last_turn ? 0 : n->turn + 1;
    if (group_ends && !last_turn && last_group < DEPTH - 1) to->wait = DEPTH - 1 - last_group;
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
  to->full += out->valid && out->layer == l && out->number + 1U == m->turns[l] && out->group == m->last_group[l];
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

bool sf_tick_reader(const sf_cycle_model *m, reader *to, const reader *r, bool begins, bool *last)
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

void sf_tick_fed(const sf_cycle_model *m, state *s, const state *was, int l, bool load, bool release)
{
  tick_spikes(m, s, was, l, tick_sums(m, s, was, l, load, release));
}
