/* Checkpoints and the model of a run, on rank 0. Nothing that stands in their place is lost before the run is finished.
 */
#ifndef SF_TOOLS_TRAIN_KEEPER_H
#define SF_TOOLS_TRAIN_KEEPER_H
#include "cli/cli.h"
#include "tools/train/options.h"
#include "train/train.h"

/* What the run has saved, and what it could not. */
typedef struct keeper {
  bool good;     /* there is a checkpoint */
  bool told;     /* that there could be none */
  bool finished; /* the model is saved, in place of a checkpoint */
  bool begun;    /* what stands there is of this run */
  bool aside;    /* what stood there of another run is OUTPUT.before, until this run is finished */
} keeper;

/* A disk that is full now may not be later, and a model is smaller: only what must be saved now has to be. */
sf_status keeper_checkpoint(const sf_trainer *trainer, const train_arguments *a, bool now, sf_progress *progress,
                            keeper *k);
/* The evaluation can be interrupted, too. Where no checkpoint can be written, the model itself may still fit. */
sf_status keeper_learned(const sf_trainer *trainer, const train_arguments *a, keeper *k);
/* The model, in place of the checkpoint. */
sf_status keeper_finish(const sf_trainer *trainer, const train_arguments *a, keeper *k);
/* Where the file of another run is kept. */
const char *keeper_before(const train_arguments *a);
#endif
