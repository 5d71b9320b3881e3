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

/* Every neuron of a spiking layer (0..FX_SPIKING-1) for all samples. halves: currents of C2 in 16 bits, else in 32. */
static INLINE void fire_layer(const neurons *n, int spiking, bool halves, int shift, const void *current, fx_block *b,
                              fx_scratch *s, int t)
{
  static const int layer[FX_SPIKING] = {FX_D1, FX_C1, FX_C2};
  for (int i = 0; i < b->n; i++) {
    uint64_t bits[SF_SPIKE_WORDS] = {0};
#pragma GCC unroll 32
    for (int j = 0; j < VECTORS; j++) {
      const int at = i * SF_LANES + j * WIDTH;
      const vec in = halves ? v_widen((const int16_t *)current + at) : v_load((const int32_t *)current + at);
      put_spikes(bits, j,
                 fire(n, &s->v[spiking][i][j * WIDTH], V(slli_epi32)(in, shift), &b->saturated[layer[spiking]][i]));
    }
    memcpy(b->spikes[spiking][t][i], bits, sizeof bits);
  }
}

static INLINE void density_step(const fx_core *core, fx_block *b, fx_scratch *s, int mode, bool first, int t)
{
  const neurons n = neurons_of(&core->scene->net, FX_D1, mode, first, t);
  const fx_words *words = &core->words;
  fire_layer(&n, 0, false, 0, s->constant, b, s, t);
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
  const bool decodes = fx_net_decodes(&core->scene->net);
  if (!decodes) c1_currents(&core->words, b, s);
  fire_layer(&n, 1, false, 0, decodes ? s->constant : s->current, b, s, t);
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
  if (!fx_net_decodes(&core->scene->net)) density_step(core, b, s, mode, first, t);
  c1_step(core, b, s, mode, first, t);
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
  } else {
    for (int i = b->n; i % GANG; i++) b->base[i] = b->base[0]; /* the last gang may have members that nobody reads */
    d1_currents(&core->words, b, s);
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
