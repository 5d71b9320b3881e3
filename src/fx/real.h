/* Inside src/fx: a scene's real-valued metadata. */
#ifndef SF_FX_REAL_H
#define SF_FX_REAL_H
#include "fx/fx.h"

/* Real-valued metadata as text (C hexadecimal notation: exact). Declared here so that the firmware, which has no
 * cJSON, can share the rest. */
typedef struct cJSON cJSON;
void fx_reals_write(cJSON *metadata, const fx_scene *scene);
sf_status fx_reals_read(const cJSON *metadata, fx_scene *scene, const char *path);
sf_status fx_reals_check(const fx_scene *scene, const char *path);
#endif
