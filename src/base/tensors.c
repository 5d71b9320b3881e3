/* safetensors, read with the checks of the format's own library. */
#include "base/io.h"
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#define HEADER_LIMIT 100000000u /* the reference library's own limit */
#define FILE_LIMIT ((size_t)1 << 36)
#define MAX_EXACT 9007199254740992.0 /* 2^53: JSON numbers are doubles */

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "tensor data is stored little-endian");

static const struct {
  const char *name;
  size_t size;
} dtypes[] = {[SF_F32] = {"F32", 4}, [SF_I8] = {"I8", 1},   [SF_U8] = {"U8", 1},  [SF_I16] = {"I16", 2},
              [SF_I32] = {"I32", 4}, [SF_I64] = {"I64", 8}, [SF_U64] = {"U64", 8}};
enum { DTYPES = sizeof dtypes / sizeof dtypes[0] };

size_t sf_dtype_size(sf_dtype type)
{
  return (unsigned)type < DTYPES ? dtypes[type].size : 0;
}
const char *sf_dtype_name(sf_dtype type)
{
  return (unsigned)type < DTYPES ? dtypes[type].name : "?";
}

/* ---- reading ---- */

/* Place of one tensor in the data section. */
typedef struct span {
  uint64_t begin, end;
  int index;
} span;

static bool json_count(const cJSON *item, uint64_t *value)
{
  if (!cJSON_IsNumber(item)) return false;
  double d = item->valuedouble;
  if (!(d >= 0 && d <= MAX_EXACT) || d != floor(d)) return false;
  *value = (uint64_t)d;
  return true;
}

static sf_status parse_dtype(const char *path, const char *name, const cJSON *item, sf_dtype *type)
{
  static const char *const other[] = {"BOOL", "U16", "F16", "BF16", "U32", "F64", "F8_E4M3", "F8_E5M2"};
  const cJSON *field = cJSON_GetObjectItemCaseSensitive(item, "dtype");
  if (!cJSON_IsString(field)) return sf_fail(SF_E_FORMAT, "%s: tensor '%s': dtype is missing", path, name);
  for (int i = 0; i < DTYPES; i++) {
    if (strcmp(field->valuestring, dtypes[i].name)) continue;
    *type = (sf_dtype)i;
    return sf_ok();
  }
  for (size_t i = 0; i < sizeof other / sizeof *other; i++)
    if (!strcmp(field->valuestring, other[i]))
      return sf_fail(SF_E_UNSUPPORTED, "%s: tensor '%s': dtype %s is not supported", path, name, other[i]);
  return sf_fail(SF_E_FORMAT, "%s: tensor '%s': unknown dtype '%.20s'", path, name, field->valuestring);
}

static sf_status parse_shape(const char *path, const cJSON *item, sf_tensor *tensor, uint64_t *bytes)
{
  const cJSON *shape = cJSON_GetObjectItemCaseSensitive(item, "shape"), *side;
  if (!cJSON_IsArray(shape)) return sf_fail(SF_E_FORMAT, "%s: tensor '%s': shape is missing", path, tensor->name);
  *bytes = sf_dtype_size(tensor->type);
  cJSON_ArrayForEach(side, shape)
  {
    uint64_t n;
    if (tensor->dims == 4)
      return sf_fail(SF_E_UNSUPPORTED, "%s: tensor '%s': more than 4 dimensions", path, tensor->name);
    if (!json_count(side, &n))
      return sf_fail(SF_E_FORMAT, "%s: tensor '%s': shape[%d] is not a count", path, tensor->name, tensor->dims);
    if (__builtin_mul_overflow(*bytes, n, bytes))
      return sf_fail(SF_E_FORMAT, "%s: tensor '%s': shape overflows", path, tensor->name);
    tensor->shape[tensor->dims++] = (int64_t)n;
  }
  return sf_ok();
}

static sf_status parse_offsets(const char *path, const cJSON *item, const sf_tensor *tensor, uint64_t bytes,
                               uint64_t data_size, span *place)
{
  const cJSON *offsets = cJSON_GetObjectItemCaseSensitive(item, "data_offsets");
  if (!cJSON_IsArray(offsets) || cJSON_GetArraySize(offsets) != 2 ||
      !json_count(cJSON_GetArrayItem(offsets, 0), &place->begin) ||
      !json_count(cJSON_GetArrayItem(offsets, 1), &place->end))
    return sf_fail(SF_E_FORMAT, "%s: tensor '%s': data_offsets is not a pair of byte offsets", path, tensor->name);
  if (place->begin > place->end || place->end > data_size)
    return sf_fail(SF_E_FORMAT, "%s: tensor '%s': bytes %ju..%ju are outside the data of %ju bytes", path, tensor->name,
                   (uintmax_t)place->begin, (uintmax_t)place->end, (uintmax_t)data_size);
  if (place->end - place->begin != bytes)
    return sf_fail(SF_E_FORMAT, "%s: tensor '%s': %ju bytes of data, its shape needs %ju", path, tensor->name,
                   (uintmax_t)(place->end - place->begin), (uintmax_t)bytes);
  return sf_ok();
}

static sf_status parse_tensor(const char *path, const cJSON *item, uint64_t data_size, sf_tensor *tensor, span *place)
{
  if (!cJSON_IsObject(item))
    return sf_fail(SF_E_FORMAT, "%s: header entry '%.64s' is not an object", path, item->string);
  if (strlen(item->string) >= sizeof tensor->name)
    return sf_fail(SF_E_UNSUPPORTED, "%s: tensor name '%.40s...' is longer than 63 bytes", path, item->string);
  strcpy(tensor->name, item->string);
  uint64_t bytes = 0;
  SF_TRY(parse_dtype(path, tensor->name, item, &tensor->type));
  SF_TRY(parse_shape(path, item, tensor, &bytes));
  return parse_offsets(path, item, tensor, bytes, data_size, place);
}

static sf_status check_metadata(const char *path, const cJSON *metadata)
{
  const cJSON *item;
  if (!cJSON_IsObject(metadata)) return sf_fail(SF_E_FORMAT, "%s: __metadata__ is not an object", path);
  cJSON_ArrayForEach(item, metadata)
  {
    if (!cJSON_IsString(item))
      return sf_fail(SF_E_FORMAT, "%s: __metadata__ '%.64s' is not a string", path, item->string);
  }
  return sf_ok();
}

static int by_place(const void *a, const void *b)
{
  const span *p = a, *q = b;
  if (p->begin != q->begin) return p->begin < q->begin ? -1 : 1;
  return (p->end > q->end) - (p->end < q->end);
}

static int by_name(const void *a, const void *b)
{
  return strcmp(((const sf_tensor *)a)->name, ((const sf_tensor *)b)->name);
}

static sf_status check_coverage(const sf_tensors *set, const char *path, span *place, uint64_t data_size)
{
  uint64_t at = 0;
  qsort(place, (size_t)set->count, sizeof *place, by_place);
  for (int i = 0; i < set->count; i++) {
    const char *name = set->tensor[place[i].index].name;
    if (place[i].begin < at)
      return sf_fail(SF_E_FORMAT, "%s: tensor '%s': overlaps another one at data byte %ju", path, name,
                     (uintmax_t)place[i].begin);
    if (place[i].begin > at)
      return sf_fail(SF_E_FORMAT, "%s: tensor '%s': a hole of %ju bytes before data byte %ju", path, name,
                     (uintmax_t)(place[i].begin - at), (uintmax_t)place[i].begin);
    at = place[i].end;
  }
  if (at != data_size)
    return sf_fail(SF_E_FORMAT, "%s: %ju bytes behind the last tensor", path, (uintmax_t)(data_size - at));
  return sf_ok();
}

static sf_status check_names(const sf_tensors *set, const char *path)
{
  sf_tensor *sorted = malloc((size_t)set->count * sizeof *sorted + 1);
  if (!sorted) return sf_fail(SF_E_MEMORY, "%s: no memory for %d tensors", path, set->count);
  memcpy(sorted, set->tensor, (size_t)set->count * sizeof *sorted);
  qsort(sorted, (size_t)set->count, sizeof *sorted, by_name);
  sf_status status = sf_ok();
  for (int i = 1; i < set->count && status.code == SF_OK; i++)
    if (!strcmp(sorted[i - 1].name, sorted[i].name))
      status = sf_fail(SF_E_FORMAT, "%s: tensor '%s': its name appears twice", path, sorted[i].name);
  free(sorted);
  return status;
}

/* Foreign files may start their data anywhere: copies the tensors to places fit for their types. */
static sf_status align_data(sf_tensors *set, const char *path)
{
  size_t total = 0, at = 0;
  bool aligned = true;
  for (int i = 0; i < set->count; i++) {
    const sf_tensor *t = &set->tensor[i];
    size_t bytes = sf_dtype_size(t->type);
    if ((uintptr_t)t->data % bytes) aligned = false;
    for (int k = 0; k < t->dims; k++) bytes *= (size_t)t->shape[k];
    total += (bytes + 7) / 8 * 8;
  }
  if (aligned) return sf_ok();
  char *buffer = malloc(total + 1);
  if (!buffer) return sf_fail(SF_E_MEMORY, "%s: no memory for %zu bytes", path, total);
  for (int i = 0; i < set->count; i++) {
    sf_tensor *t = &set->tensor[i];
    size_t bytes = sf_dtype_size(t->type);
    for (int k = 0; k < t->dims; k++) bytes *= (size_t)t->shape[k];
    memcpy(buffer + at, t->data, bytes);
    t->data = buffer + at;
    at += (bytes + 7) / 8 * 8;
  }
  free(set->buffer);
  set->buffer = buffer;
  return sf_ok();
}

static sf_status read_entries(sf_tensors *set, const char *path, cJSON *header, char *data, uint64_t data_size)
{
  int entries = cJSON_GetArraySize(header);
  span *place = calloc((size_t)entries + 1, sizeof *place);
  set->tensor = calloc((size_t)entries + 1, sizeof *set->tensor);
  sf_status status = sf_ok();
  if (!place || !set->tensor) status = sf_fail(SF_E_MEMORY, "%s: no memory for %d tensors", path, entries);
  for (cJSON *item = header->child, *next; item && status.code == SF_OK; item = next) {
    next = item->next;
    if (!strcmp(item->string, "__metadata__")) {
      status =
          set->metadata ? sf_fail(SF_E_FORMAT, "%s: __metadata__ appears twice", path) : check_metadata(path, item);
      if (status.code == SF_OK) set->metadata = cJSON_DetachItemViaPointer(header, item);
      continue;
    }
    sf_tensor *tensor = &set->tensor[set->count];
    place[set->count].index = set->count;
    status = parse_tensor(path, item, data_size, tensor, &place[set->count]);
    if (status.code == SF_OK) tensor->data = data + place[set->count++].begin;
  }
  if (status.code == SF_OK) status = check_names(set, path);
  if (status.code == SF_OK) status = check_coverage(set, path, place, data_size);
  free(place);
  return status;
}

static sf_status read_header(sf_tensors *set, const char *path, size_t size)
{
  uint64_t length;
  if (size < 8) return sf_fail(SF_E_FORMAT, "%s: %zu bytes, too short for a safetensors file", path, size);
  memcpy(&length, set->buffer, 8);
  if (length > HEADER_LIMIT)
    return sf_fail(SF_E_FORMAT, "%s: not a model or a scene: its header has %ju bytes, the limit is %u", path,
                   (uintmax_t)length, HEADER_LIMIT);
  if (length > size - 8)
    return sf_fail(SF_E_FORMAT, "%s: cut short: header of %ju bytes, %zu in the file", path, (uintmax_t)length,
                   size - 8);
  const char *text = set->buffer + 8, *end = NULL;
  if (!length || *text != '{') return sf_fail(SF_E_FORMAT, "%s: byte 8: the header is not a JSON object", path);
  if (memchr(text, 0, length)) return sf_fail(SF_E_FORMAT, "%s: the header holds a NUL byte", path);
  cJSON *header = cJSON_ParseWithLengthOpts(text, length, &end, 0);
  if (!end || end < text || end > text + length) end = text + length;
  if (!header) return sf_fail(SF_E_FORMAT, "%s: byte %zu: malformed JSON header", path, (size_t)(end - set->buffer));
  for (; end < text + length; end++)
    if (!strchr(" \t\r\n", *end)) break;
  sf_status status;
  if (end < text + length)
    status = sf_fail(SF_E_FORMAT, "%s: byte %zu: text behind the JSON header", path, (size_t)(end - set->buffer));
  else
    status = read_entries(set, path, header, set->buffer + 8 + length, size - 8 - length);
  cJSON_Delete(header);
  return status;
}

/* Takes over set->buffer. */
static sf_status parse_buffer(sf_tensors *set, size_t size)
{
  sf_status status = read_header(set, set->path, size);
  if (status.code == SF_OK) status = align_data(set, set->path);
  if (status.code != SF_OK) sf_tensors_free(set);
  return status;
}

sf_status sf_tensors_load(sf_tensors *set, const char *path)
{
  memset(set, 0, sizeof *set);
  snprintf(set->path, sizeof set->path, "%s", path);
  size_t size;
  SF_TRY(sf_read_file(path, FILE_LIMIT, &set->buffer, &size));
  return parse_buffer(set, size);
}

sf_status sf_tensors_load_memory(sf_tensors *set, const void *data, size_t size, const char *name)
{
  memset(set, 0, sizeof *set);
  snprintf(set->path, sizeof set->path, "%s", name);
  if (size > FILE_LIMIT)
    return sf_fail(SF_E_FORMAT, "%s: %zu bytes, larger than the limit of %zu", name, size, FILE_LIMIT);
  set->buffer = malloc(size + 1);
  if (!set->buffer) return sf_fail(SF_E_MEMORY, "%s: no memory for %zu bytes", name, size);
  if (size) memcpy(set->buffer, data, size);
  set->buffer[size] = 0;
  return parse_buffer(set, size);
}

void sf_tensors_free(sf_tensors *set)
{
  free(set->tensor);
  free(set->buffer);
  cJSON_Delete(set->metadata);
  memset(set, 0, sizeof *set);
}

/* ---- looking up ---- */

static void describe(char *text, size_t room, sf_dtype type, int dims, const int64_t *shape)
{
  size_t n = (size_t)snprintf(text, room, "%s[", sf_dtype_name(type));
  for (int i = 0; i < dims && n < room; i++) {
    if (shape[i] < 0)
      n += (size_t)snprintf(text + n, room - n, "%s*", i ? "," : "");
    else
      n += (size_t)snprintf(text + n, room - n, "%s%lld", i ? "," : "", (long long)shape[i]);
  }
  if (n < room) snprintf(text + n, room - n, "]");
}

sf_status sf_tensors_get(const sf_tensors *set, const char *name, sf_dtype type, int dims, const int64_t *shape,
                         const sf_tensor **tensor)
{
  *tensor = NULL;
  for (int i = 0; i < set->count; i++) {
    const sf_tensor *t = &set->tensor[i];
    if (strcmp(t->name, name)) continue;
    bool same = t->type == type && t->dims == dims;
    for (int k = 0; same && k < dims; k++) same = shape[k] < 0 || shape[k] == t->shape[k];
    if (same) {
      *tensor = t;
      return sf_ok();
    }
    char expected[120], found[120];
    describe(expected, sizeof expected, type, dims, shape);
    describe(found, sizeof found, t->type, t->dims, t->shape);
    return sf_fail(SF_E_FORMAT, "%s: tensor '%s': expected %s, found %s", set->path, name, expected, found);
  }
  return sf_fail(SF_E_FORMAT, "%s: tensor '%s' is missing", set->path, name);
}

const char *sf_tensors_meta(const sf_tensors *set, const char *key)
{
  return cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(set->metadata, key));
}

sf_status sf_tensor_finite(const char *path, const sf_tensor *tensor)
{
  if (tensor->type != SF_F32) return sf_ok();
  const float *value = tensor->data;
  size_t n = 1;
  for (int k = 0; k < tensor->dims; k++) n *= (size_t)tensor->shape[k];
  for (size_t i = 0; i < n; i++)
    if (!isfinite(value[i]))
      return sf_fail(SF_E_RANGE, "%s: tensor '%s': element %zu is %s", path, tensor->name, i,
                     isnan(value[i]) ? "NaN" : "infinite");
  return sf_ok();
}
