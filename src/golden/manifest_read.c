/* A manifest is read back strictly: what is missing, unknown or contradicts itself is refused. */
#include "base/json.h"
#include "golden/manifest.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define COUNT_LIMIT 0x1p50 /* JSON numbers are doubles; and energies of so many events fit in 64 bits */

/* One JSON object and where it stands; taken counts the fields that were asked for and found. */
typedef struct object {
  const cJSON *json;
  char where[4096 + 64];
  int taken;
} object;

static sf_status field(object *o, const char *key, const cJSON **item)
{
  SF_TRY(sf_json_need(o->json, o->where, key, item));
  o->taken++;
  return sf_ok();
}

static sf_status enter(object *inner, object *outer, const char *key)
{
  const cJSON *item;
  SF_TRY(field(outer, key, &item));
  if (!cJSON_IsObject(item)) return sf_fail(SF_E_FORMAT, "%s: %s is not an object", outer->where, key);
  *inner = (object){.json = item};
  snprintf(inner->where, sizeof inner->where, "%.4100s: %.32s", outer->where, key);
  return sf_ok();
}

static sf_status leave(const object *o)
{
  if (cJSON_GetArraySize(o->json) == o->taken) return sf_ok();
  return sf_fail(SF_E_FORMAT, "%s: has %d fields, expected %d", o->where, cJSON_GetArraySize(o->json), o->taken);
}

static sf_status read_text(object *o, const char *key, char *text, size_t size)
{
  SF_TRY(sf_json_need_text(o->json, o->where, key, text, size));
  o->taken++;
  return *text ? sf_ok() : sf_fail(SF_E_FORMAT, "%s: %s is an empty text", o->where, key);
}

static sf_status read_hash(object *o, const char *key, char hex[65])
{
  SF_TRY(read_text(o, key, hex, 65));
  if (strspn(hex, "0123456789abcdef") == 64) return sf_ok();
  return sf_fail(SF_E_FORMAT, "%s: %s is not a SHA-256 of 64 lower-case hex digits", o->where, key);
}

static sf_status expect_text(object *o, const char *key, const char *wanted)
{
  char text[64];
  SF_TRY(read_text(o, key, text, sizeof text));
  if (!strcmp(text, wanted)) return sf_ok();
  return sf_fail(SF_E_FORMAT, "%s: %s is '%s', expected '%s'", o->where, key, text, wanted);
}

static sf_status read_whole(object *o, const char *key, double low, double high, double *value)
{
  o->taken++;
  return sf_json_need_whole(o->json, o->where, key, low, high, value);
}

static sf_status read_int(object *o, const char *key, int low, int high, int *value)
{
  double number;
  SF_TRY(read_whole(o, key, low, high, &number));
  *value = (int)number;
  return sf_ok();
}

static sf_status read_count(object *o, const char *key, uint64_t *value)
{
  double number;
  SF_TRY(read_whole(o, key, 0, COUNT_LIMIT, &number));
  *value = (uint64_t)number;
  return sf_ok();
}

/* A sum that the views give. As the double that JSON makes of it. */
static sf_status expect_sum(object *o, const char *key, uint64_t sum)
{
  const cJSON *item;
  SF_TRY(field(o, key, &item));
  if (cJSON_IsNumber(item) && item->valuedouble == (double)sum) return sf_ok();
  return sf_fail(SF_E_RANGE, "%s: %s contradicts the counts, which give %llu", o->where, key, (unsigned long long)sum);
}

static sf_status read_quality(object *o, const char *key, double *value)
{
  const cJSON *item;
  SF_TRY(field(o, key, &item));
  *value = NAN;
  if (cJSON_IsNull(item)) return sf_ok();
  if (!cJSON_IsNumber(item) || !isfinite(item->valuedouble))
    return sf_fail(SF_E_FORMAT, "%s: %s is neither a number nor null", o->where, key);
  *value = item->valuedouble;
  return sf_ok();
}

static sf_status expect_mean(object *o, const char *key, double mean)
{
  double value;
  char wanted[64], found[64];
  SF_TRY(read_quality(o, key, &value));
  if (isnan(mean) && isnan(value)) return sf_ok();
  snprintf(wanted, sizeof wanted, "%.4f", mean), snprintf(found, sizeof found, "%.4f", value);
  if (!strcmp(wanted, found)) return sf_ok();
  return sf_fail(SF_E_RANGE, "%s: %s is %s, the mean over the views is %s", o->where, key, found, wanted);
}

/* ---- origin ---- */

static sf_status read_crop(object *o, sf_window *crop)
{
  const cJSON *item;
  int value[4], n = 0;
  SF_TRY(field(o, "crop", &item));
  if (cJSON_IsNull(item)) return sf_ok();
  bool good = cJSON_IsArray(item) && cJSON_GetArraySize(item) == 4;
  for (const cJSON *number = good ? item->child : NULL; number; number = number->next, n++) {
    good = good && cJSON_IsNumber(number) && number->valuedouble == number->valueint && number->valueint >= n / 2 &&
           number->valueint <= 1 << 24;
    value[n] = number->valueint;
  }
  if (!good) return sf_fail(SF_E_FORMAT, "%s: crop is neither null nor [x, y, width, height] in pixels", o->where);
  *crop = (sf_window){value[0], value[1], value[2], value[3]};
  return sf_ok();
}

static sf_status read_scale(object *o, float *scale)
{
  const cJSON *item;
  SF_TRY(field(o, "scale", &item));
  *scale = cJSON_IsNumber(item) ? (float)item->valuedouble : 0;
  if (*scale > 0 && isfinite(*scale)) return sf_ok();
  return sf_fail(SF_E_RANGE, "%s: scale is not a positive number", o->where);
}

static sf_status read_origin(object *o, sf_manifest_origin *origin)
{
  int version;
  char arithmetic[16];
  SF_TRY(expect_text(o, "format", SF_MANIFEST_FORMAT));
  SF_TRY(read_int(o, "version", SF_MANIFEST_VERSION, SF_MANIFEST_VERSION, &version));
  SF_TRY(read_text(o, "arithmetic", arithmetic, sizeof arithmetic));
  bool is_float = !strcmp(arithmetic, "float");
  if (!is_float && strcmp(arithmetic, "fixed") != 0)
    return sf_fail(SF_E_FORMAT, "%s: arithmetic is '%s', expected fixed or float", o->where, arithmetic);
  SF_TRY(read_hash(o, "scene_sha256", origin->scene_sha256));
  if (is_float) SF_TRY(read_hash(o, "model_sha256", origin->model_sha256));
  SF_TRY(read_text(o, "split", origin->split, sizeof origin->split));
  SF_TRY(read_int(o, "t_r", 1, SF_T_MAX, &origin->steps));
  SF_TRY(read_int(o, "downscale", 0, 64, &origin->downscale));
  SF_TRY(read_scale(o, &origin->scale));
  return read_crop(o, &origin->crop);
}

/* ---- views ---- */

static sf_status read_planes(object *o, sf_manifest_view *v)
{
  object planes;
  SF_TRY(enter(&planes, o, "planes"));
  for (int p = 0; p < SF_PLANES; p++)
    if (sf_plane_is_integer((sf_plane)p)) SF_TRY(read_hash(&planes, sf_plane_names[p], v->plane_sha256[p]));
  SF_TRY(leave(&planes));
  SF_TRY(read_hash(o, "counts_sha256", v->counts_sha256));
  return read_text(o, "unexpected_saturation", v->unexpected_saturation, sizeof v->unexpected_saturation);
}

static sf_status read_counts(object *o, bool is_float, sf_manifest_view *v)
{
  object counts;
  SF_TRY(enter(&counts, o, "counts"));
  SF_TRY(read_count(&counts, "samples", &v->samples));
  SF_TRY(read_count(&counts, "rays", &v->rays));
  for (int e = 0; e < SF_EVENTS && !is_float; e++) SF_TRY(read_count(&counts, sf_events[e].name, &v->event[e]));
  if (!is_float) SF_TRY(expect_sum(&counts, "energy_fj", sf_manifest_energy_fj(v)));
  return leave(&counts);
}

static sf_status read_view(const cJSON *json, const char *path, int place, const sf_manifest *m, sf_manifest_view *v)
{
  object o = {.json = json};
  bool is_float = m->origin.model_sha256[0];
  snprintf(o.where, sizeof o.where, "%s: view[%d]", path, place);
  if (!cJSON_IsObject(json)) return sf_fail(SF_E_FORMAT, "%s is not an object", o.where);
  int before = place ? m->view[place - 1].index : -1;
  SF_TRY(read_int(&o, "index", before + 1, m->total - 1, &v->index));
  SF_TRY(read_text(&o, "name", v->name, sizeof v->name));
  SF_TRY(read_int(&o, "width", 1, 1 << 24, &v->width));
  SF_TRY(read_int(&o, "height", 1, 1 << 24, &v->height));
  SF_TRY(read_hash(&o, "camera_sha256", v->camera_sha256));
  if (!is_float) SF_TRY(read_planes(&o, v));
  SF_TRY(read_counts(&o, is_float, v));
  SF_TRY(read_text(&o, "exr", v->exr, sizeof v->exr));
  if (strchr(v->exr, '/')) return sf_fail(SF_E_FORMAT, "%s: exr is not a name of a file beside the manifest", o.where);
  SF_TRY(read_hash(&o, "exr_sha256", v->exr_sha256));
  SF_TRY(read_quality(&o, "psnr", &v->psnr));
  SF_TRY(read_quality(&o, "ssim", &v->ssim));
  return leave(&o);
}

static sf_status read_views(object *o, sf_manifest *m, const char *path)
{
  const cJSON *list;
  SF_TRY(field(o, "view", &list));
  if (!cJSON_IsArray(list)) return sf_fail(SF_E_FORMAT, "%s: view is not an array", path);
  for (const cJSON *item = list->child; item; item = item->next) {
    sf_manifest_view view = {0};
    SF_TRY(read_view(item, path, m->count, m, &view));
    SF_TRY(sf_manifest_put(m, &view));
  }
  return sf_ok();
}

static sf_status check_sums(object *o, const sf_manifest *m)
{
  const cJSON *complete;
  object totals;
  sf_manifest_sum sum;
  sf_manifest_sums(m, &sum);
  bool is_float = m->origin.model_sha256[0];
  SF_TRY(field(o, "complete", &complete));
  if (!cJSON_IsBool(complete) || cJSON_IsTrue(complete) != (m->count == m->total))
    return sf_fail(SF_E_RANGE, "%s: complete contradicts the list: %d of %d views", o->where, m->count, m->total);
  SF_TRY(enter(&totals, o, "totals"));
  SF_TRY(expect_sum(&totals, "samples", sum.samples));
  SF_TRY(expect_sum(&totals, "rays", sum.rays));
  for (int e = 0; e < SF_EVENTS && !is_float; e++) SF_TRY(expect_sum(&totals, sf_events[e].name, sum.event[e]));
  if (!is_float) SF_TRY(expect_sum(&totals, "energy_fj", sum.energy_fj));
  SF_TRY(leave(&totals));
  SF_TRY(expect_mean(o, "psnr", sum.psnr));
  return expect_mean(o, "ssim", sum.ssim);
}

static sf_status read_all(const cJSON *json, const char *path, sf_manifest *m)
{
  object o = {.json = json};
  snprintf(o.where, sizeof o.where, "%s", path);
  if (!cJSON_IsObject(json)) return sf_fail(SF_E_FORMAT, "%s: not a JSON object", path);
  SF_TRY(read_origin(&o, &m->origin));
  SF_TRY(read_int(&o, "views", 1, 1 << 20, &m->total));
  SF_TRY(read_views(&o, m, path));
  SF_TRY(check_sums(&o, m));
  return leave(&o);
}

sf_status sf_manifest_load(sf_manifest *manifest, const char *path)
{
  *manifest = (sf_manifest){0};
  cJSON *json;
  SF_TRY(sf_json_load(path, &json));
  sf_status status = read_all(json, path, manifest);
  cJSON_Delete(json);
  if (status.code != SF_OK) sf_manifest_free(manifest);
  return status;
}
