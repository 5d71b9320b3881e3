/* Images: PNG and JPEG in, PNG and multi-channel EXR out, PSNR and SSIM. */
#ifndef SF_IMAGE_IMAGE_H
#define SF_IMAGE_IMAGE_H
#include "base/status.h"
#include <stddef.h>
#include <stdint.h>

/* Interleaved RGBA, straight alpha, row 0 at the top, 65535 = 1.0. */
typedef struct sf_image {
  int width, height;
  uint16_t *rgba; /* [height][width][4], owned */
} sf_image;

/* PNG of 8 or 16 bits, grey, palette, RGB or RGBA; JPEG. No alpha in the file: alpha = 65535. */
sf_status sf_image_load(sf_image *image, const char *path);
/* 8-bit RGBA PNG; written aside, then renamed. */
sf_status sf_image_save_png(const sf_image *image, const char *path);
/* PNG in memory, *data malloc'ed. pixel: [height][width] RGB, or with a palette of `colours` RGBA entries their
 * indices. */
sf_status sf_png_encode(const uint8_t *pixel, int width, int height, const uint8_t *palette, int colours, void **data,
                        size_t *size);
/* Box filter by an integer factor >= 1, alpha-weighted. Columns on the right and rows at the bottom that fill no whole
 * box are left out, so that pixel (x, y) lies where factor x, factor y did. */
sf_status sf_image_downscale(sf_image *image, int factor, const char *name);
void sf_image_free(sf_image *image);

/* Words on a picture, from their top left corner; what lies outside is left out. A dot of a character is size x size
 * pixels, a character 6 dots wide and 8 high. Others than ASCII are shown as '?'. */
enum { SF_TEXT_ADVANCE = 6, SF_TEXT_HEIGHT = 8 };
void sf_image_text(sf_image *image, int x, int y, int size, const uint8_t colour[3], const char *text);
int sf_image_text_width(const char *text, int size); /* pixels */

/* a, b: [n] of any range with peak 1. */
double sf_psnr(const float *a, const float *b, size_t n);
/* Mean SSIM, Wang et al. 2004: 11x11 Gaussian, sigma 1.5, data range 1, valid windows only, mean over channels.
 * a, b: [height][width][channels]; both sides >= 11. */
double sf_ssim(const float *a, const float *b, int width, int height, int channels);

typedef enum { SF_EXR_HALF, SF_EXR_FLOAT, SF_EXR_UINT } sf_exr_type;
typedef struct sf_exr_channel {
  char name[32];
  sf_exr_type type; /* on file; HALF and FLOAT are float in memory */
  void *data;       /* [height][width] float or uint32_t */
} sf_exr_channel;
/* Scanline EXR, ZIP. attributes: NULL-terminated pairs key, value (strings), or NULL. Written aside, then renamed. */
sf_status sf_exr_save(const char *path, int width, int height, const sf_exr_channel *channels, int n,
                      const char *const *attributes);
/* Reads every channel; data owned by the caller (free each). *channels is allocated. */
sf_status sf_exr_load(const char *path, int *width, int *height, sf_exr_channel **channels, int *n);
void sf_exr_free(sf_exr_channel *channels, int n);
#endif
