/* LLFF: poses_bounds.npy, a row per picture in the order of their names. A row is a 3 x 5 matrix (columns: down, right,
 * back, position, [height, width, focal length]) and the nearest and farthest depth (github.com/Fyusion/LLFF). */
#include "src/scene/capture.h"
#include "src/scene/npy.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { COLUMNS = 17 };
static const double FARTHEST = 1e12; /* as of COLMAP's positions */

bool sf_llff_there(const char *dir)
{
  char path[4096];
  return sf_join(path, dir, "poses_bounds.npy", "").code == SF_OK && sf_is_file(path);
}

static sf_status check_row(const char *path, int number, const double *row)
{
  const double height = row[4], width = row[9], focal = row[14];
  double length[3] = {0}, dot[3] = {0};
  for (int i = 0; i < 3; i++)
    for (int k = 0; k < 3; k++) {
      length[k] += row[5 * i + k] * row[5 * i + k];
      dot[k] += row[5 * i + k] * row[5 * i + (k + 1) % 3];
    }
  for (int k = 0; k < 3; k++)
    if (!(fabs(length[k] - 1) < 1e-2))
      return sf_fail(SF_E_RANGE, "%s: row %d: column %d of the rotation has length %g", path, number, k,
                     sqrt(length[k]));
  if (!(fabs(dot[0]) < 1e-2 && fabs(dot[1]) < 1e-2 && fabs(dot[2]) < 1e-2))
    return sf_fail(SF_E_RANGE, "%s: row %d: the rotation's axes are not at right angles", path, number);
  if (!(height >= 1 && width >= 1 && height < 1e6 && width < 1e6 && focal > 1e-3 && focal < 1e7))
    return sf_fail(SF_E_RANGE, "%s: row %d: %g x %g pixels, focal length %g", path, number, width, height, focal);
  for (int i = 0; i < 3; i++)
    if (!(fabs(row[5 * i + 3]) < FARTHEST))
      return sf_fail(SF_E_RANGE, "%s: row %d: the position is %g", path, number, row[5 * i + 3]);
  if (!(row[15] > 0 && row[16] > row[15]))
    return sf_fail(SF_E_RANGE, "%s: row %d: depths from %g to %g", path, number, row[15], row[16]);
  return sf_ok();
}

static void set_frame(sf_frame *frame, int number, const double *row)
{
  *frame = (sf_frame){.number = number,
                      .lens = {.fl_x = row[14],
                               .fl_y = row[14],
                               .width = row[9],
                               .height = row[4],
                               .model = "SIMPLE_PINHOLE",
                               .camera = -1}};
  for (int i = 0; i < 3; i++) {
    const double *from = row + 5 * i;
    double *to = frame->to_world + 4 * i;
    to[0] = from[1], to[1] = -from[0], to[2] = from[2], to[3] = from[3];
  }
}

static sf_status take_rows(sf_capture *c, const double *value, int rows)
{
  c->frame = calloc((size_t)rows, sizeof *c->frame);
  if (!c->frame) return sf_fail(SF_E_MEMORY, "%s: no memory for %d views", c->list, rows);
  c->near = INFINITY;
  for (int i = 0; i < rows; i++) {
    SF_TRY(check_row(c->list, i, value + i * COLUMNS));
    set_frame(&c->frame[i], i, value + i * COLUMNS);
    c->near = fmin(c->near, value[i * COLUMNS + 15]);
  }
  c->count = rows;
  return sf_ok();
}

static sf_status name_pictures(sf_capture *c, const char *dir, const sf_dataset_options *options)
{
  char folder[64], **name;
  int count;
  const sf_lens *lens = &c->frame[0].lens;
  SF_TRY(sf_pictures_choose(dir, options->downscale, lens->width, lens->height, folder, &c->shrink));
  SF_TRY(sf_pictures_list(dir, folder, &name, &count));
  sf_status status = sf_ok();
  if (count != c->count)
    status =
        sf_fail(SF_E_FORMAT, "%s: poses of %d views, %s/%s holds %d pictures", c->list, c->count, dir, folder, count);
  for (int i = 0; i < c->count && status.code == SF_OK; i++) {
    char *path = c->frame[i].file_path;
    if ((size_t)snprintf(path, sizeof c->frame[i].file_path, "%s/%s", folder, name[i]) >= sizeof c->frame[i].file_path)
      status = sf_fail(SF_E_RANGE, "%s/%.80s...: name too long", folder, name[i]);
  }
  sf_names_free(name, count);
  return status;
}

static void note_picture(sf_capture *c, const char *dir)
{
  char **name;
  int count;
  if (sf_pictures_list(dir, "images", &name, &count).code != SF_OK) return;
  if (count) sf_capture_note_full_size(c, dir, name[0]);
  sf_names_free(name, count);
}

sf_status sf_llff_read(sf_capture *capture, const char *dir, const sf_dataset_options *options)
{
  double *value;
  int rows;
  capture->layout = SF_LAYOUT_LLFF;
  SF_TRY(sf_join(capture->list, dir, "poses_bounds.npy", ""));
  SF_TRY(sf_npy_load(capture->list, COLUMNS, &value, &rows));
  sf_status status = take_rows(capture, value, rows);
  free(value);
  SF_TRY(status);
  note_picture(capture, dir);
  return name_pictures(capture, dir, options);
}
