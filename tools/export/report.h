/* What sf_export says of the scene that it wrote. */
#ifndef SF_TOOLS_EXPORT_REPORT_H
#define SF_TOOLS_EXPORT_REPORT_H
#include "fit/fit.h"
#include "quant/quant.h"
#include <cjson/cJSON.h>

/* fit: leaves out what was measured at the quantisation, because that is of the scene before it was cut down. bytes: of
 * the file `path`. */
void export_report_print(const fx_scene *scene, const sf_quant_report *report, bool fit, const char *path,
                         long long bytes);
cJSON *export_report_json(const fx_scene *scene, const sf_quant_report *report, const sf_fit_report *fit,
                          const char *path, long long bytes);
#endif
