/* Large arrays. */
#ifndef SF_BASE_MEMORY_H
#define SF_BASE_MEMORY_H
#include <stddef.h>

/* Zeroed, aligned to a cache line; from 4 MiB on to huge pages where the system grants them, for tables that are read
 * at random. NULL without memory; released by free(). */
void *sf_aligned_alloc(size_t bytes);
#endif
