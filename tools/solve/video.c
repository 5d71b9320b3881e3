/* A video to its sharpest frames. */
#include "base/io.h"
#include "tools/solve/solve.h"
#include <stdlib.h>
#include <string.h>

enum { TRIES = 4 }; /* frames of an interval that are looked at */

static sf_status count_frames(solve_job *job, long *frames)
{
  char log[4096], line[64];
  char *text = NULL;
  size_t size;
  const char *video = job->options->input;
  SF_TRY(solve_path(log, job->state, "ffprobe.log"));
  const char *const argv[] = {"ffprobe",       "-v",
                              "error",         "-select_streams",
                              "v:0",           "-count_packets",
                              "-show_entries", "stream=nb_read_packets",
                              "-of",           "csv=p=0",
                              video,           NULL};
  sf_status status = solve_run(job, argv, log, "ffmpeg", NULL);
  if (status.code == SF_E_STOPPED || (status.code != SF_OK && strstr(status.message, "not installed"))) return status;
  *frames = 0;
  if (sf_read_file(log, 1 << 20, &text, &size).code == SF_OK)
    snprintf(line, sizeof line, "%s", text), *frames = atol(line);
  free(text);
  if (status.code != SF_OK || *frames < 1)
    return sf_fail(SF_E_FORMAT, "%s: neither a folder of pictures nor a video that ffmpeg can read", video);
  return sf_ok();
}

static void show_frames(sf_progress *progress, const char *text, int total)
{
  sf_progress_show(progress, "pictures: frame %d of %d", atoi(text), total);
}

/* TRIES frames of each interval, evenly. */
static sf_status take_frames(solve_job *job, const char *folder, long frames)
{
  char log[4096], select[80], pattern[4096];
  const long step = frames / ((long)job->options->frames * TRIES);
  SF_TRY(solve_path(log, job->state, "ffmpeg.log"));
  SF_TRY(solve_path(pattern, folder, "%06d.jpg"));
  snprintf(select, sizeof select, "select='not(mod(n,%ld))'", step > 1 ? step : 1);
  const char *const argv[] = {"ffmpeg", "-nostdin", "-y",     "-v",  "error", "-stats", "-i",    job->options->input,
                              "-vf",    select,     "-vsync", "vfr", "-q:v",  "2",      pattern, NULL};
  const solve_watch watch = {"frame=", show_frames, (int)(frames / (step > 1 ? step : 1))};
  return solve_run(job, argv, log, "ffmpeg", &watch);
}

/* The sharpest of each interval stays. */
static sf_status choose_frames(const solve_job *job, const solve_pictures *tried, const char *folder)
{
  const int wanted = tried->count < job->options->frames ? tried->count : job->options->frames;
  for (int i = 0; i < wanted; i++) {
    const int end = (int)((long)(i + 1) * tried->count / wanted);
    char from[4096], to[4096], name[280];
    int best = (int)((long)i * tried->count / wanted);
    for (int k = best + 1; k < end; k++)
      if (tried->at[k].sharpness > tried->at[best].sharpness) best = k;
    SF_TRY(solve_path(from, folder, tried->at[best].name));
    snprintf(name, sizeof name, "frame_%s", tried->at[best].name);
    SF_TRY(solve_path(to, job->images, name));
    SF_TRY(solve_copy(from, to));
  }
  return sf_ok();
}

sf_status solve_video(solve_job *job)
{
  char folder[4096];
  long count = 0;
  solve_pictures tried = {0};
  SF_TRY(count_frames(job, &count));
  SF_TRY(solve_path(folder, job->state, "tried"));
  SF_TRY(solve_remove(folder));
  SF_TRY(sf_make_dir(folder));
  SF_TRY(take_frames(job, folder, count));
  sf_status status = solve_list(&tried, folder, NULL, 0);
  if (status.code == SF_OK) status = solve_measure(&tried, folder, &job->progress);
  if (status.code == SF_OK) status = choose_frames(job, &tried, folder);
  free(tried.at);
  if (status.code == SF_OK) status = solve_remove(folder);
  return status;
}
