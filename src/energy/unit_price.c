/* What one event costs: the widths and memories of the hardware at the prices of a technology. */
#include "energy/energy.h"

/* ---- which ledger prices what ---- */

static bool is_integer(int ledger)
{
  return ledger != SF_LEDGER_PAPER && ledger != SF_LEDGER_ANN;
}

static bool has_everything(int ledger)
{
  return ledger == SF_LEDGER_NEURON || ledger == SF_LEDGER_SHARED || ledger == SF_LEDGER_INT_ALL ||
         ledger == SF_LEDGER_INT_SHARED;
}

static bool has_memory(int ledger)
{
  return has_everything(ledger) || ledger == SF_LEDGER_MEMORY || ledger == SF_LEDGER_INT_MEMORY;
}

static bool priced(int ledger, int part)
{
  switch (part) {
  case SF_PART_MAC:
  case SF_PART_SOP:
    return true;
  case SF_PART_WEIGHT:
  case SF_PART_STATE:
  case SF_PART_LOOKUP:
  case SF_PART_FILL:
  case SF_PART_FRAME:
    return has_memory(ledger);
  default:
    return has_everything(ledger);
  }
}

/* ---- sizes ---- */

enum { WORD = 64 /* bits of an access */ };

static int bits_of(int n) /* ceil(log2 n) */
{
  int bits = 0;
  while (1 << bits < n) bits++;
  return bits;
}

int sf_sum_bits(const fx_layer *layer, bool of_products)
{
  return SF_WEIGHT_BITS + (of_products ? SF_INPUT_BITS - 1 : 0) + bits_of(layer->n_in);
}

uint64_t sf_row_accesses(const fx_layer *layer)
{
  return ((uint64_t)layer->n_out * SF_WEIGHT_BITS + WORD - 1) / WORD;
}

uint64_t sf_weights_size(const fx_layer *layer)
{
  return (uint64_t)layer->n_in * (uint64_t)layer->n_out;
}

/* ---- arithmetic ---- */

/* So many operations at a time; *interpolated as in ledger.h. */
typedef struct pricing {
  const sf_technology *tech;
  bool *interpolated;
} pricing;

static uint64_t adds(const pricing *p, int n, int bits)
{
  return (uint64_t)n * sf_price_add(p->tech, bits, p->interpolated);
}

static uint64_t products(const pricing *p, int n, int a_bits, int b_bits)
{
  return (uint64_t)n * sf_price_multiply(p->tech, a_bits, b_bits, p->interpolated);
}

enum { ACTIVATION_BITS = 8, TWIN_SUM_BITS = 32, REQUANTISE_BITS = 16, K_BITS = SF_LEAK_FRAC + 1 };
enum { TABLE_ENTRIES = 257, TABLE_ENTRY_BYTES = 4, SCALE_BITS = 16, FRACTION_BITS = 12 };

/* Scale the argument, read two neighbours of the table, interpolate between them: two multiplications, two additions.
 * An entry of 32 bits is an access. */
static uint64_t special_fj(const pricing *p, int argument_bits, int result_bits)
{
  return products(p, 1, argument_bits, SCALE_BITS) + products(p, 1, SCALE_BITS, FRACTION_BITS) +
         adds(p, 2, result_bits) + 2 * sf_price_access(p->tech, TABLE_ENTRIES * TABLE_ENTRY_BYTES, p->interpolated);
}

/* Difference from the membrane times the leak, added; compared with the threshold, which a spike takes off. Of radix
 * the leak is a shift, and an update is two additions: it compares and takes off; or it adds a sum to C2's membrane,
 * and the last of those also compares and takes off. T - 1 and T of them are 3 T - 1 additions, which 2 for each of 2 T
 * - 1 updates are not below. The integrators of D2 and C3 neither compare nor reset, and have no threshold. */
static uint64_t neuron_fj(const pricing *p, const fx_net *net, int l)
{
  const int bits = fx_layer_state_bits(l, net->mode);
  if (net->mode == FX_RADIX) return adds(p, fx_layer_fires(l) ? 2 : 1, bits);
  return products(p, 1, bits, K_BITS) + adds(p, fx_layer_fires(l) ? 4 : 2, bits);
}

/* What comes with the density's special function in radix mode: each h is a sum times 1 / (2^T - 1). */
static uint64_t means_fj(const pricing *p, const fx_net *net, int l)
{
  const int bits = fx_layer_state_bits(FX_D2, net->mode);
  if (net->mode != FX_RADIX || l != FX_D2) return 0;
  return products(p, fx_net_h(net), bits, SCALE_BITS + 1) + adds(p, fx_net_h(net), bits);
}

enum { ENTRY_BITS = 8, CELL_BITS = 9, CORNER_BITS = 17, FIELD_SUM_BITS = 24, ADDRESS_BITS = 32, LATTICE_BITS = 12 };

/* A level: the position times its scale, per axis; weights of the corners, four products along x and y, four along z;
 * y and z times their factors (of the hash, or the stride), and an address for each corner. */
static uint64_t grid_place_fj(const pricing *p)
{
  return products(p, 3, SF_POS_FRAC, ADDRESS_BITS) + adds(p, 3, ADDRESS_BITS) + products(p, 4, CELL_BITS, CELL_BITS) +
         products(p, 4, CORNER_BITS, CELL_BITS) + adds(p, 4, CORNER_BITS) + products(p, 2, LATTICE_BITS, ADDRESS_BITS) +
         adds(p, 8, ADDRESS_BITS);
}

/* A position: its place on three axes; of each pair four weights, and addresses of four points and two. */
static uint64_t tensorf_place_fj(const pricing *p)
{
  return products(p, 3, SF_POS_FRAC, LATTICE_BITS) + adds(p, 3, ADDRESS_BITS) +
         products(p, 4 * FX_PAIRS, CELL_BITS, CELL_BITS) + products(p, 6 * FX_PAIRS, LATTICE_BITS, LATTICE_BITS) +
         adds(p, 6 * FX_PAIRS, ADDRESS_BITS);
}

enum { AXIS_BITS = 16, HARMONIC_BITS = 18 };

/* Products of two axes, their sums, and two products for each harmonic: fx/sh.c. */
static uint64_t harmonics_fj(const pricing *p)
{
  return products(p, 6, AXIS_BITS, AXIS_BITS) + adds(p, 9, HARMONIC_BITS) +
         products(p, 2 * FX_SH, HARMONIC_BITS, HARMONIC_BITS);
}

/* Optical depth, weight, three colours and the distance, each added up; what is left of the light. */
static uint64_t composite_fj(const pricing *p)
{
  const int light = SF_TRANS_FRAC + 1, sum = light + SF_COLOUR_BITS;
  return products(p, 1, SF_SIGMA_BITS, SF_DELTA_FRAC) + products(p, 1, light, light) +
         products(p, 3, light, SF_COLOUR_BITS) + products(p, 1, light, ADDRESS_BITS) + adds(p, 4, sum) +
         adds(p, 2, light);
}

/* ---- units ---- */

static uint64_t layer_fj(const pricing *p, const fx_net *net, int ledger, int l, int part)
{
  const fx_layer *layer = &net->layer[l];
  const bool twin = sf_ledger_is_twin(ledger);
  uint64_t measured;
  if (sf_operation_measured(p->tech, twin, l, part, &measured)) return measured;
  switch (part) {
  case SF_PART_MAC:
    if (twin) return products(p, 1, ACTIVATION_BITS, SF_WEIGHT_BITS) + adds(p, 1, TWIN_SUM_BITS);
    return products(p, 1, SF_INPUT_BITS, SF_WEIGHT_BITS) + adds(p, 1, sf_sum_bits(layer, true));
  case SF_PART_SOP:
    return adds(p, 1, sf_sum_bits(layer, false));
  case SF_PART_WEIGHT:
    return sf_row_accesses(layer) * sf_price_access(p->tech, sf_weights_size(layer), p->interpolated);
  case SF_PART_STATE:
    return sf_price_register(p->tech, twin ? ACTIVATION_BITS : fx_layer_state_bits(l, net->mode), p->interpolated);
  case SF_PART_NEURON:
    if (twin) return products(p, 1, TWIN_SUM_BITS, REQUANTISE_BITS) + adds(p, 1, TWIN_SUM_BITS);
    return neuron_fj(p, net, l);
  case SF_PART_SPECIAL:
    return (twin ? 0 : means_fj(p, net, l)) +
           special_fj(p, twin ? TWIN_SUM_BITS : sf_sum_bits(layer, false), l == FX_D2 ? SF_SIGMA_BITS : SF_COLOUR_BITS);
  default:
    return 0;
  }
}

/* A line is read from DRAM and written to the cache in words. */
static uint64_t field_fj(const pricing *p, const sf_counted *counted, int part)
{
  const bool grid = counted->scene->backbone == FX_INGP;
  const uint64_t cache = (uint64_t)counted->cache.bytes, words = 8 * FX_LINE / WORD;
  uint64_t tags, special;
  switch (part) {
  case SF_PART_LOOKUP:
    if (!sf_price_measured(p->tech, SF_PRICE_TAG_LOOKUP, &tags)) tags = 0;
    return tags + sf_price_access(p->tech, cache, p->interpolated);
  case SF_PART_FILL:
    return words *
           (sf_price_access(p->tech, UINT64_MAX, p->interpolated) + sf_price_access(p->tech, cache, p->interpolated));
  case SF_PART_SPECIAL:
    if (grid) return 0;
    if (sf_price_measured(p->tech, SF_PRICE_SPECIAL, &special)) return special;
    return special_fj(p, FIELD_SUM_BITS, FIELD_SUM_BITS);
  case SF_PART_PRODUCT:
    return products(p, 1, CORNER_BITS, ENTRY_BITS) + adds(p, 1, FIELD_SUM_BITS);
  case SF_PART_PLACE:
    return grid ? grid_place_fj(p) : tensorf_place_fj(p);
  default:
    return 0;
  }
}

static uint64_t ray_fj(const pricing *p, const sf_counted *counted, int part)
{
  uint64_t special;
  switch (part) {
  case SF_PART_FRAME:
    return sf_price_access(p->tech, UINT64_MAX, p->interpolated);
  case SF_PART_SPECIAL:
    if (sf_price_measured(p->tech, SF_PRICE_SPECIAL, &special)) return special;
    return special_fj(p, SF_TRANS_FRAC, SF_TRANS_FRAC);
  case SF_PART_PRODUCT:
    return composite_fj(p);
  case SF_PART_PLACE:
    return counted->scene->backbone == FX_INGP ? harmonics_fj(p) : 0;
  default:
    return 0;
  }
}

sf_unit_price sf_unit_price_of(const sf_technology *technology, const sf_counted *counted, int ledger, int row,
                               int part)
{
  sf_unit_price unit = {0, false};
  const pricing p = {technology, &unit.interpolated};
  const fx_net *net = &counted->scene->net;
  if (!priced(ledger, part)) return unit;
  if (row == SF_ROW_FIELD)
    unit.fj = field_fj(&p, counted, part);
  else if (row == SF_ROW_RAY)
    unit.fj = ray_fj(&p, counted, part);
  else if (net->layer[row].n_out == 0)
    return unit;
  else if (is_integer(ledger))
    unit.fj = layer_fj(&p, net, ledger, row, part);
  else /* these families have one price each and stand first */
    unit.fj = technology->price[part == SF_PART_MAC ? SF_PRICE_FP32_MAC : SF_PRICE_FP32_ADD].fj;
  return unit;
}
