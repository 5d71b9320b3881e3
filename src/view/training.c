#include "view/training.h"
#include "page/draw.h"
#include "base/clock.h"
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

enum { POINTS = 400, SIDE = 100, SLICE = 1024 };
typedef enum { LOSS, PSNR, HELD_OUT, T_STAR, FIRING_D1, FIRING_C1, FIRING_C2, QUIET, CURVES } curve;
static const double WATCHED = 5; /* seconds after its last question that a page counts as open */

/* Pixels of a view, every so many. */
typedef struct preview {
  int width, height, stride;
  float *rgb, *truth;     /* [height][width][3]; truth NULL: no picture */
  uint8_t *shown, *whole; /* 8 bits; shown: made new, whole: the last one */
  int number;             /* of whole ones */
  double psnr;            /* of the last one; NaN: none */
  double spent, last;     /* seconds that all of them took, and the last one */
  double since, before;   /* since when a page has been open, 0: it is not; spent before */
} preview;

struct sf_view_training {
  sf_view_server *server;
  const sf_dataset *held_out;
  preview preview;
  pthread_mutex_t lock; /* of what follows, and of preview.whole */
  sf_train_stats stats;
  int count;           /* points */
  int64_t every;       /* iterations from point to point */
  double mean[CURVES]; /* smoothed */
  double x[POINTS], y[CURVES][POINTS];
};

/* ---- curves ---- */

static void smooth(double *mean, double value)
{
  if (isfinite(value)) *mean = isfinite(*mean) ? 0.9 * *mean + 0.1 * value : value;
}

/* Twice as far from point to point, so that a run of any length fits. */
static void thin_out(sf_view_training *t)
{
  for (int i = 0; i < POINTS / 2; i++) {
    t->x[i] = t->x[2 * i + 1];
    for (int c = 0; c < CURVES; c++) t->y[c][i] = t->y[c][2 * i + 1];
  }
  t->count = POINTS / 2, t->every *= 2;
}

static void add_point(sf_view_training *t, const sf_train_stats *s)
{
  smooth(&t->mean[LOSS], s->loss);
  smooth(&t->mean[PSNR], s->mse > 0 ? -10 * log10(s->mse) : (double)NAN);
  for (int l = 0; l < 3; l++) smooth(&t->mean[FIRING_D1 + l], 100 * s->firing[l]);
  t->mean[HELD_OUT] = t->preview.psnr, t->mean[T_STAR] = s->t_star;
  t->mean[QUIET] = s->quiet[0] + s->quiet[1] + s->quiet[2];
  if (s->iteration % t->every) return;
  if (t->count == POINTS) thin_out(t);
  t->x[t->count] = (double)s->iteration;
  for (int c = 0; c < CURVES; c++) t->y[c][t->count] = t->mean[c];
  t->count++;
}

/* ---- preview ---- */

static sf_status open_preview(preview *p, const sf_view *view)
{
  const sf_camera *camera = &view->camera;
  const int longer = camera->width > camera->height ? camera->width : camera->height;
  p->stride = (longer + SIDE - 1) / SIDE;
  p->width = camera->width / p->stride, p->height = camera->height / p->stride;
  const size_t n = 3 * (size_t)p->width * (size_t)p->height;
  p->rgb = calloc(n, sizeof *p->rgb), p->shown = calloc(n, 1), p->whole = calloc(n, 1);
  if (view->image.rgba) p->truth = calloc(n, sizeof *p->truth);
  if (!p->rgb || !p->shown || !p->whole || (view->image.rgba && !p->truth))
    return sf_fail(SF_E_MEMORY, "no memory for a preview");
  for (size_t i = 0; p->truth && i < n / 3; i++) {
    const size_t x = i % (size_t)p->width * (size_t)p->stride, y = i / (size_t)p->width * (size_t)p->stride;
    const uint16_t *from = view->image.rgba + 4 * (y * (size_t)view->image.width + x);
    const float alpha = (float)from[3] / 65535;
    for (size_t c = 0; c < 3; c++) p->truth[3 * i + c] = (float)from[c] / 65535 * alpha + 1 - alpha;
  }
  return sf_ok();
}

static void end_preview(sf_view_training *t)
{
  preview *p = &t->preview;
  const size_t n = 3 * (size_t)p->width * (size_t)p->height;
  for (size_t i = 0; i < n; i++) {
    const float value = p->rgb[i];
    p->shown[i] = (uint8_t)(255 * (value > 0 ? (value < 1 ? value : 1) : 0) + 0.5f);
  }
  pthread_mutex_lock(&t->lock);
  memcpy(p->whole, p->shown, n);
  p->psnr = p->truth ? sf_psnr(p->rgb, p->truth, n) : (double)NAN;
  p->number++;
  pthread_mutex_unlock(&t->lock);
}

/* Pixels from..from + n. On white, as pictures are evaluated. */
static sf_status draw_slice(sf_view_training *t, const sf_model *model, int steps, size_t from, size_t n)
{
  static const float white[3] = {1, 1, 1};
  const preview *p = &t->preview;
  float origin[3 * SLICE], direction[3 * SLICE], depth[SLICE], alpha[SLICE], samples[SLICE];
  for (size_t i = 0; i < n; i++) {
    const size_t at = from + i;
    const float x = (float)(at % (size_t)p->width * (size_t)p->stride) + 0.5f,
                y = (float)(at / (size_t)p->width * (size_t)p->stride) + 0.5f;
    sf_dataset_ray(t->held_out, t->held_out->view, x, y, origin + 3 * i, direction + 3 * i);
  }
  return sf_render_rays(model, origin, direction, n, steps, white, p->rgb + 3 * from, depth, alpha, samples);
}

static void draw_preview(sf_view_training *t, const sf_model *model, int steps)
{
  const size_t all = (size_t)t->preview.width * (size_t)t->preview.height;
  sf_status status = sf_ok(); /* the trainer itself tells of a model that is none */
  for (size_t from = 0; from < all && status.code == SF_OK; from += SLICE)
    status = draw_slice(t, model, steps, from, all - from < SLICE ? all - from : SLICE);
  if (status.code == SF_OK) end_preview(t);
}

/* A preview as soon as one like the last fits the time that it may take. */
static void watch(sf_view_training *t, const sf_model *model, const sf_train_stats *s)
{
  preview *p = &t->preview;
  const double now = sf_seconds();
  if (sf_view_idle(t->server) > WATCHED) {
    p->since = 0;
    return;
  }
  if (p->since == 0) p->since = now, p->before = p->spent;
  if (p->spent - p->before + p->last > SF_VIEW_TRAINING_SHARE * (now - p->since)) return;
  draw_preview(t, model, s->t_r > 0 ? s->t_r : model->config.steps);
  p->last = sf_seconds() - now, p->spent += p->last;
}

void sf_view_training_step(sf_view_training *t, const sf_model *model, const sf_train_stats *s)
{
  if (!t) return;
  pthread_mutex_lock(&t->lock);
  t->stats = *s;
  add_point(t, s);
  pthread_mutex_unlock(&t->lock);
  if (t->preview.rgb) watch(t, model, s);
}

double sf_view_training_spent(const sf_view_training *t)
{
  return t->preview.spent;
}

/* ---- answers ---- */

static sf_status answer_page(void *user, const sf_view_ask *ask, sf_view_reply *reply)
{
  (void)user, (void)ask;
  return sf_view_page_make(SF_VIEW_PAGE_TRAINING, reply);
}

static char *draw_curves(const sf_view_training *t)
{
  const html_axis axis = {t->x, t->count, "iteration", -1};
  const html_row row[] = {{"Loss", "", "l0", t->y[LOSS], false, 0, 0},
                          {"PSNR of the training rays", "dB", "l1", t->y[PSNR], false, 0, 0},
                          {"PSNR of the preview", "dB", "l2", t->y[HELD_OUT], false, 0, 0},
                          {"t*", "steps", "l3", t->y[T_STAR], false, 0, SF_T_MAX},
                          {"Spikes of D1", "% of neurons and steps", "l0", t->y[FIRING_D1], false, 0, 0},
                          {"Spikes of C1", "% of neurons and steps", "l2", t->y[FIRING_C1], false, 0, 0},
                          {"Spikes of C2", "% of neurons and steps", "l3", t->y[FIRING_C2], false, 0, 0},
                          {"Neurons that never fire", "", "l4", t->y[QUIET], false, 0, 0}};
  char *text = NULL;
  size_t size;
  FILE *out = open_memstream(&text, &size);
  if (!out) return NULL;
  html_rows(out, "svg-curves", "Training, as it goes", &axis, row, sizeof row / sizeof *row);
  return fclose(out) ? free(text), NULL : text;
}

static void add_number(cJSON *json, const char *key, double value)
{
  if (isfinite(value))
    cJSON_AddNumberToObject(json, key, value);
  else
    cJSON_AddNullToObject(json, key);
}

static sf_status answer_training(void *user, const sf_view_ask *ask, sf_view_reply *reply)
{
  sf_view_training *t = user;
  (void)ask;
  pthread_mutex_lock(&t->lock);
  const sf_train_stats s = t->stats;
  cJSON *json = cJSON_CreateObject(), *quiet = cJSON_AddArrayToObject(json, "quiet");
  char *curves = draw_curves(t);
  add_number(json, "loss", t->mean[LOSS]), add_number(json, "psnr", t->mean[PSNR]);
  add_number(json, "preview_psnr", t->preview.psnr);
  cJSON_AddNumberToObject(json, "preview", t->preview.number);
  pthread_mutex_unlock(&t->lock);
  if (curves) cJSON_AddStringToObject(json, "curves", curves);
  free(curves);
  cJSON_AddNumberToObject(json, "stage", s.stage), cJSON_AddNumberToObject(json, "iteration", (double)s.iteration);
  add_number(json, "progress", s.progress), add_number(json, "t_star", s.t_star);
  cJSON_AddNumberToObject(json, "t_r", s.t_r);
  add_number(json, "eta", s.progress > 0.01 ? s.seconds * (1 - s.progress) / s.progress : (double)NAN);
  for (int l = 0; l < 3; l++) cJSON_AddItemToArray(quiet, cJSON_CreateNumber(s.quiet[l]));
  if (t->held_out->count > 0) sf_json_add_text(json, "view", t->held_out->view->name);
  return sf_view_reply_json(reply, json);
}

static sf_status answer_preview(void *user, const sf_view_ask *ask, sf_view_reply *reply)
{
  sf_view_training *t = user;
  const preview *p = &t->preview;
  (void)ask;
  if (!p->rgb) return sf_fail(SF_E_RANGE, "there is no held-out view to preview");
  pthread_mutex_lock(&t->lock);
  const sf_status status = p->number ? sf_png_encode(p->whole, p->width, p->height, NULL, 0, &reply->data, &reply->size)
                                     : sf_fail(SF_E_RANGE, "there is no preview yet");
  pthread_mutex_unlock(&t->lock);
  reply->type = "image/png";
  return status;
}

static const sf_view_route routes[] = {
    {"/", answer_page}, {"/training", answer_training}, {"/preview", answer_preview}, {NULL, NULL}};

sf_status sf_view_training_open(sf_view_training **training, int port, const sf_dataset *held_out)
{
  sf_view_training *t = *training = calloc(1, sizeof *t);
  if (!t) return sf_fail(SF_E_MEMORY, "no memory for a page");
  t->held_out = held_out, t->every = 1, t->preview.psnr = NAN;
  for (int c = 0; c < CURVES; c++) t->mean[c] = NAN;
  pthread_mutex_init(&t->lock, NULL);
  sf_status status = held_out->count > 0 ? open_preview(&t->preview, held_out->view) : sf_ok();
  if (status.code == SF_OK)
    status = sf_view_open(&t->server, &(sf_view_options){.port = port, .routes = routes, .user = t});
  if (status.code != SF_OK) sf_view_training_close(t), *training = NULL;
  return status;
}

const sf_view_server *sf_view_training_server(const sf_view_training *t)
{
  return t->server;
}

void sf_view_training_close(sf_view_training *t)
{
  if (!t) return;
  sf_view_close(t->server);
  free(t->preview.rgb), free(t->preview.truth), free(t->preview.shown), free(t->preview.whole);
  pthread_mutex_destroy(&t->lock);
  free(t);
}
