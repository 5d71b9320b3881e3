/* Lists, copies, and the sharpness of pictures. */
#include "base/io.h"
#include "image/image.h"
#include "tools/solve/solve.h"
#include <dirent.h>
#include <errno.h>
#include <ftw.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

enum { SHARP_SIDE = 1024 };

sf_status solve_path(char path[4096], const char *folder, const char *name)
{
  if (snprintf(path, 4096, "%s/%s", folder, name) >= 4096) return sf_fail(SF_E_IO, "%.80s...: name too long", folder);
  return sf_ok();
}

bool solve_is_jpeg(const char *name)
{
  const char *dot = strrchr(name, '.');
  return dot && (!strcasecmp(dot, ".jpg") || !strcasecmp(dot, ".jpeg"));
}

static bool is_picture(const char *name)
{
  const char *dot = strrchr(name, '.');
  return solve_is_jpeg(name) || (dot && !strcasecmp(dot, ".png"));
}

static int by_name(const void *a, const void *b)
{
  return strcmp(((const solve_picture *)a)->name, ((const solve_picture *)b)->name);
}

static sf_status add(solve_pictures *list, const char *folder, const char *name)
{
  solve_picture *more = realloc(list->at, (size_t)(list->count + 1) * sizeof *more);
  if (!more) return sf_fail(SF_E_MEMORY, "%s: no memory for its list", folder);
  list->at = more;
  solve_picture *new = &more[list->count];
  *new = (solve_picture){0};
  if (strlen(name) >= sizeof new->name) return sf_fail(SF_E_IO, "%s/%.80s...: name too long", folder, name);
  strcpy(new->name, name);
  list->count++;
  return sf_ok();
}

sf_status solve_list(solve_pictures *list, const char *folder, char *refused, int room)
{
  sf_status status = sf_ok();
  *list = (solve_pictures){0};
  if (refused) *refused = 0;
  DIR *dir = opendir(folder);
  if (!dir) return sf_fail(SF_E_IO, "cannot read %s: %s", folder, strerror(errno));
  for (const struct dirent *e; status.code == SF_OK && (e = readdir(dir));) {
    char path[4096];
    struct stat info;
    if (e->d_name[0] == '.') continue;
    status = solve_path(path, folder, e->d_name);
    if (status.code != SF_OK || stat(path, &info) || !S_ISREG(info.st_mode)) continue;
    if (is_picture(e->d_name))
      status = add(list, folder, e->d_name);
    else if (refused && (int)(strlen(refused) + strlen(e->d_name)) + 3 < room)
      sprintf(refused + strlen(refused), "%s%s", *refused ? ", " : "", e->d_name);
  }
  closedir(dir);
  if (list->count) qsort(list->at, (size_t)list->count, sizeof *list->at, by_name);
  return status;
}

/* ---- sharpness ---- */

static double laplacian_variance(const sf_image *image)
{
  const int w = image->width, h = image->height;
  double sum = 0, squares = 0;
  for (int y = 1; y < h - 1; y++)
    for (int x = 1; x < w - 1; x++) {
      const long here = (long)y * w + x, at[5] = {here, here - 1, here + 1, here - w, here + w};
      double grey[5];
      for (int i = 0; i < 5; i++) {
        const uint16_t *p = image->rgba + 4 * at[i];
        grey[i] = (0.299 * p[0] + 0.587 * p[1] + 0.114 * p[2]) / 257;
      }
      const double l = grey[1] + grey[2] + grey[3] + grey[4] - 4 * grey[0];
      sum += l, squares += l * l;
    }
  const double n = (double)(w - 2) * (h - 2);
  return w > 2 && h > 2 ? squares / n - sum / n * (sum / n) : 0;
}

static sf_status measure_one(solve_picture *picture, const char *folder)
{
  char path[4096];
  sf_image image;
  SF_TRY(solve_path(path, folder, picture->name));
  SF_TRY(sf_image_load(&image, path));
  picture->width = image.width, picture->height = image.height;
  const int side = image.width > image.height ? image.width : image.height;
  const sf_status status = sf_image_downscale(&image, (side + SHARP_SIDE - 1) / SHARP_SIDE, path);
  if (status.code == SF_OK) picture->sharpness = laplacian_variance(&image);
  sf_image_free(&image);
  return status;
}

sf_status solve_measure(solve_pictures *list, const char *folder, sf_progress *progress)
{
  sf_status status = sf_ok();
  int done = 0;
#pragma omp parallel for schedule(dynamic)
  for (int i = 0; i < list->count; i++) {
    if (sf_cli_interrupted()) continue;
    const sf_status one = measure_one(&list->at[i], folder);
#pragma omp critical
    {
      if (one.code != SF_OK && status.code == SF_OK) status = one;
      if (sf_progress_due(progress)) sf_progress_show(progress, "pictures: %d of %d read", done, list->count);
      done++;
    }
  }
  return sf_cli_interrupted() ? sf_fail(SF_E_STOPPED, "interrupted") : status;
}

/* ---- copies ---- */

sf_status solve_copy(const char *from, const char *to)
{
  char *data = NULL;
  size_t size;
  SF_TRY(sf_read_file(from, (size_t)1 << 30, &data, &size));
  const sf_status status = sf_write_file(to, data, size);
  free(data);
  return status;
}

static int remove_one(const char *path, const struct stat *info, int type, struct FTW *place)
{
  (void)info, (void)type, (void)place;
  return remove(path);
}

sf_status solve_remove(const char *path)
{
  if (!nftw(path, remove_one, 16, FTW_DEPTH | FTW_PHYS) || errno == ENOENT) return sf_ok();
  return sf_fail(SF_E_IO, "cannot remove %s: %s", path, strerror(errno));
}

double solve_number(const char *path, const char *key, double otherwise)
{
  char *text = NULL;
  size_t size;
  if (sf_read_file(path, (size_t)1 << 30, &text, &size).code != SF_OK) return otherwise;
  for (const char *at = text; (at = strstr(at, key)); at += strlen(key)) otherwise = strtod(at + strlen(key), NULL);
  free(text);
  return otherwise;
}
