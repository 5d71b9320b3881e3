#include "firmware/sf_ray_driver.h"
#include <stdbool.h>

enum { LEVEL_WORDS = 8 }; /* of the encoder's programming; five are used */

static uint32_t get(const sf_bus *bus, uint32_t offset)
{
  return bus->read(bus->context, offset);
}
static void put(const sf_bus *bus, uint32_t offset, uint32_t value)
{
  bus->write(bus->context, offset, value);
}

const char *sf_ray_driver_error_text(uint32_t error)
{
#define SF_CSR(name, offset, access, reset, meaning)
#define SF_CSR_FIELD(owner, name, lsb, width, meaning)                                                                 \
  if (SF_CSR_##owner == SF_CSR_RAY_ERROR && (error & SF_CSR_##owner##_##name)) return #name ": " meaning;
#include "spikefield/csr.def"
#undef SF_CSR
#undef SF_CSR_FIELD
  return "no error";
}

/* C1's inputs are the directions and all outputs of D2 but the density. */
static bool fits(const sf_bus *bus, const sf_ray_blob *rays)
{
  const uint32_t h = get(bus, SF_CSR_D2_N_OUT) - 1;
  return rays->levels >= 1 && rays->levels <= SF_RAY_LEVELS_MAX && 2 * rays->levels == get(bus, SF_CSR_D1_N_IN) &&
         rays->n_dir <= SF_RAY_DIR_MAX && rays->n_dir == get(bus, SF_CSR_C1_N_IN) - h;
}

void sf_ray_driver_cache(const sf_bus *bus, uint32_t *bytes, uint32_t *ways)
{
  const uint32_t cache = get(bus, SF_CSR_FIELD_CACHE);
  *bytes = (cache & SF_CSR_FIELD_CACHE_BYTES) >> SF_CSR_FIELD_CACHE_BYTES_LSB;
  *ways = (cache & SF_CSR_FIELD_CACHE_WAYS) >> SF_CSR_FIELD_CACHE_WAYS_LSB;
}

static bool has_cache(const sf_bus *bus, const sf_ray_blob *rays)
{
  uint32_t bytes, ways;
  sf_ray_driver_cache(bus, &bytes, &ways);
  return (!rays->cache_bytes || rays->cache_bytes == bytes) && (!rays->cache_ways || rays->cache_ways == ways);
}

static void program_level(const sf_bus *bus, uint32_t index, const sf_ray_level_blob *level)
{
  put(bus, SF_CSR_ENCODER_ADDRESS, index * LEVEL_WORDS);
  put(bus, SF_CSR_ENCODER_DATA, level->scale_q16);
  put(bus, SF_CSR_ENCODER_DATA, level->stride);
  put(bus, SF_CSR_ENCODER_DATA, level->log2_size);
  put(bus, SF_CSR_ENCODER_DATA, level->offset);
  put(bus, SF_CSR_ENCODER_DATA, level->shift);
}

static void program_encoder(const sf_bus *bus, const sf_ray_blob *rays)
{
  for (uint32_t l = 0; l < rays->levels; l++) program_level(bus, l, &rays->level[l]);
  put(bus, SF_CSR_ENCODER_ADDRESS, SF_RAY_LEVELS_MAX * LEVEL_WORDS);
  put(bus, SF_CSR_ENCODER_DATA, rays->levels);
  put(bus, SF_CSR_ENCODER_DATA, rays->n_dir);
  put(bus, SF_CSR_ENCODER_DATA, rays->dir_frac);
}

sf_driver_code sf_ray_driver_load(const sf_bus *bus, const sf_ray_blob *rays)
{
  if (!fits(bus, rays)) return SF_DRIVER_MISFIT;
  if (!has_cache(bus, rays)) return SF_DRIVER_CACHE;
  program_encoder(bus, rays);
  put(bus, SF_CSR_RAY_TRANS_STOP, rays->trans_stop);
  put(bus, SF_CSR_RAY_MAX_SAMPLES, rays->max_samples);
  put(bus, SF_CSR_RAY_BACKGROUND_R, rays->background[0]);
  put(bus, SF_CSR_RAY_BACKGROUND_G, rays->background[1]);
  put(bus, SF_CSR_RAY_BACKGROUND_B, rays->background[2]);
  put(bus, SF_CSR_FIELD_BASE, rays->table);
  put(bus, SF_CSR_RAY_CTRL, SF_CSR_RAY_CTRL_START);
  return get(bus, SF_CSR_RAY_ERROR) ? SF_DRIVER_REFUSED : SF_DRIVER_OK;
}

/* Both halves of a counter that may go on counting: the high one did not change while the low one was read. */
static uint64_t counter(const sf_bus *bus, uint32_t low_half)
{
  uint32_t high = get(bus, low_half + 4), before, low;
  do {
    before = high;
    low = get(bus, low_half);
    high = get(bus, low_half + 4);
  } while (high != before);
  return (uint64_t)high << 32 | low;
}

void sf_ray_driver_field(const sf_bus *bus, sf_field_counters *counters)
{
  counters->lookups = counter(bus, SF_CSR_FIELD_LOOKUPS);
  counters->misses = counter(bus, SF_CSR_FIELD_MISSES);
  counters->fills = counter(bus, SF_CSR_FIELD_FILLS);
  counters->stalls = counter(bus, SF_CSR_FIELD_STALLS);
}

void sf_ray_driver_clear(const sf_bus *bus)
{
  put(bus, SF_CSR_RAY_CTRL, SF_CSR_RAY_CTRL_CLEAR);
}
