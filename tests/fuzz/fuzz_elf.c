/* Firmware in ELF: what is accepted lies within the memory of a program. The emulator is not here, its memory is. */
#include "firmware/sf_soc.h"
#include "fuzz.h"
#include "sim/soc/soc.h"

struct sf_soc {
  uint8_t *ram; /* SF_SOC_PROGRAM_SIZE */
  int begun;
};

/* What the system has besides, for the picture, is not for a program: a write there is one beyond `ram`. */
uint8_t *sf_soc_memory(sf_soc *soc, uint32_t address, uint64_t size)
{
  if (address < SF_SOC_RAM || size > SF_SOC_RAM_SIZE || address - SF_SOC_RAM > SF_SOC_RAM_SIZE - size) return NULL;
  return soc->ram + (address - SF_SOC_RAM);
}

void sf_soc_begin_at(sf_soc *soc, uint32_t address)
{
  (void)address;
  soc->begun++;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
  sf_soc soc = {.ram = malloc(SF_SOC_PROGRAM_SIZE)};
  FUZZ_EXPECT(soc.ram);
  const int good = fuzz_good(sf_soc_load_elf(&soc, fuzz_file(data, size)));
  FUZZ_EXPECT(soc.begun == good);
  free(soc.ram);
  return 0;
}
