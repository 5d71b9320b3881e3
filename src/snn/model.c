/* Layout of the float model. */
#include "base/memory.h"
#include "snn/layout.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

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

/* Offsets and sizes of the parts whose names and shapes are there. */
static void place_params(sf_model *m, const sf_param *param, int count)
{
  size_t offset = 0;
  m->params = count;
  for (int i = 0; i < count; i++) {
    sf_param *p = &m->param[i];
    *p = param[i];
    p->offset = offset;
    p->size = 1;
    for (int d = 0; d < p->dims; d++) p->size *= (size_t)p->shape[d];
    offset += (p->size + 15) / 16 * 16;
  }
  m->size = offset;
}

static void layout_ingp(sf_model *m, size_t entries)
{
  const int64_t hidden = m->config.hidden, features = 2 * m->config.levels;
  const sf_param param[SF_P_COUNT] = {
      [SF_P_GRID] = {.name = "grid.table", .shape = {(int64_t)entries, 2}, .dims = 2},
      [SF_P_W1] = {.name = "density.w1", .shape = {hidden, features}, .dims = 2},
      [SF_P_W2] = {.name = "density.w2", .shape = {SF_DENSITY_OUT, hidden}, .dims = 2},
      [SF_P_W3] = {.name = "colour.w3", .shape = {hidden, SF_DIR_FEATURES + SF_GEO_FEATURES}, .dims = 2},
      [SF_P_W4] = {.name = "colour.w4", .shape = {hidden, hidden}, .dims = 2},
      [SF_P_W5] = {.name = "colour.w5", .shape = {3, hidden}, .dims = 2},
      [SF_P_LEAK] = {.name = "leak", .shape = {SF_LAYERS, 1}, .dims = 1},
  };
  place_params(m, param, SF_P_COUNT);
}

static void layout_tensorf(sf_model *m)
{
  static const char *const name[4][3] = {{"density_plane.0", "density_plane.1", "density_plane.2"},
                                         {"density_line.0", "density_line.1", "density_line.2"},
                                         {"app_plane.0", "app_plane.1", "app_plane.2"},
                                         {"app_line.0", "app_line.1", "app_line.2"}};
  const sf_tensorf *f = &m->config.tensorf;
  const int64_t hidden = m->config.hidden;
  sf_param param[SF_V_COUNT] = {
      [SF_V_BASIS] = {.name = "basis_mat.weight", .shape = {f->features, sf_tensorf_products(f)}, .dims = 2},
      [SF_V_W1] = {.name = "renderModule.mlp.0.weight", .shape = {hidden, sf_tensorf_inputs(f)}, .dims = 2},
      [SF_V_B1] = {.name = "renderModule.mlp.0.bias", .shape = {hidden}, .dims = 1},
      [SF_V_W2] = {.name = "renderModule.mlp.2.weight", .shape = {hidden, hidden}, .dims = 2},
      [SF_V_B2] = {.name = "renderModule.mlp.2.bias", .shape = {hidden}, .dims = 1},
      [SF_V_W3] = {.name = "renderModule.mlp.4.weight", .shape = {3, hidden}, .dims = 2},
      [SF_V_B3] = {.name = "renderModule.mlp.4.bias", .shape = {3}, .dims = 1},
      [SF_V_LEAK] = {.name = "leak", .shape = {SF_LAYERS}, .dims = 1},
  };
  for (int i = 0; i < 3; i++) {
    const int *axis = sf_tensorf_axis[i];
    const int64_t width = f->resolution[axis[0]], height = f->resolution[axis[1]], length = f->resolution[axis[2]];
    for (int k = 0; k < 2; k++) {
      const int64_t channels = k ? f->appearance[i] : f->density[i];
      param[SF_V_DENSITY_PLANE + 6 * k + i] =
          (sf_param){.name = name[2 * k][i], .shape = {height, width, channels}, .dims = 3};
      param[SF_V_DENSITY_LINE + 6 * k + i] =
          (sf_param){.name = name[2 * k + 1][i], .shape = {length, channels}, .dims = 2};
    }
  }
  place_params(m, param, SF_V_COUNT);
}

float *sf_model_leak(const sf_model *m)
{
  return m->value + m->param[m->config.backbone == SF_TENSORF ? SF_V_LEAK : (int)SF_P_LEAK].offset;
}

sf_status sf_model_lay_out(sf_model *m, const sf_config *config)
{
  memset(m, 0, sizeof *m);
  SF_TRY(sf_config_check(config));
  m->config = *config;
  if (config->backbone == SF_TENSORF)
    layout_tensorf(m);
  else
    layout_ingp(m, layout_levels(m));
  return sf_ok();
}

sf_status sf_model_allocate(sf_model *m)
{
  const sf_config *config = &m->config;
  size_t bytes = m->size * sizeof(float), cells = sf_config_cells(config);
  m->value = sf_aligned_alloc(bytes);
  m->occupancy = malloc(cells / 8);
  if (!m->value || !m->occupancy) {
    sf_model_free(m);
    return sf_fail(SF_E_MEMORY, "model: no memory for %zu parameters", bytes / sizeof(float));
  }
  memset(m->occupancy, 0xff, cells / 8);
  m->t_star = (float)config->steps;
  m->t_r = config->steps;
  return sf_ok();
}

sf_status sf_model_create(sf_model *m, const sf_config *config)
{
  SF_TRY(sf_model_lay_out(m, config));
  return sf_model_allocate(m);
}

void sf_model_free(sf_model *m)
{
  free(m->value);
  free(m->occupancy);
  memset(m, 0, sizeof *m);
}
