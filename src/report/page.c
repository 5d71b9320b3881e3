/* The report as one page: its template filled with tables, pictures and plots. */
#include "report/internal.h"
#include "base/io.h"
#include "page/internal.h"
#include <stdlib.h>
#include <unistd.h>

enum { PLOT_LIMIT = 64 << 20 };

/* ---- functions of the template; user is the reproduction ---- */

static HTML_FUNCTION(put_style)
{
  (void)value, (void)user;
  fputs(html_style, out);
  return sf_ok();
}

static HTML_FUNCTION(picture)
{
  return sf_report_put_picture(out, user, value->node);
}

static HTML_FUNCTION(crop)
{
  return sf_report_put_crop(out, user, value->node);
}

static HTML_FUNCTION(error)
{
  return sf_report_put_error(out, user, value->node);
}

/* What gnuplot drew, as a picture: its texts and styles stay apart from the page's. */
static HTML_FUNCTION(plot)
{
  const sf_reproduction *r = user;
  char path[4096 + 320], *data;
  size_t size;
  const char *name = cJSON_GetStringValue(value->node);
  snprintf(path, sizeof path, "%s/plots/%s.svg", r->dir, name ? name : "");
  SF_TRY(sf_read_file(path, PLOT_LIMIT, &data, &size));
  fprintf(out, "<img alt=\"");
  sf_xml_escape(out, name ? name : "");
  fprintf(out, "\" src=\"data:image/svg+xml;base64,");
  html_base64(out, (const uint8_t *)data, size);
  fprintf(out, "\"/>");
  free(data);
  return sf_ok();
}

static const sf_template_call functions[] = {{"style", 0, html_put_style}, {"picture", 1, html_picture},
                                             {"crop", 1, html_crop},       {"error", 1, html_error},
                                             {"plot", 1, html_plot},       {NULL, 0, NULL}};

/* ---- what it is filled with ---- */

static cJSON *plots_json(const sf_reproduction *r)
{
  char name[300], file[300], path[4096 + 320];
  cJSON *list = cJSON_CreateArray();
  for (int scene = sf_scenes_of(SF_GROUPS - 1); scene < r->count; scene++)
    for (int i = 0; sf_report_plot(r, scene, i, name); i++) {
      sf_plot_quote(file, sizeof file, name); /* as gnuplot's script names it */
      snprintf(path, sizeof path, "%s/plots/%s.svg", r->dir, file);
      if (*name && access(path, R_OK) == 0) cJSON_AddItemToArray(list, cJSON_CreateString(file));
    }
  return list;
}

static cJSON *page_json(const sf_reproduction *r)
{
  cJSON *results = sf_reproduction_json(r), *json = cJSON_CreateObject(), *pictures = sf_report_pictures(r);
  if (results && json && pictures) {
    static const char *const kept[] = {"profile", "tables", "problems"};
    for (int i = 0; i < 3; i++)
      cJSON_AddItemToObject(json, kept[i], cJSON_DetachItemFromObjectCaseSensitive(results, kept[i]));
    cJSON_AddItemToObject(json, "scenes", pictures);
    cJSON_AddItemToObject(json, "plots", plots_json(r));
    cJSON_Delete(results);
    return json;
  }
  cJSON_Delete(results), cJSON_Delete(json), cJSON_Delete(pictures);
  return NULL;
}

sf_status sf_reproduction_page(const sf_reproduction *r)
{
  char path[4096 + 32];
  sf_writer writer;
  cJSON *json = page_json(r);
  if (!json) return sf_report_no_memory(r);
  snprintf(path, sizeof path, "%s/report.html", r->dir);
  sf_status status = sf_writer_open(&writer, path);
  if (status.code == SF_OK) {
    const sf_template page = {"reproduction.html", sf_report_page_text, json, functions, (void *)r};
    status = sf_template_fill(writer.file, &page);
    if (status.code == SF_OK)
      status = sf_writer_commit(&writer);
    else
      sf_writer_abort(&writer);
  }
  cJSON_Delete(json);
  return status;
}
