/* The image: a scene and a tile of rays as one block of memory, all that the firmware needs to make pixels. It is
 * little-endian and begins with the header. The parts follow in any order, each 8-byte aligned:
 * - the net (sf_blob.h);
 * - the field: a hash grid's table, or of TensoRF the words of sf_planes_blob followed by its basis matrix, and the
 * lines that the accelerator reads (fx_tensorf_memory), 16-byte aligned;
 * - the occupancy bitmaps of all cascades;
 * - one fx_ray per pixel, row by row;
 * - an fx_steps, if steps grow with the distance. */
#ifndef SF_FIRMWARE_SF_TILE_H
#define SF_FIRMWARE_SF_TILE_H
#include "firmware/sf_blob.h"
#include "firmware/sf_ray_driver.h"
#include "fx/fx.h"
#include <stddef.h>

enum { SF_TILE_MAGIC = 0x4d494653 /* "SFIM" */, SF_TILE_VERSION = 4, SF_TILE_SIDE_MAX = 4096 };

typedef struct sf_tile_header {
  uint32_t magic, version;
  uint32_t bytes;                                  /* of the whole image */
  uint32_t crc;                                    /* sf_crc32 from 0 of all that follows this word */
  uint32_t width, height;                          /* of the tile */
  uint32_t net, net_bytes, table, occupancy, rays; /* where each part begins, from the image's first byte */
  uint32_t levels, entries, occ_res;               /* from here on: as in fx_scene and fx_grid */
  uint32_t log2_bound, steps;                      /* steps: where they begin; 0: they are equal */
  uint32_t planes, lines;                          /* where they begin; 0: a hash grid. Else no levels and entries */
  int32_t step_q24, max_samples, trans_stop, background[3];
  int32_t scale_q16[FX_LEVELS_MAX], stride[FX_LEVELS_MAX], log2_size[FX_LEVELS_MAX], shift[FX_LEVELS_MAX];
  uint32_t offset[FX_LEVELS_MAX];
} sf_tile_header;

/* The same bytes for the host that writes them and the processor that reads them. */
_Static_assert(sizeof(sf_tile_header) % 8 == 0, "the first part begins aligned");
_Static_assert(sizeof(fx_ray) == 96 && sizeof(fx_pixel) == 48, "layout of rays and pixels");
_Static_assert(offsetof(sf_planes_blob, components) == (SF_PLANES_WORDS - 3) * 4, "words of the planes");
_Static_assert(sizeof(fx_steps) == 8 + FX_STEPS_MAX * 13 && FX_STEPS_MAX % 8 == 0, "layout of steps");

/* An image, opened. */
typedef struct sf_tile {
  sf_net_blob net;
  sf_planes_blob planes; /* of TensoRF */
  const uint8_t *lines;  /* NULL: a hash grid */
  fx_scene scene;        /* its net and planes are empty: they are in `net` and `planes` */
  const fx_ray *rays;
  uint32_t width, height;
  fx_pixel *pixels; /* [height][width], in the memory behind the image */
} sf_tile;

/* Points *tile into the block and returns NULL, or says what is wrong with the block. space: bytes of memory from block
 * on; block is 8-byte aligned. Sizes and places are checked. Values are not: the writer has to write a good scene, and
 * the checksum shows that it did not change. */
const char *sf_tile_open(uint8_t *block, uint32_t space, sf_tile *tile);

/* Where the pixels of an image of so many bytes are. */
uint32_t sf_tile_pixels_at(uint32_t bytes);

/* CRC-32 of IEEE 802.3 as zlib's, continued from crc; 0 to begin. */
uint32_t sf_crc32(uint32_t crc, const void *data, uint32_t size);
/* Of fx_pixel_rgba of every pixel: four little-endian words each. */
uint32_t sf_rgba_crc(const fx_pixel *pixels, uint32_t n);
#endif
