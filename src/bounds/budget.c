/* Error budget of the units: every block of the core against double precision, each error over its derived bound.
 * The derivations are in docs/fixed-point.md, row by row. */
#include "bounds/budget_blocks.h"

const char sf_h_text[] = {'h', ' ', '=', ' ', 'i', ' ', '>', '>', ' ', '0' + SF_H_SHIFT, 0};
_Static_assert(SF_H_SHIFT < 10, "the shift is one digit");

/* clang-format off */
static const struct block {
  const char *name, *unit, *bites;
  bool exhaustive;
  void (*measure)(sf_budget_row *row, uint64_t samples);
} blocks[SF_BUDGET_BLOCKS] = {
    [SF_BUDGET_RAY] = {"ray: sample position", "LSB of Q0.24", "far below a grid cell: nowhere", false, sf_budget_rays},
    [SF_BUDGET_STEP] = {"ray: with its step rounded", "LSB of Q0.24", "end of long rays: DELTA_FRAC", false, sf_budget_rays_ideal},
    [SF_BUDGET_GRID] = {"grid: interpolation", "LSB of an entry", "edges between cells of fine levels", false, sf_budget_grid},
    [SF_BUDGET_FEATURE] = {"grid: feature f", "LSB of int12", "spikes of D1: INPUT_BITS", true, sf_budget_feature},
    [SF_BUDGET_DIRECTION] = {"direction features", "LSB of 2^-11", "spikes of C1, once per ray", false, sf_budget_direction},
    [SF_BUDGET_CURRENT] = {"currents, all layers: sums", "LSB of a current", "exact", false, sf_budget_currents},
    [SF_BUDGET_H] = {sf_h_text, "LSB of h", "spikes of C1: H_SHIFT", true, sf_budget_h_floor},
    [SF_BUDGET_CHARGE] = {"membrane: one leak product", "LSB of s24", "spikes at the threshold", true, sf_budget_charge},
    [SF_BUDGET_MEMBRANE] = {"membrane: after 8 steps", "LSB of s24", "C2, whose current has AC_FRAC bits", false, sf_budget_membranes},
    [SF_BUDGET_ARGUMENT] = {"argument of the tables", "LSB of Q.12", "relative error of density: LOG_FRAC", false, sf_budget_argument},
    [SF_BUDGET_EXP2] = {"2^y below 256", "LSB of U16.12", "thin media: SIGMA_FRAC", true, sf_budget_exp2_low},
    [SF_BUDGET_EXP2_HIGH] = {"2^y from 256 on", "1e-6 of the value", "surfaces: opaque anyway", true, sf_budget_exp2_high},
    [SF_BUDGET_SIGMOID] = {"sigmoid", "LSB of Q0.16", "colour: 1/256 of an 8-bit level per LSB", true, sf_budget_sigmoid},
    [SF_BUDGET_DENSITY] = {"density integrator: one step", "LSB of U16.12", "thin media", true, sf_budget_integrate_density},
    [SF_BUDGET_COLOUR] = {"colour integrator: one step", "LSB of Q4.16", "colour", true, sf_budget_integrate_colour},
    [SF_BUDGET_INTEGRATORS] = {"integrators: after 8 steps", "LSB of either", "thin media, colour", false, sf_budget_integrators},
    [SF_BUDGET_EXP_NEG] = {"exp(-x)", "LSB of Q.20", "thin media on long rays: TRANS_FRAC", true, sf_budget_exp_neg},
    [SF_BUDGET_ALPHA] = {"alpha of one sample", "LSB of Q.20", "thin media on long rays: TRANS_FRAC", false, sf_budget_alpha},
    [SF_BUDGET_TRANSMITTANCE] = {"transmittance of a ray", "LSB of Q.20", "errors of one sign in uniform fog", false, sf_budget_transmittance},
    [SF_BUDGET_PIXEL] = {"pixel, density and colour given", "LSB of Q0.16", "fog with a change of colour", false, sf_budget_pixel},
};
/* clang-format on */

sf_budget_row sf_budget_measure(sf_budget_id id, uint64_t samples)
{
  const struct block *b = &blocks[id];
  sf_budget_row row = {.block = b->name, .unit = b->unit, .bites = b->bites, .exhaustive = b->exhaustive};
  b->measure(&row, samples);
  return row;
}
