/* Steps that COLMAP does: features of each picture, matches of pairs, the model of poses and points. */
#include "base/io.h"
#include "tools/solve/solve.h"
#include <errno.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { MODELS = 50 /* as many as COLMAP makes */, REGISTERED_SHARE = 2 /* of the pictures, one in this many */ };
static const char *const lenses[] = {"SIMPLE_RADIAL", "OPENCV"};

/* ---- features ---- */

static void show_features(sf_progress *progress, const char *text, int total)
{
  int done = 0, all = total;
  if (sscanf(text, "%d/%d", &done, &all) == 2) sf_progress_show(progress, "features: %d of %d pictures", done, all);
}

sf_status solve_features_inputs(solve_job *job, FILE *to)
{
  fprintf(to, "%s %d\n", lenses[job->options->lens], job->options->features);
  return sf_ok();
}

static sf_status features_of(solve_job *job, const char *list, int number)
{
  char log[4096], name[40], most[16], side[16];
  snprintf(name, sizeof name, "features-%d.log", number);
  SF_TRY(solve_path(log, job->state, name));
  snprintf(most, sizeof most, "%d", job->options->features);
  snprintf(side, sizeof side, "%d", SF_SOLVE_SIDE);
  /* clang-format off */
  const char *const argv[] = {"colmap", "feature_extractor",
                              "--database_path", job->database,
                              "--image_path", job->images,
                              "--image_list_path", list,
                              "--ImageReader.single_camera", "1",
                              "--ImageReader.camera_model", lenses[job->options->lens],
                              "--SiftExtraction.use_gpu", "0",
                              "--SiftExtraction.max_image_size", side,
                              "--SiftExtraction.max_num_features", most, NULL};
  /* clang-format on */
  const solve_watch watch = {"Processed file [", show_features, job->pictures.count};
  return solve_run(job, argv, log, "colmap", &watch);
}

/* Those of each list are of one camera. */
sf_status solve_features_work(solve_job *job)
{
  char path[4096], name[40];
  SF_TRY(solve_remove(job->database));
  for (int i = 0;; i++) {
    snprintf(name, sizeof name, "lists/%d.txt", i);
    SF_TRY(solve_path(path, job->state, name));
    if (access(path, R_OK)) return sf_ok();
    SF_TRY(features_of(job, path, i));
  }
}

/* ---- matches ---- */

static bool every_pair(const solve_job *job)
{
  const int matching = job->options->matching;
  return matching ? matching == 1 : job->pictures.count <= SF_SOLVE_ALL;
}

static void show_blocks(sf_progress *progress, const char *text, int total)
{
  int a = 0, all = 0, b = 0;
  (void)total;
  if (sscanf(text, " block [%d/%d, %d/", &a, &all, &b) == 3 && all > 0)
    sf_progress_show(progress, "matches: %d %% of the pairs", 100 * ((a - 1) * all + b) / (all * all));
  else if (sscanf(text, " image [%d/%d", &a, &all) == 2)
    sf_progress_show(progress, "matches: %d of %d pictures", a, all);
}

sf_status solve_matches_inputs(solve_job *job, FILE *to)
{
  fprintf(to, "%s\n", every_pair(job) ? "exhaustive" : "sequential");
  return sf_ok();
}

/* What is in the database is not matched again. It is written a block of pairs at a time: small blocks lose little when
 * they are interrupted. */
sf_status solve_matches_work(solve_job *job)
{
  char log[4096];
  const bool all = every_pair(job);
  SF_TRY(solve_path(log, job->state, "matches.log"));
  /* clang-format off */
  const char *const argv[] = {"colmap", all ? "exhaustive_matcher" : "sequential_matcher",
                              "--database_path", job->database,
                              "--SiftMatching.use_gpu", "0",
                              all ? "--ExhaustiveMatching.block_size" : "--SequentialMatching.overlap", "10", NULL};
  /* clang-format on */
  const solve_watch watch = {"Matching", show_blocks, 0};
  return solve_run(job, argv, log, "colmap", &watch);
}

/* ---- model ---- */

static void show_model(sf_progress *progress, const char *text, int total)
{
  int done = 0;
  if (sscanf(text, "%*d (%d)", &done) == 1) sf_progress_show(progress, "model: %d of %d pictures", done, total);
}

/* Pictures of a model, from the first 8 bytes of its table; -1: there is none. */
static int model_pictures(const solve_job *job, const char *folder)
{
  char path[4096], name[80];
  uint8_t count[8];
  snprintf(name, sizeof name, "%s/images.bin", folder);
  if (solve_path(path, job->options->output, name).code != SF_OK) return -1;
  FILE *file = fopen(path, "r");
  if (!file) return -1;
  const size_t n = fread(count, 1, sizeof count, file);
  fclose(file);
  return n == sizeof count ? count[0] | count[1] << 8 | count[2] << 16 : -1;
}

typedef struct solve_models {
  int count, largest, pictures; /* pictures: of the largest */
  char sizes[200];              /* "9, 7 and 5" */
} solve_models;

static solve_models list_models(const solve_job *job)
{
  solve_models m = {.count = 0, .largest = -1};
  int size[MODELS];
  for (int i = 0; i < MODELS; i++) {
    char folder[64];
    snprintf(folder, sizeof folder, ".solve/models/%d", i);
    const int n = model_pictures(job, folder);
    if (n < 0) continue;
    if (n > m.pictures) m.largest = i, m.pictures = n;
    size[m.count++] = n;
  }
  for (int i = 0; i < m.count && strlen(m.sizes) < 180; i++)
    sprintf(m.sizes + strlen(m.sizes), "%s%d", i == 0 ? "" : i == m.count - 1 ? " and " : ", ", size[i]);
  return m;
}

static sf_status no_model(const solve_job *job, const char *log)
{
  const char *input = job->options->input;
  const int connected = (int)solve_number(log, "(connected ", 0),
            pairs = (int)solve_number(log, "Loading matches... ", 0);
  if (connected * REGISTERED_SHARE < job->pictures.count)
    return sf_fail(
        SF_E_RANGE,
        "%s: no model: only %d of %d pictures show something that another one shows, too: they need texture and "
        "more overlap",
        input, connected, job->pictures.count);
  return sf_fail(
      SF_E_RANGE,
      "%s: no model: %d pairs of pictures match, but none shows the scene from two places. Either the camera "
      "stood still or only turned, or what it saw has little texture or repeats itself",
      input, pairs);
}

static sf_status run_mapper(solve_job *job, const char *models, const char *log)
{
  const char *const argv[] = {
      "colmap", "mapper", "--database_path", job->database, "--image_path", job->images, "--output_path", models, NULL};
  const solve_watch watch = {"Registering image #", show_model, job->pictures.count};
  const sf_status status = solve_run(job, argv, log, "colmap", &watch);
  return strstr(status.message, "failed to create sparse model") ? no_model(job, log) : status;
}

static sf_status check_models(const solve_job *job, const solve_models *m, const char *log)
{
  const char *input = job->options->input;
  const int all = job->pictures.count;
  if (m->largest < 0) return no_model(job, log);
  if (m->pictures * REGISTERED_SHARE >= all) return sf_ok();
  if (m->count > 1)
    return sf_fail(
        SF_E_RANGE,
        "%s: several models, of %s pictures; none has half of all %d. Take more pictures between the parts, or "
        "give one part alone",
        input, m->sizes, all);
  return sf_fail(SF_E_RANGE, "%s: only %d of %d pictures found their place: the others need more overlap with them",
                 input, m->pictures, all);
}

/* The largest model becomes sparse/0. */
static sf_status take_largest(solve_job *job, const char *models, const char *log)
{
  char name[16], from[4096], to[4096], target[4096];
  const solve_models m = list_models(job);
  SF_TRY(check_models(job, &m, log));
  if (m.count > 1 && !job->options->quiet) printf("models       of %s pictures: the largest is taken\n", m.sizes);
  snprintf(name, sizeof name, "%d", m.largest);
  SF_TRY(solve_path(from, models, name));
  SF_TRY(solve_path(to, job->options->output, "sparse"));
  SF_TRY(solve_remove(to));
  SF_TRY(sf_make_dir(to));
  SF_TRY(solve_path(target, to, "0"));
  if (rename(from, target)) return sf_fail(SF_E_IO, "cannot rename %s: %s", from, strerror(errno));
  return sf_ok();
}

sf_status solve_model_work(solve_job *job)
{
  char models[4096], log[4096], sparse[4096];
  SF_TRY(solve_path(models, job->state, "models"));
  SF_TRY(solve_path(log, job->state, "model.log"));
  SF_TRY(solve_remove(models));
  SF_TRY(sf_make_dir(models));
  SF_TRY(run_mapper(job, models, log));
  SF_TRY(take_largest(job, models, log));
  SF_TRY(solve_path(sparse, job->options->output, "sparse/0"));
  SF_TRY(solve_path(log, job->state, "analysis.log"));
  const char *const argv[] = {"colmap", "model_analyzer", "--path", sparse, NULL};
  return solve_run(job, argv, log, "colmap", NULL);
}

sf_status solve_model_read(solve_job *job, solve_result *result)
{
  char log[4096];
  SF_TRY(solve_path(log, job->state, "analysis.log"));
  result->pictures = job->pictures.count;
  result->registered = (int)solve_number(log, "Registered images: ", 0);
  result->points = (int)solve_number(log, "Points: ", 0);
  result->error = solve_number(log, "Mean reprojection error: ", 0);
  if (!result->registered) return sf_fail(SF_E_FORMAT, "%s: not what COLMAP's model_analyzer writes", log);
  return sf_ok();
}
