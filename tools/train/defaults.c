/* What the options of sf_train are without being given. */
#include "tools/train/options.h"

void train_field_defaults(train_arguments *a, const sf_dataset *data)
{
  sf_ranks *ranks = a->train.ranks;
  a->train = data ? sf_train_defaults_tensorf(data) : sf_train_defaults();
  a->train.ranks = ranks;
  a->theta = (double)a->train.config.theta[0];
}

void train_option_defaults(train_arguments *a, const sf_dataset *data)
{
  *a = (train_arguments){.output = "model.safetensors", .checkpoint_minutes = 2, .gamma = -1, .view = -1};
  train_field_defaults(a, data);
}
