/* What sf_train tells while it learns and at the end. */
#ifndef SF_TOOLS_TRAIN_REPORT_H
#define SF_TOOLS_TRAIN_REPORT_H
#include "tools/train/options.h"
#include <stdio.h>

/* Averages for the eye; the log has the raw values. */
typedef struct train_recent {
  double mse;
} train_recent;

/* Held-out quality at the end. */
typedef struct train_quality {
  double psnr, ssim, prefix[SF_T_MAX];
  sf_ray_events events; /* of all views */
  int views, prefixes;
  int width, height;  /* of the last view */
  const char *layout; /* of the data */
} train_quality;

/* steps: T. */
void train_log_line(FILE *log, const sf_train_stats *s, int steps);
void train_smooth(train_recent *r, const sf_train_stats *s);
/* What fits 80 columns: the log has the rest. */
void train_show(sf_progress *p, const sf_train_stats *s, const train_recent *r);
void train_show_evaluation(sf_progress *p, int done, int all, double seconds);
void train_warn(sf_progress *progress, const sf_train_stats *s);
/* To standard output as text or JSON, and to --summary. */
sf_status train_report(const train_arguments *a, const sf_model *model, const sf_train_stats *s,
                       const train_quality *q);
#endif
