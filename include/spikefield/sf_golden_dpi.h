/* The fixed-point core as a golden model for test benches in SystemVerilog, over DPI-C. The functions of
 * sf_golden_dpi.sv, which says what each gives; this header is for benches that call them from C or C++.
 *
 * One handle is one ray after another; a bench may have any number of them, each used by one thread at a time. Nothing
 * is printed and nothing ends the simulation: a call that cannot do what it should leaves its reason in sf_golden_error
 * and gives 0 or -1 as said. SystemVerilog types in C: bit [255:0] is uint32_t[8], least significant word first. */
#ifndef SPIKEFIELD_SF_GOLDEN_DPI_H
#define SPIKEFIELD_SF_GOLDEN_DPI_H
#include <stdint.h>

#if defined(__GNUC__)
#define SF_GOLDEN_API __attribute__((visibility("default")))
#else
#define SF_GOLDEN_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* NULL only when there is no memory; a scene that cannot be read is a handle with an error. steps 0: the scene's. */
SF_GOLDEN_API void *sf_golden_open(const char *scene, int steps);
SF_GOLDEN_API void sf_golden_close(void *golden); /* NULL is fine */
/* Of the last call that could fail; "" when it did not. Valid until the next call. */
SF_GOLDEN_API const char *sf_golden_error(void *golden);

SF_GOLDEN_API int sf_golden_steps(void *golden);
SF_GOLDEN_API int sf_golden_inputs(void *golden, int layer);
SF_GOLDEN_API int sf_golden_outputs(void *golden, int layer);

/* 1: the beat ended a sample, whose results are there; 0: more beats to come; -1: a bad packet. */
SF_GOLDEN_API int sf_golden_beat(void *golden, uint64_t data, int user, int last);
/* direction[16], features[32] of 16 bits each, two in a word. 1, or -1. */
SF_GOLDEN_API int sf_golden_sample(void *golden, int first, const uint32_t direction[8], const uint32_t features[16]);

SF_GOLDEN_API uint32_t sf_golden_density(void *golden);
SF_GOLDEN_API uint32_t sf_golden_colour(void *golden, int channel);
/* Neuron n is bit n % 32 of word n / 32; bits beyond a build's lanes are 0. */
enum { SF_GOLDEN_WORDS = 8 };
SF_GOLDEN_API void sf_golden_spikes(void *golden, int layer, int step, uint32_t spikes[SF_GOLDEN_WORDS]);
SF_GOLDEN_API void sf_golden_rows(void *golden, int layer, int step, uint32_t rows[SF_GOLDEN_WORDS]);
SF_GOLDEN_API int sf_golden_membrane(void *golden, int layer, int step, int neuron);
SF_GOLDEN_API int sf_golden_current(void *golden, int layer, int step, int neuron);

SF_GOLDEN_API uint64_t sf_golden_counter(void *golden, int at);
SF_GOLDEN_API void sf_golden_clear_counters(void *golden);

#ifdef __cplusplus
}
#endif
#endif
