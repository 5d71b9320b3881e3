/* For the tests of the C library: one scene as file, as core and as the library opened it; a camera that sees it. */
#ifndef SF_TESTS_LIB_FIXTURE_H
#define SF_TESTS_LIB_FIXTURE_H
#include "quant/quant.h"
#include "spikefield/spikefield.h"
#include "tests/folder_fixture.h"
#include "tests/fx_fixture.h"
#include <math.h>

static fx_scene core;
static spikefield_scene *scene;
static spikefield_scene_info info;

static inline void lib_good(spikefield_status status)
{
  ck_assert_msg(status.code == SPIKEFIELD_OK, "unexpected failure: %s", status.message);
}

static inline void lib_bad(spikefield_status status, spikefield_code code, const char *word)
{
  ck_assert_msg(status.code == code, "code %d instead of %d: '%s'", status.code, code, status.message);
  ck_assert_msg(strstr(status.message, word), "'%s' does not name '%s'", status.message, word);
}

static inline void open_fixture(void)
{
  make_folder();
  core = fixture_scene(&fixture_ingp, 11);
  core.step_q24 = 300000, core.background[1] = 30000;
  core.units.feature_scale[3] = 0.3; /* a number with a point in the file */
  ck_ok(fx_scene_save(&core, in("s.snn")));
  lib_good(spikefield_scene_open(&scene, in("s.snn")));
  lib_good(spikefield_scene_describe(scene, &info));
}

static inline void close_fixture(void)
{
  spikefield_scene_close(scene);
  fx_scene_free(&core);
  remove_folder();
}

enum { WIDTH = 37, HEIGHT = 19 }; /* several blocks, the last one not full */

static inline spikefield_camera make_camera(void)
{
  return (spikefield_camera){WIDTH, HEIGHT, 30, 31, 18.25f, 9, {1, 0, 0, 0.1f, 0, 0, -1, -3, 0, 1, 0, -0.2f}};
}
#endif
