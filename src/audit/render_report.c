#include "spikefield/golden.h"
#include <inttypes.h>
#include <math.h>

static void add_number(cJSON *object, const char *key, double value)
{
  if (isfinite(value))
    cJSON_AddNumberToObject(object, key, value);
  else
    cJSON_AddNullToObject(object, key);
}

static void add_events(cJSON *json, const sf_render_report *r)
{
  char unexpected[64];
  cJSON_AddItemToObject(json, "counts", sf_counts_json(r->net, &r->counts));
  sf_json_add_u64(json, "energy_fj", sf_energy_fj(&r->counts));
  cJSON *samples = cJSON_AddObjectToObject(json, "saturated_samples");
  for (int l = 0; l < SF_LAYERS; l++) sf_json_add_u64(samples, sf_layer_names[l], r->saturated_samples[l]);
  sf_saturation_unexpected(r->net, r->saturated_samples, unexpected, sizeof unexpected);
  cJSON_AddStringToObject(json, "unexpected_saturation", unexpected);
}

cJSON *sf_render_report_json(const sf_render_report *r)
{
  cJSON *json = cJSON_CreateObject();
  cJSON_AddStringToObject(json, "backend", r->backend);
  cJSON_AddStringToObject(json, "scene", r->scene);
  cJSON_AddStringToObject(json, "scene_sha256", r->sha256);
  cJSON_AddStringToObject(json, "view", r->view);
  cJSON_AddNumberToObject(json, "t_r", r->net->steps);
  cJSON_AddItemToObject(json, "crop", cJSON_CreateIntArray(r->crop, 4));
  add_number(json, "psnr", r->psnr);
  add_number(json, "ssim", r->ssim);
  sf_json_add_u64(json, "samples", r->counts.samples);
  sf_json_add_u64(json, "rays", r->counts.rays);
  if (r->events) add_events(json, r);
  add_number(json, "seconds", r->seconds);
  cJSON_AddStringToObject(json, "exr", r->exr);
  if (r->png) cJSON_AddStringToObject(json, "png", r->png);
  return json;
}

static void print_events(FILE *out, const sf_render_report *r)
{
  char text[256], unexpected[64];
  fprintf(out, "%" PRIu64 " MAC, %" PRIu64 " SOP, %" PRIu64 " spikes, %" PRIu64 " fJ\n",
          sf_event_total(&r->counts, SF_EVENT_MAC), sf_event_total(&r->counts, SF_EVENT_SOP),
          sf_event_total(&r->counts, SF_EVENT_SPIKES), sf_energy_fj(&r->counts));
  sf_saturation_census(r->saturated_samples, r->counts.saturated_features, text, sizeof text);
  fprintf(out, "saturation: %s\n", text);
  if (sf_saturation_unexpected(r->net, r->saturated_samples, unexpected, sizeof unexpected))
    fprintf(out,
            "UNEXPECTED saturation in %s: this mode's state cannot leave its range; do not use the image as golden\n",
            unexpected);
}

void sf_render_report_print(FILE *out, const sf_render_report *r)
{
  const int *c = r->crop;
  fprintf(out, "view %s, %d x %d at (%d, %d)%s, t_r = %d, %s\n", r->view, c[2], c[3], c[0], c[1],
          r->crop_chosen ? " (the centre: --crop was not given)" : "", r->net->steps, r->backend);
  if (isnan(r->psnr))
    fprintf(out, "no picture to compare with\n");
  else if (isnan(r->ssim))
    fprintf(out, "PSNR %.2f dB; SSIM needs 11 x 11 pixels\n", r->psnr);
  else
    fprintf(out, "PSNR %.2f dB, SSIM %.4f\n", r->psnr, r->ssim);
  fprintf(out, "%" PRIu64 " samples, %.2f per pixel; %.2f s\n", r->counts.samples,
          (double)r->counts.samples / ((double)c[2] * c[3]), r->seconds);
  if (r->events) print_events(out, r);
  fprintf(out, "wrote %s%s%s\n", r->exr, r->png ? " and " : "", r->png ? r->png : "");
}
