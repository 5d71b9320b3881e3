/* Writes the image that firmware/sf_tile.c reads. */
#include "sim/soc/job.h"
#include "firmware/sf_soc.h"
#include "firmware/sf_tile.h"
#include "fx/cache.h"
#include "fx/scene.h"
#include "fx/tensorf.h"
#include "sim/ray/ray.h"
#include <stdlib.h>
#include <string.h>

typedef struct plan {
  size_t net, table, planes, lines, occupancy, steps, rays, end; /* table, or planes and lines */
} plan;

static size_t aligned(size_t at)
{
  return (at + 7) / 8 * 8;
}

static size_t line_aligned(size_t at)
{
  return (at + SF_LINE_BYTES - 1) / SF_LINE_BYTES * SF_LINE_BYTES;
}

static size_t net_bytes(const fx_net *net)
{
  size_t rows = 0;
  for (int l = 0; l < SF_LAYERS; l++) rows += (size_t)fx_layer_rows(&net->layer[l]);
  return SF_BLOB_WORDS * 4 + rows * SF_LANES;
}

static size_t basis_bytes(const fx_tensorf *field)
{
  return (size_t)fx_factors_components(&field->appearance) * SF_PLANES_FEATURES;
}

static size_t lines_bytes(const fx_tensorf *field)
{
  fx_factor_place place[2 * FX_PAIRS];
  return (size_t)fx_tensorf_places(field, place) * SF_LINE_BYTES;
}

static plan make_plan(const fx_scene *scene, size_t rays)
{
  plan p = {.net = aligned(sizeof(sf_tile_header))};
  const size_t field = aligned(p.net + net_bytes(&scene->net));
  if (scene->backbone == FX_INGP) {
    p.table = field;
    p.occupancy = aligned(p.table + (size_t)scene->grid.entries * FX_GRID_FEATURES);
  } else {
    p.planes = field;
    p.lines = line_aligned(p.planes + SF_PLANES_WORDS * 4 + basis_bytes(&scene->tensorf));
    p.occupancy = aligned(p.lines + lines_bytes(&scene->tensorf));
  }
  p.steps = aligned(p.occupancy + fx_occupancy_bytes(scene));
  p.rays = aligned(p.steps + (scene->steps ? sizeof *scene->steps : 0));
  p.end = p.rays + rays * sizeof(fx_ray);
  return p;
}

static void put_words(uint8_t *to, const int32_t *word, int n)
{
  for (int i = 0; i < n; i++)
    for (int b = 0; b < 4; b++) to[4 * i + b] = (uint8_t)((uint32_t)word[i] >> 8 * b);
}

static void put_net(uint8_t *to, const fx_net *net)
{
  const fx_scale density = fx_net_scale(net, &net->exp_in), colour = fx_net_scale(net, &net->sigmoid_in);
  const int32_t head[SF_BLOB_HEADER_WORDS] = {SF_BLOB_MAGIC, SF_BLOB_VERSION, (int32_t)net_bytes(net),
                                              net->mode,     net->steps,      density.mul,
                                              density.shift, density.bias,    colour.mul,
                                              colour.shift,  colour.bias};
  put_words(to, head, SF_BLOB_HEADER_WORDS);
  uint8_t *weights = to + SF_BLOB_WORDS * 4;
  for (int l = 0; l < SF_LAYERS; l++) {
    const fx_layer *layer = &net->layer[l];
    const int32_t field[SF_BLOB_LAYER_WORDS] = {layer->n_in, layer->n_out, layer->k, fx_net_theta(net, l), layer->bias};
    put_words(to + 4 * (SF_BLOB_HEADER_WORDS + l * SF_BLOB_LAYER_WORDS), field, SF_BLOB_LAYER_WORDS);
    const size_t size = (size_t)fx_layer_rows(layer) * SF_LANES;
    memcpy(weights, layer->w, size);
    weights += size;
  }
}

static void put_field(uint8_t *bytes, const plan *p, const fx_scene *scene)
{
  if (scene->backbone == FX_INGP) {
    memcpy(bytes + p->table, scene->grid.table, (size_t)scene->grid.entries * FX_GRID_FEATURES);
    return;
  }
  const sf_planes_blob planes = sf_ray_planes_of(&scene->tensorf);
  memcpy(bytes + p->planes, &planes, SF_PLANES_WORDS * 4);
  memcpy(bytes + p->planes + SF_PLANES_WORDS * 4, planes.basis, basis_bytes(&scene->tensorf));
  fx_tensorf_memory(&scene->tensorf, bytes + p->lines);
}

static sf_tile_header make_header(const fx_scene *scene, const plan *p, int width, int height)
{
  sf_tile_header h = {.magic = SF_TILE_MAGIC,
                      .version = SF_TILE_VERSION,
                      .bytes = (uint32_t)p->end,
                      .width = (uint32_t)width,
                      .height = (uint32_t)height,
                      .net = (uint32_t)p->net,
                      .net_bytes = (uint32_t)net_bytes(&scene->net),
                      .table = (uint32_t)p->table,
                      .planes = (uint32_t)p->planes,
                      .lines = (uint32_t)p->lines,
                      .occupancy = (uint32_t)p->occupancy,
                      .rays = (uint32_t)p->rays,
                      .levels = (uint32_t)scene->grid.levels,
                      .entries = (uint32_t)scene->grid.entries,
                      .occ_res = (uint32_t)scene->occ_res,
                      .log2_bound = (uint32_t)scene->log2_bound,
                      .steps = scene->steps ? (uint32_t)p->steps : 0,
                      .step_q24 = scene->step_q24,
                      .max_samples = scene->max_samples,
                      .trans_stop = scene->trans_stop};
  memcpy(h.background, scene->background, sizeof h.background);
  for (int l = 0; l < scene->grid.levels; l++) {
    h.scale_q16[l] = scene->grid.scale_q16[l];
    h.stride[l] = scene->grid.stride[l];
    h.log2_size[l] = scene->grid.log2_size[l];
    h.shift[l] = scene->grid.shift[l];
    h.offset[l] = (uint32_t)scene->grid.offset[l];
  }
  return h;
}

sf_status sf_soc_image_make(const fx_scene *scene, const fx_ray *rays, int width, int height, uint8_t **image,
                            size_t *size)
{
  const size_t n = (size_t)width * (size_t)height;
  const plan p = make_plan(scene, n);
  if (p.end + 8 + n * sizeof(fx_pixel) > SF_SOC_IMAGE_SPACE)
    return sf_fail(SF_E_RANGE, "scene and tile of %d x %d pixels take %zu bytes, the system's memory has %u", width,
                   height, p.end + n * sizeof(fx_pixel), SF_SOC_IMAGE_SPACE);
  uint8_t *bytes = calloc(1, p.end);
  if (!bytes) return sf_fail(SF_E_MEMORY, "no memory for an image of %zu bytes", p.end);
  sf_tile_header head = make_header(scene, &p, width, height);
  memcpy(bytes, &head, sizeof head);
  put_net(bytes + p.net, &scene->net);
  put_field(bytes, &p, scene);
  memcpy(bytes + p.occupancy, scene->occupancy, fx_occupancy_bytes(scene));
  if (scene->steps) memcpy(bytes + p.steps, scene->steps, sizeof *scene->steps);
  memcpy(bytes + p.rays, rays, n * sizeof *rays);
  const size_t from = offsetof(sf_tile_header, crc) + sizeof head.crc;
  head.crc = sf_crc32(0, bytes + from, (uint32_t)(p.end - from));
  memcpy(bytes, &head, sizeof head);
  *image = bytes;
  *size = p.end;
  return sf_ok();
}

size_t sf_soc_image_pixels_at(const uint8_t *image)
{
  return sf_tile_pixels_at(((const sf_tile_header *)image)->bytes);
}
