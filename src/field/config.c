/* Configuration of the float model: which field it has, and the ranges of its numbers. */
#include "field/field.h"

const sf_field *sf_field_of(const sf_config *config)
{
  static const sf_field *const field[SF_FIELDS] = {[SF_INGP] = &sf_field_grid, [SF_TENSORF] = &sf_field_planes};
  return field[config->backbone];
}

sf_status sf_steps_make(sf_steps *steps, const sf_config *config, int stride)
{
  return sf_field_of(config)->steps(steps, config, stride);
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
  SF_TRY(check_range("mode", c->mode, SF_HYBRID, c->along ? SF_NODECAY : SF_RADIX));
  SF_TRY(check_range("along_ray", c->along, 0, c->net == SF_NET_ANN ? 0 : 1));
  SF_TRY(check_range("steps", c->steps, 1, c->net == SF_NET_ANN || c->along ? 1 : SF_T_MAX));
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
  SF_TRY(check_range("stop", c->stop, SF_STOP_MIN, SF_STOP_MAX));
  SF_TRY(check_range("backbone", c->backbone, 0, SF_FIELDS - 1));
  return sf_field_of(c)->check(c);
}
