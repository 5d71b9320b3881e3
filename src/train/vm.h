/* What the files of the TensoRF backbone share. Densities come first, ray by ray; their weights decide which samples
 * reach the decoder, and those alone fill blocks. */
#ifndef SF_TRAIN_VM_H
#define SF_TRAIN_VM_H
#include "render/vm_ray.h"
#include "train/internal.h"

/* Samples of the rays of one part of the batch, ray after ray. */
typedef struct sf_vm_part {
  float *x, *sigma, *slope, *weight; /* x [capacity][3]; slope becomes the gradient of the density feature */
  int used, capacity;
} sf_vm_part;

typedef struct sf_vm_ray_samples {
  int part, first, count;
  float light, undecoded; /* what all samples take of the ray's light, and those that the decoder does not see */
} sf_vm_ray_samples;

typedef struct sf_vm {
  sf_vm_field density, appearance; /* of the current parameters */
  sf_decoder_words *decoder;
  sf_vm_part part[GROUPS];
  sf_vm_ray_samples *ray; /* [RAYS_MAX] */
  float *x, *dproduct;    /* of the lanes of the batch: [lanes][3], [lanes][products] */
  int lanes_capacity;
  float *wire; /* between ranks */
  size_t wire_capacity;
  int event;               /* of the schedule, to come */
  int64_t fresh;           /* iteration at which the optimiser started anew */
  double fresh_at;         /* progress there */
  double light, undecoded; /* what samples take of the rays' light, all and undecoded ones: recent iterations */
} sf_vm;

sf_status sf_vm_draw(sf_trainer *trainer);
/* Room for so many samples. */
sf_status sf_vm_part_reserve(sf_vm_part *part, int samples);
/* The rays and samples of the ranks' parts to all. */
sf_status sf_vm_share_draw(sf_trainer *trainer);
/* Those of sf_backbone. */
sf_status sf_vm_prepare(sf_trainer *trainer, const sf_loss_plan *plan);
void sf_vm_bundle(sf_trainer *trainer, const sf_loss_plan *plan, const sf_bundle *bundle, sf_worker *worker,
                  sf_group *group);
sf_status sf_vm_share(sf_trainer *trainer);
void sf_vm_collect(sf_trainer *trainer, const void *grad);
void sf_vm_update(sf_trainer *trainer);
/* Runs what the schedule asks for at the current progress: masks, shrinking, upsampling. */
sf_status sf_vm_grow(sf_trainer *trainer);

/* The field on other grid points, as many as resolution says: point i of axis a lies where point start + i * stride of
 * the old grid lay, which is inside the old grid. Replaces the parameters and clears the optimiser. */
sf_status sf_vm_resample(sf_trainer *trainer, const sf_tensorf *field, const double start[3], const double stride[3]);
/* The alpha mask from the densities: cells of the occupancy grid near a point with alpha above `share` of the
 * threshold. */
sf_status sf_vm_mask(sf_trainer *trainer, double share, bool within_old);
/* Cuts the box to what the mask holds, at grid points, so that no value changes. The mask is of the old box still. */
sf_status sf_vm_shrink(sf_trainer *trainer);
#endif
