/* csr.def as tables. */
#include "tools/gen/gen.h"
#include "base/arch.h"
#include <string.h>

const gen_register gen_registers[] = {
#define SF_CSR(name, offset, access, reset, meaning) {#name, offset, GEN_##access, reset, meaning},
#include "spikefield/csr.def"
#undef SF_CSR
#undef SF_CSR_FIELD
};
const gen_field gen_fields[] = {
#define SF_CSR(name, offset, access, reset, meaning)
#define SF_CSR_FIELD(owner, name, lsb, width, meaning) {#owner, #name, lsb, width, meaning},
#include "spikefield/csr.def"
#undef SF_CSR
#undef SF_CSR_FIELD
};
const gen_memory gen_memories[] = {
#define SF_CSR(name, offset, access, reset, meaning)
#define SF_CSR_WINDOW(name, words, bits, meaning) {#name, NULL, NULL, words, bits, meaning},
#define SF_CSR_MEMORY(name, address, data, words, bits, meaning) {#name, #address, #data, words, bits, meaning},
#include "spikefield/csr.def"
#undef SF_CSR
#undef SF_CSR_FIELD
};
const int gen_register_count = sizeof gen_registers / sizeof *gen_registers;
const int gen_field_count = sizeof gen_fields / sizeof *gen_fields;
const int gen_memory_count = sizeof gen_memories / sizeof *gen_memories;

const char *gen_access_name(gen_access access)
{
  static const char *const names[] = {"RO", "RW", "WO", "W1C"};
  return names[access];
}

const gen_memory *gen_window(const gen_register *r)
{
  for (int i = 0; i < gen_memory_count; i++)
    if (!gen_memories[i].address && !strcmp(gen_memories[i].name, r->name)) return &gen_memories[i];
  return NULL;
}

const gen_field *gen_next_field(const gen_register *r, int *at)
{
  for (++*at; *at < gen_field_count; ++*at)
    if (!strcmp(gen_fields[*at].owner, r->name)) return &gen_fields[*at];
  return NULL;
}

gen_field gen_whole(const gen_register *r)
{
  return (gen_field){r->name, "VALUE", 0, 32, r->meaning};
}

int gen_all_fields(const gen_register *r, gen_field *out)
{
  int count = 0, at = -1;
  for (const gen_field *f; (f = gen_next_field(r, &at));) out[count++] = *f;
  if (!count) out[count++] = gen_whole(r);
  return count;
}

bool gen_volatile(const gen_register *r)
{
  for (int i = 0; i < gen_memory_count; i++)
    if (gen_memories[i].address && !strcmp(gen_memories[i].address, r->name)) return true;
  /* A register that is only read and has contents after reset is a constant. */
  return r->access == GEN_W1C || (r->access == GEN_RO && !r->reset);
}

bool gen_testable(const gen_register *r)
{
  return r->access == GEN_RO && !gen_volatile(r);
}
