/* Which vector instructions a program may use. */
#ifndef SF_BASE_CPU_H
#define SF_BASE_CPU_H
#include "base/status.h"
#include <stdbool.h>

typedef enum { SF_CPU_PORTABLE, SF_CPU_AVX2, SF_CPU_AVX512, SF_CPU_AVX512BF16, SF_CPU_AMX } sf_cpu;
/* Whether SPIKEFIELD_CPU (portable, avx2, avx512, avx512bf16, amx) lets the program take its CPU for one that has
 * these; without the variable it does. For machines that are not alike. */
bool sf_cpu_may(sf_cpu has);
/* SF_E_RANGE: SPIKEFIELD_CPU has another word. */
sf_status sf_cpu_check(void);
#endif
