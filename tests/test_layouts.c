/* LLFF, COLMAP and instant-ngp against the Blender layout of the same cameras. */
#include "ck_run.h"
#include "layout_folder.h"
#include "src/scene/capture.h"

LOOP_TEST(colmap_has_the_rays_of_its_poses, 4)
{
  const layout_rig rig = orbit(), listed = shuffled(&rig);
  put_colmap(_i & 2 ? "sparse" : "sparse/0", &listed, _i & 1);
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  same_splits(&rig);
  reload("train");
  ck_assert_int_eq(d.layout, SF_LAYOUT_COLMAP);
  const char *const list[] = {"sparse/0/images.bin", "sparse/0/images.txt", "sparse/images.bin", "sparse/images.txt"};
  ck_assert_str_eq(d.list, in(list[_i]));
  ck_assert_str_eq(d.view[0].lens, "PINHOLE");
  ck_assert(!d.ndc && d.bound == 1); /* all points lie between the cameras */
  ck_assert_int_eq(d.points, rig.points);
  double mean = 0, middle[3];
  for (int v = 0; v < d.count; v++) {
    const float *m = d.view[v].camera.to_world;
    mean += sqrt((double)(m[3] * m[3] + m[7] * m[7] + m[11] * m[11])) / d.count;
  }
  ck_assert_double_eq_tol(mean, 1.32, 0.02);   /* of the training views; it is exact for all */
  to_model(&d, (double[3]){3, -2, 1}, middle); /* what they look at is the origin; held to the mean by 1 in 1000 */
  for (int i = 0; i < 3; i++) ck_assert_double_eq_tol(middle[i], 0, 2e-3);
  ck_assert_double_gt(d.world[10] / sqrt(d.world[8] * d.world[8] + d.world[9] * d.world[9] + d.world[10] * d.world[10]),
                      0.99);
  double p[3];
  to_model(&d, rig.point[5], p);
  for (int i = 0; i < 3; i++) ck_assert_double_eq_tol(p[i], (double)d.point[15 + i], 1e-6);
}

/* Moves the cameras so that they look at the origin. */
static void look_at_origin(layout_rig *rig)
{
  for (int v = 0; v < VIEWS; v++)
    for (int i = 0; i < 3; i++) rig->view[v].to_world[4 * i + 3] -= i == 0 ? 3 : i == 1 ? -2 : 1;
}

TEST(instant_ngp_has_the_rays_of_its_poses)
{
  layout_rig rig = orbit();
  look_at_origin(&rig);
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  put_json("transforms.json", &rig, "\"aabb_scale\":4,", "images", 0, 1);
  same_splits(&rig);
  reload("test");
  ck_assert_int_eq(d.layout, SF_LAYOUT_INGP);
  ck_assert(d.scale == 0.33f && d.bound == 2 && d.offset[0] == 0);
  /* its own cube: 0.5 p + (0.6, 0.5, 0.4), of which the middle is the origin and the box has half edge 1 */
  put_json("transforms.json", &rig, "\"aabb_scale\":1,\"scale\":0.25,\"offset\":[0.6,0.5,0.4],", "images", 0, 1);
  same_splits(&rig);
  reload("test");
  ck_assert(d.scale == 0.5f && d.bound == 1);
  ck_assert_float_eq_tol(d.offset[0], 0.2f, 1e-6f);
  ck_assert_float_eq_tol(d.offset[2], -0.2f, 1e-6f);
  ck_ok(reload_as("test", &(sf_dataset_options){.downscale = 1, .scale = 1}));
  ck_assert_float_eq_tol(d.offset[0], 0.4f, 1e-6f); /* the box's middle stays in the origin */
  /* half a million units away, in single precision 1/32 */
  for (int v = 0; v < VIEWS; v++) rig.view[v].to_world[3] += 500000;
  put_json("transforms.json", &rig, "\"aabb_scale\":1,\"scale\":0.25,\"offset\":[-124999.4,0.5,0.4],", "images", 0, 1);
  reload("test");
  const sf_view *a = &d.view[0], *b = &d.view[1];
  const double apart = named(&rig, b->name)->to_world[3] - named(&rig, a->name)->to_world[3];
  ck_assert_float_eq_tol(b->camera.to_world[3] - a->camera.to_world[3], (float)(0.5 * apart), 1e-6f);
}

/* The training file says where the scene lies, in words or by its poses, for the views of the other file, too. */
LOOP_TEST(splits_in_two_files_have_the_same_coordinates, 3)
{
  static const char *const training[] = {"transforms.json", "transforms_train.json", "transforms_train.json"};
  static const char *const more[] = {"", "\"aabb_scale\":4,", ""};
  const layout_rig rig = orbit();
  OWNED(sf_dataset) train, test;
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  put_json(training[_i], &rig, more[_i], "images", 3, 2);
  put_json("transforms_test.json", &rig, "", "images", 0, 5);
  load(&train, "train"), load(&test, "test");
  ck_assert_int_eq(train.layout, _i < 2 ? SF_LAYOUT_INGP : SF_LAYOUT_BLENDER);
  ck_assert_int_eq(test.layout, train.layout);
  ck_assert(train.count == 7 && train.total == 7 && test.count == 4 && test.total == 4);
  ck_assert_str_eq(train.view[0].name, "images/p03.png");
  ck_assert_str_eq(test.view[1].name, "images/p05.png");
  same_rays(&train, &rig), same_rays(&test, &rig);
  ck_ok(sf_dataset_agree(&train, &test));
}

/* A surveyor's coordinates: the metres that floats lose are taken off before. */
TEST(far_coordinates_lose_nothing)
{
  layout_rig rig = orbit();
  for (int v = 0; v < VIEWS; v++) rig.view[v].to_world[3] += 512345.25, rig.view[v].to_world[7] += 5412345.5;
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  put_json("transforms.json", &rig, "", "images", 0, 1);
  reload("train");
  same_rays(&d, &rig);
}

TEST(splits_in_other_coordinates_are_refused)
{
  const layout_rig rig = row();
  OWNED(sf_dataset) train, test;
  put_llff(&rig, 0, 4, 40);
  put_pictures("images_4", &rig, WIDTH, HEIGHT, 255);
  load(&train, "train"), load(&test, "test");
  ck_ok(sf_dataset_agree(&train, &test));
  float *const number[] = {&test.scale, &test.offset[2], &test.ndc_near, &test.ndc_focal[1]};
  for (int i = 0; i < 6; i++) {
    const sf_dataset before = test;
    if (i < 4) *number[i] += 1e-3f;
    if (i == 4) test.bound = 2;
    if (i == 5) test.world[7] += 1e-9;
    ck_bad(sf_dataset_agree(&train, &test), SF_E_FORMAT, "poses_bounds.npy", "other coordinates");
    test = before;
  }
}

/* NDC or not, another scale, another bound; what poses are computed from may differ a little. */
TEST(another_scenes_data_is_refused)
{
  layout_rig rig = row();
  put_llff(&rig, 0, 4, 40);
  put_pictures("images_4", &rig, WIDTH, HEIGHT, 255);
  ck_ok(reload_as("train", &(sf_dataset_options){.scale = 0.125f}));
  ck_assert(d.scale == 0.125f && d.own_scale != d.scale); /* whatever it is read at */
  const sf_space space = sf_dataset_space(&d);
  ck_assert(space.ndc == 1 && space.scale == d.own_scale && space.bound == 1);
  ck_ok(sf_space_check(&space, "m", &d));
  sf_space other = space;
  other.scale *= 1.005f;
  ck_ok(sf_space_check(&other, "m", &d));
  other.scale *= 1.02f;
  ck_bad(sf_space_check(&other, "m", &d), SF_E_RANGE, "m: learned from data of scale", "poses_bounds.npy: scale");
  other = space, other.bound = 2;
  ck_bad(sf_space_check(&other, "m", &d), SF_E_RANGE, "and bound 2", "bound 1: this is another scene's data");
  other = space, other.ndc = 0;
  ck_bad(sf_space_check(&other, "m", &d), SF_E_RANGE, "m: learned from data without NDC rays", "with NDC");
  ck_ok(sf_space_check(&(sf_space){0}, "m", &d));
  other = space, other.poses ^= 1;
  ck_bad(sf_space_check(&other, "m", &d), SF_E_RANGE, "m: learned from a list of 17 views",
         "lists 17 and their poses differ");
  other.poses = 0; /* of an older file */
  ck_ok(sf_space_check(&other, "m", &d));
}

static sf_space space_of(const char *split, const sf_dataset_options *options)
{
  ck_ok(reload_as(split, options));
  return sf_dataset_space(&d);
}

/* The list that names the training views tells a scene, whatever is loaded of it and how; the test views' does not. */
TEST(poses_of_the_training_list_tell_the_scene)
{
  layout_rig rig = orbit();
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  put_json("transforms_train.json", &rig, "", "images", 1, 2);
  put_json("transforms_test.json", &rig, "", "images", 0, 2);
  const sf_space train = space_of("train", NULL);
  ck_assert(train.poses > 0 && train.views == VIEWS / 2 && train.picture > 0);
  const sf_dataset_options part = {.scale = 0.125f, .limit = 1, .first = 1, .cameras_only = true};
  const sf_space partly = space_of("train", &part), tested = space_of("test", NULL);
  ck_assert(partly.poses == train.poses && partly.picture == train.picture);
  ck_assert(tested.poses == train.poses && tested.picture == train.picture);
  put_json("transforms_test.json", &rig, "", "images", 0, 4);
  ck_assert_int_eq(space_of("test", NULL).poses, train.poses);
  for (int v = 1; v < VIEWS; v += 2)
    for (int i = 3; i < 12; i += 4) {
      const double before = rig.view[v].to_world[i];
      rig.view[v].to_world[i] += 1e-3;
      put_json("transforms_train.json", &rig, "", "images", 1, 2);
      ck_assert_int_ne(space_of("test", NULL).poses, train.poses);
      rig.view[v].to_world[i] = before + 1e-9;
    }
  put_json("transforms_train.json", &rig, "", "images", 1, 2);
  ck_assert_int_eq(space_of("test", NULL).poses, train.poses);
  rig.view[3].to_world[1] += 0.05;
  put_json("transforms_train.json", &rig, "", "images", 1, 2);
  ck_assert_int_ne(space_of("test", NULL).poses, train.poses);
  ck_assert_int_eq(unlink(in("transforms_train.json")), 0);
  const sf_space unknown = space_of("test", NULL);
  ck_assert(unknown.poses == 0 && unknown.views == 0);
  ck_ok(sf_space_check(&train, "m", &d));
}

/* The same cameras before another scene: its pictures are taken, with a warning. */
TEST(other_pictures_from_the_same_cameras_are_told)
{
  layout_rig rig = orbit();
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  put_json("transforms_train.json", &rig, "", "images", 1, 2);
  put_json("transforms_test.json", &rig, "", "images", 0, 2);
  const sf_space train = space_of("test", NULL);
  const int before = d.warnings;
  ck_ok(sf_space_check(&train, "m", &d));
  ck_assert_int_eq(d.warnings, before);
  put_pictures("images", &rig, WIDTH, HEIGHT, 128);
  const sf_space other = space_of("test", NULL);
  ck_assert(other.poses == train.poses && other.picture != train.picture);
  ck_ok(sf_space_check(&train, "m", &d));
  ck_assert_int_eq(d.warnings, before + 1);
  ck_assert_ptr_nonnull(strstr(d.warning[before], "m: learned from other pictures"));
  const sf_space older = {.scale = train.scale, .bound = train.bound, .views = train.views, .poses = train.poses};
  ck_ok(sf_space_check(&older, "m", &d));
  ck_assert_int_eq(d.warnings, before + 1);
}

/* Both splits are of the one list. */
LOOP_TEST(one_list_has_one_hash, 2)
{
  layout_rig rig = _i ? row() : orbit();
  put_pictures(_i ? "images_4" : "images", &rig, WIDTH, HEIGHT, 255);
  if (_i)
    put_llff(&rig, 0, 4, 40);
  else
    put_colmap("sparse/0", &rig, 0);
  const sf_space train = space_of("train", NULL);
  ck_assert(train.poses > 0 && train.views == VIEWS);
  ck_assert_int_eq(space_of("test", NULL).poses, train.poses);
  rig.view[3].to_world[11] += 0.01;
  if (_i)
    put_llff(&rig, 0, 4, 40);
  else
    put_colmap("sparse/0", &rig, 0);
  ck_assert_int_ne(space_of("test", NULL).poses, train.poses);
}

TEST(an_object_on_nothing_fills_the_box)
{
  const layout_rig rig = orbit();
  put_pictures("images", &rig, WIDTH, HEIGHT, 0); /* the first rows are transparent */
  put_json("transforms.json", &rig, "", "images", 0, 1);
  same_splits(&rig);
  reload("train");
  ck_assert_int_eq(d.bound, 1);
  /* half the picture's height over the focal length, at the middle distance of 5 to 5.3 */
  ck_assert_double_eq_tol(1 / (double)d.scale, 5.0 * 6 / 21, 0.3 * 6 / 21);
}

/* The optical axis is far beside the picture: what it shows counts, not what the camera is turned to. */
TEST(a_crop_looks_where_its_picture_is)
{
  const layout_rig rig = orbit();
  layout_rig crop = rig;
  sf_dataset whole;
  const double slope = tan(M_PI / 3), angle[2] = {cos(M_PI / 3), sin(M_PI / 3)};
  char more[100];
  crop.lens[0].param[2] -= slope * crop.lens[0].param[0];
  for (int v = 0; v < VIEWS; v++)
    for (int i = 0; i < 3; i++) {
      const double *m = rig.view[v].to_world + 4 * i;
      crop.view[v].to_world[4 * i] = angle[0] * m[0] - angle[1] * m[2];
      crop.view[v].to_world[4 * i + 2] = angle[1] * m[0] + angle[0] * m[2];
    }
  put_pictures("images", &rig, WIDTH, HEIGHT, 0);
  put_json("transforms.json", &rig, "", "images", 0, 1), load(&whole, "train");
  snprintf(more, sizeof more, "\"cx\":%.17g,", crop.lens[0].param[2]);
  put_json("transforms.json", &crop, more, "images", 0, 1), reload("train");
  ck_assert_int_eq(d.warnings, 0);
  same_rays(&d, &crop);
  for (int i = 0; i < 12; i++) ck_assert_double_eq_tol(d.world[i], whole.world[i], 1e-9);
  ck_assert_float_eq_tol(d.scale, whole.scale * 2, 1e-5f); /* 60 degrees off: the object is at half the depth */
  sf_dataset_free(&whole);
  look_at_origin(&crop);
  strcat(more, "\"aabb_scale\":1,");
  put_json("transforms.json", &crop, more, "images", 0, 1), reload("train");
  ck_assert_int_eq(d.warnings, 0);
  put_json("transforms.json", &crop, "\"cx\":100,\"aabb_scale\":1,", "images", 0, 1);
  ck_bad(reload_as("train", NULL), SF_E_RANGE, "transforms.json", "no view looks at the scene");
}

TEST(blender_has_the_rays_of_its_poses)
{
  layout_rig rig = orbit();
  look_at_origin(&rig);
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  put_json("transforms_train.json", &rig, "", "images", 1, 2);
  put_json("transforms_test.json", &rig, "", "images", 0, 2);
  reload("train");
  ck_assert_int_eq(d.layout, SF_LAYOUT_BLENDER);
  ck_assert_str_eq(d.list, in("transforms_train.json"));
  ck_assert_int_eq(d.count, VIEWS / 2);
  same_rays(&d, &rig);
}

/* The point on the rig's ray, brought into NDC by its definition, lies on the ray that is handed out; rays are looked
 * at from the near plane on. */
LOOP_TEST(forward_facing_rays_are_ndc, 2)
{
  const layout_rig rig = row();
  put_llff(&rig, _i, 4, 40);
  put_pictures("images_4", &rig, WIDTH, HEIGHT, 255);
  reload("test");
  ck_assert_int_eq(d.layout, SF_LAYOUT_LLFF);
  ck_assert_str_eq(d.list, in("poses_bounds.npy"));
  ck_assert(d.ndc && d.bound == 1 && d.ndc_near == 1);
  ck_assert_float_eq_tol(d.ndc_focal[0], 60 / 32.0f, 1e-6f);
  ck_assert_float_eq_tol(d.ndc_focal[1], 60 / 24.0f, 1e-6f);
  ck_assert(d.view[0].camera.fx == 15 && d.view[0].camera.width == WIDTH);
  const double scale = (double)d.scale, tolerance = _i ? 3e-6 : 2e-6;
  sf_dataset unit = d;
  unit.scale = 1;
  float here[3], beside[3], dir[3];
  const int points = sf_dataset_pixels(&d, 2); /* as far apart as the pixels on the near plane, where all look alike */
  sf_dataset_ray(&d, &d.view[1], 8, 6, here, dir), sf_dataset_ray(&d, &d.view[1], 9, 6, beside, dir);
  ck_assert_int_eq(points, (int)ceil(2 * WIDTH / scale));
  ck_assert_double_eq_tol((double)(beside[0] - here[0]) * points / 4, 1, 0.1);
  for (int n = 0; n < 12 * d.count; n++) {
    const sf_view *view = &d.view[n / 12];
    const double px = WIDTH * (n % 4) / 3.0, py = HEIGHT * (n / 4 % 3) / 2.0, depth[4] = {0.01, 5, 50, 1e9};
    const ray r = rig_ray(named(&rig, view->name), &rig.lens[0], 4 * px, 4 * py);
    float o[3], dir[3];
    sf_dataset_ray(&d, view, (float)px, (float)py, o, dir);
    for (int i = 0; i < 3; i++) o[i] += (float)SF_NEAR * dir[i];
    ck_assert_float_eq_tol(o[2], -d.scale, 1e-6f);
    ck_assert_double_eq_tol(sqrt((double)(dir[0] * dir[0] + dir[1] * dir[1] + dir[2] * dir[2])), 1, 1e-6);
    for (int k = 0; k < 4; k++) {
      double far[3], p[3], ndc[3];
      for (int i = 0; i < 3; i++) far[i] = r.o[i] + depth[k] * r.d[i];
      to_model(&unit, far, p);
      if (k == 0) p[2] = fmin(p[2], -0.1); /* before the near plane the line goes on */
      ndc[0] = -(double)d.ndc_focal[0] * p[0] / p[2], ndc[1] = -(double)d.ndc_focal[1] * p[1] / p[2];
      ndc[2] = 1 + 2 / p[2];
      for (int i = 0; i < 3; i++) ndc[i] *= scale;
      if (k > 0) ck_assert_double_eq_tol(from_ray(o, dir, ndc), 0, tolerance);
      if (k > 0)
        for (int i = 0; i < 3; i++) ck_assert_double_le(fabs(ndc[i]), 1 + 1e-6);
    }
  }
}

/* NeRF's recentring: the mean pose becomes the identity; the nearest depth is at 4 / 3. */
TEST(forward_facing_poses_are_recentred)
{
  const layout_rig rig = row();
  OWNED(sf_dataset) one, other;
  double sum[12] = {0};
  put_llff(&rig, 0, 4, 40);
  put_pictures("images_4", &rig, WIDTH, HEIGHT, 255);
  load(&one, "train"), load(&other, "test");
  for (int v = 0; v < VIEWS; v++) {
    const sf_dataset *d = v % 8 ? &one : &other;
    const sf_view *view = &d->view[v % 8 ? v - 1 - v / 8 : v / 8];
    ck_assert_ptr_eq(named(&rig, view->name), &rig.view[v]);
    for (int i = 0; i < 12; i++) sum[i] += (double)view->camera.to_world[i] / VIEWS;
  }
  for (int i = 0; i < 3; i++) {
    ck_assert_double_eq_tol(sum[4 * i + 3], 0, 1e-6);
    ck_assert_double_eq_tol(sum[4 * i + 2], i == 2 ? sum[10] : 0, 1e-6);
  }
  ck_assert_double_gt(sum[10], 0.98);
  ck_assert_double_eq_tol(sum[1], 0, 1e-6);
  const double *w = one.world;
  ck_assert_double_eq_tol(sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]), 1 / (0.75 * 4), 1e-12);
}

TEST(poses_decide_what_faces_forward)
{
  layout_rig rig = orbit();
  rig.lens[0].param[1] = WIDTH / 2.0; /* one focal length */
  put_llff(&rig, 0, 2, 9);
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  reload("train");
  ck_assert(d.layout == SF_LAYOUT_LLFF && !d.ndc && d.bound > 1);
  rig = row(); /* but one of them stands behind the nearest thing */
  put_llff(&rig, 0, 4, 40);
  ck_ok(sf_make_dir(in("sparse/0")));
  reload("train");
  ck_assert(d.ndc && d.warnings == 0);
  rig.view[3].to_world[3] += 3.5;
  put_llff(&rig, 0, 4, 40);
  reload("train");
  ck_assert(!d.ndc);
  rig = row(); /* or so far aside that it cannot see what the others see */
  rig.view[3].to_world[7] += 1e5;
  put_llff(&rig, 0, 4, 40);
  reload("train");
  ck_assert(!d.ndc);
}

ck_options ck_program = {.set_up = make_folder, .tear_down = tear_down};
