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

static int64_t zeros(const int8_t *entry, size_t n)
{
  int64_t sum = 0;
  for (size_t i = 0; i < n; i++) sum += !entry[i];
  return sum;
}

static void describe_grid(const fx_grid *grid, sf_fit_state *state)
{
  state->levels = grid->levels, state->entries = grid->entries;
  for (int64_t i = 0; i < grid->entries; i++) state->zero_entries += !grid->table[2 * i] && !grid->table[2 * i + 1];
}

static void describe_planes(const fx_scene *scene, sf_fit_state *state)
{
  const fx_tensorf *field = &scene->tensorf;
  state->planes = true;
  state->features = field->features, state->weight_stop = field->weight_stop;
  state->feature_freqs = field->feature_freqs, state->view_freqs = field->view_freqs;
  for (int which = 0; which < SF_FACTORS; which++)
    for (int pair = 0; pair < FX_PAIRS; pair++) {
      const fx_factors *f = which == SF_OF_DENSITY ? &field->density : &field->appearance;
      const int32_t u = field->res[pair == 2], v = field->res[pair ? 2 : 1], w = field->res[2 - pair];
      const size_t n = (size_t)f->components[pair], plane = (size_t)u * (size_t)v * n, line = (size_t)w * n;
      state->components[which] += f->components[pair];
      state->entries += (int64_t)(plane + line);
      state->zero_entries += zeros(f->plane[pair], plane) + zeros(f->line[pair], line);
    }
  for (int axis = 0; axis < 3; axis++) {
    state->points[axis] = field->res[axis];
    state->box[axis] = 1 / (scene->units.to_box_scale * scene->units.stretch[axis]);
  }
  state->distance = ldexp(scene->step_q24, -SF_DELTA_FRAC) / scene->units.to_box_scale;
}

void sf_fit_describe(const fx_scene *scene, const sf_quant_widths *widths, const sf_fit_sum *sum, uint64_t rays,
                     sf_fit_state *state)
{
  const int64_t bytes = (int64_t)(scene->log2_bound + 1) * scene->occ_res * scene->occ_res * scene->occ_res / 8;
  memset(state, 0, sizeof *state);
  for (int l = 0; l < SF_LAYERS; l++)
    state->n_in[l] = scene->net.layer[l].n_in, state->n_out[l] = scene->net.layer[l].n_out;
  state->steps = scene->net.steps, state->trans_stop = scene->trans_stop;
  state->directions = fx_net_harmonics(&scene->net);
  if (scene->backbone == FX_TENSORF)
    describe_planes(scene, state);
  else
    describe_grid(&scene->grid, state);
  for (int64_t i = 0; i < bytes; i++) state->cells += __builtin_popcount(scene->occupancy[i]);
  state->widths = *widths;
  state->bytes = (uint64_t)sf_packed_bytes(scene, widths);
  state->cycles = sf_cycles_least(&scene->net, &sum->counts, &sf_engine_default);
  state->sum = *sum;
  state->psnr = psnr(sum->error, rays);
}
