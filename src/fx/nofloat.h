/* Included last by every file of src/fx: from here on the compiler rejects floating-point types.
 * (fx.h itself has double fields, units for quant/ and reports; real.c carries them through as text.) */
#ifndef SF_FX_NOFLOAT_H
#define SF_FX_NOFLOAT_H
#pragma GCC poison float double _Float16 _Float32 _Float64 _Float128 __float128
#endif
