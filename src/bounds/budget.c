/* Error budget of the units: every block of the core against double precision, each error over its derived bound.
 * The derivations are in docs/fixed-point.md, row by row. */
#include "bounds/budget_blocks.h"

const char sf_h_text[] = {'h', ' ', '=', ' ', 'i', ' ', '>', '>', ' ', '0' + SF_H_SHIFT, 0};
_Static_assert(SF_H_SHIFT < 10, "the shift is one digit");

/* clang-format off */
enum { GRID = 1 << FX_INGP, PLANES = 1 << FX_TENSORF, BOTH = GRID | PLANES };

static const struct block {
  const char *name, *unit, *bites;
  int fields;
  bool exhaustive;
  void (*measure)(sf_budget_row *row, uint64_t samples);
} blocks[SF_BUDGET_BLOCKS] = {
    [SF_BUDGET_RAY] = {"ray: sample position", "LSB of Q0.24", "far below a grid cell: nowhere", BOTH, false, sf_budget_rays},
    [SF_BUDGET_STEP] = {"ray: with its step rounded", "LSB of Q0.24", "end of long rays: DELTA_FRAC", BOTH, false, sf_budget_rays_ideal},
    [SF_BUDGET_GRID] = {"grid: interpolation", "LSB of an entry", "edges between cells of fine levels", GRID, false, sf_budget_grid},
    [SF_BUDGET_FEATURE] = {"grid: feature f", "LSB of int12", "spikes of D1: INPUT_BITS", GRID, true, sf_budget_feature},
    [SF_BUDGET_DIRECTION] = {"direction features", "LSB of 2^-11", "spikes of C1, once per ray", GRID, false, sf_budget_direction},
    [SF_BUDGET_PLACE] = {"planes: place between points", "1/256 of a cell", "in the next three rows", PLANES, false, sf_budget_place},
    [SF_BUDGET_PLANE] = {"planes: bilinear value", "LSB of an entry", "edges between cells", PLANES, false, sf_budget_plane},
    [SF_BUDGET_LINE] = {"lines: linear value", "LSB of an entry", "edges between cells", PLANES, false, sf_budget_line},
    [SF_BUDGET_SUM] = {"density: sum of products", "LSB of a product", "surfaces between grid points", PLANES, false, sf_budget_density_sum},
    [SF_BUDGET_ACTIVATION_ARGUMENT] = {"density: argument", "LSB of Q.12", "relative error of density: LOG_FRAC", PLANES, false, sf_budget_activation_argument},
    [SF_BUDGET_SOFTPLUS] = {"density: softplus", "LSB of Q.20", "where it bends: 1.8e-4 of the density", PLANES, true, sf_budget_softplus},
    [SF_BUDGET_RELU] = {"density: ReLU", "LSB of Q.20", "exact", PLANES, true, sf_budget_relu},
    [SF_BUDGET_ACTIVATED] = {"density: scale", "LSB of U16.12", "thin media: SIGMA_FRAC", PLANES, false, sf_budget_activated},
    [SF_BUDGET_PRODUCT] = {"appearance: product", "LSB of a product", "edges between cells", PLANES, false, sf_budget_product},
    [SF_BUDGET_BASIS] = {"appearance: sums of the basis", "LSB of a sum", "exact", PLANES, false, sf_budget_basis},
    [SF_BUDGET_APPEARANCE] = {"appearance: feature", "LSB of int12", "spikes of C1: INPUT_BITS", PLANES, false, sf_budget_appearance},
    [SF_BUDGET_SINE] = {"sine of a phase", "LSB of Q1.14", "far below the LSB of the encodings", PLANES, true, sf_budget_sine},
    [SF_BUDGET_FEATURE_WAVES] = {"sines, cosines: of features", "LSB of 2^-10", "spikes of C1: INPUT_BITS", PLANES, false, sf_budget_feature_waves},
    [SF_BUDGET_AXES] = {"direction: its axes", "LSB of 2^-10", "spikes of C1: INPUT_BITS", PLANES, false, sf_budget_axes},
    [SF_BUDGET_DIRECTION_WAVES] = {"sines, cosines: of a direction", "LSB of 2^-10", "spikes of C1: INPUT_BITS", PLANES, false, sf_budget_direction_waves},
    [SF_BUDGET_CURRENT] = {"currents, all layers: sums", "LSB of a current", "exact", GRID, false, sf_budget_currents},
    [SF_BUDGET_DECODER_CURRENT] = {"decoder's currents, with biases", "LSB of a current", "exact", PLANES, false, sf_budget_decoder_currents},
    [SF_BUDGET_H] = {sf_h_text, "LSB of h", "spikes of C1: H_SHIFT", GRID, true, sf_budget_h_floor},
    [SF_BUDGET_CHARGE] = {"membrane: one leak product", "LSB of s24", "spikes at the threshold", BOTH, true, sf_budget_charge},
    [SF_BUDGET_MEMBRANE] = {"membrane: after 8 steps", "LSB of s24", "C2, whose current has AC_FRAC bits", BOTH, false, sf_budget_membranes},
    [SF_BUDGET_ARGUMENT] = {"argument of the tables", "LSB of Q.12", "relative error of density: LOG_FRAC", BOTH, false, sf_budget_argument},
    [SF_BUDGET_EXP2] = {"2^y below 256", "LSB of U16.12", "thin media: SIGMA_FRAC", GRID, true, sf_budget_exp2_low},
    [SF_BUDGET_EXP2_HIGH] = {"2^y from 256 on", "1e-6 of the value", "surfaces: opaque anyway", GRID, true, sf_budget_exp2_high},
    [SF_BUDGET_SIGMOID] = {"sigmoid", "LSB of Q0.16", "colour: 1/256 of an 8-bit level per LSB", BOTH, true, sf_budget_sigmoid},
    [SF_BUDGET_DENSITY] = {"density integrator: one step", "LSB of U16.12", "thin media", GRID, true, sf_budget_integrate_density},
    [SF_BUDGET_COLOUR] = {"colour integrator: one step", "LSB of Q4.16", "colour", BOTH, true, sf_budget_integrate_colour},
    [SF_BUDGET_INTEGRATORS] = {"integrators: after 8 steps", "LSB of either", "thin media, colour", BOTH, false, sf_budget_integrators},
    [SF_BUDGET_EXP_NEG] = {"exp(-x)", "LSB of Q.20", "thin media on long rays: TRANS_FRAC", BOTH, true, sf_budget_exp_neg},
    [SF_BUDGET_ALPHA] = {"alpha of one sample", "LSB of Q.20", "thin media on long rays: TRANS_FRAC", BOTH, false, sf_budget_alpha},
    [SF_BUDGET_WEIGHT] = {"weight of one sample", "LSB of Q.20", "whether a sample is decoded", PLANES, false, sf_budget_weight},
    [SF_BUDGET_UNDECODED] = {"light of samples not decoded", "LSB of Q0.16", "fog: weight_stop", PLANES, false, sf_budget_undecoded},
    [SF_BUDGET_TRANSMITTANCE] = {"transmittance of a ray", "LSB of Q.20", "errors of one sign in uniform fog", BOTH, false, sf_budget_transmittance},
    [SF_BUDGET_PIXEL] = {"pixel, density and colour given", "LSB of Q0.16", "fog with a change of colour", BOTH, false, sf_budget_pixel},
};
/* clang-format on */

bool sf_budget_has(int32_t backbone, sf_budget_id id)
{
  return blocks[id].fields >> backbone & 1;
}

sf_budget_row sf_budget_measure_planted(sf_budget_id id, uint64_t samples, double plant)
{
  const struct block *b = &blocks[id];
  sf_budget_row row = {
      .block = b->name, .unit = b->unit, .bites = b->bites, .exhaustive = b->exhaustive, .plant = plant};
  b->measure(&row, samples);
  return row;
}

sf_budget_row sf_budget_measure(sf_budget_id id, uint64_t samples)
{
  return sf_budget_measure_planted(id, samples, 0);
}
