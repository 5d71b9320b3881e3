/* Held-out quality of the float model. */
#include "train/train.h"
#include <math.h>
#include <stdlib.h>

static const double PSNR_MOST = 99;

/* A view's rays and picture over white, and room for pictures of it; all in one piece of memory. */
typedef struct shot {
  size_t pixels;
  float *origin, *direction, *truth, *rgb; /* [pixels][3] */
} shot;

static const float white[3] = {1, 1, 1};

static sf_status shot_create(shot *s, const sf_dataset *data, const sf_view *view, int pictures)
{
  const sf_image *im = &view->image;
  const size_t n = (size_t)im->width * im->height;
  float *memory = malloc((9 + 3 * (size_t)pictures) * n * sizeof *memory);
  if (!memory) return sf_fail(SF_E_MEMORY, "evaluate: no memory for view '%s'", view->name);
  *s = (shot){n, memory, memory + 3 * n, memory + 6 * n, memory + 9 * n};
  for (size_t i = 0; i < n; i++) {
    sf_dataset_ray(data, view, (float)(i % im->width) + 0.5f, (float)(i / im->width) + 0.5f, s->origin + 3 * i,
                   s->direction + 3 * i);
    const float alpha = im->rgba[4 * i + 3] / 65535.0f;
    for (int c = 0; c < 3; c++) s->truth[3 * i + c] = im->rgba[4 * i + c] / 65535.0f * alpha + 1 - alpha;
  }
  return sf_ok();
}

static double psnr_of(const shot *s, float *rgb)
{
  for (size_t i = 0; i < 3 * s->pixels; i++) rgb[i] = rgb[i] < 0 ? 0 : rgb[i] > 1 ? 1 : rgb[i];
  return fmin(sf_psnr(rgb, s->truth, 3 * s->pixels), PSNR_MOST);
}

static sf_status evaluate_view(const sf_model *model, const sf_dataset *data, const sf_view *view, int steps,
                               double *psnr, double *ssim, sf_ray_events *events)
{
  const sf_image *im = &view->image;
  shot s;
  SF_TRY(shot_create(&s, data, view, 1));
  const sf_status status =
      sf_render_counted(model, s.origin, s.direction, s.pixels, steps, white, s.rgb, NULL, NULL, NULL, events);
  if (!status.code) {
    *psnr = psnr_of(&s, s.rgb);
    *ssim = im->width >= 11 && im->height >= 11 ? sf_ssim(s.rgb, s.truth, im->width, im->height, 3) : NAN;
  }
  free(s.origin);
  return status;
}

/* Adds the view's PSNR after each step. */
static sf_status evaluate_steps(const sf_model *model, const sf_dataset *data, const sf_view *view, double *psnr)
{
  const int steps = model->config.steps;
  shot s;
  SF_TRY(shot_create(&s, data, view, steps));
  const sf_status status = sf_render_prefixes(model, s.origin, s.direction, s.pixels, white, s.rgb);
  for (int t = 0; !status.code && t < steps; t++) psnr[t] += psnr_of(&s, s.rgb + 3 * s.pixels * (size_t)t);
  free(s.origin);
  return status;
}

static sf_status no_picture(const sf_dataset *data)
{
  return sf_fail(SF_E_FORMAT, "%s: no view with a picture to evaluate on", data->path);
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
  if (!used) return no_picture(data);
  *psnr /= used;
  *ssim = compared ? *ssim / compared : NAN;
  return sf_ok();
}

sf_status sf_evaluate_prefixes(const sf_model *model, const sf_dataset *data, int views, double *psnr)
{
  int used = 0;
  for (int t = 0; t < model->config.steps; t++) psnr[t] = 0;
  for (int v = 0; v < data->count && (views == 0 || used < views); v++) {
    if (!data->view[v].image.rgba) continue;
    SF_TRY(evaluate_steps(model, data, &data->view[v], psnr));
    used++;
  }
  if (!used) return no_picture(data);
  for (int t = 0; t < model->config.steps; t++) psnr[t] /= used;
  return sf_ok();
}
