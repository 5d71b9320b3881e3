#include "golden/golden.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

const char *const sf_plane_names[SF_PLANES] = {
    [SF_PLANE_R] = "R",
    [SF_PLANE_G] = "G",
    [SF_PLANE_B] = "B",
    [SF_PLANE_A] = "A",
    [SF_PLANE_Z] = "Z",
    [SF_PLANE_SAMPLES] = "samples",
    [SF_PLANE_SPIKES] = "spikes",
    [SF_PLANE_SOPS] = "sops",
    [SF_PLANE_MACS] = "macs",
    [SF_PLANE_FX_R] = "fx.R",
    [SF_PLANE_FX_G] = "fx.G",
    [SF_PLANE_FX_B] = "fx.B",
    [SF_PLANE_FX_A] = "fx.A",
    [SF_PLANE_FX_T] = "fx.T",
    [SF_PLANE_FX_ZHI] = "fx.Zhi",
    [SF_PLANE_FX_ZLO] = "fx.Zlo",
    [SF_PLANE_ENERGY] = "energy_fJ",
};

bool sf_plane_is_integer(sf_plane plane)
{
  return plane >= SF_PLANE_SAMPLES && plane != SF_PLANE_ENERGY;
}

sf_status sf_golden_create(sf_golden *golden, int width, int height, int count)
{
  *golden = (sf_golden){.width = width, .height = height, .planes = count};
  for (int p = 0; p < count; p++) {
    golden->plane[p] = calloc((size_t)width * (size_t)height, 4);
    if (golden->plane[p]) continue;
    sf_golden_free(golden);
    return sf_fail(SF_E_MEMORY, "no memory for an image of %d x %d", width, height);
  }
  return sf_ok();
}

void sf_golden_free(sf_golden *golden)
{
  for (int p = 0; p < SF_PLANES; p++) free(golden->plane[p]);
  *golden = (sf_golden){0};
}

double sf_golden_step_length(const sf_golden_job *job)
{
  return job->scene->step_q24 / 16777216.0 / job->scene->units.to_box_scale / (double)job->data->scale;
}

sf_status sf_golden_stopped(const sf_golden_job *job)
{
  return sf_fail(SF_E_STOPPED, "stopped in view %s", job->view->name);
}

static uint32_t to_u32(uint64_t value)
{
  return value > UINT32_MAX ? UINT32_MAX : (uint32_t)value;
}

void sf_golden_set(sf_golden *golden, size_t i, const fx_pixel *pixel, const fx_cost *cost, double step_length)
{
  uint32_t rgba[4];
  fx_pixel_rgba(pixel, rgba);
  for (int c = 0; c < 4; c++) {
    sf_golden_real(golden, SF_PLANE_R + c)[i] = (float)rgba[c] / 65535;
    sf_golden_int(golden, SF_PLANE_FX_R + c)[i] = rgba[c];
  }
  sf_golden_int(golden, SF_PLANE_FX_T)[i] = pixel->transmittance;
  sf_golden_int(golden, SF_PLANE_FX_ZHI)[i] = (uint32_t)(pixel->depth >> 32);
  sf_golden_int(golden, SF_PLANE_FX_ZLO)[i] = (uint32_t)pixel->depth;
  double steps = pixel->weight_sum ? (double)pixel->depth / (double)pixel->weight_sum / 65536 : 0;
  sf_golden_real(golden, SF_PLANE_Z)[i] = (float)(steps * step_length);
  sf_golden_int(golden, SF_PLANE_SAMPLES)[i] = pixel->samples;
  sf_golden_int(golden, SF_PLANE_MACS)[i] = to_u32(cost->macs);
  sf_golden_int(golden, SF_PLANE_SOPS)[i] = to_u32(cost->sops);
  sf_golden_int(golden, SF_PLANE_SPIKES)[i] = to_u32(cost->spikes);
  sf_golden_real(golden, SF_PLANE_ENERGY)[i] = (float)sf_cost_fj(cost);
}

sf_status sf_golden_save(const sf_golden *golden, const char *path, const char *const *attributes)
{
  sf_exr_channel channel[SF_PLANES] = {0};
  for (int p = 0; p < golden->planes; p++) {
    snprintf(channel[p].name, sizeof channel[p].name, "%s", sf_plane_names[p]);
    channel[p].type = sf_plane_is_integer((sf_plane)p) ? SF_EXR_UINT : SF_EXR_FLOAT;
    channel[p].data = golden->plane[p];
  }
  return sf_exr_save(path, golden->width, golden->height, channel, golden->planes, attributes);
}

static uint16_t to_u16(float value)
{
  return value > 0 ? (uint16_t)((value < 1 ? value : 1) * 65535 + 0.5f) : 0; /* NaN is black */
}

sf_status sf_golden_save_png(const sf_golden *golden, const char *path)
{
  size_t n = (size_t)golden->width * (size_t)golden->height;
  sf_image image = {golden->width, golden->height, malloc(n * 4 * sizeof(uint16_t))};
  if (!image.rgba) return sf_fail(SF_E_MEMORY, "%s: no memory for the picture", path);
  for (size_t i = 0; i < n; i++) {
    for (int c = 0; c < 3; c++) image.rgba[4 * i + (size_t)c] = to_u16(sf_golden_real(golden, SF_PLANE_R + c)[i]);
    image.rgba[4 * i + 3] = 65535;
  }
  sf_status status = sf_image_save_png(&image, path);
  free(image.rgba);
  return status;
}

/* Interleaved RGB of the rendering and of the picture's window. */
static void interleave(const sf_golden *golden, const sf_image *picture, int x0, int y0, const float background[3],
                       float *ours, float *theirs)
{
  for (int y = 0; y < golden->height; y++)
    for (int x = 0; x < golden->width; x++) {
      size_t i = (size_t)y * (size_t)golden->width + (size_t)x;
      const uint16_t *p = picture->rgba + 4 * ((size_t)(y0 + y) * (size_t)picture->width + (size_t)(x0 + x));
      float alpha = (float)p[3] / 65535;
      for (int c = 0; c < 3; c++) {
        ours[3 * i + (size_t)c] = sf_golden_real(golden, SF_PLANE_R + c)[i];
        theirs[3 * i + (size_t)c] = (float)p[c] / 65535 * alpha + background[c] * (1 - alpha);
      }
    }
}

/* Opaque, from interleaved RGB. */
static sf_status save_rgb(const float *rgb, int width, int height, const char *path)
{
  const size_t n = (size_t)width * (size_t)height;
  sf_image image = {width, height, malloc(n * 4 * sizeof(uint16_t))};
  if (!image.rgba) return sf_fail(SF_E_MEMORY, "%s: no memory for the picture", path);
  for (size_t i = 0; i < n; i++)
    for (size_t c = 0; c < 4; c++) image.rgba[4 * i + c] = c < 3 ? to_u16(rgb[3 * i + c]) : 65535;
  const sf_status status = sf_image_save_png(&image, path);
  free(image.rgba);
  return status;
}

sf_status sf_golden_save_truth(const sf_golden *golden, const sf_image *picture, int x, int y,
                               const float background[3], const char *path)
{
  const size_t n = (size_t)golden->width * (size_t)golden->height * 3;
  float *pair = malloc(2 * n * sizeof *pair);
  if (!pair) return sf_fail(SF_E_MEMORY, "%s: no memory for the picture", path);
  interleave(golden, picture, x, y, background, pair, pair + n);
  const sf_status status = save_rgb(pair + n, golden->width, golden->height, path);
  free(pair);
  return status;
}

sf_status sf_golden_quality(const sf_golden *golden, const sf_image *picture, int x, int y, const float background[3],
                            double *psnr, double *ssim)
{
  if (x < 0 || y < 0 || x + golden->width > picture->width || y + golden->height > picture->height)
    return sf_fail(SF_E_RANGE, "window %d,%d,%d,%d is outside the picture of %d x %d", x, y, golden->width,
                   golden->height, picture->width, picture->height);
  size_t n = (size_t)golden->width * (size_t)golden->height * 3;
  float *pair = malloc(2 * n * sizeof *pair);
  if (!pair) return sf_fail(SF_E_MEMORY, "no memory to compare %d x %d pixels", golden->width, golden->height);
  interleave(golden, picture, x, y, background, pair, pair + n);
  *psnr = sf_psnr(pair, pair + n, n);
  *ssim = golden->width < 11 || golden->height < 11 ? (double)NAN
                                                    : sf_ssim(pair, pair + n, golden->width, golden->height, 3);
  free(pair);
  return sf_ok();
}
