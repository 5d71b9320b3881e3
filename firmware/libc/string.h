/* What freestanding code of src/fx takes from <string.h>; support.c has the bodies. */
#ifndef SPIKEFIELD_FIRMWARE_STRING_H
#define SPIKEFIELD_FIRMWARE_STRING_H
#include <stddef.h>

void *memcpy(void *restrict to, const void *restrict from, size_t size);
void *memset(void *to, int value, size_t size);
#endif
