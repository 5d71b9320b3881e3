/* The page: its template filled with its JSON. */
#include "page/internal.h"
#include "base/io.h"
#include <stdlib.h>

static HTML_FUNCTION(put_style)
{
  (void)value, (void)user;
  fputs(html_style, out);
  return sf_ok();
}

static HTML_FUNCTION(put_script)
{
  (void)value, (void)user;
  fputs(html_script, out);
  return sf_ok();
}

/* JSON between script tags: '<' and '&' as escapes, which is JSON still. */
static HTML_FUNCTION(put_json)
{
  char *text = cJSON_PrintUnformatted(((const html_view *)user)->json);
  (void)value;
  if (!text) return sf_fail(SF_E_MEMORY, "no memory for the report");
  for (const char *c = text; *c; c++)
    if (*c == '<' || *c == '>' || *c == '&')
      fprintf(out, "\\u%04x", *c);
    else
      fputc(*c, out);
  free(text);
  return sf_ok();
}

static const sf_template_call functions[] = {{"style", 0, html_put_style},
                                             {"script", 0, html_put_script},
                                             {"json", 0, html_put_json},
                                             {"count", 1, html_put_count},
                                             {"energy", 1, html_put_energy},
                                             {"energy_in", 2, html_put_energy_in},
                                             {"energy_text", 1, html_put_energy_text},
                                             {"saving", 1, html_put_saving},
                                             {"real2", 1, html_put_real2},
                                             {"real4", 1, html_put_real4},
                                             {"group", 1, html_put_group},
                                             {"price", 1, html_put_price},
                                             {"tenths", 1, html_put_tenths},
                                             {"percent", 1, html_put_percent},
                                             {"base", 1, html_put_base},
                                             {"as_text", 2, html_put_as_text},
                                             {"golden_picture", 0, html_golden_picture},
                                             {"energy_map", 0, html_energy_map},
                                             {"energy_scale", 0, html_energy_scale},
                                             {"samples_map", 0, html_samples_map},
                                             {"samples_scale", 0, html_samples_scale},
                                             {"steps_map", 0, html_steps_map},
                                             {"steps_scale", 0, html_steps_scale},
                                             {"by_step", 0, html_by_step},
                                             {"by_layer", 0, html_by_layer},
                                             {"raster", 0, html_raster},
                                             {"rates", 0, html_rates},
                                             {"ledger_savings", 0, html_ledger_savings},
                                             {"reading_savings", 0, html_reading_savings},
                                             {"ledger_bars", 2, html_ledger_bars},
                                             {"tornado", 1, html_tornado},
                                             {"break_even", 0, html_break_even},
                                             {"quality", 0, html_quality},
                                             {NULL, 0, NULL}};

static sf_status write_page(FILE *out, const sf_page *page)
{
  static const struct {
    const char *name, *text;
  } part[] = {{"report.html", html_report},
              {"report_prices.html", html_report_prices},
              {"report_proof.html", html_report_proof}};
  html_view view = {.page = page, .json = sf_page_json(page), .status = sf_ok()};
  sf_status status = view.json ? sf_ok() : sf_fail(SF_E_MEMORY, "no memory for the report");
  for (size_t i = 0; i < sizeof part / sizeof *part && status.code == SF_OK; i++) {
    const sf_template template = {part[i].name, part[i].text, view.json, functions, &view};
    status = sf_template_fill(out, &template);
  }
  cJSON_Delete((cJSON *)view.json);
  return status;
}

sf_status sf_page_save(const sf_page *page, const char *path)
{
  sf_writer writer;
  SF_TRY(sf_writer_open(&writer, path));
  const sf_status status = write_page(writer.file, page);
  if (status.code == SF_OK) return sf_writer_commit(&writer);
  sf_writer_abort(&writer);
  return status;
}
