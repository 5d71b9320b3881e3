/* .snn: a safetensors file of integer tensors; scalars are metadata strings. */
#include "base/io.h"
#include "src/fx/arrays.h"
#include "src/fx/real.h"
#include "src/fx/scene.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include "src/fx/nofloat.h"

#define FORMAT "spikefield-snn"
#define VERSION "1"
#define TENSORF "tensorf"
enum { TENSORS = SF_LAYERS + FX_TENSORF_ARRAYS + 7 };

static const char *const mode_name[] = {"hybrid", "decay", "no-decay", "radix"};

typedef struct int_field {
  const char *key;
  size_t offset;
} int_field;

#define OF_LAYER(id, member)                                                                                           \
  {                                                                                                                    \
#id "." #member, offsetof(fx_scene, net.layer[FX_##id].member)                                                     \
  }
#define LAYER(id) OF_LAYER(id, n_in), OF_LAYER(id, n_out), OF_LAYER(id, k), OF_LAYER(id, theta)
#define FIELD(field)                                                                                                   \
  {                                                                                                                    \
#field, offsetof(fx_scene, field)                                                                                  \
  }
static const int_field ints[] = {
    LAYER(D1),
    LAYER(D2),
    LAYER(C1),
    LAYER(C2),
    LAYER(C3),
    {"t_r", offsetof(fx_scene, net.steps)},
    {"exp_in.mul", offsetof(fx_scene, net.exp_in.mul)},
    {"exp_in.shift", offsetof(fx_scene, net.exp_in.shift)},
    {"exp_in.bias", offsetof(fx_scene, net.exp_in.bias)},
    {"sigmoid_in.mul", offsetof(fx_scene, net.sigmoid_in.mul)},
    {"sigmoid_in.shift", offsetof(fx_scene, net.sigmoid_in.shift)},
    {"sigmoid_in.bias", offsetof(fx_scene, net.sigmoid_in.bias)},
    FIELD(grid.levels),
    FIELD(occ_res),
    FIELD(step_q24),
    FIELD(max_samples),
    FIELD(trans_stop),
    FIELD(background[0]),
    FIELD(background[1]),
    FIELD(background[2]),
};
enum { INTS = sizeof ints / sizeof ints[0] };

/* Not in the file when 0. */
static const int_field optional[] = {
    OF_LAYER(C1, bias), OF_LAYER(C2, bias), OF_LAYER(C3, bias), FIELD(log2_bound),
    FIELD(gamma_q24),   FIELD(near_q16),    FIELD(longest_q16),
};
enum { OPTIONAL = sizeof optional / sizeof optional[0] };

#define SCALE(field) FIELD(field.mul), FIELD(field.shift), FIELD(field.bias)
#define EACH(field) FIELD(field[0]), FIELD(field[1]), FIELD(field[2])
/* Of scenes whose metadata 'backbone' says so. */
static const int_field tensorf_ints[] = {
    EACH(tensorf.res),
    EACH(tensorf.density.components),
    EACH(tensorf.appearance.components),
    SCALE(tensorf.density_in),
    SCALE(tensorf.sigma_out),
    SCALE(tensorf.feature_in),
    SCALE(tensorf.phase_in),
    FIELD(tensorf.activation),
    FIELD(tensorf.weight_stop),
    FIELD(tensorf.features),
    FIELD(tensorf.feature_freqs),
    FIELD(tensorf.view_freqs),
    FIELD(tensorf.encoding_frac),
};
enum { TENSORF_INTS = sizeof tensorf_ints / sizeof tensorf_ints[0] };

static int32_t *int_of(const fx_scene *scene, const int_field *field)
{
  return (int32_t *)((char *)scene + field->offset);
}

/* ---- checksum ---- */

static uint64_t fnv1a(uint64_t hash, const void *data, size_t size)
{
  const uint8_t *byte = data;
  for (size_t i = 0; i < size; i++) hash = (hash ^ byte[i]) * UINT64_C(0x100000001b3);
  return hash;
}

static size_t tensor_bytes(const sf_tensor *tensor)
{
  size_t size = sf_dtype_size(tensor->type);
  for (int i = 0; i < tensor->dims; i++) size *= (size_t)tensor->shape[i];
  return size;
}

/* FNV-1a of each tensor and of each metadata pair, added up: rewriting the file with another library may reorder it. */
static uint64_t checksum(const sf_tensor *tensor, int count, const cJSON *metadata)
{
  const uint64_t start = UINT64_C(0xcbf29ce484222325);
  uint64_t sum = 0;
  for (int i = 0; i < count; i++) {
    const uint64_t named = fnv1a(start, tensor[i].name, strlen(tensor[i].name) + 1);
    const uint64_t shaped = fnv1a(named, tensor[i].shape, (size_t)tensor[i].dims * sizeof tensor[i].shape[0]);
    sum += fnv1a(shaped, tensor[i].data, tensor_bytes(&tensor[i]));
  }
  const cJSON *item;
  cJSON_ArrayForEach(item, metadata)
  {
    if (!strcmp(item->string, "checksum")) continue;
    const char *value = cJSON_GetStringValue(item);
    const uint64_t keyed = fnv1a(start, item->string, strlen(item->string) + 1);
    sum += fnv1a(keyed, value ? value : "", value ? strlen(value) : 0);
  }
  return sum;
}

/* ---- tensors of a scene, the same list for both directions ---- */

static sf_tensor make_tensor(const char *name, sf_dtype type, void *data, int dims, int64_t rows, int64_t columns)
{
  sf_tensor tensor = {.type = type, .dims = dims, .shape = {rows, columns}, .data = data};
  strncpy(tensor.name, name, sizeof tensor.name - 1);
  return tensor;
}

/* The levels' arrays: their length is known before the sizes they hold. */
static int list_levels(sf_tensor *tensor, fx_scene *scene)
{
  fx_grid *grid = &scene->grid;
  if (scene->backbone == FX_TENSORF) return 0;
  tensor[0] = make_tensor("grid.scale_q16", SF_I32, grid->scale_q16, 1, grid->levels, 0);
  tensor[1] = make_tensor("grid.stride", SF_I32, grid->stride, 1, grid->levels, 0);
  tensor[2] = make_tensor("grid.log2_size", SF_I32, grid->log2_size, 1, grid->levels, 0);
  tensor[3] = make_tensor("grid.shift", SF_I32, grid->shift, 1, grid->levels, 0);
  tensor[4] = make_tensor("grid.offset", SF_I64, grid->offset, 1, grid->levels, 0);
  return 5;
}

static int list_field(sf_tensor *tensor, fx_scene *scene)
{
  fx_array list[FX_TENSORF_ARRAYS];
  if (scene->backbone == FX_INGP) {
    tensor[0] = make_tensor("grid.table", SF_I8, scene->grid.table, 2, scene->grid.entries, FX_GRID_FEATURES);
    return 1;
  }
  const int count = fx_tensorf_arrays(&scene->tensorf, list);
  for (int i = 0; i < count; i++) {
    tensor[i] = make_tensor(list[i].name, SF_I8, *list[i].data, list[i].dims, 0, 0);
    memcpy(tensor[i].shape, list[i].shape, sizeof list[i].shape);
  }
  return count;
}

static int list_bulk(sf_tensor *tensor, fx_scene *scene)
{
  int count = list_field(tensor, scene);
  tensor[count++] = make_tensor("occupancy", SF_U8, scene->occupancy, 1, (int64_t)fx_occupancy_bytes(scene), 0);
  for (int id = 0; id < SF_LAYERS; id++) {
    const fx_layer *layer = &scene->net.layer[id];
    const int rows = fx_layer_rows(layer);
    if (rows > 0) tensor[count++] = make_tensor(fx_layer_table[id].tensor, SF_I8, layer->w, 2, rows, SF_LANES);
  }
  return count;
}

/* ---- saving ---- */

static void add_u64(cJSON *metadata, const char *key, uint64_t value)
{
  char text[32];
  snprintf(text, sizeof text, "0x%016" PRIx64, value);
  cJSON_AddStringToObject(metadata, key, text);
}

/* The widths that give the integers of a scene their meaning: a build of others must not run it. */
enum { ARCH_TEXT = 160 };
static void describe_arch(char text[ARCH_TEXT])
{
  snprintf(text, ARCH_TEXT, "AC_FRAC=%d LEAK_FRAC=%d H_SHIFT=%d INPUT_BITS=%d LOG_FRAC=%d TRANS_FRAC=%d DELTA_FRAC=%d",
           SF_AC_FRAC, SF_LEAK_FRAC, SF_H_SHIFT, SF_INPUT_BITS, SF_LOG_FRAC, SF_TRANS_FRAC, SF_DELTA_FRAC);
}

/* Names the first parameter that is another one. */
static sf_status check_arch(const sf_tensors *set)
{
  char ours[ARCH_TEXT];
  const char *theirs = sf_tensors_meta(set, "arch");
  size_t at = 0;
  describe_arch(ours);
  if (!theirs) return sf_fail(SF_E_UNSUPPORTED, "%s: metadata 'arch' is missing", set->path);
  if (!strcmp(theirs, ours)) return sf_ok();
  while (ours[at] && ours[at] == theirs[at]) at++;
  while (at && ours[at - 1] != ' ') at--;
  return sf_fail(SF_E_UNSUPPORTED, "%s: metadata 'arch': the scene has %.*s, this build %.*s", set->path,
                 (int)strcspn(theirs + at, " "), theirs + at, (int)strcspn(ours + at, " "), ours + at);
}

static void add_int(cJSON *metadata, const fx_scene *scene, const int_field *field)
{
  char text[16];
  snprintf(text, sizeof text, "%" PRId32, *int_of(scene, field));
  cJSON_AddStringToObject(metadata, field->key, text);
}

static cJSON *make_metadata(const fx_scene *scene)
{
  char arch[ARCH_TEXT];
  cJSON *metadata = cJSON_CreateObject();
  if (!metadata) return NULL;
  cJSON_AddStringToObject(metadata, "format", FORMAT);
  cJSON_AddStringToObject(metadata, "version", VERSION);
  describe_arch(arch);
  cJSON_AddStringToObject(metadata, "arch", arch);
  cJSON_AddStringToObject(metadata, "mode", mode_name[scene->net.mode]);
  for (int i = 0; i < INTS; i++) add_int(metadata, scene, &ints[i]);
  for (int i = 0; i < OPTIONAL; i++)
    if (*int_of(scene, &optional[i])) add_int(metadata, scene, &optional[i]);
  if (scene->backbone == FX_TENSORF) {
    cJSON_AddStringToObject(metadata, "backbone", TENSORF);
    for (int i = 0; i < TENSORF_INTS; i++) add_int(metadata, scene, &tensorf_ints[i]);
  }
  fx_reals_write(metadata, scene);
  return metadata;
}

sf_status fx_scene_save(const fx_scene *scene, const char *path)
{
  sf_tensor tensor[TENSORS];
  fx_scene copy = *scene;
  SF_TRY(fx_scene_check(scene, path));
  if (scene->backbone == FX_INGP && !scene->grid.levels)
    return sf_fail(SF_E_UNSUPPORTED, "%s: a decoder behind no field is no scene that a file can hold", path);
  int count = list_levels(tensor, &copy);
  count += list_bulk(tensor + count, &copy);
  cJSON *metadata = make_metadata(scene);
  if (!metadata) return sf_fail(SF_E_MEMORY, "%s: no memory for the metadata", path);
  add_u64(metadata, "checksum", checksum(tensor, count, metadata));
  const sf_status status = sf_tensors_save(tensor, count, metadata, path);
  cJSON_Delete(metadata);
  return status;
}

/* ---- loading ---- */

static sf_status read_int(const sf_tensors *set, const int_field *field, fx_scene *scene)
{
  const char *text = sf_tensors_meta(set, field->key);
  char *end = NULL;
  if (!text) return sf_fail(SF_E_FORMAT, "%s: metadata '%s' is missing", set->path, field->key);
  const long value = strtol(text, &end, 10);
  if (end == text || *end || value < INT32_MIN || value > INT32_MAX)
    return sf_fail(SF_E_FORMAT, "%s: metadata '%s' is '%.40s', expected an integer", set->path, field->key, text);
  *int_of(scene, field) = (int32_t)value;
  return sf_ok();
}

static sf_status read_mode(const sf_tensors *set, fx_scene *scene)
{
  const char *text = sf_tensors_meta(set, "mode");
  for (int32_t mode = FX_HYBRID; text && mode <= FX_RADIX; mode++)
    if (!strcmp(text, mode_name[mode])) {
      scene->net.mode = mode;
      return sf_ok();
    }
  if (text && !strcmp(text, "weighted"))
    return sf_fail(SF_E_UNSUPPORTED,
                   "%s: metadata 'mode' is 'weighted', a neuron of an earlier release that this program does not have: "
                   "train the model anew and export it",
                   set->path);
  return sf_fail(SF_E_FORMAT, "%s: metadata 'mode' is '%.40s', expected hybrid, decay, no-decay or radix", set->path,
                 text ? text : "");
}

static sf_status expect_meta(const sf_tensors *set, const char *key, const char *expected, sf_code code)
{
  const char *text = sf_tensors_meta(set, key);
  if (text && !strcmp(text, expected)) return sf_ok();
  return sf_fail(code, "%s: metadata '%s' is '%.100s', expected '%s'", set->path, key, text ? text : "", expected);
}

/* Absent: INGP's, as all files were before there was another. */
static sf_status read_backbone(const sf_tensors *set, fx_scene *scene)
{
  const char *text = sf_tensors_meta(set, "backbone");
  if (!text) return sf_ok();
  SF_TRY(expect_meta(set, "backbone", TENSORF, SF_E_UNSUPPORTED));
  scene->backbone = FX_TENSORF;
  for (int i = 0; i < TENSORF_INTS; i++) SF_TRY(read_int(set, &tensorf_ints[i], scene));
  return sf_ok();
}

/* Rows of weights are as long as the lanes of the build that wrote them. */
static sf_status check_lanes(const sf_tensors *set)
{
  const int64_t shape[2] = {-1, -1};
  const sf_tensor *w;
  SF_TRY(sf_tensors_get(set, fx_layer_table[FX_C1].tensor, SF_I8, 2, shape, &w));
  const int lanes = w->shape[1] == 128 || w->shape[1] == 256 ? (int)w->shape[1] : SF_LANES;
  if (lanes == SF_LANES) return sf_ok();
  return sf_fail(SF_E_UNSUPPORTED,
                 "%s: tensor '%s' needs %d lanes, this build has %d (make B=build/l%d ARCH=\"LANES=%d\" has them)",
                 set->path, w->name, lanes, SF_LANES, lanes, lanes);
}

static sf_status read_metadata(const sf_tensors *set, fx_scene *scene)
{
  SF_TRY(expect_meta(set, "format", FORMAT, SF_E_FORMAT));
  SF_TRY(expect_meta(set, "version", VERSION, SF_E_UNSUPPORTED));
  SF_TRY(check_lanes(set));
  SF_TRY(check_arch(set));
  for (int i = 0; i < INTS; i++) SF_TRY(read_int(set, &ints[i], scene));
  for (int i = 0; i < OPTIONAL; i++)
    if (sf_tensors_meta(set, optional[i].key)) SF_TRY(read_int(set, &optional[i], scene));
  SF_TRY(read_backbone(set, scene));
  SF_TRY(read_mode(set, scene));
  if (scene->net.steps < 1 || scene->net.steps > SF_T_MAX)
    return sf_fail(SF_E_RANGE, "%s: metadata 't_r' is %d, expected 1..%d", set->path, scene->net.steps, SF_T_MAX);
  if (scene->backbone == FX_INGP && (scene->grid.levels < 1 || scene->grid.levels > FX_LEVELS_MAX))
    return sf_fail(SF_E_RANGE, "%s: metadata 'grid.levels' is %d, expected 1..%d", set->path, scene->grid.levels,
                   FX_LEVELS_MAX);
  return fx_reals_read(set->metadata, scene, set->path);
}

static sf_status copy_tensors(const sf_tensors *set, const sf_tensor *want, int count)
{
  for (int i = 0; i < count; i++) {
    const sf_tensor *found;
    SF_TRY(sf_tensors_get(set, want[i].name, want[i].type, want[i].dims, want[i].shape, &found));
    memcpy(want[i].data, found->data, tensor_bytes(found));
  }
  return sf_ok();
}

static sf_status read_entries(const sf_tensors *set, fx_grid *grid)
{
  const int64_t shape[2] = {-1, FX_GRID_FEATURES};
  const sf_tensor *table;
  SF_TRY(sf_tensors_get(set, "grid.table", SF_I8, 2, shape, &table));
  grid->entries = table->shape[0];
  return sf_ok();
}

static sf_status check_sum(const sf_tensors *set)
{
  char expected[32];
  snprintf(expected, sizeof expected, "0x%016" PRIx64, checksum(set->tensor, set->count, set->metadata));
  return expect_meta(set, "checksum", expected, SF_E_FORMAT);
}

static sf_status read_scene(const sf_tensors *set, fx_scene *scene)
{
  sf_tensor want[TENSORS];
  SF_TRY(read_metadata(set, scene));
  SF_TRY(copy_tensors(set, want, list_levels(want, scene)));
  if (scene->backbone == FX_INGP) SF_TRY(read_entries(set, &scene->grid));
  SF_TRY(fx_scene_allocate(scene, set->path));
  SF_TRY(copy_tensors(set, want, list_bulk(want, scene)));
  SF_TRY(fx_scene_check(scene, set->path));
  return check_sum(set);
}

/* Frees the tensors. */
static sf_status load_set(fx_scene *scene, sf_tensors *set)
{
  const sf_status status = read_scene(set, scene);
  sf_tensors_free(set);
  if (status.code != SF_OK) fx_scene_free(scene);
  return status;
}

sf_status fx_scene_load(fx_scene *scene, const char *path)
{
  sf_tensors set;
  memset(scene, 0, sizeof *scene);
  SF_TRY(sf_tensors_load(&set, path));
  return load_set(scene, &set);
}

sf_status fx_scene_load_memory(fx_scene *scene, const void *data, size_t size, const char *name)
{
  sf_tensors set;
  memset(scene, 0, sizeof *scene);
  SF_TRY(sf_tensors_load_memory(&set, data, size, name));
  return load_set(scene, &set);
}
