/* Numbers of the page: <data> elements, whose data-key says where in the JSON they are. */
#include "page/internal.h"
#include <math.h>
#include <stdarg.h>
#include <string.h>

/* ---- by path ---- */

static sf_template_value value_at(html_view *v, const char *format, va_list args)
{
  sf_template_value value = {.node = NULL};
  const int n = vsnprintf(value.path, sizeof value.path, format, args);
  if (n > 0 && n < (int)sizeof value.path) value.node = sf_json_at(v->json, value.path);
  if (!value.node && v->status.code == SF_OK) v->status = sf_fail(SF_E_FORMAT, "report: no value %s", value.path);
  return value;
}

sf_template_value html_at(html_view *v, const char *format, ...)
{
  va_list args;
  va_start(args, format);
  const sf_template_value value = value_at(v, format, args);
  va_end(args);
  return value;
}

double html_real(html_view *v, const char *format, ...)
{
  va_list args;
  va_start(args, format);
  const sf_template_value value = value_at(v, format, args);
  va_end(args);
  return sf_json_real(value.node);
}

const char *html_text(html_view *v, const char *format, ...)
{
  va_list args;
  va_start(args, format);
  const sf_template_value value = value_at(v, format, args);
  va_end(args);
  const char *text = cJSON_GetStringValue(value.node);
  return text ? text : "";
}

/* ---- functions of the template ---- */

static void data_begin(FILE *out, const sf_template_value *value)
{
  fprintf(out, "<data data-key=\"%s\" value=\"", value->path);
  html_put_exact(out, value->node);
  fprintf(out, "\">");
}

HTML_FUNCTION(put_count)
{
  char text[HTML_NUMBER];
  (void)user;
  data_begin(out, value);
  fprintf(out, "%s</data>", html_count(text, sf_json_u64(value->node)));
  return sf_ok();
}

HTML_FUNCTION(put_energy)
{
  char text[HTML_NUMBER];
  (void)user;
  data_begin(out, value);
  fprintf(out, "%s</data>", html_energy(text, sf_json_real(value->node)));
  return sf_ok();
}

/* In the unit that suits the second value: for columns of one unit. */
HTML_FUNCTION(put_energy_in)
{
  double scale;
  const char *unit = html_unit(sf_json_real(value[1].node), &scale);
  (void)user;
  data_begin(out, value);
  fprintf(out, "%.*f %s</data>", scale > 1 ? 3 : 0, sf_json_real(value->node) / scale, unit);
  return sf_ok();
}

/* "61.7 % saved", "7.1 % more" */
HTML_FUNCTION(put_saving)
{
  const double saving = sf_json_real(value->node);
  (void)user;
  if (!isfinite(saving)) {
    fprintf(out, "no saving is defined");
    return sf_ok();
  }
  fprintf(out, "<b class=\"%s\">", saving < 0 ? "bad" : "good");
  data_begin(out, value);
  fprintf(out, "%.1f %% %s</data></b>", fabs(saving), saving < 0 ? "more" : "saved");
  return sf_ok();
}

static sf_status put_real(FILE *out, const sf_template_value *value, int decimals)
{
  const double real = sf_json_real(value->node);
  if (!isfinite(real)) {
    fprintf(out, "-");
    return sf_ok();
  }
  data_begin(out, value);
  fprintf(out, "%s%.*f</data>", real < 0 ? "\xe2\x88\x92" : "", decimals, fabs(real));
  return sf_ok();
}

HTML_FUNCTION(put_real2)
{
  (void)user;
  return put_real(out, value, 2);
}

HTML_FUNCTION(put_real4)
{
  (void)user;
  return put_real(out, value, 4);
}

/* What the JSON has in words too: "1.95 nJ". */
HTML_FUNCTION(put_as_text)
{
  (void)user;
  data_begin(out, value);
  sf_xml_escape(out, cJSON_GetStringValue(value[1].node));
  fprintf(out, "</data>");
  return sf_ok();
}

/* ---- in running text ---- */

HTML_FUNCTION(put_energy_text)
{
  char text[HTML_NUMBER];
  (void)user;
  fputs(html_energy(text, sf_json_real(value->node)), out);
  return sf_ok();
}

HTML_FUNCTION(put_group)
{
  char text[HTML_NUMBER];
  (void)user;
  fputs(html_count(text, sf_json_u64(value->node)), out);
  return sf_ok();
}

HTML_FUNCTION(put_price)
{
  (void)user;
  fprintf(out, "%g pJ", sf_json_real(value->node) / 1000);
  return sf_ok();
}

HTML_FUNCTION(put_tenths)
{
  char text[HTML_NUMBER];
  (void)user;
  fputs(html_tenths(text, sf_json_real(value->node)), out);
  return sf_ok();
}

HTML_FUNCTION(put_percent) /* of a rate */
{
  (void)user;
  fprintf(out, "%.2f %%", 100 * sf_json_real(value->node));
  return sf_ok();
}

/* The last part of a path of files. */
HTML_FUNCTION(put_base)
{
  const char *path = cJSON_GetStringValue(value->node), *slash = path ? strrchr(path, '/') : NULL;
  (void)user;
  sf_xml_escape(out, slash && slash[1] ? slash + 1 : path ? path : "");
  return sf_ok();
}
