/* For targets whose input is a safetensors file: a mutation that keeps the file whole and changes scalars of its
 * header, several at once, since most of them are only valid together. libFuzzer alone breaks the header's length or
 * the syntax of the text, and all that it reaches is the refusal. */
#ifndef SF_TESTS_FUZZ_MUTATE_HEADER_H
#define SF_TESTS_FUZZ_MUTATE_HEADER_H
#include "fuzz.h"
#include <cjson/cJSON.h>

size_t LLVMFuzzerMutate(uint8_t *data, size_t size, size_t max) __attribute__((weak)); /* not in a replay */
size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t max, unsigned seed);

static inline unsigned header_draw(unsigned *state, int below)
{
  *state = *state * 1664525u + 1013904223u;
  return (*state >> 8) % (unsigned)below;
}

/* Another scalar's value, a corner, or a neighbour. */
static inline void header_change(const cJSON *metadata, unsigned *state)
{
  static const char *const corner[] = {"0", "1", "2", "-1", "3", "16", "160", "2147483647", "0x1p-7", "tensorf"};
  const int n = cJSON_GetArraySize(metadata);
  char text[32];
  if (n < 1) return;
  cJSON *item = cJSON_GetArrayItem(metadata, (int)header_draw(state, n));
  const char *was = cJSON_GetStringValue(item), *now = text;
  if (!was) return;
  const unsigned kind = header_draw(state, 3);
  if (kind == 0) now = cJSON_GetStringValue(cJSON_GetArrayItem(metadata, (int)header_draw(state, n)));
  if (kind == 1) now = corner[header_draw(state, sizeof corner / sizeof *corner)];
  if (kind == 2) snprintf(text, sizeof text, "%ld", strtol(was, NULL, 10) + (header_draw(state, 2) ? 1 : -1));
  if (now && now != was) cJSON_SetValuestring(item, now);
}

/* The file with another header, or 0 where it has none that can be read or there is no room. */
static inline size_t header_replace(uint8_t *data, size_t size, size_t max, unsigned seed)
{
  uint64_t length;
  if (size < sizeof length) return 0;
  memcpy(&length, data, sizeof length);
  if (length > size - sizeof length) return 0;
  cJSON *header = cJSON_ParseWithLength((const char *)data + sizeof length, (size_t)length);
  const cJSON *metadata = cJSON_GetObjectItemCaseSensitive(header, "__metadata__");
  for (unsigned i = 0, changes = 1 + header_draw(&seed, 6); i < changes; i++) header_change(metadata, &seed);
  char *text = metadata ? cJSON_PrintUnformatted(header) : NULL;
  cJSON_Delete(header);
  const size_t rest = size - sizeof length - (size_t)length, chars = text ? strlen(text) : 0;
  const size_t total = chars && sizeof length + chars + rest <= max ? sizeof length + chars + rest : 0;
  if (total) {
    memmove(data + sizeof length + chars, data + sizeof length + length, rest);
    memcpy(data + sizeof length, text, chars);
    length = chars;
    memcpy(data, &length, sizeof length);
  }
  cJSON_free(text);
  return total;
}

size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t max, unsigned seed)
{
  const size_t changed = seed % 4 ? header_replace(data, size, max, seed) : 0;
  return changed ? changed : LLVMFuzzerMutate(data, size, max);
}
#endif
