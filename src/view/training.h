/* Training on a page of this machine: curves, and a preview of a held-out view. */
#ifndef SF_VIEW_TRAINING_H
#define SF_VIEW_TRAINING_H
#include "train/train.h"
#include "view/view.h"

/* Previews take at most this share of the time; none are made while no page asks. */
#define SF_VIEW_TRAINING_SHARE 0.015

typedef struct sf_view_training sf_view_training;
/* held_out: its first view is previewed; it must outlive this, and may be empty. */
sf_status sf_view_training_open(sf_view_training **training, int port, const sf_dataset *held_out);
const sf_view_server *sf_view_training_server(const sf_view_training *training);
/* After every iteration, from the thread that trains. NULL is fine. */
void sf_view_training_step(sf_view_training *training, const sf_model *model, const sf_train_stats *stats);
/* Seconds that previews have taken. */
double sf_view_training_spent(const sf_view_training *training);
void sf_view_training_close(sf_view_training *training); /* NULL is fine */
#endif
