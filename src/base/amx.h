/* Matrix tiles of the CPU (Intel AMX). */
#ifndef SF_BASE_AMX_H
#define SF_BASE_AMX_H
#include <stdbool.h>
#include <stdint.h>

/* What _tile_loadconfig reads. Static objects, please: GCC does not see that memory is read. */
typedef struct sf_tile_shapes {
  uint8_t palette, start, reserved[14]; /* palette 1 */
  uint16_t bytes[16];                   /* of a row of each tile */
  uint8_t rows[16];
} sf_tile_shapes;

/* Whether the CPU multiplies tiles of bfloat16 pairs and of bytes, and the system lets this process use them; asks for
 * that once more at every call, which costs a system call. Tiles are state of a thread. */
bool sf_have_amx(void);
#endif
