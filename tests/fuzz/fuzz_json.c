/* JSON files: reports, data sets. */
#include "fuzz.h"
#include "base/io.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
  cJSON *json;
  if (!fuzz_good(sf_json_load(fuzz_file(data, size), &json))) {
    FUZZ_EXPECT(!json);
    return 0;
  }
  char *text = cJSON_Print(json);
  FUZZ_EXPECT(text);
  cJSON_Delete(json);
  /* What is written can be read. */
  FUZZ_EXPECT(fuzz_good(sf_json_load(fuzz_file((const uint8_t *)text, strlen(text)), &json)));
  cJSON_free(text);
  cJSON_Delete(json);
  return 0;
}
