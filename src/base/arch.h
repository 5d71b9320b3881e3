/* The constants of arch.def as C enumerators SF_LANES, SF_T_MAX, ..., and what follows from them. */
#ifndef SF_BASE_ARCH_H
#define SF_BASE_ARCH_H
enum {
#define SF_ARCH(name, value, meaning) SF_##name = (value),
#include "spikefield/arch.def"
#undef SF_ARCH
  SF_SPIKE_WORDS = SF_LANES / 64 /* of a layer's bitmap: neuron n is bit n % 64 of word n / 64 */
};

/* The largest value of a symmetric signed number of `bits` bits. */
static inline int sf_symmetric_max(int bits)
{
  return (1 << (bits - 1)) - 1;
}
#endif
