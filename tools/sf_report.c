/* sf_report: tables, JSON and plot scripts from the runs of `make reproduce`. */
#include "report/report.h"
#include "cli/cli.h"
#include "base/io.h"
#include <string.h>

static sf_status write_table(const sf_reproduction *r)
{
  char path[4096 + 32];
  sf_writer writer;
  snprintf(path, sizeof path, "%s/table.md", r->dir);
  SF_TRY(sf_writer_open(&writer, path));
  const sf_status status = sf_reproduction_print(writer.file, r);
  if (status.code == SF_OK) return sf_writer_commit(&writer);
  sf_writer_abort(&writer);
  return status;
}

static sf_status write_json(const sf_reproduction *r)
{
  char path[4096 + 32];
  snprintf(path, sizeof path, "%s/results.json", r->dir);
  cJSON *json = sf_reproduction_json(r);
  if (!json) return sf_fail(SF_E_MEMORY, "%s: no memory", path);
  sf_status status = sf_json_save(json, path);
  cJSON_Delete(json);
  return status;
}

static sf_status report(const sf_reproduction *r, bool quiet)
{
  int plots, tables;
  if (r->count == 0) return sf_fail(SF_E_FORMAT, "%s: no folder SCENE/RUN of make reproduce", r->dir);
  SF_TRY(write_table(r));
  SF_TRY(write_json(r));
  SF_TRY(sf_reproduction_csv(r, &tables));
  SF_TRY(sf_reproduction_plots(r, &plots));
  if (!quiet) {
    SF_TRY(sf_reproduction_print(stdout, r));
    printf("wrote %s/table.md, results.json, %d files in tables/ and %d scripts in plots/\n", r->dir, tables, plots);
  }
  if (!r->problems) return sf_ok();
  return sf_fail(SF_E_FORMAT, "%.200s: %.300s%s", r->dir, r->problem[0],
                 r->problems > 1 ? " (and others, see table.md)" : "");
}

static sf_status write_page(const sf_reproduction *r, bool quiet)
{
  if (r->count == 0) return sf_fail(SF_E_FORMAT, "%s: no folder SCENE/RUN of make reproduce", r->dir);
  SF_TRY(sf_reproduction_page(r));
  if (!quiet) printf("page: %s/report.html\n", r->dir);
  return sf_ok();
}

int main(int argc, char **argv)
{
  bool quiet = false, page = false;
  const sf_option options[] = {
      {"--page", 0, SF_ARG_FLAG, &page, 0, 0, NULL, NULL, "DIR/report.html alone, with the plots that gnuplot drew"},
      {"--quiet", 'q', SF_ARG_FLAG, &quiet, 0, 0, NULL, NULL, "write the files, print nothing"},
      {0}};
  const sf_cli cli = {
      .program = "sf_report",
      .usage = "sf_report DIR [--page] [--quiet]",
      .summary = "Gathers DIR/SCENE/RUN/ of `make reproduce` into DIR/table.md (printed, too), DIR/results.json,\n"
                 "DIR/tables/*.csv and DIR/plots/*.gp, beside the values of the paper. Missing runs appear as '-'. "
                 "Exit status 1\n"
                 "when a file is unreadable or two counts of one frame differ; the report is written all the same.\n"
                 "Where there is no run nothing is written.",
      .examples = "  sf_report build/reproduce/quick\n"
                  "  sf_report build/reproduce/paper --quiet\n",
      .options = options,
      .min_positional = 1,
      .max_positional = 1};
  const char *dir = NULL;
  sf_reproduction r = {0};
  sf_status status = sf_cli_parse(&cli, argc, argv, &dir);
  if (!status.code) status = sf_reproduction_load(&r, dir);
  if (!status.code) status = page ? write_page(&r, quiet) : report(&r, quiet);
  sf_reproduction_free(&r);
  return sf_cli_finish(&cli, status);
}
