#include "firmware/sf_ray_stream.h"
#include "firmware/sf_soc.h"
#include "firmware/sf_stream.h"
#include <string.h>

enum { WORD = 4, DIRECTION_WORDS = 2 };

static void put(const sf_bus *bus, uint32_t offset, uint32_t value)
{
  bus->write(bus->context, offset, value);
}

static void put_words(const sf_bus *fifos, uint32_t at, const uint32_t *word, uint32_t n)
{
  for (uint32_t i = 0; i < n; i++) put(fifos, SF_RAYS_BEAT + WORD * (at + i), word[i]);
}

/* The block reads these with a ray's first beat. */
static void put_ray(const sf_bus *fifos, const fx_ray *ray, bool empty, bool new_tile)
{
  const uint32_t x = (uint16_t)ray->unit[0], y = (uint16_t)ray->unit[1], z = (uint16_t)ray->unit[2];
  const uint32_t word[DIRECTION_WORDS] = {x | y << 16, z | (uint32_t)empty << 16 | (uint32_t)new_tile << 17};
  put_words(fifos, SF_RAYS_BEAT_WORDS - DIRECTION_WORDS, word, DIRECTION_WORDS);
}

static void put_sample(const sf_bus *fifos, const fx_scene *scene, const fx_ray *ray, int32_t at, const uint32_t pos[3])
{
  const uint64_t distance = fx_distance(scene, ray, at);
  const uint32_t word[SF_RAYS_BEAT_WORDS - DIRECTION_WORDS] = {
      pos[0], pos[1], pos[2], (uint32_t)fx_delta(scene, at), (uint32_t)distance, (uint32_t)(distance >> 32)};
  put_words(fifos, 0, word, SF_RAYS_BEAT_WORDS - DIRECTION_WORDS);
}

static sf_driver_code receive(const sf_bus *fifos, fx_pixel *pixel)
{
  uint32_t word[SF_RAYS_PIXEL_WORDS], status;
  const sf_driver_code code = sf_stream_await(fifos, SF_RAYS_STATUS, SF_STREAM_STATUS_HAS_RESULT, &status);
  if (code != SF_DRIVER_OK) return code;
  for (uint32_t i = 0; i < SF_RAYS_PIXEL_WORDS; i++) word[i] = fifos->read(fifos->context, SF_RAYS_PIXEL + WORD * i);
  memcpy(pixel, word, sizeof *pixel);
  return SF_DRIVER_OK;
}

/* The accelerator drops what follows the end of a ray, and knows by the last beat where the next one begins. */
sf_driver_code sf_ray_stream_pixel(const sf_bus *fifos, const fx_scene *scene, const fx_ray *ray, bool new_tile,
                                   fx_pixel *pixel)
{
  uint32_t pos[3], status, control = SF_STREAM_CONTROL_FIRST;
  int32_t at = fx_march_next(scene, ray, 0, pos, NULL);
  put_ray(fifos, ray, at < 0, new_tile);
  while (!(control & SF_STREAM_CONTROL_LAST)) {
    if (at >= 0) {
      put_sample(fifos, scene, ray, at, pos);
      at = fx_march_next(scene, ray, at + 1, pos, NULL);
    }
    const sf_driver_code code = sf_stream_await(fifos, SF_RAYS_STATUS, SF_STREAM_STATUS_CAN_SEND, &status);
    if (code != SF_DRIVER_OK) return code;
    if (at < 0 || (status & SF_STREAM_STATUS_HAS_RESULT)) control |= SF_STREAM_CONTROL_LAST;
    put(fifos, SF_RAYS_CONTROL, control);
    control &= SF_STREAM_CONTROL_LAST;
  }
  return receive(fifos, pixel);
}
