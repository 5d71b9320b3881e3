/* Configuration, layout and loading of the float model. */
#include "base/memory.h"
#include "spikefield/model.h"
#include "spikefield/io.h"

#include <math.h>
#include <stdio.h>
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
  SF_TRY(check_range("lattice", c->lattice, 16, 1024));
  SF_TRY(check_range("occ_res", c->occ_res, 8, 256));
  if (c->occ_res & (c->occ_res - 1))
    return sf_fail(SF_E_RANGE, "model config: occ_res = %d is not a power of two", c->occ_res);
  SF_TRY(check_range("bound", c->bound, 1, 64));
  if (c->bound & (c->bound - 1)) return sf_fail(SF_E_RANGE, "model config: bound = %d is not a power of two", c->bound);
  SF_TRY(check_range("dt_gamma", c->dt_gamma, 0, 0.125));
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

static sf_status lay_out(sf_model *m, const sf_config *config)
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

static sf_status allocate(sf_model *m)
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
  SF_TRY(lay_out(m, config));
  return allocate(m);
}

void sf_model_free(sf_model *m)
{
  free(m->value);
  free(m->occupancy);
  memset(m, 0, sizeof *m);
}

static sf_status meta_number(const sf_tensors *set, const char *key, double *value)
{
  const char *text = sf_tensors_meta(set, key);
  if (!text) return sf_fail(SF_E_FORMAT, "%s: metadata key '%s' is missing", set->path, key);
  char *end;
  *value = strtod(text, &end);
  if (end == text || *end || !isfinite(*value))
    return sf_fail(SF_E_FORMAT, "%s: metadata key '%s' is not a number: '%.40s'", set->path, key, text);
  return sf_ok();
}

static sf_status meta_int(const sf_tensors *set, const char *key, int32_t *value)
{
  double number = 0;
  SF_TRY(meta_number(set, key, &number));
  if (number != floor(number) || fabs(number) > 1e9)
    return sf_fail(SF_E_FORMAT, "%s: metadata key '%s' = %g is not a small integer", set->path, key, number);
  *value = (int32_t)number;
  return sf_ok();
}

/* A number of the configuration by its metadata key, one table for both directions. */
typedef struct config_field {
  const char *key;
  int32_t *integer;
  float *number;
} config_field;

enum { CONFIG_FIELDS = 14, TENSORF_FIELDS = 24 };

static void config_table(sf_config *c, config_field f[CONFIG_FIELDS])
{
  const config_field table[CONFIG_FIELDS] = {{"net", .integer = &c->net},
                                             {"mode", .integer = &c->mode},
                                             {"steps", .integer = &c->steps},
                                             {"levels", .integer = &c->levels},
                                             {"log2_hash", .integer = &c->log2_hash},
                                             {"base_res", .integer = &c->base_res},
                                             {"finest_res", .integer = &c->finest_res},
                                             {"hidden", .integer = &c->hidden},
                                             {"lattice", .integer = &c->lattice},
                                             {"occ_res", .integer = &c->occ_res},
                                             {"theta_d1", .number = &c->theta[0]},
                                             {"theta_c1", .number = &c->theta[1]},
                                             {"theta_c2", .number = &c->theta[2]},
                                             {"scale", .number = &c->scale}};
  memcpy(f, table, sizeof table);
}

static void tensorf_table(sf_tensorf *t, config_field f[TENSORF_FIELDS])
{
  const config_field table[TENSORF_FIELDS] = {{"box_min_x", .number = &t->box[0][0]},
                                              {"box_min_y", .number = &t->box[0][1]},
                                              {"box_min_z", .number = &t->box[0][2]},
                                              {"box_max_x", .number = &t->box[1][0]},
                                              {"box_max_y", .number = &t->box[1][1]},
                                              {"box_max_z", .number = &t->box[1][2]},
                                              {"resolution_x", .integer = &t->resolution[0]},
                                              {"resolution_y", .integer = &t->resolution[1]},
                                              {"resolution_z", .integer = &t->resolution[2]},
                                              {"density_0", .integer = &t->density[0]},
                                              {"density_1", .integer = &t->density[1]},
                                              {"density_2", .integer = &t->density[2]},
                                              {"appearance_0", .integer = &t->appearance[0]},
                                              {"appearance_1", .integer = &t->appearance[1]},
                                              {"appearance_2", .integer = &t->appearance[2]},
                                              {"features", .integer = &t->features},
                                              {"feature_freqs", .integer = &t->feature_freqs},
                                              {"view_freqs", .integer = &t->view_freqs},
                                              {"activation", .integer = &t->activation},
                                              {"density_shift", .number = &t->shift},
                                              {"distance_scale", .number = &t->distance_scale},
                                              {"step_ratio", .number = &t->step_ratio},
                                              {"near", .number = &t->near},
                                              {"far", .number = &t->far}};
  memcpy(f, table, sizeof table);
}

static sf_status load_fields(const sf_tensors *set, const config_field *f, int count)
{
  for (int i = 0; i < count; i++) {
    double number;
    if (f[i].integer)
      SF_TRY(meta_int(set, f[i].key, f[i].integer));
    else {
      SF_TRY(meta_number(set, f[i].key, &number));
      *f[i].number = (float)number;
    }
  }
  return sf_ok();
}

static sf_status load_config(const sf_tensors *set, sf_config *c)
{
  const char *format = sf_tensors_meta(set, "format"), *version = sf_tensors_meta(set, "version");
  if (!format || strcmp(format, "spikefield-model"))
    return sf_fail(SF_E_FORMAT, "%s: not a spikefield model (metadata format is '%.40s')", set->path,
                   format ? format : "absent");
  if (!version || strcmp(version, "1"))
    return sf_fail(SF_E_UNSUPPORTED, "%s: model version '%.20s', this program reads version 1", set->path,
                   version ? version : "absent");
  config_field field[CONFIG_FIELDS], more[TENSORF_FIELDS];
  config_table(c, field);
  SF_TRY(load_fields(set, field, CONFIG_FIELDS));
  if (sf_tensors_meta(set, "backbone")) SF_TRY(meta_int(set, "backbone", &c->backbone));
  if (c->backbone == SF_TENSORF) {
    tensorf_table(&c->tensorf, more);
    SF_TRY(load_fields(set, more, TENSORF_FIELDS));
    SF_TRY(meta_int(set, "ndc", &c->tensorf.ndc));
  }
  c->bound = 1;
  double number;
  if (sf_tensors_meta(set, "bound")) SF_TRY(meta_int(set, "bound", &c->bound));
  if (sf_tensors_meta(set, "dt_gamma")) {
    SF_TRY(meta_number(set, "dt_gamma", &number));
    c->dt_gamma = (float)number;
  }
  sf_status status = sf_config_check(c);
  return status.code ? sf_fail(status.code, "%s: %s", set->path, status.message) : status;
}

static void put_number(cJSON *meta, const char *key, double value)
{
  char text[40];
  snprintf(text, sizeof text, "%.17g", value);
  cJSON_AddStringToObject(meta, key, text);
}

static void put_fields(cJSON *meta, const config_field *f, int count)
{
  for (int i = 0; i < count; i++) put_number(meta, f[i].key, f[i].integer ? *f[i].integer : (double)*f[i].number);
}

void sf_model_describe(const sf_model *m, cJSON *meta)
{
  sf_config c = m->config;
  config_field field[CONFIG_FIELDS], more[TENSORF_FIELDS];
  cJSON_AddStringToObject(meta, "format", "spikefield-model");
  cJSON_AddStringToObject(meta, "version", "1");
  config_table(&c, field);
  put_fields(meta, field, CONFIG_FIELDS);
  put_number(meta, "bound", c.bound);
  put_number(meta, "dt_gamma", c.dt_gamma);
  put_number(meta, "t_star", m->t_star);
  put_number(meta, "t_r", m->t_r);
  put_number(meta, "weight_bits", m->scales.weight_bits);
  if (c.backbone != SF_TENSORF) return;
  put_number(meta, "backbone", c.backbone);
  put_number(meta, "ndc", c.tensorf.ndc);
  tensorf_table(&c.tensorf, more);
  put_fields(meta, more, TENSORF_FIELDS);
}

int sf_model_tensors(const sf_model *m, sf_tensor *list)
{
  int n = 0;
  for (; n < m->params; n++) {
    list[n] = (sf_tensor){.type = SF_F32, .dims = m->param[n].dims, .data = m->value + m->param[n].offset};
    snprintf(list[n].name, sizeof list[n].name, "%s", m->param[n].name);
    memcpy(list[n].shape, m->param[n].shape, sizeof m->param[n].shape);
  }
  list[n++] = (sf_tensor){"occupancy", SF_U8, 1, {(int64_t)(sf_config_cells(&m->config) / 8)}, m->occupancy};
  if (m->scales.weight_bits) list[n++] = (sf_tensor){"scales", SF_F32, 1, {SF_SCALES}, (void *)&m->scales.lsb};
  return n;
}

sf_status sf_model_save(const sf_model *m, const char *path)
{
  sf_tensor list[SF_PARAMS_MAX + 2];
  const int n = sf_model_tensors(m, list);
  cJSON *meta = cJSON_CreateObject();
  if (!meta) return sf_fail(SF_E_MEMORY, "%s: no memory for metadata", path);
  sf_model_describe(m, meta);
  sf_status status = sf_tensors_save(list, n, meta, path);
  cJSON_Delete(meta);
  return status;
}

/* Only a fine-tuned model has any. */
static sf_status load_scales(sf_scales *s, const sf_tensors *set)
{
  const int64_t shape[1] = {SF_SCALES};
  const sf_tensor *t;
  if (!sf_tensors_meta(set, "weight_bits")) return sf_ok();
  SF_TRY(meta_int(set, "weight_bits", &s->weight_bits));
  if (s->weight_bits == 0) return sf_ok();
  if (s->weight_bits < 2 || s->weight_bits > SF_WEIGHT_BITS)
    return sf_fail(SF_E_RANGE, "%s: metadata key 'weight_bits' is %d, expected 2..%d", set->path, s->weight_bits,
                   SF_WEIGHT_BITS);
  SF_TRY(sf_tensors_get(set, "scales", SF_F32, 1, shape, &t));
  memcpy(&s->lsb, t->data, sizeof s->lsb);
  for (int i = 0; i < SF_SCALES; i++) {
    const float lsb = ((const float *)t->data)[i];
    if (!(lsb > 1e-30f && lsb < 1e30f))
      return sf_fail(SF_E_RANGE, "%s: tensor 'scales': element %d is %g, expected a positive number", set->path, i,
                     (double)lsb);
  }
  return sf_ok();
}

/* All tensors are found before memory is asked for: a few words of metadata can name a grid of gigabytes. */
static sf_status load_tensors(sf_model *m, const sf_tensors *set)
{
  const int64_t bytes = (int64_t)(sf_config_cells(&m->config) / 8);
  const sf_tensor *part[SF_PARAMS_MAX], *occupancy;
  for (int i = 0; i < m->params; i++) {
    const sf_param *p = &m->param[i];
    SF_TRY(sf_tensors_get(set, p->name, SF_F32, p->dims, p->shape, &part[i]));
    SF_TRY(sf_tensor_finite(set->path, part[i]));
  }
  SF_TRY(sf_tensors_get(set, "occupancy", SF_U8, 1, &bytes, &occupancy));
  SF_TRY(allocate(m));
  for (int i = 0; i < m->params; i++)
    memcpy(m->value + m->param[i].offset, part[i]->data, m->param[i].size * sizeof(float));
  memcpy(m->occupancy, occupancy->data, (size_t)bytes);
  return sf_ok();
}

static sf_status load_budget(sf_model *m, const sf_tensors *set)
{
  double t_star;
  SF_TRY(meta_number(set, "t_star", &t_star));
  SF_TRY(meta_int(set, "t_r", &m->t_r));
  if (m->t_r < 1 || m->t_r > m->config.steps || t_star < 1 || t_star > m->config.steps)
    return sf_fail(SF_E_RANGE, "%s: t_r = %d, t_star = %g outside 1..T = %d", set->path, m->t_r, t_star,
                   m->config.steps);
  m->t_star = (float)t_star;
  return load_scales(&m->scales, set);
}

sf_status sf_model_load(sf_model *m, const char *path)
{
  memset(m, 0, sizeof *m);
  sf_tensors set;
  sf_config config = {0};
  SF_TRY(sf_tensors_load(&set, path));
  sf_status status = load_config(&set, &config);
  if (!status.code) status = lay_out(m, &config);
  if (!status.code) status = load_tensors(m, &set);
  if (!status.code) status = load_budget(m, &set);
  if (status.code) sf_model_free(m);
  sf_tensors_free(&set);
  return status;
}
