/* PNG: every kind of file, rounding, damage, sizes that no file has. */
#include "ck_run.h"
#include "image/image.h"
#include "base/io.h"
#include "base/rng.h"
#include "tests/image_fixture.h"
#include <math.h>
#include <png.h>

enum { W = 13, H = 9 };

/* One kind of PNG: how it is stored, and how a stored sample becomes RGBA. */
typedef struct kind {
  int depth, colour, interlace, transparent;
} kind;
static const kind kinds[] = {
    {1, PNG_COLOR_TYPE_GRAY, 0, 0},       {2, PNG_COLOR_TYPE_GRAY, 1, 0},       {4, PNG_COLOR_TYPE_GRAY, 0, 1},
    {8, PNG_COLOR_TYPE_GRAY, 0, 0},       {8, PNG_COLOR_TYPE_GRAY, 1, 1},       {16, PNG_COLOR_TYPE_GRAY, 0, 0},
    {16, PNG_COLOR_TYPE_GRAY, 1, 1},      {8, PNG_COLOR_TYPE_GRAY_ALPHA, 0, 0}, {16, PNG_COLOR_TYPE_GRAY_ALPHA, 1, 0},
    {8, PNG_COLOR_TYPE_RGB, 0, 0},        {8, PNG_COLOR_TYPE_RGB, 1, 1},        {16, PNG_COLOR_TYPE_RGB, 0, 0},
    {16, PNG_COLOR_TYPE_RGB, 1, 1},       {8, PNG_COLOR_TYPE_RGB_ALPHA, 0, 0},  {8, PNG_COLOR_TYPE_RGB_ALPHA, 1, 0},
    {16, PNG_COLOR_TYPE_RGB_ALPHA, 0, 0}, {16, PNG_COLOR_TYPE_RGB_ALPHA, 1, 0}, {1, PNG_COLOR_TYPE_PALETTE, 0, 0},
    {4, PNG_COLOR_TYPE_PALETTE, 1, 1},    {8, PNG_COLOR_TYPE_PALETTE, 0, 1},
};

static int channels_of(int colour)
{
  if (colour == PNG_COLOR_TYPE_GRAY || colour == PNG_COLOR_TYPE_PALETTE) return 1;
  return colour == PNG_COLOR_TYPE_GRAY_ALPHA ? 2 : colour == PNG_COLOR_TYPE_RGB ? 3 : 4;
}

static unsigned sample(const kind *k, int x, int y, int c)
{
  return (unsigned)(sf_random_u64(5, (uint64_t)c, (uint64_t)(y * W + x)) >> 40) & ((1u << k->depth) - 1);
}

/* Palette entry i, alpha last. */
static unsigned palette(int i, int c)
{
  return (unsigned)(i * 53 + c * 97 + 11) & 255;
}

static void put_png(const char *path, const kind *k)
{
  FILE *f = fopen(path, "wb");
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
  png_infop info = png_create_info_struct(png);
  ck_assert(!setjmp(png_jmpbuf(png)));
  png_init_io(png, f);
  png_set_IHDR(png, info, W, H, k->depth, k->colour, k->interlace ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE, 0, 0);
  if (k->colour == PNG_COLOR_TYPE_PALETTE) {
    png_color colours[256];
    png_byte alpha[256];
    int n = 1 << k->depth;
    for (int i = 0; i < n; i++) {
      colours[i].red = (png_byte)palette(i, 0), colours[i].green = (png_byte)palette(i, 1);
      colours[i].blue = (png_byte)palette(i, 2), alpha[i] = (png_byte)palette(i, 3);
    }
    png_set_PLTE(png, info, colours, n);
    if (k->transparent) png_set_tRNS(png, info, alpha, n, NULL);
  } else if (k->transparent) {
    png_color_16 key = {0};
    key.gray = key.red = (png_uint_16)sample(k, 3, 2, 0);
    key.green = (png_uint_16)sample(k, 3, 2, 1), key.blue = (png_uint_16)sample(k, 3, 2, 2);
    png_set_tRNS(png, info, NULL, 0, &key);
  }
  png_write_info(png, info);
  if (k->depth < 8) png_set_packing(png);
  int channels = channels_of(k->colour), bytes = k->depth == 16 ? 2 : 1;
  png_byte data[H][W * 8], *rows[H];
  for (int y = 0; y < H; y++) {
    rows[y] = data[y];
    for (int x = 0; x < W; x++) {
      for (int c = 0; c < channels; c++) {
        unsigned v = sample(k, x, y, c);
        png_byte *p = data[y] + (x * channels + c) * bytes;
        if (bytes == 2) *p++ = (png_byte)(v >> 8);
        *p = (png_byte)v;
      }
    }
  }
  png_write_image(png, rows);
  png_write_end(png, NULL);
  png_destroy_write_struct(&png, &info);
  fclose(f);
}

static void expected_rgba(const kind *k, int x, int y, unsigned out[4])
{
  unsigned full = 65535 / ((1u << k->depth) - 1), v[4];
  int channels = channels_of(k->colour);
  for (int c = 0; c < channels; c++) v[c] = sample(k, x, y, c);
  if (k->colour == PNG_COLOR_TYPE_PALETTE) {
    for (int c = 0; c < 4; c++) out[c] = palette((int)v[0], c) * 257;
    if (!k->transparent) out[3] = 65535;
    return;
  }
  bool grey = channels < 3, key = k->transparent;
  for (int c = 0; c < 3; c++) out[c] = v[grey ? 0 : c] * full;
  out[3] = channels == 2 ? v[1] * full : channels == 4 ? v[3] * full : 65535;
  for (int c = 0; c < channels && key; c++) key = v[c] == sample(k, 3, 2, c);
  if (key) out[3] = 0;
}

LOOP_TEST(png_kinds, COUNT(kinds))
{
  OWNED(sf_image) image;
  const kind *k = &kinds[_i];
  put_png(in("a.png"), k);
  ck_ok(sf_image_load(&image, in("a.png")));
  ck_assert_int_eq(image.width, W);
  ck_assert_int_eq(image.height, H);
  for (int y = 0; y < H; y++) {
    for (int x = 0; x < W; x++) {
      unsigned e[4];
      expected_rgba(k, x, y, e);
      for (int c = 0; c < 4; c++) ck_assert_uint_eq(image.rgba[(y * W + x) * 4 + c], e[c]);
    }
  }
}

TEST(png_round_trip_rounds_to_nearest)
{
  OWNED(sf_image) a = noise_image(31, 17), b;
  a.rgba[0] = 65535, a.rgba[1] = 128, a.rgba[2] = 129, a.rgba[3] = 0;
  ck_ok(sf_image_save_png(&a, in("a.png")));
  ck_ok(sf_image_load(&b, in("a.png")));
  ck_assert_int_eq(b.width, 31);
  ck_assert_int_eq(b.height, 17);
  for (int i = 0; i < 31 * 17 * 4; i++) ck_assert_uint_eq(b.rgba[i], (unsigned)lrint(a.rgba[i] / 257.0) * 257);
  ck_assert_uint_eq(b.rgba[1], 0);
  ck_assert_uint_eq(b.rgba[2], 257);
}

TEST(png_damage)
{
  sf_image a = noise_image(7, 5);
  ck_ok(sf_image_save_png(&a, in("a.png")));
  sf_image_free(&a);
  ck_damage(in("a.png"), load_image, true);
}

static void put_be(unsigned char *p, uint32_t v)
{
  for (int i = 0; i < 4; i++) p[i] = (unsigned char)(v >> (24 - 8 * i));
}

TEST(image_faults)
{
  sf_image image;
  ck_bad(sf_image_load(&image, in("none.png")), SF_E_IO, "none.png", "No such file");
  ck_ok(sf_write_file(in("text.png"), "hello", 5));
  ck_bad(sf_image_load(&image, in("text.png")), SF_E_FORMAT, "text.png", "neither");
  ck_ok(sf_write_file(in("empty.png"), "", 0));
  ck_bad(sf_image_load(&image, in("empty.png")), SF_E_FORMAT, "empty.png", "empty");
  ck_bad(sf_image_load(&image, folder), SF_E_IO, folder, "folder");
  image = (sf_image){0, 3, NULL};
  ck_bad(sf_image_save_png(&image, in("x.png")), SF_E_RANGE, "x.png", "0 x 3");
}

/* A header that promises 40000 x 40000 pixels is refused before memory is asked for, also in a file large enough. */
TEST(absurd_size_is_refused)
{
  unsigned char f[33] = {0x89, 'P', 'N', 'G', 13, 10, 26, 10, 0, 0, 0, 13, 'I', 'H', 'D', 'R'};
  sf_image image;
  put_be(f + 16, 40000);
  put_be(f + 20, 40000);
  f[24] = 8, f[25] = 6;
  uint32_t crc = 0xffffffffu;
  for (int i = 12; i < 29; i++) {
    crc ^= f[i];
    for (int b = 0; b < 8; b++) crc = crc & 1 ? (crc >> 1) ^ 0xedb88320u : crc >> 1;
  }
  put_be(f + 29, ~crc);
  const size_t enough = (size_t)6 << 20;
  char *file = calloc(1, enough);
  memcpy(file, f, 33);
  memcpy(file + 33, "\0\0\0\0IDAT\x35\xaf\x06\x1e", 12);
  ck_ok(sf_write_file(in("big.png"), file, 45));
  ck_bad(sf_image_load(&image, in("big.png")), SF_E_FORMAT, "big.png", "45 bytes cannot hold 40000 x 40000");
  ck_ok(sf_write_file(in("big.png"), file, enough));
  ck_bad(sf_image_load(&image, in("big.png")), SF_E_RANGE, "big.png", "40000 x 40000");
  free(file);
}

ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};
