/* Densities along one ray through a TensoRF field. */
#ifndef SF_RENDER_VM_RAY_H
#define SF_RENDER_VM_RAY_H
#include "render/march.h"
#include "snn/kernels.h"

enum { SF_RAY_SAMPLES = SF_STEPS_MAX }; /* of a ray at most */

/* The samples of a ray in occupied cells, front to back, until it is opaque; each array has room for SF_RAY_SAMPLES. */
typedef struct sf_vm_samples {
  float *x;             /* [n][3] in [0,1]^3 */
  float *sigma, *slope; /* density per model unit, and its slope by the feature */
  float *weight;        /* composited */
  int *lattice;         /* their lattice points, or NULL */
} sf_vm_samples;

/* Returns n; the transmittance behind the last. */
int sf_vm_ray(const sf_kernels *kernels, const sf_vm_field *density, const sf_march *march, sf_vm_samples samples,
              float *transmittance);

/* What the decoder's inputs have of a direction, once per ray: the direction and its encodings, as the scales round
 * them. */
typedef struct sf_vm_direction {
  float value[3 + 6 * SF_FREQS_MAX];
} sf_vm_direction;
sf_vm_direction sf_vm_encode_direction(const sf_model *model, const float direction[3]);
/* into the rows of `in` [inputs][SF_BLOCK] at `lane`. */
void sf_vm_put_direction(const sf_tensorf *field, const sf_vm_direction *direction, float *in, int lane);
#endif
