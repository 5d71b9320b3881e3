/* Inside src/fx: pieces shared by check.c, scene.c, file.c. */
#ifndef SF_FX_SCENE_H
#define SF_FX_SCENE_H
#include "fx/fx.h"

enum { FX_DIMENSION_MAX = 3 };

/* Sizes alone: everything that memory is allocated and indexed by. */
sf_status fx_check_sizes(const fx_scene *scene, const char *path);
uint64_t fx_grid_bytes(const fx_grid *grid); /* read for one sample */
size_t fx_occupancy_bytes(const fx_scene *scene);

static inline sf_status in_range(const char *path, const char *owner, const char *field, int64_t value, int64_t low,
                                 int64_t high)
{
  if (value >= low && value <= high) return sf_ok();
  return sf_fail(SF_E_RANGE, "%s: %s.%s is %lld, expected %lld..%lld", path, owner, field, (long long)value,
                 (long long)low, (long long)high);
}

/* TensoRF's arrays, all of int8. */
enum { FX_TENSORF_ARRAYS = 4 * FX_PAIRS + 1 };
typedef struct fx_array {
  const char *name; /* of its tensor */
  int8_t **data;
  int dims;
  int64_t shape[FX_DIMENSION_MAX];
} fx_array;
int fx_tensorf_arrays(fx_tensorf *field, fx_array list[FX_TENSORF_ARRAYS]); /* sizes are set; returns their number */
size_t fx_array_bytes(const fx_array *array);
sf_status fx_check_tensorf_sizes(const fx_tensorf *field, int inputs, const char *path); /* inputs: of the decoder */
sf_status fx_check_tensorf(const fx_tensorf *field, const char *path);                   /* the rest */

/* TensoRF's pairs: first and second axis of the plane, axis of the line. */
extern const int fx_pair_axes[FX_PAIRS][3];
int fx_factors_components(const fx_factors *factors); /* of all pairs */
/* The reads of planes and lines: see tensorf_isa.h. */
typedef struct fx_vm {
  int64_t (*density)(const fx_tensorf *field, const uint32_t pos[3]); /* sum of products */
  void (*features)(const fx_tensorf *field, const uint32_t pos[3], int32_t sum[FX_APPEARANCE_MAX]);
} fx_vm;
extern const fx_vm fx_vm_portable;
/* fx_tensorf_density, fx_tensorf_encode. */
uint32_t fx_vm_sigma(const fx_tensorf *field, const fx_vm *vm, const uint32_t pos[3], fx_counts *counts);
void fx_vm_encode(const fx_tensorf *field, const fx_vm *vm, const uint32_t pos[3], const int16_t unit[3], int16_t *x,
                  fx_counts *counts);
/* Sum of the density's products to density: see fx_tensorf. */
uint32_t fx_tensorf_activate(const fx_tensorf *field, int64_t sum);

/* Lattice point n at pos through density and compositing; its weight, or 0 when it does not reach the decoder. */
uint32_t fx_tensorf_weight(const fx_scene *scene, const fx_vm *vm, const fx_ray *ray, int32_t n, const uint32_t pos[3],
                           fx_pixel *pixel, fx_counts *counts);

/* Real-valued metadata as text (C hexadecimal notation: exact). Declared here so that the firmware, which has no
 * cJSON, can share the rest. */
typedef struct cJSON cJSON;
void fx_reals_write(cJSON *metadata, const fx_scene *scene);
sf_status fx_reals_read(const cJSON *metadata, fx_scene *scene, const char *path);
sf_status fx_reals_check(const fx_scene *scene, const char *path);
#endif
