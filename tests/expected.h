/* Whole texts that the product has to write, kept in tests/expected. A changed figure, word or column is a difference.
 * After a wanted change, CK_EXPECTED=write writes them anew, and `git diff` shows what became of them. */
#ifndef SF_TESTS_EXPECTED_H
#define SF_TESTS_EXPECTED_H
#include "folder_fixture.h"
#include <cjson/cJSON.h>
#include <math.h>

/* The first line that differs, in both texts. */
static inline void ck_same_lines(const char *name, const char *text, const char *wanted)
{
  for (int line = 1; *text || *wanted; line++) {
    const int a = (int)strcspn(text, "\n"), b = (int)strcspn(wanted, "\n");
    ck_assert_msg(a == b && !memcmp(text, wanted, (size_t)a), "%s:%d: '%.*s' expected, not '%.*s'", name, line, b,
                  wanted, a, text);
    text += a, wanted += b;
    ck_assert_msg(*text == *wanted, "%s:%d: %s", name, line, *text ? "more lines than expected" : "a line is missing");
    if (*text) text++, wanted++;
  }
}

/* A word that differs, unless both are numbers that do so by less than `share` of the larger one. */
static inline void ck_same_words(const char *name, const char *text, const char *wanted, double share)
{
  static const char blanks[] = " \n";
  for (int word = 1; text += strspn(text, blanks), wanted += strspn(wanted, blanks), *text || *wanted; word++) {
    const int a = (int)strcspn(text, blanks), b = (int)strcspn(wanted, blanks);
    char *end[2];
    const double x = strtod(text, &end[0]), y = strtod(wanted, &end[1]);
    const bool numbers = a && b && end[0] == text + a && end[1] == wanted + b && isfinite(x) && isfinite(y);
    ck_assert_msg(numbers ? fabs(x - y) <= share * fmax(fabs(x), fabs(y)) : a == b && !memcmp(text, wanted, (size_t)a),
                  "%s: word %d: '%.*s' expected, not '%.*s', before '%.60s'", name, word, b, wanted, a, text,
                  wanted + b);
    text += a, wanted += b;
  }
}

/* share: 0, or what numbers may differ by. */
static inline void ck_expected_about(const char *name, const char *text, double share)
{
  char path[200];
  size_t size;
  snprintf(path, sizeof path, "tests/expected/%s", name);
  if (getenv("CK_EXPECTED")) put_file(path, text, strlen(text));
  char *wanted = read_whole(path, &size);
  if (share > 0)
    ck_same_words(path, text, wanted, share);
  else
    ck_same_lines(path, text, wanted);
  free(wanted);
}

static inline void ck_expected(const char *name, const char *text)
{
  ck_expected_about(name, text, 0);
}

/* A line for each value that is `depth` objects or lists deep. */
static inline void flatten(FILE *out, const cJSON *json, const char *at, int depth)
{
  int i = 0;
  const cJSON *item;
  if (depth > 0 && json->child) {
    cJSON_ArrayForEach(item, json)
    {
      char inner[200];
      const int n = item->string ? snprintf(inner, sizeof inner, "%s.%s", at, item->string)
                                 : snprintf(inner, sizeof inner, "%s[%d]", at, i++);
      ck_assert_int_lt(n, sizeof inner);
      flatten(out, item, inner, depth - 1);
    }
    return;
  }
  char *text = cJSON_PrintUnformatted(json);
  fprintf(out, "%s %s\n", at, text);
  free(text);
}

/* The JSON as one text with a line for each value; deleted. */
static inline void ck_expected_json(const char *name, cJSON *json, int depth)
{
  char *text = NULL;
  size_t size;
  FILE *out = open_memstream(&text, &size);
  flatten(out, json, "json", depth);
  fclose(out);
  ck_expected(name, text);
  free(text);
  cJSON_Delete(json);
}

/* What a function writes. */
#define ck_expected_text(name, out, call) ck_expected_text_about(name, out, call, 0)
#define ck_expected_text_about(name, out, call, share)                                                                 \
  do {                                                                                                                 \
    char *text_ = NULL;                                                                                                \
    size_t size_;                                                                                                      \
    FILE *out = open_memstream(&text_, &size_);                                                                        \
    call;                                                                                                              \
    fclose(out);                                                                                                       \
    ck_expected_about(name, text_, share);                                                                             \
    free(text_);                                                                                                       \
  } while (0)
#endif
