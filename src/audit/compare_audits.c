/* Two audits, read from their JSON: what differs in how they were made, in energy and in events. */
#include "energy/energy.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct side {
  const cJSON *json, *technology, *ledgers, *layers;
  const char *name;
  int scheme; /* of the prices: 1 by the byte, 2 by the access */
  double views;
} side;

static bool is_ledger(const cJSON *ledger)
{
  return cJSON_IsString(sf_json_get(ledger, "key")) && cJSON_IsString(sf_json_get(ledger, "title")) &&
         cJSON_IsNumber(sf_json_get(ledger, "mj_per_view")) && cJSON_IsObject(sf_json_get(ledger, "parts_fj")) &&
         cJSON_GetArraySize(sf_json_get(ledger, "rows")) == SF_ROWS;
}

/* All of its scheme, in any order. */
static bool has_ledgers(const cJSON *list)
{
  const cJSON *ledger;
  cJSON_ArrayForEach(ledger, list)
  {
    if (!is_ledger(ledger)) return false;
  }
  return cJSON_GetArraySize(list) > 0;
}

static sf_status open_side(const cJSON *json, const char *name, side *s)
{
  const cJSON *ledgers = sf_json_get(json, "ledgers"), *views = sf_json_get(json, "views");
  *s = (side){.json = json,
              .name = name,
              .technology = sf_json_get(ledgers, "technology"),
              .ledgers = sf_json_get(ledgers, "list")};
  s->layers = sf_json_get(sf_json_get(json, "counts"), "layers");
  s->scheme = sf_json_says(json, "format", SF_AUDIT_FORMAT) ? 2 : sf_json_says(json, "format", SF_AUDIT_FORMAT_1);
  if (!s->scheme || !cJSON_IsNumber(views) || !(views->valuedouble > 0) || !has_ledgers(s->ledgers) ||
      cJSON_GetArraySize(s->layers) != SF_LAYERS || !cJSON_IsArray(sf_json_get(s->technology, "prices")))
    return sf_fail(SF_E_FORMAT, "%s: not a report of energy_audit --json, format %s or %s", name, SF_AUDIT_FORMAT,
                   SF_AUDIT_FORMAT_1);
  s->views = views->valuedouble;
  return sf_ok();
}

/* ---- ledgers of both ---- */

static const cJSON *find_ledger(const side *s, const char *key)
{
  const cJSON *ledger;
  cJSON_ArrayForEach(ledger, s->ledgers)
  {
    if (sf_json_says(ledger, "key", key)) return ledger;
  }
  return NULL;
}

/* The same events at the same kinds of prices in every scheme. */
static bool is_arithmetic(const char *key)
{
  static const char *const keys[] = {"paper", "width", "ann_fp32", "ann_int"};
  for (size_t i = 0; i < sizeof keys / sizeof *keys; i++)
    if (!strcmp(keys[i], key)) return true;
  return false;
}

/* NULL: the ledger can be compared. */
static const char *obstacle(const side *a, const side *b, const char *key)
{
  if (!find_ledger(a, key)) return "A does not have it";
  if (!find_ledger(b, key)) return "B does not have it";
  if (a->scheme == b->scheme || is_arithmetic(key)) return NULL;
  return "one report prices memories by the byte, without the field's cache and arithmetic; the other by the access";
}

static void add_obstacles(cJSON *list, const side *of, const side *a, const side *b)
{
  const cJSON *ledger;
  cJSON_ArrayForEach(ledger, of->ledgers)
  {
    const char *key = sf_json_text(ledger, "key"), *why = obstacle(a, b, key);
    if (!why || (of == b && find_ledger(a, key))) continue;
    cJSON *item = cJSON_CreateObject();
    cJSON_AddStringToObject(item, "key", key);
    cJSON_AddStringToObject(item, "title", sf_json_text(ledger, "title"));
    cJSON_AddStringToObject(item, "why", why);
    cJSON_AddItemToArray(list, item);
  }
}

/* Ledgers that stand in one report alone, or mean something else there. */
static cJSON *not_comparable(const side *a, const side *b)
{
  cJSON *list = cJSON_CreateArray();
  add_obstacles(list, a, a, b);
  add_obstacles(list, b, a, b);
  return list;
}

/* ---- settings ---- */

static void add_setting(cJSON *list, const char *name, const cJSON *a, const cJSON *b)
{
  if (cJSON_Compare(a, b, true)) return;
  cJSON *item = cJSON_CreateObject();
  cJSON_AddStringToObject(item, "name", name);
  cJSON_AddItemToObject(item, "a", a ? cJSON_Duplicate(a, true) : cJSON_CreateNull());
  cJSON_AddItemToObject(item, "b", b ? cJSON_Duplicate(b, true) : cJSON_CreateNull());
  cJSON_AddItemToArray(list, item);
}

static const cJSON *price_text(const side *s, const char *key)
{
  const cJSON *price;
  cJSON_ArrayForEach(price, sf_json_get(s->technology, "prices"))
  {
    const cJSON *name = sf_json_get(price, "key");
    if (cJSON_IsString(name) && !strcmp(name->valuestring, key)) return sf_json_get(price, "text");
  }
  return NULL;
}

static void add_prices(cJSON *list, const side *of, const side *a, const side *b)
{
  const cJSON *price;
  cJSON_ArrayForEach(price, sf_json_get(of->technology, "prices"))
  {
    char name[80];
    const cJSON *key = sf_json_get(price, "key");
    if (!cJSON_IsString(key) || (of == b && price_text(a, key->valuestring))) continue;
    snprintf(name, sizeof name, "price of %s", key->valuestring);
    add_setting(list, name, price_text(a, key->valuestring), price_text(b, key->valuestring));
  }
}

static cJSON *settings(const side *a, const side *b)
{
  static const char *const keys[] = {"scene", "scene_sha256", "data",    "split", "t_r",
                                     "views", "seed",         "samples", "format"};
  cJSON *list = cJSON_CreateArray();
  for (size_t i = 0; i < sizeof keys / sizeof *keys; i++)
    add_setting(list, keys[i], sf_json_get(a->json, keys[i]), sf_json_get(b->json, keys[i]));
  const cJSON *x = sf_json_get(a->json, "cache"), *y = sf_json_get(b->json, "cache");
  add_setting(list, "cache bytes", sf_json_get(x, "bytes"), sf_json_get(y, "bytes"));
  add_setting(list, "cache ways", sf_json_get(x, "ways"), sf_json_get(y, "ways"));
  add_setting(list, "technology", sf_json_get(a->technology, "title"), sf_json_get(b->technology, "title"));
  add_prices(list, a, a, b);
  add_prices(list, b, a, b);
  return list;
}

/* ---- figures ---- */

typedef struct change {
  char name[64];
  double a, b, size; /* size: what the list is sorted by */
} change;

typedef struct changes {
  change item[256];
  int count;
} changes;

static void add_change(changes *list, const char *name, double a, double b, bool relative)
{
  if (list->count == (int)(sizeof list->item / sizeof *list->item) || a == b) return;
  change *c = &list->item[list->count++];
  snprintf(c->name, sizeof c->name, "%s", name);
  c->a = a, c->b = b;
  c->size = relative ? fabs(b - a) / fmax(fabs(a), fabs(b)) : fabs(b - a);
}

static int larger(const void *a, const void *b)
{
  const change *x = a, *y = b;
  if (x->size != y->size) return x->size < y->size ? 1 : -1;
  return strcmp(x->name, y->name);
}

static void add_percent(cJSON *json, double a, double b)
{
  sf_json_add_real(json, "change_percent", 100 * (b / a - 1));
}

static cJSON *changes_json(changes *list)
{
  cJSON *json = cJSON_CreateArray();
  qsort(list->item, (size_t)list->count, sizeof *list->item, larger);
  for (int i = 0; i < list->count; i++) {
    const change *c = &list->item[i];
    cJSON *item = cJSON_CreateObject();
    cJSON_AddStringToObject(item, "name", c->name);
    cJSON_AddNumberToObject(item, "a", c->a);
    cJSON_AddNumberToObject(item, "b", c->b);
    cJSON_AddNumberToObject(item, "change", c->b - c->a);
    add_percent(item, c->a, c->b);
    cJSON_AddItemToArray(json, item);
  }
  return json;
}

static double sum_of(const cJSON *list)
{
  double sum = 0;
  const cJSON *item;
  cJSON_ArrayForEach(item, list) sum += cJSON_IsNumber(item) ? item->valuedouble : 0;
  return sum;
}

static cJSON *ledger_totals(const side *a, const side *b)
{
  cJSON *list = cJSON_CreateArray();
  const cJSON *x;
  cJSON_ArrayForEach(x, a->ledgers)
  {
    const char *key = sf_json_text(x, "key");
    if (obstacle(a, b, key)) continue;
    const cJSON *y = find_ledger(b, key);
    const double from = sf_json_number(x, "mj_per_view"), to = sf_json_number(y, "mj_per_view");
    cJSON *item = cJSON_CreateObject();
    cJSON_AddStringToObject(item, "key", key);
    cJSON_AddStringToObject(item, "title", sf_json_text(x, "title"));
    cJSON_AddNumberToObject(item, "a_mj_per_view", from);
    cJSON_AddNumberToObject(item, "b_mj_per_view", to);
    add_percent(item, from, to);
    const cJSON *saving[2] = {sf_json_get(x, "saving_percent"), sf_json_get(y, "saving_percent")};
    cJSON_AddItemToObject(item, "a_saving_percent", saving[0] ? cJSON_Duplicate(saving[0], 0) : cJSON_CreateNull());
    cJSON_AddItemToObject(item, "b_saving_percent", saving[1] ? cJSON_Duplicate(saving[1], 0) : cJSON_CreateNull());
    cJSON_AddItemToArray(list, item);
  }
  return list;
}

/* The title of a part of the energy, in the words of its report. */
static const char *part_title(const side *s, const char *part)
{
  const cJSON *title = sf_json_get(sf_json_get(sf_json_get(s->json, "titles"), "parts"), part);
  return cJSON_IsString(title) ? title->valuestring : part;
}

/* Of one ledger: by what the energy is spent on, then by row and step. mJ per view. */
static cJSON *ledger_parts(const side *a, const side *b, const char *key)
{
  changes list = {.count = 0};
  const cJSON *x = sf_json_get(find_ledger(a, key), "parts_fj"), *y = sf_json_get(find_ledger(b, key), "parts_fj");
  const cJSON *part;
  cJSON_ArrayForEach(part, x)
  {
    const double other = sf_json_get(y, part->string) ? sf_json_number(y, part->string) : 0;
    add_change(&list, part_title(a, part->string), part->valuedouble * 1e-12 / a->views, other * 1e-12 / b->views,
               false);
  }
  cJSON_ArrayForEach(part, y)
  {
    if (!sf_json_get(x, part->string))
      add_change(&list, part_title(b, part->string), 0, part->valuedouble * 1e-12 / b->views, false);
  }
  return changes_json(&list);
}

static double cell(const side *s, const char *key, int row, int step)
{
  const cJSON *rows = sf_json_get(find_ledger(s, key), "rows");
  const cJSON *item = cJSON_GetArrayItem(sf_json_get(cJSON_GetArrayItem(rows, row), "fj"), step);
  return cJSON_IsNumber(item) ? item->valuedouble * 1e-12 / s->views : 0;
}

static cJSON *ledger_cells(const side *a, const side *b, const char *key)
{
  changes list = {.count = 0};
  for (int r = 0; r < SF_ROWS; r++)
    for (int t = 0; t < SF_T_MAX; t++) {
      char name[64];
      snprintf(name, sizeof name, r < SF_LAYERS ? "%s, step %d" : "%s", sf_row_name(r), t);
      add_change(&list, name, cell(a, key, r, t), cell(b, key, r, t), false);
    }
  return changes_json(&list);
}

static cJSON *energies(const side *a, const side *b)
{
  cJSON *json = cJSON_CreateObject();
  const cJSON *x;
  cJSON_ArrayForEach(x, a->ledgers)
  {
    const char *key = sf_json_text(x, "key");
    if (obstacle(a, b, key)) continue;
    cJSON *ledger = cJSON_AddObjectToObject(json, key);
    cJSON_AddItemToObject(ledger, "parts", ledger_parts(a, b, key));
    cJSON_AddItemToObject(ledger, "cells", ledger_cells(a, b, key));
  }
  return json;
}

/* What both counted. */
static void add_traffic(changes *list, const side *a, const side *b)
{
  const cJSON *x = sf_json_get(sf_json_get(a->json, "counts"), "traffic");
  const cJSON *y = sf_json_get(sf_json_get(b->json, "counts"), "traffic");
  for (int e = SF_TRAFFIC_LOOKUP; e < SF_TRAFFIC_EVENTS; e++) {
    const char *name = sf_traffic_events[e].name;
    if (sf_json_get(x, name) && sf_json_get(y, name))
      add_change(list, sf_traffic_events[e].title, sf_json_number(x, name) / a->views,
                 sf_json_number(y, name) / b->views, true);
  }
}

/* Events per view, all steps, and firing rates. */
static cJSON *events(const side *a, const side *b)
{
  changes list = {.count = 0};
  for (int l = 0; l < SF_LAYERS; l++) {
    const cJSON *x = cJSON_GetArrayItem(a->layers, l), *y = cJSON_GetArrayItem(b->layers, l);
    char name[64];
    for (int e = 0; e < SF_EVENTS; e++) {
      snprintf(name, sizeof name, "%s of %s", sf_events[e].title, fx_layer_name(l));
      add_change(&list, name, sum_of(sf_json_get(x, sf_events[e].name)) / a->views,
                 sum_of(sf_json_get(y, sf_events[e].name)) / b->views, true);
    }
  }
  const cJSON *x = sf_json_get(a->json, "counts"), *y = sf_json_get(b->json, "counts");
  add_change(&list, "samples", sf_json_number(x, "samples") / a->views, sf_json_number(y, "samples") / b->views, true);
  add_change(&list, "rays with samples", sf_json_number(x, "rays") / a->views, sf_json_number(y, "rays") / b->views,
             true);
  add_change(&list, sf_traffic_events[SF_TRAFFIC_TABLE].title, sf_json_number(x, "grid_bytes") / a->views,
             sf_json_number(y, "grid_bytes") / b->views, true);
  add_traffic(&list, a, b);
  return changes_json(&list);
}

sf_status sf_audits_compare(const cJSON *a, const char *a_name, const cJSON *b, const char *b_name, cJSON **comparison)
{
  side x, y;
  *comparison = NULL;
  SF_TRY(open_side(a, a_name, &x));
  SF_TRY(open_side(b, b_name, &y));
  cJSON *json = cJSON_CreateObject();
  sf_json_add_text(json, "a", a_name);
  sf_json_add_text(json, "b", b_name);
  cJSON_AddItemToObject(json, "settings", settings(&x, &y));
  cJSON_AddItemToObject(json, "ledgers", ledger_totals(&x, &y));
  cJSON_AddItemToObject(json, "not_comparable", not_comparable(&x, &y));
  cJSON_AddItemToObject(json, "energies_mj_per_view", energies(&x, &y));
  cJSON_AddItemToObject(json, "events_per_view", events(&x, &y));
  *comparison = json;
  return sf_ok();
}
