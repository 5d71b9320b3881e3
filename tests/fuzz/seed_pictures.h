/* Pictures among the first inputs of the fuzzing targets: PNG, JPEG and OpenEXR of several kinds. */
#ifndef SF_TESTS_FUZZ_SEED_PICTURES_H
#define SF_TESTS_FUZZ_SEED_PICTURES_H
#include "seeds.h"
#include <png.h>
#include <jpeglib.h>

static void put_png(const char *name, int depth, int colour, int interlace)
{
  FILE *file = fopen(seed_path("image", name), "wb");
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
  png_infop info = png_create_info_struct(png);
  png_color palette[4] = {{0, 0, 0}, {255, 0, 0}, {0, 255, 0}, {9, 8, 7}};
  png_byte alpha[2] = {0, 128}, row[6 * 8], *rows[4];
  for (size_t i = 0; i < sizeof row; i++) row[i] = (png_byte)(i * 53);
  for (int y = 0; y < 4; y++) rows[y] = row; /* even sizes: the target halves them */
  FUZZ_EXPECT(file && info && !setjmp(png_jmpbuf(png)));
  png_init_io(png, file);
  png_set_IHDR(png, info, 6, 4, depth, colour, interlace, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  if (colour == PNG_COLOR_TYPE_PALETTE) {
    png_set_PLTE(png, info, palette, 4);
    png_set_tRNS(png, info, alpha, 2, NULL);
  }
  png_write_info(png, info);
  png_write_image(png, rows);
  png_write_end(png, info);
  png_destroy_write_struct(&png, &info);
  FUZZ_EXPECT(!fclose(file));
}

static void put_jpeg(const char *name, int components, bool progressive)
{
  struct jpeg_error_mgr errors;
  struct jpeg_compress_struct codec = {.err = jpeg_std_error(&errors)};
  FILE *file = fopen(seed_path("image", name), "wb");
  JSAMPLE line[18 * 3], *rows[1] = {line};
  FUZZ_EXPECT(file);
  jpeg_create_compress(&codec);
  jpeg_stdio_dest(&codec, file);
  codec.image_width = 18, codec.image_height = 18, codec.input_components = components;
  codec.in_color_space = components == 1 ? JCS_GRAYSCALE : JCS_RGB;
  jpeg_set_defaults(&codec);
  if (progressive) jpeg_simple_progression(&codec);
  codec.restart_interval = progressive ? 0 : 2;
  jpeg_start_compress(&codec, TRUE);
  for (int y = 0; y < 18; y++) {
    for (size_t i = 0; i < sizeof line; i++) line[i] = (JSAMPLE)(i * 31 + (size_t)y * 17);
    jpeg_write_scanlines(&codec, rows, 1);
  }
  jpeg_finish_compress(&codec);
  jpeg_destroy_compress(&codec);
  FUZZ_EXPECT(!fclose(file));
}

static inline void put_pictures(void)
{
  put_png("palette.png", 2, PNG_COLOR_TYPE_PALETTE, PNG_INTERLACE_NONE);
  put_png("grey16.png", 16, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_ADAM7);
  put_png("rgba.png", 8, PNG_COLOR_TYPE_RGB_ALPHA, PNG_INTERLACE_NONE);
  put_jpeg("grey.jpg", 1, false);
  put_jpeg("colour.jpg", 3, false);
  put_jpeg("progressive.jpg", 3, true);
}

static inline void put_exr(void)
{
  float real[20];
  uint32_t whole[20];
  for (int i = 0; i < 20; i++) real[i] = (float)i / 7, whole[i] = (uint32_t)i * 99991;
  const sf_exr_channel channel[] = {
      {"R", SF_EXR_HALF, real}, {"Z", SF_EXR_FLOAT, real}, {"samples", SF_EXR_UINT, whole}};
  const char *const attributes[] = {"scene", "a.snn", NULL};
  FUZZ_EXPECT(fuzz_good(sf_exr_save(seed_path("exr", "three.exr"), 5, 4, channel, 3, attributes)));
  FUZZ_EXPECT(fuzz_good(sf_exr_save(seed_path("exr", "one.exr"), 1, 20, channel + 1, 1, NULL)));
}
#endif
