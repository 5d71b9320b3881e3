#include "cycles/planes.h"
#include "cycles/lines.h"
#include "cycles/state.h"
#include "fx/tensorf.h"
#include "fx/tensorf_place.h"
#include <stdlib.h>

/* Cycles from one event to another, as the stages of the RTL make them. */
enum {
  HOLD = 2,          /* from a beat that was taken to the next one, rtl/sf_light.sv */
  POSITION = 3,      /* from a position to its first line, rtl/sf_planes_reads.sv */
  WEIGHT = 38,       /* from the last line of a density to its exponential */
  DECIDE = 5,        /* from there to what becomes of the sample */
  ITEMS = 63,        /* that wait for the compositor, rtl/sf_light.sv */
  BLOCK = 8,         /* from the last line of 16 components to the basis matrix */
  BLOCK_CYCLES = 16, /* there, rtl/sf_basis.sv */
  SUMS = 3,          /* from its last component to the sums */
  SCALED = 6,        /* from the last feature to the values, rtl/sf_waves.sv */
  BEAT = 14,         /* from the first value to the first beat */
  BEAT_VALUES = 4,
  COLOUR_CYCLES = 6,                    /* of the compositor with a colour, rtl/sf_composite.sv */
  LIGHT_CYCLES = 3,                     /* and without */
  PIXEL_CYCLES = 7,                     /* more for a ray's last sample, and a cycle to hand it over */
  RING_READS = 128,                     /* samples inside, at most; a power of two */
  BLOCKS = FX_COMPONENTS_MAX / FX_LINE, /* of 16 components per pair, at most */
  APPEARANCES = 5                       /* on their way to rtl/sf_waves.sv, at most */
};

typedef struct item {
  bool decoded, last, empty;
  uint64_t pushed, taken;
} item;

struct sf_planes_model {
  const fx_scene *scene;
  int inputs;
  lines field;
  sf_cycle_model *nets;
  sf_planes_totals totals;
  /* light */
  uint64_t beat;                                   /* the next one can be held */
  uint64_t free;                                   /* the reads can take a position */
  uint64_t gone;                                   /* the last sample left */
  uint64_t asked[RING_READS], weighed[RING_READS]; /* by number of the density */
  /* appearances */
  uint64_t basis_free, sums_out, scale_free, bank_free[2], value_free, appearance_left[APPEARANCES];
  /* compositor */
  item items[RING_READS];
  uint64_t pushed, composited, composite_free, pixel;
};

static uint64_t later(uint64_t a, uint64_t b)
{
  return a > b ? a : b;
}

/* ---- compositor ---- */

static void composite(sf_planes_model *m, item *next, uint64_t at)
{
  const uint64_t cycles = next->empty ? 0 : next->decoded ? COLOUR_CYCLES - 1 : LIGHT_CYCLES - 1;
  next->taken = at;
  m->composited++;
  m->composite_free = at + cycles + 1;
  if (!next->last) return;
  m->pixel = at + cycles + PIXEL_CYCLES;
  m->composite_free = m->pixel + 1;
}

/* Items without a colour, as far as they are taken until a cycle. */
static void composite_until(sf_planes_model *m, uint64_t clock)
{
  while (m->composited < m->pushed) {
    item *next = &m->items[m->composited % RING_READS];
    const uint64_t at = later(next->pushed + 1, m->composite_free);
    if (next->decoded || at > clock) return;
    composite(m, next, at);
  }
}

/* taker: the result at this cycle goes to the first item that waits, if that has come so far. */
static bool take_result(void *user, uint64_t clock)
{
  sf_planes_model *m = user;
  composite_until(m, clock);
  item *next = &m->items[m->composited % RING_READS];
  if (m->composited == m->pushed || !next->decoded) return false;
  if (clock <= next->pushed || clock < m->composite_free) return false;
  composite(m, next, clock);
  return true;
}

/* Until the item of this number has been taken, and when that was. */
static uint64_t taken_at(sf_planes_model *m, uint64_t number)
{
  composite_until(m, UINT64_MAX);
  while (m->composited <= number) {
    sf_tick(m->nets);
    if (m->items[m->composited % RING_READS].decoded) continue;
    composite_until(m, UINT64_MAX);
  }
  return m->items[number % RING_READS].taken;
}

/* There is room for one more from this cycle on, which is counted a cycle late. */
static uint64_t room_for_item(sf_planes_model *m)
{
  if (m->pushed == 0) return 0;
  const uint64_t behind = m->items[(m->pushed - 1) % RING_READS].pushed + 2;
  return m->pushed < ITEMS ? behind : later(behind, taken_at(m, m->pushed - ITEMS) + 2);
}

static void push_item(sf_planes_model *m, item next)
{
  m->items[m->pushed++ % RING_READS] = next;
}

/* ---- decoder ---- */

/* The engine's clock stands still while nothing is in it. */
static void run_nets(sf_planes_model *m, uint64_t clock)
{
  while (m->nets->clock < clock && !sf_idle(m->nets)) sf_tick(m->nets);
  if (m->nets->clock < clock) m->nets->clock = clock;
}

/* The first beat is offered at `at`. Returns when it is taken. */
static uint64_t send_packet(sf_planes_model *m, const sf_cycle_sample *sample, uint64_t at)
{
  sf_cycle_model *nets = m->nets;
  run_nets(m, at);
  while (nets->now.in.full == 2) sf_tick(nets);
  const uint64_t begins = nets->clock;
  sf_cycle_sample *next = &nets->ring[nets->now.added++ % RING];
  *next = *sample;
  next->first_beat = begins;
  next->last_beat = begins + (uint64_t)(m->inputs > BEAT_VALUES ? m->inputs - BEAT_VALUES : 0);
  return begins;
}

/* ---- field ---- */

/* Of `rows` rows of a plane, or the one of a line, with 1 or 2 points each of `of_point` lines. Two points beside each
 * other are read at once where their lines lie in both banks of the cache. come[]: when the last line of each block of
 * 16 components came. Returns the line behind. */
static const uint32_t *read_rows(sf_planes_model *m, const uint32_t *line, int rows, int points, int of_point,
                                 uint64_t *ready, bool *empty, uint64_t come[BLOCKS])
{
  const int at_once = of_point % 2 ? points : 1;
  for (int row = 0; row < rows; row++)
    for (int i = 0; i < of_point * points; i += at_once, line += at_once) {
      const uint32_t two[2] = {line[0], line[at_once - 1]};
      come[i / points] = lines_next(&m->field, two, *ready, *empty);
      *ready = m->field.issued + 1, *empty = false;
    }
  return line;
}

/* Lines of a position. block[] says when the last one of each block of 16 components came. Returns when the last one of
 * all came. */
static uint64_t read_lines(sf_planes_model *m, const sf_planes_read *read, bool appearance, uint64_t at, bool empty,
                           uint64_t block[FX_PAIRS * BLOCKS], int *blocks)
{
  uint32_t line[FX_LOOKUPS_ROOM];
  const uint32_t *next = line;
  const fx_tensorf *field = &m->scene->tensorf;
  const fx_factors *factors = appearance ? &field->appearance : &field->density;
  const vm_place place = vm_find(field->res, read->pos);
  uint64_t ready = at + POSITION;
  m->totals.lookups += (uint64_t)fx_tensorf_lines(field, appearance, read->pos, line);
  *blocks = 0;
  for (int pair = 0; pair < FX_PAIRS; pair++) {
    const int *axes = fx_pair_axes[pair], of_point = (factors->components[pair] + FX_LINE - 1) / FX_LINE;
    const int u = 1 + (place.g[axes[0]] != 0), v = 1 + (place.g[axes[1]] != 0), w = 1 + (place.g[axes[2]] != 0);
    uint64_t *come = block + *blocks;
    next = read_rows(m, next, v, u, of_point, &ready, &empty, come);
    next = read_rows(m, next, 1, w, of_point, &ready, &empty, come);
    *blocks += of_point;
  }
  m->free = ready;
  return block[*blocks - 1];
}

/* The next sample's packet, whose blocks of components come as block[] says. */
static void read_appearance(sf_planes_model *m, const sf_planes_read *read, const sf_cycle_sample *sample, uint64_t at)
{
  uint64_t block[FX_PAIRS * BLOCKS] = {0}, begins = m->basis_free;
  const uint64_t number = m->totals.decoded++, bank = number % 2;
  int blocks;
  read_lines(m, read, true, at, false, block, &blocks);
  for (int i = 0; i < blocks; i++) begins = later(block[i] + BLOCK, begins) + BLOCK_CYCLES;
  const uint64_t sums = later(begins - 1 + SUMS, m->sums_out); /* handed over, once those before have left */
  const uint64_t scales = later(sums + 1, later(m->scale_free, m->bank_free[bank]));
  const uint64_t scaled = scales + 2 * (uint64_t)m->scene->tensorf.features;
  const uint64_t values = later(scaled + SCALED + 1, m->value_free);
  const uint64_t offered = values + BEAT - (m->inputs < BEAT_VALUES ? (uint64_t)(BEAT_VALUES - m->inputs) : 0);
  m->basis_free = sums + 1;
  m->appearance_left[number % APPEARANCES] = m->sums_out = scaled;
  m->scale_free = scaled + SCALED;
  const uint64_t stalled = send_packet(m, sample, offered) - offered;
  const uint64_t last_value = values + (uint64_t)m->inputs - 1 + stalled;
  m->bank_free[bank] = last_value + 1;
  m->value_free = last_value + 2;
}

/* ---- light ---- */

static void read_density(sf_planes_model *m, const sf_planes_read *read, uint64_t i, uint64_t at_least, bool empty)
{
  uint64_t block[FX_PAIRS * BLOCKS] = {0}, at = later(at_least, later(m->beat, m->free));
  int blocks;
  m->asked[i % RING_READS] = at;
  m->weighed[i % RING_READS] = read_lines(m, read, false, at, empty, block, &blocks) + WEIGHT;
  m->beat = at + HOLD;
}

/* What becomes of the oldest sample, i, once those up to `newest` are asked for. */
static void decide(sf_planes_model *m, const sf_planes_read *read, uint64_t i, uint64_t newest,
                   const sf_cycle_sample *sample)
{
  uint64_t at = later(m->gone + 1, m->weighed[i % RING_READS]) + DECIDE;
  if (!read->behind) at = later(at, m->asked[newest % RING_READS] + 1);
  at = later(at, room_for_item(m));
  m->gone = at;
  if (read->behind) return;
  push_item(m, (item){.decoded = read->decoded, .last = read->last || read->ends, .pushed = at});
  if (!read->decoded) return;
  at = later(at + 1, m->free);
  if (m->totals.decoded >= APPEARANCES) at = later(at, m->appearance_left[m->totals.decoded % APPEARANCES] + 1);
  m->gone = at;
  read_appearance(m, read, sample, at);
}

/* Densities of a ray in turn with what becomes of those FX_AHEAD before them. */
static const sf_cycle_sample *add_ray(sf_planes_model *m, const sf_planes_read *read, size_t n, bool new_tile,
                                      const sf_cycle_sample *sample)
{
  const uint64_t base = m->totals.densities;
  size_t oldest = 0;
  for (size_t i = 0; i < n; i++) {
    read_density(m, &read[i], base + i, m->gone + 1, new_tile && i == 0);
    const bool last = i + 1 == n;
    while (oldest <= i && (last || i - oldest == FX_AHEAD)) {
      decide(m, &read[oldest], base + oldest, base + i, sample);
      sample += read[oldest++].decoded;
    }
  }
  m->totals.densities += n;
  return sample;
}

static void add_empty_ray(sf_planes_model *m)
{
  const uint64_t at = later(m->beat, later(m->gone + 1, room_for_item(m)));
  push_item(m, (item){.last = true, .empty = true, .pushed = at});
  m->beat = at + HOLD;
}

/* ---- the model ---- */

sf_status sf_planes_model_open(sf_planes_model **model, const fx_scene *scene, const sf_engine *engine,
                               const fx_cache_shape *cache, int latency)
{
  sf_planes_model *m = *model = calloc(1, sizeof *m);
  if (!m) return sf_fail(SF_E_MEMORY, "no memory for the cycle model");
  m->scene = scene;
  m->inputs = fx_tensorf_inputs(&scene->tensorf);
  m->beat = 1;
  m->nets = sf_cycle_model_create(&scene->net, engine);
  if (!m->nets) return sf_fail(SF_E_MEMORY, "no memory for the cycle model");
  m->nets->takes = take_result, m->nets->user = m;
  return lines_open(&m->field, cache, latency);
}

void sf_planes_model_add(sf_planes_model *m, const sf_planes_record *record, bool new_tile)
{
  const sf_cycle_sample *sample = record->nets.at;
  for (size_t i = 0, n; i < record->count; i += n, m->totals.rays++) {
    for (n = 1; !record->at[i + n - 1].last;) n++;
    if (record->at[i].empty) {
      add_empty_ray(m);
      continue;
    }
    sample = add_ray(m, &record->at[i], n, new_tile, sample);
    new_tile = false;
  }
  m->totals.misses = m->field.misses;
}

void sf_planes_model_drain(sf_planes_model *m)
{
  if (m->pushed) taken_at(m, m->pushed - 1);
  while (!sf_idle(m->nets)) sf_tick(m->nets);
  m->totals.cycles = m->pixel + 1;
}

const sf_planes_totals *sf_planes_model_totals(const sf_planes_model *model)
{
  return &model->totals;
}

const sf_cycle_totals *sf_planes_model_engine(const sf_planes_model *model)
{
  return sf_cycle_model_totals(model->nets);
}

void sf_planes_model_close(sf_planes_model *model)
{
  if (!model) return;
  lines_close(&model->field);
  sf_cycle_model_free(model->nets);
  free(model);
}
