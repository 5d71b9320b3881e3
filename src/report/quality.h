/* What `make quality` measures: short runs of several scenes, spiking and twin, over several seeds. */
#ifndef SF_REPORT_QUALITY_H
#define SF_REPORT_QUALITY_H
#include "base/status.h"
#include <cjson/cJSON.h>
#include <stdbool.h>
#include <stdio.h>

/* A number over the seeds that have it; NaN where none has. */
typedef struct sf_spread {
  double mean, least, most;
  int count;
} sf_spread;

typedef enum {
  SF_QUALITY_PSNR,   /* dB, held-out views, spiking at t_r */
  SF_QUALITY_TWIN,   /* dB, of the ReLU twin */
  SF_QUALITY_EXCESS, /* squared error above the twin's, of the PSNRs */
  SF_QUALITY_T_STAR,
  SF_QUALITY_STEPS,   /* t_r */
  SF_QUALITY_WORTH,   /* squared error that one more step saves at t* */
  SF_QUALITY_PRICE,   /* what it costs there */
  SF_QUALITY_LOST,    /* share of the cells that the twins of all seeds have, and the spiking model has not */
  SF_QUALITY_SECONDS, /* of training, spiking */
  SF_QUALITIES
} sf_quality_metric;

typedef struct sf_quality_scene {
  char name[256], states[256]; /* states: how the searches ended, each once */
  sf_spread value[SF_QUALITIES];
} sf_quality_scene;

typedef struct sf_quality {
  sf_quality_scene *scene; /* owned, by name */
  int count;
} sf_quality;

/* Reads DIR/SCENE/{snn,ann}-SEED/{train.json,model.safetensors}. A run that is not finished is not there. Free it after
 * a failure, too. */
sf_status sf_quality_load(sf_quality *quality, const char *dir);
void sf_quality_free(sf_quality *quality);
cJSON *sf_quality_json(const sf_quality *quality);
/* Table; before: of an earlier measurement (sf_quality_json) or NULL, whose differences stand in brackets. */
void sf_quality_print(FILE *out, const sf_quality *quality, const cJSON *before);
#endif
