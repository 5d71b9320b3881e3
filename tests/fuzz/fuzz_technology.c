/* Technology files: of what is accepted every price can be asked for, between its points and beyond them. */
#include "fuzz.h"
#include "energy/ledger.h"

static void ask(const sf_technology *t)
{
  static const int bits[] = {1, 8, 9, 31, 64, 256};
  static const uint64_t bytes[] = {1, 100, 8192, 8193, 1 << 20, UINT64_C(1) << 40};
  bool interpolated = false;
  uint64_t fj;
  for (int i = 0; i < 6; i++) {
    (void)sf_price_add(t, bits[i], &interpolated);
    for (int j = 0; j < 6; j++) (void)sf_price_multiply(t, bits[i], bits[j], &interpolated);
    (void)sf_price_access(t, bytes[i], &interpolated);
    (void)sf_price_register(t, bits[i], &interpolated);
  }
  for (int f = 0; f < SF_PRICE_KEYS; f++)
    FUZZ_EXPECT(sf_price_measured(t, (sf_price_family)f, &fj) || (f >= SF_PRICE_FAMILIES || f == SF_PRICE_REGISTER));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
  sf_technology technology;
  if (!fuzz_good(sf_technology_load(&technology, fuzz_file(data, size)))) return 0;
  FUZZ_EXPECT(technology.count > 0 && technology.count <= SF_PRICES_MAX);
  FUZZ_EXPECT(technology.name[0] && technology.title[0]);
  ask(&technology);
  return 0;
}
