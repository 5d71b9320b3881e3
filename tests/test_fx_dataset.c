/* The data of a fixed-point scene: read at the scale it was trained at, and refused where it is another scene's. */
#include "ck_run.h"
#include "quant/quant.h"
#include "tests/folder_fixture.h"

static void make_data(void)
{
  make_folder();
  for (int seed = 1; seed < 3; seed++) {
    const sf_procedural_options o = {
        .width = 8, .height = 8, .train_views = 3, .test_views = 2, .seed = (uint64_t)seed};
    ck_ok(sf_procedural_write("simple", in(seed == 1 ? "scene" : "other"), &o, NULL, NULL));
  }
}

/* As sf_export writes it down. */
static fx_scene trained_on(const sf_dataset *data)
{
  const sf_space s = sf_dataset_space(data);
  fx_scene scene = {.backbone = FX_INGP};
  scene.units = (fx_units){.model_scale = (double)data->scale,
                           .data_scale = (double)s.scale,
                           .data_bound = s.bound,
                           .data_ndc = s.ndc,
                           .data_views = s.views,
                           .data_poses = s.poses,
                           .data_picture = s.picture};
  return scene;
}

static sf_dataset read_at(float scale)
{
  sf_dataset data;
  ck_ok(sf_dataset_load(&data, in("scene"), "train", &(sf_dataset_options){.downscale = 1, .scale = scale}));
  return data;
}

static sf_status load_of(const fx_scene *scene, const char *dir, float scale, sf_dataset *data)
{
  return sf_fx_dataset_load(data, scene, "s.snn", in(dir), "test",
                            &(sf_dataset_options){.downscale = 1, .scale = scale});
}

/* Loads, with so many warnings, and the last one holds the word. */
static void expect_loaded(const fx_scene *scene, const char *dir, int warnings, const char *word)
{
  OWNED(sf_dataset) data = {0};
  ck_ok(load_of(scene, dir, 0, &data));
  ck_assert_int_eq(data.count, 2);
  ck_assert_int_eq(data.warnings, warnings);
  if (warnings) ck_assert_msg(strstr(data.warning[warnings - 1], word), "%s", data.warning[warnings - 1]);
}

static void expect_refused(const fx_scene *scene, const char *dir, const char *word)
{
  sf_dataset data;
  ck_bad(load_of(scene, dir, 0, &data), SF_E_RANGE, "s.snn", word);
  ck_assert_int_eq(data.count, 0); /* nothing is left */
  ck_assert_ptr_null(data.view);
}

TEST(the_scale_is_the_trained_one)
{
  OWNED(sf_dataset) own = read_at(0), half = read_at(0.5f * own.own_scale), loaded;
  fx_scene scene = trained_on(&half);
  ck_assert_float_ne(half.scale, own.scale);
  ck_ok(load_of(&scene, "scene", 0, &loaded));
  ck_assert_float_eq(loaded.scale, half.scale);
  sf_dataset none;
  ck_bad(load_of(&scene, "scene", own.scale, &none), SF_E_RANGE, "s.snn: trained at scale ", "give --scale ");
  ck_assert_ptr_null(none.view);
  sf_dataset_free(&loaded);
  ck_ok(load_of(&scene, "scene", half.scale, &loaded)); /* the same, said */
  sf_dataset_free(&loaded);
  scene.units.model_scale = 0; /* it does not tell: as the options say, or as the data proposes */
  ck_ok(load_of(&scene, "scene", 0.25f * own.own_scale, &loaded));
  ck_assert_float_eq(loaded.scale, 0.25f * own.own_scale);
  sf_dataset_free(&loaded);
  ck_ok(load_of(&scene, "scene", 0, &loaded));
  ck_assert_float_eq(loaded.scale, own.scale);
}

TEST(another_scenes_data)
{
  OWNED(sf_dataset) own = read_at(0);
  fx_scene scene = trained_on(&own);
  expect_loaded(&scene, "scene", 0, NULL);
  expect_refused(&scene, "other", "their poses differ");
  scene.units.data_picture++;
  expect_loaded(&scene, "scene", 1, "another first picture");
  scene.units.data_picture = 0; /* unknown */
  expect_loaded(&scene, "scene", 0, NULL);
  scene.units.data_poses = 0;
  expect_loaded(&scene, "other", 0, NULL);
  scene = trained_on(&own), scene.units.data_ndc = 1;
  expect_refused(&scene, "scene", "with NDC rays");
  scene = trained_on(&own), scene.units.data_bound = 2 * own.bound;
  expect_refused(&scene, "scene", "scale");
  scene = trained_on(&own), scene.units.data_scale *= 1.02;
  expect_refused(&scene, "scene", "another scene's data");
  scene.units.data_scale *= 1.005 / 1.02;
  expect_loaded(&scene, "scene", 0, NULL);
}

/* Numbers of a damaged file are unknown ones, and fit. */
TEST(numbers_beyond_a_whole_one)
{
  OWNED(sf_dataset) own = read_at(0);
  static const double odd[] = {0, 0.5, -3, 1.1e9, 1e300};
  for (int i = 0; i < COUNT(odd); i++) {
    fx_scene scene = trained_on(&own);
    scene.units.data_poses = odd[i];
    expect_loaded(&scene, "other", 0, NULL);
    scene = trained_on(&own), scene.units.data_bound = odd[i];
    expect_refused(&scene, "scene", "bound 0");
  }
  fx_scene scene = trained_on(&own);
  scene.units.data_poses = 1e9; /* the largest that is one */
  expect_refused(&scene, "scene", "poses differ");
  scene.units.data_poses = 1;
  expect_refused(&scene, "scene", "poses differ");
}

/* Files of before say no data: a scale or a bound that differs is a warning. */
TEST(scenes_that_say_no_data)
{
  OWNED(sf_dataset) own = read_at(0);
  fx_scene scene = {.backbone = FX_INGP};
  int log2_bound = 0;
  while (1 << log2_bound < own.bound) log2_bound++;
  scene.log2_bound = log2_bound;
  expect_loaded(&scene, "scene", 0, NULL); /* nothing is known */
  scene.units.model_scale = (double)own.own_scale;
  expect_loaded(&scene, "scene", 0, NULL);
  expect_loaded(&scene, "other", 0, NULL);
  scene.units.model_scale = (double)own.own_scale * 1.008;
  expect_loaded(&scene, "scene", 0, NULL);
  scene.units.model_scale = (double)own.own_scale * 1.03;
  expect_loaded(&scene, "scene", 1, "is this the data that it learned from?");
  scene.units.model_scale = (double)own.own_scale * 0.97;
  expect_loaded(&scene, "scene", 1, "is this the data that it learned from?");
  scene.units.model_scale = (double)own.own_scale, scene.log2_bound++;
  expect_loaded(&scene, "scene", 1, "bound");
  scene.backbone = FX_TENSORF, scene.units.near = 2, scene.units.far = 6; /* has no bound */
  expect_loaded(&scene, "scene", 0, NULL);
}

/* TensoRF's rays in NDC begin at 0 and have no end. */
TEST(rays_that_tell_of_ndc)
{
  OWNED(sf_dataset) own = read_at(0);
  fx_scene scene = {.backbone = FX_TENSORF};
  scene.units.near = 0, scene.units.far = 1e5;
  expect_refused(&scene, "scene", "with NDC rays");
  scene.units.far = 99999;
  expect_loaded(&scene, "scene", 0, NULL);
  scene.units.near = 0.1, scene.units.far = 1e5;
  expect_loaded(&scene, "scene", 0, NULL);
  scene.backbone = FX_INGP, scene.units.near = 0;
  expect_loaded(&scene, "scene", 0, NULL);
}

TEST(no_data_at_all)
{
  fx_scene scene = {.backbone = FX_INGP};
  sf_dataset data;
  const sf_status status = load_of(&scene, "nowhere", 0, &data);
  ck_assert_int_ne(status.code, SF_OK);
  ck_assert_ptr_null(data.view);
}

ck_options ck_program = {.set_up = make_data, .tear_down = remove_folder};
