/* One file of a report: what is wrong with it is noted, and the report goes on without it. */
#include "report/internal.h"
#include "base/io.h"
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

sf_status sf_report_no_memory(const sf_reproduction *r)
{
  return sf_fail(SF_E_MEMORY, "%s: no memory for the report", r->dir);
}

sf_status sf_report_problem(sf_reproduction *r, const char *format, ...)
{
  char text[1024];
  va_list args;
  va_start(args, format);
  vsnprintf(text, sizeof text, format, args);
  va_end(args);
  const size_t n = strlen(r->dir);
  for (char *at = text; n && (at = strstr(at, r->dir)); at++) /* no path of this machine */
    if (at[n] == '/' && (at == text || at[-1] == ' ')) memmove(at, at + n + 1, strlen(at + n + 1) + 1);
  char **list = realloc(r->problem, (size_t)(r->problems + 1) * sizeof *list);
  if (!list) return sf_report_no_memory(r);
  r->problem = list;
  list[r->problems] = strdup(text);
  if (!list[r->problems]) return sf_report_no_memory(r);
  r->problems++;
  return sf_ok();
}

sf_status sf_report_read_json(sf_reproduction *r, const char *path, cJSON **json)
{
  *json = NULL;
  if (access(path, F_OK)) return sf_ok();
  sf_status status = sf_json_load(path, json);
  if (!status.code && !cJSON_IsObject(*json)) {
    cJSON_Delete(*json);
    *json = NULL;
    status = sf_fail(SF_E_FORMAT, "%s: not a JSON object", path);
  }
  if (!status.code || status.code == SF_E_MEMORY) return status;
  return sf_report_problem(r, "%s", status.message);
}
