/* A picture as a stream of tiles: a coarse one first, then every pixel. Each tile is 8 words, little-endian: x, y,
 * pixels across and down, stride, 1 with a map; then RGBA of 8 bits, then the map's floats. A tile without pixels is
 * the last one: `down` bytes of JSON follow it, what was counted and the map's scale. */
#include "sim/view/internal.h"
#include "page/draw.h"
#include "base/clock.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { WORDS = 8, ROWS = FX_TILE };

typedef struct picture {
  sf_viewer *v;
  sf_sight sight;
  int source, map;
  int stride, y; /* of the next tile */
  bool finish, ended;
  fx_counts counts; /* of the last pass */
  double start, low, high;
  size_t wrong; /* pixels of RTL that differ */
} picture;

static sf_status draw(picture *p, sf_tile *tile)
{
  sf_viewer *v = p->v;
  if (p->source == SF_VIEW_RTL) return sf_tile_rtl(v, &p->sight, tile);
  if (p->source == SF_VIEW_PHOTO) return sf_tile_photo(v, &p->sight, tile);
  pthread_mutex_lock(&v->drawing);
  const sf_status status =
      p->source == SF_VIEW_FLOAT ? sf_tile_float(v, &p->sight, tile) : sf_tile_fixed(v, &p->sight, p->map, tile);
  pthread_mutex_unlock(&v->drawing);
  return status;
}

/* As a PNG has it: to 16 bits, then to 8. NaN is black. */
static uint8_t eight(float value)
{
  const uint32_t sixteen = value > 0 ? (uint32_t)((value < 1 ? value : 1) * 65535 + 0.5f) : 0;
  return (uint8_t)((sixteen * 255u + 32767u) / 65535u);
}

static void note_range(picture *p, const sf_tile *tile, size_t n)
{
  for (size_t i = 0; i < n; i++) {
    p->wrong += (size_t)isnan(tile->rgb[3 * i]);
    if (!tile->value || isnan(tile->value[i])) continue;
    p->low = fmin(p->low, (double)tile->value[i]), p->high = fmax(p->high, (double)tile->value[i]);
  }
}

static sf_status pack(const sf_tile *tile, void **data, size_t *size)
{
  const size_t n = (size_t)tile->across * (size_t)tile->down;
  const uint32_t head[WORDS] = {(uint32_t)tile->x,    (uint32_t)tile->y,      (uint32_t)tile->across,
                                (uint32_t)tile->down, (uint32_t)tile->stride, tile->value != NULL};
  *size = sizeof head + 4 * n * (tile->value ? 2 : 1);
  uint8_t *to = malloc(*size);
  if (!to) return sf_fail(SF_E_MEMORY, "no memory for a tile");
  *data = to;
  memcpy(to, head, sizeof head);
  for (size_t i = 0; i < n; i++) {
    for (size_t c = 0; c < 3; c++) to[sizeof head + 4 * i + c] = eight(tile->rgb[3 * i + c]);
    to[sizeof head + 4 * i + 3] = 255;
  }
  if (tile->value) memcpy(to + sizeof head + 4 * n, tile->value, 4 * n);
  return sf_ok();
}

/* ---- what came of it ---- */

static void add_scale(cJSON *json, const picture *p)
{
  sf_map_text text;
  char *svg = NULL;
  size_t size;
  sf_map_describe(p->map, &text);
  if (p->map == SF_MAP_NONE || !(p->high >= p->low)) return;
  const double low = p->low < p->high ? p->low : 0, high = p->high > low ? p->high : low + 1;
  cJSON_AddNumberToObject(json, "low", low);
  cJSON_AddNumberToObject(json, "high", high);
  FILE *out = open_memstream(&svg, &size);
  if (!out) return;
  html_colour_bar(out, "svg-map-scale", low, high, text.unit);
  if (!fclose(out)) cJSON_AddStringToObject(json, "legend", svg);
  free(svg);
}

static void add_counts(cJSON *json, const picture *p)
{
  const fx_counts *c = &p->counts;
  sf_json_add_u64(json, "samples", c->samples);
  if (p->source == SF_VIEW_FLOAT) return;
  sf_json_add_u64(json, "spikes", sf_event_total(c, SF_EVENT_SPIKES));
  sf_json_add_u64(json, "sops", sf_event_total(c, SF_EVENT_SOP));
  sf_json_add_u64(json, "macs", sf_event_total(c, SF_EVENT_MAC));
  sf_json_add_u64(json, "energy_fj", sf_energy_fj(c));
}

static sf_status pack_end(const picture *p, const sf_status *why, void **data, size_t *size)
{
  cJSON *json = cJSON_CreateObject();
  if (why->code != SF_OK) sf_json_add_text(json, "error", why->message);
  if (p->source != SF_VIEW_PHOTO) add_counts(json, p);
  add_scale(json, p);
  cJSON_AddNumberToObject(json, "wrong", (double)p->wrong);
  cJSON_AddNumberToObject(json, "milliseconds", 1000 * (sf_seconds() - p->start));
  char *text = cJSON_PrintUnformatted(json);
  cJSON_Delete(json);
  if (!text) return sf_fail(SF_E_MEMORY, "no memory for a reply");
  const uint32_t head[WORDS] = {[3] = (uint32_t)strlen(text)};
  *size = sizeof head + strlen(text);
  uint8_t *to = malloc(*size);
  if (to) memcpy(to, head, sizeof head), memcpy(to + sizeof head, text, strlen(text));
  free(text);
  *data = to;
  return to ? sf_ok() : sf_fail(SF_E_MEMORY, "no memory for a reply");
}

/* ---- tile by tile ---- */

static bool next_pass(picture *p)
{
  if (p->y < p->sight.window.y + p->sight.window.height) return true;
  if (p->stride == 1 || !p->finish) return false;
  p->stride = 1, p->y = p->sight.window.y;
  p->counts = (fx_counts){0}, p->wrong = 0, p->low = INFINITY, p->high = -INFINITY;
  return true;
}

/* A coarse picture in one piece; else so many rows that a piece takes a fraction of a second. */
static sf_tile next_tile(const picture *p)
{
  const sf_window *w = &p->sight.window;
  const int below = p->stride > 1 ? w->y + w->height : p->source == SF_VIEW_RTL ? p->y + 1 : (p->y / ROWS + 1) * ROWS;
  const int end = below < w->y + w->height ? below : w->y + w->height;
  return (sf_tile){.x = w->x,
                   .y = p->y,
                   .across = (w->width + p->stride - 1) / p->stride,
                   .down = (end - p->y + p->stride - 1) / p->stride,
                   .stride = p->stride};
}

static sf_status draw_tile(picture *p, sf_tile *tile, void **data, size_t *size)
{
  const size_t n = (size_t)tile->across * (size_t)tile->down;
  tile->rgb = malloc(3 * n * sizeof *tile->rgb);
  tile->value = p->map == SF_MAP_NONE ? NULL : malloc(n * sizeof *tile->value);
  if (!tile->rgb || (p->map != SF_MAP_NONE && !tile->value)) return sf_fail(SF_E_MEMORY, "no memory for a tile");
  SF_TRY(draw(p, tile));
  fx_counts_add(&p->counts, &tile->counts);
  note_range(p, tile, n);
  p->y += tile->down * tile->stride;
  return pack(tile, data, size);
}

static sf_status next(void *stream, void **data, size_t *size)
{
  picture *p = stream;
  sf_status status = sf_ok();
  *data = NULL, *size = 0;
  if (p->ended) return sf_ok();
  if (next_pass(p)) {
    sf_tile tile = next_tile(p);
    status = draw_tile(p, &tile, data, size);
    free(tile.rgb), free(tile.value);
    if (status.code == SF_OK) return status;
  }
  p->ended = true;
  return pack_end(p, &status, data, size);
}

static sf_status check(const sf_viewer *v, const picture *p)
{
  const bool differs = p->map >= SF_MAP_PHOTO;
  if (p->source == SF_VIEW_FLOAT || p->map == SF_MAP_FLOAT) SF_TRY(sf_viewer_need_model(v, p->sight.steps));
  if ((p->source == SF_VIEW_PHOTO || p->map == SF_MAP_PHOTO) && p->sight.index < 0)
    return sf_fail(SF_E_RANGE, "a photograph is there of the data set's views alone, at their size");
  if (differs && p->source != SF_VIEW_FIXED)
    return sf_fail(SF_E_USAGE, "map: a difference is of the fixed source to another one");
  return sf_ok();
}

SF_VIEWER_ANSWER(picture)
{
  sf_viewer *v = user;
  picture *p = calloc(1, sizeof *p);
  if (!p) return sf_fail(SF_E_MEMORY, "no memory for a picture");
  *p = (picture){.v = v,
                 .source = ask->source,
                 .stride = ask->stride > 0 ? ask->stride : 1,
                 .finish = ask->finish != 0,
                 .start = sf_seconds(),
                 .low = INFINITY,
                 .high = -INFINITY};
  p->map = ask->map[0] ? sf_map_find(ask->map) : SF_MAP_NONE;
  reply->stream = p, reply->end = free;
  if (p->map < 0) return sf_fail(SF_E_USAGE, "map: there is no such map");
  SF_TRY(sf_sight_of(v, ask, &p->sight));
  SF_TRY(check(v, p));
  const bool slow = p->source == SF_VIEW_RTL || p->map == SF_MAP_RTL;
  if (slow && (ask->window[2] == 0 || ask->window[2] * ask->window[3] > 4096))
    return sf_fail(SF_E_USAGE, "window: the accelerator, simulated, takes a window of 1 to 4096 pixels");
  if (slow || p->source == SF_VIEW_PHOTO) p->stride = 1;
  p->y = p->sight.window.y;
  reply->type = "application/octet-stream", reply->next = next;
  return sf_ok();
}
