/* The safetensors container: what is accepted is described truly, and can be written and read again. */
#include "fuzz.h"
#include "base/io.h"
#include <math.h>

static size_t bytes_of(const sf_tensor *tensor)
{
  size_t bytes = sf_dtype_size(tensor->type);
  for (int k = 0; k < tensor->dims; k++) bytes *= (size_t)tensor->shape[k];
  return bytes;
}

static void look_up(const sf_tensors *set)
{
  for (int i = 0; i < set->count; i++) {
    const sf_tensor *tensor = &set->tensor[i], *found;
    fuzz_touch(tensor->data, bytes_of(tensor));
    fuzz_good(sf_tensor_finite("input", tensor));
    FUZZ_EXPECT(fuzz_good(sf_tensors_get(set, tensor->name, tensor->type, tensor->dims, tensor->shape, &found)));
    FUZZ_EXPECT(found == tensor);
  }
  fuzz_good(sf_tensors_get(set, "absent", SF_F32, 0, NULL, &(const sf_tensor *){0}));
  if (sf_tensors_meta(set, "format")) fuzz_touch(sf_tensors_meta(set, "format"), 1);
}

static void write_again(const sf_tensors *set)
{
  char path[300];
  sf_tensors again;
  snprintf(path, sizeof path, "%s/again.safetensors", fuzz_folder());
  if (!fuzz_good(sf_tensors_save(set->tensor, set->count, set->metadata, path))) return;
  FUZZ_EXPECT(fuzz_good(sf_tensors_load(&again, path)));
  FUZZ_EXPECT(again.count == set->count);
  sf_tensors_free(&again);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
  sf_tensors set;
  if (!fuzz_good(sf_tensors_load(&set, fuzz_file(data, size)))) {
    FUZZ_EXPECT(!set.tensor && !set.buffer && !set.metadata);
    return 0;
  }
  look_up(&set);
  write_again(&set);
  sf_tensors_free(&set);
  return 0;
}
