/* Both nets for a block of samples, layer by layer, all steps of a layer at once. */
#ifndef SF_FX_NETS_ISA_H
#define SF_FX_NETS_ISA_H
#include "src/fx/vec_isa.h"
#if defined(FX_TILES)
#include "src/fx/tiles_isa.h"
#else
#include "src/fx/event_isa.h"
#endif

static INLINE void integrate_steps(const fx_net *net, fx_block *b, fx_scratch *s, int mode)
{
  integrate_step(net, b, s, mode, true, 0);
  for (int t = 1; t < net->steps; t++) integrate_step(net, b, s, mode, false, t);
}

static INLINE void nets_of_mode(const fx_core *core, fx_block *b, fx_scratch *s, int mode)
{
  const fx_net *net = &core->scene->net;
  memset(b->saturated, 0, sizeof b->saturated);
  if (fx_net_decodes(net)) {
    memset(b->spikes[0], 0, sizeof b->spikes[0]);
    memset(s->acc[0], 0, sizeof s->acc[0]);
    c1_constant_layer(core, b, mode);
  } else {
    density_layers(core, b, s, mode);
    c1_layer(core, b, s, mode);
  }
  c2_layer(core, b, s, mode);
  c3_layer(core, b, s, mode);
  if (mode == FX_RADIX)
    read_weighed(net, b, s);
  else
    integrate_steps(net, b, s, mode);
  fx_block_count(b, net->steps);
  for (int i = 0; i < b->n; i++) b->out[i] = (fx_out){s->acc[0][i], {s->acc[1][i], s->acc[2][i], s->acc[3][i]}};
}

static void nets_radix(const fx_core *core, fx_block *block, fx_scratch *scratch)
{
  nets_of_mode(core, block, scratch, FX_RADIX);
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
  case FX_NODECAY:
    nets_nodecay(core, block, scratch);
    break;
  default:
    nets_radix(core, block, scratch);
  }
  tiles_end();
}
#endif
