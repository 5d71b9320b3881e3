/* Inside src/fx: what a TensoRF scene holds, listed once for memory, file and checks. */
#ifndef SF_FX_ARRAYS_H
#define SF_FX_ARRAYS_H
#include "fx/fx.h"

enum { FX_DIMENSION_MAX = 3 };

/* TensoRF's arrays, all of int8. */
enum { FX_TENSORF_ARRAYS = 4 * FX_PAIRS + 1 };
typedef struct fx_array {
  const char *name; /* of its tensor */
  int8_t **data;
  int dims;
  int64_t shape[FX_DIMENSION_MAX];
} fx_array;
int fx_tensorf_arrays(fx_tensorf *field, fx_array list[FX_TENSORF_ARRAYS]); /* sizes are set; returns their number */
size_t fx_array_bytes(const fx_array *array);
#endif
