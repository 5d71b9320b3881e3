/* A scene's spiking nets and what happens in them, in the formats of other tools: spike and potential traces of
 * SANA-FE, graphs of NIR. docs/activity.md says what corresponds to what. */
#ifndef SF_EXCHANGE_EXCHANGE_H
#define SF_EXCHANGE_EXCHANGE_H
#include "fx/fx.h"
#include "snn/model.h"
#include "scene/scene.h"

/* ---- traces as SANA-FE writes them ---- */

typedef struct sf_traces_options {
  int view; /* of the data set; -1: a random one for every ray */
  int rays; /* random pixels; ray N is sf_cosim's ray N of the same seed where view is -1 */
  uint64_t seed;
} sf_traces_options;

typedef struct sf_traces_report {
  int rays; /* with samples */
  uint64_t samples, timesteps, spikes;
} sf_traces_report;

/* FOLDER/spikes.csv: "neuron,timestep", a line "C1.5,3" per spike. FOLDER/potentials.csv: "timestep,neuron C1.0,...", a
 * line per time step: membranes after fire and reset, in their LSB. Groups are C1, C2, D1. Time steps count from 1
 * through all samples, net.steps each. FOLDER/samples.csv: "timestep,ray,view,x,y,sample" of each sample's first step.
 * SF_E_FORMAT when no ray has a sample. */
sf_status sf_traces_write(const char *folder, const fx_scene *scene, const sf_dataset *data,
                          const sf_traces_options *options, sf_traces_report *report);
/* ---- NIR (Pedersen et al. 2024) ---- */

/* The graph of the nets as an HDF5 file for NIR's readers: Input "features" and "direction" (of a
 * decoder "inputs" alone), Linear or Affine "D1_weight" ..., LIF (or IF) "D1", "C1", "C2", Output "density" and
 * "colour". A model's numbers are real, a scene's are its integers in floating point. What NIR cannot say (soft reset,
 * hybrid's first step, rounding) is metadata: see docs/activity.md. Spiking nets only; SF_E_UNSUPPORTED in a build
 * without HDF5. */
sf_status sf_nir_write_model(const char *path, const sf_model *model);
sf_status sf_nir_write_scene(const char *path, const fx_scene *scene);
#endif
