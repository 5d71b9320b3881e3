#include "sim/board/board.h"
#include "sim/board/bus.h"
#include "sim/sim.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

enum { MEMORY_WORD = 8, WORDS_A_FRAME = (SF_FRAME_WORDS - 1) / 2, PATIENCE = 4000 /* of 1024 cycles */ };
#define USER ((uint64_t)1 << 62)
#define LAST ((uint64_t)1 << 63)

/* ---- the field's memory ---- */

/* How many of the first levels the memory has room for. */
static int levels_that_fit(const fx_grid *grid, uint64_t bytes)
{
  int n = 0;
  while (n + 1 < grid->levels && (uint64_t)grid->offset[n + 1] * FX_GRID_FEATURES <= bytes) n++;
  return n;
}

static sf_status check_size(const sf_board *b)
{
  const fx_grid *grid = &b->scene->grid;
  const uint64_t bytes = (uint64_t)grid->entries * FX_GRID_FEATURES;
  if (b->scene->backbone != FX_INGP || bytes <= b->link.memory_bytes) return sf_ok();
  return sf_fail(SF_E_UNSUPPORTED,
                 "%s: its grid takes %" PRIu64 " bytes, the board has %" PRIu32 ": room for the first %d of %d levels; "
                 "a scene that fits: sf_export MODEL -o SMALL.snn --fit --data DATA --fit-bytes %" PRIu32,
                 b->path, bytes, b->link.memory_bytes, levels_that_fit(grid, b->link.memory_bytes), grid->levels,
                 b->link.memory_bytes);
}

static uint32_t four(const uint8_t *byte, uint64_t at, uint64_t end)
{
  uint32_t word = 0;
  for (uint32_t i = 0; i < 4 && at + i < end; i++) word |= (uint32_t)byte[at + i] << 8 * i;
  return word;
}

static sf_status fill_memory(sf_board *b)
{
  const uint8_t *byte = (const uint8_t *)b->scene->grid.table;
  const uint64_t end = (uint64_t)b->scene->grid.entries * FX_GRID_FEATURES;
  for (uint64_t at = 0; at < end;) {
    sf_frame f = {.command = SF_LINK_MEMORY, .words = 1, .word = {(uint32_t)(at / MEMORY_WORD)}};
    for (int i = 0; i < WORDS_A_FRAME && at < end; i++, at += MEMORY_WORD) {
      f.word[f.words++] = four(byte, at, end);
      f.word[f.words++] = four(byte, at + 4, end);
    }
    SF_TRY(sf_link_call(&b->link, &f));
  }
  return sf_ok();
}

/* ---- begin and end ---- */

sf_status sf_board_load(sf_board *b)
{
  const sf_net_blob net = sf_dut_blob(&b->scene->net);
  const sf_ray_blob rays = sf_ray_blob_of(b->scene, 0);
  const sf_planes_blob planes = sf_ray_planes_of(&b->scene->tensorf);
  sf_driver_reset(sf_board_bus(b));
  SF_TRY(sf_board_status(b, SF_DRIVER_OK, "reset"));
  SF_TRY(sf_link_greet(&b->link)); /* no ray is inside any more: the pixels that had come go, too */
  SF_TRY(sf_board_status(b, sf_driver_load(sf_board_bus(b), &net), "load"));
  const sf_driver_code code =
      sf_ray_driver_load(sf_board_bus(b), &rays, b->scene->backbone == FX_TENSORF ? &planes : NULL);
  SF_TRY(sf_board_status(b, code, "load rays"));
  const sf_bus *bus = sf_board_bus(b);
  bus->write(bus->context, SF_CSR_IRQ_ENABLE, SF_CSR_IRQ_ENABLE_ERROR);
  bus->write(bus->context, SF_CSR_RAY_IRQ_ENABLE, ~0u);
  SF_TRY(sf_board_status(b, SF_DRIVER_OK, "load"));
  return sf_board_clear(b);
}

static sf_status begin(sf_board *b)
{
  SF_TRY(sf_board_status(b, sf_driver_probe(sf_board_bus(b)), "probe"));
  SF_TRY(check_size(b));
  SF_TRY(sf_board_load(b));
  return fill_memory(b);
}

sf_status sf_board_open(sf_board **out, const char *port, double patience, const fx_scene *scene, const char *path)
{
  *out = NULL;
  sf_board *b = calloc(1, sizeof *b);
  if (!b) return sf_fail(SF_E_MEMORY, "%s: out of memory", port);
  b->scene = scene, b->path = path;
  sf_status status = sf_link_open(&b->link, port, patience);
  if (status.code == SF_OK) status = begin(b);
  if (status.code == SF_OK)
    *out = b;
  else
    sf_board_close(b);
  return status;
}

void sf_board_close(sf_board *b)
{
  if (!b) return;
  sf_link_close(&b->link);
  free(b);
}

/* ---- counters ---- */

fx_cache_shape sf_board_cache(sf_board *b)
{
  uint32_t bytes, ways;
  sf_ray_driver_cache(sf_board_bus(b), &bytes, &ways);
  return (fx_cache_shape){(int32_t)bytes, (int32_t)ways};
}

sf_status sf_board_clear(sf_board *b)
{
  const sf_bus *bus = sf_board_bus(b);
  sf_ray_driver_clear(bus);
  return sf_board_status(b, sf_driver_clear(bus), "clear counters");
}

sf_status sf_board_read(sf_board *b, sf_board_counters *c)
{
  sf_driver_counters read;
  const sf_bus *bus = sf_board_bus(b);
  SF_TRY(sf_board_status(b, sf_driver_read_counters(bus, &read), "read counters"));
  sf_dut_counts_of(&read, &c->counts);
  c->cycles = read.cycles, c->busy = read.busy, c->stalls = read.stall_in + read.stall_out;
  memcpy(c->layer_busy, read.layer_busy, sizeof c->layer_busy);
  sf_ray_driver_field(bus, &c->field);
  return sf_board_status(b, SF_DRIVER_OK, "read counters");
}

/* ---- rays ---- */

typedef struct run {
  sf_board *board;
  const sf_ray_request *request;
  fx_pixel *pixel;
  int n, ray, at, received; /* ray, at: of the next beat that is made */
  sf_ray_beat beat[SF_LINK_BEATS_MAX];
  int beats; /* made and not yet taken */
} run;

static sf_status trouble(run *r, const char *what)
{
  sf_board *b = r->board;
  sf_board_bus(b);
  const char *net = sf_board_error(b, SF_CSR_ERROR, sf_driver_error_text);
  const char *rays = sf_board_error(b, SF_CSR_RAY_ERROR, sf_ray_driver_error_text);
  return sf_fail(SF_E_DIFFERENCE, "accelerator: %s, %d of %d rays in, %d pixels out: %s; rays: %s", what, r->ray, r->n,
                 r->received, net, rays);
}

/* A ray that has to stop early gets its last beat after its pixel has come. */
static bool waits_for_pixel(const run *r)
{
  return r->ray < r->n && r->request[r->ray].stops && r->at == r->request[r->ray].n && r->received <= r->ray;
}

static void make_beats(run *r)
{
  while (r->beats < SF_LINK_BEATS_MAX && r->ray < r->n && !waits_for_pixel(r)) {
    const sf_ray_beat beat = sf_ray_beat_of(&r->request[r->ray], r->at++);
    r->beat[r->beats++] = beat;
    if (beat.last) r->ray++, r->at = 0;
  }
}

static uint32_t pixels_wanted(const run *r)
{
  const int due = r->ray + waits_for_pixel(r) - r->received;
  if (r->ray < r->n && !waits_for_pixel(r)) return 0;
  return (uint32_t)(due < SF_LINK_PIXELS ? due : SF_LINK_PIXELS);
}

static void put_beat(const sf_ray_beat *beat, uint32_t word[SF_LINK_BEAT_WORDS])
{
  for (int i = 0; i < SF_LINK_BEAT_WORDS; i++) {
    const uint64_t marks = (beat->user ? USER : 0) | (beat->last ? LAST : 0);
    const uint64_t two = beat->data[i / 2] | (i >= 6 ? marks : 0);
    word[i] = (uint32_t)(two >> 32 * (i % 2));
  }
}

static sf_status take_pixels(run *r, const sf_frame *f, uint32_t pixels)
{
  if (f->words != 3 + pixels * SF_LINK_PIXEL_WORDS)
    return sf_fail(SF_E_IO, "%s: an answer of another size than it says", r->board->link.port);
  for (uint32_t i = 0; i < pixels; i++) {
    uint64_t word[6];
    const uint32_t *from = f->word + 3 + i * SF_LINK_PIXEL_WORDS;
    for (int w = 0; w < 6; w++) word[w] = (uint64_t)from[2 * w + 1] << 32 | from[2 * w];
    if (r->received == r->ray + (r->at > 0)) return trouble(r, "pixel without a ray");
    r->pixel[r->received++] = sf_ray_pixel_of(word);
  }
  return sf_ok();
}

/* One command sends the beats that are ready and takes the pixels that have come. */
static sf_status step(run *r)
{
  make_beats(r);
  sf_frame f = {.command = SF_LINK_STREAM, .words = 1, .word = {(uint32_t)PATIENCE << 16 | pixels_wanted(r)}};
  for (int i = 0; i < r->beats; i++, f.words += SF_LINK_BEAT_WORDS) put_beat(&r->beat[i], f.word + f.words);
  SF_TRY(sf_link_call(&r->board->link, &f));
  const int taken = (int)(f.word[1] & 0xffff);
  const uint32_t pixels = f.word[1] >> 16;
  if (taken > r->beats) return sf_fail(SF_E_IO, "%s: more beats taken than were sent", r->board->link.port);
  memmove(r->beat, r->beat + taken, (size_t)(r->beats - taken) * sizeof *r->beat);
  r->beats -= taken;
  SF_TRY(take_pixels(r, &f, pixels));
  if (f.word[2] & 1) return trouble(r, "interrupt");
  return f.word[2] >> 31 && !taken && !pixels ? trouble(r, "hang") : sf_ok();
}

sf_status sf_board_run(sf_board *b, const sf_ray_request *request, int n, fx_pixel *pixel)
{
  run r = {.board = b, .request = request, .pixel = pixel, .n = n};
  sf_status status = sf_ok();
  while ((r.received < n || r.ray < n || r.beats > 0) && status.code == SF_OK) status = step(&r);
  if (status.code == SF_OK) status = step(&r); /* nothing more may come */
  return status;
}
