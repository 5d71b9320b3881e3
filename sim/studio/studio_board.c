#include "sim/board/batch.h"
#include "sim/lockstep.h"
#include "sim/studio/studio.h"
#include <stdlib.h>

_Static_assert((int)SF_BATCH_RAYS >= FX_TILE * FX_TILE, "a tile is a batch");

static sf_status add_pixel(const sf_golden_job *job, sf_batch *batch, int x, int y)
{
  fx_ray ray;
  const int across = job->window.x + x, down = job->window.y + y;
  SF_TRY(sf_pixel_ray(job->scene, job->data, job->view, across, down, &ray));
  return sf_batch_add(batch, &ray, sf_tile_number(across, down));
}

static void set_pixel(const sf_golden_job *job, const sf_batch_ray *ray, int x, int y, sf_golden *golden)
{
  const fx_cost cost = sf_cost_of(&ray->counts);
  sf_golden_set(golden, (size_t)y * (size_t)job->window.width + (size_t)x, &ray->board, &cost,
                sf_golden_step_length(job));
  fx_counts_add(&golden->counts, &ray->counts);
}

/* "pixel (3, 5) of view r_0, sample 2: layer C1 step 0 mac: expected 7, actual 8, cycle 9" */
static sf_status named(const sf_golden_job *job, const sf_window *tile, const sf_batch *batch, const sf_status *status)
{
  char text[200], sample[40] = "";
  const sf_cosim_place *where = &batch->place;
  const int x = (int)where->ray % tile->width, y = (int)where->ray / tile->width;
  if (where->what.wire) sf_difference_text(&where->what, text);
  if (where->exact) snprintf(sample, sizeof sample, "sample %llu: ", (unsigned long long)where->sample);
  return sf_fail(status->code, "pixel (%d, %d) of view %s, %s%s", job->window.x + tile->x + x,
                 job->window.y + tile->y + y, job->view->name, sample, where->what.wire ? text : status->message);
}

static sf_status one_tile(const sf_golden_job *job, const sf_window *tile, void *user, sf_golden *golden)
{
  sf_batch *batch = user;
  sf_batch_begin(batch);
  for (int y = 0; y < tile->height; y++)
    for (int x = 0; x < tile->width; x++) SF_TRY(add_pixel(job, batch, tile->x + x, tile->y + y));
  const sf_status status = sf_batch_run(batch);
  if (status.code == SF_E_DIFFERENCE && batch->place.found) return named(job, tile, batch, &status);
  SF_TRY(status);
  for (int i = 0; i < batch->count; i++)
    set_pixel(job, &batch->ray[i], tile->x + i % tile->width, tile->y + i / tile->width, golden);
  return job->tick && !job->tick(job->user, (size_t)batch->count) ? sf_golden_stopped(job) : sf_ok();
}

sf_status sf_golden_board(const sf_golden_job *job, sf_board *board, sf_golden *golden)
{
  sf_batch *batch = calloc(1, sizeof *batch);
  if (!batch) return sf_fail(SF_E_MEMORY, "picture from the board: out of memory");
  sf_status status = sf_batch_open(batch, board);
  if (status.code == SF_OK) status = sf_each_tile(job, one_tile, batch, golden);
  sf_batch_close(batch);
  free(batch);
  return status;
}
