/* SVG, element by element. Colours and type are classes of the page's style sheet: light, dark and print follow it. */
#include "page/internal.h"
#include <math.h>
#include <stdarg.h>

void svg_begin(FILE *out, const char *id, double width, double height, const char *title, const char *description)
{
  fprintf(out, "<svg id=\"%s\" viewBox=\"0 0 %g %g\" role=\"img\" aria-labelledby=\"%s-t %s-d\">\n<title id=\"%s-t\">",
          id, width, height, id, id, id);
  sf_xml_escape(out, title);
  fprintf(out, "</title><desc id=\"%s-d\">", id);
  sf_xml_escape(out, description);
  fprintf(out, "</desc>\n");
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

void svg_bar(FILE *out, double x, double y, double width, double height, const char *style,
             const sf_template_value *value, const char *tip)
{
  fprintf(out, "<rect x=\"%.6g\" y=\"%.6g\" width=\"%.6g\" height=\"%.6g\" class=\"%s\"", x, y, width, height, style);
  fprintf(out, " data-key=\"%s\" data-value=\"", value->path);
  html_put_exact(out, value->node);
  fprintf(out, "\"><title>");
  sf_xml_escape(out, tip);
  fprintf(out, "</title></rect>\n");
}

void svg_percents(FILE *out, double x0, double x1, double width, double y)
{
  for (int i = 0; i <= 4; i++) {
    const double x = i == 0 ? 0 : i == 4 ? width : x0 + (x1 - x0) * i / 4.0;
    svg_text(out, x, y, i == 0 ? "num mut" : i == 4 ? "num mut end" : "num mut mid", "%d %%", 25 * i);
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
