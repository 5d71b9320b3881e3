#include "firmware/sf_stream.h"
#include "firmware/sf_soc.h"
#include <stddef.h>

enum { VALUES = 4, RESULT_BEATS = 2 };

static uint32_t get(const sf_stream *stream, uint32_t offset)
{
  return stream->bus.read(stream->bus.context, offset);
}
static void put(const sf_stream *stream, uint32_t offset, uint32_t value)
{
  stream->bus.write(stream->bus.context, offset, value);
}

sf_stream sf_stream_for(const sf_bus *bus, const sf_net_blob *net)
{
  enum { D1, D2, C1 };
  const int n_h = net->layer[D1].n_out ? net->layer[D2].n_out - 1 : 0;
  return (sf_stream){*bus, net->layer[C1].n_in - n_h, net->layer[D1].n_in};
}

static uint32_t pair(const int16_t *value, int n)
{
  return (n > 0 ? (uint16_t)value[0] : 0u) | (n > 1 ? (uint32_t)(uint16_t)value[1] << 16 : 0u);
}

sf_driver_code sf_stream_await(const sf_bus *bus, uint32_t offset, uint32_t state, uint32_t *status)
{
  for (int32_t i = 0; i < SF_STREAM_POLLS; i++)
    if ((*status = bus->read(bus->context, offset)) & state) return SF_DRIVER_OK;
  return SF_DRIVER_TIMEOUT;
}

static sf_driver_code await(const sf_stream *stream, uint32_t state)
{
  uint32_t status;
  return sf_stream_await(&stream->bus, SF_STREAM_STATUS, state, &status);
}

/* n values as beats of four, the last one filled with zeros. */
static sf_driver_code send(const sf_stream *stream, const int16_t *value, int n, uint32_t first, uint32_t last)
{
  for (int i = 0; i < n; i += VALUES) {
    const sf_driver_code code = await(stream, SF_STREAM_STATUS_CAN_SEND);
    if (code != SF_DRIVER_OK) return code;
    put(stream, SF_STREAM_LOW, pair(value + i, n - i));
    put(stream, SF_STREAM_HIGH, pair(value + i + 2, n - i - 2));
    put(stream, SF_STREAM_CONTROL, (i == 0 ? first : 0) | (i + VALUES >= n ? last : 0));
  }
  return SF_DRIVER_OK;
}

static sf_driver_code receive(const sf_stream *stream, uint32_t result[4])
{
  for (int beat = 0; beat < RESULT_BEATS; beat++) {
    const sf_driver_code code = await(stream, SF_STREAM_STATUS_HAS_RESULT);
    if (code != SF_DRIVER_OK) return code;
    result[2 * beat] = get(stream, SF_STREAM_RESULT_LOW);
    result[2 * beat + 1] = get(stream, SF_STREAM_RESULT_HIGH);
  }
  return SF_DRIVER_OK;
}

sf_driver_code sf_stream_sample(const sf_stream *stream, const int16_t *dir, const int16_t *f, uint32_t result[4])
{
  const int n_dir = dir ? stream->n_dir : 0;
  const uint32_t whole = stream->n_feature == 0 ? SF_STREAM_CONTROL_LAST : 0;
  sf_driver_code code = send(stream, dir, n_dir, SF_STREAM_CONTROL_FIRST, whole);
  const uint32_t first = dir && n_dir == 0 ? SF_STREAM_CONTROL_FIRST : 0; /* a net without directions */
  if (code == SF_DRIVER_OK) code = send(stream, f, stream->n_feature, first, SF_STREAM_CONTROL_LAST);
  return code == SF_DRIVER_OK ? receive(stream, result) : code;
}
