/* One table of a COLMAP model, beside whole ones and small pictures. The first byte of the input says which table. */
#include "fuzz.h"
#include "base/io.h"
#include "scene/scene.h"
#include "data_set.h"
#include <math.h>

enum { TABLES = 3, KINDS = 2 * TABLES };
static const char *const table_name[TABLES] = {"cameras", "images", "points3D"};

static void put_table(const char *folder, int kind, int of, const char *input)
{
  static layout_file file;
  static layout_rig rig;
  char path[400];
  const int text = kind / TABLES, table = kind % TABLES;
  rig = layout_small_rig();
  snprintf(path, sizeof path, "%s/sparse/0/%s.%s", folder, table_name[table], text ? "txt" : "bin");
  if (kind == of) {
    FUZZ_EXPECT(!symlink(input, path));
    return;
  }
  if (table == 0) layout_cameras(&file, &rig, text);
  if (table == 1) layout_images(&file, &rig, text);
  if (table == 2) layout_points(&file, &rig, text);
  FUZZ_EXPECT(fuzz_good(sf_write_file(path, file.bytes, file.size)));
}

/* Folder `kind`: that table is the fuzzer's input. */
static const char *make_data_set(int kind, const char *input)
{
  static char data[KINDS][300];
  char path[400];
  if (data[kind][0]) return data[kind];
  snprintf(data[kind], sizeof data[kind], "%s/%d", fuzz_folder(), kind);
  snprintf(path, sizeof path, "%s/sparse/0", data[kind]);
  FUZZ_EXPECT(fuzz_good(sf_make_dir(path)));
  snprintf(path, sizeof path, "%s/images", data[kind]);
  FUZZ_EXPECT(fuzz_good(sf_make_dir(path)));
  for (int v = 0; v < 4; v++) {
    uint16_t pixel[8 * 6 * 4] = {0};
    snprintf(path, sizeof path, "%s/images/p%02d.png", data[kind], v);
    FUZZ_EXPECT(fuzz_good(sf_image_save_png(&(sf_image){8, 6, pixel}, path)));
  }
  for (int t = 0; t < TABLES; t++) put_table(data[kind], kind / TABLES * TABLES + t, kind, input);
  return data[kind];
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
  if (!size) return 0;
  const int kind = data[0] % KINDS;
  const char *folder = make_data_set(kind, fuzz_file(data + 1, size - 1));
  sf_dataset set;
  if (!fuzz_good(sf_dataset_load(&set, folder, "train", &(sf_dataset_options){.limit = 16}))) {
    FUZZ_EXPECT(!set.view && !set.point && !set.warning);
    return 0;
  }
  fuzz_use_views(&set);
  FUZZ_EXPECT(fuzz_good(sf_dataset_survey(&set)));
  fuzz_touch(set.point, (size_t)set.points * 3 * sizeof *set.point);
  sf_dataset_free(&set);
  return 0;
}
