/* Inside src/quant: TensoRF's field and decoder to integers. */
#ifndef SF_QUANT_TENSORF_H
#define SF_QUANT_TENSORF_H
#include "src/quant/internal.h"

/* Points that a ray sees, with random directions, and what the float decoder does there. Layers C1, C2, C3 are 0, 1, 2;
 * rows are samples x steps, but for C1, whose current is constant. */
typedef struct sf_vm_calibration {
  int samples, steps, hidden, n_features, n_inputs;
  uint32_t *pos;      /* [samples][3] Q0.24 of the field's box */
  float *direction;   /* [samples][3] */
  float *features;    /* [samples][n_features] */
  float *inputs;      /* [samples][n_inputs] of the decoder */
  float *current[3];  /* [samples][hidden], [rows][hidden], [rows][3] */
  uint8_t *spikes[2]; /* [rows][hidden] of C1, C2 */
} sf_vm_calibration;
sf_status sf_vm_calibrate(sf_vm_calibration *calibration, const sf_model *model, int steps, uint64_t seed);
void sf_vm_calibration_free(sf_vm_calibration *calibration);

static inline void sf_vm_position(const uint32_t pos[3], float x[3])
{
  for (int axis = 0; axis < 3; axis++) x[axis] = (float)pos[axis] * 0x1p-24f;
}

/* Planes, lines, and the scales from their products to density and features. scene->tensorf is allocated. */
sf_status sf_quantise_factors(fx_scene *scene, const sf_model *model, const char *name,
                              const sf_vm_calibration *calibration, sf_quant_report *report);
/* The decoder's layers; the field is ready. */
sf_status sf_quantise_decoder(fx_scene *scene, const sf_model *model, const char *name,
                              const sf_vm_calibration *calibration, sf_quant_report *report);
/* Everything of a TensoRF scene but what all scenes share (mode, steps, background, leaks). */
void sf_tensorf_set_sizes(fx_scene *scene, const sf_model *model);
void sf_tensorf_set_scalars(fx_scene *scene, const sf_model *model);
/* The rest: calibrates and fits. Sizes and scalars are set, the scene is allocated. */
sf_status sf_quantise_tensorf(fx_scene *scene, const sf_model *model, const char *name, const sf_quant_options *options,
                              sf_quant_report *report);
#endif
