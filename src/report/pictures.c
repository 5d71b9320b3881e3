/* Pictures of every scene beside the truth: whole, one part magnified, the errors as a map. */
#include "report/internal.h"
#include "image/image.h"
#include "page/internal.h"
#include <math.h>
#include <stdlib.h>
#include <unistd.h>

enum { PART = 5, PART_LEAST = 8, VIEWS = 4096, CELLS = 2 + SF_BETAS };
static const double BLACK = 0.2; /* the error that the map shows black */

/* ---- pixels ---- */

static sf_status load(const sf_reproduction *r, const char *file, sf_image *image)
{
  char path[4096 + 700];
  snprintf(path, sizeof path, "%s/%s", r->dir, file ? file : "");
  return sf_image_load(image, path);
}

static double squared(const uint16_t *a, const uint16_t *b)
{
  double sum = 0;
  for (int c = 0; c < 3; c++) {
    const double d = ((double)a[c] - b[c]) / 65535;
    sum += d * d;
  }
  return sum / 3;
}

static bool same_size(const sf_image *a, const sf_image *b)
{
  return a->width == b->width && a->height == b->height;
}

static double psnr(const sf_image *a, const sf_image *b)
{
  const size_t n = (size_t)a->width * (size_t)a->height;
  double sum = 0;
  for (size_t i = 0; i < n; i++) sum += squared(a->rgba + 4 * i, b->rgba + 4 * i);
  return sum > 0 ? -10 * log10(sum / (double)n) : 99;
}

/* A window of a picture as <img>. */
static sf_status put_window(FILE *out, const sf_image *image, int x0, int y0, int width, int height, const char *alt)
{
  if (x0 < 0 || y0 < 0 || width < 1 || height < 1 || x0 + width > image->width || y0 + height > image->height)
    return sf_fail(SF_E_RANGE, "a part of a picture is outside of it");
  uint8_t *rgb = malloc(3 * (size_t)width * (size_t)height);
  if (!rgb) return sf_fail(SF_E_MEMORY, "no memory for a picture");
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++)
      for (int c = 0; c < 3; c++)
        rgb[3 * (y * width + x) + c] =
            (uint8_t)(image->rgba[4 * ((size_t)(y0 + y) * (size_t)image->width + (size_t)(x0 + x)) + (size_t)c] / 257);
  const sf_status status = html_put_png(out, rgb, width, height, NULL, 0, alt);
  free(rgb);
  return status;
}

sf_status sf_report_put_picture(FILE *out, const sf_reproduction *r, const cJSON *cell)
{
  sf_image image;
  SF_TRY(load(r, sf_json_text(cell, "file"), &image));
  const sf_status status = put_window(out, &image, 0, 0, image.width, image.height, sf_json_text(cell, "title"));
  sf_image_free(&image);
  return status;
}

static int at(const cJSON *cell, int i)
{
  const cJSON *number = cJSON_GetArrayItem(sf_json_get(cell, "crop"), i);
  return number ? number->valueint : -1;
}

sf_status sf_report_put_crop(FILE *out, const sf_reproduction *r, const cJSON *cell)
{
  sf_image image;
  SF_TRY(load(r, sf_json_text(cell, "file"), &image));
  const sf_status status =
      put_window(out, &image, at(cell, 0), at(cell, 1), at(cell, 2), at(cell, 2), "A part, magnified");
  sf_image_free(&image);
  return status;
}

static sf_status put_map(FILE *out, const sf_image *image, const sf_image *truth)
{
  const size_t n = (size_t)image->width * (size_t)image->height;
  if (!same_size(image, truth)) return sf_fail(SF_E_FORMAT, "a picture and the truth have different sizes");
  uint8_t *rgb = malloc(3 * n);
  if (!rgb) return sf_fail(SF_E_MEMORY, "no memory for a picture");
  for (size_t i = 0; i < n; i++) {
    const double error = sqrt(squared(image->rgba + 4 * i, truth->rgba + 4 * i)) / BLACK;
    for (size_t c = 0; c < 3; c++) rgb[3 * i + c] = (uint8_t)(255 * (1 - fmin(error, 1)) + 0.5);
  }
  const sf_status status = html_put_png(out, rgb, image->width, image->height, NULL, 0, "Map of the errors");
  free(rgb);
  return status;
}

sf_status sf_report_put_error(FILE *out, const sf_reproduction *r, const cJSON *cell)
{
  sf_image image, truth;
  SF_TRY(load(r, sf_json_text(cell, "file"), &image));
  sf_status status = load(r, sf_json_text(cell, "truth"), &truth);
  if (status.code == SF_OK) {
    status = put_map(out, &image, &truth);
    sf_image_free(&truth);
  }
  sf_image_free(&image);
  return status;
}

/* ---- where the errors are ---- */

typedef struct part {
  int x, y, side;
} part;

/* The square with the largest sum, in steps of half its side. */
static part worst_part(const double *error, int width, int height)
{
  const int least = width < height ? width : height;
  part best = {0, 0, least / PART > PART_LEAST ? least / PART : least < PART_LEAST ? least : PART_LEAST};
  double most = -1;
  const int step = best.side > 1 ? best.side / 2 : 1;
  for (int y = 0; y + best.side <= height; y += step)
    for (int x = 0; x + best.side <= width; x += step) {
      double sum = 0;
      for (int v = y; v < y + best.side; v++)
        for (int u = x; u < x + best.side; u++) sum += error[(size_t)v * (size_t)width + (size_t)u];
      if (sum > most) most = sum, best.x = x, best.y = y;
    }
  return best;
}

/* ---- a scene ---- */

/* Its own folder's run; the seeds beside it are in the tables. */
static void name_of(const sf_report_scene *scene, int run, const char *prefix, int view, char path[640])
{
  snprintf(path, 640, "%s/%s/%s-%d.png", scene->name, sf_run_kinds[run].name, prefix, view);
}

static bool is_there(const sf_reproduction *r, const char *file)
{
  char path[4096 + 700];
  snprintf(path, sizeof path, "%s/%s", r->dir, file);
  return access(path, R_OK) == 0;
}

/* The first view of which some run left the truth; -1: none. */
static int find_truth(const sf_reproduction *r, const sf_report_scene *scene, char path[640])
{
  for (int view = 0; view < VIEWS; view++)
    for (int i = -1; i < SF_BETAS; i++) {
      name_of(scene, i < 0 ? SF_RUN_ANN : sf_paper_groups[scene->group].beta[i], "truth", view, path);
      if (is_there(r, path)) return view;
    }
  return -1;
}

typedef struct beside {
  const sf_image *truth;
  double *error; /* [height][width], summed over the pictures */
  cJSON *cells;
} beside;

static void add_cell(beside *b, const char *title, const char *file, const char *truth, double db)
{
  char text[32];
  cJSON *cell = cJSON_CreateObject();
  sf_json_add_text(cell, "title", title), sf_json_add_text(cell, "file", file), sf_json_add_text(cell, "truth", truth);
  snprintf(text, sizeof text, "%.2f", db);
  if (!isnan(db)) cJSON_AddStringToObject(cell, "psnr", text);
  cJSON_AddItemToArray(b->cells, cell);
}

static void add_picture(const sf_reproduction *r, beside *b, const char *title, const char *file, const char *truth)
{
  sf_image image;
  if (!is_there(r, file) || load(r, file, &image).code != SF_OK) return;
  if (same_size(&image, b->truth)) {
    const size_t n = (size_t)image.width * (size_t)image.height;
    for (size_t i = 0; i < n; i++) b->error[i] += squared(image.rgba + 4 * i, b->truth->rgba + 4 * i);
    add_cell(b, title, file, truth, psnr(&image, b->truth));
  }
  sf_image_free(&image);
}

static cJSON *scene_json(const sf_reproduction *r, const sf_report_scene *scene, int view, const char *path,
                         const sf_image *truth)
{
  char file[640];
  cJSON *json = cJSON_CreateObject();
  beside b = {truth, calloc((size_t)truth->width * (size_t)truth->height, sizeof *b.error),
              cJSON_AddArrayToObject(json, "cells")};
  if (!b.error || !b.cells) {
    free(b.error), cJSON_Delete(json);
    return NULL;
  }
  sf_json_add_text(json, "name", scene->name);
  cJSON_AddNumberToObject(json, "view", view);
  add_cell(&b, "truth", path, path, NAN);
  for (int i = -1; i < SF_BETAS; i++) {
    const int run = i < 0 ? SF_RUN_ANN : sf_paper_groups[scene->group].beta[i];
    name_of(scene, run, "frame", view, file);
    add_picture(r, &b, sf_run_kinds[run].title, file, path);
  }
  const part crop = worst_part(b.error, truth->width, truth->height);
  for (cJSON *cell = b.cells->child; cell; cell = cell->next)
    cJSON_AddItemToObject(cell, "crop", cJSON_CreateIntArray((const int[]){crop.x, crop.y, crop.side}, 3));
  free(b.error);
  return json;
}

cJSON *sf_report_pictures(const sf_reproduction *r)
{
  cJSON *list = cJSON_CreateArray();
  for (int s = 0; s < r->count; s++) {
    char path[640];
    sf_image truth;
    const int view = find_truth(r, &r->scene[s], path);
    if (view < 0 || load(r, path, &truth).code != SF_OK) continue;
    cJSON_AddItemToArray(list, scene_json(r, &r->scene[s], view, path, &truth));
    sf_image_free(&truth);
  }
  return list;
}
