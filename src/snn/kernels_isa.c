/* The kernels of kernels.h for one instruction set: the build defines SF_ISA. */
#include "snn/adam_isa.h"
#include "snn/along_isa.h"
#include "snn/grid_isa.h"
#include "snn/vm_isa.h"

#define SF_JOIN_(a, b) a##b
#define SF_JOIN(a, b) SF_JOIN_(a, b)
#define SF_TEXT_(a) #a
#define SF_TEXT(a) SF_TEXT_(a)

uint64_t SF_JOIN(sf_march_points_, SF_ISA)(const sf_march *march, int word); /* march_isa.c */

const sf_kernels SF_JOIN(sf_kernels_, SF_ISA) = {.name = SF_TEXT(SF_ISA),
                                                 .prepare = prepare,
                                                 .forward = nets_forward,
                                                 .density = nets_density,
                                                 .backward = nets_backward,
                                                 .grid_forward = grid_forward,
                                                 .grid_backward = grid_backward,
                                                 .march = SF_JOIN(sf_march_points_, SF_ISA),
                                                 .vm_density = vm_density,
                                                 .vm_products = vm_products,
                                                 .vm_backward = vm_backward,
                                                 .decoder_prepare = decoder_prepare,
                                                 .decoder_forward = decoder_forward,
                                                 .decoder_backward = decoder_backward,
                                                 .along_density = along_density,
                                                 .along_forward = along_forward,
                                                 .along_backward = along_backward,
                                                 .decoder_along_forward = decoder_along_forward,
                                                 .decoder_along_backward = decoder_along_backward,
                                                 .adam = adam_update};
