#include "src/fx/check_tensorf.h"
#include "src/fx/arrays.h"
#include "src/fx/range.h"
#include "src/fx/tensorf.h"
#include "src/fx/unit.h"
#include "src/fx/nofloat.h"

enum { FIELD_BYTES_MAX = 1 << 30, SHIFT_MAX = 40, MUL_MAX = 65535 };

static sf_status check_factors(const fx_factors *factors, const char *name, const char *path)
{
  static const char *const field[] = {"components[0]", "components[1]", "components[2]"};
  for (int pair = 0; pair < FX_PAIRS; pair++)
    SF_TRY(in_range(path, name, field[pair], factors->components[pair], 1, FX_COMPONENTS_MAX));
  return sf_ok();
}

/* Each array is at most 2^28, so the sum cannot overflow. */
int64_t fx_tensorf_bytes(const fx_tensorf *field)
{
  fx_tensorf copy = *field;
  fx_array list[FX_TENSORF_ARRAYS];
  const int n = fx_tensorf_arrays(&copy, list);
  int64_t bytes = 0;
  for (int i = 0; i < n; i++) bytes += (int64_t)fx_array_bytes(&list[i]);
  return bytes;
}

sf_status fx_check_tensorf_sizes(const fx_tensorf *field, int inputs, const char *path)
{
  static const char *const res[] = {"res[0]", "res[1]", "res[2]"};
  for (int axis = 0; axis < 3; axis++)
    SF_TRY(in_range(path, "tensorf", res[axis], field->res[axis], 1, FX_TENSORF_RES_MAX));
  SF_TRY(check_factors(&field->density, "tensorf.density", path));
  SF_TRY(check_factors(&field->appearance, "tensorf.appearance", path));
  SF_TRY(in_range(path, "tensorf", "features", field->features, 1, FX_APPEARANCE_MAX));
  SF_TRY(in_range(path, "tensorf", "feature_freqs", field->feature_freqs, 0, FX_FREQS_MAX));
  SF_TRY(in_range(path, "tensorf", "view_freqs", field->view_freqs, 0, FX_FREQS_MAX));
  const int needed = fx_tensorf_inputs(field);
  SF_TRY(in_range(path, fx_layer_name(FX_C1), "n_in", inputs, needed, needed));
  return in_range(path, "tensorf", "bytes of planes and lines", fx_tensorf_bytes(field), 1, FIELD_BYTES_MAX);
}

static sf_status check_scale(const fx_scale *scale, const char *name, int bias_low, int bias_high, const char *path)
{
  SF_TRY(in_range(path, name, "mul", scale->mul, 0, MUL_MAX));
  SF_TRY(in_range(path, name, "shift", scale->shift, 0, SHIFT_MAX));
  return in_range(path, name, "bias", scale->bias, bias_low, bias_high);
}

static sf_status check_entries(const fx_array *array, const char *path)
{
  const int8_t *entry = *array->data;
  if (!entry) return sf_fail(SF_E_FORMAT, "%s: tensor '%s' is missing", path, array->name);
  for (size_t i = 0; i < fx_array_bytes(array); i++)
    if (entry[i] == INT8_MIN)
      return sf_fail(SF_E_RANGE, "%s: tensor '%s': element %zu is -128, expected -127..127", path, array->name, i);
  return sf_ok();
}

sf_status fx_check_tensorf(const fx_tensorf *field, const char *path)
{
  const int bias = 1 << (FX_ACTIVATION_BITS - 1);
  fx_tensorf copy = *field;
  fx_array list[FX_TENSORF_ARRAYS];
  SF_TRY(in_range(path, "tensorf", "activation", field->activation, FX_SOFTPLUS, FX_RELU));
  SF_TRY(check_scale(&field->density_in, "tensorf.density_in", -bias, bias - 1, path));
  SF_TRY(check_scale(&field->sigma_out, "tensorf.sigma_out", 0, 0, path));
  SF_TRY(check_scale(&field->feature_in, "tensorf.feature_in", 0, 0, path));
  SF_TRY(check_scale(&field->phase_in, "tensorf.phase_in", 0, 0, path));
  SF_TRY(in_range(path, "tensorf", "weight_stop", field->weight_stop, 0, FX_TRANS_ONE - 1));
  SF_TRY(in_range(path, "tensorf", "encoding_frac", field->encoding_frac, 0, FX_DIR_FRAC_MAX));
  const int n = fx_tensorf_arrays(&copy, list);
  for (int i = 0; i < n; i++) SF_TRY(check_entries(&list[i], path));
  return sf_ok();
}
