/* For the tests of the emulated system: a small scene and its rays, the core's pixels, and the firmware on the system
 * with something between driver and bus that a test can let go wrong. */
#ifndef SF_TESTS_SOC_FIXTURE_H
#define SF_TESTS_SOC_FIXTURE_H
#include "ck_run.h"
#include "sim/soc/soc.h"
#include "firmware/sf_soc.h"
#include "firmware/sf_tile.h"
#include "fx/memory.h"
#include "sim/soc/job.h"
#include "tests/dut_fixture.h"
#include "tests/fx_fixture.h"
#include <libgen.h>
#include <unistd.h>

enum { OUTPUT_MAX = 1 << 14, WIDTH = 3, HEIGHT = 2, PIXELS = WIDTH * HEIGHT, INSTRUCTIONS = 300000000 };
static char output[OUTPUT_MAX]; /* each test runs in a process of its own */
static size_t output_size;

static bool keep_output(void *user, char c)
{
  (void)user;
  if (output_size + 1 >= OUTPUT_MAX) return false;
  output[output_size++] = c;
  return true;
}

typedef struct scenario {
  fx_scene scene;
  fx_ray ray[PIXELS];
  fx_pixel core[PIXELS], firmware[PIXELS];
  fx_counts counts;
  fx_memory_counts reads;
  const fx_memory_counts *field; /* of TensoRF: reads; else NULL */
  bool rays;                     /* the accelerator is sf_ray_top */
  uint8_t *image;
  size_t image_size;
  sf_dut *dut;
  sf_bus real; /* the accelerator's own bus, behind the one that a test puts before it */
  uint32_t offset, from, to;
  int stall;
} scenario;

/* Short rays from in front of the box through it; the last one misses. */
static void make_rays(scenario *s)
{
  for (int i = 0; i < PIXELS; i++) {
    fx_ray *ray = &s->ray[i];
    const int64_t one = (int64_t)1 << 40;
    for (int axis = 0; axis < 3; axis++) {
      ray->origin[axis] = one / 100 * fixture_pick(7, 50, (uint64_t)(3 * i + axis), 10, 60);
      ray->step[axis] = one / 1000 * fixture_pick(7, 51, (uint64_t)(3 * i + axis), 2, 20);
    }
    fixture_inputs(7, (uint64_t)i, ray->dir, FX_SH, 700);
    ray->count = i == PIXELS - 1 ? 0 : 6 + i;
    ray->first_q16 = 1000 * i;
    for (int axis = 0; axis < 3; axis++)
      ray->unit[axis] = (int16_t)fixture_pick(7, 52, (uint64_t)(3 * i + axis), -FX_UNIT_ONE, FX_UNIT_ONE);
  }
}

static void core_reads(void *user, fx_read what, const uint32_t pos[3])
{
  fx_memory_read(user, what, pos);
}

static void render_core(scenario *of)
{
  fx_memory memory;
  const fx_watch watch = {core_reads, &memory};
  ck_ok(fx_memory_open(&memory, &of->scene, &(fx_cache_shape){SF_CACHE_BYTES, SF_CACHE_WAYS}));
  memset(&of->counts, 0, sizeof of->counts);
  for (int i = 0; i < PIXELS; i++) {
    fx_memory_ray(&memory, 0);
    ck_ok(fx_render_watched(&of->scene, &of->ray[i], NULL, NULL, &watch, &of->core[i], &of->counts));
  }
  of->reads = memory.counts;
  fx_memory_close(&memory);
}

/* Of a scene and rays: what the core makes of them, and the image. */
static scenario *finish_scenario(scenario *of)
{
  of->rays = of->scene.backbone == FX_TENSORF;
  of->field = of->rays ? &of->reads : NULL;
  render_core(of);
  ck_assert_uint_gt(of->counts.samples, of->rays ? 10 : 20);
  ck_ok(sf_soc_image_make(&of->scene, of->ray, WIDTH, HEIGHT, &of->image, &of->image_size));
  return of;
}

static scenario *make_scenario_of(fx_scene scene)
{
  scenario *s = calloc(1, sizeof *s);
  s->scene = scene;
  make_rays(s);
  return finish_scenario(s);
}

static void free_scenario(scenario *s)
{
  fx_scene_free(&s->scene);
  free(s->image);
  free(s);
}

static scenario *s; /* what a test runs */
static uint32_t exit_status = 99;

/* BUILD/tests/test_NAME -> BUILD/firmware/sf_firmware.elf */
static void firmware_path(char path[4096])
{
  char self[4000] = "";
  ck_assert_int_gt(readlink("/proc/self/exe", self, sizeof self - 1), 0);
  snprintf(path, 4096, "%s/../firmware/sf_firmware.elf", dirname(self));
}

static uint32_t bus_read(void *context, uint32_t offset);
static void bus_write(void *context, uint32_t offset, uint32_t value);

/* The firmware on the system; bus_read and bus_write below stand between. */
static sf_status run_firmware(void)
{
  char path[4096];
  sf_soc *soc;
  firmware_path(path);
  ck_ok(sf_soc_open_dut(&s->dut, s->rays, &(sf_dut_options){.seed = 9, .stall_percent = s->stall}));
  s->real = s->dut->bus;
  s->dut->bus = (sf_bus){bus_read, bus_write, s};
  ck_ok(
      sf_soc_open(&soc, s->dut, &(sf_soc_options){.rays = s->rays, .instructions = INSTRUCTIONS, .uart = keep_output}));
  ck_ok(sf_soc_load_elf(soc, path));
  memcpy(sf_soc_memory(soc, SF_SOC_IMAGE, s->image_size), s->image, s->image_size);
  const sf_status status = sf_soc_run(soc, &exit_status);
  memcpy(s->firmware, sf_soc_memory(soc, SF_SOC_IMAGE, SF_SOC_IMAGE_SPACE) + sf_soc_image_pixels_at(s->image),
         sizeof s->firmware);
  sf_soc_close(soc);
  sf_dut_close(s->dut);
  return status;
}

/* What a test does to one register: reads of `offset` give `to`; writes go to `to` instead (REDIRECT), or write `to`
 * instead of their value (REPLACE), or are lost, the one of number `to` (LOSE_ONE) or all (LOSE). */
typedef enum { HONEST, READ_AS, REDIRECT, REPLACE, LOSE_ONE, LOSE, DEAF } bus_fault;
static bus_fault fault;
static uint32_t lost;

static uint32_t bus_read(void *context, uint32_t offset)
{
  scenario *s = context;
  if (fault == READ_AS && offset == s->offset) return s->to;
  if (fault == DEAF && offset == s->offset) s->dut->bus_hung = true;
  return s->real.read(s->real.context, offset);
}

static void bus_write(void *context, uint32_t offset, uint32_t value)
{
  scenario *s = context;
  if (offset == s->offset) {
    if (fault == REDIRECT) offset = s->to;
    if (fault == REPLACE) value = s->to;
    if (fault == LOSE || (fault == LOSE_ONE && lost++ == s->to)) return;
  }
  s->real.write(s->real.context, offset, value);
}

static void same_as_core(scenario *other, int stall)
{
  free_scenario(s);
  s = other;
  s->stall = stall;
  const sf_status status = run_firmware();
  ck_assert_msg(status.code == SF_OK && exit_status == 0, "%s\n%s", status.message, output);
  ck_ok(sf_soc_compare_pixels(s->core, s->firmware, PIXELS, WIDTH));
  ck_ok(sf_soc_compare_audit(&s->counts, s->field, s->core, PIXELS, output));
}

static const char *open_edited(const scenario *s, uint8_t *block, size_t space, int word, uint32_t value)
{
  sf_tile tile;
  sf_tile_header *h = (sf_tile_header *)block;
  memcpy(block, s->image, s->image_size);
  if (word >= 0) memcpy(block + 4 * word, &value, 4);
  h->crc = sf_crc32(0, &h->width, (uint32_t)(s->image_size - offsetof(sf_tile_header, width)));
  return sf_tile_open(block, (uint32_t)space, &tile);
}

/* With a right checksum again. */
static inline void seal(scenario *of)
{
  sf_tile_header *h = (sf_tile_header *)of->image;
  h->crc = sf_crc32(0, &h->width, (uint32_t)(of->image_size - offsetof(sf_tile_header, width)));
}

/* The firmware ends with exit status 1 and the line. */
static inline void expect_line(bus_fault what, uint32_t offset, uint32_t to, const char *line)
{
  fault = what, s->offset = offset, s->to = to;
  ck_ok(run_firmware());
  ck_assert_uint_eq(exit_status, 1);
  ck_assert_msg(strstr(output, line), "'%s' is not in '%s'", line, output);
}

/* It ends well, with other pixels and another audit. */
static inline void expect_difference(bus_fault what, uint32_t offset, uint32_t to)
{
  fault = what, s->offset = offset, s->to = to;
  const sf_status status = run_firmware();
  ck_assert_msg(status.code == SF_OK && exit_status == 0, "%s\n%s", status.message, output);
  ck_assert_int_eq(sf_soc_compare_pixels(s->core, s->firmware, PIXELS, WIDTH).code, SF_E_DIFFERENCE);
  ck_assert_int_eq(sf_soc_compare_audit(&s->counts, s->field, s->core, PIXELS, output).code, SF_E_DIFFERENCE);
}
#endif
