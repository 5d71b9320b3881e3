/* Matrix tiles of the CPU (Intel AMX). */
#ifndef SF_BASE_AMX_H
#define SF_BASE_AMX_H
#include <stdbool.h>

/* Whether the CPU multiplies tiles of bfloat16 pairs and of bytes, and the system lets this process use them; asks for
 * that once more at every call, which costs a system call. Tiles are state of a thread. */
bool sf_have_amx(void);
#endif
