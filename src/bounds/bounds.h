/* Error budget of the fixed-point core: per block a bound that is derived (docs/fixed-point.md), and the error that is
 * measured against double precision; then what each block costs in a picture. */
#ifndef SF_BOUNDS_BOUNDS_H
#define SF_BOUNDS_BOUNDS_H
#include "fx/fx.h"
#include "snn/model.h"
#include "scene/scene.h"
#include <cjson/cJSON.h>
#include <stdio.h>

typedef enum {
  SF_BUDGET_RAY,
  SF_BUDGET_STEP,
  SF_BUDGET_GRID,
  SF_BUDGET_FEATURE,
  SF_BUDGET_DIRECTION,
  SF_BUDGET_PLACE,
  SF_BUDGET_PLANE,
  SF_BUDGET_LINE,
  SF_BUDGET_SUM,
  SF_BUDGET_ACTIVATION_ARGUMENT,
  SF_BUDGET_SOFTPLUS,
  SF_BUDGET_RELU,
  SF_BUDGET_ACTIVATED,
  SF_BUDGET_PRODUCT,
  SF_BUDGET_BASIS,
  SF_BUDGET_APPEARANCE,
  SF_BUDGET_SINE,
  SF_BUDGET_FEATURE_WAVES,
  SF_BUDGET_AXES,
  SF_BUDGET_DIRECTION_WAVES,
  SF_BUDGET_CURRENT,
  SF_BUDGET_DECODER_CURRENT,
  SF_BUDGET_H,
  SF_BUDGET_CHARGE,
  SF_BUDGET_MEMBRANE,
  SF_BUDGET_ARGUMENT,
  SF_BUDGET_EXP2,
  SF_BUDGET_EXP2_HIGH,
  SF_BUDGET_SIGMOID,
  SF_BUDGET_DENSITY,
  SF_BUDGET_COLOUR,
  SF_BUDGET_INTEGRATORS,
  SF_BUDGET_EXP_NEG,
  SF_BUDGET_ALPHA,
  SF_BUDGET_WEIGHT,
  SF_BUDGET_UNDECODED,
  SF_BUDGET_TRANSMITTANCE,
  SF_BUDGET_PIXEL,
  SF_BUDGET_BLOCKS
} sf_budget_id;

/* `measured` is the largest error, `bound` the one of its input: some depend on the input (the samples before, the
 * value itself). `ratio` is the most that any input's error has of its own bound; above 1 it refutes the derivation. */
typedef struct sf_budget_row {
  const char *block, *unit;
  const char *bites; /* where it bites, and which width of arch.def buys less of it */
  bool exhaustive;   /* over every input that can make a difference */
  double bound, measured, ratio;
  uint64_t inputs;
  double plant;
} sf_budget_row;

/* Has a field (fx_backbone) the block? */
bool sf_budget_has(int32_t backbone, sf_budget_id id);
/* Measures one block: exhaustively, or over `samples` random and adversarial inputs. Deterministic. */
sf_budget_row sf_budget_measure(sf_budget_id id, uint64_t samples);
/* The same with a fault: `plant` units more in everything that the fixed block yields. */
sf_budget_row sf_budget_measure_planted(sf_budget_id id, uint64_t samples, double plant);
void sf_budget_print(FILE *out, const sf_budget_row *row, int rows);
cJSON *sf_budget_json(const sf_budget_row *row, int rows);

extern const char sf_h_text[]; /* "h = i >> 3": the shift is H_SHIFT */

/* What can be computed in double precision in place of the fixed block; together, but for the weight test: the float
 * model. A field has part of them. */
typedef enum {
  SF_EXACT_LATTICE,  /* unrounded positions and step */
  SF_EXACT_POSITION, /* hash grid: cell fractions, corner weights and features unrounded, from the int8 tables; TensoRF:
                        the place between the points of planes and lines */
  SF_EXACT_PLANE,    /* unrounded values of planes; those of lines, and their products in the density, always are */
  SF_EXACT_PRODUCT,  /* unrounded products of the appearance */
  SF_EXACT_ENTRIES,  /* float table entries; of TensoRF those of the density */
  SF_EXACT_APPEARANCE, /* float planes and lines of the appearance */
  SF_EXACT_ACTIVATION, /* the density's argument, softplus or ReLU, and density */
  SF_EXACT_BASIS,      /* float basis matrix */
  SF_EXACT_FEATURE,    /* unrounded features */
  SF_EXACT_WAVES,      /* sines and cosines of features, of unrounded angles */
  SF_EXACT_D1,         /* float weights, and biases where there are any */
  SF_EXACT_D2,
  SF_EXACT_C1,
  SF_EXACT_C2,
  SF_EXACT_C3,
  SF_EXACT_DIRECTION,  /* unrounded spherical harmonics; the direction, its sines and cosines */
  SF_EXACT_H,          /* no floor behind i >> H_SHIFT */
  SF_EXACT_LEAK,       /* k and theta of the float model */
  SF_EXACT_MEMBRANE,   /* leak products unrounded, no saturation */
  SF_EXACT_EXP2,       /* argument and 2^y */
  SF_EXACT_SIGMOID,    /* argument and logistic function */
  SF_EXACT_INTEGRATOR, /* both output integrators */
  SF_EXACT_COMPOSITE,  /* sigma * delta, exp, transmittance */
  SF_EXACT_DECODE,     /* every sample is decoded, however little it weighs */
  SF_EXACT_BLOCKS
} sf_exact_id;

typedef struct sf_exact_row {
  const char *block;             /* NULL: the field has no such block */
  double psnr;                   /* dB against the fixed picture; INFINITY when equal */
  double psnr_truth;             /* dB against the photograph, same rays */
  uint64_t flips[SF_LAYERS];     /* spikes that differ from the fixed core's at the same position (D1, C1, C2) */
  uint64_t decisions[SF_LAYERS]; /* neurons * steps * samples looked at */
  uint64_t sample_flips, points; /* samples that the net sees on this ray or on the core's, not on both; or on either */
} sf_exact_row;

/* One layer's currents, the core's own inputs given: |error| <= sum |x| |dw| + |w| |dx|, in LSB of the current. */
typedef struct sf_current_row {
  double bound, measured, ratio; /* as in sf_budget_row */
  double rms;
  uint64_t currents;
} sf_current_row;

enum { SF_EXACT_ROWS = SF_EXACT_BLOCKS + 2 }; /* none, each alone, all */
typedef struct sf_picture_budget {
  uint64_t rays, samples;
  sf_exact_row row[SF_EXACT_ROWS]; /* none; 1 + sf_exact_id; all */
  sf_current_row current[SF_LAYERS];
} sf_picture_budget;

typedef struct sf_picture_job {
  const sf_model *model;
  const fx_scene *scene; /* the plain export of model */
  const sf_dataset *data;
  const sf_view *view; /* of data */
  const char *name;    /* of the scene, for messages */
  uint64_t rays, seed;
  bool (*tick)(void *user, int done, int rows); /* before each row; false stops; may be NULL */
  void *user;
} sf_picture_job;
/* The first layer whose weights are not the model's, rounded and clipped; -1: none. Where sizes differ, as after a
 * trim, or units are unknown, it cannot be told, and is -1. */
int sf_other_weights(const sf_model *model, const fx_scene *scene);
/* SF_E_UNSUPPORTED if the scene is not the plain export of this model: other sizes or weights, unknown units. */
sf_status sf_picture_budget_check(const sf_picture_job *job);
/* `rays` random pixels of one view (seeded), rendered once per row. The row "none" must be the core's picture bit for
 * bit, which is checked (SF_E_DIFFERENCE). Makes the check above, too. */
sf_status sf_picture_budget_make(const sf_picture_job *job, sf_picture_budget *budget);
void sf_picture_budget_print(FILE *out, const sf_picture_budget *budget);
cJSON *sf_picture_budget_json(const sf_picture_budget *budget);
#endif
