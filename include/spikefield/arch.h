/* The constants of arch.def as C enumerators SF_LANES, SF_T_MAX, ... */
#ifndef SPIKEFIELD_ARCH_H
#define SPIKEFIELD_ARCH_H
enum {
#define SF_ARCH(name, value, meaning) SF_##name = (value),
#include "spikefield/arch.def"
#undef SF_ARCH
};
#endif
