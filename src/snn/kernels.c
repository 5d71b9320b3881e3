/* Choice of the instruction set at run time. */
#include "snn/kernels.h"
#include "base/amx.h"
#include "base/cpu.h"
#include <string.h>

extern const sf_kernels sf_kernels_portable;
#if defined(__x86_64__)
extern const sf_kernels sf_kernels_avx2, sf_kernels_avx512, sf_kernels_avx512bf16, sf_kernels_amx;
#endif

const sf_kernels *sf_kernels_training(void)
{
  static const char *const rounding[] = {"amx", "avx512bf16"};
  for (int i = 0; i < 2; i++) {
    const sf_kernels *fast = sf_kernels_select(rounding[i]);
    if (fast) return fast;
  }
  return sf_kernels_select(NULL);
}

const sf_kernels *sf_kernels_select(const char *name)
{
  const sf_kernels *candidate[5];
  int n = 0;
#if defined(__x86_64__)
  __builtin_cpu_init();
  if (sf_cpu_may(SF_CPU_AVX512) && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("fma")) {
    candidate[n++] = &sf_kernels_avx512;
    if (sf_cpu_may(SF_CPU_AVX512BF16) && __builtin_cpu_supports("avx512bf16") &&
        __builtin_cpu_supports("avx512vbmi2")) { /* round: only by name */
      candidate[n++] = &sf_kernels_avx512bf16;
      if (name && !strcmp(name, "amx") && sf_cpu_may(SF_CPU_AMX) && sf_have_amx()) candidate[n++] = &sf_kernels_amx;
    }
  }
  if (sf_cpu_may(SF_CPU_AVX2) && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
    candidate[n++] = &sf_kernels_avx2;
#endif
  candidate[n++] = &sf_kernels_portable;
  if (!name) return candidate[0];
  for (int i = 0; i < n; i++)
    if (!strcmp(candidate[i]->name, name)) return candidate[i];
  return NULL;
}
