/* Inside src/fx: pieces shared by check.c, scene.c, file.c. */
#ifndef SPIKEFIELD_FX_SCENE_H
#define SPIKEFIELD_FX_SCENE_H
#include "spikefield/fx.h"

enum { FX_DIMENSION_MAX = 3 };
extern const char *const fx_layer_tensor[SF_LAYERS]; /* tensor names, also used in messages */

/* Sizes alone: everything that memory is allocated and indexed by. */
sf_status fx_check_sizes(const fx_scene *scene, const char *path);
uint64_t fx_grid_bytes(const fx_grid *grid); /* read for one sample */
size_t fx_occupancy_bytes(const fx_scene *scene);

/* Real-valued metadata as text (C hexadecimal notation: exact). Declared here so that the firmware, which has no
 * cJSON, can share the rest. */
typedef struct cJSON cJSON;
void fx_reals_write(cJSON *metadata, const fx_scene *scene);
sf_status fx_reals_read(const cJSON *metadata, fx_scene *scene, const char *path);
sf_status fx_reals_check(const fx_scene *scene, const char *path);
#endif
