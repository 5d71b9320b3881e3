/* SVG, element by element. Colours and type are classes of the page's style sheet: light, dark and print follow it. */
#include "page/internal.h"
#include <inttypes.h>
#include <math.h>
#include <stdarg.h>

void svg_begin(FILE *out, const char *id, double width, double height, const char *title, const char *description)
{
  fprintf(out,
          "<svg id=\"%s\" viewBox=\"0 0 %g %g\" role=\"img\" aria-labelledby=\"%s-t %s-d\">\n"
          "<title id=\"%s-t\">%s</title><desc id=\"%s-d\">%s</desc>\n",
          id, width, height, id, id, id, title, id, description);
}

void svg_end(FILE *out)
{
  fprintf(out, "</svg>\n");
}

void svg_text(FILE *out, double x, double y, const char *style, const char *format, ...)
{
  char text[512];
  va_list args;
  va_start(args, format);
  vsnprintf(text, sizeof text, format, args);
  va_end(args);
  fprintf(out, "<text x=\"%.4g\" y=\"%.4g\" class=\"%s\">", x, y, style);
  sf_xml_escape(out, text);
  fprintf(out, "</text>\n");
}

void svg_line(FILE *out, double x1, double y1, double x2, double y2, const char *style)
{
  fprintf(out, "<line x1=\"%.5g\" y1=\"%.5g\" x2=\"%.5g\" y2=\"%.5g\" class=\"%s\"/>\n", x1, y1, x2, y2, style);
}

void svg_bar(FILE *out, double x, double y, double width, double height, const char *style, const char *key,
             uint64_t value, const char *tip)
{
  fprintf(out, "<rect x=\"%.6g\" y=\"%.6g\" width=\"%.6g\" height=\"%.6g\" class=\"%s\"", x, y, width, height, style);
  if (key) fprintf(out, " data-key=\"%s\" data-value=\"%" PRIu64 "\"", key, value);
  if (tip) {
    fprintf(out, "><title>");
    sf_xml_escape(out, tip);
    fprintf(out, "</title></rect>\n");
  } else {
    fprintf(out, "/>\n");
  }
}

double svg_tick(double span, int most)
{
  if (!(span > 0)) return 1;
  double step = pow(10, floor(log10(span / most)));
  while (span / step > most) {
    const double lead = step / pow(10, floor(log10(step) + 1e-9));
    step *= lead > 1.5 && lead < 3 ? 2.5 : 2;
  }
  return step;
}
