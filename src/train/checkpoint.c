/* Checkpoints: the model's tensors, and with the optimiser everything that a bit-identical continuation needs.
 * Random numbers are counter-based, so the iteration number is their whole state. */
#include "base/io.h"
#include "train/vm.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { TENSORS_MAX = 4 * SF_P_COUNT + 3 };

/* FNV-1a. */
static uint64_t mix(uint64_t hash, const void *data, size_t bytes)
{
  const unsigned char *byte = data;
  for (size_t i = 0; i < bytes; i++) hash = (hash ^ byte[i]) * 0x100000001b3;
  return hash;
}

/* Of the cameras, of the pictures' sizes and brightness, and of where the scene lies. */
static void write_views(const sf_dataset *data, char text[17])
{
  const float space[] = {data->scale,        data->offset[0],   data->offset[1],    data->offset[2],
                         (float)data->bound, data->ndc ? 1 : 0, data->ndc_focal[0], data->ndc_focal[1]};
  uint64_t hash = mix(0xcbf29ce484222325, space, sizeof space);
  for (int v = 0; v < data->count; v++) {
    hash = mix(hash, &data->view[v].camera, sizeof data->view[v].camera);
    hash = mix(hash, &data->view[v].brightness, sizeof data->view[v].brightness);
  }
  snprintf(text, 17, "%016llx", (unsigned long long)hash);
}

/* The trainer's own numbers, one table for both directions. */
typedef struct state_field {
  const char *key;
  double *number;
  int64_t *integer;
  int *small;
} state_field;

enum { STATE_FIELDS = 46, VM_FIELDS = 5, COST_FIELDS = 4 };
enum { FIELDS_MAX = STATE_FIELDS + SF_T_MAX + VM_FIELDS + COST_FIELDS };
/* Those of every prefix, and of what only some trainers have. */
static int further_fields(sf_trainer *t, state_field f[FIELDS_MAX - STATE_FIELDS])
{
  static const char *const prefix[] = {"train.search_m1", "train.search_m2", "train.search_m3", "train.search_m4",
                                       "train.search_m5", "train.search_m6", "train.search_m7", "train.search_m8"};
  _Static_assert(SF_T_MAX <= sizeof prefix / sizeof *prefix, "a name per prefix");
  int n = 0;
  for (int i = 0; i < SF_T_MAX; i++) f[n++] = (state_field){prefix[i], .number = &t->search.prefix[i]};
  if (t->options.charge > 0) {
    f[n++] = (state_field){"train.charge_error", .number = &t->charge.error};
    f[n++] = (state_field){"train.charge_reads", .number = &t->charge.reads};
  }
  if (t->options.opaque > 0 || t->vm) {
    f[n++] = (state_field){"train.tail_error", .number = &t->tail.error};
    f[n++] = (state_field){"train.tail_samples", .number = &t->tail.samples};
  }
  if (!t->vm) return n;
  f[n++] = (state_field){"train.vm_event", .small = &t->vm->event};
  f[n++] = (state_field){"train.vm_fresh", .integer = &t->vm->fresh};
  f[n++] = (state_field){"train.vm_fresh_at", .number = &t->vm->fresh_at};
  f[n++] = (state_field){"train.vm_light", .number = &t->vm->light};
  f[n++] = (state_field){"train.vm_undecoded", .number = &t->vm->undecoded};
  return n;
}

static int state_table(sf_trainer *t, state_field f[FIELDS_MAX])
{
  const state_field table[STATE_FIELDS] = {
      {"train.iteration", .integer = &t->iteration},
      {"train.samples", .integer = &t->samples},
      {"train.averaged", .small = &t->averaged},
      {"train.stage", .small = &t->stage},
      {"train.rays", .small = &t->rays},
      {"train.stride", .small = &t->stride},
      {"train.last_samples", .small = &t->batch.samples},
      {"train.seconds", .number = &t->seconds},
      {"train.progress", .number = &t->progress},
      {"train.stage_progress", .number = &t->stage_progress},
      {"train.search_state", .small = &t->search.state},
      {"train.search_measured", .small = &t->search.measured},
      {"train.search_fast", .number = &t->search.fast[0]},
      {"train.search_fast2", .number = &t->search.fast[1]},
      {"train.search_slow", .number = &t->search.slow[0]},
      {"train.search_slow2", .number = &t->search.slow[1]},
      {"train.search_slope", .number = &t->search.slope},
      {"train.search_slope2", .number = &t->search.slope2},
      {"train.search_slope_level", .number = &t->search.slope_level},
      {"train.search_level", .number = &t->search.level},
      {"train.search_level2", .number = &t->search.level2},
      {"train.search_ratio", .number = &t->search.ratio},
      {"train.search_ratio2", .number = &t->search.ratio2},
      {"train.search_firing_d1", .number = &t->search.firing[0]},
      {"train.search_firing_c1", .number = &t->search.firing[1]},
      {"train.search_firing_c2", .number = &t->search.firing[2]},
      {"train.search_samples", .number = &t->search.samples_per_frame},
      {"train.search_rays", .number = &t->search.rays_per_sample},
      {"train.search_at", .number = &t->search.at},
      {"train.search_mark", .number = &t->search.mark},
      {"train.search_mark_at", .number = &t->search.mark_at},
      {"train.search_moved", .number = &t->search.moved},
      {"train.occupied", .number = &t->occupied},
      {"train.epoch", .number = &t->epoch},
      {"train.firing_d1", .number = &t->firing[0]},
      {"train.firing_c1", .number = &t->firing[1]},
      {"train.firing_c2", .number = &t->firing[2]},
      {"train.run_d1", .small = &t->health.run[0]},
      {"train.run_c1", .small = &t->health.run[1]},
      {"train.run_c2", .small = &t->health.run[2]},
      {"train.revived_d1", .small = &t->health.revived[0]},
      {"train.revived_c1", .small = &t->health.revived[1]},
      {"train.revived_c2", .small = &t->health.revived[2]},
      {"train.quiet_d1", .small = &t->health.quiet[0]},
      {"train.quiet_c1", .small = &t->health.quiet[1]},
      {"train.quiet_c2", .small = &t->health.quiet[2]},
  };
  memcpy(f, table, sizeof table);
  return STATE_FIELDS + further_fields(t, f + STATE_FIELDS);
}

static int list_tensors(const sf_trainer *t, bool with_optimiser, sf_tensor *list)
{
  const sf_model *m = &t->model;
  const int64_t res = m->config.occ_res, layers = sf_config_cascades(&m->config) * res;
  int n = sf_model_tensors(m, list);
  const struct {
    const char *prefix;
    float *data;
  } sets[3] = {{"adam.m.", t->moment1}, {"adam.v.", t->moment2}, {"average.", t->average}};
  for (int s = 0; s < (!with_optimiser ? 0 : t->averaged ? 3 : 2); s++)
    for (int i = 0; i < SF_P_COUNT; i++) {
      if (!sf_model_has(m, i)) continue;
      sf_tensor *x = &list[n++];
      *x = (sf_tensor){.type = SF_F32, .dims = m->param[i].dims, .data = sets[s].data + m->param[i].offset};
      snprintf(x->name, sizeof x->name, "%s%s", sets[s].prefix, m->param[i].name);
      memcpy(x->shape, m->param[i].shape, sizeof m->param[i].shape);
    }
  if (with_optimiser && t->density)
    list[n++] = (sf_tensor){"occupancy.density", SF_F32, 3, {layers, res, res}, t->density};
  return n;
}

sf_status sf_trainer_save(const sf_trainer *t, const char *path, bool with_optimiser)
{
  sf_tensor list[TENSORS_MAX];
  const int n = list_tensors(t, with_optimiser, list);
  for (int i = 0; i < n; i++) /* the last good checkpoint must survive a run that went wrong */
    if (list[i].type == SF_F32) SF_TRY(sf_tensor_finite(path, &list[i]));
  SF_TRY(sf_parameters_check(t));
  cJSON *meta = cJSON_CreateObject();
  if (!meta) return sf_fail(SF_E_MEMORY, "%s: no memory for metadata", path);
  sf_model_describe(&t->model, meta);
  sf_tensors_put_number(meta, "beta", t->options.beta);
  if (t->options.charge > 0) sf_tensors_put_number(meta, "charge", t->options.charge);
  if (t->options.opaque > 0) sf_tensors_put_number(meta, "opaque", t->options.opaque);
  sf_tensors_put_number(meta, "seed", (double)t->options.seed);
  if (with_optimiser) {
    const cJSON *item;
    char views[17];
    write_views(t->data, views);
    cJSON_AddStringToObject(meta, "train.views", views);
    cJSON_ArrayForEach(item, t->options.record)
    {
      cJSON_AddStringToObject(meta, item->string, item->valuestring);
    }
    state_field field[FIELDS_MAX];
    const int fields = state_table((sf_trainer *)t, field);
    for (int i = 0; i < fields; i++)
      sf_tensors_put_number(meta, field[i].key,
                            field[i].number    ? *field[i].number
                            : field[i].integer ? (double)*field[i].integer
                                               : *field[i].small);
  }
  sf_status status = sf_tensors_save(list, n, meta, path);
  cJSON_Delete(meta);
  return status;
}

static sf_status load_state(sf_trainer *t, const sf_tensors *set)
{
  state_field field[FIELDS_MAX];
  const int fields = state_table(t, field);
  for (int i = 0; i < fields; i++) {
    const char *text = sf_tensors_meta(set, field[i].key);
    char *end = NULL;
    const double value = text ? strtod(text, &end) : 0;
    if (!text || end == text || *end || !(fabs(value) < (field[i].small ? 1e9 : 1e15)))
      return sf_fail(SF_E_FORMAT, "%s: cannot resume: metadata key '%s' is missing or broken", set->path, field[i].key);
    if (field[i].number)
      *field[i].number = value;
    else if (field[i].integer)
      *field[i].integer = (int64_t)value;
    else
      *field[i].small = (int)value;
  }
  if (t->stage < 1 || t->stage > 3 || t->rays < RAYS_MIN || t->rays > RAYS_MAX || t->stride < 1 || t->stride > 8 ||
      t->iteration < 0 || t->samples < 0 || t->averaged < 0)
    return sf_fail(SF_E_FORMAT,
                   "%s: cannot resume: train.iteration, samples, averaged, stage, rays or stride is out of range",
                   set->path);
  if (!(t->progress >= 0 && t->progress <= 1 && t->stage_progress >= 0 && t->epoch >= 0))
    return sf_fail(SF_E_FORMAT, "%s: cannot resume: train.progress, stage_progress or epoch is out of range",
                   set->path);
  if (t->vm && !(t->vm->event >= 0 && t->vm->event <= 5 && t->vm->fresh >= 0 && t->vm->fresh <= t->iteration &&
                 t->vm->fresh_at >= 0 && t->vm->fresh_at <= 1))
    return sf_fail(SF_E_FORMAT, "%s: cannot resume: train.vm_event, vm_fresh or vm_fresh_at is out of range",
                   set->path);
  if (t->search.state < SF_SEARCH_NONE || t->search.state > SF_SEARCH_TOO_SHORT || t->search.measured < 0 ||
      !(t->search.fast[0] >= 0 && t->search.slow[0] >= 0 && t->search.at >= 0 && t->search.at <= 1))
    return sf_fail(SF_E_FORMAT, "%s: cannot resume: train.search_state, measured, fast, slow or at is out of range",
                   set->path);
  if (!(t->tail.error >= 0 && t->tail.samples >= 0))
    return sf_fail(SF_E_FORMAT, "%s: cannot resume: train.tail_error or tail_samples is out of range", set->path);
  for (int l = 0; l < 3; l++)
    if (t->health.revived[l] < 0 || t->health.revived[l] > 1000000)
      return sf_fail(SF_E_FORMAT, "%s: cannot resume: train.revived is out of range", set->path);
  return sf_ok();
}

static sf_status check_views(const sf_dataset *data, const sf_tensors *set)
{
  char views[17];
  const char *before = sf_tensors_meta(set, "train.views");
  write_views(data, views);
  if (!before || !strcmp(before, views)) return sf_ok();
  return sf_fail(SF_E_RANGE, "%s: cannot resume: its run learned from other views than the %d of %s", set->path,
                 data->count, data->list);
}

sf_status sf_checkpoint_load(sf_trainer *t, const char *path)
{
  sf_tensors set;
  SF_TRY(sf_tensors_load(&set, path));
  sf_status status = load_state(t, &set);
  if (!status.code) status = check_views(t->data, &set);
  if (!status.code && t->averaged) status = sf_average_reserve(t);
  sf_tensor list[TENSORS_MAX];
  const int n = status.code ? 0 : list_tensors(t, true, list);
  for (int i = 0; i < n && !status.code; i++) {
    const sf_tensor *from;
    status = sf_tensors_get(&set, list[i].name, list[i].type, list[i].dims, list[i].shape, &from);
    if (!status.code && from->type == SF_F32) status = sf_tensor_finite(path, from);
    if (status.code) break;
    size_t bytes = sf_dtype_size(from->type);
    for (int d = 0; d < from->dims; d++) bytes *= (size_t)from->shape[d];
    memcpy(list[i].data, from->data, bytes);
  }
  sf_tensors_free(&set);
  return status;
}
