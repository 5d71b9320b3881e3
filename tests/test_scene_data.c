/* What data sets say of one another: warnings told once, other scenes, other splits. */
#include "ck_run.h"
#include "layout_folder.h"
#include "tests/expected.h"

TEST(a_warning_is_told_once)
{
  sf_dataset first = {.path = "a"}, second = {.path = "b"};
  for (int i = 0; i < 3; i++) ck_ok(sf_warn(&first, "number %d\nand more", i));
  for (int i = 1; i < 5; i++) ck_ok(sf_warn(&second, "number %d\nand more", i));
  static char *text;
  static size_t size;
  for (int told = 0; told < 2; told++) {
    FILE *out = open_memstream(&text, &size);
    sf_dataset_warn(out, "prog", &second, told ? &first : NULL);
    fclose(out);
    ck_assert_str_eq(text, told ? "prog: warning: number 3 and more\nprog: warning: number 4 and more\n"
                                : "prog: warning: number 1 and more\nprog: warning: number 2 and more\n"
                                  "prog: warning: number 3 and more\nprog: warning: number 4 and more\n");
    free(text);
  }
  ck_assert(sf_dataset_has_warning(&first, "number 0 and more") && sf_dataset_has_warning(&first, "number 2 and more"));
  ck_assert(!sf_dataset_has_warning(&first, "number 3 and more") && !sf_dataset_has_warning(&first, "number"));
  sf_dataset_free(&first), sf_dataset_free(&second);
}

/* Spaces that fit, that nearly do, and that do not. */
TEST(spaces_and_what_differs)
{
  static const struct {
    sf_space learned;
    const char *word; /* NULL: it fits; "!": with a warning */
  } rows[] = {{{.scale = 0.5f, .bound = 2, .views = 7, .poses = 11, .picture = 13}, NULL},
              {{.scale = 0, .bound = 9, .ndc = 1, .poses = 5}, NULL},
              {{.scale = 0.5f, .bound = 2}, NULL},
              {{.scale = 0.5f, .bound = 2, .poses = 11}, NULL},
              {{.scale = 0.5f, .bound = 2, .poses = 11, .picture = 14}, "!"},
              {{.scale = 0.5f, .bound = 2, .poses = 0, .picture = 14}, NULL},
              {{.scale = 0.504f, .bound = 2, .poses = 11, .picture = 13}, NULL},
              {{.scale = 0.496f, .bound = 2, .poses = 11, .picture = 13}, NULL},
              {{.scale = 0.506f, .bound = 2, .poses = 11}, "scale 0.506 and bound 2"},
              {{.scale = 0.494f, .bound = 2, .poses = 11}, "scale 0.494 and bound 2"},
              {{.scale = 0.5f, .bound = 4, .poses = 11}, "scale 0.5 and bound 4"},
              {{.scale = 0.5f, .bound = 2, .ndc = 1, .poses = 11}, "with NDC rays"},
              {{.scale = 0.5f, .bound = 2, .views = 7, .poses = 12}, "list of 7 views, b lists 8"}};
  for (int i = 0; i < COUNT(rows); i++) {
    sf_dataset data = {
        .path = "b", .list = "l", .own_scale = 0.5f, .scale = 3, .bound = 2, .listed = 8, .poses = 11, .picture = 13};
    const sf_status status = sf_space_check(&rows[i].learned, "m", &data);
    const bool warns = rows[i].word && *rows[i].word == '!';
    if (rows[i].word && !warns)
      ck_bad(status, SF_E_RANGE, rows[i].word, "m: learned from");
    else
      ck_ok(status);
    ck_assert_int_eq(data.warnings, warns);
    if (warns) ck_assert_ptr_nonnull(strstr(data.warning[0], "m: learned from other pictures: b has"));
    sf_dataset_free(&data);
  }
  sf_dataset data = {.path = "b", .own_scale = 0.5f, .bound = 2, .ndc = true, .listed = 8, .poses = 11, .picture = 13};
  const sf_space space = sf_dataset_space(&data), none = {.scale = 0.5f, .bound = 2};
  ck_assert(space.scale == 0.5f && space.bound == 2 && space.ndc == 1 && space.views == 8 && space.poses == 11 &&
            space.picture == 13);
  ck_bad(sf_space_check(&none, "m", &data), SF_E_RANGE, "without NDC rays", "with NDC");
  data.poses = 0, data.picture = 0;
  ck_ok(sf_space_check(&space, "m", &data));
  ck_assert_int_eq(data.warnings, 0);
}

TEST(splits_agree_or_not)
{
  const sf_dataset train = {.list = "a",
                            .ndc = true,
                            .bound = 2,
                            .scale = 3,
                            .ndc_near = 4,
                            .offset = {5, 6, 7},
                            .ndc_focal = {8, 9},
                            .world = {1, 2, 3}};
  sf_dataset test = train;
  strcpy(test.list, "b");
  ck_ok(sf_dataset_agree(&train, &test));
  for (int i = 0; i < 8; i++) {
    test = train;
    if (i == 0) test.ndc = false;
    if (i == 1) test.bound = 4;
    if (i == 2) test.scale = 3.5f;
    if (i == 3) test.ndc_near = 5;
    if (i == 4) test.offset[2] = 8;
    if (i == 5) test.ndc_focal[1] = 8;
    if (i == 6) test.world[11] = 1;
    if (i == 7) test.world[0] = -1;
    ck_bad(sf_dataset_agree(&train, &test), SF_E_FORMAT, "other coordinates", i == 0 ? "no NDC and NDC" : "NDC");
  }
}

/* One pixel on nothing makes an object of a scene, wherever it is in the picture. */
LOOP_TEST(a_transparent_pixel_is_found, 3)
{
  const layout_rig rig = orbit();
  put_colmap("sparse/0", &rig, 0);
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  if (_i) {
    sf_image image;
    ck_ok(sf_image_load(&image, in("images/p00.png")));
    image.rgba[4 * (_i == 1 ? 0 : image.width * image.height - 1) + 3] = 0;
    ck_ok(sf_image_save_png(&image, in("images/p00.png")));
    sf_image_free(&image);
  }
  sf_dataset set;
  load(&set, "test");
  ck_assert_int_eq(fabs((double)set.own_scale - 0.26437) > 0.01, _i > 0);
  sf_dataset_free(&set);
}

static void options(FILE *out)
{
  static const struct {
    sf_dataset_options o;
    const char *split;
  } rows[] = {{{.downscale = -1}, "train"},     {{.limit = -1}, "train"},
              {{.first = -1}, "train"},         {{.scale = -1}, "train"},
              {{.scale = INFINITY}, "train"},   {{.scale = NAN}, "train"},
              {{.limit = 2}, "train"},          {{.limit = 2, .first = 3}, "train"},
              {{.first = 12}, "train"},         {{.first = 13}, "train"},
              {{.first = 1}, "test"},           {{.first = 5, .limit = 1}, "test"},
              {{.scale = 2}, "test"},           {{.downscale = 2}, "test"},
              {{.cameras_only = true}, "test"}, {{0}, "val"}};
  const layout_rig rig = orbit();
  put_colmap("sparse/0", &rig, 0);
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  for (int i = 0; i < COUNT(rows); i++) {
    sf_dataset set;
    const sf_status status = sf_dataset_load(&set, folder, rows[i].split, &rows[i].o);
    const char *after = strstr(status.message, folder);
    fprintf(out, "row %d: %d %s\n", i, status.code, after ? after + strlen(folder) : status.message);
    if (status.code) continue;
    fprintf(out, "  %d of %d by %d listed %d scale %.5g own %.5g:", set.count, set.total, set.downscale, set.listed,
            (double)set.scale, (double)set.own_scale);
    for (int v = 0; v < set.count; v++)
      fprintf(out, " %s %dx%d %s %.4g%s", set.view[v].name, set.view[v].camera.width, set.view[v].camera.height,
              set.view[v].lens, (double)set.view[v].brightness, set.view[v].image.rgba ? "" : " no picture");
    fprintf(out, "\n");
    sf_dataset_free(&set);
  }
}

TEST(parts_of_a_data_set)
{
  ck_expected_text("data-options.txt", out, options(out));
}

ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};
