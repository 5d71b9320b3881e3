/* safetensors, written as the format's own library writes it. */
#include "base/io.h"
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#define HEADER_LIMIT 100000000u
#define FILE_LIMIT ((size_t)1 << 36)

static sf_status tensor_bytes(const char *path, const sf_tensor *tensor, size_t *bytes)
{
  *bytes = sf_dtype_size(tensor->type);
  size_t length = strnlen(tensor->name, sizeof tensor->name);
  if (!length || length == sizeof tensor->name || !strcmp(tensor->name, "__metadata__"))
    return sf_fail(SF_E_RANGE, "%s: '%.63s' cannot name a tensor", path, tensor->name);
  if (!*bytes || tensor->dims < 0 || tensor->dims > 4)
    return sf_fail(SF_E_RANGE, "%s: tensor '%s': unknown type or more than 4 dimensions", path, tensor->name);
  for (int k = 0; k < tensor->dims; k++)
    if (tensor->shape[k] < 0 || __builtin_mul_overflow(*bytes, (size_t)tensor->shape[k], bytes) || *bytes > FILE_LIMIT)
      return sf_fail(SF_E_RANGE, "%s: tensor '%s': shape[%d] is out of range", path, tensor->name, k);
  if (*bytes && !tensor->data) return sf_fail(SF_E_RANGE, "%s: tensor '%s': it has no data", path, tensor->name);
  return sf_ok();
}

/* Widest type first, then by name, as the reference library does: every tensor is then aligned for its type. */
static int save_order(const void *a, const void *b)
{
  const sf_tensor *p = *(const sf_tensor *const *)a, *q = *(const sf_tensor *const *)b;
  size_t sp = sf_dtype_size(p->type), sq = sf_dtype_size(q->type);
  if (sp != sq) return sp > sq ? -1 : 1;
  return strcmp(p->name, q->name);
}

static sf_status check_names(const char *path, const sf_tensor **order, int count)
{
  for (int i = 0; i < count; i++)
    for (int k = i + 1; k < count; k++)
      if (!strcmp(order[i]->name, order[k]->name))
        return sf_fail(SF_E_RANGE, "%s: two tensors are named '%s'", path, order[i]->name);
  return sf_ok();
}

static sf_status check_metadata(const char *path, const cJSON *metadata)
{
  const cJSON *item;
  if (!cJSON_IsObject(metadata)) return sf_fail(SF_E_RANGE, "%s: the metadata is not a JSON object", path);
  cJSON_ArrayForEach(item, metadata)
  {
    if (!cJSON_IsString(item)) return sf_fail(SF_E_RANGE, "%s: metadata '%.64s' is not a string", path, item->string);
  }
  return sf_ok();
}

static bool add_entry(cJSON *header, const sf_tensor *tensor, size_t begin, size_t end)
{
  cJSON *entry = cJSON_AddObjectToObject(header, tensor->name);
  cJSON *shape, *offsets, *last = NULL;
  if (!entry || !cJSON_AddStringToObject(entry, "dtype", sf_dtype_name(tensor->type))) return false;
  if (!(shape = cJSON_AddArrayToObject(entry, "shape"))) return false;
  for (int k = 0; k < tensor->dims; k++) {
    if (!(last = cJSON_CreateNumber((double)tensor->shape[k]))) return false;
    cJSON_AddItemToArray(shape, last);
  }
  if (!(offsets = cJSON_AddArrayToObject(entry, "data_offsets"))) return false;
  cJSON *first = cJSON_CreateNumber((double)begin);
  last = cJSON_CreateNumber((double)end);
  return cJSON_AddItemToArray(offsets, first) && cJSON_AddItemToArray(offsets, last);
}

/* JSON text of the header; NULL when memory ran out. */
static char *header_text(const sf_tensor **order, const size_t *bytes, int count, const cJSON *metadata)
{
  cJSON *header = cJSON_CreateObject();
  bool good = header != NULL;
  if (good && metadata && metadata->child) {
    cJSON *copy = cJSON_Duplicate(metadata, 1);
    good = cJSON_AddItemToObject(header, "__metadata__", copy);
  }
  size_t at = 0;
  for (int i = 0; i < count && good; i++) {
    good = add_entry(header, order[i], at, at + bytes[i]);
    at += bytes[i];
  }
  char *text = good ? cJSON_PrintUnformatted(header) : NULL;
  cJSON_Delete(header);
  return text;
}

static sf_status write_all(const char *path, const char *header, const sf_tensor **order, const size_t *bytes,
                           int count)
{
  sf_writer writer;
  SF_TRY(sf_writer_open(&writer, path));
  size_t length = strlen(header), padded = (length + 7) / 8 * 8;
  uint64_t prefix = padded;
  if (padded > HEADER_LIMIT) {
    sf_writer_abort(&writer);
    return sf_fail(SF_E_RANGE, "%s: a header of %zu bytes is over the format's limit", path, padded);
  }
  fwrite(&prefix, sizeof prefix, 1, writer.file);
  fwrite(header, 1, length, writer.file);
  for (; length < padded; length++) fputc(' ', writer.file);
  for (int i = 0; i < count && !ferror(writer.file); i++)
    if (bytes[i]) fwrite(order[i]->data, 1, bytes[i], writer.file);
  return sf_writer_commit(&writer);
}

sf_status sf_tensors_save(const sf_tensor *tensor, int count, const cJSON *metadata, const char *path)
{
  if (metadata) SF_TRY(check_metadata(path, metadata));
  const sf_tensor **order = calloc((size_t)count + 1, sizeof *order);
  size_t *bytes = calloc((size_t)count + 1, sizeof *bytes);
  sf_status status = order && bytes ? sf_ok() : sf_fail(SF_E_MEMORY, "%s: no memory for %d tensors", path, count);
  for (int i = 0; i < count && status.code == SF_OK; i++) order[i] = &tensor[i];
  if (status.code == SF_OK && count) qsort(order, (size_t)count, sizeof *order, save_order);
  for (int i = 0; i < count && status.code == SF_OK; i++) status = tensor_bytes(path, order[i], &bytes[i]);
  if (status.code == SF_OK) status = check_names(path, order, count);
  if (status.code == SF_OK) {
    char *header = header_text(order, bytes, count, metadata);
    status = header ? write_all(path, header, order, bytes, count) : sf_fail(SF_E_MEMORY, "%s: no memory", path);
    cJSON_free(header);
  }
  free(order);
  free(bytes);
  return status;
}

void sf_tensors_put_number(cJSON *metadata, const char *key, double value)
{
  char text[40];
  snprintf(text, sizeof text, "%.17g", value);
  cJSON_AddStringToObject(metadata, key, text);
}
