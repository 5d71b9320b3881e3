#include "golden/manifest.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

void sf_manifest_free(sf_manifest *manifest)
{
  free(manifest->view);
  *manifest = (sf_manifest){0};
}

/* What a file keeps, so that means do not depend on whether views were read back. */
static double rounded(double value)
{
  char text[64];
  snprintf(text, sizeof text, "%.4f", value);
  return isfinite(value) ? strtod(text, NULL) : (double)NAN;
}

sf_status sf_manifest_put(sf_manifest *manifest, const sf_manifest_view *view)
{
  int at = 0;
  while (at < manifest->count && manifest->view[at].index < view->index) at++;
  if (at == manifest->count || manifest->view[at].index != view->index) {
    sf_manifest_view *list = realloc(manifest->view, (size_t)(manifest->count + 1) * sizeof *list);
    if (!list) return sf_fail(SF_E_MEMORY, "no memory for a manifest of %d views", manifest->count + 1);
    manifest->view = list;
    memmove(list + at + 1, list + at, (size_t)(manifest->count++ - at) * sizeof *list);
  }
  manifest->view[at] = *view;
  manifest->view[at].psnr = rounded(view->psnr);
  manifest->view[at].ssim = rounded(view->ssim);
  return sf_ok();
}

const sf_manifest_view *sf_manifest_find(const sf_manifest *manifest, int index)
{
  for (int i = 0; i < manifest->count; i++)
    if (manifest->view[i].index == index) return &manifest->view[i];
  return NULL;
}

/* ---- sums ---- */

uint64_t sf_manifest_energy_fj(const sf_manifest_view *view)
{
  fx_counts counts = {0};
  counts.layer[0].mac[0] = view->event[SF_EVENT_MAC];
  counts.layer[0].sop[0] = view->event[SF_EVENT_SOP];
  return sf_energy_fj(&counts);
}

static uint64_t add(uint64_t a, uint64_t b)
{
  return a > UINT64_MAX - b ? UINT64_MAX : a + b;
}

void sf_manifest_sums(const sf_manifest *manifest, sf_manifest_sum *sum)
{
  *sum = (sf_manifest_sum){0};
  for (int i = 0; i < manifest->count; i++) {
    const sf_manifest_view *v = &manifest->view[i];
    sum->samples = add(sum->samples, v->samples), sum->rays = add(sum->rays, v->rays);
    for (int e = 0; e < SF_EVENTS; e++) sum->event[e] = add(sum->event[e], v->event[e]);
    sum->energy_fj = add(sum->energy_fj, sf_manifest_energy_fj(v));
    sum->pixels += (uint64_t)v->width * (uint64_t)v->height;
    sum->psnr += v->psnr / manifest->count, sum->ssim += v->ssim / manifest->count;
  }
  if (manifest->count == 0) sum->psnr = sum->ssim = NAN;
}

/* ---- comparison ---- */

static sf_status same_text(const char *field, const char *wanted, const char *here)
{
  if (!strcmp(wanted, here)) return sf_ok();
  return sf_fail(SF_E_DIFFERENCE, "%s is %.64s, here it is %.64s", field, *wanted ? wanted : "absent",
                 *here ? here : "absent");
}

static sf_status same_number(const char *field, uint64_t wanted, uint64_t here)
{
  if (wanted == here) return sf_ok();
  return sf_fail(SF_E_DIFFERENCE, "%s is %" PRIu64 ", here it is %" PRIu64, field, wanted, here);
}

static void crop_text(const sf_window *crop, char text[64])
{
  if (crop->width == 0)
    snprintf(text, 64, "the whole view");
  else
    snprintf(text, 64, "%d,%d,%d,%d", crop->x, crop->y, crop->width, crop->height);
}

sf_status sf_manifest_same_origin(const sf_manifest_origin *wanted, const sf_manifest_origin *here)
{
  char a[64], b[64];
  SF_TRY(same_text("scene_sha256", wanted->scene_sha256, here->scene_sha256));
  SF_TRY(same_text("model_sha256", wanted->model_sha256, here->model_sha256));
  SF_TRY(same_text("split", wanted->split, here->split));
  SF_TRY(same_number("t_r", (uint64_t)wanted->steps, (uint64_t)here->steps));
  SF_TRY(same_number("downscale", (uint64_t)wanted->downscale, (uint64_t)here->downscale));
  if (wanted->scale != here->scale)
    return sf_fail(SF_E_DIFFERENCE, "scale is %.9g, here it is %.9g", (double)wanted->scale, (double)here->scale);
  crop_text(&wanted->crop, a), crop_text(&here->crop, b);
  return same_text("crop", a, b);
}

sf_status sf_manifest_same_camera(const sf_manifest_view *wanted, const char *name, const sf_camera *here)
{
  char hash[65];
  SF_TRY(same_text("name", wanted->name, name));
  sf_manifest_hash_camera(here, hash);
  return same_text("camera_sha256", wanted->camera_sha256, hash);
}

sf_status sf_manifest_same_view(const sf_manifest_view *wanted, const sf_manifest_view *here, int *plane)
{
  *plane = -1;
  SF_TRY(same_text("camera_sha256", wanted->camera_sha256, here->camera_sha256));
  SF_TRY(same_number("width", (uint64_t)wanted->width, (uint64_t)here->width));
  SF_TRY(same_number("height", (uint64_t)wanted->height, (uint64_t)here->height));
  for (int p = 0; p < SF_PLANES; p++) {
    char field[48];
    snprintf(field, sizeof field, "plane %s: SHA-256", sf_plane_names[p]);
    sf_status status = same_text(field, wanted->plane_sha256[p], here->plane_sha256[p]);
    if (status.code == SF_OK) continue;
    *plane = p;
    return status;
  }
  SF_TRY(same_number("samples", wanted->samples, here->samples));
  SF_TRY(same_number("rays", wanted->rays, here->rays));
  for (int e = 0; e < SF_EVENTS; e++) SF_TRY(same_number(sf_events[e].name, wanted->event[e], here->event[e]));
  SF_TRY(same_text("counts_sha256", wanted->counts_sha256, here->counts_sha256));
  return same_text("unexpected_saturation", wanted->unexpected_saturation, here->unexpected_saturation);
}
