/* Configuration and layout of the float model. */
#include "base/memory.h"
#include "snn/model.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

sf_config sf_config_default(void)
{
  return (sf_config){.net = SF_NET_SNN,
                     .mode = SF_HYBRID,
                     .steps = SF_T_MAX,
                     .levels = 16,
                     .log2_hash = 19,
                     .base_res = 16,
                     .finest_res = 2048,
                     .hidden = 128,
                     .theta = {1, 1, 1},
                     .scale = 0.8f,
                     .lattice = 1024,
                     .occ_res = 128,
                     .bound = 1};
}

void sf_config_bound(sf_config *c, int bound)
{
  c->bound = bound;
  c->dt_gamma = bound > 1 ? 1.0f / 128 : 0;
  c->finest_res = bound < 16 ? 2048 * bound : 32768;
}

static sf_status check_range(const char *name, double value, double low, double high)
{
  if (!(value >= low && value <= high))
    return sf_fail(SF_E_RANGE, "model config: %s = %g is outside %g..%g", name, value, low, high);
  return sf_ok();
}

sf_status sf_config_check(const sf_config *c)
{
  SF_TRY(check_range("net", c->net, SF_NET_SNN, SF_NET_ANN));
  SF_TRY(check_range("mode", c->mode, SF_HYBRID, SF_NODECAY));
  SF_TRY(check_range("steps", c->steps, 1, c->net == SF_NET_ANN ? 1 : SF_T_MAX));
  SF_TRY(check_range("levels", c->levels, 1, 16));
  SF_TRY(check_range("log2_hash", c->log2_hash, 4, 24));
  SF_TRY(check_range("base_res", c->base_res, 2, 4096));
  SF_TRY(check_range("finest_res", c->finest_res, c->base_res, 32768));
  SF_TRY(check_range("hidden", c->hidden, 16, SF_LANES));
  if (c->hidden % 16) return sf_fail(SF_E_RANGE, "model config: hidden = %d is not a multiple of 16", c->hidden);
  for (int i = 0; i < 3; i++) SF_TRY(check_range("theta", c->theta[i], 1e-6, 1e6));
  SF_TRY(check_range("scale", c->scale, 1e-6, 1e6));
  SF_TRY(check_range("lattice", c->lattice, SF_LATTICE_MIN, 1024));
  SF_TRY(check_range("occ_res", c->occ_res, 8, 256));
  if (c->occ_res & (c->occ_res - 1))
    return sf_fail(SF_E_RANGE, "model config: occ_res = %d is not a power of two", c->occ_res);
  SF_TRY(check_range("bound", c->bound, 1, 64));
  if (c->bound & (c->bound - 1)) return sf_fail(SF_E_RANGE, "model config: bound = %d is not a power of two", c->bound);
  SF_TRY(check_range("dt_gamma", c->dt_gamma, 0, SF_GAMMA_MAX));
  SF_TRY(check_range("backbone", c->backbone, SF_INGP, SF_TENSORF));
  if (c->backbone == SF_TENSORF) return sf_tensorf_check(&c->tensorf);
  sf_steps steps;
  return sf_steps_make(&steps, c, 1);
}

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
