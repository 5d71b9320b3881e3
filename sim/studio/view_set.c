#include "sim/studio/view_set.h"
#include "base/sha256.h"
#include "base/io.h"
#include "base/text.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

void sf_view_set_free(sf_view_set *set)
{
  sf_manifest_free(&set->manifest);
}

static void picture_path(const sf_view_set *set, const char *name, char path[4096 + 80])
{
  snprintf(path, 4096 + 80, "%s/%s", set->folder, name);
}

/* ---- one view ---- */

static sf_status place_window(const sf_view_set *set, sf_shot *shot)
{
  const sf_window *crop = &set->manifest.origin.crop;
  const sf_camera *camera = &shot->view->camera;
  if (crop->width == 0) return sf_ok();
  if (crop->x + crop->width > camera->width || crop->y + crop->height > camera->height)
    return sf_fail(SF_E_RANGE, "view %s has %d x %d pixels: %d,%d,%d,%d is not inside", shot->view->name, camera->width,
                   camera->height, crop->x, crop->y, crop->width, crop->height);
  shot->window = *crop;
  return sf_ok();
}

static sf_status render_loaded(sf_view_set *set, sf_shot *shot, sf_manifest_view *view)
{
  SF_TRY(place_window(set, shot));
  if (set->begin) set->begin(set->user, shot);
  SF_TRY(sf_shot_render(set->studio, shot));
  set->rendered++;
  set->pixels += (uint64_t)shot->window.width * (uint64_t)shot->window.height;
  *view = (sf_manifest_view){.index = shot->index, .psnr = shot->psnr, .ssim = shot->ssim};
  snprintf(view->name, sizeof view->name, "%s", shot->view->name);
  return sf_manifest_describe(view, &set->studio->scene.net, &shot->view->camera, &shot->golden);
}

/* ---- rendering ---- */

static bool finished(const sf_view_set *set, int index)
{
  char path[4096 + 80], hash[65];
  const sf_manifest_view *view = sf_manifest_find(&set->manifest, index);
  if (!view) return false;
  picture_path(set, view->exr, path);
  return sf_sha256_file(path, hash).code == SF_OK && !strcmp(hash, view->exr_sha256);
}

static sf_status keep(sf_view_set *set, const sf_shot *shot, sf_manifest_view *view)
{
  char path[4096 + 80];
  snprintf(view->exr, sizeof view->exr, "view_%04d.exr", view->index);
  picture_path(set, view->exr, path);
  SF_TRY(sf_shot_save(set->studio, shot, path));
  SF_TRY(sf_sha256_file(path, view->exr_sha256));
  SF_TRY(sf_manifest_put(&set->manifest, view));
  return sf_manifest_save(&set->manifest, set->manifest_path);
}

static sf_status render_view(sf_view_set *set, sf_shot *shot)
{
  sf_manifest_view view;
  SF_TRY(render_loaded(set, shot, &view));
  return keep(set, shot, &view);
}

/* The first view tells the scale, the number of views and whether the window can be inside. */
static sf_status take_origin(sf_view_set *set, const sf_window *crop)
{
  const sf_studio *studio = set->studio;
  sf_manifest_origin *o = &set->manifest.origin;
  sf_shot shot;
  sf_status status = sf_shot_load(studio, 0, &shot);
  *o = (sf_manifest_origin){
      .steps = studio->scene.net.steps, .downscale = shot.data.downscale, .scale = shot.data.scale, .crop = *crop};
  set->manifest.total = shot.data.total;
  if (status.code == SF_OK) status = place_window(set, &shot);
  sf_shot_free(&shot);
  SF_TRY(status);
  memcpy(o->scene_sha256, studio->scene_sha256, sizeof o->scene_sha256);
  snprintf(o->split, sizeof o->split, "%s", studio->options.split);
  if (studio->options.backend != SF_BACKEND_FLOAT) return sf_ok();
  return sf_sha256_file(studio->model_path, o->model_sha256);
}

static sf_status same_camera(const sf_view_set *set, const sf_manifest_view *view)
{
  sf_shot shot;
  sf_status status = sf_shot_load(set->studio, view->index, &shot);
  if (status.code == SF_OK) status = sf_manifest_same_camera(view, shot.view->name, &shot.view->camera);
  sf_shot_free(&shot);
  if (status.code != SF_E_DIFFERENCE) return status;
  return sf_fail(status.code, "view[%d]: %s", view->index, status.message);
}

static sf_status same_set(const sf_view_set *set, const sf_manifest *found)
{
  SF_TRY(sf_manifest_same_origin(&found->origin, &set->manifest.origin));
  if (found->total != set->manifest.total)
    return sf_fail(SF_E_DIFFERENCE, "views is %d, here it is %d", found->total, set->manifest.total);
  for (int i = 0; i < found->count; i++) SF_TRY(same_camera(set, &found->view[i]));
  return sf_ok();
}

/* Views that are there already are taken over, if they are views of this very set. */
static sf_status resume(sf_view_set *set)
{
  if (access(set->manifest_path, F_OK)) return sf_ok();
  sf_manifest found;
  SF_TRY(sf_manifest_load(&found, set->manifest_path));
  if (found.count == 0) return sf_ok();
  const sf_status status = same_set(set, &found);
  if (status.code == SF_OK)
    set->manifest = found;
  else
    sf_manifest_free(&found);
  if (status.code != SF_E_DIFFERENCE) return status;
  return sf_fail(status.code, "%s belongs to another set: %s", set->manifest_path, status.message);
}

static sf_status render_missing(sf_view_set *set, const bool *done)
{
  for (int i = 0; i < set->manifest.total; i++) {
    sf_shot shot;
    if (done[i]) continue;
    sf_status status = sf_shot_load(set->studio, i, &shot);
    if (status.code == SF_OK) status = render_view(set, &shot);
    sf_shot_free(&shot);
    if (status.code == SF_E_STOPPED)
      return sf_fail(status.code, "stopped; %s holds %d of %d view%s, the same command goes on", set->folder,
                     set->manifest.count, set->manifest.total, sf_plural((uint64_t)set->manifest.total));
    SF_TRY(status);
  }
  return sf_ok();
}

sf_status sf_view_set_render(sf_view_set *set, const sf_window *crop)
{
  snprintf(set->manifest_path, sizeof set->manifest_path, "%s/%s", set->folder, SF_MANIFEST_NAME);
  SF_TRY(take_origin(set, crop));
  SF_TRY(sf_make_dir(set->folder));
  SF_TRY(resume(set));
  SF_TRY(sf_manifest_save(&set->manifest, set->manifest_path));
  bool *done = calloc((size_t)set->manifest.total, sizeof *done);
  if (!done)
    return sf_fail(SF_E_MEMORY, "no memory for %d view%s", set->manifest.total,
                   sf_plural((uint64_t)set->manifest.total));
  for (int i = 0; i < set->manifest.total; i++) set->todo += !(done[i] = finished(set, i));
  sf_status status = render_missing(set, done);
  free(done);
  return status;
}

/* ---- verification ---- */

/* The picture differs from the manifest. The EXR, while it is the one that belongs there, knows the pixel. */
static void locate(const sf_view_set *set, const sf_shot *shot, int plane, sf_verdict *verdict)
{
  char path[4096 + 80], hash[65];
  picture_path(set, verdict->view->exr, path);
  if (plane < 0 || sf_sha256_file(path, hash).code != SF_OK || strcmp(hash, verdict->view->exr_sha256) != 0) return;
  sf_status pixel = sf_golden_compare_file(&shot->golden, path, plane);
  if (pixel.code == SF_E_DIFFERENCE) verdict->picture = pixel;
}

static void check_file(const sf_view_set *set, const sf_shot *shot, sf_verdict *verdict)
{
  char path[4096 + 80], hash[65];
  picture_path(set, verdict->view->exr, path);
  if (access(path, F_OK)) return;
  verdict->file = sf_sha256_file(path, hash);
  if (verdict->file.code != SF_OK || !strcmp(hash, verdict->view->exr_sha256)) return;
  verdict->file = sf_golden_compare_file(&shot->golden, path, -1);
  if (verdict->file.code == SF_OK)
    snprintf(verdict->note, sizeof verdict->note, "%s is not the file of the manifest, its integer planes are the same",
             verdict->view->exr);
}

/* Pictures of the data set only judge a rendering; they are not part of it. */
static void check_quality(const sf_manifest_view *here, sf_verdict *verdict)
{
  const sf_manifest_view *view = verdict->view;
  bool same = (fabs(view->psnr - here->psnr) <= 0.001 || (isnan(view->psnr) && !isfinite(here->psnr))) &&
              (fabs(view->ssim - here->ssim) <= 0.001 || (isnan(view->ssim) && isnan(here->ssim)));
  if (same || verdict->note[0]) return;
  snprintf(verdict->note, sizeof verdict->note,
           "PSNR %.4f dB, SSIM %.4f, in the manifest %.4f dB, %.4f: another picture to compare with", here->psnr,
           here->ssim, view->psnr, view->ssim);
}

static sf_status verify_view(sf_view_set *set, sf_shot *shot, sf_verdict *verdict)
{
  sf_manifest_view here;
  int plane = -1;
  if (!shot->view) {
    verdict->picture = sf_fail(SF_E_DIFFERENCE, "%s has %d view%s", set->studio->options.data, shot->data.total,
                               sf_plural((uint64_t)shot->data.total));
    return sf_ok();
  }
  if (strcmp(shot->view->name, verdict->view->name) != 0) {
    verdict->picture = sf_fail(SF_E_DIFFERENCE, "name is %s, here it is %s", verdict->view->name, shot->view->name);
    return sf_ok();
  }
  SF_TRY(render_loaded(set, shot, &here));
  verdict->picture = sf_manifest_same_view(verdict->view, &here, &plane);
  if (verdict->picture.code != SF_OK) locate(set, shot, plane, verdict);
  check_file(set, shot, verdict);
  if (verdict->picture.code == SF_OK) check_quality(&here, verdict);
  return sf_ok();
}

static sf_status check_total(const sf_view_set *set)
{
  sf_shot shot;
  SF_TRY(sf_shot_load(set->studio, set->manifest.total, &shot));
  int total = shot.data.total;
  sf_shot_free(&shot);
  if (total == set->manifest.total) return sf_ok();
  return sf_fail(SF_E_DIFFERENCE, "%s: views is %d, %s has %d %s views", set->manifest_path, set->manifest.total,
                 set->studio->options.data, total, set->manifest.origin.split);
}

sf_status sf_view_set_verify(sf_view_set *set, int only, void (*report)(void *user, const sf_verdict *verdict),
                             int *differences)
{
  const sf_manifest *m = &set->manifest;
  *differences = 0;
  if (strcmp(m->origin.scene_sha256, set->studio->scene_sha256) != 0)
    return sf_fail(SF_E_DIFFERENCE, "%s: made from the scene with SHA-256 %s, %s has %s", set->manifest_path,
                   m->origin.scene_sha256, set->studio->options.scene, set->studio->scene_sha256);
  SF_TRY(check_total(set));
  set->todo = only >= 0 ? 1 : m->count;
  for (int i = 0; i < m->count; i++) {
    sf_verdict verdict = {.view = &m->view[i]};
    sf_shot shot;
    if (only >= 0 && m->view[i].index != only) continue;
    sf_status status = sf_shot_load(set->studio, m->view[i].index, &shot);
    if (status.code == SF_OK) status = verify_view(set, &shot, &verdict);
    sf_shot_free(&shot);
    if (status.code == SF_E_STOPPED)
      return sf_fail(status.code, "stopped after %d view%s", set->rendered, sf_plural((uint64_t)set->rendered));
    SF_TRY(status);
    *differences += verdict.picture.code != SF_OK || verdict.file.code != SF_OK;
    report(set->user, &verdict);
  }
  return sf_ok();
}
