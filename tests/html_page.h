/* For test_html.c: reads a page as text and counts what is wrong with it; the first fault is kept in words. */
#ifndef SF_TESTS_HTML_PAGE_H
#define SF_TESTS_HTML_PAGE_H
#include <cjson/cJSON.h>
#include <ctype.h>
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct faults {
  int count;
  char first[400];
} faults;

static inline void fault(faults *f, const char *format, ...)
{
  va_list args;
  if (f->count++ > 0) return;
  va_start(args, format);
  vsnprintf(f->first, sizeof f->first, format, args);
  va_end(args);
}

/* ---- well-formed: tags nest, attributes are quoted, entities are known ---- */

static inline const char *check_entity(faults *f, const char *at)
{
  static const char *const known[] = {"&lt;", "&gt;", "&amp;", "&quot;"};
  for (int i = 0; i < 4; i++)
    if (!strncmp(at, known[i], strlen(known[i]))) return at + strlen(known[i]);
  fault(f, "unknown entity %.12s", at);
  return at + 1;
}

/* After the name of a tag: to behind its '>'. */
static inline const char *check_attributes(faults *f, const char *at, bool *closed)
{
  *closed = false;
  for (;;) {
    while (isspace((unsigned char)*at)) at++;
    if (*at == '/' && at[1] == '>') {
      *closed = true;
      return at + 2;
    }
    if (*at == '>') return at + 1;
    const char *name = at;
    while (isalnum((unsigned char)*at) || strchr("-:", *at ? *at : ' ')) at++;
    if (at == name || at[0] != '=' || at[1] != '"') {
      fault(f, "attribute without a quoted value: %.30s", name);
      return at + 1;
    }
    for (at += 2; *at && *at != '"';) {
      if (*at == '<') fault(f, "'<' in a value: %.30s", name);
      at = *at == '&' ? check_entity(f, at) : at + 1;
    }
    if (*at) at++;
  }
}

static inline void check_tags(faults *f, const char *page)
{
  char stack[64][16];
  int depth = 0;
  const char *at = strstr(page, "<html");
  while (at && *at) {
    if (*at == '&') {
      at = check_entity(f, at);
      continue;
    }
    if (*at != '<') {
      at++;
      continue;
    }
    const bool end = at[1] == '/';
    char name[16] = "";
    bool closed;
    at += 1 + end;
    for (size_t n = 0; isalnum((unsigned char)*at) && n < sizeof name - 1; at++) name[n++] = *at;
    at = check_attributes(f, at, &closed);
    if (end) {
      if (depth == 0 || strcmp(stack[depth - 1], name))
        fault(f, "</%s> does not close <%s>", name, depth ? stack[depth - 1] : "");
      depth -= depth > 0;
    } else if (!closed && depth < 64) {
      strcpy(stack[depth++], name);
    }
  }
  if (depth > 0) fault(f, "<%s> stays open", stack[depth - 1]);
}

/* ---- nothing is fetched ---- */

static inline void check_references(faults *f, const char *page)
{
  for (const char *at = page; (at = strstr(at, "src=\"")); at++)
    if (strncmp(at + 5, "data:image/png;base64,", 22)) fault(f, "fetches %.40s", at);
  for (const char *at = page; (at = strstr(at, "href=\"")); at++) {
    char id[64];
    if (sscanf(at + 6, "#%50[^\"]", id) != 1) {
      fault(f, "leads outside: %.40s", at);
      continue;
    }
    char target[80];
    snprintf(target, sizeof target, "id=\"%s\"", id);
    if (!strstr(page, target)) fault(f, "leads nowhere: #%s", id);
  }
  for (const char *at = page; (at = strstr(at, "url(")); at++)
    if (at[4] != '#') fault(f, "fetches %.40s", at);
  static const char *const never[] = {"@import", "<link", "<iframe", "<object", "fetch(", "XMLHttp"};
  for (int i = 0; i < 6; i++)
    if (strstr(page, never[i])) fault(f, "has %s", never[i]);
}

/* ---- numbers are those of the JSON inside ---- */

static inline cJSON *page_json(const char *page)
{
  const char *at = strstr(page, "id=\"audit-json\">");
  return at ? cJSON_Parse(at + strlen("id=\"audit-json\">")) : NULL;
}

/* "ledgers.list[2].parts_fj.mac" */
static inline const cJSON *json_at(const cJSON *json, const char *path)
{
  while (json && *path) {
    char name[64];
    int length = 0, index;
    if (*path == '.') path++;
    if (sscanf(path, "[%d]%n", &index, &length) == 1 && length > 0)
      json = cJSON_GetArrayItem(json, index);
    else if (sscanf(path, "%63[^.[]%n", name, &length) == 1)
      json = cJSON_GetObjectItemCaseSensitive(json, name);
    else
      return NULL;
    path += length;
  }
  return json;
}

/* Text such as "12 345", "70.98 mJ", a minus sign before it: its value, and half a unit of its last digit. */
static inline double shown_value(const char *text, double *half)
{
  static const struct {
    const char *name;
    double factor;
  } unit[] = {{" fJ", 1}, {" pJ", 1e3}, {" nJ", 1e6}, {" \xc2\xb5J", 1e9}, {" mJ", 1e12}, {" J", 1e15}, {" kJ", 1e18}};
  char digits[64];
  size_t n = 0;
  double sign = 1;
  *half = 0.5;
  if (!strncmp(text, "\xe2\x88\x92", 3)) sign = -1, text += 3;
  bool fraction = false;
  for (; n < sizeof digits - 1; text++) {
    if (!strncmp(text, "\xe2\x80\xaf", 3)) {
      text += 2;
      continue;
    }
    if (!isdigit((unsigned char)*text) && *text != '.') break;
    if (fraction) *half /= 10;
    fraction |= *text == '.';
    digits[n++] = *text;
  }
  digits[n] = 0;
  double factor = 1;
  for (int i = 0; i < 7; i++)
    if (!strncmp(text, unit[i].name, strlen(unit[i].name))) factor = unit[i].factor;
  *half *= factor;
  if (!strncmp(text, " % more", 7)) sign = -1; /* spent, where the JSON has a negative saving */
  return n ? sign * atof(digits) * factor : (double)NAN;
}

/* Every <data> and every data-key of a shape; returns how many. */
static inline int check_numbers(faults *f, const char *page, const cJSON *json)
{
  int count = 0;
  for (const char *at = page; (at = strstr(at, "data-key=\"")); at++, count++) {
    char key[128], value[64];
    int length = 0;
    if (sscanf(at, "data-key=\"%127[^\"]\" %*[a-z-]=\"%63[^\"]\"%n", key, value, &length) != 2 || length == 0) {
      fault(f, "no value: %.60s", at);
      continue;
    }
    const cJSON *item = json_at(json, key);
    if (!cJSON_IsNumber(item)) {
      if (!(cJSON_IsNull(item) && atof(value) == 0)) fault(f, "%s is not in the JSON", key);
      continue;
    }
    const double wanted = item->valuedouble;
    if (fabs(atof(value) - wanted) > 1e-12 * fabs(wanted))
      fault(f, "%s: %s on the page, %.17g in the JSON", key, value, wanted);
    double half;
    const bool text = at[length] == '>' && !strncmp(at - 6, "<data ", 6);
    if (!text) continue;
    const double shown = shown_value(at + length + 1, &half);
    if (strstr(key, "prices[")) half = 0.5; /* as in the price list: "1.95 nJ" is exact */
    if (!(fabs(shown - wanted) <= half * (1 + 1e-9)))
      fault(f, "%s: shown as %.20s, is %.17g", key, at + length + 1, wanted);
  }
  return count;
}

/* ---- pictures ---- */

/* From the element with this id to its end tag; NULL where it is not there. Free it. */
static inline char *element(const char *page, const char *tag, const char *id)
{
  char start[128], end[24];
  snprintf(start, sizeof start, "<%s id=\"%s\"", tag, id);
  snprintf(end, sizeof end, "</%s>", tag);
  const char *from = strstr(page, start), *to = from ? strstr(from, end) : NULL;
  return to ? strndup(from, (size_t)(to - from)) : NULL;
}

/* Bars of an SVG are as long as their values: `side` is "width" or "height"; a gap of one unit may be left out. */
static inline void check_bars(faults *f, const char *page, const char *svg, const char *side, int least)
{
  char *text = element(page, "svg", svg), pattern[32];
  double scale = 0;
  int count = 0;
  snprintf(pattern, sizeof pattern, " %s=\"", side);
  for (int pass = 0; pass < 2 && text; pass++) {
    double largest = 0;
    for (const char *at = text; (at = strstr(at, "<rect ")); at++) {
      const char *end = strchr(at, '>'), *key = strstr(at, "data-value=\""), *length = strstr(at, pattern);
      if (!key || key > end || !length || length > end) continue;
      const double value = fabs(atof(key + strlen("data-value=\""))), size = atof(length + strlen(pattern));
      if (pass == 0 && value > largest) largest = value, scale = size / value;
      if (pass == 1 && fabs(size - scale * value) > 1.3)
        fault(f, "%s: a bar of %g is %g long, not %g", svg, value, size, scale * value);
      count += pass;
    }
  }
  if (count < least) fault(f, "%s has %d bars of at least %d", svg, count, least);
  free(text);
}

static inline void check_element(faults *f, const char *page, const char *tag, const char *id, const char *holds,
                                 int least)
{
  char *text = element(page, tag, id);
  int count = 0;
  for (const char *at = text; at && (at = strstr(at, holds)); at++) count++;
  if (!text) fault(f, "no %s %s", tag, id);
  if (count < least) fault(f, "%s has %d of %d %s", id, count, least, holds);
  free(text);
}
#endif
