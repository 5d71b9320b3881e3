/* Folders of runs: two scenes with four runs each, whose files are the parts of the input. A byte 0x1c ends a part;
 * when there are fewer parts than slots they begin again. */
#include "fuzz.h"
#include "base/io.h"
#include "report/report.h"

enum { SLOTS = 7 };

/* A file of memory for each slot, by turns under the names of the runs' files. */
static void make_run(const char *folder, int scene, sf_run_id run, const int slot[SLOTS])
{
  static const char *const file[] = {"status",          "train.cmd",    "eval.cmd",     "version",
                                     "train.json",      "train.jsonl",  "cosim.json",   "audit-0.json",
                                     "audit-1.json",    "fixed-0.json", "float-0.json", "prefix-1-0.json",
                                     "prefix-2-0.json", "float-1.json", "convert.json"};
  char dir[400], path[440], input[40];
  snprintf(dir, sizeof dir, "%s/scene%d/%s", folder, scene, sf_run_kinds[run].name);
  FUZZ_EXPECT(fuzz_good(sf_make_dir(dir)));
  for (size_t f = 0; f < sizeof file / sizeof *file; f++) {
    snprintf(path, sizeof path, "%s/%s", dir, file[f]);
    snprintf(input, sizeof input, "/proc/self/fd/%d", slot[(f + (size_t)(scene + run)) % SLOTS]);
    FUZZ_EXPECT(!symlink(input, path));
  }
}

static const char *make_runs(const int slot[SLOTS])
{
  static const sf_run_id run[] = {SF_RUN_ANN, SF_RUN_BETA_5E7, SF_RUN_BETA_1E6, SF_RUN_T};
  static char folder[300];
  if (folder[0]) return folder;
  snprintf(folder, sizeof folder, "%s/runs", fuzz_folder());
  for (int scene = 0; scene < 2; scene++)
    for (size_t r = 0; r < sizeof run / sizeof *run; r++) make_run(folder, scene, run[r], slot);
  return folder;
}

static const int *fill_slots(const uint8_t *data, size_t size)
{
  static int slot[SLOTS];
  const uint8_t *part = data, *end = data + size;
  for (int s = 0; s < SLOTS; s++) {
    if (!slot[s]) slot[s] = memfd_create("part", 0);
    const uint8_t *stop = size ? memchr(part, 0x1c, (size_t)(end - part)) : NULL;
    const size_t length = size ? (size_t)((stop ? stop : end) - part) : 0;
    FUZZ_EXPECT(slot[s] > 0 && !ftruncate(slot[s], 0) && pwrite(slot[s], part, length, 0) == (ssize_t)length);
    part = stop && stop + 1 < end ? stop + 1 : data;
  }
  return slot;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
  static FILE *nowhere;
  sf_reproduction report;
  if (!nowhere) nowhere = fopen("/dev/null", "w");
  FUZZ_EXPECT(nowhere);
  if (!fuzz_good(sf_reproduction_load(&report, make_runs(fill_slots(data, size))))) return 0;
  FUZZ_EXPECT(report.count == 2);
  sf_reproduction_print(nowhere, &report);
  cJSON *json = sf_reproduction_json(&report);
  FUZZ_EXPECT(json);
  cJSON_Delete(json);
  sf_reproduction_free(&report);
  return 0;
}
