#include "base/json.h"
#include "base/io.h"
#include "base/text.h"
#include <ctype.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { JSON_LIMIT = 256 << 20 };

/* Line and column (in bytes), both from 1. */
static void locate(const char *text, const char *at, int *line, int *column)
{
  *line = 1, *column = 1;
  for (; text < at; text++) {
    if (*text == '\n')
      ++*line, *column = 1;
    else
      ++*column;
  }
}

static sf_status fail_at(const char *path, const char *text, const char *at, const char *problem)
{
  int line, column;
  locate(text, at, &line, &column);
  return sf_fail(SF_E_FORMAT, "%s:%d:%d: %s", path, line, column, problem);
}

/* Python's json and others write what JSON has no word for. */
static const char *no_word(const char *at, const char *end)
{
  static const char *const word[] = {"NaN",       "nan", "-NaN", "-nan", "Infinity",
                                     "-Infinity", "inf", "-inf", "Inf",  "-Inf"};
  for (size_t i = 0; i < sizeof word / sizeof *word; i++) {
    const size_t n = strlen(word[i]);
    if ((size_t)(end - at) >= n && !memcmp(at, word[i], n) && (at + n == end || !isalnum((unsigned char)at[n])))
      return word[i];
  }
  return NULL;
}

static sf_status malformed(const char *path, const char *text, const char *at, const char *end)
{
  char problem[100];
  if (at == end) return fail_at(path, text, at, "malformed JSON: the file ends early");
  const char *word = no_word(at, end);
  if (!word) return fail_at(path, text, at, "malformed JSON");
  snprintf(problem, sizeof problem, "malformed JSON: %s is not JSON: a number must stand here", word);
  return fail_at(path, text, at, problem);
}

static sf_status parse(const char *path, const char *text, size_t size, cJSON **json)
{
  const char *zero = memchr(text, 0, size), *end = text + size, *at = NULL;
  if (zero) return fail_at(path, text, zero, "malformed JSON: a NUL byte");
  size_t blank = strspn(text, " \t\r\n");
  if (blank == size) return fail_at(path, text, end, "malformed JSON: the file is empty");
  *json = cJSON_ParseWithLengthOpts(text, size + 1, &at, 0);
  if (!at || at < text || at > end) at = end;
  if (!*json) return malformed(path, text, at, end);
  at += strspn(at, " \t\r\n");
  if (at == end) return sf_ok();
  cJSON_Delete(*json);
  *json = NULL;
  return fail_at(path, text, at, "malformed JSON: text after the end");
}

sf_status sf_json_load(const char *path, cJSON **json)
{
  *json = NULL;
  char *text;
  size_t size;
  SF_TRY(sf_read_file(path, JSON_LIMIT, &text, &size));
  sf_status status = parse(path, text, size, json);
  free(text);
  return status;
}

sf_status sf_json_save(const cJSON *json, const char *path)
{
  char *text = cJSON_Print(json);
  if (!text) return sf_fail(SF_E_MEMORY, "%s: no memory for the JSON text", path);
  size_t n = strlen(text);
  text[n] = '\n'; /* the terminator's place: the length is passed on */
  sf_status status = sf_write_file(path, text, n + 1);
  cJSON_free(text);
  return status;
}

sf_status sf_json_print(cJSON *json, bool lines)
{
  char *text = json ? lines ? cJSON_Print(json) : cJSON_PrintUnformatted(json) : NULL;
  cJSON_Delete(json);
  if (!text) return sf_fail(SF_E_MEMORY, "no memory for the report");
  sf_utf8_write(stdout, text);
  putchar('\n');
  cJSON_free(text);
  return fflush(stdout) == 0 && !ferror(stdout) ? sf_ok()
                                                : sf_fail(SF_E_IO, "standard output: cannot write the report");
}

/* ---- fields ---- */

const cJSON *sf_json_get(const cJSON *object, const char *key)
{
  return cJSON_GetObjectItemCaseSensitive(object, key);
}

double sf_json_number(const cJSON *object, const char *key)
{
  const cJSON *item = sf_json_get(object, key);
  return cJSON_IsNumber(item) && isfinite(item->valuedouble) ? item->valuedouble : NAN;
}

const char *sf_json_text(const cJSON *object, const char *key)
{
  return cJSON_GetStringValue(sf_json_get(object, key));
}

bool sf_json_says(const cJSON *object, const char *key, const char *text)
{
  const char *value = sf_json_text(object, key);
  return value && !strcmp(value, text);
}

const cJSON *sf_json_at(const cJSON *json, const char *path)
{
  while (json && *path) {
    char name[64];
    int length = 0;
    unsigned index;
    if (*path == '.') path++;
    if (sscanf(path, "[%u]%n", &index, &length) == 1 && length > 0)
      json = cJSON_GetArrayItem(json, (int)index);
    else if (sscanf(path, "%63[^.[]%n", name, &length) == 1)
      json = cJSON_GetObjectItemCaseSensitive(json, name);
    else
      return NULL;
    path += length;
  }
  return json;
}

double sf_json_real(const cJSON *item)
{
  if (cJSON_IsRaw(item)) return strtod(item->valuestring, NULL);
  return cJSON_IsNumber(item) ? item->valuedouble : (double)NAN;
}

uint64_t sf_json_u64(const cJSON *item)
{
  if (cJSON_IsRaw(item)) return strtoull(item->valuestring, NULL, 10);
  return cJSON_IsNumber(item) && item->valuedouble > 0 ? (uint64_t)item->valuedouble : 0;
}

sf_status sf_json_need(const cJSON *object, const char *where, const char *key, const cJSON **item)
{
  *item = sf_json_get(object, key);
  return *item ? sf_ok() : sf_fail(SF_E_FORMAT, "%s: %s is missing", where, key);
}

sf_status sf_json_need_whole(const cJSON *object, const char *where, const char *key, double low, double high,
                             double *value)
{
  const cJSON *item;
  SF_TRY(sf_json_need(object, where, key, &item));
  *value = cJSON_IsNumber(item) ? item->valuedouble : (double)NAN;
  if (*value >= low && *value <= high && *value == floor(*value)) return sf_ok();
  return sf_fail(SF_E_RANGE, "%s: %s is not a whole number from %.0f to %.0f", where, key, low, high);
}

sf_status sf_json_need_text(const cJSON *object, const char *where, const char *key, char *text, size_t size)
{
  const cJSON *item;
  SF_TRY(sf_json_need(object, where, key, &item));
  const char *value = cJSON_GetStringValue(item);
  if (!value || strlen(value) >= size)
    return sf_fail(SF_E_FORMAT, "%s: %s is not a text of at most %zu bytes", where, key, size - 1);
  memcpy(text, value, strlen(value) + 1);
  return sf_ok();
}

void sf_json_add_u64(cJSON *object, const char *key, uint64_t value)
{
  char digits[24];
  snprintf(digits, sizeof digits, "%" PRIu64, value);
  cJSON_AddRawToObject(object, key, digits);
}

void sf_json_add_real(cJSON *object, const char *key, double value)
{
  if (isfinite(value))
    cJSON_AddNumberToObject(object, key, value);
  else
    cJSON_AddNullToObject(object, key);
}

void sf_json_add_text(cJSON *object, const char *key, const char *text)
{
  char *whole = malloc(strlen(text) * strlen(sf_utf8_replacement) + 1), *to = whole;
  if (!whole) return;
  for (size_t n; *text; text += n ? n : 1) {
    n = sf_utf8_length(text);
    memcpy(to, n ? text : sf_utf8_replacement, n ? n : strlen(sf_utf8_replacement));
    to += n ? n : strlen(sf_utf8_replacement);
  }
  *to = 0;
  cJSON_AddStringToObject(object, key, whole);
  free(whole);
}
