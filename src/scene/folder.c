/* Folders of pictures: images, images_2, images_4, ... */
#include "src/scene/capture.h"
#include <dirent.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

enum { SHRINK_MAX = 64 };

bool sf_is_file(const char *path)
{
  struct stat info;
  return !stat(path, &info) && !S_ISDIR(info.st_mode);
}

bool sf_is_folder(const char *path)
{
  struct stat info;
  return !stat(path, &info) && S_ISDIR(info.st_mode);
}

sf_status sf_join(char path[4096], const char *dir, const char *name, const char *tail)
{
  bool absolute = name[0] == '/';
  int n = snprintf(path, 4096, "%s%s%s%s", absolute ? "" : dir, absolute ? "" : "/", name, tail);
  if (n < 0 || n >= 4096) return sf_fail(SF_E_IO, "%.80s.../%.80s: name too long", dir, name);
  return sf_ok();
}

static bool is_picture(const char *name)
{
  const char *dot = strrchr(name, '.');
  return dot && (!strcasecmp(dot, ".png") || !strcasecmp(dot, ".jpg") || !strcasecmp(dot, ".jpeg"));
}

/* ---- which folder ---- */

static void folder_name(char folder[64], int shrink)
{
  if (shrink == 1)
    strcpy(folder, "images");
  else
    snprintf(folder, 64, "images_%d", shrink);
}

static bool has(const char *dir, int shrink)
{
  char folder[64], path[4096];
  folder_name(folder, shrink);
  return sf_join(path, dir, folder, "").code == SF_OK && sf_is_folder(path);
}

sf_status sf_pictures_choose(const char *dir, int downscale, double width, double height, char folder[64], int *shrink)
{
  const double side = width > height ? width : height;
  int found = 0, smallest = 0, fitting = 0;
  for (int n = 1; n <= SHRINK_MAX; n++) {
    if (!has(dir, n)) continue;
    smallest = n;
    if (!fitting && side / n <= SF_LONG_SIDE) fitting = n;
    if (downscale && downscale % n == 0) found = n;
  }
  if (!smallest) return sf_fail(SF_E_IO, "%s: no folder images or images_N with the pictures", dir);
  if (!downscale) found = fitting ? fitting : smallest;
  if (!found) {
    folder_name(folder, smallest);
    return sf_fail(SF_E_RANGE, "%s: pictures of 1/%d of the full size are asked for: they cannot be made from %s", dir,
                   downscale, folder);
  }
  folder_name(folder, found);
  *shrink = downscale / found;
  return sf_ok();
}

/* ---- their names ---- */

void sf_names_free(char **name, int count)
{
  for (int i = 0; i < count; i++) free(name[i]);
  free(name);
}

static int by_name(const void *a, const void *b)
{
  return strcmp(*(char *const *)a, *(char *const *)b);
}

static sf_status add_name(char ***name, int *count, int *room, const char *text)
{
  if (*count == *room) {
    const int more = *room ? 2 * *room : 64;
    char **larger = realloc(*name, (size_t)more * sizeof **name);
    if (!larger) return sf_fail(SF_E_MEMORY, "no memory for the names of %d pictures", more);
    *name = larger, *room = more;
  }
  (*name)[*count] = strdup(text);
  if (!(*name)[*count]) return sf_fail(SF_E_MEMORY, "no memory for the names of pictures");
  ++*count;
  return sf_ok();
}

sf_status sf_pictures_list(const char *dir, const char *folder, char ***name, int *count)
{
  char path[4096];
  int room = 0;
  *name = NULL, *count = 0;
  SF_TRY(sf_join(path, dir, folder, ""));
  DIR *list = opendir(path);
  if (!list) return sf_fail(SF_E_IO, "cannot read %s: %s", path, strerror(errno));
  sf_status status = sf_ok();
  for (const struct dirent *entry; status.code == SF_OK && (entry = readdir(list));)
    if (entry->d_name[0] != '.' && is_picture(entry->d_name)) status = add_name(name, count, &room, entry->d_name);
  closedir(list);
  if (status.code != SF_OK) {
    sf_names_free(*name, *count);
    return status;
  }
  if (*count) qsort(*name, (size_t)*count, sizeof **name, by_name);
  return sf_ok();
}

sf_status sf_picture_find(char path[4096], const char *dir, const char *file)
{
  static const char *const ending[] = {".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG"};
  SF_TRY(sf_join(path, dir, file, ".jpeg")); /* the longest: the others fit too */
  SF_TRY(sf_join(path, dir, file, ""));
  if (sf_is_file(path)) return sf_ok();
  char *end = is_picture(file) ? strrchr(path, '.') : path + strlen(path);
  for (size_t i = 0; i < sizeof ending / sizeof *ending; i++) {
    strcpy(end, ending[i]);
    if (sf_is_file(path)) return sf_ok();
  }
  return is_picture(file) ? sf_join(path, dir, file, "") : sf_join(path, dir, file, ".png");
}

sf_status sf_picture_load(sf_image *image, const char *path)
{
  struct stat info;
  if (!stat(path, &info) && !S_ISREG(info.st_mode) && !S_ISDIR(info.st_mode))
    return sf_fail(SF_E_IO, "cannot read %s: it is not a regular file", path);
  return sf_image_load(image, path);
}
