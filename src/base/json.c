#include "base/io.h"
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

static sf_status parse(const char *path, const char *text, size_t size, cJSON **json)
{
  const char *zero = memchr(text, 0, size), *end = text + size, *at = NULL;
  if (zero) return fail_at(path, text, zero, "malformed JSON: a NUL byte");
  size_t blank = strspn(text, " \t\r\n");
  if (blank == size) return fail_at(path, text, end, "malformed JSON: the file is empty");
  *json = cJSON_ParseWithLengthOpts(text, size + 1, &at, 0);
  if (!at || at < text || at > end) at = end;
  if (!*json) return fail_at(path, text, at, at == end ? "malformed JSON: the file ends early" : "malformed JSON");
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

size_t sf_utf8_length(const char *text)
{
  const unsigned char *c = (const unsigned char *)text;
  if (c[0] < 0x80) return 1;
  const size_t n = c[0] >= 0xf0 ? 4 : c[0] >= 0xe0 ? 3 : 2;
  uint32_t code = c[0] & (0x7fu >> n);
  for (size_t i = 1; i < n; i++) {
    if ((c[i] & 0xc0) != 0x80) return 0;
    code = code << 6 | (c[i] & 0x3fu);
  }
  static const uint32_t least[] = {0, 0, 0x80, 0x800, 0x10000};
  const bool surrogate = code >= 0xd800 && code < 0xe000, none = code == 0xfffe || code == 0xffff;
  return c[0] < 0xc0 || c[0] > 0xf4 || code < least[n] || code > 0x10ffff || surrogate || none ? 0 : n;
}

const char sf_utf8_replacement[] = "\xef\xbf\xbd";

void sf_utf8_write(FILE *out, const char *text)
{
  for (size_t n; *text; text += n ? n : 1) {
    n = sf_utf8_length(text);
    fwrite(n ? text : sf_utf8_replacement, 1, n ? n : strlen(sf_utf8_replacement), out);
  }
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
