#include "firmware/sf_ray_driver.h"
#include <stdbool.h>

enum { LEVEL_WORDS = 8 }; /* of the encoder's programming; five are used */
/* See rtl/sf_planes.sv. */
enum { PLANES = 0x100, PLANES_SCALES = 0x110, PLANES_ARRAYS = 0x120, BASIS = 0x800, PAIR_ROWS = 64 };

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

static uint32_t inputs(const sf_planes_blob *planes)
{
  return planes->features * (1 + 2 * planes->feature_freqs) + 3 * (1 + 2 * planes->view_freqs);
}

static bool planes_fit(const sf_bus *bus, const sf_planes_blob *planes)
{
  for (int pair = 0; pair < 3; pair++)
    if (planes->components[pair] < 1 || planes->components[pair] > PAIR_ROWS) return false;
  return get(bus, SF_CSR_D1_N_IN) == 0 && inputs(planes) == get(bus, SF_CSR_C1_N_IN);
}

static uint32_t four(const int8_t *value)
{
  return (uint8_t)value[0] | (uint32_t)(uint8_t)value[1] << 8 | (uint32_t)(uint8_t)value[2] << 16 |
         (uint32_t)(uint8_t)value[3] << 24;
}

/* A pair's last line may have room for more components. Their rows are multiplied, too, by 0. */
static void program_basis(const sf_bus *bus, const sf_planes_blob *planes)
{
  const int8_t *row = planes->basis;
  for (uint32_t pair = 0; pair < 3; pair++) {
    put(bus, SF_CSR_ENCODER_ADDRESS, BASIS + pair * PAIR_ROWS * SF_PLANES_FEATURES / 4);
    for (uint32_t c = 0; c < planes->components[pair]; c++, row += SF_PLANES_FEATURES)
      for (uint32_t f = 0; f < SF_PLANES_FEATURES; f += 4) put(bus, SF_CSR_ENCODER_DATA, four(row + f));
  }
}

static void program_planes(const sf_bus *bus, const sf_planes_blob *planes)
{
  put(bus, SF_CSR_ENCODER_ADDRESS, PLANES);
  put(bus, SF_CSR_ENCODER_DATA, 1);
  for (int axis = 0; axis < 3; axis++) put(bus, SF_CSR_ENCODER_DATA, planes->res[axis]);
  put(bus, SF_CSR_ENCODER_DATA, planes->relu);
  put(bus, SF_CSR_ENCODER_DATA, planes->weight_stop);
  put(bus, SF_CSR_ENCODER_DATA, planes->features);
  put(bus, SF_CSR_ENCODER_DATA, planes->feature_freqs);
  put(bus, SF_CSR_ENCODER_DATA, planes->view_freqs);
  put(bus, SF_CSR_ENCODER_DATA, planes->frac);
  put(bus, SF_CSR_ENCODER_ADDRESS, PLANES_SCALES);
  for (int i = 0; i < SF_PLANES_SCALES; i++) {
    put(bus, SF_CSR_ENCODER_DATA, planes->scale[i].mul);
    put(bus, SF_CSR_ENCODER_DATA, planes->scale[i].shift);
  }
  put(bus, SF_CSR_ENCODER_DATA, (uint32_t)planes->bias);
  for (uint32_t i = 0; i < SF_PLANES_ARRAYS; i++) {
    put(bus, SF_CSR_ENCODER_ADDRESS, PLANES_ARRAYS + 4 * i);
    put(bus, SF_CSR_ENCODER_DATA, planes->array[i].plane);
    put(bus, SF_CSR_ENCODER_DATA, planes->array[i].line);
    put(bus, SF_CSR_ENCODER_DATA, planes->array[i].point_lines);
  }
  program_basis(bus, planes);
}

static void program_grid(const sf_bus *bus, const sf_ray_blob *rays)
{
  put(bus, SF_CSR_ENCODER_ADDRESS, PLANES);
  put(bus, SF_CSR_ENCODER_DATA, 0);
  program_encoder(bus, rays);
}

sf_driver_code sf_ray_driver_load(const sf_bus *bus, const sf_ray_blob *rays, const sf_planes_blob *planes)
{
  const uint32_t kind = planes ? SF_CSR_FIELD_KINDS_PLANES : SF_CSR_FIELD_KINDS_GRID;
  if (!(get(bus, SF_CSR_FIELD_KINDS) & kind)) return SF_DRIVER_FIELD;
  if (planes ? !planes_fit(bus, planes) : !fits(bus, rays)) return SF_DRIVER_MISFIT;
  if (!has_cache(bus, rays)) return SF_DRIVER_CACHE;
  planes ? program_planes(bus, planes) : program_grid(bus, rays);
  put(bus, SF_CSR_RAY_TRANS_STOP, rays->trans_stop);
  put(bus, SF_CSR_RAY_MAX_SAMPLES, rays->max_samples);
  put(bus, SF_CSR_RAY_BACKGROUND_R, rays->background[0]);
  put(bus, SF_CSR_RAY_BACKGROUND_G, rays->background[1]);
  put(bus, SF_CSR_RAY_BACKGROUND_B, rays->background[2]);
  put(bus, SF_CSR_FIELD_BASE, rays->table);
  put(bus, SF_CSR_RAY_CTRL, SF_CSR_RAY_CTRL_START);
  return get(bus, SF_CSR_RAY_ERROR) ? SF_DRIVER_REFUSED : SF_DRIVER_OK;
}

/* Reads both halves of a counter that may go on counting, until the high one did not change while the low one was read.
 */
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
