/* One audit from its files to its figures: what energy_audit runs, once or for each side of a comparison. */
#ifndef SF_SIM_AUDIT_RUN_H
#define SF_SIM_AUDIT_RUN_H
#include "energy/energy.h"

typedef struct sf_audit_options {
  const char *scene, *data, *split; /* .snn file, data set, "train" or "test" */
  int view, views;                  /* one view, or the first `views`; -1 and 0: not given */
  uint64_t rays;                    /* so many random ones in place of all pixels; 0: all pixels */
  int downscale;                    /* as sf_dataset_options */
  double scale;                     /* of the world, 0: the scene's */
  int steps;                        /* in place of the scene's t_r; 0: as it is */
  uint64_t seed, recount_rays;
  int rtl_rays, stall;
  const char *plusarg;
  fx_cache_shape cache; /* of the field; zeros: as built */
  const char *tech;     /* a file, or the name of one beside the program: ../share/spikefield/tech/NAME.tech */
  const char *twin;     /* float model of a ReLU twin, or NULL */
  sf_ranks *ranks;      /* who counts; NULL: this process */
  bool (*tick)(void *user, const char *what, uint64_t done, uint64_t total); /* rays; false stops */
  void *user;
} sf_audit_options;

typedef struct sf_audit {
  sf_audit_options opt;
  fx_scene scene;
  sf_dataset data;
  uint64_t pixels; /* of one view */
  char hash[65];
  sf_technology technology;
  sf_audit_report report;
} sf_audit;

/* Reads the files. Close the audit even after a failure. */
sf_status sf_audit_open(sf_audit *audit, const sf_audit_options *options);
/* Counts and prices: fills the report. Call it on every rank; rank 0 alone prices, and runs the accelerator. If the
 * three counts differ, report.three.agreement says so, and this does not fail. */
sf_status sf_audit_count(sf_audit *audit);
void sf_audit_close(sf_audit *audit);
#endif
