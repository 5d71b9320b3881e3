/* First step: the pictures that are good enough, at their full size and at the size that training reads. */
#include "base/io.h"
#include "base/sha256.h"
#include "base/text.h"
#include "image/image.h"
#include "tools/solve/solve.h"
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/* Below either a picture is blurred: a number that no picture with texture reaches, and a share of what the others
 * have. */
#define SHARP_LEAST 12.0
#define SHARP_SHARE 0.1

static bool is_folder(const char *path)
{
  struct stat info;
  return !stat(path, &info) && S_ISDIR(info.st_mode);
}

sf_status solve_pictures_inputs(solve_job *job, FILE *to)
{
  const solve_options *o = job->options;
  char hex[65], refused[120];
  solve_pictures list;
  if (!is_folder(o->input)) {
    SF_TRY(sf_sha256_file(o->input, hex));
    fprintf(to, "%s %d\n", hex, o->frames);
    return sf_ok();
  }
  sf_status status = solve_list(&list, o->input, refused, sizeof refused);
  if (status.code == SF_OK && !list.count)
    status = sf_fail(SF_E_IO, "%s: no JPEG or PNG picture is there%s%s", o->input, *refused ? ", only " : "", refused);
  for (int i = 0; i < list.count && status.code == SF_OK; i++) {
    char path[4096];
    status = solve_path(path, o->input, list.at[i].name);
    if (status.code == SF_OK) status = sf_sha256_file(path, hex);
    fprintf(to, "%s %s\n", list.at[i].name, hex);
  }
  free(list.at);
  return status;
}

/* ---- which ---- */

static int by_sharpness(const void *a, const void *b)
{
  const double x = ((const solve_picture *)a)->sharpness, y = ((const solve_picture *)b)->sharpness;
  return (x > y) - (x < y);
}

static sf_status sharpness_limit(const solve_pictures *list, double *limit)
{
  solve_picture *sorted = malloc((size_t)list->count * sizeof *sorted);
  if (!sorted) return sf_fail(SF_E_MEMORY, "no memory for %d pictures", list->count);
  memcpy(sorted, list->at, (size_t)list->count * sizeof *sorted);
  qsort(sorted, (size_t)list->count, sizeof *sorted, by_sharpness);
  const double share = SHARP_SHARE * sorted[list->count / 2].sharpness;
  *limit = share > SHARP_LEAST ? share : SHARP_LEAST;
  free(sorted);
  return sf_ok();
}

/* Those that stay keep their order; the others are removed from images/. */
static sf_status leave_out_blurred(solve_job *job, solve_pictures *list)
{
  char path[4096];
  const char *input = job->options->input;
  char names[160] = "";
  int kept = 0, all = list->count;
  double limit = 0, best = 0;
  SF_TRY(sharpness_limit(list, &limit));
  for (int i = 0; i < all; i++) {
    const solve_picture *p = &list->at[i];
    if (p->sharpness > best) best = p->sharpness;
    if (p->sharpness >= limit) {
      list->at[kept++] = *p;
      continue;
    }
    SF_TRY(solve_path(path, job->images, p->name));
    SF_TRY(solve_remove(path));
    if (strlen(names) + strlen(p->name) + 3 < sizeof names)
      sprintf(names + strlen(names), "%s%s", *names ? ", " : "", p->name);
  }
  list->count = kept;
  if (kept < SF_SOLVE_LEAST)
    return sf_fail(
        SF_E_RANGE,
        "%s: %d of %d pictures are blurred or blank and %d are needed: the sharpest has %.3g, a picture needs "
        "%.3g (variance of the Laplacian)",
        input, all - kept, all, SF_SOLVE_LEAST, best, limit);
  if (kept < all && !job->options->quiet)
    printf("left out     %d of %d pictures, blurred or blank: %s%s\n", all - kept, all, names,
           strlen(names) > 120 ? " ..." : "");
  return sf_ok();
}

/* ---- where to ---- */

/* A phone held upright writes its rows as the sensor has them, and a tag that says how to turn them. exiftran turns
 * JPEG pictures without a loss, sets the tag back, and leaves the others alone. With -np it cuts off the blocks at an
 * edge that are not whole and so cannot be turned; its manual has this the wrong way round. */
static sf_status turn_upright(solve_job *job, const solve_pictures *list)
{
  enum { AT_ONCE = 64 };
  char log[4096], (*paths)[4096] = malloc(AT_ONCE * sizeof *paths);
  const char *argv[AT_ONCE + 4] = {"exiftran", "-np", "-ai"};
  if (!paths) return sf_fail(SF_E_MEMORY, "no memory for the names of %d pictures", AT_ONCE);
  sf_status status = solve_path(log, job->state, "upright.log");
  for (int i = 0, n = 0; i < list->count && status.code == SF_OK; i++) {
    if (solve_is_jpeg(list->at[i].name)) {
      status = solve_path(paths[n], job->images, list->at[i].name);
      argv[3 + n] = paths[n];
      argv[3 + ++n] = NULL;
    }
    if (!n || (n < AT_ONCE && i + 1 < list->count) || status.code != SF_OK) continue;
    status = solve_run(job, argv, log, "exiftran", NULL);
    n = 0;
  }
  free(paths);
  return status;
}

/* The picture's size as it lies now, and with factor > 1 the smaller picture. */
static sf_status shrink(solve_picture *picture, const char *images, const char *folder, int factor)
{
  char from[4096], to[4096], name[300];
  sf_image image;
  snprintf(name, sizeof name, "%.*s.png", (int)(strrchr(picture->name, '.') - picture->name), picture->name);
  SF_TRY(solve_path(from, images, picture->name));
  SF_TRY(solve_path(to, folder, name));
  SF_TRY(sf_image_load(&image, from));
  picture->width = image.width, picture->height = image.height;
  sf_status status = factor > 1 ? sf_image_downscale(&image, factor, from) : sf_ok();
  if (status.code == SF_OK && factor > 1) status = sf_image_save_png(&image, to);
  sf_image_free(&image);
  return status;
}

/* images_N holds PNG pictures, whatever the ending of the full size is. */
static sf_status check_stems(const solve_pictures *list, const char *folder)
{
  for (int i = 0; i < list->count; i++)
    for (int k = 0; k < i; k++) {
      const size_t n = (size_t)(strrchr(list->at[i].name, '.') - list->at[i].name);
      if (!strncmp(list->at[i].name, list->at[k].name, n + 1) && !strchr(list->at[k].name + n + 1, '.'))
        return sf_fail(SF_E_RANGE, "%s: %s and %s differ by their ending alone: rename one", folder, list->at[k].name,
                       list->at[i].name);
    }
  return sf_ok();
}

static sf_status make_smaller(solve_job *job, solve_pictures *list)
{
  int side = 0;
  char folder[4096], name[32];
  for (int i = 0; i < list->count; i++) {
    const solve_picture *p = &list->at[i];
    const int longer = p->width > p->height ? p->width : p->height;
    if (longer > side) side = longer;
  }
  const int factor = (side + SF_SOLVE_SIDE - 1) / SF_SOLVE_SIDE;
  snprintf(name, sizeof name, "images_%d", factor);
  SF_TRY(solve_path(folder, job->options->output, name));
  if (factor > 1) SF_TRY(check_stems(list, job->options->input));
  if (factor > 1) SF_TRY(sf_make_dir(folder));
  for (int i = 0; i < list->count; i++) {
    if (sf_cli_interrupted()) return sf_fail(SF_E_STOPPED, "interrupted");
    SF_TRY(shrink(&list->at[i], job->images, folder, factor));
    if (sf_progress_due(&job->progress)) sf_progress_show(&job->progress, "pictures: %d of %d", i + 1, list->count);
  }
  return sf_ok();
}

static bool same_size(const solve_picture *a, const solve_picture *b)
{
  return a->width == b->width && a->height == b->height;
}

/* Pictures of one size are of one camera, which COLMAP is told by a list of their names. */
static sf_status write_lists(solve_job *job, const solve_pictures *list)
{
  char folder[4096], path[4096], name[64];
  int lists = 0;
  SF_TRY(solve_path(folder, job->state, "lists"));
  SF_TRY(solve_remove(folder));
  SF_TRY(sf_make_dir(folder));
  for (int i = 0; i < list->count; i++) {
    bool listed = false;
    for (int k = 0; k < i; k++) listed |= same_size(&list->at[i], &list->at[k]);
    if (listed) continue;
    snprintf(name, sizeof name, "%d.txt", lists++);
    SF_TRY(solve_path(path, folder, name));
    FILE *file = fopen(path, "w");
    if (!file) return sf_fail(SF_E_IO, "cannot write %s", path);
    for (int k = i; k < list->count; k++)
      if (same_size(&list->at[i], &list->at[k])) fprintf(file, "%s\n", list->at[k].name);
    if (fclose(file)) return sf_fail(SF_E_IO, "cannot write %s", path);
  }
  return sf_ok();
}

static sf_status remove_old(solve_job *job)
{
  char path[4096], name[32];
  SF_TRY(solve_remove(job->images));
  for (int n = 2; n <= 64; n++) {
    snprintf(name, sizeof name, "images_%d", n);
    SF_TRY(solve_path(path, job->options->output, name));
    SF_TRY(solve_remove(path));
  }
  return sf_make_dir(job->images);
}

static sf_status copy_all(solve_job *job)
{
  char source[4096], target[4096];
  solve_pictures list;
  sf_status status = solve_list(&list, job->options->input, NULL, 0);
  for (int i = 0; i < list.count && status.code == SF_OK; i++) {
    if (sf_cli_interrupted()) status = sf_fail(SF_E_STOPPED, "interrupted");
    if (status.code == SF_OK && solve_is_jpeg(list.at[i].name)) status = solve_installed("exiftran", "exiftran");
    if (status.code == SF_OK) status = solve_path(source, job->options->input, list.at[i].name);
    if (status.code == SF_OK) status = solve_path(target, job->images, list.at[i].name);
    if (status.code == SF_OK) status = solve_copy(source, target);
    if (sf_progress_due(&job->progress))
      sf_progress_show(&job->progress, "pictures: %d of %d copied", i + 1, list.count);
  }
  free(list.at);
  return status;
}

static sf_status choose(solve_job *job)
{
  solve_pictures list;
  sf_status status = solve_list(&list, job->images, NULL, 0);
  if (status.code == SF_OK && list.count < SF_SOLVE_LEAST)
    status = sf_fail(SF_E_RANGE, "%s: %d picture%s, at least %d are needed, and 50 are better", job->options->input,
                     list.count, sf_plural((uint64_t)list.count), SF_SOLVE_LEAST);
  if (status.code == SF_OK) status = solve_measure(&list, job->images, &job->progress);
  if (status.code == SF_OK) status = leave_out_blurred(job, &list);
  if (status.code == SF_OK && is_folder(job->options->input)) status = turn_upright(job, &list);
  if (status.code == SF_OK) status = make_smaller(job, &list);
  if (status.code == SF_OK) status = write_lists(job, &list);
  free(list.at);
  return status;
}

sf_status solve_pictures_work(solve_job *job)
{
  SF_TRY(solve_installed("colmap", "colmap")); /* before minutes are spent on pictures */
  SF_TRY(remove_old(job));
  SF_TRY(is_folder(job->options->input) ? copy_all(job) : solve_video(job));
  return choose(job);
}
