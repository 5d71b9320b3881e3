/* sf_soc: the firmware renders a tile on an emulated system-on-chip with the Verilated accelerator. */
#include "sim/plusarg.h"
#include "sim/soc/soc.h"
#include "firmware/sf_ray_driver.h"
#include "firmware/sf_soc.h"
#include "sim/soc/job.h"
#include "cli/cli.h"
#include "base/clock.h"
#include "golden/golden.h"
#include "base/io.h"
#include "quant/quant.h"
#include "sim/studio/studio.h"
#include <inttypes.h>
#include <libgen.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { TILE = 8, OUTPUT_MAX = 1 << 20, IMAGE_FILE_MAX = SF_SOC_IMAGE_SPACE };

typedef struct options {
  int view, split, downscale, stall;
  uint64_t seed, instructions;
  double scale;
  const char *scene, *data, *crop, *firmware, *image, *save_image, *png, *plusarg;
  bool json, quiet;
} options;
static const char *const split_name[] = {"test", "train"};

typedef struct job {
  options opt;
  char firmware[4096]; /* path */
  fx_scene scene;
  sf_dataset data; /* of one view */
  sf_window tile;
  /* host path */
  fx_ray *rays;
  fx_pixel *pixels;
  fx_cost *costs;
  fx_counts counts;
  fx_memory field; /* of TensoRF: its cache, which is the accelerator's */
  /* the system */
  uint8_t *image;
  size_t image_size;
  sf_dut *dut;
  sf_soc *soc;
  const fx_pixel *made; /* by the firmware, in its memory */
  char *output;         /* of the UART, NUL-terminated */
  size_t output_size, shown;
  double begun, seconds;
  sf_progress progress;
} job;

/* The accelerator is sf_ray_top. */
static bool takes_rays(const job *j)
{
  return j->scene.backbone == FX_TENSORF;
}

static sf_status open_accelerator(job *j)
{
  const options *o = &j->opt;
  const sf_dut_options dut = {.seed = o->seed, .stall_percent = o->stall, .plusarg = o->plusarg};
  SF_TRY(sf_plusarg_check(o->plusarg));
  return sf_soc_open_dut(&j->dut, takes_rays(j), &dut);
}

/* ---- the tile ---- */

static sf_status choose_tile(job *j)
{
  const sf_camera *camera = &j->data.view[0].camera;
  const int w = camera->width < TILE ? camera->width : TILE, h = camera->height < TILE ? camera->height : TILE;
  j->tile = (sf_window){(camera->width - w) / 2, (camera->height - h) / 2, w, h};
  if (j->opt.crop) SF_TRY(sf_window_parse(j->opt.crop, &j->tile));
  const sf_window *t = &j->tile;
  if (t->x + t->width > camera->width || t->y + t->height > camera->height)
    return sf_fail(SF_E_USAGE, "--crop %.60s is out of range: the view has %d x %d pixels", j->opt.crop, camera->width,
                   camera->height);
  return sf_ok();
}

static size_t pixels_of(const job *j)
{
  return (size_t)j->tile.width * (size_t)j->tile.height;
}

static sf_status load(job *j)
{
  const options *o = &j->opt;
  const sf_dataset_options how = {.downscale = o->downscale, .scale = (float)o->scale, .first = o->view, .limit = 1};
  SF_TRY(fx_scene_load(&j->scene, o->scene));
  SF_TRY(sf_fx_dataset_load(&j->data, &j->scene, o->scene, o->data, split_name[o->split], &how));
  sf_dataset_warn(stderr, "sf_soc", &j->data, NULL);
  if (j->data.count == 0)
    return sf_fail(SF_E_USAGE, "--view %d is out of range: %s has %d %s views", o->view, o->data, j->data.total,
                   split_name[o->split]);
  return choose_tile(j);
}

/* The firmware's rays are one list of one tile. */
static sf_status render_list(job *j, size_t n)
{
  fx_core *core;
  uint32_t bytes = SF_CACHE_BYTES, ways = SF_CACHE_WAYS;
  if (takes_rays(j)) sf_ray_driver_cache(sf_dut_driver_bus(j->dut), &bytes, &ways);
  const fx_cache_shape cache = {(int32_t)bytes, (int32_t)ways};
  SF_TRY(fx_memory_open(&j->field, &j->scene, &cache));
  fx_memory_begin(&j->field);
  uint64_t *tile = calloc(n, sizeof *tile);
  if (!tile) return sf_fail(SF_E_MEMORY, "no memory for %zu pixels", n);
  sf_status status = fx_core_open(&core, &j->scene, NULL);
  if (status.code == SF_OK) {
    status = fx_render_list(core, &j->field, tile, j->rays, n, j->pixels, j->costs, &j->counts);
    fx_core_close(core);
  }
  free(tile);
  return status;
}

/* What the firmware must find: the same rays through the fixed-point core. */
static sf_status run_core(job *j)
{
  const size_t n = pixels_of(j);
  j->rays = calloc(n, sizeof *j->rays), j->pixels = calloc(n, sizeof *j->pixels),
  j->costs = calloc(n, sizeof *j->costs);
  if (!j->rays || !j->pixels || !j->costs) return sf_fail(SF_E_MEMORY, "no memory for %zu pixels", n);
  for (size_t i = 0; i < n; i++) {
    const int x = j->tile.x + (int)(i % (size_t)j->tile.width), y = j->tile.y + (int)(i / (size_t)j->tile.width);
    SF_TRY(sf_pixel_ray(&j->scene, &j->data, &j->data.view[0], x, y, &j->rays[i]));
  }
  return render_list(j, n);
}

static sf_status make_image(job *j)
{
  const options *o = &j->opt;
  if (!o->image)
    SF_TRY(sf_soc_image_make(&j->scene, j->rays, j->tile.width, j->tile.height, &j->image, &j->image_size));
  if (o->image) SF_TRY(sf_read_file(o->image, IMAGE_FILE_MAX, (char **)&j->image, &j->image_size));
  return o->save_image ? sf_write_file(o->save_image, j->image, j->image_size) : sf_ok();
}

/* ---- the system ---- */

static void show_output(job *j)
{
  if (!j->opt.json) printf("  %.*s", (int)(j->output_size - j->shown), j->output + j->shown), fflush(stdout);
  j->shown = j->output_size;
}

static bool uart(void *user, char c)
{
  job *j = user;
  if (j->output_size + 1 >= OUTPUT_MAX) return false;
  j->output[j->output_size++] = c == '\n' || (c >= ' ' && c <= '~') ? c : '?';
  if (c == '\n') show_output(j);
  return true;
}

static bool tick(void *user, uint64_t instructions)
{
  job *j = user;
  if (sf_progress_due(&j->progress))
    sf_progress_show(&j->progress, "firmware: %.1f M instructions, accelerator: %" PRIu64 " cycles",
                     (double)instructions * 1e-6, sf_dut_cycle(j->dut));
  return !sf_cli_interrupted();
}

static sf_status build(job *j)
{
  const options *o = &j->opt;
  const sf_soc_options soc = {
      .rays = takes_rays(j), .instructions = o->instructions, .uart = uart, .tick = tick, .user = j};
  j->output = calloc(1, OUTPUT_MAX);
  if (!j->output) return sf_fail(SF_E_MEMORY, "no memory for the firmware's output");
  SF_TRY(sf_soc_open(&j->soc, j->dut, &soc));
  SF_TRY(sf_soc_load_elf(j->soc, j->firmware));
  memcpy(sf_soc_memory(j->soc, SF_SOC_IMAGE, j->image_size), j->image, j->image_size);
  return sf_ok();
}

/* Behind the image as it is in memory now: it may be another one than this tile's. */
static sf_status find_pixels(job *j)
{
  const size_t at = sf_soc_image_pixels_at(sf_soc_memory(j->soc, SF_SOC_IMAGE, SF_SOC_IMAGE_SPACE));
  const size_t bytes = pixels_of(j) * sizeof *j->pixels;
  if (at > SF_SOC_IMAGE_SPACE || bytes > SF_SOC_IMAGE_SPACE - at)
    return sf_fail(SF_E_DIFFERENCE, "firmware: no room for %zu pixels behind the image", pixels_of(j));
  j->made = (const fx_pixel *)sf_soc_memory(j->soc, (uint32_t)(SF_SOC_IMAGE + at), bytes);
  return sf_ok();
}

/* The firmware's own word on what went wrong is its last line. */
static sf_status exit_failure(const job *j, uint32_t exit_status)
{
  const char *line = j->output;
  for (const char *at = line; (at = strchr(at, '\n')) && at[1];) line = ++at;
  return sf_fail(SF_E_UNSUPPORTED, "firmware: exit status %" PRIu32 ": %.*s", exit_status, (int)strcspn(line, "\n"),
                 line);
}

static sf_status run_firmware(job *j)
{
  uint32_t exit_status;
  sf_progress_begin(&j->progress, j->opt.quiet);
  j->begun = sf_seconds();
  const sf_status status = sf_soc_run(j->soc, &exit_status);
  j->seconds = sf_seconds() - j->begun;
  sf_progress_end(&j->progress);
  if (j->shown < j->output_size) show_output(j);
  SF_TRY(status);
  return exit_status ? exit_failure(j, exit_status) : sf_ok();
}

static sf_status compare(job *j)
{
  SF_TRY(find_pixels(j));
  SF_TRY(sf_soc_compare_pixels(j->pixels, j->made, pixels_of(j), j->tile.width));
  return sf_soc_compare_audit(&j->counts, takes_rays(j) ? &j->field.counts : NULL, j->pixels, pixels_of(j), j->output);
}

/* ---- reports ---- */

static sf_status save_png(const job *j)
{
  if (!j->opt.png) return sf_ok();
  sf_golden golden = {0};
  const sf_golden_job job = {.scene = &j->scene, .data = &j->data};
  SF_TRY(sf_golden_create(&golden, j->tile.width, j->tile.height, SF_PLANES));
  for (size_t i = 0; i < pixels_of(j); i++)
    sf_golden_set(&golden, i, &j->made[i], &j->costs[i], sf_golden_step_length(&job));
  const sf_status status = sf_golden_save_png(&golden, j->opt.png);
  sf_golden_free(&golden);
  return status;
}

static cJSON *output_json(const char *output)
{
  cJSON *lines = cJSON_CreateArray();
  for (size_t length; *output; output += length + (output[length] == '\n')) {
    length = strcspn(output, "\n");
    char *line = strndup(output, length);
    if (line) cJSON_AddItemToArray(lines, cJSON_CreateString(line));
    free(line);
  }
  return lines;
}

static sf_status print_json(const job *j, const sf_status *status)
{
  const sf_soc_totals total = sf_soc_total(j->soc);
  cJSON *json = cJSON_CreateObject();
  cJSON_AddStringToObject(json, "scene", j->opt.scene);
  cJSON_AddStringToObject(json, "view", j->data.view[0].name);
  const int crop[] = {j->tile.x, j->tile.y, j->tile.width, j->tile.height};
  cJSON_AddItemToObject(json, "crop", cJSON_CreateIntArray(crop, 4));
  cJSON_AddStringToObject(json, "firmware", j->firmware);
  cJSON_AddNumberToObject(json, "image_bytes", (double)j->image_size);
  cJSON_AddItemToObject(json, "uart", output_json(j->output));
  cJSON_AddBoolToObject(json, "equal", status->code == SF_OK);
  cJSON_AddStringToObject(json, "message", status->message);
  sf_json_add_u64(json, "pixels", pixels_of(j));
  sf_json_add_u64(json, "samples", j->counts.samples);
  sf_json_add_u64(json, "energy_fj", sf_energy_fj(&j->counts));
  sf_json_add_u64(json, "instructions", total.instructions);
  sf_json_add_u64(json, "register_reads", total.reads);
  sf_json_add_u64(json, "register_writes", total.writes);
  sf_json_add_u64(json, "cycles", sf_dut_cycle(j->dut));
  cJSON_AddNumberToObject(json, "seconds", j->seconds);
  return sf_json_print(json, true);
}

static sf_status print_text(const job *j)
{
  const sf_soc_totals total = sf_soc_total(j->soc);
  printf("equal to the fixed-point core: %zu pixels of %" PRIu64 " samples, every event, %" PRIu64 " fJ\n",
         pixels_of(j), j->counts.samples, sf_energy_fj(&j->counts));
  printf("image of %zu bytes; %.1f M instructions, %" PRIu64 " register accesses, %" PRIu64 " clock cycles; %.1f s\n",
         j->image_size, (double)total.instructions * 1e-6, total.reads + total.writes, sf_dut_cycle(j->dut),
         j->seconds);
  if (j->opt.save_image) printf("wrote %s\n", j->opt.save_image);
  if (j->opt.png) printf("wrote %s\n", j->opt.png);
  const bool written = fflush(stdout) == 0 && !ferror(stdout);
  return written ? sf_ok() : sf_fail(SF_E_IO, "standard output: cannot write the report");
}

/* ---- program ---- */

static sf_status work(job *j)
{
  SF_TRY(load(j));
  SF_TRY(open_accelerator(j));
  SF_TRY(run_core(j));
  SF_TRY(make_image(j));
  SF_TRY(build(j));
  sf_status status = run_firmware(j);
  if (status.code == SF_OK) status = compare(j);
  status = sf_soc_explain(j->soc, status);
  if (status.code == SF_OK) status = save_png(j);
  if (status.code == SF_E_STOPPED) return status;
  const sf_status printed = j->opt.json ? print_json(j, &status) : status.code == SF_OK ? print_text(j) : sf_ok();
  return status.code == SF_OK ? printed : status;
}

/* Built: BUILD/firmware/sf_firmware.elf beside BUILD/bin. Installed: PREFIX/lib/spikefield beside PREFIX/bin. */
static void find_firmware(job *j)
{
  char program[4000] = "";
  const ssize_t length = readlink("/proc/self/exe", program, sizeof program - 1);
  if (j->opt.firmware || length < 0) {
    snprintf(j->firmware, sizeof j->firmware, "%s", j->opt.firmware ? j->opt.firmware : "sf_firmware.elf");
    return;
  }
  const char *folder = dirname(program);
  snprintf(j->firmware, sizeof j->firmware, "%s/../lib/spikefield/sf_firmware.elf", folder);
  if (access(j->firmware, F_OK)) snprintf(j->firmware, sizeof j->firmware, "%s/../firmware/sf_firmware.elf", folder);
}

static sf_status parse(int argc, char **argv, options *o, sf_cli *cli)
{
  const sf_option table[] = {
      SF_GROUP("What to render"),
      {"--view", 0, SF_ARG_INT, &o->view, 0, 1 << 20, NULL, "K", "which view of the split, from 0 (default 0)"},
      {"--crop", 0, SF_ARG_STRING, &o->crop, 0, 0, NULL, "X,Y,W,H", "the tile (default: 8x8 in the centre)"},
      {"--split", 0, SF_ARG_CHOICE, &o->split, 0, 0, "test|train", "NAME", "which views --view counts (default test)"},
      {"--png", 0, SF_ARG_OUTPUT, &o->png, 0, 0, NULL, "FILE", "write the firmware's pixels"},
      SF_GROUP("What is printed"),
      {"--json", 0, SF_ARG_FLAG, &o->json, 0, 0, NULL, NULL, "report as JSON"},
      {"--quiet", 'q', SF_ARG_FLAG, &o->quiet, 0, 0, NULL, NULL, "no progress line"},
      SF_GROUP("The system"),
      {"--firmware", 0, SF_ARG_INPUT, &o->firmware, 0, 0, NULL, "ELF",
       "program to run (default: the one built or installed with sf_soc)"},
      {"--image", 0, SF_ARG_INPUT, &o->image, 0, 0, NULL, "FILE", "memory image to load instead of the tile's own"},
      {"--save-image", 0, SF_ARG_OUTPUT, &o->save_image, 0, 0, NULL, "FILE",
       "write the memory image, for other systems"},
      {"--instructions", 0, SF_ARG_U64, &o->instructions, 1, 0x1p53, NULL, "N",
       "instructions that the program may take (default 10^10)"},
      SF_GROUP("Tuning"),
      {"--downscale", 0, SF_ARG_INT, &o->downscale, 0, 64, NULL, "N",
       "views of 1/N of the full size, 0 = by the layout (default 0)"},
      {"--scale", 0, SF_ARG_DOUBLE, &o->scale, 0, 1e6, NULL, "S",
       "model units per world unit, 0 = the scene's (default 0)"},
      {"--seed", 0, SF_ARG_U64, &o->seed, 0, 0, NULL, "S",
       "seed of stalls and register contents at power-on (default 1)"},
      {"--stall", 0, SF_ARG_INT, &o->stall, 0, 90, NULL, "PERCENT",
       "percent of cycles with a bubble or back-pressure (default 0)"},
      {"--plusarg", 0, SF_ARG_STRING, &o->plusarg, 0, 0, NULL, "TEXT", "hand TEXT to the simulation"},
      {0}};
  const char *positional[2];
  cli->options = table;
  const sf_status status = sf_cli_parse(cli, argc, argv, positional);
  cli->options = NULL;
  o->scene = positional[0], o->data = positional[1];
  return status;
}

static void release(job *j)
{
  sf_soc_close(j->soc);
  sf_dut_close(j->dut);
  free(j->output), free(j->image), free(j->costs), free(j->pixels), free(j->rays);
  sf_dataset_free(&j->data);
  fx_memory_close(&j->field);
  fx_scene_free(&j->scene);
  free(j);
}

int main(int argc, char **argv)
{
  sf_cli cli = {
      .program = "sf_soc",
      .usage = "sf_soc scene.snn DATA [--view K] [--crop X,Y,W,H] [options]",
      .summary =
          "Runs the firmware on an emulated RV32IM system with the Verilated accelerator: it renders a tile and\n"
          "prints the audit over its UART. The accelerator computes the nets of a scene with a hash grid, and makes\n"
          "pixels of positions for one of TensoRF. Pixels and audit are compared with the fixed-point core. Exit\n"
          "status 1 on a difference, and when the firmware fails, traps or does not end.",
      .examples = "  sf_soc scene.snn data --view 3 --crop 40,40,16,16 --png tile.png\n"
                  "  sf_soc scene.snn data --stall 20 --json\n"
                  "  sf_soc scene.snn data --save-image tile.img\n"
                  "  sf_soc scene.snn data --firmware my.elf --image tile.img\n",
      .min_positional = 2,
      .max_positional = 2};
  job *j = calloc(1, sizeof *j);
  if (!j) return sf_cli_finish(&cli, sf_fail(SF_E_MEMORY, "no memory"));
  j->opt = (options){.seed = 1, .instructions = 10000000000};
  sf_status status = parse(argc, argv, &j->opt, &cli);
  if (status.code == SF_OK) {
    find_firmware(j);
    sf_cli_catch_signals();
    status = work(j);
  }
  release(j);
  return sf_cli_finish(&cli, status);
}
