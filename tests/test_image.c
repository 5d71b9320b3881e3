/* JPEG, EXR, downscaling, PSNR and SSIM; full disks. */
#include "ck_run.h"
#include "image/image.h"
#include "base/rng.h"
#include "tests/image_fixture.h"
#include <jpeglib.h>
#include <math.h>
#include <signal.h>
#include <sys/resource.h>

TEST(full_disk_leaves_nothing)
{
  OWNED(sf_image) a = noise_image(100, 100);
  struct rlimit limit = {10000, 10000};
  float *depth = calloc(200 * 200, sizeof *depth);
  for (int i = 0; i < 200 * 200; i++) depth[i] = sf_random_float(1, 1, (uint64_t)i);
  sf_exr_channel c = {"Z", SF_EXR_FLOAT, depth};
  signal(SIGXFSZ, SIG_IGN);
  ck_assert_int_eq(setrlimit(RLIMIT_FSIZE, &limit), 0);
  ck_bad(sf_image_save_png(&a, in("a.png")), SF_E_IO, "a.png", "large");
  ck_bad(sf_exr_save(in("a.exr"), 200, 200, &c, 1, NULL), SF_E_IO, "a.exr", "large");
  ck_assert_int_eq(entries(), 0);
  ck_bad(sf_image_save_png(&a, in("no/a.png")), SF_E_IO, "no/a.png", "No such file");
  ck_bad(sf_exr_save(in("no/a.exr"), 200, 200, &c, 1, NULL), SF_E_IO, "no/a.exr", "No such file");
  free(depth);
}

/* ---- JPEG ---- */

static void put_jpeg(const char *path, int width, int height, bool grey, bool progressive)
{
  struct jpeg_compress_struct c;
  struct jpeg_error_mgr e;
  FILE *f = fopen(path, "wb");
  c.err = jpeg_std_error(&e);
  jpeg_create_compress(&c);
  jpeg_stdio_dest(&c, f);
  c.image_width = (JDIMENSION)width, c.image_height = (JDIMENSION)height;
  c.input_components = grey ? 1 : 3, c.in_color_space = grey ? JCS_GRAYSCALE : JCS_RGB;
  jpeg_set_defaults(&c);
  jpeg_set_quality(&c, 100, TRUE);
  for (int i = 0; i < c.num_components; i++) c.comp_info[i].h_samp_factor = c.comp_info[i].v_samp_factor = 1;
  if (progressive) jpeg_simple_progression(&c);
  jpeg_start_compress(&c, TRUE);
  JSAMPLE line[3 * 64], *row = line;
  for (int y = 0; y < height; y++) {
    for (int x = 0; x < width; x++)
      for (int k = 0; k < c.input_components; k++)
        line[x * c.input_components + k] = (JSAMPLE)(k == 0 ? 4 * x : k == 1 ? 5 * y : 200 - 2 * x);
    jpeg_write_scanlines(&c, &row, 1);
  }
  jpeg_finish_compress(&c);
  jpeg_destroy_compress(&c);
  fclose(f);
}

static void put_scans(const char *path, int width, int height, const jpeg_scan_info *scan, int scans)
{
  struct jpeg_error_mgr e;
  struct jpeg_compress_struct c = {.err = jpeg_std_error(&e)};
  FILE *f = fopen(path, "wb");
  JSAMPLE line[64] = {0, 255, 7, 200}, *row = line;
  jpeg_create_compress(&c);
  jpeg_stdio_dest(&c, f);
  c.image_width = (JDIMENSION)width, c.image_height = (JDIMENSION)height;
  c.input_components = 1, c.in_color_space = JCS_GRAYSCALE;
  jpeg_set_defaults(&c);
  c.scan_info = scan, c.num_scans = scans;
  jpeg_start_compress(&c, TRUE);
  for (int y = 0; y < height; y++) jpeg_write_scanlines(&c, &row, 1);
  jpeg_finish_compress(&c);
  jpeg_destroy_compress(&c);
  fclose(f);
}

/* Quality 100 without chroma subsampling: rounding of the transform and the colour change stays within 3 of 255. */
LOOP_TEST(jpeg_values, 4)
{
  OWNED(sf_image) image;
  bool grey = _i & 1;
  put_jpeg(in("a.jpg"), 40, 24, grey, _i & 2);
  ck_ok(sf_image_load(&image, in("a.jpg")));
  ck_assert_int_eq(image.width, 40);
  ck_assert_int_eq(image.height, 24);
  for (int y = 0; y < 24; y++) {
    for (int x = 0; x < 40; x++) {
      const uint16_t *p = image.rgba + (y * 40 + x) * 4;
      const int e[3] = {4 * x, grey ? 4 * x : 5 * y, grey ? 4 * x : 200 - 2 * x};
      for (int c = 0; c < 3; c++) {
        ck_assert_int_le(abs(p[c] - e[c] * 257), 3 * 257);
        ck_assert_int_eq(p[c] % 257, 0); /* 255 becomes 65535 */
      }
      ck_assert_uint_eq(p[3], 65535);
    }
  }
}

LOOP_TEST(jpeg_damage, 2)
{
  put_jpeg(in("a.jpg"), 24, 16, false, _i);
  ck_damage(in("a.jpg"), load_image, false);
}

/* Every coefficient in a scan of its own, each bit of it in another one: every scan goes through the whole picture. */
TEST(jpeg_of_many_scans_is_refused)
{
  enum { SCANS = 1 + 63 * 4 };
  jpeg_scan_info scan[SCANS] = {{.comps_in_scan = 1}};
  sf_image image;
  for (int i = 1; i < SCANS; i++) {
    const int pass = (i - 1) / 63, k = 1 + (i - 1) % 63;
    scan[i] = (jpeg_scan_info){.comps_in_scan = 1, .Ss = k, .Se = k, .Ah = pass ? 4 - pass : 0, .Al = 3 - pass};
  }
  put_scans(in("a.jpg"), 8, 8, scan, 1 + 63 * 2);
  ck_ok(sf_image_load(&image, in("a.jpg")));
  sf_image_free(&image);
  put_scans(in("a.jpg"), 8, 8, scan, SCANS);
  ck_bad(sf_image_load(&image, in("a.jpg")), SF_E_FORMAT, "a.jpg", "more than 200 scans");
}

/* ---- downscaling ---- */

TEST(downscale_weighs_by_alpha)
{
  uint16_t pixels[2][4][4] = {{{100, 0, 0, 65535}, {900, 0, 0, 0}, {7, 8, 9, 0}, {9, 8, 7, 0}},
                              {{400, 0, 0, 32768}, {500, 0, 0, 0}, {7, 8, 9, 0}, {9, 8, 8, 0}}};
  sf_image image = {4, 2, malloc(sizeof pixels)};
  memcpy(image.rgba, pixels, sizeof pixels);
  ck_bad(sf_image_downscale(&image, 3, "name.png"), SF_E_RANGE, "name.png", "4 x 2");
  ck_bad(sf_image_downscale(&image, 0, "name.png"), SF_E_RANGE, "name.png", "below 1");
  ck_ok(sf_image_downscale(&image, 1, ""));
  ck_assert_int_eq(image.width, 4);
  ck_ok(sf_image_downscale(&image, 2, ""));
  ck_assert_int_eq(image.width, 2);
  ck_assert_int_eq(image.height, 1);
  /* (100 * 65535 + 400 * 32768) / (65535 + 32768) = 200.0005; alpha 98303 / 4 = 24575.75 */
  ck_assert_uint_eq(image.rgba[0], 200);
  ck_assert_uint_eq(image.rgba[3], 24576);
  /* nothing opaque: the plain mean, 31 / 4 = 7.75 in blue */
  ck_assert_uint_eq(image.rgba[4], 8);
  ck_assert_uint_eq(image.rgba[6], 8);
  ck_assert_uint_eq(image.rgba[7], 0);
  sf_image_free(&image);
  uint16_t row[2][5][4] = {{{2}, {4}, {6}, {8}, {900}}, {{2}, {4}, {6}, {8}, {900}}};
  image = (sf_image){5, 2, malloc(sizeof row)};
  memcpy(image.rgba, row, sizeof row);
  ck_ok(sf_image_downscale(&image, 2, "")); /* the fifth column fills no box */
  ck_assert_int_eq(image.width, 2);
  ck_assert_uint_eq(image.rgba[0], 3);
  ck_assert_uint_eq(image.rgba[4], 7);
  sf_image_free(&image);
}

/* ---- EXR ---- */

enum { EW = 37, EH = 41 }; /* three blocks of 16 lines, the last one short */

static void exr_channels(sf_exr_channel c[4])
{
  static const char *const names[4] = {"raw.R", "Z", "B", "spikes"};
  static const sf_exr_type types[4] = {SF_EXR_UINT, SF_EXR_FLOAT, SF_EXR_HALF, SF_EXR_UINT};
  for (int k = 0; k < 4; k++) {
    strcpy(c[k].name, names[k]);
    c[k].type = types[k];
    uint32_t *u = c[k].data = malloc(EW * EH * 4);
    float *f = c[k].data;
    for (uint64_t i = 0; i < EW * EH; i++) {
      u[i] = (uint32_t)(sf_random_u64(9, (uint64_t)k, i) >> 32);
      if (types[k] == SF_EXR_HALF) f[i] = (float)sf_random_below(9, 7, i, 4096) / 2048 - 1; /* exact in half */
    }
  }
}

TEST(exr_round_trip_is_exact)
{
  sf_exr_channel c[4], *back;
  const char *const attributes[] = {"scene", "a \"quoted\" text", "steps", "5", NULL};
  static const int order[4] = {2, 1, 0, 3}; /* sorted by name: B, Z, raw.R, spikes */
  int width, height, n;
  exr_channels(c);
  ck_ok(sf_exr_save(in("a.exr"), EW, EH, c, 4, attributes));
  ck_ok(sf_exr_load(in("a.exr"), &width, &height, &back, &n));
  ck_assert_int_eq(width, EW);
  ck_assert_int_eq(height, EH);
  ck_assert_int_eq(n, 4);
  for (int i = 0; i < 4; i++) {
    const sf_exr_channel *e = &c[order[i]];
    ck_assert_str_eq(back[i].name, e->name);
    ck_assert_int_eq(back[i].type, e->type);
    ck_assert_mem_eq(back[i].data, e->data, EW * EH * 4);
  }
  size_t size;
  char *bytes = read_whole(in("a.exr"), &size);
  ck_assert_ptr_nonnull(memmem(bytes, size, "scene\0string\0\x0f\0\0\0a \"quoted\" text", 32));
  ck_assert_ptr_nonnull(memmem(bytes, size,
                               "steps\0string\0\x01\0\0\0"
                               "5",
                               18));
  ck_assert_ptr_nonnull(memmem(bytes, size, "compression\0compression\0\x01\0\0\0\x03", 29)); /* 3 = ZIP */
  free(bytes);
  sf_exr_free(back, n);
  for (int i = 0; i < 4; i++) free(c[i].data);
}

TEST(exr_half_rounds)
{
  float v[4] = {1.0f + 1.0f / 4096, -70000.0f, 1e-9f, 0.1f};
  sf_exr_channel c = {"H", SF_EXR_HALF, v}, *back;
  int width, height, n;
  ck_ok(sf_exr_save(in("h.exr"), 2, 2, &c, 1, NULL));
  ck_ok(sf_exr_load(in("h.exr"), &width, &height, &back, &n));
  const float *f = back[0].data;
  ck_assert(f[0] == 1.0f);                      /* half has 10 fraction bits */
  ck_assert(isinf(f[1]) && f[1] < 0);           /* the largest half is 65504 */
  ck_assert(f[2] == 0.0f);                      /* below half of the smallest denormal, 2^-25 */
  ck_assert(fabsf(f[3] - 0.1f) <= 0.1f / 2048); /* relative rounding error 2^-11 */
  sf_exr_free(back, n);
}

static sf_status load_exr(const char *path)
{
  int width, height, n;
  sf_exr_channel *c;
  sf_status s = sf_exr_load(path, &width, &height, &c, &n);
  if (s.code == SF_OK)
    sf_exr_free(c, n);
  else
    ck_assert_ptr_null(c);
  return s;
}

TEST(exr_damage)
{
  uint32_t u[20 * 19];
  float f[20 * 19];
  for (int i = 0; i < 20 * 19; i++) u[i] = (uint32_t)(i / 7), f[i] = sf_random_float(1, 3, (uint64_t)i);
  sf_exr_channel c[2] = {{"A", SF_EXR_UINT, u}, {"Z", SF_EXR_FLOAT, f}};
  ck_ok(sf_exr_save(in("a.exr"), 20, 19, c, 2, NULL));
  ck_damage(in("a.exr"), load_exr, false);
}

TEST(exr_refused)
{
  float f[4] = {0};
  sf_exr_channel twice[2] = {{"A", SF_EXR_FLOAT, f}, {"A", SF_EXR_HALF, f}}, none = {"A", SF_EXR_FLOAT, NULL};
  const char *const reserved[] = {"channels", "text", NULL};
  ck_bad(sf_exr_save(in("a.exr"), 2, 2, twice, 2, NULL), SF_E_RANGE, "a.exr", "two EXR channels are named 'A'");
  ck_bad(sf_exr_save(in("a.exr"), 2, 2, &none, 1, NULL), SF_E_RANGE, "a.exr", "no data");
  ck_bad(sf_exr_save(in("a.exr"), 0, 2, twice, 1, NULL), SF_E_RANGE, "a.exr", "0 x 2");
  ck_bad(sf_exr_save(in("a.exr"), 2, 2, twice, 0, NULL), SF_E_RANGE, "a.exr", "0 channels");
  ck_assert_int_ne(sf_exr_save(in("a.exr"), 2, 2, twice, 1, reserved).code, SF_OK);
  const char *const unnamed[] = {"", "text", NULL}, *const again[] = {"a", "1", "a", "2", NULL};
  ck_assert_int_ne(sf_exr_save(in("a.exr"), 2, 2, twice, 1, unnamed).code, SF_OK);
  ck_ok(sf_exr_save(in("a.exr"), 2, 2, twice, 1, again)); /* the later value stands */
  ck_assert_int_eq(unlink(in("a.exr")), 0);
  ck_assert_int_eq(entries(), 0);
  ck_bad(load_exr(in("none.exr")), SF_E_IO, "none.exr", "No such file");
}

/* ---- PSNR and SSIM ---- */

TEST(psnr_known)
{
  float a[4] = {0, 0.5f, 1, 0.25f}, b[4] = {0.5f, 0.5f, 1, 0.25f};
  ck_assert(isinf(sf_psnr(a, a, 4)));
  /* mse = 0.25 / 4 = 1/16, exactly: 10 log10 16, to the rounding of log10 */
  ck_assert_double_eq_tol(sf_psnr(a, b, 4), 12.041199826559248, 1e-12);
  ck_assert_double_eq_tol(sf_psnr(a, b, 1), 6.020599913279624, 1e-12);
}

/* Straight from the definition: a two-dimensional window, two passes, moments about the mean. */
static double naive_ssim(const float *a, const float *b, int width, int height, int channels)
{
  double weight[11][11], total = 0, sum = 0;
  for (int i = 0; i < 11; i++)
    for (int k = 0; k < 11; k++) total += weight[i][k] = exp(-((i - 5) * (i - 5) + (k - 5) * (k - 5)) / 4.5);
  long n = 0;
  for (int c = 0; c < channels; c++) {
    for (int y = 5; y < height - 5; y++) {
      for (int x = 5; x < width - 5; x++, n++) {
        double ma = 0, mb = 0, va = 0, vb = 0, cov = 0;
        for (int pass = 0; pass < 2; pass++) {
          for (int i = 0; i < 11; i++) {
            for (int k = 0; k < 11; k++) {
              int at = ((y + i - 5) * width + x + k - 5) * channels + c;
              double w = weight[i][k] / total;
              if (!pass)
                ma += w * a[at], mb += w * b[at];
              else
                va += w * (a[at] - ma) * (a[at] - ma), vb += w * (b[at] - mb) * (b[at] - mb),
                    cov += w * (a[at] - ma) * (b[at] - mb);
            }
          }
        }
        sum += (2 * ma * mb + 1e-4) * (2 * cov + 9e-4) / ((ma * ma + mb * mb + 1e-4) * (va + vb + 9e-4));
      }
    }
  }
  return sum / (double)n;
}

LOOP_TEST(ssim_equals_the_definition, 4)
{
  static const int sizes[][3] = {{11, 11, 1}, {12, 20, 3}, {33, 17, 3}, {40, 11, 4}};
  int w = sizes[_i][0], h = sizes[_i][1], c = sizes[_i][2], n = w * h * c;
  float *a = malloc((size_t)n * sizeof *a), *b = malloc((size_t)n * sizeof *b);
  for (int i = 0; i < n; i++) {
    a[i] = 0.5f + 0.5f * sinf((float)i * 0.37f);
    b[i] = 0.7f * a[i] + 0.3f * sf_random_float(2, 0, (uint64_t)i);
  }
  /* Sums of 121 doubles near 1: cancellation in E[x^2] - E[x]^2 costs about 1e-15, divided by at least 9e-4. */
  ck_assert_double_eq_tol(sf_ssim(a, b, w, h, c), naive_ssim(a, b, w, h, c), 1e-11);
  ck_assert_double_eq_tol(sf_ssim(a, a, w, h, c), 1, 1e-12);
  free(a);
  free(b);
}

TEST(ssim_of_constants)
{
  enum { N = 15 * 14 };
  float a[N], b[N];
  for (int i = 0; i < N; i++) a[i] = 0.25f, b[i] = 0.75f;
  /* (2 * 0.25 * 0.75 + c1) / (0.25^2 + 0.75^2 + c1), c1 = 1e-4 */
  ck_assert_double_eq_tol(sf_ssim(a, b, 15, 14, 1), 0.3751 / 0.6251, 1e-12);
  ck_assert(isnan(sf_ssim(a, b, 10, 14, 1)));
}

ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};
