/* The hash grid as a field: a density net and a colour net read its features. grid.c is its oracle. */
#include "field/field.h"
#include <math.h>

/* torch-ngp's table: resolution ceil(base * s^l), one more point per axis, rounded up to 8 entries. */
static size_t layout_levels(sf_model *m)
{
  const sf_config *c = &m->config;
  double growth = c->levels > 1 ? pow((double)c->finest_res / c->base_res, 1.0 / (c->levels - 1)) : 1.0;
  size_t total = 0;
  for (int l = 0; l < c->levels; l++) {
    double resolution = c->base_res * pow(growth, l);
    uint64_t stride = (uint64_t)ceil(resolution - 1e-9) + 1, dense = (stride * stride * stride + 7) / 8 * 8;
    uint64_t hashed = 1ull << c->log2_hash;
    sf_grid_level *level = &m->level[l];
    level->scale = (float)(resolution - 1);
    level->stride = dense <= hashed ? (uint32_t)stride : 0;
    level->entries = (uint32_t)(dense <= hashed ? dense : hashed);
    level->offset = total;
    total += level->entries;
  }
  return total;
}

static void lay_out(sf_model *m, sf_param param[SF_P_COUNT])
{
  const int64_t entries = (int64_t)layout_levels(m);
  param[SF_P_GRID] = (sf_param){.name = "grid.table", .shape = {entries, 2}, .dims = 2};
}

static sf_status check(const sf_config *config)
{
  sf_steps steps;
  return sf_steps_growing(&steps, config, 1);
}

static int inputs(const sf_config *config)
{
  return 2 * config->levels;
}

/* Its numbers are in every model's metadata. */
static int numbers(sf_config *config, sf_number number[SF_NUMBERS_MAX])
{
  (void)config, (void)number;
  return 0;
}

const sf_field sf_field_grid = {.name = "ingp",
                                .lattice = true,
                                .weights = {"density.w1", "density.w2", "colour.w3", "colour.w4", "colour.w5"},
                                .scales = offsetof(struct sf_lsb, bias) / sizeof(float),
                                .check = check,
                                .inputs = inputs,
                                .lay_out = lay_out,
                                .steps = sf_steps_growing,
                                .numbers = numbers};
