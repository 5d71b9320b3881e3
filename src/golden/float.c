/* A window of a view through the float field. */
#include "golden/golden.h"
#include <stdlib.h>

enum {
  BATCH = 4096,
  FLOATS_PER_RAY = 12
}; /* rays in one call of the renderer; origin, direction, rgb, three scalars */

static sf_status render_rows(const sf_golden_job *job, const sf_model *model, int y, int rows, float *space,
                             sf_golden *golden)
{
  size_t width = (size_t)job->window.width, n = width * (size_t)rows, first = width * (size_t)y;
  float *origin = space, *direction = origin + 3 * n, *rgb = direction + 3 * n, *depth = rgb + 3 * n,
        *alpha = depth + n, *samples = alpha + n, background[3];
  for (int c = 0; c < 3; c++) background[c] = (float)job->scene->background[c] / 65536;
  for (size_t i = 0; i < n; i++) {
    float px = (float)(job->window.x + (int)(i % width)) + 0.5f;
    float py = (float)(job->window.y + y + (int)(i / width)) + 0.5f;
    sf_dataset_ray(job->data, job->view, px, py, origin + 3 * i, direction + 3 * i);
  }
  SF_TRY(sf_render_rays(model, origin, direction, n, job->scene->net.steps, background, rgb, depth, alpha, samples));
  for (size_t i = 0; i < n; i++) {
    for (int c = 0; c < 3; c++) sf_golden_real(golden, SF_PLANE_R + c)[first + i] = rgb[3 * i + (size_t)c];
    sf_golden_real(golden, SF_PLANE_A)[first + i] = alpha[i];
    sf_golden_real(golden, SF_PLANE_Z)[first + i] = alpha[i] > 0 ? depth[i] / alpha[i] / job->data->scale : 0;
    sf_golden_int(golden, SF_PLANE_SAMPLES)[first + i] = (uint32_t)samples[i];
    golden->counts.samples += (uint64_t)samples[i];
    golden->counts.rays += samples[i] > 0;
  }
  return sf_ok();
}

sf_status sf_golden_float(const sf_golden_job *job, const sf_model *model, sf_golden *golden)
{
  const sf_window *w = &job->window;
  int rows = w->width >= BATCH ? 1 : BATCH / w->width;
  if (rows > w->height) rows = w->height;
  float *space = malloc((size_t)rows * (size_t)w->width * FLOATS_PER_RAY * sizeof *space);
  if (!space) return sf_fail(SF_E_MEMORY, "no memory for a batch of %d rows", rows);
  sf_status status = sf_ok();
  for (int y = 0; y < w->height && status.code == SF_OK; y += rows) {
    int n = w->height - y < rows ? w->height - y : rows;
    status = render_rows(job, model, y, n, space, golden);
    if (status.code == SF_OK && job->tick && !job->tick(job->user, (size_t)n * (size_t)w->width))
      status = sf_golden_stopped(job);
  }
  free(space);
  return status;
}
