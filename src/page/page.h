/* One audit as one self-contained HTML page: nothing is fetched, it works without JavaScript, it is well-formed XML.
 * report*.html are its template, filled with the values of its JSON; charts are functions that read the same values.
 * Every number that the JSON report has stands in a <data data-key="PATH" value="EXACT"> element, and the JSON itself
 * is inside the page (id "audit-json"), so that the two can be compared. */
#ifndef SF_PAGE_PAGE_H
#define SF_PAGE_PAGE_H
#include "golden/golden.h"

/* The pictured view with t steps. */
typedef struct sf_page_prefix {
  double psnr, ssim; /* against the picture; NaN without one */
  uint64_t fj;       /* paper ledger */
} sf_page_prefix;

/* Spikes of the samples of one ray, from the front. */
enum { SF_PAGE_COLUMNS = 64, SF_PAGE_BINS = 20 };
typedef struct sf_page_ray {
  int x, y;                                                              /* its pixel */
  int samples;                                                           /* shown: at most SF_PAGE_COLUMNS / steps */
  int all;                                                               /* of the ray */
  uint64_t spikes[SF_PAGE_COLUMNS][SF_LAYERS][SF_T_MAX][SF_SPIKE_WORDS]; /* as fx_trace */
} sf_page_ray;

typedef struct sf_page {
  /* The caller's. */
  const sf_audit_report *report;
  const fx_scene *scene;
  const sf_dataset *data;
  const sf_view *view;                           /* of data: the pictured one */
  const char *model;                             /* float model for its PSNR, or NULL */
  bool model_optional;                           /* leave its PSNR out where it is not the scene's */
  const char *command;                           /* that repeats the run */
  bool whole;                                    /* the audit covers every pixel of this view and nothing else */
  bool (*tick)(void *user, int done, int total); /* pictures; false stops. Or NULL */
  void *user;
  /* sf_page_gather's. */
  sf_golden golden; /* with t_r steps */
  uint8_t *steps;   /* [height][width] time steps that a pixel needs, 0 = no samples; NULL without a picture */
  sf_page_prefix prefix[SF_T_MAX]; /* t = 1.. */
  double psnr_float;               /* NaN: not measured */
  int trained_steps;               /* T of the float model, 0: unknown */
  char model_sha256[65];
  sf_page_ray ray;
  uint64_t neuron[SF_LAYERS][SF_T_MAX][SF_LANES]; /* spikes of each neuron over `sampled` samples */
  uint64_t sampled;
} sf_page;

/* A pixel needs the fewest steps whose error (RMS over R, G, B, against the picture) is within this of its best. */
#define SF_PAGE_NEED (4.0 / 255)

/* Renders what the page shows. SF_E_DIFFERENCE where the counts of the pictured view are not the audit's. */
sf_status sf_page_gather(sf_page *page);
void sf_page_free(sf_page *page);
/* The report's JSON with the page's own numbers below "page". */
cJSON *sf_page_json(const sf_page *page);
sf_status sf_page_save(const sf_page *page, const char *path);
#endif
