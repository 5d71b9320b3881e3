#include "firmware/sf_tile.h"
#include "fx/cache.h"
#include "fx/tensorf.h"
#include <stdbool.h>
#include <string.h>

enum { CRC_FROM = offsetof(sf_tile_header, width), LOG2_BOUND_MAX = 6, PLANES_BYTES = SF_PLANES_WORDS * 4 };

uint32_t sf_crc32(uint32_t crc, const void *data, uint32_t size)
{
  static const uint32_t table[16] = {0x00000000, 0x1db71064, 0x3b6e20c8, 0x26d930ac, 0x76dc4190, 0x6b6b51f4,
                                     0x4db26158, 0x5005713c, 0xedb88320, 0xf00f9344, 0xd6d6a3e8, 0xcb61b38c,
                                     0x9b64c2b0, 0x86d3d2d4, 0xa00ae278, 0xbdbdf21c};
  const uint8_t *bytes = data;
  crc = ~crc;
  for (uint32_t i = 0; i < size; i++) {
    crc ^= bytes[i];
    crc = crc >> 4 ^ table[crc & 15];
    crc = crc >> 4 ^ table[crc & 15];
  }
  return ~crc;
}

uint32_t sf_rgba_crc(const fx_pixel *pixels, uint32_t n)
{
  uint32_t crc = 0, rgba[4];
  for (uint32_t i = 0; i < n; i++) {
    fx_pixel_rgba(&pixels[i], rgba);
    crc = sf_crc32(crc, rgba, sizeof rgba);
  }
  return crc;
}

uint32_t sf_tile_pixels_at(uint32_t bytes)
{
  return (bytes + 7) & ~7u;
}

/* True if a part of so many bytes lies after the header and inside the tile. */
static bool inside(const sf_tile_header *h, uint32_t at, uint64_t size)
{
  return at % 8 == 0 && at >= sizeof *h && at <= h->bytes && size <= h->bytes - at;
}

static bool tile_fits(const sf_tile_header *h, uint32_t space)
{
  if (h->width < 1 || h->height < 1 || h->width > SF_TILE_SIDE_MAX || h->height > SF_TILE_SIDE_MAX) return false;
  const uint64_t pixels = (uint64_t)h->width * h->height, end = sf_tile_pixels_at(h->bytes) + pixels * sizeof(fx_pixel);
  return inside(h, h->rays, pixels * sizeof(fx_ray)) && end <= space;
}

static bool level_fits(const sf_tile_header *h, uint32_t level)
{
  const int32_t stride = h->stride[level], log2_size = h->log2_size[level];
  if (stride < 0 || stride > 1 << 10 || log2_size < 0 || log2_size > 30) return false;
  const uint64_t size = stride ? (uint64_t)stride * (uint64_t)stride * (uint64_t)stride : 1u << log2_size;
  return h->offset[level] <= h->entries && size <= h->entries - h->offset[level];
}

static bool grid_fits(const sf_tile_header *h)
{
  if (h->levels < 1 || h->levels > FX_LEVELS_MAX) return false;
  for (uint32_t level = 0; level < h->levels; level++)
    if (!level_fits(h, level)) return false;
  return !h->lines && inside(h, h->table, (uint64_t)h->entries * FX_GRID_FEATURES);
}

static sf_planes_blob planes_of(const sf_tile_header *h, const uint8_t *block)
{
  sf_planes_blob planes;
  memcpy(&planes, block + h->planes, PLANES_BYTES);
  planes.basis = (const int8_t *)block + h->planes + PLANES_BYTES;
  return planes;
}

/* True if so many points lie in the memory from this line on. */
static bool points_fit(const sf_tile_header *h, uint64_t line, uint64_t points, uint64_t point_lines)
{
  return inside(h, h->lines, (line + points * point_lines) * FX_LINE);
}

static bool planes_fit(const sf_tile_header *h, const uint8_t *block)
{
  if (h->levels || h->entries || h->table || h->lines % FX_LINE || !inside(h, h->planes, PLANES_BYTES)) return false;
  const sf_planes_blob planes = planes_of(h, block);
  uint64_t rows = 0;
  for (int axis = 0; axis < 3; axis++) {
    if (planes.res[axis] < 1 || planes.res[axis] > FX_TENSORF_RES_MAX) return false;
    if (planes.components[axis] > FX_COMPONENTS_MAX) return false;
    rows += planes.components[axis];
  }
  for (int i = 0; i < SF_PLANES_ARRAYS; i++) {
    const sf_planes_array_blob *array = &planes.array[i];
    const int *axes = fx_pair_axes[i % FX_PAIRS];
    const uint64_t points = (uint64_t)planes.res[axes[0]] * planes.res[axes[1]], n = array->point_lines;
    if (n > FX_COMPONENTS_MAX / FX_LINE || !points_fit(h, array->plane, points, n)) return false;
    if (!points_fit(h, array->line, planes.res[axes[2]], n)) return false;
  }
  return inside(h, h->planes, PLANES_BYTES + rows * SF_PLANES_FEATURES);
}

static bool space_fits(const sf_tile_header *h)
{
  const uint64_t res = h->occ_res;
  if (res < 2 || res > 256 || (res & (res - 1)) != 0 || h->log2_bound > LOG2_BOUND_MAX) return false;
  if (h->steps && !inside(h, h->steps, sizeof(fx_steps))) return false;
  return inside(h, h->occupancy, (h->log2_bound + 1) * (res * res * res / 8));
}

/* Checks the header: a grid has the net's number of features, and planes need a net without densities. */
static bool net_fits(const sf_tile_header *h, const sf_net_blob *net)
{
  return net->layer[0].n_in == (int32_t)h->levels * FX_GRID_FEATURES && (net->layer[0].n_out == 0) == (h->planes != 0);
}

static fx_grid grid_of(const sf_tile_header *h, uint8_t *block)
{
  fx_grid grid = {.levels = (int32_t)h->levels, .entries = (int64_t)h->entries, .table = (int8_t *)(block + h->table)};
  for (uint32_t level = 0; level < h->levels; level++) {
    grid.scale_q16[level] = h->scale_q16[level];
    grid.stride[level] = h->stride[level];
    grid.log2_size[level] = h->log2_size[level];
    grid.shift[level] = h->shift[level];
    grid.offset[level] = (int64_t)h->offset[level];
  }
  return grid;
}

static void point_into(const sf_tile_header *h, uint8_t *block, sf_tile *tile)
{
  tile->scene = (fx_scene){.backbone = h->planes ? FX_TENSORF : FX_INGP,
                           .grid = grid_of(h, block),
                           .occ_res = (int32_t)h->occ_res,
                           .log2_bound = (int32_t)h->log2_bound,
                           .occupancy = block + h->occupancy,
                           .steps = h->steps ? (fx_steps *)(block + h->steps) : NULL,
                           .step_q24 = h->step_q24,
                           .max_samples = h->max_samples,
                           .trans_stop = h->trans_stop,
                           .background = {h->background[0], h->background[1], h->background[2]}};
  if (h->planes) tile->planes = planes_of(h, block);
  tile->lines = h->planes ? block + h->lines : NULL;
  tile->rays = (const fx_ray *)(block + h->rays);
  tile->width = h->width, tile->height = h->height;
  tile->pixels = (fx_pixel *)(block + sf_tile_pixels_at(h->bytes));
}

const char *sf_tile_open(uint8_t *block, uint32_t space, sf_tile *tile)
{
  const sf_tile_header *h = (const sf_tile_header *)block;
  if (space < sizeof *h || h->magic != SF_TILE_MAGIC) return "none in memory";
  if (h->version != SF_TILE_VERSION) return "of another version than this firmware's";
  if (h->bytes < sizeof *h || h->bytes > space) return "cut short, or larger than the memory";
  if (sf_crc32(0, block + CRC_FROM, h->bytes - CRC_FROM) != h->crc) return "damaged: wrong checksum";
  if (!tile_fits(h, space)) return "the tile does not fit";
  if (!space_fits(h) || !(h->planes ? planes_fit(h, block) : grid_fits(h))) return "field or occupancy do not fit";
  if (!inside(h, h->net, h->net_bytes) || sf_blob_open(block + h->net, h->net_bytes, &tile->net))
    return "the net is not whole";
  if (!net_fits(h, &tile->net)) return "net and field differ";
  point_into(h, block, tile);
  return NULL;
}
