/* Configuration of the float model: defaults and ranges. */
#include "snn/model.h"

sf_config sf_config_default(void)
{
  return (sf_config){.net = SF_NET_SNN,
                     .mode = SF_HYBRID,
                     .steps = SF_T_MAX,
                     .levels = 16,
                     .log2_hash = 19,
                     .base_res = 16,
                     .finest_res = 2048,
                     .hidden = 128,
                     .theta = {1, 1, 1},
                     .scale = 0.8f,
                     .lattice = 1024,
                     .occ_res = 128,
                     .bound = 1};
}

void sf_config_bound(sf_config *c, int bound)
{
  c->bound = bound;
  c->dt_gamma = bound > 1 ? 1.0f / 128 : 0;
  c->finest_res = bound < 16 ? 2048 * bound : 32768;
}

static sf_status check_range(const char *name, double value, double low, double high)
{
  if (!(value >= low && value <= high))
    return sf_fail(SF_E_RANGE, "model config: %s = %g is outside %g..%g", name, value, low, high);
  return sf_ok();
}

sf_status sf_config_check(const sf_config *c)
{
  SF_TRY(check_range("net", c->net, SF_NET_SNN, SF_NET_ANN));
  SF_TRY(check_range("mode", c->mode, SF_HYBRID, SF_NODECAY));
  SF_TRY(check_range("steps", c->steps, 1, c->net == SF_NET_ANN ? 1 : SF_T_MAX));
  SF_TRY(check_range("levels", c->levels, 1, 16));
  SF_TRY(check_range("log2_hash", c->log2_hash, 4, 24));
  SF_TRY(check_range("base_res", c->base_res, 2, 4096));
  SF_TRY(check_range("finest_res", c->finest_res, c->base_res, 32768));
  SF_TRY(check_range("hidden", c->hidden, 16, SF_LANES));
  if (c->hidden % 16) return sf_fail(SF_E_RANGE, "model config: hidden = %d is not a multiple of 16", c->hidden);
  for (int i = 0; i < 3; i++) SF_TRY(check_range("theta", c->theta[i], 1e-6, 1e6));
  SF_TRY(check_range("scale", c->scale, 1e-6, 1e6));
  SF_TRY(check_range("lattice", c->lattice, SF_LATTICE_MIN, 1024));
  SF_TRY(check_range("occ_res", c->occ_res, 8, 256));
  if (c->occ_res & (c->occ_res - 1))
    return sf_fail(SF_E_RANGE, "model config: occ_res = %d is not a power of two", c->occ_res);
  SF_TRY(check_range("bound", c->bound, 1, 64));
  if (c->bound & (c->bound - 1)) return sf_fail(SF_E_RANGE, "model config: bound = %d is not a power of two", c->bound);
  SF_TRY(check_range("dt_gamma", c->dt_gamma, 0, SF_GAMMA_MAX));
  SF_TRY(check_range("backbone", c->backbone, SF_INGP, SF_TENSORF));
  if (c->backbone == SF_TENSORF && (c->bound != 1 || c->dt_gamma > 0))
    return sf_fail(SF_E_RANGE, "model config: bound = %d and dt_gamma = %g with TensoRF, expected 1 and 0", c->bound,
                   (double)c->dt_gamma);
  if (c->backbone == SF_TENSORF) return sf_tensorf_check(&c->tensorf);
  sf_steps steps;
  return sf_steps_make(&steps, c, 1);
}
