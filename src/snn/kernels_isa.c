/* The kernels of kernels.h for one instruction set: the build defines SF_ISA. */
#include "snn/backward_isa.h"
#include "snn/grid_isa.h"

#define SF_JOIN_(a, b) a##b
#define SF_JOIN(a, b) SF_JOIN_(a, b)
#define SF_TEXT_(a) #a
#define SF_TEXT(a) SF_TEXT_(a)

const sf_kernels SF_JOIN(sf_kernels_, SF_ISA) = {SF_TEXT(SF_ISA), prepare,      forward,      density,
                                                 backward,        grid_forward, grid_backward};
