#include "sim/ray/ray.h"
#include "base/rng.h"

enum { STREAM_REQUEST = 32, STREAM_ANSWER, STREAM_LATENCY, LATENCY_MAX = 24 };

/* An entry beyond the table is counted and read as 0. */
static uint16_t read_entry(sf_memory *m, uint32_t address)
{
  if (address >= (uint64_t)m->grid->entries) {
    m->outside++;
    return 0;
  }
  const int8_t *entry = m->grid->table + (uint64_t)address * FX_GRID_FEATURES;
  return (uint16_t)((unsigned)(uint8_t)entry[1] << 8 | (uint8_t)entry[0]);
}

static void take(sf_memory *m)
{
  const sf_dut *dut = m->dut;
  m->answered += dut->in.mem_answer;
  if (!dut->in.mem_ready || !dut->out.mem_request) return;
  const uint64_t tail = m->asked++ % SF_MEMORY_QUEUE;
  m->data[tail] = read_entry(m, dut->out.mem_address);
  m->due[tail] = dut->cycle + sf_random_below(dut->seed, STREAM_LATENCY, dut->cycle, LATENCY_MAX);
}

static void offer(sf_memory *m)
{
  sf_dut *dut = m->dut;
  const uint64_t waiting = m->asked - m->answered, head = m->answered % SF_MEMORY_QUEUE;
  dut->in.mem_ready = waiting < SF_MEMORY_QUEUE && !sf_dut_stalls(dut, STREAM_REQUEST);
  dut->in.mem_answer = waiting > 0 && m->due[head] <= dut->cycle && !sf_dut_stalls(dut, STREAM_ANSWER);
  dut->in.mem_data = m->data[head];
}

void sf_memory_cycle(void *memory)
{
  take(memory);
  offer(memory);
}
