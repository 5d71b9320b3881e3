/* Both nets for a block of samples, layer by layer and step by step. */
#ifndef SPIKEFIELD_FX_NETS_ISA_H
#define SPIKEFIELD_FX_NETS_ISA_H
#include "src/fx/integrate_isa.h"
#include "src/fx/plif_isa.h"
#if defined(FX_TILES)
#include "src/fx/tiles_isa.h"
#else
#include "src/fx/event_isa.h"
#endif

static const int spiking_layer[FX_SPIKING] = {FX_D1, FX_C1, FX_C2};

/* Every neuron of C1 or C2 (1, 2 of FX_SPIKING) at step t, for all samples. halves: currents of C2 in 16 bits, else
 * in 32. */
static INLINE void fire_layer(const neurons *n, int spiking, bool halves, int shift, const void *current, fx_block *b,
                              fx_scratch *s, int t)
{
  for (int i = 0; i < b->n; i++) {
    uint64_t bits[SF_SPIKE_WORDS] = {0};
#pragma GCC unroll 32
    for (int j = 0; j < VECTORS; j++) {
      const int at = i * SF_LANES + j * WIDTH;
      int32_t *membranes = &s->v[spiking - 1][i][j * WIDTH];
      const vec in = halves ? v_widen((const int16_t *)current + at) : v_load((const int32_t *)current + at);
      vec v = n->first ? v_set(0) : v_load(membranes);
      put_spikes(bits, j, fire(n, &v, V(slli_epi32)(in, shift), &b->saturated[spiking_layer[spiking]][i]));
      if (!n->last) v_store(membranes, v);
    }
    memcpy(b->spikes[spiking][t][i], bits, sizeof bits);
  }
}

/* TILE vectors of one sample from neuron `at` on. */
static INLINE void fire_vectors(const neurons *n, vec v[TILE], const vec in[TILE], int at,
                                uint64_t spikes[SF_SPIKE_WORDS], uint32_t *saturated)
{
  uint64_t bits[SF_SPIKE_WORDS] = {0};
#pragma GCC unroll 8
  for (int j = 0; j < TILE; j++) put_spikes(bits, j, fire(n, &v[j], in[j], saturated));
  memcpy((uint8_t *)spikes + at / 8, bits, TILE * WIDTH / 8); /* little-endian */
}

/* All steps of a layer whose currents, s->constant, serve all of them: membranes stay in registers. */
static INLINE void fire_constant(const fx_net *net, int spiking, int mode, fx_block *b, const fx_scratch *s)
{
  const int layer = spiking_layer[spiking];
  const neurons first = neurons_of(net, layer, mode, true, 0), later = neurons_of(net, layer, mode, false, 1);
  for (int i = 0; i < b->n; i++)
    for (int at = 0; at < SF_LANES; at += TILE * WIDTH) {
      vec v[TILE], in[TILE];
#pragma GCC unroll 8
      for (int j = 0; j < TILE; j++) v[j] = v_set(0), in[j] = v_load(&s->constant[i][at + j * WIDTH]);
      fire_vectors(&first, v, in, at, b->spikes[spiking][0][i], &b->saturated[layer][i]);
      for (int t = 1; t < net->steps; t++)
        fire_vectors(&later, v, in, at, b->spikes[spiking][t][i], &b->saturated[layer][i]);
    }
}

static INLINE void density_step(const fx_core *core, fx_block *b, fx_scratch *s, int t)
{
  const fx_words *words = &core->words;
  small_currents(words->d2, words->d2_quads, (const uint64_t(*)[SF_SPIKE_WORDS])b->spikes[0][t], false, b->n,
                 s->d2_current);
  for (int i = 0; i < b->n; i++) {
    __m256i *current = (__m256i *)s->d2_current[i];
    s->argument[0][i] = s->d2_current[i][0];
    _mm256_storeu_si256(current, _mm256_srai_epi16(_mm256_loadu_si256(current), SF_H_SHIFT));
  }
}

static INLINE void c1_step(const fx_core *core, fx_block *b, fx_scratch *s, int mode, bool first, int t)
{
  const neurons n = neurons_of(&core->scene->net, FX_C1, mode, first, t);
  c1_currents(&core->words, b, s);
  fire_layer(&n, 1, false, 0, s->current, b, s, t);
}

static INLINE void c2_step(const fx_core *core, fx_block *b, fx_scratch *s, int mode, bool first, int t)
{
  const neurons n = neurons_of(&core->scene->net, FX_C2, mode, first, t);
  const uint64_t(*spikes)[SF_SPIKE_WORDS] = (const uint64_t(*)[SF_SPIKE_WORDS])b->spikes[1][t];
  const bool halves = c2_currents(&core->words, spikes, core->scene->net.layer[FX_C2].bias != 0, b->n, s);
  if (halves)
    fire_layer(&n, 2, true, SF_AC_FRAC, s->c2_current, b, s, t);
  else
    fire_layer(&n, 2, false, SF_AC_FRAC, s->current, b, s, t);
}

static INLINE void c3_step(const fx_core *core, fx_block *b, fx_scratch *s, int t)
{
  small_currents(core->words.c3, core->words.c3_quads, (const uint64_t(*)[SF_SPIKE_WORDS])b->spikes[2][t],
                 core->scene->net.layer[FX_C3].bias != 0, b->n, s->c3_current);
  for (int o = 0; o < COLOURS; o++)
    for (int i = 0; i < b->n; i++) s->argument[1 + o][i] = s->c3_current[i][o];
}

static INLINE void step(const fx_core *core, fx_block *b, fx_scratch *s, int mode, bool first, int t)
{
  if (!fx_net_decodes(&core->scene->net)) {
    density_step(core, b, s, t);
    c1_step(core, b, s, mode, first, t);
  }
  c2_step(core, b, s, mode, first, t);
  c3_step(core, b, s, t);
  integrate_step(&core->scene->net, b, s, mode, first);
}

static INLINE void nets_of_mode(const fx_core *core, fx_block *b, fx_scratch *s, int mode)
{
  const fx_net *net = &core->scene->net;
  memset(b->saturated, 0, sizeof b->saturated);
  if (fx_net_decodes(net)) {
    memset(b->spikes[0], 0, sizeof b->spikes[0]);
    memset(s->acc[0], 0, sizeof s->acc[0]);
    c1_constant_currents(&core->words, net->layer[FX_C1].n_in, b, s);
    fire_constant(net, 1, mode, b, s);
  } else {
    for (int i = b->n; i % GANG; i++) b->base[i] = b->base[0]; /* the last gang may have members that nobody reads */
    d1_currents(&core->words, b, s);
    fire_constant(net, 0, mode, b, s);
  }
  step(core, b, s, mode, true, 0);
  for (int t = 1; t < net->steps; t++) step(core, b, s, mode, false, t);
  fx_block_count(b, net->steps);
  for (int i = 0; i < b->n; i++) b->out[i] = (fx_out){s->acc[0][i], {s->acc[1][i], s->acc[2][i], s->acc[3][i]}};
}

static void nets_hybrid(const fx_core *core, fx_block *block, fx_scratch *scratch)
{
  nets_of_mode(core, block, scratch, FX_HYBRID);
}
static void nets_decay(const fx_core *core, fx_block *block, fx_scratch *scratch)
{
  nets_of_mode(core, block, scratch, FX_DECAY);
}
static void nets_nodecay(const fx_core *core, fx_block *block, fx_scratch *scratch)
{
  nets_of_mode(core, block, scratch, FX_NODECAY);
}

static void nets(const fx_core *core, fx_block *block, fx_scratch *scratch)
{
  tiles_begin();
  switch (core->scene->net.mode) {
  case FX_HYBRID:
    nets_hybrid(core, block, scratch);
    break;
  case FX_DECAY:
    nets_decay(core, block, scratch);
    break;
  default:
    nets_nodecay(core, block, scratch);
  }
  tiles_end();
}
#endif
