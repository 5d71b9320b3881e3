/* sf_quality: the table of `make quality`. */
#include "report/quality.h"
#include "cli/cli.h"
#include "base/json.h"
#include <stdio.h>

static sf_status report(const sf_quality *q, const char *dir, const char *before, bool as_json)
{
  char path[4096 + 32];
  cJSON *old = NULL, *json = sf_quality_json(q);
  if (!json) return sf_fail(SF_E_MEMORY, "%s: no memory", dir);
  snprintf(path, sizeof path, "%s/quality.json", dir);
  sf_status status = sf_json_save(json, path);
  if (!status.code && before) status = sf_json_load(before, &old);
  if (!status.code && !as_json) sf_quality_print(stdout, q, old);
  cJSON_Delete(old);
  if (!status.code && as_json) return sf_json_print(json, false);
  cJSON_Delete(json);
  return status;
}

int main(int argc, char **argv)
{
  bool as_json = false;
  const char *before = NULL, *dir = NULL;
  const sf_option options[] = {{"--against", 'a', SF_ARG_INPUT, &before, 0, 0, NULL, "FILE",
                                "quality.json of an earlier measurement, in brackets"},
                               {"--json", 0, SF_ARG_FLAG, &as_json, 0, 0, NULL, NULL, "print the numbers as JSON"},
                               {0}};
  const sf_cli cli = {
      .program = "sf_quality",
      .usage = "sf_quality DIR [options]",
      .summary = "Gathers DIR/SCENE/{snn,ann}-SEED/ of `make quality` into one table, and into DIR/quality.json.\n"
                 "A value is the mean over the seeds +- half of their range. `cells lost`: of the occupied\n"
                 "cells that the twins of all seeds have, the share that is empty in the spiking model.",
      .examples = "  sf_quality build/quality\n"
                  "  sf_quality build/quality --against build/quality/kept.json\n",
      .options = options,
      .min_positional = 1,
      .max_positional = 1};
  sf_quality q = {0};
  sf_status status = sf_cli_parse(&cli, argc, argv, &dir);
  if (!status.code) status = sf_quality_load(&q, dir);
  if (!status.code) status = report(&q, dir, before, as_json);
  sf_quality_free(&q);
  return sf_cli_finish(&cli, status);
}
