/* The contact sheet of a set: every finished view, small, with its name. */
#include "sim/studio/view_set.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { TILE_MAX = 160, SHEET = 4000, GAP = 8, LABEL = 12, LABELLED = 96 /* tiles that have room for words */ };
static const uint8_t ink[3] = {60, 60, 60};

typedef struct sheet {
  sf_image image;
  int columns, tile, high; /* tiles are tile x high */
  int step;                /* from tile to tile downwards */
} sheet;

static uint16_t to_u16(double value)
{
  return value > 0 ? (uint16_t)((value < 1 ? value : 1) * 65535 + 0.5) : 0;
}

static int least(int a, int b)
{
  return a < b ? a : b;
}

/* The size on the sheet; a small picture is not enlarged. */
static void shrunk(const sheet *s, int width, int height, int *w, int *h)
{
  const int most = width > height ? width : height;
  const double scale = most > s->tile ? (double)s->tile / most : 1;
  *w = (int)fmax(1, floor(width * scale)), *h = (int)fmax(1, floor(height * scale));
}

static sf_status make_sheet(sheet *s, const sf_manifest *set)
{
  const int views = set->count;
  int most = LABELLED;
  for (int i = 0; i < views; i++) most = (int)fmax(most, fmax(set->view[i].width, set->view[i].height));
  s->columns = (int)ceil(sqrt(views));
  s->tile = least(SHEET / s->columns, least(TILE_MAX, most));
  if (s->tile < 1) return sf_fail(SF_E_RANGE, "%d views are too many for a contact sheet", views);
  s->high = 1;
  for (int i = 0, w, h; i < views; i++) {
    shrunk(s, set->view[i].width, set->view[i].height, &w, &h);
    s->high = h > s->high ? h : s->high;
  }
  s->step = s->high + GAP + (s->tile >= LABELLED ? LABEL : 0);
  s->image.width = s->columns * (s->tile + GAP) + GAP;
  s->image.height = (views + s->columns - 1) / s->columns * s->step + GAP;
  const size_t n = 4 * (size_t)s->image.width * (size_t)s->image.height;
  s->image.rgba = malloc(n * sizeof *s->image.rgba);
  if (!s->image.rgba) return sf_fail(SF_E_MEMORY, "no memory for a picture of %d views", views);
  memset(s->image.rgba, 0xff, n * sizeof *s->image.rgba);
  return sf_ok();
}

/* The mean of what falls on each pixel of the tile. */
static void shrink(sheet *s, int left, int top, const float *const rgb[3], int width, int height)
{
  int w, h;
  shrunk(s, width, height, &w, &h);
  h = least(h, s->high); /* whatever the file holds, it stays in its tile */
  for (int y = 0; y < h; y++)
    for (int x = 0; x < w; x++) {
      double sum[3] = {0};
      const int x0 = x * width / w, x1 = (x + 1) * width / w, y0 = y * height / h, y1 = (y + 1) * height / h;
      for (int v = y0; v < y1; v++)
        for (int u = x0; u < x1; u++)
          for (int c = 0; c < 3; c++) sum[c] += (double)rgb[c][(size_t)v * (size_t)width + (size_t)u];
      uint16_t *pixel = s->image.rgba + 4 * ((size_t)(top + y) * (size_t)s->image.width + (size_t)(left + x));
      for (int c = 0; c < 3; c++) pixel[c] = to_u16(sum[c] / ((x1 - x0) * (double)(y1 - y0)));
    }
}

static sf_status add_picture(sheet *s, int left, int top, const char *path)
{
  int width, height, n;
  sf_exr_channel *channel;
  const float *rgb[3] = {NULL, NULL, NULL};
  SF_TRY(sf_exr_load(path, &width, &height, &channel, &n));
  for (int i = 0; i < n; i++)
    for (int c = 0; c < 3; c++)
      if (!strcmp(channel[i].name, sf_plane_names[SF_PLANE_R + c]) && channel[i].type != SF_EXR_UINT)
        rgb[c] = channel[i].data;
  const bool whole = rgb[0] && rgb[1] && rgb[2];
  if (whole) shrink(s, left, top, rgb, width, height);
  sf_exr_free(channel, n);
  return whole ? sf_ok() : sf_fail(SF_E_FORMAT, "%s: no channels R, G and B", path);
}

/* As much of the end of the name as there is room for, and the PSNR. */
static void add_label(sheet *s, int left, int top, const sf_manifest_view *view)
{
  char text[320], psnr[40] = "";
  const int room = s->tile / SF_TEXT_ADVANCE;
  if (s->tile < LABELLED) return;
  if (!isnan(view->psnr)) snprintf(psnr, sizeof psnr, " %.1f dB", view->psnr);
  const int letters = room - (int)strlen(psnr), length = (int)strlen(view->name);
  snprintf(text, sizeof text, "%s%s", view->name + (length > letters ? length - letters : 0), psnr);
  sf_image_text(&s->image, left, top + s->high + 2, 1, ink, text);
}

static sf_status fill_sheet(sheet *s, const sf_view_set *set)
{
  const sf_studio *studio = set->studio;
  for (int i = 0; i < set->manifest.count; i++) {
    char path[4096 + 80];
    const sf_manifest_view *view = &set->manifest.view[i];
    const int left = GAP + i % s->columns * (s->tile + GAP), top = GAP + i / s->columns * s->step;
    if (studio->tick && !studio->tick(studio->user, 0))
      return sf_fail(SF_E_STOPPED, "stopped; %s holds all views, the same command draws %s", set->folder,
                     SF_CONTACT_NAME);
    snprintf(path, sizeof path, "%s/%s", set->folder, view->exr);
    SF_TRY(add_picture(s, left, top, path));
    add_label(s, left, top, view);
  }
  return sf_ok();
}

sf_status sf_view_set_contact(const sf_view_set *set, char path[4096 + 16])
{
  sheet s;
  snprintf(path, 4096 + 16, "%s/%s", set->folder, SF_CONTACT_NAME);
  SF_TRY(make_sheet(&s, &set->manifest));
  sf_status status = fill_sheet(&s, set);
  if (status.code == SF_OK) status = sf_image_save_png(&s.image, path);
  sf_image_free(&s.image);
  return status;
}
