/* The integer model: loading, and rays through what was accepted, in the portable and in the vector core. */
#include "fuzz.h"
#include "mutate_header.h"
#include "fx/fx.h"
#include "quant/quant.h"

enum { SUM_CHARS = 18, SAMPLES = 6, POINTS = 64 };

/* A mutated file has a wrong checksum, which the refusal states as it should be: puts it in, so that the fuzzer gets
 * past it. False where the file was refused for another reason. */
static bool mend_checksum(uint8_t *data, size_t size, const char *message)
{
  const char *is = strstr(message, "'checksum' is '0x"), *expected = strstr(message, "expected '0x");
  if (!is || !expected || expected - is < SUM_CHARS) return false;
  is += strlen("'checksum' is '"), expected += strlen("expected '");
  uint8_t *at = memmem(data, size, is, SUM_CHARS);
  if (!at || expected[SUM_CHARS] != '\'') return false;
  memcpy(at, expected, SUM_CHARS);
  return true;
}

static sf_status load(fx_scene *scene, const uint8_t *data, size_t size)
{
  sf_status status = fx_scene_load(scene, fuzz_file(data, size));
  if (status.code != SF_E_FORMAT) return status;
  uint8_t *mended = malloc(size + 1);
  FUZZ_EXPECT(mended);
  memcpy(mended, data, size);
  if (mend_checksum(mended, size, status.message)) status = fx_scene_load(scene, fuzz_file(mended, size));
  free(mended);
  return status;
}

static void render(const fx_scene *scene, const fx_ray *ray, fx_pixel *pixel, fx_counts *counts)
{
  uint32_t rgba[4];
  const uint64_t before = counts->samples;
  FUZZ_EXPECT(fuzz_good(fx_render_ray(scene, ray, NULL, NULL, pixel, counts)));
  FUZZ_EXPECT(pixel->weight_sum + pixel->transmittance == 1u << SF_TRANS_FRAC);
  FUZZ_EXPECT(pixel->samples == counts->samples - before);
  fx_pixel_rgba(pixel, rgba);
  fuzz_touch(rgba, sizeof rgba);
}

/* Whatever the scene holds, both cores give the same bits. which: of the kernels, any number. */
static void render_in_vectors(const fx_scene *scene, const fx_ray ray[2], const fx_pixel wanted[2],
                              const fx_counts *counted, size_t which)
{
  static const char *const kernels[] = {NULL, "avx2", "portable"};
  fx_core *core;
  fx_counts counts = {0};
  fx_pixel pixel[2];
  if (fx_core_open(&core, scene, kernels[which % 3]).code != SF_OK) /* another CPU's */
    FUZZ_EXPECT(fuzz_good(fx_core_open(&core, scene, NULL)));
  FUZZ_EXPECT(fuzz_good(fx_render_rays(core, ray, 2, pixel, NULL, &counts)));
  fx_core_close(core);
  FUZZ_EXPECT(!memcmp(pixel, wanted, sizeof pixel));
  FUZZ_EXPECT(!memcmp(&counts, counted, sizeof counts));
}

/* One ray as cameras make them, where the scene's units allow it; one across the box, corner to corner. */
static void make_rays(const fx_scene *scene, fx_ray ray[2])
{
  const float origin[3] = {0.1f, 0.2f, 2.5f}, direction[3] = {0.05f, -0.1f, -1};
  if (!fuzz_good(sf_fx_ray_make(scene, origin, direction, &ray[0]))) ray[0] = (fx_ray){0};
  if (ray[0].count > 4096) ray[0].count = 4096;
  ray[1] = (fx_ray){.count = POINTS};
  const int64_t steps = scene->steps ? (scene->steps->at_q16[POINTS - 1] >> 16) + 1 : POINTS - 1;
  for (int axis = 0; axis < 3; axis++) {
    ray[1].origin[axis] = axis ? 1 : ((int64_t)1 << 40) - 1;
    ray[1].step[axis] = (int64_t)(axis ? 1 : -1) * ((((int64_t)1 << 40) - 2) / steps);
  }
  for (int i = 0; i < FX_SH; i++) ray[1].dir[i] = (int16_t)(i % 2 ? -2047 : 2047);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
  fx_scene scene;
  fx_ray ray[2];
  fx_pixel pixel[2];
  fx_counts counts = {0};
  if (!fuzz_good(load(&scene, data, size))) {
    FUZZ_EXPECT(!scene.owner);
    return 0;
  }
  FUZZ_EXPECT(fuzz_good(fx_scene_check(&scene, "input")));
  if (scene.max_samples > SAMPLES) scene.max_samples = SAMPLES;
  make_rays(&scene, ray);
  for (int i = 0; i < 2; i++) render(&scene, &ray[i], &pixel[i], &counts);
  render_in_vectors(&scene, ray, pixel, &counts, size);
  fx_scene_free(&scene);
  return 0;
}
