/* The float model on file: metadata and tensors, checked one by one. */
#include "field/field.h"
#include "field/layout.h"
#include "snn/model.h"
#include "base/io.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

/* CONFIG_NUMBERS are of every model; of SPACE_NUMBERS, files may lack those from SPACE_POSES or SPACE_PICTURE on. */
enum { CONFIG_NUMBERS = 14, SPACE_NUMBERS = 6, SPACE_POSES = 3, SPACE_PICTURE = 5 };

static void config_numbers(sf_config *c, sf_number f[CONFIG_NUMBERS])
{
  const sf_number table[CONFIG_NUMBERS] = {{"net", .integer = &c->net},
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

static sf_status load_numbers(const sf_tensors *set, const sf_number *f, int count)
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

static void space_numbers(sf_config *c, sf_number f[SPACE_NUMBERS])
{
  const sf_number table[SPACE_NUMBERS] = {
      {"data_scale", .number = &c->space.scale},  {"data_bound", .integer = &c->space.bound},
      {"data_ndc", .integer = &c->space.ndc},     {"data_views", .integer = &c->space.views},
      {"data_poses", .integer = &c->space.poses}, {"data_picture", .integer = &c->space.picture}};
  memcpy(f, table, sizeof table);
}

/* Of the data that it learned from: files that do not say are read, too. */
static sf_status load_space(const sf_tensors *set, sf_config *c)
{
  sf_number number_of[SPACE_NUMBERS];
  space_numbers(c, number_of);
  if (!sf_tensors_meta(set, number_of[0].key)) return sf_ok();
  const bool poses = sf_tensors_meta(set, number_of[SPACE_POSES].key);
  const bool picture = poses && sf_tensors_meta(set, number_of[SPACE_PICTURE].key);
  SF_TRY(load_numbers(set, number_of, picture ? SPACE_NUMBERS : poses ? SPACE_PICTURE : SPACE_POSES));
  if (picture && c->space.picture < 1)
    return sf_fail(SF_E_RANGE, "%s: metadata: data_picture %d: expected > 0", set->path, c->space.picture);
  if (poses && (c->space.views < 1 || c->space.poses < 1))
    return sf_fail(SF_E_RANGE, "%s: metadata: data_views %d, data_poses %d: expected > 0", set->path, c->space.views,
                   c->space.poses);
  if (c->space.scale > 0 && c->space.bound > 0 && (c->space.ndc == 0 || c->space.ndc == 1)) return sf_ok();
  return sf_fail(SF_E_RANGE, "%s: metadata: data_scale %g, data_bound %d, data_ndc %d: expected > 0, > 0, 0 or 1",
                 set->path, (double)c->space.scale, c->space.bound, c->space.ndc);
}

static sf_status load_config(const sf_tensors *set, sf_config *c)
{
  const char *format = sf_tensors_meta(set, "format"), *version = sf_tensors_meta(set, "version");
  if (!format || strcmp(format, "spikefield-model"))
    return sf_fail(SF_E_FORMAT, "%s: not a spikefield model (metadata format is '%.40s')", set->path,
                   format ? format : "absent");
  if (!version || (strcmp(version, "1") && strcmp(version, "2")))
    return sf_fail(SF_E_UNSUPPORTED, "%s: model version '%.20s', this program reads versions 1 and 2", set->path,
                   version ? version : "absent");
  sf_number number_of[CONFIG_NUMBERS], more[SF_NUMBERS_MAX];
  config_numbers(c, number_of);
  SF_TRY(load_numbers(set, number_of, CONFIG_NUMBERS));
  if (!strcmp(version, "1") && c->mode == SF_RADIX && c->net == SF_NET_SNN) /* mode 3 was another neuron there */
    return sf_fail(
        SF_E_UNSUPPORTED,
        "%s: its neurons are the weighted ones of an earlier release, which this program does not have: train "
        "the model anew",
        set->path);
  if (sf_tensors_meta(set, "backbone")) SF_TRY(meta_int(set, "backbone", &c->backbone));
  if (c->backbone < 0 || c->backbone >= SF_FIELDS)
    return sf_fail(SF_E_RANGE, "%s: model config: backbone = %d is outside 0..%d", set->path, c->backbone,
                   SF_FIELDS - 1);
  if (sf_tensors_meta(set, "along_ray")) SF_TRY(meta_int(set, "along_ray", &c->along));
  SF_TRY(load_numbers(set, more, sf_field_of(c)->numbers(c, more)));
  c->bound = 1;
  double number;
  if (sf_tensors_meta(set, "bound")) SF_TRY(meta_int(set, "bound", &c->bound));
  if (sf_tensors_meta(set, "dt_gamma")) {
    SF_TRY(meta_number(set, "dt_gamma", &number));
    c->dt_gamma = (float)number;
  }
  c->stop = 1e-4; /* of files that do not say */
  if (sf_tensors_meta(set, "stop")) SF_TRY(meta_number(set, "stop", &c->stop));
  c->tensorf.weight_stop = SF_WEIGHT_STOP_FIRST;
  if (sf_tensors_meta(set, "weight_stop")) SF_TRY(meta_number(set, "weight_stop", &c->tensorf.weight_stop));
  SF_TRY(load_space(set, c));
  sf_status status = sf_config_check(c);
  return status.code ? sf_fail(status.code, "%s: %s", set->path, status.message) : status;
}

static void put_numbers(cJSON *meta, const sf_number *f, int count)
{
  for (int i = 0; i < count; i++)
    sf_tensors_put_number(meta, f[i].key, f[i].integer ? *f[i].integer : (double)*f[i].number);
}

void sf_model_describe(const sf_model *m, cJSON *meta)
{
  sf_config c = m->config;
  sf_number number_of[CONFIG_NUMBERS], more[SF_NUMBERS_MAX];
  cJSON_AddStringToObject(meta, "format", "spikefield-model");
  cJSON_AddStringToObject(meta, "version", "2");
  config_numbers(&c, number_of);
  put_numbers(meta, number_of, CONFIG_NUMBERS);
  sf_tensors_put_number(meta, "bound", c.bound);
  sf_tensors_put_number(meta, "dt_gamma", c.dt_gamma);
  sf_tensors_put_number(meta, "stop", c.stop);
  sf_tensors_put_number(meta, "t_star", m->t_star);
  sf_tensors_put_number(meta, "t_r", m->t_r);
  sf_tensors_put_number(meta, "weight_bits", m->scales.weight_bits);
  if (m->scales.weight_bits) {
    sf_tensors_put_number(meta, "h_shift", SF_H_SHIFT);
    sf_tensors_put_number(meta, "grid_bits", m->scales.grid_bits);
    sf_tensors_put_number(meta, "leak_bits", m->scales.leak_bits);
  }
  if (c.backbone) sf_tensors_put_number(meta, "backbone", c.backbone);
  if (c.along) sf_tensors_put_number(meta, "along_ray", c.along);
  put_numbers(meta, more, sf_field_of(&c)->numbers(&c, more));
  if (c.backbone == SF_TENSORF) sf_tensors_put_number(meta, "weight_stop", c.tensorf.weight_stop);
  sf_number space[SPACE_NUMBERS];
  space_numbers(&c, space);
  const int numbers = !c.space.poses ? SPACE_POSES : !c.space.picture ? SPACE_PICTURE : SPACE_NUMBERS;
  if (c.space.scale > 0) put_numbers(meta, space, numbers);
}

int sf_model_tensors(const sf_model *m, sf_tensor *list)
{
  int n = 0;
  for (const sf_param *p = m->param; p < m->param + SF_P_COUNT; p++) {
    if (!p->name) continue;
    list[n] = (sf_tensor){.type = SF_F32, .dims = p->dims, .data = m->value + p->offset};
    snprintf(list[n].name, sizeof list[n].name, "%s", p->name);
    memcpy(list[n++].shape, p->shape, sizeof p->shape);
  }
  list[n++] = (sf_tensor){"occupancy", SF_U8, 1, {(int64_t)(sf_config_cells(&m->config) / 8)}, m->occupancy};
  if (m->scales.weight_bits)
    list[n++] = (sf_tensor){"scales", SF_F32, 1, {sf_field_of(&m->config)->scales}, (void *)&m->scales.lsb};
  return n;
}

sf_status sf_model_save(const sf_model *m, const char *path)
{
  sf_tensor list[SF_P_COUNT + 2];
  const int n = sf_model_tensors(m, list);
  cJSON *meta = cJSON_CreateObject();
  if (!meta) return sf_fail(SF_E_MEMORY, "%s: no memory for metadata", path);
  sf_model_describe(m, meta);
  sf_status status = sf_tensors_save(list, n, meta, path);
  cJSON_Delete(meta);
  return status;
}

/* A width that files of before it could be fine-tuned for do not name: then it is the widest. */
static sf_status load_width(int32_t *bits, const sf_tensors *set, const char *key, int low, int high)
{
  *bits = high;
  if (sf_tensors_meta(set, key)) SF_TRY(meta_int(set, key, bits));
  if (*bits >= low && *bits <= high) return sf_ok();
  return sf_fail(SF_E_RANGE, "%s: metadata key '%s' is %d, expected %d..%d", set->path, key, *bits, low, high);
}

/* Only a fine-tuned model has any. */
static sf_status load_scales(sf_scales *s, const sf_tensors *set, int count)
{
  const int64_t shape[1] = {count};
  const sf_tensor *t;
  if (!sf_tensors_meta(set, "weight_bits")) return sf_ok();
  SF_TRY(meta_int(set, "weight_bits", &s->weight_bits));
  if (s->weight_bits == 0) return sf_ok();
  SF_TRY(load_width(&s->weight_bits, set, "weight_bits", 2, SF_WEIGHT_BITS));
  SF_TRY(load_width(&s->grid_bits, set, "grid_bits", 2, SF_GRID_BITS));
  SF_TRY(load_width(&s->leak_bits, set, "leak_bits", 4, SF_LEAK_FRAC));
  int32_t h_shift = 3; /* of files that do not say */
  if (sf_tensors_meta(set, "h_shift")) SF_TRY(meta_int(set, "h_shift", &h_shift));
  if (h_shift != SF_H_SHIFT)
    return sf_fail(SF_E_UNSUPPORTED, "%s: fine-tuned for h = current >> %d, this build has H_SHIFT = %d", set->path,
                   h_shift, SF_H_SHIFT);
  SF_TRY(sf_tensors_get(set, "scales", SF_F32, 1, shape, &t));
  sf_scales_clear(s);
  memcpy(&s->lsb, t->data, (size_t)count * sizeof(float));
  for (int i = 0; i < count; i++) {
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
  const sf_tensor *part[SF_P_COUNT], *occupancy;
  for (int i = 0; i < SF_P_COUNT; i++) {
    const sf_param *p = &m->param[i];
    if (!p->name) continue;
    SF_TRY(sf_tensors_get(set, p->name, SF_F32, p->dims, p->shape, &part[i]));
    SF_TRY(sf_tensor_finite(set->path, part[i]));
  }
  SF_TRY(sf_tensors_get(set, "occupancy", SF_U8, 1, &bytes, &occupancy));
  SF_TRY(sf_model_allocate(m));
  for (int i = 0; i < SF_P_COUNT; i++)
    if (sf_model_has(m, i)) memcpy(m->value + m->param[i].offset, part[i]->data, m->param[i].size * sizeof(float));
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
  return load_scales(&m->scales, set, sf_field_of(&m->config)->scales);
}

sf_status sf_model_load(sf_model *m, const char *path)
{
  memset(m, 0, sizeof *m);
  sf_tensors set;
  sf_config config = {0};
  SF_TRY(sf_tensors_load(&set, path));
  sf_status status = load_config(&set, &config);
  if (!status.code) status = sf_model_lay_out(m, &config);
  if (!status.code) status = load_tensors(m, &set);
  if (!status.code) status = load_budget(m, &set);
  if (status.code) sf_model_free(m);
  sf_tensors_free(&set);
  return status;
}
