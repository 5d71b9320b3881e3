/* Inside src/bounds: the blocks whose errors budget.c lists. */
#ifndef SF_BOUNDS_BUDGET_BLOCKS_H
#define SF_BOUNDS_BUDGET_BLOCKS_H
#include "base/rng.h"
#include "bounds/bounds.h"
#include <math.h>

/* A bound of 0 allows no error. */
static inline void budget_add(sf_budget_row *row, double error, double bound)
{
  const double size = fabs(error + row->plant), ratio = size == 0 ? 0 : size / bound;
  if (row->inputs == 0 || size > row->measured) row->measured = size, row->bound = bound;
  row->ratio = fmax(row->ratio, ratio);
  row->inputs++;
}

static inline int64_t budget_pick(uint64_t stream, uint64_t index, int64_t low, int64_t high)
{
  return low + (int64_t)sf_random_below(20, stream, index, (uint64_t)(high - low + 1));
}

static inline double budget_uniform(uint64_t stream, uint64_t index)
{
  return 2 * (double)sf_random_float(20, stream, index) - 1;
}

/* Each measures one block into `row`: exhaustively, or over `samples` inputs. */
void sf_budget_rays(sf_budget_row *row, uint64_t samples);
void sf_budget_rays_ideal(sf_budget_row *row, uint64_t samples);
void sf_budget_grid(sf_budget_row *row, uint64_t samples);
void sf_budget_feature(sf_budget_row *row, uint64_t samples);
void sf_budget_direction(sf_budget_row *row, uint64_t samples);
void sf_budget_currents(sf_budget_row *row, uint64_t samples);
void sf_budget_h_floor(sf_budget_row *row, uint64_t samples);
void sf_budget_charge(sf_budget_row *row, uint64_t samples);
void sf_budget_integrate_density(sf_budget_row *row, uint64_t samples);
void sf_budget_integrate_colour(sf_budget_row *row, uint64_t samples);
void sf_budget_membranes(sf_budget_row *row, uint64_t samples);
void sf_budget_integrators(sf_budget_row *row, uint64_t samples);
void sf_budget_decoder_currents(sf_budget_row *row, uint64_t samples);
void sf_budget_place(sf_budget_row *row, uint64_t samples);
void sf_budget_plane(sf_budget_row *row, uint64_t samples);
void sf_budget_line(sf_budget_row *row, uint64_t samples);
void sf_budget_product(sf_budget_row *row, uint64_t samples);
void sf_budget_density_sum(sf_budget_row *row, uint64_t samples);
void sf_budget_activation_argument(sf_budget_row *row, uint64_t samples);
void sf_budget_softplus(sf_budget_row *row, uint64_t samples);
void sf_budget_relu(sf_budget_row *row, uint64_t samples);
void sf_budget_activated(sf_budget_row *row, uint64_t samples);
void sf_budget_weight(sf_budget_row *row, uint64_t samples);
void sf_budget_undecoded(sf_budget_row *row, uint64_t samples);
void sf_budget_basis(sf_budget_row *row, uint64_t samples);
void sf_budget_appearance(sf_budget_row *row, uint64_t samples);
void sf_budget_sine(sf_budget_row *row, uint64_t samples);
void sf_budget_feature_waves(sf_budget_row *row, uint64_t samples);
void sf_budget_axes(sf_budget_row *row, uint64_t samples);
void sf_budget_direction_waves(sf_budget_row *row, uint64_t samples);
void sf_budget_argument(sf_budget_row *row, uint64_t samples);
void sf_budget_exp2_low(sf_budget_row *row, uint64_t samples);
void sf_budget_exp2_high(sf_budget_row *row, uint64_t samples);
void sf_budget_sigmoid(sf_budget_row *row, uint64_t samples);
void sf_budget_exp_neg(sf_budget_row *row, uint64_t samples);
void sf_budget_alpha(sf_budget_row *row, uint64_t samples);
void sf_budget_transmittance(sf_budget_row *row, uint64_t samples);
void sf_budget_pixel(sf_budget_row *row, uint64_t samples);
#endif
