#include "base/json.h"
#include "golden/manifest.h"
#include <math.h>

static void add_real(cJSON *object, const char *key, const char *format, double value)
{
  char text[64];
  snprintf(text, sizeof text, format, value);
  if (isfinite(value))
    cJSON_AddRawToObject(object, key, text);
  else
    cJSON_AddNullToObject(object, key);
}

static void add_counts(cJSON *json, uint64_t samples, uint64_t rays, const uint64_t *event, uint64_t energy)
{
  sf_json_add_u64(json, "samples", samples);
  sf_json_add_u64(json, "rays", rays);
  if (!event) return;
  for (int e = 0; e < SF_EVENTS; e++) sf_json_add_u64(json, sf_events[e].name, event[e]);
  sf_json_add_u64(json, "energy_fj", energy);
}

static cJSON *view_json(const sf_manifest_view *v, bool is_float)
{
  cJSON *json = cJSON_CreateObject();
  cJSON_AddNumberToObject(json, "index", v->index);
  cJSON_AddStringToObject(json, "name", v->name);
  cJSON_AddNumberToObject(json, "width", v->width);
  cJSON_AddNumberToObject(json, "height", v->height);
  cJSON_AddStringToObject(json, "camera_sha256", v->camera_sha256);
  if (!is_float) {
    cJSON *planes = cJSON_AddObjectToObject(json, "planes");
    for (int p = 0; p < SF_PLANES; p++)
      if (sf_plane_is_integer((sf_plane)p)) cJSON_AddStringToObject(planes, sf_plane_names[p], v->plane_sha256[p]);
    cJSON_AddStringToObject(json, "counts_sha256", v->counts_sha256);
    cJSON_AddStringToObject(json, "unexpected_saturation", v->unexpected_saturation);
  }
  add_counts(cJSON_AddObjectToObject(json, "counts"), v->samples, v->rays, is_float ? NULL : v->event,
             sf_manifest_energy_fj(v));
  cJSON_AddStringToObject(json, "exr", v->exr);
  cJSON_AddStringToObject(json, "exr_sha256", v->exr_sha256);
  add_real(json, "psnr", "%.4f", v->psnr);
  add_real(json, "ssim", "%.4f", v->ssim);
  return json;
}

static void add_origin(cJSON *json, const sf_manifest_origin *o)
{
  cJSON_AddStringToObject(json, "format", SF_MANIFEST_FORMAT);
  cJSON_AddNumberToObject(json, "version", SF_MANIFEST_VERSION);
  cJSON_AddStringToObject(json, "arithmetic", o->model_sha256[0] ? "float" : "fixed");
  cJSON_AddStringToObject(json, "scene_sha256", o->scene_sha256);
  if (o->model_sha256[0]) cJSON_AddStringToObject(json, "model_sha256", o->model_sha256);
  cJSON_AddStringToObject(json, "split", o->split);
  cJSON_AddNumberToObject(json, "t_r", o->steps);
  cJSON_AddNumberToObject(json, "downscale", o->downscale);
  add_real(json, "scale", "%.9g", (double)o->scale);
  const sf_window *c = &o->crop;
  if (c->width > 0)
    cJSON_AddItemToObject(json, "crop", cJSON_CreateIntArray((const int[4]){c->x, c->y, c->width, c->height}, 4));
  else
    cJSON_AddNullToObject(json, "crop");
}

sf_status sf_manifest_save(const sf_manifest *manifest, const char *path)
{
  cJSON *json = cJSON_CreateObject();
  if (!json) return sf_fail(SF_E_MEMORY, "%s: no memory for the manifest", path);
  bool is_float = manifest->origin.model_sha256[0];
  sf_manifest_sum sum;
  sf_manifest_sums(manifest, &sum);
  add_origin(json, &manifest->origin);
  cJSON_AddNumberToObject(json, "views", manifest->total);
  cJSON_AddBoolToObject(json, "complete", manifest->count == manifest->total);
  add_counts(cJSON_AddObjectToObject(json, "totals"), sum.samples, sum.rays, is_float ? NULL : sum.event,
             sum.energy_fj);
  add_real(json, "psnr", "%.4f", sum.psnr);
  add_real(json, "ssim", "%.4f", sum.ssim);
  cJSON *list = cJSON_AddArrayToObject(json, "view");
  for (int i = 0; i < manifest->count; i++) cJSON_AddItemToArray(list, view_json(&manifest->view[i], is_float));
  sf_status status = sf_json_save(json, path);
  cJSON_Delete(json);
  return status;
}
