/* A scene file of each test, its edits, and that they are refused. */
#ifndef SF_TESTS_SCENE_FILE_FIXTURE_H
#define SF_TESTS_SCENE_FILE_FIXTURE_H
#include "folder_fixture.h"
#include "src/fx/scene.h"
#include "base/io.h"
#include <cjson/cJSON.h>

static char path[300];

static inline void set_up(void)
{
  make_folder();
  snprintf(path, sizeof path, "%s", in("scene.snn"));
}

/* Fails to load, the message names the file and `place`, and nothing is left behind. */
static inline void assert_refused(const char *place)
{
  fx_scene scene;
  const sf_status status = fx_scene_load(&scene, path);
  ck_assert_msg(status.code != SF_OK, "loaded in spite of: %s", place);
  ck_assert_msg(strstr(status.message, path) && strstr(status.message, place), "'%s' does not name '%s'",
                status.message, place);
  ck_assert_ptr_null(scene.owner);
}

/* Rewrites one metadata string and keeps every tensor. */
static inline void edit(const char *key, const char *value)
{
  OWNED(sf_tensors) set;
  ck_ok(sf_tensors_load(&set, path));
  cJSON_DeleteItemFromObjectCaseSensitive(set.metadata, key);
  if (value) cJSON_AddStringToObject(set.metadata, key, value);
  ck_ok(sf_tensors_save(set.tensor, set.count, set.metadata, path));
}

/* key, value, what the refusal names */
static inline void assert_edit_refused(const fx_scene *scene, const char *const wrong[3])
{
  ck_ok(fx_scene_save(scene, path));
  edit(wrong[0], wrong[1]);
  assert_refused(wrong[2]);
}
#endif
