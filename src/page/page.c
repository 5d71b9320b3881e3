/* The page, part after part, and its numbers as JSON. */
#include "page/internal.h"
#include "base/io.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>

static void add_real(cJSON *object, const char *key, double value)
{
  if (isfinite(value))
    cJSON_AddNumberToObject(object, key, value);
  else
    cJSON_AddNullToObject(object, key);
}

static cJSON *digits(uint64_t value)
{
  char text[24];
  snprintf(text, sizeof text, "%" PRIu64, value);
  return cJSON_CreateRaw(text);
}

static void add_layers(cJSON *json, const sf_page *page)
{
  cJSON *list = cJSON_AddArrayToObject(json, "layer_fj");
  for (int l = 0; l < SF_LAYERS; l++) {
    cJSON *steps = cJSON_CreateArray();
    for (int t = 0; t < page->report->net->steps; t++)
      cJSON_AddItemToArray(steps, digits(html_layer_fj(&page->report->measure.core, l, t)));
    cJSON_AddItemToArray(list, steps);
  }
}

static void add_prefixes(cJSON *json, const sf_page *page)
{
  cJSON *list = cJSON_AddArrayToObject(json, "prefix");
  for (int t = 0; t < SF_T_MAX; t++) {
    cJSON *prefix = cJSON_CreateObject();
    cJSON_AddNumberToObject(prefix, "t", t + 1);
    add_real(prefix, "psnr", page->prefix[t].psnr);
    add_real(prefix, "ssim", page->prefix[t].ssim);
    sf_json_add_u64(prefix, "energy_fj", page->prefix[t].fj);
    cJSON_AddItemToArray(list, prefix);
  }
}

static void add_rates(cJSON *json, const sf_page *page)
{
  sf_json_add_u64(json, "rate_samples", page->sampled);
  cJSON *rates = cJSON_AddObjectToObject(json, "rate_bins");
  for (int l = 0; l < SF_LAYERS; l++) {
    if (!fx_layer_fires(l)) continue;
    cJSON *steps = cJSON_AddArrayToObject(rates, fx_layer_name(l));
    for (int t = 0; t < page->report->net->steps; t++) {
      int bin[SF_PAGE_BINS];
      html_rate_bins(page, l, t, bin);
      cJSON_AddItemToArray(steps, cJSON_CreateIntArray(bin, SF_PAGE_BINS));
    }
  }
}

cJSON *sf_page_json(const sf_page *page)
{
  cJSON *report = sf_report_json(page->report), *json = cJSON_AddObjectToObject(report, "page");
  sf_json_add_text(json, "view", page->view->name);
  cJSON_AddNumberToObject(json, "width", page->view->camera.width);
  cJSON_AddNumberToObject(json, "height", page->view->camera.height);
  add_real(json, "psnr_fixed", page->prefix[page->report->net->steps - 1].psnr);
  add_real(json, "ssim_fixed", page->prefix[page->report->net->steps - 1].ssim);
  add_real(json, "psnr_float", page->psnr_float);
  add_layers(json, page);
  add_prefixes(json, page);
  add_rates(json, page);
  return report;
}

/* JSON between script tags: '<' and '&' as escapes, which is JSON still. */
static sf_status write_json(FILE *out, const sf_page *page)
{
  cJSON *json = sf_page_json(page);
  char *text = json ? cJSON_PrintUnformatted(json) : NULL;
  cJSON_Delete(json);
  if (!text) return sf_fail(SF_E_MEMORY, "no memory for the report");
  fprintf(out, "<script type=\"application/json\" id=\"audit-json\">");
  for (const char *c = text; *c; c++)
    if (*c == '<' || *c == '>' || *c == '&')
      fprintf(out, "\\u%04x", *c);
    else
      fputc(*c, out);
  fprintf(out, "</script>\n");
  free(text);
  return sf_ok();
}

static void write_lines(FILE *out, const char *const *line)
{
  for (; *line; line++) fprintf(out, "%s\n", *line);
}

static sf_status write_page(FILE *out, const sf_page *page)
{
  fprintf(out, "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n<title>Energy audit: ");
  sf_xml_escape(out, html_base_name(page->report->data));
  fprintf(out, ", view ");
  sf_xml_escape(out, page->view->name);
  fprintf(out, "</title>\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n<style>\n");
  write_lines(out, html_style);
  fprintf(out, "</style>\n</head>\n<body>\n");
  html_head(out, page);
  fprintf(out, "<main>\n");
  html_basics(out, page);
  SF_TRY(html_pictures(out, page));
  html_energy_section(out, page);
  html_spikes(out, page);
  html_ledgers(out, page);
  html_quality(out, page);
  html_counts(out, page);
  html_limits(out, page);
  html_origin(out, page);
  fprintf(out, "</main>\n");
  SF_TRY(write_json(out, page));
  fprintf(out, "<script>\n");
  write_lines(out, html_script);
  fprintf(out, "</script>\n</body>\n</html>\n");
  return sf_ok();
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
