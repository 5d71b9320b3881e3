/* A trained ReLU twin as a spiking net without training: every ReLU becomes an integrate-and-fire neuron without leak,
 * whose rate over T steps stands for the activation (Diehl et al. 2015, Rueckauer et al. 2017). It is what PATA is held
 * against. Float; of a TensoRF model the decoder is converted, its densities stay. */
#ifndef SF_CONVERT_CONVERT_H
#define SF_CONVERT_CONVERT_H
#include "snn/model.h"

enum { SF_CONVERTED_LAYERS = 3, SF_CONVERT_STEPS = 1024, SF_CONVERT_POINTS = 16 };

/* Thresholds of D1, C1, C2 (a decoder has no D1) are balanced: a neuron that fires at every step stands for this
 * activation. Inputs and biases are the same current at every step, a spike carries its layer's threshold, membranes
 * begin at half of it and are reset by it. The density's and the colour's currents are averaged over the steps before
 * their activations. */
typedef struct sf_converted {
  const sf_model *model; /* the twin; must outlive it */
  int first;             /* 0, or 1 of a decoder: C1 */
  float threshold[SF_CONVERTED_LAYERS];
  float *d2, *c1, *c2, *c3; /* transposed: a row is what one input adds; owned */
  float *memory;
} sf_converted;

/* Thresholds: the percentile (0..100] of a layer's activations on `rays` random rays of the views, 1 where it is 0.
 * SF_E_USAGE: no ReLU twin. */
sf_status sf_convert(sf_converted *net, const sf_model *twin, const sf_dataset *views, int rays, double percentile,
                     uint64_t seed);
void sf_converted_free(sf_converted *net);

/* Outputs of one sample after each number of steps, which rise. in: features of a hash grid, or a decoder's inputs,
 * which hold the direction: it has no sigma, and does not read sh. sops: additions that spikes caused until there. */
typedef struct sf_converted_output {
  float sigma, colour[3];
  uint64_t sops;
} sf_converted_output;
void sf_converted_sample(const sf_converted *net, const float *in, const float *sh, int points, const int *steps,
                         sf_converted_output *output);
/* Products of one sample in that many steps: constant inputs once, those of h at every step. steps = 0: of the twin,
 * all its synapses. */
uint64_t sf_converted_macs(const sf_model *twin, int steps);

/* On random rays of the views with a picture. The twin itself is steps = 0. samples: those that the net sees. Energy:
 * paper ledger, fJ. */
typedef struct sf_conversion {
  int steps;
  double psnr;
  uint64_t samples, macs, sops, fj; /* of all rays */
} sf_conversion;
typedef struct sf_conversion_rays {
  int count;
  uint64_t seed;
  void (*tick)(void *user, int done); /* or NULL; by one thread */
  void *user;
} sf_conversion_rays;
sf_status sf_convert_measure(const sf_converted *net, const sf_dataset *views, const sf_conversion_rays *rays,
                             int points, const int *steps, sf_conversion *twin, sf_conversion *result);
#endif
