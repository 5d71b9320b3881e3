#include "sim/soc/stream.h"
#include "firmware/sf_soc.h"

enum { ACCESS_CYCLES = 4, STALL_INPUT = 18, STALL_OUTPUT, WORD = 4 };

/* Pins and registers of the two ports. The words of a beat begin at 0. Reading the last word of a result takes it. */
typedef struct sf_soc_port {
  bool rays;
  uint32_t beat_words, control, status, result, result_words;
} port;
static const port samples_port = {false, 2, SF_STREAM_CONTROL, SF_STREAM_STATUS, SF_STREAM_RESULT_LOW, 2};
static const port rays_port = {true,           SF_RAYS_BEAT_WORDS, SF_RAYS_CONTROL,
                               SF_RAYS_STATUS, SF_RAYS_PIXEL,      SF_RAYS_PIXEL_WORDS};

static void push(sf_soc_fifo *fifo, const sf_soc_beat *beat)
{
  fifo->beat[(fifo->head + fifo->count++) % SF_SOC_FIFO_BEATS] = *beat;
}

static void pop(sf_soc_fifo *fifo)
{
  fifo->head = (fifo->head + 1) % SF_SOC_FIFO_BEATS;
  fifo->count--;
}

static uint64_t pair(const uint32_t *word)
{
  return (uint64_t)word[1] << 32 | word[0];
}

/* ---- pins ---- */

static bool *valid_in(sf_soc_stream *s)
{
  return s->port->rays ? &s->dut->in.ray_valid : &s->dut->in.s_valid;
}

static bool *ready_out(sf_soc_stream *s)
{
  return s->port->rays ? &s->dut->in.pixel_ready : &s->dut->in.m_ready;
}

/* A beat that was offered stays until it is taken, as AXI4-Stream demands. */
static void offer(sf_soc_stream *s)
{
  sf_pins_in *in = &s->dut->in;
  const sf_soc_beat *beat = &s->in.beat[s->in.head];
  if (*valid_in(s) || s->in.count == 0 || sf_dut_stalls(s->dut, STALL_INPUT)) return;
  *valid_in(s) = true;
  in->s_user = in->ray_user = beat->control & SF_STREAM_CONTROL_FIRST;
  in->s_last = in->ray_last = beat->control & SF_STREAM_CONTROL_LAST;
  in->s_data = pair(beat->word);
  for (uint32_t i = 0; i < s->port->beat_words; i += 2) in->ray_data[i / 2] = pair(beat->word + i);
}

static sf_soc_beat shown(const sf_soc_stream *s)
{
  const sf_pins_out *out = &s->dut->out;
  sf_soc_beat beat = {.control = 0};
  for (uint32_t i = 0; i < s->port->result_words; i++)
    beat.word[i] = (uint32_t)((s->port->rays ? out->pixel_data[i / 2] : out->m_data) >> 32 * (i % 2));
  return beat;
}

static void each_cycle(void *context)
{
  sf_soc_stream *s = context;
  const sf_pins_out *out = &s->dut->out;
  if (*valid_in(s) && (s->port->rays ? out->ray_ready : out->s_ready)) {
    *valid_in(s) = false;
    pop(&s->in);
  }
  if (*ready_out(s) && (s->port->rays ? out->pixel_valid : out->m_valid)) {
    const sf_soc_beat beat = shown(s);
    push(&s->out, &beat);
  }
  offer(s);
  *ready_out(s) = s->out.count < SF_SOC_FIFO_BEATS && !sf_dut_stalls(s->dut, STALL_OUTPUT);
  if (s->port->rays) sf_memory_cycle(&s->memory);
}

void sf_soc_stream_attach(sf_soc_stream *stream, sf_dut *dut, bool rays)
{
  *stream = (sf_soc_stream){.dut = dut, .port = rays ? &rays_port : &samples_port};
  dut->each_cycle = each_cycle;
  dut->each_cycle_context = stream;
}

void sf_soc_stream_detach(sf_soc_stream *stream)
{
  stream->dut->each_cycle = NULL;
  *valid_in(stream) = *ready_out(stream) = false;
}

/* ---- the processor's side ---- */

static void advance(sf_soc_stream *stream)
{
  for (int i = 0; i < ACCESS_CYCLES; i++) sf_dut_tick(stream->dut);
}

static uint32_t status(const sf_soc_stream *s)
{
  return (s->in.count < SF_SOC_FIFO_BEATS ? SF_STREAM_STATUS_CAN_SEND : 0) |
         (s->out.count > 0 ? SF_STREAM_STATUS_HAS_RESULT : 0);
}

static uint32_t result(sf_soc_stream *s, uint32_t word)
{
  const uint32_t value = s->out.beat[s->out.head].word[word];
  if (word + 1 < s->port->result_words) return value;
  if (s->out.count == 0)
    s->fault = "a result was taken that is not there";
  else
    pop(&s->out);
  return value;
}

uint32_t sf_soc_stream_read(sf_soc_stream *stream, uint32_t offset)
{
  const port *p = stream->port;
  advance(stream);
  if (offset == p->status) return status(stream);
  if (offset >= p->result && offset < p->result + WORD * p->result_words)
    return result(stream, (offset - p->result) / WORD);
  stream->fault = "read of a register that is not there";
  return 0;
}

static void send(sf_soc_stream *s, uint32_t control)
{
  s->next.control = control;
  if (s->in.count == SF_SOC_FIFO_BEATS)
    s->fault = "a beat was sent into a full FIFO";
  else
    push(&s->in, &s->next);
}

void sf_soc_stream_write(sf_soc_stream *stream, uint32_t offset, uint32_t value)
{
  const port *p = stream->port;
  advance(stream);
  if (offset == p->control)
    send(stream, value);
  else if (offset < WORD * p->beat_words)
    stream->next.word[offset / WORD] = value;
  else
    stream->fault = "write to a register that is not there";
}
