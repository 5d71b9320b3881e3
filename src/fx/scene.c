#include "src/fx/arrays.h"
#include "src/fx/check.h"
#include "src/fx/scene.h"
#include "src/fx/march.h"
#include <stdlib.h>
#include <string.h>
#include "src/fx/nofloat.h"

enum { ALIGN = 64 };

size_t fx_occupancy_bytes(const fx_scene *scene)
{
  const size_t res = (size_t)scene->occ_res;
  return (size_t)(scene->log2_bound + 1) * (res * res * res / 8);
}

static size_t aligned(size_t size)
{
  return (size + ALIGN - 1) / ALIGN * ALIGN;
}

/* Lays everything out from `at` on and returns the bytes; NULL: only counts. */
static size_t lay_out(fx_scene *scene, int8_t *at)
{
  fx_array list[FX_TENSORF_ARRAYS];
  const int arrays = scene->backbone == FX_TENSORF ? fx_tensorf_arrays(&scene->tensorf, list) : 0;
  const size_t table = aligned((size_t)scene->grid.entries * FX_GRID_FEATURES);
  size_t size = table;
  if (at && !arrays) scene->grid.table = at;
  for (int i = 0; i < arrays; i++) {
    if (at) *list[i].data = at + size;
    size += aligned(fx_array_bytes(&list[i]));
  }
  if (at) scene->occupancy = (uint8_t *)(at + size);
  size += aligned(fx_occupancy_bytes(scene));
  if (at) scene->steps = scene->gamma_q24 ? (fx_steps *)(at + size) : NULL;
  size += scene->gamma_q24 ? aligned(sizeof(fx_steps)) : 0;
  for (int id = 0; id < SF_LAYERS; id++) {
    if (at) scene->net.layer[id].w = at + size;
    size += (size_t)fx_layer_rows(&scene->net.layer[id]) * SF_LANES;
  }
  return aligned(size);
}

/* One block for everything: sizes are bounded by fx_check_sizes, so the sum cannot overflow. */
sf_status fx_scene_allocate(fx_scene *scene, const char *path)
{
  SF_TRY(fx_check_sizes(scene, path));
  const size_t size = lay_out(scene, NULL);
  int8_t *block = aligned_alloc(ALIGN, size);
  if (!block) return sf_fail(SF_E_MEMORY, "%s: no memory for %zu bytes", path, size);
  memset(block, 0, size);
  scene->owner = block;
  lay_out(scene, block);
  if (scene->steps) fx_steps_fill(scene, scene->steps);
  return sf_ok();
}

void fx_scene_free(fx_scene *scene)
{
  free(scene->owner);
  memset(scene, 0, sizeof *scene);
}
