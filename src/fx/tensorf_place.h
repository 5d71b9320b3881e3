/* A position between the points of TensoRF's planes and lines. Widths and equations: tensorf.c. */
#ifndef SF_FX_TENSORF_PLACE_H
#define SF_FX_TENSORF_PLACE_H
#include "src/fx/tensorf.h"

enum { VM_FRAC = 8, VM_ONE = 1 << VM_FRAC };

typedef struct vm_place {
  int32_t at[3], next[3]; /* grid points */
  int32_t g[3];           /* 0..255 */
} vm_place;

static inline vm_place vm_find(const int32_t res[3], const uint32_t pos[3])
{
  const int shift = SF_POS_FRAC - VM_FRAC;
  vm_place p;
  for (int axis = 0; axis < 3; axis++) {
    const int32_t q8 = (int32_t)(((int64_t)pos[axis] * (res[axis] - 1) + (1 << (shift - 1))) >> shift);
    p.at[axis] = q8 >> VM_FRAC;
    p.g[axis] = q8 & (VM_ONE - 1);
    p.next[axis] = p.at[axis] + (p.g[axis] != 0);
  }
  return p;
}
#endif
