/* Folders of runs: the input is every file of two runs of one scene. */
#include "fuzz.h"
#include "spikefield/io.h"
#include "spikefield/report.h"

static const char *make_runs(const char *input)
{
  static char folder[300];
  static const sf_run_id run[] = {SF_RUN_ANN, SF_RUN_BETA_5E7};
  static const char *const file[] = {"status",      "train.cmd",    "eval.cmd",     "version",         "train.json",
                                     "train.jsonl", "audit-0.json", "fixed-0.json", "prefix-1-0.json", "float-0.json"};
  if (folder[0]) return folder;
  snprintf(folder, sizeof folder, "%s/runs", fuzz_folder());
  for (size_t r = 0; r < sizeof run / sizeof *run; r++) {
    char dir[400], path[440];
    snprintf(dir, sizeof dir, "%s/scene/%s", folder, sf_run_kinds[run[r]].name);
    FUZZ_EXPECT(fuzz_good(sf_make_dir(dir)));
    for (size_t f = 0; f < sizeof file / sizeof *file; f++) {
      snprintf(path, sizeof path, "%s/%s", dir, file[f]);
      FUZZ_EXPECT(!symlink(input, path));
    }
  }
  return folder;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
  static FILE *nowhere;
  sf_reproduction report;
  if (!nowhere) nowhere = fopen("/dev/null", "w");
  FUZZ_EXPECT(nowhere);
  if (!fuzz_good(sf_reproduction_load(&report, make_runs(fuzz_file(data, size))))) return 0;
  FUZZ_EXPECT(report.count == 1);
  sf_reproduction_print(nowhere, &report);
  cJSON *json = sf_reproduction_json(&report);
  FUZZ_EXPECT(json);
  cJSON_Delete(json);
  sf_reproduction_free(&report);
  return 0;
}
