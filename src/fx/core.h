/* Inside src/fx: a core at work on blocks of samples. */
#ifndef SF_FX_CORE_H
#define SF_FX_CORE_H
#include "src/fx/kernels.h"

/* fx_march_next by the core's kernels. */
int32_t fx_core_march(const fx_core *core, const fx_ray *ray, int32_t n, uint32_t pos[3], fx_counts *counts);

/* Adds sample i's saturations to counts and its events to cost (may be NULL). */
void fx_block_account(const fx_core *core, const fx_block *b, int i, fx_counts *counts, fx_cost *cost);
#endif
