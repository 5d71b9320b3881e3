/* JSON files: read and written, fields by their names with a clear message. */
#ifndef SF_BASE_JSON_H
#define SF_BASE_JSON_H
#include "base/status.h"
#include <cjson/cJSON.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Parsed JSON with a message that names path, line and column. Free with cJSON_Delete. Rejects trailing text. */
sf_status sf_json_load(const char *path, cJSON **json);
sf_status sf_json_save(const cJSON *json, const char *path);
/* To standard output, as lines or as one; frees it. NULL is SF_E_MEMORY. What is no UTF-8 becomes U+FFFD. */
sf_status sf_json_print(cJSON *json, bool lines);

/* Fields of an object, which may be NULL or something else: then it has none. */
const cJSON *sf_json_get(const cJSON *object, const char *key);            /* NULL: none */
double sf_json_number(const cJSON *object, const char *key);               /* NaN: no finite number */
const char *sf_json_text(const cJSON *object, const char *key);            /* NULL: no text */
bool sf_json_says(const cJSON *object, const char *key, const char *text); /* this text and no other */
/* "ledgers.list[2].parts_fj.mac"; NULL: not there. */
const cJSON *sf_json_at(const cJSON *json, const char *path);
/* Of a number or of the digits of sf_json_add_u64; NaN, 0: neither. */
double sf_json_real(const cJSON *item);
uint64_t sf_json_u64(const cJSON *item);
/* Fields that have to be there; the message is "where: key ..." */
sf_status sf_json_need(const cJSON *object, const char *where, const char *key, const cJSON **item);
/* A whole number, low to high: else SF_E_RANGE. */
sf_status sf_json_need_whole(const cJSON *object, const char *where, const char *key, double low, double high,
                             double *value);
/* A text that fits text[size]. */
sf_status sf_json_need_text(const cJSON *object, const char *where, const char *key, char *text, size_t size);

/* Integers keep all their digits: cJSON numbers are doubles. */
void sf_json_add_u64(cJSON *object, const char *key, uint64_t value);
/* null where the value is no finite number. */
void sf_json_add_real(cJSON *object, const char *key, double value);
/* Text from outside, as a path or a view's name: what is no UTF-8 becomes U+FFFD. */
void sf_json_add_text(cJSON *object, const char *key, const char *text);
#endif
