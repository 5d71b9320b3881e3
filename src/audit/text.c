/* Names of files and views in reports: any bytes come in, UTF-8 goes out. */
#include "spikefield/audit.h"
#include <stdlib.h>
#include <string.h>

static const char replacement[] = "\xef\xbf\xbd"; /* U+FFFD */

/* Bytes of the character that begins here; 0 where there is none that is well-formed and allowed in XML. */
static size_t character(const char *text)
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

void sf_xml_escape(FILE *out, const char *text)
{
  for (size_t n; *text; text += n ? n : 1) {
    n = character(text);
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
      fputs(replacement, out);
  }
}

void sf_json_add_text(cJSON *object, const char *key, const char *text)
{
  char *whole = malloc(strlen(text) * strlen(replacement) + 1), *to = whole;
  if (!whole) return;
  for (size_t n; *text; text += n ? n : 1) {
    n = character(text);
    memcpy(to, n ? text : replacement, n ? n : strlen(replacement));
    to += n ? n : strlen(replacement);
  }
  *to = 0;
  cJSON_AddStringToObject(object, key, whole);
  free(whole);
}

void sf_csv_text(FILE *out, const char *text)
{
  if (!strpbrk(text, ",\"\r\n")) {
    fputs(text, out);
    return;
  }
  fputc('"', out);
  for (; *text; text++) {
    if (*text == '"') fputc('"', out);
    fputc(*text, out);
  }
  fputc('"', out);
}
