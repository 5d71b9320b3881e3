#include "tools/train/watch.h"

sf_status train_watch_open(train_watch *watch, const train_arguments *a, const char *data,
                           const sf_dataset_options *how)
{
  sf_dataset_options one = *how;
  one.limit = 1;
  *watch = (train_watch){0};
  if (a->view < 0 || sf_ranks_rank(a->train.ranks)) return sf_ok();
  SF_TRY(sf_dataset_load(&watch->held_out, data, "test", &one));
  SF_TRY(sf_view_training_open(&watch->page, a->view, &watch->held_out));
  fprintf(stderr, "sf_train: watch it at %s\n", sf_view_url(sf_view_training_server(watch->page)));
  sf_view_browse(sf_view_training_server(watch->page));
  return sf_ok();
}

void train_watch_close(train_watch *watch)
{
  sf_view_training_close(watch->page);
  sf_dataset_free(&watch->held_out);
}
