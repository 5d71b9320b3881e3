#include "golden/golden.h"
#include <inttypes.h>
#include <math.h>

static void add_events(cJSON *json, const sf_render_report *r)
{
  char unexpected[64];
  cJSON_AddItemToObject(json, "counts", sf_counts_json(r->net, &r->golden->counts));
  sf_json_add_u64(json, "energy_fj", sf_energy_fj(&r->golden->counts));
  cJSON *samples = cJSON_AddObjectToObject(json, "saturated_samples");
  for (int l = 0; l < SF_LAYERS; l++)
    sf_json_add_u64(samples, fx_layer_name(l), r->golden->counts.saturated_samples[l]);
  sf_saturation_unexpected(r->net, r->golden->counts.saturated_samples, unexpected, sizeof unexpected);
  cJSON_AddStringToObject(json, "unexpected_saturation", unexpected);
}

cJSON *sf_render_report_json(const sf_render_report *r)
{
  const sf_window *c = &r->crop;
  cJSON *json = cJSON_CreateObject();
  cJSON_AddStringToObject(json, "backend", r->backend);
  sf_json_add_text(json, "scene", r->scene);
  cJSON_AddStringToObject(json, "scene_sha256", r->sha256);
  sf_json_add_text(json, "view", r->view);
  cJSON_AddNumberToObject(json, "t_r", r->net->steps);
  cJSON_AddItemToObject(json, "crop", cJSON_CreateIntArray((const int[4]){c->x, c->y, c->width, c->height}, 4));
  sf_json_add_real(json, "psnr", r->psnr);
  sf_json_add_real(json, "ssim", r->ssim);
  sf_json_add_u64(json, "samples", r->golden->counts.samples);
  sf_json_add_u64(json, "rays", r->golden->counts.rays);
  if (r->events) add_events(json, r);
  sf_json_add_real(json, "seconds", r->seconds);
  sf_json_add_text(json, "exr", r->exr);
  if (r->png) sf_json_add_text(json, "png", r->png);
  return json;
}

static void print_events(FILE *out, const sf_render_report *r)
{
  char text[256], unexpected[64];
  fprintf(out, "%" PRIu64 " MAC, %" PRIu64 " SOP, %" PRIu64 " spikes, %" PRIu64 " fJ\n",
          sf_event_total(&r->golden->counts, SF_EVENT_MAC), sf_event_total(&r->golden->counts, SF_EVENT_SOP),
          sf_event_total(&r->golden->counts, SF_EVENT_SPIKES), sf_energy_fj(&r->golden->counts));
  sf_saturation_census(r->golden->counts.saturated_samples, r->golden->counts.saturated_features, text, sizeof text);
  fprintf(out, "saturation: %s\n", text);
  if (sf_saturation_unexpected(r->net, r->golden->counts.saturated_samples, unexpected, sizeof unexpected))
    fprintf(out,
            "UNEXPECTED saturation in %s: this mode's state cannot leave its range; do not use the image as golden\n",
            unexpected);
}

void sf_render_report_print(FILE *out, const sf_render_report *r)
{
  const sf_window *c = &r->crop;
  fprintf(out, "view %s, %d x %d at (%d, %d)%s, t_r = %d, %s\n", r->view, c->width, c->height, c->x, c->y,
          r->crop_chosen ? " (the centre: --crop was not given)" : "", r->net->steps, r->backend);
  if (isnan(r->psnr))
    fprintf(out, "no picture to compare with\n");
  else if (isnan(r->ssim))
    fprintf(out, "PSNR %.2f dB; SSIM needs 11 x 11 pixels\n", r->psnr);
  else
    fprintf(out, "PSNR %.2f dB, SSIM %.4f\n", r->psnr, r->ssim);
  fprintf(out, "%" PRIu64 " samples, %.2f per pixel; %.2f s\n", r->golden->counts.samples,
          (double)r->golden->counts.samples / ((double)c->width * c->height), r->seconds);
  if (r->events) print_events(out, r);
  fprintf(out, "wrote %s%s%s\n", r->exr, r->png ? " and " : "", r->png ? r->png : "");
}
