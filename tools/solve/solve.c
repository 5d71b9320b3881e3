/* The steps, and what was done of them before. */
#include "tools/solve/solve.h"
#include "base/io.h"
#include "base/sha256.h"
#include <dirent.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct solve_step {
  const char *name;
  sf_status (*inputs)(solve_job *job, FILE *to); /* NULL: none but the step before */
  sf_status (*work)(solve_job *job);
} solve_step;

static const solve_step steps[] = {{"pictures", solve_pictures_inputs, solve_pictures_work},
                                   {"features", solve_features_inputs, solve_features_work},
                                   {"matches", solve_matches_inputs, solve_matches_work},
                                   {"model", NULL, solve_model_work}};
enum { STEPS = sizeof steps / sizeof *steps };

/* Hash of a step's name, inputs, and the stamp of the step before, which it replaces. */
static sf_status make_stamp(solve_job *job, const solve_step *step, char stamp[65])
{
  char *text = NULL;
  size_t size = 0;
  FILE *to = open_memstream(&text, &size);
  if (!to) return sf_fail(SF_E_MEMORY, "no memory for the inputs of %s", step->name);
  fprintf(to, "%s\n%s\n", stamp, step->name);
  const sf_status status = step->inputs ? step->inputs(job, to) : sf_ok();
  if (fclose(to)) return sf_fail(SF_E_MEMORY, "no memory for the inputs of %s", step->name);
  if (status.code == SF_OK) sf_sha256(text, size, stamp);
  free(text);
  return status;
}

static bool is_done(const char *path, const char stamp[65])
{
  char *text = NULL;
  size_t size;
  const bool done = sf_read_file(path, 4096, &text, &size).code == SF_OK && !strcmp(text, stamp);
  free(text);
  return done;
}

/* What later steps made is of no use once this one is done anew. */
static sf_status forget(solve_job *job, int from)
{
  char path[4096];
  for (int i = from; i < STEPS; i++) {
    SF_TRY(solve_path(path, job->state, steps[i].name));
    if (unlink(path) && errno != ENOENT) return sf_fail(SF_E_IO, "cannot remove %s: %s", path, strerror(errno));
  }
  return sf_ok();
}

static sf_status do_step(solve_job *job, int i, char stamp[65])
{
  char path[4096];
  SF_TRY(make_stamp(job, &steps[i], stamp));
  SF_TRY(solve_path(path, job->state, steps[i].name));
  if (is_done(path, stamp)) return sf_ok();
  SF_TRY(forget(job, i));
  sf_progress_begin(&job->progress, job->options->quiet);
  const sf_status status = steps[i].work(job);
  sf_progress_end(&job->progress);
  SF_TRY(status);
  return sf_write_file(path, stamp, 64);
}

/* Old pictures are removed where new ones come: only from a folder that this program made. */
static sf_status check_output(const solve_job *job)
{
  const char *output = job->options->output;
  char *inside = realpath(job->options->input, NULL), *outside = realpath(output, NULL);
  const size_t n = outside ? strlen(outside) : 0;
  const bool within = inside && outside && !strncmp(inside, outside, n) && (inside[n] == '/' || !inside[n]);
  free(inside), free(outside);
  if (within) return sf_fail(SF_E_USAGE, "-o %s: the photographs lie in it: give another folder", output);
  if (!access(job->state, F_OK)) return sf_ok();
  int entries = 0;
  DIR *dir = opendir(output);
  while (dir && readdir(dir)) entries++;
  if (dir) closedir(dir);
  if (entries > 2)
    return sf_fail(SF_E_USAGE, "-o %s: neither empty nor made by --solve before: give another folder", output);
  return sf_ok();
}

static sf_status run_steps(solve_job *job)
{
  char stamp[65] = "spikefield-solve-1";
  for (int i = 0; i < STEPS; i++) {
    SF_TRY(do_step(job, i, stamp));
    if (i == 0) SF_TRY(solve_list(&job->pictures, job->images, NULL, 0));
  }
  return sf_ok();
}

sf_status solve(const solve_options *options, solve_result *result)
{
  solve_job job = {.options = options};
  SF_TRY(sf_readable(options->input));
  SF_TRY(solve_path(job.images, options->output, "images"));
  SF_TRY(solve_path(job.state, options->output, ".solve"));
  SF_TRY(solve_path(job.database, job.state, "colmap.db"));
  SF_TRY(check_output(&job));
  SF_TRY(sf_make_dir(job.state));
  sf_status status = run_steps(&job);
  if (status.code == SF_OK) status = solve_model_read(&job, result);
  free(job.pictures.at);
  if (status.code == SF_E_STOPPED)
    return sf_fail(SF_E_STOPPED, "interrupted; the same command goes on with what is not done yet");
  return status;
}
