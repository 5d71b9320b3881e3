#include "base/text.h"
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

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

const char *sf_plural(uint64_t count)
{
  return count == 1 ? "" : "s";
}
