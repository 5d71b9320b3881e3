/* Whether the runs of a report were made with one set of parameters. */
#include "report/internal.h"
#include <string.h>

/* Its own options are last in a run's command; reproduce.sh begins them with one of these. */
static size_t common_length(const char *command)
{
  const char *end = NULL;
  for (const char *at = command; (at = strchr(at, ' ')); at++)
    if (!strncmp(at, " --beta ", 8) || !strncmp(at, " --net ", 7)) end = at;
  return end ? (size_t)(end - command) : strlen(command);
}

static bool same_training(const sf_run *a, const sf_run *b)
{
  const size_t n = common_length(a->train_command);
  return n == common_length(b->train_command) && !strncmp(a->train_command, b->train_command, n);
}

/* Other scenes may have other views. */
static bool same_evaluation(const sf_run *a, const sf_run *b, bool same_scene)
{
  const char *x = a->eval_command, *y = b->eval_command;
  if (!x || !y) return true;
  const char *p = strstr(x, ", --"), *q = strstr(y, ", --");
  return same_scene || !p || !q ? !strcmp(x, y) : !strcmp(p, q);
}

/* The run whose parameters the others are held against. */
typedef struct first_run {
  const sf_run *run;
  int scene, id;
} first_run;

static sf_status compare(sf_reproduction *r, first_run *first, int scene, const sf_run *run, int id, bool *differ)
{
  if (!run->train_command) return sf_ok();
  if (!first->run) *first = (first_run){run, scene, id};
  const bool trained = same_training(first->run, run);
  if (trained && same_evaluation(first->run, run, scene == first->scene)) return sf_ok();
  *differ = true;
  return sf_report_problem(r, "runs of different parameters: %s, %s: '%s'; %s, %s: '%s'", r->scene[first->scene].name,
                           sf_run_kinds[first->id].name, trained ? first->run->eval_command : first->run->train_command,
                           r->scene[scene].name, sf_run_kinds[id].name,
                           trained ? run->eval_command : run->train_command);
}

/* Scenes of any kind have rows of their own, each with its minutes. */
sf_status sf_report_compare_parameters(sf_reproduction *r)
{
  first_run first = {0};
  bool differ = false;
  for (int s = 0; s < r->count && !differ; s++) {
    if (sf_report_is_pairs(r)) first.run = NULL;
    for (int k = 0; k < r->scene[s].seeds; k++)
      for (int i = 0; i < SF_RUNS && !differ; i++) SF_TRY(compare(r, &first, s, &r->scene[s].of[k].run[i], i, &differ));
  }
  return sf_ok();
}
