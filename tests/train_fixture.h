/* A small scene and small training runs. */
#ifndef SF_TESTS_TRAIN_FIXTURE_H
#define SF_TESTS_TRAIN_FIXTURE_H
#include "folder_fixture.h"
#include "train/internal.h"
#include <math.h>

enum { T = 6 };

static inline void make_scene(int views)
{
  make_folder();
  const sf_procedural_options o = {.width = 24, .height = 24, .train_views = views, .test_views = 1, .seed = 1};
  ck_ok(sf_procedural_write("simple", in("scene"), &o, NULL, NULL));
}

static inline sf_dataset load(const char *split)
{
  sf_dataset data;
  ck_ok(sf_dataset_load(&data, in("scene"), split, &(sf_dataset_options){.downscale = 1}));
  return data;
}

static sf_dataset data; /* the views that a program's tests train on */

static inline void open_scene(int views)
{
  make_scene(views);
  data = load("train");
}

static inline void close_scene(void)
{
  sf_dataset_free(&data);
  remove_folder();
}

/* The same pictures, taken for those of a forward-facing scene. view[from->count] is the result's. */
static inline sf_dataset facing_forward(const sf_dataset *from, sf_view *view)
{
  sf_dataset forward = *from;
  memcpy(view, from->view, (size_t)from->count * sizeof *view);
  for (int v = 0; v < from->count; v++) {
    const float pose[12] = {1, 0, 0, 0.1f * (float)(v - 3), 0, 1, 0, 0.05f * (float)(v % 2), 0, 0, 1, 0};
    memcpy(view[v].camera.to_world, pose, sizeof pose);
  }
  forward.view = view, forward.layout = SF_LAYOUT_LLFF, forward.ndc = true, forward.ndc_near = 1, forward.scale = 0.9f;
  for (int i = 0; i < 2; i++) forward.ndc_focal[i] = view[0].camera.fx / 12;
  return forward;
}

static inline sf_train_options small_run(void)
{
  sf_train_options o = sf_train_defaults();
  o.config.levels = 4;
  o.config.log2_hash = 10;
  o.config.finest_res = 64;
  o.config.hidden = 32;
  o.config.steps = T;
  o.config.lattice = 128;
  o.config.occ_res = 16;
  o.samples = 1024;
  o.stage1 = 12;
  o.stage2 = 28;
  return o;
}

typedef sf_trainer *trainer; /* OWNED(trainer) */

static inline void trainer_free(trainer *t)
{
  sf_trainer_free(*t);
}

static inline sf_trainer *start(const sf_dataset *data, const sf_train_options *o, const char *resume)
{
  sf_trainer *t;
  ck_ok(sf_trainer_create(&t, data, o, resume));
  return t;
}

/* The statistics of the last of n iterations. */
static inline sf_train_stats steps(sf_trainer *t, int n)
{
  sf_train_stats stats = {0};
  for (int i = 0; i < n; i++) ck_ok(sf_trainer_step(t, &stats));
  return stats;
}

/* Seconds are in a checkpoint, so two runs' values are compared, not their files. */
static inline void same_model(const sf_trainer *a, const sf_trainer *b)
{
  ck_assert_int_eq(memcmp(a->model.value, b->model.value, a->model.size * sizeof(float)), 0);
  ck_assert_int_eq(memcmp(a->moment2, b->moment2, a->model.size * sizeof(float)), 0);
  ck_assert_float_eq(a->model.t_star, b->model.t_star);
  ck_assert_int_eq(memcmp(&a->health, &b->health, sizeof a->health), 0);
  ck_assert_int_eq(a->samples, b->samples);
}

/* Its model, as it is now, is not loaded again. */
static inline void ck_refused(sf_trainer *t, const char *word, const char *other)
{
  sf_model m;
  ck_ok(sf_trainer_save(t, in("bad.safetensors"), false));
  ck_bad(sf_model_load(&m, in("bad.safetensors")), SF_E_RANGE, word, other);
}

/* A checkpoint after some iterations, and what follows is the same as without. again: the options that resume it. */
static inline void ck_resume(const sf_train_options *o, const sf_train_options *again, int before, int after)
{
  OWNED(trainer) whole = start(&data, o, NULL), part = start(&data, o, NULL);
  steps(whole, before + after);
  steps(part, before);
  ck_ok(sf_trainer_save(part, in("part.safetensors"), true));
  sf_trainer_free(part);
  part = start(&data, again, in("part.safetensors"));
  steps(part, after);
  same_model(whole, part);
}
#endif
