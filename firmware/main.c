/* Renders a tile: takes scene and rays from the image in memory, programs the accelerator, walks every ray with the
 * fixed-point core's own marching (src/fx), leaves the pixels behind the image and prints the audit: the accelerator's
 * counters, their energy, a checksum of the picture. In a scene with a hash grid the core's grid and compositing run
 * here, and the accelerator computes the nets; in one of TensoRF it makes pixels of positions.
 * Whatever goes wrong is one line that begins with "error: ", and exit status 1. */
#include "firmware/sf_ray_stream.h"
#include "firmware/sf_soc.h"
#include "firmware/sf_stream.h"
#include "firmware/sf_tile.h"
#include "firmware/sf_uart.h"

typedef struct eval {
  sf_stream stream;
  sf_driver_code code;
} eval;

static uint32_t mmio_read(void *context, uint32_t offset)
{
  return *(volatile uint32_t *)((uintptr_t)context + offset);
}

static void mmio_write(void *context, uint32_t offset, uint32_t value)
{
  *(volatile uint32_t *)((uintptr_t)context + offset) = value;
}

static const sf_bus accelerator = {mmio_read, mmio_write, (void *)SF_SOC_ACCELERATOR};
static const sf_bus stream = {mmio_read, mmio_write, (void *)SF_SOC_STREAM};
static const sf_bus rays = {mmio_read, mmio_write, (void *)SF_SOC_RAYS};

static int fail(const char *what, const char *why, const char *detail)
{
  sf_uart_text("error: ");
  sf_uart_text(what);
  sf_uart_text(": ");
  sf_uart_text(why);
  if (detail) sf_uart_text(": "), sf_uart_text(detail);
  sf_uart_text("\n");
  return 1;
}

/* Only a device that was found has ERROR registers, which say more. */
static int fail_driver(const sf_tile *tile, const char *what, sf_driver_code code)
{
  const bool found = code == SF_DRIVER_REFUSED || code == SF_DRIVER_TIMEOUT;
  const uint32_t error = found ? accelerator.read(accelerator.context, SF_CSR_ERROR) : 0;
  const uint32_t of_rays = found && tile->lines ? accelerator.read(accelerator.context, SF_CSR_RAY_ERROR) : 0;
  return fail(what, sf_driver_text(code),
              error     ? sf_driver_error_text(error)
              : of_rays ? sf_ray_driver_error_text(of_rays)
                        : NULL);
}

/* The planes stay where they are in the image. */
static sf_driver_code load_planes(const sf_tile *tile)
{
  const fx_scene *scene = &tile->scene;
  sf_ray_blob blob = {.trans_stop = (uint32_t)scene->trans_stop,
                      .max_samples = (uint32_t)scene->max_samples,
                      .table = (uint32_t)(uintptr_t)tile->lines};
  for (int o = 0; o < 3; o++) blob.background[o] = (uint32_t)scene->background[o];
  const sf_driver_code code = sf_ray_driver_load(&accelerator, &blob, &tile->planes);
  if (code == SF_DRIVER_OK) sf_ray_driver_clear(&accelerator);
  return code;
}

/* fx_net_fn: the accelerator takes the place of fx_net_sample. */
static sf_status accelerate(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  eval *e = user;
  uint32_t result[4];
  sf_status status = sf_ok();
  e->code = sf_stream_sample(&e->stream, first ? ray->dir : NULL, f, result);
  if (e->code != SF_DRIVER_OK) status.code = SF_E_IO;
  *out = (fx_out){result[0], {result[1], result[2], result[3]}};
  return status;
}

static sf_driver_code render_rays(const sf_tile *tile)
{
  sf_driver_code code = SF_DRIVER_OK;
  for (uint32_t i = 0; i < tile->width * tile->height && code == SF_DRIVER_OK; i++)
    code = sf_ray_stream_pixel(&rays, &tile->scene, &tile->rays[i], i == 0, &tile->pixels[i]);
  return code;
}

static sf_driver_code render_samples(const sf_tile *tile)
{
  eval e = {.stream = sf_stream_for(&stream, &tile->net)};
  for (uint32_t i = 0; i < tile->width * tile->height; i++)
    if (fx_render_ray(&tile->scene, &tile->rays[i], accelerate, &e, &tile->pixels[i], NULL).code != SF_OK) break;
  return e.code;
}

static uint64_t total(const sf_driver_counters *counters, int event, int layer)
{
  uint64_t sum = 0;
  for (int t = 0; t < SF_T_MAX; t++) sum += counters->event[event][layer][t];
  return sum;
}

static void print_field(void)
{
  sf_field_counters field;
  sf_ray_driver_field(&accelerator, &field);
  sf_uart_number("\naudit lookups ", field.lookups);
  sf_uart_number(" misses ", field.misses);
}

/* A decoder cannot tell where a ray begins. */
static uint64_t rays_with_samples(const sf_tile *tile)
{
  uint64_t n = 0;
  for (uint32_t i = 0; i < tile->width * tile->height; i++) n += tile->pixels[i].samples > 0;
  return n;
}

static void print_audit(const sf_tile *tile, const sf_driver_counters *counters)
{
  static const char *const event[SF_EVENTS] = {
#define EVENT(id, name, title, unit, fj) " " #name " ",
      SF_EVENT_TABLE(EVENT)
#undef EVENT
  };
  uint64_t energy = 0;
  for (int l = 0; l < SF_LAYERS; l++) {
    sf_uart_text("audit ");
    sf_uart_text(fx_layer_name(l));
    for (int e = 0; e < SF_EVENTS; e++) sf_uart_number(event[e], total(counters, e, l));
    sf_uart_text("\n");
    energy += total(counters, SF_EVENT_MAC, l) * SF_MAC_FJ + total(counters, SF_EVENT_SOP, l) * SF_SOP_FJ;
  }
  sf_uart_number("audit samples ", counters->samples);
  sf_uart_number(" rays ", tile->lines ? rays_with_samples(tile) : counters->rays);
  if (tile->lines) print_field();
  sf_uart_number("\naudit energy_fj ", energy);
  sf_uart_hex("\naudit rgba_crc ", sf_rgba_crc(tile->pixels, tile->width * tile->height));
  sf_uart_number("\ncycles ", counters->cycles);
  sf_uart_number(" busy ", counters->busy);
  sf_uart_text("\n");
}

static void print_tile(const sf_tile *tile)
{
  sf_uart_number("tile ", tile->width);
  sf_uart_number(" x ", tile->height);
  sf_uart_number(" pixels, ", (uint64_t)tile->net.steps);
  sf_uart_number(" time steps, ", tile->lines ? tile->planes.features : (uint64_t)tile->net.layer[0].n_in);
  sf_uart_text(tile->lines ? " features of planes\n" : " features\n");
}

int main(void)
{
  static sf_driver_counters counters;
  static sf_tile tile;
  sf_uart_text("spikefield firmware\n");
  const char *why = sf_tile_open((uint8_t *)SF_SOC_IMAGE, SF_SOC_IMAGE_SPACE, &tile);
  if (why) return fail("image", why, NULL);
  print_tile(&tile);
  sf_driver_code code = sf_driver_probe(&accelerator);
  if (code != SF_DRIVER_OK) return fail_driver(&tile, "probe", code);
  code = sf_driver_load(&accelerator, &tile.net);
  if (code != SF_DRIVER_OK) return fail_driver(&tile, "load", code);
  if (tile.lines) code = load_planes(&tile);
  if (code != SF_DRIVER_OK) return fail_driver(&tile, "load planes", code);
  code = sf_driver_clear(&accelerator);
  if (code != SF_DRIVER_OK) return fail_driver(&tile, "clear counters", code);
  code = (tile.lines ? render_rays : render_samples)(&tile);
  if (code != SF_DRIVER_OK) return fail_driver(&tile, "render", code);
  code = sf_driver_read_counters(&accelerator, &counters);
  if (code != SF_DRIVER_OK) return fail_driver(&tile, "read counters", code);
  print_audit(&tile, &counters);
  sf_uart_text("done\n");
  return 0;
}
