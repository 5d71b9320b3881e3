/* Manifests of golden images: what is accepted is written and read back the same. */
#include "fuzz.h"
#include "golden/manifest.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
  char path[300];
  sf_manifest manifest, again;
  if (!fuzz_good(sf_manifest_load(&manifest, fuzz_file(data, size)))) {
    FUZZ_EXPECT(!manifest.view);
    return 0;
  }
  FUZZ_EXPECT(manifest.count >= 0 && manifest.count <= manifest.total);
  cJSON *report = sf_manifest_report_json(&manifest);
  FUZZ_EXPECT(report);
  cJSON_Delete(report);
  snprintf(path, sizeof path, "%s/again.json", fuzz_folder());
  FUZZ_EXPECT(fuzz_good(sf_manifest_save(&manifest, path)));
  FUZZ_EXPECT(fuzz_good(sf_manifest_load(&again, path)));
  FUZZ_EXPECT(again.count == manifest.count && again.total == manifest.total);
  FUZZ_EXPECT(fuzz_good(sf_manifest_same_origin(&manifest.origin, &again.origin)));
  sf_manifest_free(&again);
  sf_manifest_free(&manifest);
  return 0;
}
