/* Operations whose energy a technology knows as a whole, from a netlist (make asic-energy). */
#include "energy/ledger.h"

bool sf_operation_measured(const sf_technology *technology, bool twin, int row, int part, uint64_t *fj)
{
  switch (part) {
  case SF_PART_MAC:
    return sf_price_measured(technology, twin ? SF_PRICE_TWIN_MAC : SF_PRICE_MAC, fj);
  case SF_PART_SOP:
    return sf_price_measured(technology, SF_PRICE_SOP, fj);
  case SF_PART_NEURON:
    return !twin && row < SF_LAYERS &&
           sf_price_measured(technology, fx_layer_fires(row) ? SF_PRICE_NEURON : SF_PRICE_INTEGRATOR, fj);
  case SF_PART_SPECIAL:
    return sf_price_measured(technology, SF_PRICE_SPECIAL, fj);
  default:
    return false;
  }
}
