#include "src/fx/scene.h"
#include <stdlib.h>
#include <string.h>
#include "src/fx/nofloat.h"

enum { ALIGN = 64 };

size_t fx_occupancy_bytes(const fx_scene *scene)
{
  const size_t res = (size_t)scene->occ_res;
  return res * res * res / 8;
}

static size_t aligned(size_t size)
{
  return (size + ALIGN - 1) / ALIGN * ALIGN;
}

/* One block for everything: sizes are bounded by fx_check_sizes, so the sum cannot overflow. */
sf_status fx_scene_allocate(fx_scene *scene, const char *path)
{
  SF_TRY(fx_check_sizes(scene, path));
  const size_t table = aligned((size_t)scene->grid.entries * FX_GRID_FEATURES),
               bits = aligned(fx_occupancy_bytes(scene));
  size_t size = table + bits;
  for (int id = 0; id < SF_LAYERS; id++) size += (size_t)fx_layer_rows(&scene->net.layer[id]) * SF_LANES;
  int8_t *block = aligned_alloc(ALIGN, aligned(size));
  if (!block) return sf_fail(SF_E_MEMORY, "%s: no memory for %zu bytes", path, size);
  memset(block, 0, aligned(size));
  scene->owner = block;
  scene->grid.table = block;
  scene->occupancy = (uint8_t *)(block + table);
  int8_t *w = block + table + bits;
  for (int id = 0; id < SF_LAYERS; id++) {
    scene->net.layer[id].w = w;
    w += (size_t)fx_layer_rows(&scene->net.layer[id]) * SF_LANES;
  }
  return sf_ok();
}

void fx_scene_free(fx_scene *scene)
{
  free(scene->owner);
  memset(scene, 0, sizeof *scene);
}
