#include "cli/record.h"
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { TEXT = 4200 };
static const char prefix[] = "option.";

static bool asked_for(const sf_option *o, double value)
{
  return o->min == o->max || (value >= o->min && value <= o->max);
}

/* The shortest text that reads as the same number. */
static void write_double(double value, char text[TEXT])
{
  for (int digits = 6; digits <= 17; digits++) {
    snprintf(text, TEXT, "%.*g", digits, value);
    if (strtod(text, NULL) == value) return;
  }
}

static void write_choice(const char *choices, int index, char text[TEXT])
{
  for (; index > 0; index--) choices = strchr(choices, '|') + 1;
  snprintf(text, TEXT, "%.*s", (int)strcspn(choices, "|"), choices);
}

static void write_value(const sf_option *o, char text[TEXT])
{
  *text = 0;
  switch (o->type) {
  case SF_ARG_INT:
    if (asked_for(o, *(int *)o->value)) snprintf(text, TEXT, "%d", *(int *)o->value);
    break;
  case SF_ARG_U64:
    snprintf(text, TEXT, "%" PRIu64, *(uint64_t *)o->value);
    break;
  case SF_ARG_DOUBLE:
    if (asked_for(o, *(double *)o->value)) write_double(*(double *)o->value, text);
    break;
  case SF_ARG_CHOICE:
    write_choice(o->choices, *(int *)o->value, text);
    break;
  case SF_ARG_STRING:
  case SF_ARG_INPUT:
    if (*(const char **)o->value) snprintf(text, TEXT, "%s", *(const char **)o->value);
    break;
  case SF_ARG_FLAG:
    if (*(bool *)o->value) strcpy(text, "on");
    break;
  default:
    break;
  }
}

static bool is_apart(const char *const *apart, const char *name)
{
  while (*apart && strcmp(*apart, name) != 0) apart++;
  return *apart;
}

static void key_of(const sf_option *o, char key[80])
{
  snprintf(key, 80, "%s%s", prefix, o->name + 2);
}

cJSON *sf_record_make(const sf_option *options, const char *const *apart)
{
  cJSON *record = cJSON_CreateObject();
  for (const sf_option *o = options; record && o->name; o++) {
    char key[80], text[TEXT];
    if (o->type == SF_ARG_GROUP || is_apart(apart, o->name)) continue;
    key_of(o, key);
    write_value(o, text);
    if (cJSON_AddStringToObject(record, key, text)) continue;
    cJSON_Delete(record);
    return NULL;
  }
  return record;
}

sf_status sf_record_words(const sf_tensors *set, const sf_option *options, const char *const *apart, char **word,
                          int *words, int room)
{
  for (const sf_option *o = options; o->name; o++) {
    char key[80];
    if (o->type == SF_ARG_GROUP) continue;
    key_of(o, key);
    const char *value = is_apart(apart, o->name) ? NULL : sf_tensors_meta(set, key);
    if (!value || !*value) continue;
    const size_t length = strlen(o->name) + strlen(value) + 2;
    char *text = *words < room ? malloc(length) : NULL;
    if (!text) return sf_fail(SF_E_MEMORY, "%s: no memory for its options", set->path);
    snprintf(text, length, o->type == SF_ARG_FLAG ? "%s" : "%s=%s", o->name, value);
    word[(*words)++] = text;
  }
  return sf_ok();
}

sf_status sf_record_compare(const sf_tensors *set, const cJSON *record)
{
  const cJSON *item;
  cJSON_ArrayForEach(item, record)
  {
    const char *value = sf_tensors_meta(set, item->string);
    if (!value || !strcmp(value, item->valuestring)) continue;
    return sf_fail(SF_E_RANGE, "%s: its run has --%s %s, the command line says %s", set->path,
                   item->string + strlen(prefix), *value ? value : "not set", item->valuestring);
  }
  return sf_ok();
}
