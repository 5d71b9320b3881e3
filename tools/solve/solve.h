/* Photographs or a video to a data set: its pictures, and their poses by COLMAP, which runs as a program of its own. */
#ifndef SF_TOOLS_SOLVE_H
#define SF_TOOLS_SOLVE_H
#include "base/status.h"
#include "cli/cli.h"
#include <stdbool.h>
#include <stdio.h>

enum {
  SF_SOLVE_LEAST = 8,   /* pictures */
  SF_SOLVE_SIDE = 1600, /* pixels: what the reader of data sets takes by itself, and what features are found in */
  SF_SOLVE_ALL = 100    /* pictures up to which every pair is matched */
};
#define SF_SOLVE_MATCHINGS "auto|exhaustive|sequential"
#define SF_SOLVE_LENSES "SIMPLE_RADIAL|OPENCV"

typedef struct solve_options {
  const char *input;  /* a folder of JPEG and PNG pictures, or a video */
  const char *output; /* a folder: images/, perhaps images_N/, sparse/0/, and .solve/ with the state of each step */
  int frames;         /* of a video, at most */
  int features;       /* of a picture, at most */
  int matching, lens; /* of the choices above */
  bool quiet;
} solve_options;

typedef struct solve_result {
  int pictures, registered, points;
  double error; /* mean of the reprojections, pixels */
} solve_result;

/* A name with its sharpness: the variance of the Laplacian (Pech-Pacheco et al. 2000), of grey values 0 to 255. */
typedef struct solve_picture {
  char name[256];
  int width, height;
  double sharpness;
} solve_picture;
typedef struct solve_pictures {
  solve_picture *at;
  int count;
} solve_pictures;

typedef struct solve_job {
  const solve_options *options;
  char images[4096], state[4096], database[4096];
  solve_pictures pictures; /* of images/, once they are there */
  sf_progress progress;
} solve_job;

/* ---- files ---- */

/* Regular files of a folder with these endings, in the order of names; the rest 0. With refused: those with other
 * endings are named there. SF_E_IO, SF_E_MEMORY. */
sf_status solve_list(solve_pictures *list, const char *folder, char *refused, int room);
/* Size and sharpness of each: of the box-filtered picture of at most 1024 pixels a side. On all processors. */
sf_status solve_measure(solve_pictures *list, const char *folder, sf_progress *progress);
/* "FOLDER/NAME". SF_E_IO: too long. */
sf_status solve_path(char path[4096], const char *folder, const char *name);
bool solve_is_jpeg(const char *name); /* by its ending */
sf_status solve_copy(const char *from, const char *to);
sf_status solve_remove(const char *path); /* a file, or a folder with all that is in it; absent is fine */
/* The number behind the last `key` of a text file; `otherwise` where there is none. */
double solve_number(const char *path, const char *key, double otherwise);

/* ---- programs ---- */

/* A line of a program's log as progress: `text` is what follows the last `key` in it. */
typedef struct solve_watch {
  const char *key;
  void (*show)(sf_progress *progress, const char *text, int total);
  int total;
} solve_watch;
/* SF_E_IO, with the Debian package that holds it, unless it is in PATH. */
sf_status solve_installed(const char *program, const char *package);
/* Runs argv[0], its output to the file `log`; `package` of Debian holds it. watch: NULL for none.
 * SF_E_IO: not there, or it failed (the message has the last line of the log). SF_E_STOPPED: interrupted. */
sf_status solve_run(solve_job *job, const char *const *argv, const char *log, const char *package,
                    const solve_watch *watch);

/* ---- steps ---- */

/* What decides the pictures: every name and hash of the input, or those of the video. */
sf_status solve_pictures_inputs(solve_job *job, FILE *to);
/* images/ and images_N/ from the folder or the video; state/lists: names by size. */
sf_status solve_pictures_work(solve_job *job);
/* Fills images/ with the sharpest frame of each of options->frames intervals. */
sf_status solve_video(solve_job *job);

sf_status solve_features_inputs(solve_job *job, FILE *to);
sf_status solve_features_work(solve_job *job);
sf_status solve_matches_inputs(solve_job *job, FILE *to);
sf_status solve_matches_work(solve_job *job);
sf_status solve_model_work(solve_job *job);
/* Of a model that is there. */
sf_status solve_model_read(solve_job *job, solve_result *result);

/* All steps. A step whose inputs are as they were is not done again. */
sf_status solve(const solve_options *options, solve_result *result);
#endif
