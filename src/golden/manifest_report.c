#include "golden/manifest.h"
#include <inttypes.h>
#include <math.h>
#include <string.h>

cJSON *sf_manifest_report_json(const sf_manifest *manifest)
{
  sf_manifest_sum sum;
  sf_manifest_sums(manifest, &sum);
  bool is_float = manifest->origin.model_sha256[0];
  cJSON *json = cJSON_CreateObject();
  cJSON_AddNumberToObject(json, "views", manifest->total);
  cJSON_AddNumberToObject(json, "finished", manifest->count);
  cJSON_AddNumberToObject(json, "t_r", manifest->origin.steps);
  sf_json_add_real(json, "psnr", sum.psnr);
  sf_json_add_real(json, "ssim", sum.ssim);
  sf_json_add_u64(json, "samples", sum.samples);
  sf_json_add_u64(json, "rays", sum.rays);
  for (int e = 0; e < SF_EVENTS && !is_float; e++) sf_json_add_u64(json, sf_events[e].name, sum.event[e]);
  if (!is_float) sf_json_add_u64(json, "energy_fj", sum.energy_fj);
  cJSON *list = cJSON_AddArrayToObject(json, "view");
  for (int i = 0; i < manifest->count; i++) {
    const sf_manifest_view *v = &manifest->view[i];
    cJSON *view = cJSON_CreateObject();
    cJSON_AddItemToArray(list, view);
    cJSON_AddNumberToObject(view, "index", v->index);
    cJSON_AddStringToObject(view, "name", v->name);
    cJSON_AddStringToObject(view, "exr", v->exr);
    sf_json_add_real(view, "psnr", v->psnr);
    sf_json_add_real(view, "ssim", v->ssim);
    sf_json_add_u64(view, "samples", v->samples);
    if (!is_float) sf_json_add_u64(view, "energy_fj", sf_manifest_energy_fj(v));
  }
  return json;
}

static void print_quality(FILE *out, double psnr, double ssim)
{
  if (isnan(psnr))
    fprintf(out, "%8s", "-");
  else
    fprintf(out, "%8.2f", psnr);
  if (isnan(ssim))
    fprintf(out, " %7s", "-");
  else
    fprintf(out, " %7.4f", ssim);
}

static void print_row(FILE *out, const char *name, const sf_manifest_sum *s, bool is_float)
{
  fprintf(out, "%-28s ", name);
  print_quality(out, s->psnr, s->ssim);
  fprintf(out, " %12" PRIu64, s->samples);
  if (!is_float)
    fprintf(out, " %15" PRIu64 " %15" PRIu64 " %13" PRIu64 " %11.4f", s->event[SF_EVENT_MAC], s->event[SF_EVENT_SOP],
            s->event[SF_EVENT_SPIKES], (double)s->energy_fj * 1e-12);
  fputc('\n', out);
}

void sf_manifest_report_print(FILE *out, const sf_manifest *manifest)
{
  bool is_float = manifest->origin.model_sha256[0];
  sf_manifest_sum sum;
  sf_manifest_sums(manifest, &sum);
  fprintf(out, "%-28s %8s %7s %12s", "view", "PSNR, dB", "SSIM", "samples");
  if (!is_float) fprintf(out, " %15s %15s %13s %11s", "MAC", "SOP", "spikes", "energy, mJ");
  fputc('\n', out);
  for (int i = 0; i < manifest->count; i++) {
    sf_manifest_sum one;
    sf_manifest_view *v = &manifest->view[i];
    sf_manifest_sums(&(sf_manifest){.count = 1, .view = v}, &one);
    print_row(out, v->name, &one, is_float);
    if (v->unexpected_saturation[0] && strcmp(v->unexpected_saturation, "none") != 0)
      fprintf(out, "    UNEXPECTED saturation in %s: do not use the image as golden\n", v->unexpected_saturation);
  }
  print_row(out, "mean quality, total counts", &sum, is_float);
}
