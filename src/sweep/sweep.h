/* What each bit of width costs. A point is one model quantised at some widths, rendered and counted on one view; a
 * sweep is a folder of points, and its report names those that no other beats. */
#ifndef SF_SWEEP_SWEEP_H
#define SF_SWEEP_SWEEP_H
#include "field/field.h"
#include "quant/quant.h"
#include <cjson/cJSON.h>
#include <stdio.h>

/* What is swept. AC_FRAC, H_SHIFT and TRANS_FRAC are those that the program was built with (make ARCH=...). */
typedef enum {
  SF_AXIS_WEIGHT,
  SF_AXIS_FEATURE,
  SF_AXIS_GRID,
  SF_AXIS_LEAK,
  SF_AXIS_AC_FRAC,
  SF_AXIS_H_SHIFT,
  SF_AXIS_TRANS_FRAC,
  SF_AXIS_TABLE, /* the field's size: log2 of a hashed level's entries, points of planes; another is another training */
  SF_AXIS_STEPS,
  SF_AXES
} sf_axis_id;
typedef struct sf_axis {
  const char *name, *letter;    /* "weight_bits", "w" */
  const char *title[SF_FIELDS]; /* "weights, bits", by sf_backbone_kind; NULL: such models have none */
} sf_axis;
extern const sf_axis sf_axes[SF_AXES];

typedef enum {
  SF_POINT_PSNR_TRUTH, /* fixed point against the picture, dB */
  SF_POINT_PSNR_FLOAT, /* fixed point against the float field at the same steps, dB */
  SF_POINT_LOSS,       /* dB against the picture that the float field has more */
  SF_POINT_EXCESS,     /* mean squared error against the picture, less the float field's */
  SF_POINT_MAX_ERROR,  /* largest difference from the float field in a channel, of 255 */
  SF_POINT_ENERGY,     /* ledgers of audit.h, mJ per frame */
  SF_POINT_ENERGY_H_ONCE,
  SF_POINT_ENERGY_H_SPIKES,
  SF_POINT_ENERGY_ANN,
  SF_POINT_BYTES,   /* of the packed model */
  SF_POINT_TRAFFIC, /* bits of weights, grid entries and states moved per frame */
  SF_POINT_CLIPPED_FEATURES,
  SF_POINT_CLIPPED_DENSITY, /* saturations of D2: harmless, alpha saturates long before */
  SF_POINT_CLIPPED_STATES,  /* of D1, C1, C2, C3: unexpected but in modes no-decay and radix */
  SF_POINT_SAMPLES,         /* through the nets */
  SF_POINT_SPEED,           /* samples/s of the fixed-point core, grid and marching included */
  SF_POINT_FIGURES
} sf_point_figure_id;
typedef struct sf_point_figure {
  const char *name, *head, *title, *format; /* in JSON and CSV; of a column; in full; as printed */
} sf_point_figure;
extern const sf_point_figure sf_point_figures[SF_POINT_FIGURES];

typedef struct sf_point {
  char name[128], model[128]; /* "w8-f12-...", file name of the model */
  int backbone;               /* sf_backbone_kind */
  int axis[SF_AXES];          /* 0: the model has none */
  int steps_max;              /* the model's T */
  double figure[SF_POINT_FIGURES];
  bool front; /* see sf_sweep_mark */
} sf_point;

/* Quantises, renders in float and in fixed point, compares, counts. */
typedef struct sf_point_options {
  const char *model, *data, *split; /* paths; "train" or "test" */
  int view, every;                  /* every Nth pixel along both axes; figures per frame are scaled up */
  sf_quant_options quant;
} sf_point_options;
sf_status sf_point_measure(sf_point *point, const sf_point_options *options);
cJSON *sf_point_json(const sf_point *point); /* NULL: no memory */
void sf_point_print(FILE *out, const sf_point *point);

/* The points of DIR/points/NAME.json in the order of their axes. */
typedef struct sf_sweep {
  char dir[4096];
  sf_point *point;
  int count;
  const sf_point *centre; /* the point that the sweep goes around, named in DIR/centre */
} sf_sweep;
sf_status sf_sweep_load(sf_sweep *sweep, const char *dir);
void sf_sweep_free(sf_sweep *sweep);

/* Whether a is at least as good as b in PSNR against the picture and in each of the costs, and better in one. Figures
 * are compared as printed, so that noise makes no front. */
bool sf_point_beats(const sf_point *a, const sf_point *b, const int *cost, int costs);
/* Marks the front: points that no other beats in energy (paper ledger), packed bytes and bits moved. */
void sf_sweep_mark(sf_sweep *sweep);
/* What tells a point from the centre: "w5 t1", "centre". */
void sf_point_short_name(const sf_sweep *sweep, const sf_point *point, char *text, size_t size);
/* The point differs from the centre in `axis` at most. */
bool sf_point_on_axis(const sf_sweep *sweep, const sf_point *point, int axis);

/* Markdown; one CSV row per point; DIR/plots/NAME.gp, self-contained gnuplot scripts that write NAME.svg. */
void sf_sweep_print(FILE *out, const sf_sweep *sweep);
void sf_sweep_csv(FILE *out, const sf_sweep *sweep);
sf_status sf_sweep_plots(const sf_sweep *sweep, int *count);
#endif
