/* What freestanding code of src/fx takes from <string.h>; support.c has the bodies. */
#ifndef SF_FIRMWARE_LIBC_STRING_H
#define SF_FIRMWARE_LIBC_STRING_H
#include <stddef.h>

void *memcpy(void *restrict to, const void *restrict from, size_t size);
void *memset(void *to, int value, size_t size);
#endif
