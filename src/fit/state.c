/* What a scene is and costs, before and after the fit. */
#include "fit/fit.h"
#include "cycles/cycles.h"
#include "energy/energy.h"
#include <math.h>
#include <string.h>

static double psnr(uint64_t error, uint64_t rays)
{
  return 10 * log10(3.0 * (double)rays * 65535.0 * 65535.0 / (double)error);
}

void sf_fit_describe(const fx_scene *scene, const sf_quant_widths *widths, const sf_fit_sum *sum, uint64_t rays,
                     sf_fit_state *state)
{
  const int64_t bytes = (int64_t)(scene->log2_bound + 1) * scene->occ_res * scene->occ_res * scene->occ_res / 8;
  memset(state, 0, sizeof *state);
  for (int l = 0; l < SF_LAYERS; l++)
    state->n_in[l] = scene->net.layer[l].n_in, state->n_out[l] = scene->net.layer[l].n_out;
  state->levels = scene->grid.levels, state->steps = scene->net.steps, state->trans_stop = scene->trans_stop;
  state->directions = state->n_in[FX_C1] - (state->n_out[FX_D2] - 1);
  state->entries = scene->grid.entries;
  for (int64_t i = 0; i < scene->grid.entries; i++)
    state->zero_entries += !scene->grid.table[2 * i] && !scene->grid.table[2 * i + 1];
  for (int64_t i = 0; i < bytes; i++) state->cells += __builtin_popcount(scene->occupancy[i]);
  state->widths = *widths;
  state->bytes = (uint64_t)sf_packed_bytes(scene, widths);
  state->cycles = sf_cycles_least(&scene->net, &sum->counts, &sf_engine_default);
  state->sum = *sum;
  state->psnr = psnr(sum->error, rays);
}
