#include "sim/cover.h"
#include "firmware/sf_driver.h"
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#ifdef SF_COVERAGE
sf_cover *sf_cover_open(void)
{
  const int file = open(SF_COVERAGE "/functional.bin", O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (file < 0) return NULL;
  const bool sized = ftruncate(file, sizeof(sf_cover)) == 0;
  void *at = sized ? mmap(NULL, sizeof(sf_cover), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0) : MAP_FAILED;
  close(file);
  return at == MAP_FAILED ? NULL : at;
}
#else
sf_cover *sf_cover_open(void)
{
  return NULL;
}
#endif

void sf_cover_close(sf_cover *cover)
{
  if (cover) munmap(cover, sizeof *cover);
}

static void hit(uint64_t *bin)
{
  __atomic_fetch_add(bin, 1, __ATOMIC_RELAXED); /* other processes add to it, too */
}

/* ---- samples ---- */

/* Outputs of radix have no rail: their sums fit. */
static bool at_rail(int layer, int mode, int32_t v)
{
  const int bits = fx_layer_table[layer].state_bits;
  if (!fx_layer_fires(layer)) return mode != FX_RADIX && v == (1 << bits) - 1;
  return v == (1 << (bits - 1)) - 1 || v == -(1 << (bits - 1));
}

static void cover_beat(sf_cover *cover, const fx_net *net, const fx_trace *core, const sf_dut_result *result, int l,
                       int t)
{
  const bool spiking = fx_layer_fires(l);
  const int n = l == FX_D2 ? 1 : net->layer[l].n_out;
  bool rail = false;
  for (int o = 0; o < n && !rail; o++) rail = at_rail(l, net->mode, core->membrane[l][t][o]);
  hit(&cover->beat[l][net->mode][t][rail][result->stalled[l][spiking ? t : 0]]);
  if (!spiking) return;
  int fired = 0;
  for (int w = 0; w < SF_SPIKE_WORDS; w++) fired += __builtin_popcountll(core->spikes[l][t][w]);
  if (fired == 0) hit(&cover->silent[l]);
  if (fired == n) hit(&cover->full[l]);
}

void sf_cover_sample(const fx_net *net, const fx_trace *core, const sf_dut_result *result)
{
  sf_cover *cover = sf_cover_open();
  if (!cover) return;
  hit(&cover->steps[net->mode][net->steps - 1]);
  const bool per_sample = fx_net_constants_per_sample(net), biased = net->layer[FX_C2].bias != 0;
  hit(&cover->inputs[per_sample][biased]);
  for (int l = fx_net_first_layer(net); l < SF_LAYERS; l++)
    for (int t = 0; t < net->steps; t++) cover_beat(cover, net, core, result, l, t);
  sf_cover_close(cover);
}

/* ---- pins and registers ---- */

void sf_phase_follow(sf_phase *phase, const sf_pins_in *in, const sf_pins_out *out)
{
  if (in->s_valid && out->s_ready) *phase = in->s_last ? SF_PHASE_SAMPLE : SF_PHASE_PACKET;
  if (out->tap_valid) *phase = SF_PHASE_LAYER + out->tap_layer;
  if (!out->m_valid) return;
  if (!in->m_ready)
    *phase = out->m_last ? SF_PHASE_HALF_RESULT : SF_PHASE_RESULT;
  else
    *phase = out->m_last ? SF_PHASE_IDLE : SF_PHASE_HALF_RESULT;
}

void sf_cover_read(sf_cover *cover, uint32_t offset, uint32_t value)
{
  if (!cover || offset != SF_CSR_ERROR) return;
  for (int bit = 0; bit < SF_COVER_ERRORS; bit++)
    if (value >> bit & 1) hit(&cover->error[bit]);
}

void sf_cover_write(sf_cover *cover, uint32_t offset, uint32_t value, sf_phase phase)
{
  if (!cover || offset != SF_CSR_CTRL) return;
  if (value & SF_CSR_CTRL_SOFT_RESET) hit(&cover->reset[phase]);
  if (value & SF_CSR_CTRL_CLEAR) hit(&cover->walk[0][phase != SF_PHASE_IDLE]);
  if (value & SF_CSR_CTRL_SNAPSHOT) hit(&cover->walk[1][phase != SF_PHASE_IDLE]);
}
