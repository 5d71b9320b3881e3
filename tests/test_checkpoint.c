/* Checkpoints: a number that is missing, broken or out of its range is refused, at its limits it is taken; what a run
 * cannot start with, and what ends it. */
#include "ck_run.h"
#include "train_fixture.h"
#include "train/vm.h"

static sf_train_options grid_run(void)
{
  sf_train_options o = small_run();
  o.config.hidden = 16, o.config.steps = 4, o.config.lattice = 64, o.config.levels = 2, o.samples = 256;
  o.stage1 = 3, o.stage2 = 12, o.charge = o.opaque = 1;
  return o;
}

static sf_train_options planes_run(void)
{
  sf_train_options o = sf_train_defaults_tensorf(&data);
  o.config.steps = 3, o.config.hidden = 16;
  o.config.occ_res = 16, o.voxels = 20, o.rays = 64, o.samples = 2048, o.stage1 = 3, o.stage2 = 40;
  for (int a = 0; a < 3; a++) o.config.tensorf.resolution[a] = 12 + a;
  return o;
}

/* good.safetensors of the folder */
static void write_after(const sf_train_options *o, int iterations)
{
  OWNED(trainer) t = start(&data, o, NULL);
  steps(t, iterations);
  ck_ok(sf_trainer_save(t, in("good.safetensors"), true));
}

/* The checkpoint with another text of the key, NULL: without it. */
static sf_status resumed_with(const sf_train_options *o, const char *key, const char *value)
{
  OWNED(sf_tensors) set;
  sf_trainer *t;
  ck_ok(sf_tensors_load(&set, in("good.safetensors")));
  ck_assert_msg(cJSON_GetObjectItemCaseSensitive(set.metadata, key) != NULL, "a checkpoint has no '%s'", key);
  cJSON_DeleteItemFromObjectCaseSensitive(set.metadata, key);
  if (value) cJSON_AddStringToObject(set.metadata, key, value);
  ck_ok(sf_tensors_save(set.tensor, set.count, set.metadata, in("edited.safetensors")));
  const sf_status status = sf_trainer_create(&t, &data, o, in("edited.safetensors"));
  ck_assert((t == NULL) == (status.code != SF_OK));
  sf_trainer_free(t);
  return status;
}

/* Every number of the trainer's own: its key, and texts that are none. */
TEST(each_number_is_there_and_is_one)
{
  const sf_train_options grid = grid_run(), planes = planes_run();
  for (int kind = 0; kind < 2; kind++) {
    const sf_train_options *o = kind ? &planes : &grid;
    write_after(o, 4);
    int numbers = 0;
    OWNED(sf_tensors) set;
    const cJSON *item;
    ck_ok(sf_tensors_load(&set, in("good.safetensors")));
    cJSON_ArrayForEach(item, set.metadata)
    {
      if (strncmp(item->string, "train.", 6) != 0 || !strcmp(item->string, "train.views")) continue;
      static const char *const none[] = {NULL, "", "x", "1x", "nan", "inf", "1e16"};
      for (int i = numbers % COUNT(none); i < COUNT(none); i += numbers ? COUNT(none) : 1) /* all texts once */
        ck_bad(resumed_with(o, item->string, none[i]), SF_E_FORMAT, item->string, "is missing or broken");
      numbers++;
    }
    ck_assert_int_eq(numbers, kind ? 46 + 8 + 2 + 5 : 46 + 8 + 2 + 2);
  }
}

/* What is taken at most and at least, and what is refused beyond it. */
TEST(numbers_have_ranges)
{
  static const struct {
    const char *key, *taken[2], *refused[2], *word;
    int backbone; /* 1: planes */
  } rows[] = {{"train.stage", {"1", "3"}, {"0", "4"}, "rays or stride", 0},
              {"train.rays", {"64", "32768"}, {"63", "32769"}, "rays or stride", 0},
              {"train.stride", {"1", "8"}, {"0", "9"}, "rays or stride", 0},
              {"train.iteration", {"0", "999999"}, {"-1", "-2"}, "train.iteration", 0},
              {"train.samples", {"0", "1e14"}, {"-1", "-2"}, "samples", 0},
              {"train.averaged", {"0", "0"}, {"-1", "-2"}, "averaged", 0},
              {"train.progress", {"0", "1"}, {"-0.001", "1.001"}, "train.progress", 0},
              {"train.stage_progress", {"0", "7"}, {"-0.001", "-1"}, "stage_progress", 0},
              {"train.epoch", {"0", "12"}, {"-0.001", "-1"}, "epoch", 0},
              {"train.search_state", {"0", "6"}, {"-1", "7"}, "train.search_state", 0},
              {"train.search_measured", {"0", "99"}, {"-1", "-2"}, "measured", 0},
              {"train.search_fast", {"0", "9"}, {"-0.001", "-1"}, "fast", 0},
              {"train.search_slow", {"0", "9"}, {"-0.001", "-1"}, "slow", 0},
              {"train.search_at", {"0", "1"}, {"-0.001", "1.001"}, "or at is", 0},
              {"train.revived_d1", {"0", "1000000"}, {"-1", "1000001"}, "train.revived", 0},
              {"train.revived_c1", {"0", "1000000"}, {"-1", "1000001"}, "train.revived", 0},
              {"train.revived_c2", {"0", "1000000"}, {"-1", "1000001"}, "train.revived", 0},
              {"train.tail_error", {"0", "9"}, {"-0.001", "-1"}, "train.tail_error", 0},
              {"train.tail_samples", {"0", "99"}, {"-0.001", "-1"}, "tail_samples", 0},
              {"train.vm_event", {"0", "5"}, {"-1", "6"}, "train.vm_event", 1},
              {"train.vm_fresh", {"0", "4"}, {"-1", "5"}, "vm_fresh", 1},
              {"train.vm_fresh_at", {"0", "1"}, {"-0.001", "1.001"}, "vm_fresh_at", 1}};
  const sf_train_options grid = grid_run(), planes = planes_run();
  for (int kind = 0; kind < 2; kind++) {
    const sf_train_options *o = kind ? &planes : &grid;
    write_after(o, 4);
    for (int i = 0; i < COUNT(rows); i++)
      for (int k = 0; k < 2 && rows[i].backbone == kind; k++) {
        ck_ok(resumed_with(o, rows[i].key, rows[i].taken[k]));
        ck_bad(resumed_with(o, rows[i].key, rows[i].refused[k]), SF_E_FORMAT, rows[i].word, "cannot resume");
      }
  }
}

/* In any of its tensors, the optimiser's too. */
TEST(a_number_that_is_none)
{
  const sf_train_options o = grid_run();
  write_after(&o, 2);
  OWNED(sf_tensors) set;
  ck_ok(sf_tensors_load(&set, in("good.safetensors")));
  int tensors = 0;
  for (int i = 0; i < set.count; i++) {
    if (set.tensor[i].type != SF_F32) continue;
    float *value = set.tensor[i].data;
    const float before = *value;
    sf_trainer *t;
    *value = NAN;
    ck_ok(sf_tensors_save(set.tensor, set.count, set.metadata, in("edited.safetensors")));
    const sf_status status = sf_trainer_create(&t, &data, &o, in("edited.safetensors"));
    ck_assert_int_ne(status.code, SF_OK);
    ck_assert_msg(strstr(status.message, set.tensor[i].name), "'%s' does not name '%s'", status.message,
                  set.tensor[i].name);
    *value = before;
    tensors++;
  }
  ck_assert_int_gt(tensors, 18); /* six of the model, and twice as many of Adam */
}

/* A run with other backbone or rays in NDC than the checkpoint's. */
TEST(a_checkpoint_of_another_kind)
{
  const sf_train_options grid = grid_run(), planes = planes_run();
  sf_trainer *t;
  write_after(&planes, 2);
  const char *good = in("good.safetensors");
  ck_bad(sf_trainer_create(&t, &data, &grid, good), SF_E_RANGE, good, "of the other backbone");
  sf_dataset forward = data;
  forward.ndc = true;
  ck_bad(sf_trainer_create(&t, &forward, &planes, good), SF_E_RANGE, good, "without NDC, the data is in it");
}

TEST(a_view_without_a_picture)
{
  const sf_train_options o = grid_run();
  sf_trainer *t;
  uint16_t *const picture = data.view[2].image.rgba;
  data.view[2].image.rgba = NULL;
  ck_bad(sf_trainer_create(&t, &data, &o, NULL), SF_E_FORMAT, data.view[2].name, "has no picture");
  ck_assert_ptr_null(t);
  data.view[2].image.rgba = picture;
}

TEST(more_fixed_steps_than_there_are)
{
  sf_train_options o = grid_run();
  sf_trainer *t;
  for (int steps = -1; steps <= 5; steps += 6) {
    o.fixed_steps = steps;
    ck_bad(sf_trainer_create(&t, &data, &o, NULL), SF_E_RANGE, "fixed steps", "the model has 4");
  }
  o.fixed_steps = 4;
  sf_trainer_free(start(&data, &o, NULL));
}

/* A weight that is not a number, or so large that the gradients are: the iteration ends the run and says why. */
TEST(numbers_that_went_wrong)
{
  static const struct {
    float weight;
    const char *word;
  } rows[] = {{NAN, "the loss is "}, {INFINITY, "iteration 2"}};
  for (int i = 0; i < COUNT(rows); i++) {
    sf_train_options o = grid_run();
    OWNED(trainer) t = start(&data, &o, NULL);
    sf_train_stats stats;
    steps(t, 2);
    for (int k = 0; k < 16; k++) sf_model_param(&t->model, SF_P_C3)[k] = rows[i].weight;
    ck_bad(sf_trainer_step(t, &stats), SF_E_RANGE, rows[i].word, "train: ");
    ck_assert_int_ne(sf_trainer_save(t, in("wrong.safetensors"), true).code, SF_OK); /* the last good one stays */
  }
}

static void set_up(void)
{
  open_scene(4);
}

ck_options ck_program = {.set_up_all = set_up, .tear_down_all = close_scene, .one_process = true};
