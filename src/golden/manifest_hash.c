/* Canonical bytes: least significant first, whatever the machine. */
#include "golden/manifest.h"
#include "base/sha256.h"
#include <stdlib.h>
#include <string.h>

static uint8_t *put(uint8_t *to, uint64_t value, int bytes)
{
  for (int i = 0; i < bytes; i++) *to++ = (uint8_t)(value >> (8 * i));
  return to;
}

static sf_status hash_plane(const uint32_t *plane, size_t n, char hex[65])
{
  uint8_t *bytes = malloc(4 * n), *to = bytes;
  if (!bytes) return sf_fail(SF_E_MEMORY, "no memory to hash %zu pixels", n);
  for (size_t i = 0; i < n; i++) to = put(to, plane[i], 4);
  sf_sha256(bytes, 4 * n, hex);
  free(bytes);
  return sf_ok();
}

static void hash_counts(const fx_net *net, const fx_counts *c, char hex[65])
{
  uint8_t bytes[8 * (SF_LAYERS * SF_EVENTS * SF_T_MAX + 4 + 2 * SF_LAYERS + 3)], *to = bytes;
  for (int l = 0; l < SF_LAYERS; l++)
    for (int e = 0; e < SF_EVENTS; e++)
      for (int t = 0; t < net->steps; t++) to = put(to, c->layer[l].event[e][t], 8);
  to = put(to, c->samples, 8), to = put(to, c->rays, 8);
  to = put(to, c->grid_bytes, 8), to = put(to, c->march_steps, 8);
  for (int l = 0; l < SF_LAYERS; l++) to = put(to, c->saturated[l], 8);
  for (int l = 0; l < SF_LAYERS; l++) to = put(to, c->saturated_samples[l], 8);
  to = put(to, c->saturated_features, 8);
  if (c->field_samples || c->field_mac) to = put(to, c->field_samples, 8), to = put(to, c->field_mac, 8);
  sf_sha256(bytes, (size_t)(to - bytes), hex);
}

static uint8_t *put_real(uint8_t *to, float value)
{
  uint32_t bits;
  memcpy(&bits, &value, sizeof bits);
  return put(to, bits, 4);
}

void sf_manifest_hash_camera(const sf_camera *camera, char hex[65])
{
  const float lens[4] = {camera->k1, camera->k2, camera->p1, camera->p2};
  uint8_t bytes[4 * (2 + 4 + 12 + 4)], *to = bytes;
  to = put(to, (uint64_t)camera->width, 4), to = put(to, (uint64_t)camera->height, 4);
  to = put_real(to, camera->fx), to = put_real(to, camera->fy);
  to = put_real(to, camera->cx), to = put_real(to, camera->cy);
  for (int i = 0; i < 12; i++) to = put_real(to, camera->to_world[i]);
  const bool pinhole = lens[0] == 0 && lens[1] == 0 && lens[2] == 0 && lens[3] == 0;
  for (int i = 0; i < 4 && !pinhole; i++) to = put_real(to, lens[i]);
  sf_sha256(bytes, (size_t)(to - bytes), hex);
}

sf_status sf_manifest_describe(sf_manifest_view *view, const fx_net *net, const sf_camera *camera,
                               const sf_golden *golden)
{
  view->width = golden->width, view->height = golden->height;
  view->samples = golden->counts.samples, view->rays = golden->counts.rays;
  sf_manifest_hash_camera(camera, view->camera_sha256);
  if (golden->planes == SF_FLOAT_PLANES) return sf_ok();
  for (int p = 0; p < SF_PLANES; p++)
    if (sf_plane_is_integer((sf_plane)p))
      SF_TRY(hash_plane(golden->plane[p], (size_t)golden->width * (size_t)golden->height, view->plane_sha256[p]));
  for (int e = 0; e < SF_EVENTS; e++) view->event[e] = sf_event_total(&golden->counts, e);
  hash_counts(net, &golden->counts, view->counts_sha256);
  sf_saturation_unexpected(net, golden->counts.saturated_samples, view->unexpected_saturation,
                           sizeof view->unexpected_saturation);
  return sf_ok();
}

/* ---- the planes of a file ---- */

static sf_status compare_plane(const sf_golden *golden, int p, const sf_exr_channel *channels, int n, const char *path)
{
  const uint32_t *here = golden->plane[p], *there = NULL;
  for (int i = 0; i < n; i++)
    if (!strcmp(channels[i].name, sf_plane_names[p]) && channels[i].type == SF_EXR_UINT) there = channels[i].data;
  if (!there) return sf_fail(SF_E_DIFFERENCE, "%s: no integer channel %s", path, sf_plane_names[p]);
  for (int y = 0; y < golden->height; y++)
    for (int x = 0; x < golden->width; x++) {
      size_t i = (size_t)y * (size_t)golden->width + (size_t)x;
      if (here[i] != there[i])
        return sf_fail(SF_E_DIFFERENCE, "%s: plane %s, pixel (%d, %d) is %u, here it is %u", path, sf_plane_names[p], x,
                       y, there[i], here[i]);
    }
  return sf_ok();
}

sf_status sf_golden_compare_file(const sf_golden *golden, const char *path, int plane)
{
  sf_exr_channel *channels;
  int width, height, n;
  SF_TRY(sf_exr_load(path, &width, &height, &channels, &n));
  sf_status status = sf_ok();
  if (width != golden->width || height != golden->height)
    status = sf_fail(SF_E_DIFFERENCE, "%s: %d x %d pixels, here it has %d x %d", path, width, height, golden->width,
                     golden->height);
  for (int p = 0; p < golden->planes && status.code == SF_OK; p++)
    if (sf_plane_is_integer((sf_plane)p) && (plane < 0 || p == plane))
      status = compare_plane(golden, p, channels, n, path);
  sf_exr_free(channels, n);
  return status;
}
