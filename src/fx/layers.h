/* What is known of a layer whatever the net: its names, what its inputs are and what its outputs do. */
#ifndef SF_FX_LAYERS_H
#define SF_FX_LAYERS_H
#include "base/arch.h"
#include <stdbool.h>

typedef enum { FX_D1, FX_D2, FX_C1, FX_C2, FX_C3 } fx_layer_id;
enum { FX_SPIKING = 3, FX_NO_LAYER = -1 };

typedef struct fx_layer_facts {
  const char *name;
  const char *tensor; /* its weights in a scene file */
  int spikes_of;      /* the layer whose spikes are its inputs, each a SOP; FX_NO_LAYER: values, each a MAC */
  bool fires;         /* its neurons spike: plif; else it integrates what a special function makes of its currents */
  int state_bits;     /* of a membrane, or of the integrator */
} fx_layer_facts;

static const fx_layer_facts fx_layer_table[SF_LAYERS] = {
    [FX_D1] = {"D1", "density.w1", FX_NO_LAYER, true, SF_MEMBRANE_BITS}, /* features */
    [FX_D2] = {"D2", "density.w2", FX_D1, false, SF_SIGMA_BITS},
    [FX_C1] = {"C1", "colour.w3", FX_NO_LAYER, true, SF_MEMBRANE_BITS}, /* harmonics and h, or a decoder's inputs */
    [FX_C2] = {"C2", "colour.w4", FX_C1, true, SF_MEMBRANE_BITS},
    [FX_C3] = {"C3", "colour.w5", FX_C2, false, SF_COLOUR_BITS},
};

/* The layers that fire, in the order of the nets. */
static const int fx_spiking_layers[FX_SPIKING] = {FX_D1, FX_C1, FX_C2};

static inline const char *fx_layer_name(int layer)
{
  return fx_layer_table[layer].name;
}

static inline bool fx_layer_fires(int layer)
{
  return fx_layer_table[layer].fires;
}

static inline bool fx_layer_reads_spikes(int layer)
{
  return fx_layer_table[layer].spikes_of != FX_NO_LAYER;
}

/* Times at which it puts something out: every step where it fires, else the last one. */
static inline int fx_layer_outputs(int layer, int steps)
{
  return fx_layer_fires(layer) ? steps : 1;
}
#endif
