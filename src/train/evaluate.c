/* Held-out quality of the float model. */
#include "train/train.h"
#include <math.h>
#include <stdlib.h>

static const double PSNR_MOST = 99;

static sf_status evaluate_view(const sf_model *model, const sf_dataset *data, const sf_view *view, int steps,
                               double *psnr, double *ssim, sf_ray_events *events)
{
  const sf_image *im = &view->image;
  const size_t n = (size_t)im->width * im->height;
  float *memory = malloc(12 * n * sizeof *memory);
  if (!memory) return sf_fail(SF_E_MEMORY, "evaluate: no memory for view '%s'", view->name);
  float *origin = memory, *direction = memory + 3 * n, *rgb = memory + 6 * n, *truth = memory + 9 * n;
  const float white[3] = {1, 1, 1};
  for (size_t i = 0; i < n; i++) {
    sf_dataset_ray(data, view, (float)(i % im->width) + 0.5f, (float)(i / im->width) + 0.5f, origin + 3 * i,
                   direction + 3 * i);
    const float alpha = im->rgba[4 * i + 3] / 65535.0f;
    for (int c = 0; c < 3; c++) truth[3 * i + c] = im->rgba[4 * i + c] / 65535.0f * alpha + 1 - alpha;
  }
  sf_status status = sf_render_counted(model, origin, direction, n, steps, white, rgb, NULL, NULL, NULL, events);
  if (!status.code) {
    for (size_t i = 0; i < 3 * n; i++) rgb[i] = rgb[i] < 0 ? 0 : rgb[i] > 1 ? 1 : rgb[i];
    *psnr = fmin(sf_psnr(rgb, truth, 3 * n), PSNR_MOST);
    *ssim = im->width >= 11 && im->height >= 11 ? sf_ssim(rgb, truth, im->width, im->height, 3) : NAN;
  }
  free(memory);
  return status;
}

sf_status sf_evaluate(const sf_model *model, const sf_dataset *data, int views, int steps, double *psnr, double *ssim)
{
  sf_ray_events events = {0};
  return sf_evaluate_counted(model, data, views, steps, psnr, ssim, &events);
}

sf_status sf_evaluate_counted(const sf_model *model, const sf_dataset *data, int views, int steps, double *psnr,
                              double *ssim, sf_ray_events *events)
{
  int used = 0, compared = 0;
  *psnr = *ssim = 0;
  for (int v = 0; v < data->count && (views == 0 || used < views); v++) {
    if (!data->view[v].image.rgba) continue;
    double p = 0, s = 0;
    SF_TRY(evaluate_view(model, data, &data->view[v], steps, &p, &s, events));
    *psnr += p;
    if (!isnan(s)) *ssim += s, compared++;
    used++;
  }
  if (!used) return sf_fail(SF_E_FORMAT, "%s: no view with a picture to evaluate on", data->path);
  *psnr /= used;
  *ssim = compared ? *ssim / compared : NAN;
  return sf_ok();
}

sf_status sf_evaluate_prefixes(const sf_model *model, const sf_dataset *data, int views, double *psnr)
{
  double ssim;
  for (int steps = 1; steps <= model->config.steps; steps++)
    SF_TRY(sf_evaluate(model, data, views, steps, &psnr[steps - 1], &ssim));
  return sf_ok();
}
