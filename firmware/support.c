/* What compiler and core expect of a C library. */
#include "base/status.h"
#include <string.h>

void *memcpy(void *restrict to, const void *restrict from, size_t size)
{
  unsigned char *t = to;
  const unsigned char *f = from;
  for (size_t i = 0; i < size; i++) t[i] = f[i];
  return to;
}

void *memset(void *to, int value, size_t size)
{
  unsigned char *t = to;
  for (size_t i = 0; i < size; i++) t[i] = (unsigned char)value;
  return to;
}

sf_status sf_ok(void)
{
  sf_status status;
  status.code = SF_OK;
  status.message[0] = 0;
  return status;
}
