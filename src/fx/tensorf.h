/* Inside src/fx: TensoRF's field at a point. */
#ifndef SF_FX_TENSORF_H
#define SF_FX_TENSORF_H
#include "fx/fx.h"

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
void fx_tensorf_count_density(const fx_tensorf *field, fx_counts *counts); /* of one position; counts may be NULL */
/* Sum of the density's products to density: see fx_tensorf. */
uint32_t fx_tensorf_activate(const fx_tensorf *field, int64_t sum);

/* Lattice point n at pos through density and compositing; its weight, or 0 when it does not reach the decoder. */
uint32_t fx_tensorf_weight(const fx_scene *scene, const fx_vm *vm, const fx_ray *ray, int32_t n, const uint32_t pos[3],
                           fx_pixel *pixel, fx_counts *counts);
#endif
