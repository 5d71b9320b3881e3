#include "base/memory.h"
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

void *sf_aligned_alloc(size_t bytes)
{
  const size_t huge = (size_t)2 << 20, align = bytes >= 2 * huge ? huge : 64;
  const size_t size = (bytes + align - 1) / align * align;
  void *p = aligned_alloc(align, size);
  if (!p) return NULL;
#ifdef MADV_HUGEPAGE
  if (align == huge) madvise(p, size, MADV_HUGEPAGE); /* a wish: what it says does not matter */
#endif
  memset(p, 0, bytes);
  return p;
}
