/* What the page shows beyond the audit: the view at every number of steps, the spikes of one ray, the rates of the
 * neurons. */
#include "page/page.h"
#include "base/sha256.h"
#include "bounds/bounds.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SAMPLED = 60000 }; /* samples whose neurons are looked at one by one, about */

static size_t pixels(const sf_page *page)
{
  return (size_t)page->view->camera.width * (size_t)page->view->camera.height;
}

static sf_golden_job job_of(const sf_page *page, const fx_scene *scene)
{
  const sf_camera *camera = &page->view->camera;
  return (sf_golden_job){
      .scene = scene, .data = page->data, .view = page->view, .window = {0, 0, camera->width, camera->height}};
}

static void background_of(const fx_scene *scene, float background[3])
{
  for (int c = 0; c < 3; c++) background[c] = (float)scene->background[c] / 65536;
}

static bool go_on(const sf_page *page, int done)
{
  return !page->tick || page->tick(page->user, done, SF_T_MAX + 2);
}

/* ---- the view at t = 1..T ---- */

static double pixel_error(const sf_golden *golden, const sf_image *picture, const float background[3], size_t i)
{
  const uint16_t *p = picture->rgba + 4 * i;
  const float alpha = (float)p[3] / 65535;
  double sum = 0;
  for (int c = 0; c < 3; c++) {
    const float truth = (float)p[c] / 65535 * alpha + background[c] * (1 - alpha);
    const double difference = (double)(sf_golden_real(golden, SF_PLANE_R + c)[i] - truth);
    sum += difference * difference;
  }
  return sqrt(sum / 3);
}

static sf_status render_prefix(sf_page *page, int t, float *error, sf_golden *golden)
{
  fx_scene scene = *page->scene; /* shares weights and tables; only the number of steps differs */
  sf_page_prefix *prefix = &page->prefix[t];
  float background[3];
  scene.net.steps = t + 1;
  const sf_golden_job job = job_of(page, &scene);
  SF_TRY(sf_golden_fixed(&job, golden));
  *prefix = (sf_page_prefix){.psnr = NAN, .ssim = NAN, .fj = sf_energy_fj(&golden->counts)};
  if (!page->view->image.rgba) return sf_ok();
  background_of(&scene, background);
  for (size_t i = 0; i < pixels(page); i++) error[i] = (float)pixel_error(golden, &page->view->image, background, i);
  return sf_golden_quality(golden, &page->view->image, 0, 0, background, &prefix->psnr, &prefix->ssim);
}

static void find_needed_steps(sf_page *page, const float *error)
{
  const size_t n = pixels(page);
  for (size_t i = 0; i < n; i++) {
    float best = error[i];
    int t = 0;
    for (int s = 1; s < SF_T_MAX; s++) best = error[s * n + i] < best ? error[s * n + i] : best;
    while ((double)error[(size_t)t * n + i] > (double)best + SF_PAGE_NEED) t++;
    page->steps[i] = sf_golden_int(&page->golden, SF_PLANE_SAMPLES)[i] ? (uint8_t)(t + 1) : 0;
  }
}

static sf_status render_prefixes(sf_page *page, float *error)
{
  const sf_camera *camera = &page->view->camera;
  for (int t = 0; t < SF_T_MAX; t++) {
    sf_golden golden;
    if (!go_on(page, t)) return sf_fail(SF_E_STOPPED, "stopped at the pictures of the report");
    SF_TRY(sf_golden_create(&golden, camera->width, camera->height, SF_PLANES));
    const sf_status status = render_prefix(page, t, error + (size_t)t * pixels(page), &golden);
    if (status.code == SF_OK && t + 1 == page->scene->net.steps)
      page->golden = golden;
    else
      sf_golden_free(&golden);
    SF_TRY(status);
  }
  return sf_ok();
}

static sf_status gather_pictures(sf_page *page)
{
  float *error = malloc(pixels(page) * SF_T_MAX * sizeof *error);
  if (!error) return sf_fail(SF_E_MEMORY, "no memory for %zu pixels", pixels(page));
  sf_status status = render_prefixes(page, error);
  if (status.code == SF_OK && page->view->image.rgba) {
    page->steps = malloc(pixels(page));
    if (page->steps)
      find_needed_steps(page, error);
    else
      status = sf_fail(SF_E_MEMORY, "no memory for %zu pixels", pixels(page));
  }
  free(error);
  SF_TRY(status);
  if (!page->whole) return sf_ok();
  return sf_counts_compare(&page->golden.counts, "picture", &page->report->measure.core, "audit");
}

/* Another training of the same sizes would show its own PSNR. */
static sf_status check_model(const sf_page *page, const sf_model *model)
{
  if (page->scene->net.steps > model->config.steps || page->data->scale != model->config.scale)
    return sf_fail(SF_E_RANGE, "%s: not the model of this scene (T %d, scale %g)", page->model, model->config.steps,
                   (double)model->config.scale);
  const int other = sf_other_weights(model, page->scene);
  return other < 0 ? sf_ok()
                   : sf_fail(SF_E_RANGE, "%s: not the model of this scene (other weights in layer %s)", page->model,
                             fx_layer_name(other));
}

static sf_status float_quality(sf_page *page, const sf_model *model)
{
  float background[3];
  double ssim;
  sf_golden golden;
  const sf_golden_job job = job_of(page, page->scene);
  background_of(page->scene, background);
  SF_TRY(sf_golden_create(&golden, page->golden.width, page->golden.height, SF_FLOAT_PLANES));
  sf_status status = sf_golden_float(&job, model, &golden);
  if (status.code == SF_OK)
    status = sf_golden_quality(&golden, &page->view->image, 0, 0, background, &page->psnr_float, &ssim);
  sf_golden_free(&golden);
  return status;
}

static sf_status gather_float(sf_page *page)
{
  sf_model model;
  page->psnr_float = NAN;
  if (!page->model) return sf_ok();
  SF_TRY(sf_model_load(&model, page->model));
  sf_status status = check_model(page, &model);
  if (!status.code) {
    page->trained_steps = model.config.steps;
    status = sf_sha256_file(page->model, page->model_sha256);
    if (status.code == SF_OK && page->view->image.rgba) status = float_quality(page, &model);
  } else if (page->model_optional) {
    status = sf_ok();
  }
  sf_model_free(&model);
  return status;
}

/* ---- spikes ---- */

/* Of the hit pixels with the median number of samples, the one nearest to the centre; -1 without samples. */
static ptrdiff_t choose_ray(const sf_page *page)
{
  const uint32_t *samples = sf_golden_int(&page->golden, SF_PLANE_SAMPLES);
  const int width = page->golden.width, height = page->golden.height;
  const size_t n = pixels(page);
  size_t hits = 0, below = 0, of[1025] = {0};
  for (size_t i = 0; i < n; i++) {
    if (samples[i] == 0) continue;
    hits++, of[samples[i] < 1024 ? samples[i] : 1024]++;
  }
  uint32_t median = 0;
  while (median < 1024 && below + of[median] <= hits / 2) below += of[median++];
  ptrdiff_t chosen = -1;
  double nearest = INFINITY;
  for (size_t i = 0; i < n && hits > 0; i++) {
    const double x = (double)(i % (size_t)width) - width / 2.0, y = (double)(i / (size_t)width) - height / 2.0;
    if (samples[i] < median || samples[i] > median || x * x + y * y >= nearest) continue;
    nearest = x * x + y * y, chosen = (ptrdiff_t)i;
  }
  return chosen;
}

typedef struct watch {
  sf_observer observer;
  fx_trace trace;
  sf_page_ray *ray; /* or NULL */
  uint64_t neuron[SF_LAYERS][SF_T_MAX][SF_LANES], samples;
} watch;

static sf_status watch_sample(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  watch *w = user;
  SF_TRY(sf_observer_net(&w->observer, ray, first, f, out));
  const int steps = w->observer.net->steps;
  w->samples++;
  for (int l = 0; l < SF_LAYERS; l++)
    for (int t = 0; t < steps; t++)
      for (int word = 0; word < SF_SPIKE_WORDS; word++)
        for (uint64_t bits = w->trace.spikes[l][t][word]; bits; bits &= bits - 1)
          w->neuron[l][t][64 * word + __builtin_ctzll(bits)]++;
  if (!w->ray) return sf_ok();
  if ((w->ray->samples + 1) * steps <= SF_PAGE_COLUMNS)
    memcpy(w->ray->spikes[w->ray->samples++], w->trace.spikes, sizeof w->trace.spikes);
  w->ray->all++;
  return sf_ok();
}

static sf_status watch_pixel(const sf_page *page, size_t i, watch *w)
{
  const size_t width = (size_t)page->golden.width;
  fx_ray ray;
  fx_pixel pixel;
  SF_TRY(sf_pixel_ray(page->scene, page->data, page->view, (int)(i % width), (int)(i / width), &ray));
  sf_observer_begin(&w->observer);
  return fx_render_ray(page->scene, &ray, watch_sample, w, &pixel, &w->observer.core);
}

static sf_status watch_rows(sf_page *page, size_t stride, sf_status *failed)
{
#pragma omp parallel
  {
    watch *w = calloc(1, sizeof *w);
    sf_status status = w ? sf_ok() : sf_fail(SF_E_MEMORY, "no memory for the spikes");
    if (w) w->observer.net = &page->scene->net, w->observer.trace = &w->trace;
#pragma omp for schedule(dynamic, 256)
    for (size_t i = 0; i < pixels(page); i++)
      if (i % stride == stride / 2 && status.code == SF_OK) status = watch_pixel(page, i, w);
#pragma omp critical(sf_page_watch)
    {
      if (status.code != SF_OK) *failed = status;
      uint64_t *to = &page->neuron[0][0][0];
      for (size_t i = 0; w && i < sizeof w->neuron / sizeof(uint64_t); i++) to[i] += (&w->neuron[0][0][0])[i];
      page->sampled += w ? w->samples : 0;
    }
    free(w);
  }
  return *failed;
}

static sf_status gather_spikes(sf_page *page)
{
  const ptrdiff_t chosen = choose_ray(page);
  sf_status failed = sf_ok();
  if (chosen < 0) return sf_ok();
  SF_TRY(watch_rows(page, (size_t)(page->golden.counts.samples / SAMPLED) + 1, &failed));
  watch *w = calloc(1, sizeof *w);
  if (!w) return sf_fail(SF_E_MEMORY, "no memory for the spikes of a ray");
  w->observer.net = &page->scene->net, w->observer.trace = &w->trace, w->ray = &page->ray;
  page->ray.x = (int)(chosen % page->golden.width), page->ray.y = (int)(chosen / page->golden.width);
  const sf_status status = watch_pixel(page, (size_t)chosen, w);
  free(w);
  return status;
}

sf_status sf_page_gather(sf_page *page)
{
  SF_TRY(gather_pictures(page));
  if (!go_on(page, SF_T_MAX)) return sf_fail(SF_E_STOPPED, "stopped at the float picture of the report");
  SF_TRY(gather_float(page));
  if (!go_on(page, SF_T_MAX + 1)) return sf_fail(SF_E_STOPPED, "stopped at the spikes of the report");
  return gather_spikes(page);
}

void sf_page_free(sf_page *page)
{
  sf_golden_free(&page->golden);
  free(page->steps);
  page->steps = NULL;
}
