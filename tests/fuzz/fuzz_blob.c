/* The firmware's net in memory: opening it and programming a device that takes everything. */
#include "firmware/sf_blob.h"
#include "fuzz.h"

static uint32_t read_register(void *context, uint32_t offset)
{
  (void)context, (void)offset;
  return 0;
}

static void write_register(void *context, uint32_t offset, uint32_t value)
{
  *(uint32_t *)context ^= offset + value;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
  uint32_t sum = 0;
  const sf_bus bus = {read_register, write_register, &sum};
  sf_net_blob net;
  if (size > UINT32_MAX || sf_blob_open(data, (uint32_t)size, &net)) return 0;
  FUZZ_EXPECT(sf_driver_load(&bus, &net) == SF_DRIVER_OK);
  return 0;
}
