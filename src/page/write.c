/* Numbers and pictures as text. */
#include "page/internal.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define NARROW "\xe2\x80\xaf" /* U+202F, a space that does not break and does not tear digits apart */

const char *html_count(char text[HTML_NUMBER], uint64_t value)
{
  char digits[24];
  const int n = snprintf(digits, sizeof digits, "%" PRIu64, value);
  size_t used = 0;
  for (int i = 0; i < n; i++) {
    if (i > 0 && (n - i) % 3 == 0) memcpy(text + used, NARROW, 3), used += 3;
    text[used++] = digits[i];
  }
  text[used] = 0;
  return text;
}

/* Four significant digits, plain. */
static const char *digits4(double value)
{
  const double size = fabs(value);
  return size >= 999.95 ? "%.0f" : size >= 99.995 ? "%.1f" : size >= 9.9995 ? "%.2f" : "%.3f";
}

const char *html_energy(char text[HTML_NUMBER], double fj)
{
  double scale;
  const char *unit = html_unit(fabs(fj), &scale);
  char format[16];
  snprintf(format, sizeof format, "%s %%s", digits4(fj / scale));
  snprintf(text, HTML_NUMBER, format, fj / scale, unit);
  return text;
}

const char *html_percent(char text[HTML_NUMBER], double percent)
{
  if (!isfinite(percent))
    snprintf(text, HTML_NUMBER, "-");
  else
    snprintf(text, HTML_NUMBER, "%s%.1f %%", percent <= -0.05 ? "\xe2\x88\x92" : "", fabs(percent));
  return text;
}

const char *html_tenths(char text[HTML_NUMBER], double value)
{
  snprintf(text, HTML_NUMBER, "%s%.1f", value <= -0.05 ? "\xe2\x88\x92" : "", fabs(value));
  return text;
}

const char *html_unit(double top_fj, double *scale)
{
  static const char *const unit[] = {"fJ", "pJ", "nJ", "\xc2\xb5J", "mJ", "J", "kJ"};
  int i = 0;
  for (*scale = 1; i < 6 && top_fj / *scale >= 999.95; i++) *scale *= 1000;
  return unit[i];
}

void html_put_exact(FILE *out, const cJSON *node)
{
  const double real = sf_json_real(node);
  if (cJSON_IsRaw(node))
    fputs(node->valuestring, out);
  else
    fprintf(out, "%.17g", isfinite(real) ? real : 0);
}

void html_base64(FILE *out, const uint8_t *data, size_t size)
{
  static const char letter[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  for (size_t i = 0; i < size; i += 3) {
    const size_t left = size - i;
    const uint32_t three =
        (uint32_t)data[i] << 16 | (left > 1 ? (uint32_t)data[i + 1] << 8 : 0) | (left > 2 ? (uint32_t)data[i + 2] : 0);
    fputc(letter[three >> 18], out), fputc(letter[three >> 12 & 63], out);
    fputc(left > 1 ? letter[three >> 6 & 63] : '=', out), fputc(left > 2 ? letter[three & 63] : '=', out);
  }
}

sf_status html_put_png(FILE *out, const uint8_t *pixel, int width, int height, const uint8_t *palette, int colours,
                       const char *alt)
{
  void *data;
  size_t size;
  SF_TRY(sf_png_encode(pixel, width, height, palette, colours, &data, &size));
  fprintf(out, "<img width=\"%d\" height=\"%d\"%s alt=\"", width, height, width <= 320 ? " class=\"coarse\"" : "");
  sf_xml_escape(out, alt);
  fprintf(out, "\" src=\"data:image/png;base64,");
  html_base64(out, data, size);
  fprintf(out, "\"/>\n");
  free(data);
  return sf_ok();
}
