#include "src/fx/arrays.h"
#include "src/fx/tensorf.h"
#include "src/fx/nofloat.h"

static int list_factors(fx_factors *f, const int32_t res[3], const char *const *names, fx_array *list)
{
  for (int pair = 0; pair < FX_PAIRS; pair++) {
    const int32_t *axes = fx_pair_axes[pair];
    const int64_t n = f->components[pair];
    list[pair] = (fx_array){names[pair], &f->plane[pair], 3, {res[axes[1]], res[axes[0]], n}};
    list[FX_PAIRS + pair] = (fx_array){names[FX_PAIRS + pair], &f->line[pair], 2, {res[axes[2]], n}};
  }
  return 2 * FX_PAIRS;
}

int fx_tensorf_arrays(fx_tensorf *field, fx_array list[FX_TENSORF_ARRAYS])
{
  static const char *const density[] = {"density_plane.0", "density_plane.1", "density_plane.2",
                                        "density_line.0",  "density_line.1",  "density_line.2"};
  static const char *const appearance[] = {"app_plane.0", "app_plane.1", "app_plane.2",
                                           "app_line.0",  "app_line.1",  "app_line.2"};
  int n = list_factors(&field->density, field->res, density, list);
  n += list_factors(&field->appearance, field->res, appearance, list + n);
  list[n++] = (fx_array){"basis_mat", &field->basis, 2, {fx_factors_components(&field->appearance), FX_APPEARANCE_MAX}};
  return n;
}

size_t fx_array_bytes(const fx_array *array)
{
  size_t size = 1;
  for (int i = 0; i < array->dims; i++) size *= (size_t)array->shape[i];
  return size;
}
