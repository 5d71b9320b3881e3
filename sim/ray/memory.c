#include "sim/ray/ray.h"
#include "base/rng.h"
#include <stdlib.h>

enum { STREAM_REQUEST = 32, STREAM_ANSWER, STREAM_LATENCY, STREAM_BASE, LATENCY_MAX = 24 };
enum { BEAT_BYTES = 8, BEATS = 2, SIZE_8_BYTES = 3, INCREMENTING = 1, BOUNDARY = 4096, BASE_LOW = 1 << 28 };

uint32_t sf_memory_base(uint64_t seed)
{
  const uint64_t most = (UINT64_C(1) << 32) - 2 * BASE_LOW; /* room for a table of BASE_LOW bytes */
  return BASE_LOW + (uint32_t)sf_random_below(seed, STREAM_BASE, 0, most / SF_LINE_BYTES) * SF_LINE_BYTES;
}

sf_status sf_memory_fill(sf_memory *m, const fx_scene *scene)
{
  const fx_grid *grid = &scene->grid;
  fx_factor_place place[2 * FX_PAIRS];
  m->contents = (const uint8_t *)grid->table, m->bytes = (uint64_t)grid->entries * FX_GRID_FEATURES;
  if (scene->backbone == FX_INGP) return sf_ok();
  m->bytes = (uint64_t)fx_tensorf_places(&scene->tensorf, place) * SF_LINE_BYTES;
  m->contents = m->planes = malloc(m->bytes);
  if (!m->planes) return sf_fail(SF_E_MEMORY, "no memory for the accelerator's planes");
  fx_tensorf_memory(&scene->tensorf, m->planes);
  return sf_ok();
}

/* ---- AXI's rules, and this block's ---- */

static const char *broken_rule(const sf_memory *m)
{
  const sf_pins_out *out = &m->dut->out;
  if (m->waits && (!out->ar_valid || out->ar_address != m->waiting)) return "a request of the memory changed or went";
  if (m->dut->in.r_valid && !out->r_ready) return "no room for an answer that was asked for";
  if (!out->ar_valid) return NULL;
  if (out->ar_len != BEATS - 1 || out->ar_size != SIZE_8_BYTES || out->ar_burst != INCREMENTING)
    return "a burst that is not two beats of eight bytes";
  if (out->ar_prot) return "a request that is not unprivileged, secure and of data";
  if (out->ar_address % SF_LINE_BYTES) return "a burst that is not aligned to a line";
  if (out->ar_address % BOUNDARY + BEATS * BEAT_BYTES > BOUNDARY) return "a burst across 4 KiB";
  return NULL;
}

static void watch(sf_memory *m)
{
  const char *what = broken_rule(m);
  if (what && !m->fault) m->fault = what;
  m->waits = m->dut->out.ar_valid && !m->dut->in.ar_ready;
  m->waiting = m->dut->out.ar_address;
}

/* ---- contents ---- */

/* What lies beyond the table in its last line reads as 0. */
static uint64_t read_beat(const sf_memory *m, uint32_t address)
{
  const uint64_t at = (uint32_t)(address - m->base), end = m->bytes;
  uint64_t value = 0;
  for (uint64_t i = 0; i < BEAT_BYTES && at + i < end; i++) value |= (uint64_t)m->contents[at + i] << 8 * i;
  return value;
}

static void take(sf_memory *m)
{
  const sf_dut *dut = m->dut;
  if (dut->in.r_valid) {
    m->answered += dut->in.r_last;
    m->second = !dut->in.r_last;
  }
  if (!dut->in.ar_ready || !dut->out.ar_valid) return;
  const uint64_t tail = m->asked++ % SF_MEMORY_QUEUE;
  const uint64_t latency =
      m->latency ? (uint64_t)m->latency : sf_random_below(dut->seed, STREAM_LATENCY, dut->cycle, LATENCY_MAX);
  m->address[tail] = dut->out.ar_address;
  m->due[tail] = dut->cycle + latency;
  m->outside += (uint32_t)(dut->out.ar_address - m->base) >= m->bytes;
}

static void offer(sf_memory *m)
{
  sf_dut *dut = m->dut;
  const uint64_t waiting = m->asked - m->answered, head = m->answered % SF_MEMORY_QUEUE;
  dut->in.ar_ready = waiting < SF_MEMORY_QUEUE && !sf_dut_stalls(dut, STREAM_REQUEST);
  dut->in.r_valid = waiting > 0 && m->due[head] <= dut->cycle && !sf_dut_stalls(dut, STREAM_ANSWER);
  dut->in.r_last = dut->in.r_valid && m->second;
  dut->in.r_data = dut->in.r_valid ? read_beat(m, m->address[head] + (m->second ? BEAT_BYTES : 0)) : 0;
}

void sf_memory_cycle(void *memory)
{
  sf_memory *m = memory;
  if (m->dut->in.rst_n) {
    watch(m);
    take(m);
  } else { /* of the memory, too */
    m->answered = m->asked;
    m->second = m->waits = false;
  }
  offer(m);
}
