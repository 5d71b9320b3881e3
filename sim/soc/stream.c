#include "sim/soc/stream.h"
#include "firmware/sf_soc.h"

enum { ACCESS_CYCLES = 4, STALL_INPUT = 18, STALL_OUTPUT };

static void push(sf_soc_fifo *fifo, uint64_t data, uint8_t control)
{
  const uint32_t at = (fifo->head + fifo->count++) % SF_SOC_FIFO_BEATS;
  fifo->data[at] = data;
  fifo->control[at] = control;
}

static void pop(sf_soc_fifo *fifo)
{
  fifo->head = (fifo->head + 1) % SF_SOC_FIFO_BEATS;
  fifo->count--;
}

/* A beat that was offered stays until it is taken, as AXI4-Stream demands. */
static void offer(sf_soc_stream *s)
{
  sf_pins_in *in = &s->dut->in;
  if (in->s_valid || s->in.count == 0 || sf_dut_stalls(s->dut, STALL_INPUT)) return;
  const uint8_t control = s->in.control[s->in.head];
  in->s_valid = true;
  in->s_data = s->in.data[s->in.head];
  in->s_user = control & SF_STREAM_CONTROL_FIRST;
  in->s_last = control & SF_STREAM_CONTROL_LAST;
}

static void each_cycle(void *context)
{
  sf_soc_stream *s = context;
  sf_pins_in *in = &s->dut->in;
  const sf_pins_out *out = &s->dut->out;
  if (in->s_valid && out->s_ready) {
    in->s_valid = false;
    pop(&s->in);
  }
  if (in->m_ready && out->m_valid) push(&s->out, out->m_data, 0);
  offer(s);
  in->m_ready = s->out.count < SF_SOC_FIFO_BEATS && !sf_dut_stalls(s->dut, STALL_OUTPUT);
}

void sf_soc_stream_attach(sf_soc_stream *stream, sf_dut *dut)
{
  *stream = (sf_soc_stream){.dut = dut};
  dut->each_cycle = each_cycle;
  dut->each_cycle_context = stream;
}

void sf_soc_stream_detach(sf_soc_stream *stream)
{
  sf_dut *dut = stream->dut;
  dut->each_cycle = NULL;
  dut->in.s_valid = dut->in.m_ready = false;
}

static void advance(sf_soc_stream *stream)
{
  for (int i = 0; i < ACCESS_CYCLES; i++) sf_dut_tick(stream->dut);
}

static uint32_t status(const sf_soc_stream *s)
{
  return (s->in.count < SF_SOC_FIFO_BEATS ? SF_STREAM_STATUS_CAN_SEND : 0) |
         (s->out.count > 0 ? SF_STREAM_STATUS_HAS_RESULT : 0);
}

static uint32_t take(sf_soc_stream *s)
{
  const uint64_t data = s->out.data[s->out.head];
  if (s->out.count == 0)
    s->fault = "a result was taken that is not there";
  else
    pop(&s->out);
  return (uint32_t)(data >> 32);
}

uint32_t sf_soc_stream_read(sf_soc_stream *stream, uint32_t offset)
{
  advance(stream);
  switch (offset) {
  case SF_STREAM_STATUS:
    return status(stream);
  case SF_STREAM_RESULT_LOW:
    return (uint32_t)stream->out.data[stream->out.head];
  case SF_STREAM_RESULT_HIGH:
    return take(stream);
  }
  stream->fault = "read of a register that is not there";
  return 0;
}

static void send(sf_soc_stream *s, uint32_t control)
{
  if (s->in.count == SF_SOC_FIFO_BEATS)
    s->fault = "a beat was sent into a full FIFO";
  else
    push(&s->in, (uint64_t)s->high << 32 | s->low, (uint8_t)control);
}

void sf_soc_stream_write(sf_soc_stream *stream, uint32_t offset, uint32_t value)
{
  advance(stream);
  switch (offset) {
  case SF_STREAM_LOW:
    stream->low = value;
    return;
  case SF_STREAM_HIGH:
    stream->high = value;
    return;
  case SF_STREAM_CONTROL:
    send(stream, value);
    return;
  }
  stream->fault = "write to a register that is not there";
}
