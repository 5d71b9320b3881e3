/* What sf_export writes beside a scene, for other tools: vectors, traces, graphs. */
#ifndef SF_TOOLS_EXPORT_EXTRAS_H
#define SF_TOOLS_EXPORT_EXTRAS_H
#include "sim/kit/kit.h"
#include "exchange/exchange.h"
#include "quant/quant.h"
#include <cjson/cJSON.h>

typedef struct export_options {
  const char *vectors, *traces, *nir; /* folders and file; NULL: not wanted */
  const char *data;                   /* for vectors and traces */
  int rays, samples, view;            /* rays 0: as many as each has by default; samples: of vectors; view: of traces */
  uint64_t seed;
} export_options;

typedef struct export_extras {
  sf_dataset data; /* the test views, without pictures */
  sf_kit_report kit;
  sf_traces_report traces;
} export_extras;

/* Reads all inputs, so that a fault in one is known before anything is written. scene_path: for messages and the
 * vectors' record. Close it even after a failure. */
sf_status export_extras_open(export_extras *extras, const fx_scene *scene, const char *scene_path,
                             const export_options *options);
void export_extras_close(export_extras *extras);
sf_status export_extras_write(export_extras *extras, const fx_scene *scene, const char *scene_path,
                              const export_options *options);
void export_extras_print(const export_extras *extras, const export_options *options);
void export_extras_json(cJSON *json, const export_extras *extras, const export_options *options);
#endif
