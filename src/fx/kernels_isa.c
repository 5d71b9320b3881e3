/* The kernels of core.h for one instruction set: the build defines SF_ISA. */
#include "src/fx/cache_isa.h"
#include "src/fx/grid_isa.h"
#include "src/fx/march_isa.h"
#include "src/fx/nets_isa.h"
#include "src/fx/tensorf_isa.h"
#include "src/fx/nofloat.h"

#define FX_JOIN_(a, b) a##b
#define FX_JOIN(a, b) FX_JOIN_(a, b)
#define FX_TEXT_(a) #a
#define FX_TEXT(a) FX_TEXT_(a)

static const fx_vm vm = {vm_density, vm_features};
const fx_kernels FX_JOIN(fx_kernels_, SF_ISA) = {FX_TEXT(SF_ISA), 4 * WIDTH, nets,  features,
                                                 march,           &vm,       lines, look_up};
