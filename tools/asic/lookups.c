/* What the field's cache is asked for on a scene: lookups SCENE.snn DATA N writes the first N pairs of entries (those
 * of corners x and x + 1) of a tile of 16 x 16 pixels in the middle of view 0, then of the tiles behind it. A line of
 * text is `EMPTY ENTRY ENTRY`; EMPTY is 1 for the first pair of a tile. Order: pixels of a tile, samples of a ray,
 * levels, corners. */
#include "fx/fx.h"
#include "quant/quant.h"
#include "scene/scene.h"
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

enum { TILE = 16, PAIRS = 4, CELL_FRAC = 8 };

typedef struct job {
  fx_scene scene;
  sf_dataset data;
  long left;  /* pairs */
  bool empty; /* before the next pair */
} job;

/* Entry of the grid point (x, y, z) of a level, counted over all levels. */
static uint32_t entry_of(const fx_grid *grid, int level, uint32_t x, uint32_t y, uint32_t z)
{
  const uint32_t stride = (uint32_t)grid->stride[level];
  const uint32_t at = stride ? x + stride * (y + stride * z)
                             : (x ^ y * 2654435761u ^ z * 805459861u) & ((1u << grid->log2_size[level]) - 1);
  return (uint32_t)grid->offset[level] + at;
}

static void put_sample(job *j, const uint32_t pos[3])
{
  const fx_grid *grid = &j->scene.grid;
  for (int level = 0; level < grid->levels; level++) {
    uint32_t base[3];
    for (int axis = 0; axis < 3; axis++) {
      const int64_t product = (int64_t)pos[axis] * grid->scale_q16[level];
      const int shift = SF_POS_FRAC + 16 - CELL_FRAC;
      const int64_t p = ((product + ((int64_t)1 << (shift - 1))) >> shift) + (1 << (CELL_FRAC - 1));
      base[axis] = (uint32_t)(p >> CELL_FRAC);
    }
    for (uint32_t corner = 0; corner < PAIRS && j->left > 0; corner++, j->left--) {
      const uint32_t y = base[1] + (corner & 1), z = base[2] + (corner >> 1);
      printf("%d %08" PRIx32 " %08" PRIx32 "\n", j->empty, entry_of(grid, level, base[0], y, z),
             entry_of(grid, level, base[0] + 1, y, z));
      j->empty = false;
    }
  }
}

static sf_status put_pixel(job *j, int x, int y)
{
  float origin[3], direction[3];
  fx_ray ray;
  fx_pixel pixel;
  uint32_t pos[3];
  sf_dataset_ray(&j->data, &j->data.view[0], (float)x + 0.5f, (float)y + 0.5f, origin, direction);
  SF_TRY(sf_fx_ray_make(&j->scene, origin, direction, &ray));
  fx_counts counts = {0};
  SF_TRY(fx_render_ray(&j->scene, &ray, NULL, NULL, &pixel, &counts));
  int32_t n = 0;
  for (uint64_t left = counts.samples; left > 0 && j->left > 0; left--, n++) {
    n = fx_march_next(&j->scene, &ray, n, pos, &counts);
    if (n < 0) break;
    put_sample(j, pos);
  }
  return sf_ok();
}

static sf_status put_tiles(job *j)
{
  const sf_camera *camera = &j->data.view[0].camera;
  const int across = camera->width / TILE, tiles = across * (camera->height / TILE);
  const int middle = camera->height / TILE / 2 * across + across / 2;
  if (tiles == 0) return sf_fail(SF_E_USAGE, "the view is smaller than a tile of %d x %d pixels", TILE, TILE);
  for (int t = 0; t < tiles && j->left > 0; t++) {
    const int tile = (middle + t) % tiles, x = tile % across * TILE, y = tile / across * TILE;
    j->empty = true;
    for (int i = 0; i < TILE * TILE && j->left > 0; i++) SF_TRY(put_pixel(j, x + i % TILE, y + i / TILE));
  }
  return sf_ok();
}

static sf_status run(job *j, const char *scene, const char *data)
{
  const sf_dataset_options how = {.limit = 1};
  SF_TRY(fx_scene_load(&j->scene, scene));
  if (j->scene.backbone != FX_INGP)
    return sf_fail(SF_E_UNSUPPORTED, "%s: a scene without a hash grid: planes have other look-ups", scene);
  SF_TRY(sf_fx_dataset_load(&j->data, &j->scene, scene, data, "test", &how));
  if (j->data.count == 0) return sf_fail(SF_E_USAGE, "%s: no test view", data);
  SF_TRY(put_tiles(j));
  return fflush(stdout) ? sf_fail(SF_E_IO, "standard output: not written") : sf_ok();
}

int main(int argc, char **argv)
{
  job j = {.left = argc == 4 ? strtol(argv[3], NULL, 10) : 0};
  if (j.left < 1) {
    fprintf(stderr, "usage: lookups SCENE.snn DATA N\n");
    return 2;
  }
  const sf_status status = run(&j, argv[1], argv[2]);
  if (status.code != SF_OK) fprintf(stderr, "lookups: %s\n", status.message);
  sf_dataset_free(&j.data);
  fx_scene_free(&j.scene);
  return status.code != SF_OK;
}
