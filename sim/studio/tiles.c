#include "sim/studio/studio.h"

uint64_t sf_tile_number(int across, int down)
{
  return (uint64_t)(down / FX_TILE) << 32 | (uint64_t)(across / FX_TILE);
}

/* Pixels from `at` to the beginning of the view's next tile. */
static int tile_end(int origin, int at, int end)
{
  const int next = at + FX_TILE - (origin + at) % FX_TILE;
  return next < end ? next : end;
}

sf_status sf_each_tile(const sf_golden_job *job, sf_tile_fn work, void *user, sf_golden *golden)
{
  const sf_window *w = &job->window;
  for (int top = 0, below; top < w->height; top = below) {
    below = tile_end(w->y, top, w->height);
    for (int left = 0, beside; left < w->width; left = beside) {
      beside = tile_end(w->x, left, w->width);
      const sf_window tile = {left, top, beside - left, below - top};
      SF_TRY(work(job, &tile, user, golden));
    }
  }
  return sf_ok();
}
