/* sf_pareto: tables, CSV and plot scripts from the points of `make pareto`. */
#include "cli/cli.h"
#include "base/io.h"
#include "sweep/sweep.h"

static sf_status write_file(const sf_sweep *sweep, const char *name, void (*write)(FILE *out, const sf_sweep *sweep))
{
  char path[sizeof sweep->dir + 32];
  sf_writer writer;
  snprintf(path, sizeof path, "%s/%s", sweep->dir, name);
  SF_TRY(sf_writer_open(&writer, path));
  write(writer.file, sweep);
  return sf_writer_commit(&writer);
}

static sf_status report(const sf_sweep *sweep, bool quiet)
{
  int plots;
  SF_TRY(write_file(sweep, "table.md", sf_sweep_print));
  SF_TRY(write_file(sweep, "points.csv", sf_sweep_csv));
  SF_TRY(sf_sweep_plots(sweep, &plots));
  if (quiet) return sf_ok();
  sf_sweep_print(stdout, sweep);
  printf("\nwrote %s/table.md, points.csv and %d scripts in plots/\n", sweep->dir, plots);
  return sf_ok();
}

int main(int argc, char **argv)
{
  bool quiet = false;
  const sf_option options[] = {
      {"--quiet", 'q', SF_ARG_FLAG, &quiet, 0, 0, NULL, NULL, "write the files, print nothing"}, {0}};
  const sf_cli cli = {
      .program = "sf_pareto",
      .usage = "sf_pareto DIR [--quiet]",
      .summary = "Gathers DIR/points/*.json of `make pareto` (written by sf_point) into DIR/table.md (printed, too),\n"
                 "DIR/points.csv and DIR/plots/*.gp; names the points that no other beats.",
      .examples = "  sf_pareto build/pareto/quick\n",
      .options = options,
      .min_positional = 1,
      .max_positional = 1};
  const char *dir = NULL;
  sf_sweep sweep = {0};
  sf_status status = sf_cli_parse(&cli, argc, argv, &dir);
  if (status.code == SF_OK) status = sf_sweep_load(&sweep, dir);
  if (status.code == SF_OK) {
    sf_sweep_mark(&sweep);
    status = report(&sweep, quiet);
  }
  sf_sweep_free(&sweep);
  return sf_cli_finish(&cli, status);
}
