/* Names in reports, as XML, JSON and CSV have them. */
#include "energy/energy.h"
#include "base/io.h"
#include <stdlib.h>
#include <string.h>

void sf_xml_escape(FILE *out, const char *text)
{
  for (size_t n; *text; text += n ? n : 1) {
    n = sf_utf8_length(text);
    if (*text == '<')
      fputs("&lt;", out);
    else if (*text == '>')
      fputs("&gt;", out);
    else if (*text == '&')
      fputs("&amp;", out);
    else if (*text == '"')
      fputs("&quot;", out);
    else if (n == 1 && *text < ' ' && *text != '\n' && *text != '\t')
      fputc('?', out); /* other control characters do not exist in XML */
    else if (n)
      fwrite(text, 1, n, out);
    else
      fputs(sf_utf8_replacement, out);
  }
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

void sf_csv_text(FILE *out, const char *text)
{
  const bool quoted = strpbrk(text, ",\"\r\n");
  if (quoted) fputc('"', out);
  for (size_t n; *text; text += n ? n : 1) {
    n = sf_utf8_length(text);
    if (*text == '"') fputc('"', out);
    fwrite(n ? text : sf_utf8_replacement, 1, n ? n : strlen(sf_utf8_replacement), out);
  }
  if (quoted) fputc('"', out);
}
