/* The driver against registers that are not a block's: what no simulated run reaches. */
#include "ck_run.h"
#include "firmware/sf_driver.h"
#include "firmware/sf_ray_driver.h"
#include <stdlib.h>

enum { WORDS = 2048 };

typedef struct registers {
  uint32_t word[WORDS]; /* what reads give, by offset / 4 */
  int rolls;            /* reads of FIELD_MISSES before its low half passes 2^32 */
  uint32_t data_writes;
} registers;

static uint32_t read_word(void *context, uint32_t offset)
{
  registers *r = context;
  const uint32_t value = r->word[offset / 4];
  if (offset == SF_CSR_FIELD_MISSES && r->rolls-- == 1) r->word[offset / 4] = 1, r->word[offset / 4 + 1]++;
  return value;
}

static void write_word(void *context, uint32_t offset, uint32_t value)
{
  (void)value;
  ((registers *)context)->data_writes += offset == SF_CSR_WEIGHT_DATA;
}

static uint32_t half_of(uint32_t offset)
{
  return offset * 2654435761u;
}

static sf_bus filled(registers *r)
{
  memset(r, 0, sizeof *r);
  for (uint32_t at = SF_CSR_COUNTERS; at < 4 * WORDS; at += 4) r->word[at / 4] = half_of(at);
  for (uint32_t at = SF_CSR_FIELD_LOOKUPS; at <= SF_CSR_FIELD_STALLS_HIGH; at += 4) r->word[at / 4] = half_of(at);
  return (sf_bus){read_word, write_word, r};
}

static uint64_t at_place(uint32_t event, uint32_t layer, uint32_t step)
{
  const uint32_t low = SF_CSR_COUNTERS + ((event * 8 + layer) * 8 + step) * 8;
  return (uint64_t)half_of(low + 4) << 32 | half_of(low);
}

TEST(counters_have_both_halves)
{
  registers r;
  const sf_bus bus = filled(&r);
  sf_driver_counters c;
  ck_assert_int_eq(sf_driver_read_counters(&bus, &c), SF_DRIVER_OK);
  for (uint32_t event = 0; event < SF_EVENTS; event++)
    for (uint32_t layer = 0; layer < SF_LAYERS; layer++)
      for (uint32_t step = 0; step < SF_T_MAX; step++)
        ck_assert_uint_eq(c.event[event][layer][step], at_place(event, layer, step));
  const uint64_t global[] = {c.samples, c.rays, c.cycles, c.busy, c.stall_in, c.stall_out};
  for (uint32_t i = 0; i < COUNT(global); i++) ck_assert_uint_eq(global[i], at_place(0, 7, i));
  for (uint32_t l = 0; l < SF_LAYERS; l++) ck_assert_uint_eq(c.layer_busy[l], at_place(1, 7, l));
}

/* The field's counters go on while they are read. */
TEST(halves_belong_together)
{
  registers r;
  const sf_bus bus = filled(&r);
  sf_field_counters c;
  r.word[SF_CSR_FIELD_MISSES / 4] = 0xffffffff, r.word[SF_CSR_FIELD_MISSES / 4 + 1] = 6;
  for (r.rolls = 0; r.rolls < 2;) {
    const int rolls = r.rolls;
    sf_ray_driver_field(&bus, &c);
    ck_assert_uint_eq(c.misses, rolls ? (uint64_t)7 << 32 | 1 : ((uint64_t)6 << 32 | 0xffffffff));
    r.rolls = rolls + 1;
  }
  ck_assert_uint_eq(c.lookups, (uint64_t)half_of(SF_CSR_FIELD_LOOKUPS + 4) << 32 | half_of(SF_CSR_FIELD_LOOKUPS));
  ck_assert_uint_eq(c.fills, (uint64_t)half_of(SF_CSR_FIELD_FILLS + 4) << 32 | half_of(SF_CSR_FIELD_FILLS));
  ck_assert_uint_eq(c.stalls, (uint64_t)half_of(SF_CSR_FIELD_STALLS + 4) << 32 | half_of(SF_CSR_FIELD_STALLS));
}

/* Sizes that no net has: no weight is read. The block refuses them at start. Under the sanitizers a read is found. */
TEST(sizes_that_are_none)
{
  static const int32_t size[] = {-1, INT32_MIN, SF_DRIVER_INPUTS + 1, INT32_MAX};
  int8_t *w = calloc(1, 1);
  for (int i = 0; i < COUNT(size); i++)
    for (int out = 0; out < 2; out++) {
      registers r;
      const sf_bus bus = filled(&r);
      sf_net_blob net = {.mode = 0, .steps = 1};
      for (int l = 0; l < SF_LAYERS; l++) net.layer[l] = (sf_layer_blob){.n_in = 0, .n_out = 0, .w = w};
      net.layer[2] = (sf_layer_blob){.n_in = out ? 1 : size[i], .n_out = out ? size[i] : 1, .bias = 1, .w = w};
      sf_driver_program(&bus, &net);
      ck_assert_uint_eq(r.data_writes, 0);
    }
  free(w);
}
