/* The firmware's image in memory: a wrong checksum is mended, then every part of an opened one is read from end to end.
 */
#include "firmware/sf_tile.h"
#include "fuzz.h"
#include <stdlib.h>
#include <string.h>

/* The checksum is in another unit, so every byte is read. */
static void use(const sf_tile *tile)
{
  const uint32_t pixels = tile->width * tile->height, res = (uint32_t)tile->scene.occ_res;
  memset(tile->pixels, 0, pixels * sizeof *tile->pixels);
  sf_crc32(0, tile->rays, pixels * (uint32_t)sizeof *tile->rays);
  sf_crc32(0, tile->scene.occupancy, res * res * res / 8);
  sf_crc32(0, tile->scene.grid.table, (uint32_t)tile->scene.grid.entries * FX_GRID_FEATURES);
  for (int l = 0; l < SF_LAYERS; l++) sf_crc32(0, tile->net.layer[l].w, (uint32_t)tile->net.layer[l].n_in * SF_LANES);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
  enum { ROOM = 64 * sizeof(fx_pixel), FROM = offsetof(sf_tile_header, width) };
  sf_tile tile;
  if (size > 1 << 24) return 0;
  uint8_t *block = calloc(1, size + ROOM);
  FUZZ_EXPECT(block);
  memcpy(block, data, size);
  sf_tile_header *h = (sf_tile_header *)block;
  if (size >= sizeof *h && h->bytes >= sizeof *h && h->bytes <= size)
    h->crc = sf_crc32(0, block + FROM, h->bytes - FROM);
  if (!sf_tile_open(block, (uint32_t)(size + ROOM), &tile)) use(&tile);
  free(block);
  return 0;
}
