/* sf_train --view: the page beside the training. */
#ifndef SF_TOOLS_TRAIN_WATCH_H
#define SF_TOOLS_TRAIN_WATCH_H
#include "tools/train/options.h"
#include "view/training.h"

typedef struct train_watch {
  sf_dataset held_out;    /* its first view */
  sf_view_training *page; /* NULL: without --view */
} train_watch;
/* Says where the page is. Close it even after a failure. */
sf_status train_watch_open(train_watch *watch, const train_arguments *a, const char *data,
                           const sf_dataset_options *how);
void train_watch_close(train_watch *watch);
#endif
