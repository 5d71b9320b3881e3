/* Rays in, pixels out: what sf_ray_top needs and what must come out. The rays are the kit's first ones, whole, and then
 * one without a sample. */
#include "sim/kit/kit.h"
#include "sim/ray/request.h"
#include "sim/sim.h"
#include "energy/energy.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

enum { KIT_RAYS = 5, BASE = 0x40000, LINE_BYTES = 16, BEAT_WAITS = 4, BEAT_USER = 2, BEAT_LAST = 1 };

typedef struct kit_rays {
  const fx_scene *scene;
  int rays, beats;
  fx_ray ray[KIT_RAYS];
  fx_pixel pixel[KIT_RAYS];
  sf_ray_request request[KIT_RAYS];
  sf_ray_sample *sample; /* [KIT_RAYS][SF_RAY_SAMPLES_MAX] */
  uint8_t *contents;     /* of the field's memory */
  bool *seen;            /* by line: it is read */
  uint64_t lines;
  fx_memory memory;
  fx_counts counts;
} kit_rays;

static void see(void *user, const uint32_t *line, int n)
{
  kit_rays *k = user;
  for (int i = 0; i < n; i++) k->seen[line[i]] = true;
}

static void read_field(void *user, fx_read what, const uint32_t pos[3])
{
  fx_memory_read(&((kit_rays *)user)->memory, what, pos);
}

static sf_status fill_memory(kit_rays *k)
{
  const fx_grid *grid = &k->scene->grid;
  const size_t bytes = (size_t)grid->entries * FX_GRID_FEATURES;
  fx_factor_place place[2 * FX_PAIRS];
  const bool planes = k->scene->backbone == FX_TENSORF;
  k->lines = planes ? fx_tensorf_places(&k->scene->tensorf, place) : (bytes + LINE_BYTES - 1) / LINE_BYTES;
  k->contents = calloc(k->lines, LINE_BYTES), k->seen = calloc(k->lines, sizeof *k->seen);
  k->sample = calloc((size_t)KIT_RAYS * SF_RAY_SAMPLES_MAX, sizeof *k->sample);
  if (!k->contents || !k->seen || !k->sample) return sf_fail(SF_E_MEMORY, "no memory for the kit's field");
  if (planes)
    fx_tensorf_memory(&k->scene->tensorf, k->contents);
  else
    memcpy(k->contents, grid->table, bytes);
  SF_TRY(fx_memory_open(&k->memory, k->scene, &(fx_cache_shape){SF_CACHE_BYTES, SF_CACHE_WAYS}));
  k->memory.see = see, k->memory.user = k;
  return sf_ok();
}

/* Each ray is a tile of its own. */
static sf_status render(kit_rays *k, const sf_kit_draw *draw)
{
  const fx_watch watch = {read_field, k};
  k->rays = draw->rays < KIT_RAYS ? draw->rays + 1 : KIT_RAYS;
  for (int i = 0; i < k->rays; i++) {
    k->ray[i] = draw->ray[i < draw->rays ? i : 0].ray;
    if (i == k->rays - 1) k->ray[i].count = 0;
    fx_memory_ray(&k->memory, (uint64_t)i);
    SF_TRY(fx_render_watched(k->scene, &k->ray[i], NULL, NULL, &watch, &k->pixel[i], &k->counts));
    sf_ray_sample *sample = k->sample + (size_t)i * SF_RAY_SAMPLES_MAX;
    k->request[i] = sf_ray_request_as(k->scene, &k->ray[i], &k->pixel[i], sample);
    k->request[i].new_tile = true;
  }
  return sf_ok();
}

/* ---- images ---- */

/* A beat that ends a stopped ray waits for the ray's pixel. */
static sf_status write_beats(sf_kit_output *output, kit_rays *k)
{
  sf_kit_writer file;
  SF_TRY(sf_kit_begin(output, &file, "rays.hex"));
  for (int i = 0; i < k->rays; i++) {
    const sf_ray_request *request = &k->request[i];
    sf_ray_beat beat;
    int at = 0;
    do {
      beat = sf_ray_beat_of(request, at);
      const int waits = request->stops && at == request->n ? BEAT_WAITS : 0;
      fprintf(file.writer.file, "%x", (unsigned)(waits | (beat.user ? BEAT_USER : 0) | (beat.last ? BEAT_LAST : 0)));
      for (int word = 3; word >= 0; word--) fprintf(file.writer.file, "%016" PRIx64, beat.data[word]);
      fputc('\n', file.writer.file);
      at++, k->beats++;
    } while (!beat.last);
  }
  return sf_kit_end(output, &file);
}

/* The lines that are read. Each run of them follows its address. */
static sf_status write_memory(sf_kit_output *output, const kit_rays *k)
{
  sf_kit_writer file;
  SF_TRY(sf_kit_begin(output, &file, "memory.hex"));
  for (uint64_t line = 0; line < k->lines; line++) {
    if (!k->seen[line]) continue;
    if (line == 0 || !k->seen[line - 1]) fprintf(file.writer.file, "@%" PRIx64 "\n", line);
    for (int i = LINE_BYTES - 1; i >= 0; i--)
      fprintf(file.writer.file, "%02x", k->contents[line * LINE_BYTES + (uint64_t)i]);
    fputc('\n', file.writer.file);
  }
  return sf_kit_end(output, &file);
}

static sf_status write_pixels(sf_kit_output *output, const kit_rays *k)
{
  sf_kit_writer file;
  SF_TRY(sf_kit_begin(output, &file, "expected_pixels.hex"));
  for (int i = 0; i < k->rays; i++) {
    const fx_pixel *p = &k->pixel[i];
    fprintf(file.writer.file, "%016" PRIx64 "%08" PRIx32 "%08" PRIx32 "%016" PRIx64, (uint64_t)p->samples,
            p->transmittance, p->weight_sum, p->depth);
    for (int o = 2; o >= 0; o--) fprintf(file.writer.file, "%016" PRIx64, p->colour[o]);
    fputc('\n', file.writer.file);
  }
  return sf_kit_end(output, &file);
}

static sf_status write_sizes(sf_kit_output *output, const kit_rays *k, int writes)
{
  sf_kit_writer file;
  SF_TRY(sf_kit_begin(output, &file, "sf_kit_rays.svh"));
  FILE *f = file.writer.file;
  fprintf(f, "// Sizes of the kit's rays.\nlocalparam integer RAYS = %d;\nlocalparam integer RAY_BEATS = %d;\n",
          k->rays, k->beats);
  fprintf(f, "localparam integer RAY_WRITES = %d;\nlocalparam integer LINES = %" PRIu64 ";\n", writes, k->lines);
  fprintf(f, "localparam [31:0] MEMORY_BASE = 32'h%08x;\n", (unsigned)BASE);
  fprintf(f, "localparam [31:0] LOOKUPS = 32'd%" PRIu64 ";\n", k->memory.counts.lookups);
  fprintf(f, "localparam [31:0] MISSES = 32'd%" PRIu64 ";\n", k->memory.counts.misses);
  return sf_kit_end(output, &file);
}

static sf_status write_all(sf_kit_output *output, kit_rays *k)
{
  int writes = 0;
  SF_TRY(sf_kit_program_rays(output, k->scene, BASE, &writes));
  SF_TRY(write_beats(output, k));
  SF_TRY(write_memory(output, k));
  SF_TRY(write_pixels(output, k));
  if (fx_net_constants_per_sample(&k->scene->net)) k->counts.rays = 0; /* a decoder's samples belong to no ray */
  SF_TRY(sf_kit_counters(output, "expected_ray_counters.hex", &k->counts));
  return write_sizes(output, k, writes);
}

sf_status sf_kit_rays(sf_kit_output *output, const sf_kit_draw *draw)
{
  kit_rays k = {.scene = draw->scene};
  sf_status status = fill_memory(&k);
  if (status.code == SF_OK) status = render(&k, draw);
  if (status.code == SF_OK) status = write_all(output, &k);
  fx_memory_close(&k.memory);
  free(k.contents), free(k.seen), free(k.sample);
  return status;
}
