#include "sim/studio/internal.h"
#include "base/sha256.h"
#include "base/io.h"
#include "base/text.h"
#include "snn/kernels.h"
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

void sf_view_set_free(sf_view_set *set)
{
  sf_manifest_free(&set->manifest);
}

void sf_set_path(const sf_view_set *set, const char *name, char path[4096 + 80])
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

sf_status sf_set_render(sf_view_set *set, sf_shot *shot, sf_manifest_view *view)
{
  SF_TRY(place_window(set, shot));
  if (set->begin) set->begin(set->user, shot);
  SF_TRY(sf_shot_render(set->studio, shot));
  *view = (sf_manifest_view){.index = shot->index, .psnr = shot->psnr, .ssim = shot->ssim};
  snprintf(view->name, sizeof view->name, "%s", shot->view->name);
  return sf_manifest_describe(view, &set->studio->scene.net, &shot->view->camera, &shot->golden);
}

/* ---- rendering ---- */

static bool is_there(const sf_view_set *set, const sf_manifest_view *view)
{
  char path[4096 + 80], hash[65];
  sf_set_path(set, view->exr, path);
  return sf_sha256_file(path, hash).code == SF_OK && !strcmp(hash, view->exr_sha256);
}

static bool finished(const sf_view_set *set, int index)
{
  const sf_manifest_view *view = sf_manifest_find(&set->manifest, index);
  return view && is_there(set, view);
}

typedef struct rendered {
  sf_status status;
  sf_manifest_view view;
} rendered;

static sf_status keep_picture(const sf_view_set *set, const sf_shot *shot, sf_manifest_view *view)
{
  char path[4096 + 80];
  snprintf(view->exr, sizeof view->exr, "view_%04d.exr", view->index);
  sf_set_path(set, view->exr, path);
  SF_TRY(sf_shot_save(set->studio, shot, path));
  return sf_sha256_file(path, view->exr_sha256);
}

/* Runs on the rank that the view is dealt to. */
static void render_view(void *user, uint64_t unit, void *result)
{
  const sf_set_run *r = user;
  rendered *to = result;
  sf_shot shot;
  to->status = sf_shot_load(r->set->studio, r->index[unit], &shot);
  if (to->status.code == SF_OK) to->status = sf_set_render(r->set, &shot, &to->view);
  if (to->status.code == SF_OK) to->status = keep_picture(r->set, &shot, &to->view);
  sf_shot_free(&shot);
  to->status = sf_ranks_named(r->set->ranks, to->status);
}

static sf_status keep(sf_view_set *set, const sf_manifest_view *view)
{
  if (sf_ranks_size(set->ranks) > 1 && !is_there(set, view))
    return sf_fail(SF_E_IO, "%s/%s: a rank has written it, rank 0 does not find it: all have to see this folder",
                   set->folder, view->exr);
  set->rendered++;
  set->pixels += (uint64_t)view->width * (uint64_t)view->height;
  SF_TRY(sf_manifest_put(&set->manifest, view));
  return sf_manifest_save(&set->manifest, set->manifest_path);
}

static bool take_view(void *user, uint64_t unit, const void *result)
{
  sf_set_run *r = user;
  const rendered *from = result;
  (void)unit;
  r->ended = from->status;
  if (r->ended.code == SF_E_STOPPED) return sf_ranks_stop(r->set->ranks); /* else its rank alone was stopped */
  if (r->ended.code == SF_OK) r->ended = keep(r->set, &from->view);
  return r->ended.code == SF_OK;
}

void sf_set_tick(void *user)
{
  const sf_set_run *r = user;
  if (r->set->tick) r->set->tick(r->set->user);
}

/* The first view says the scale, the number of views, and whether the window fits. */
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

/* The truth may have changed since the view was rendered, so a view that is kept is compared with it again. */
static sf_status measure_again(const sf_view_set *set, sf_shot *shot, sf_manifest *found, sf_manifest_view view)
{
  char path[4096 + 80];
  if (!is_there(set, &view)) return sf_ok(); /* it will be rendered */
  sf_set_path(set, view.exr, path);
  SF_TRY(place_window(set, shot));
  SF_TRY(sf_shot_measure(set->studio, shot, path));
  view.psnr = shot->psnr, view.ssim = shot->ssim;
  return sf_manifest_put(found, &view);
}

static sf_status same_view(const sf_view_set *set, sf_manifest *found, const sf_manifest_view *view)
{
  sf_shot shot;
  sf_status status = sf_shot_load(set->studio, view->index, &shot);
  if (status.code == SF_OK) status = sf_manifest_same_camera(view, shot.view->name, &shot.view->camera);
  if (status.code == SF_OK) status = measure_again(set, &shot, found, *view);
  sf_shot_free(&shot);
  if (status.code != SF_E_DIFFERENCE) return status;
  return sf_fail(status.code, "view[%d]: %s", view->index, status.message);
}

static sf_status same_set(const sf_view_set *set, sf_manifest *found)
{
  SF_TRY(sf_manifest_same_origin(&found->origin, &set->manifest.origin));
  if (found->total != set->manifest.total)
    return sf_fail(SF_E_DIFFERENCE, "views is %d, here it is %d", found->total, set->manifest.total);
  for (int i = 0; i < found->count; i++) SF_TRY(same_view(set, found, &found->view[i]));
  return sf_ok();
}

/* Views that exist already are kept if they belong to this set. */
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

const char *sf_set_lost(const sf_status *dealt)
{
  return dealt->code == SF_E_STOPPED ? dealt->message + strlen("stopped") : "";
}

static sf_status render_missing(sf_view_set *set, const bool *done, int *index)
{
  sf_set_run r = {.set = set, .index = index, .ended = sf_ok()};
  const sf_manifest *m = &set->manifest;
  for (int i = 0; i < m->total; i++)
    if (!done[i]) index[set->todo++] = i;
  const sf_deal deal = {.end = (uint64_t)set->todo,
                        .result_size = sizeof(rendered),
                        .work = render_view,
                        .take = take_view,
                        .any_order = true, /* the manifest sorts them */
                        .tick = sf_set_tick,
                        .user = &r};
  const sf_status dealt = sf_ranks_deal(set->ranks, &deal);
  if (dealt.code != SF_E_STOPPED && r.ended.code != SF_E_STOPPED) return r.ended.code == SF_OK ? dealt : r.ended;
  return sf_fail(SF_E_STOPPED, "stopped; %s holds %d of %d view%s%s, the same command goes on", set->folder, m->count,
                 m->total, sf_plural((uint64_t)m->total), sf_set_lost(&dealt));
}

/* Rank 0 alone reads and writes the manifest. */
static sf_status begin_set(sf_view_set *set)
{
  if (sf_ranks_rank(set->ranks)) return sf_ok();
  SF_TRY(sf_make_dir(set->folder));
  SF_TRY(resume(set));
  return sf_manifest_save(&set->manifest, set->manifest_path);
}

sf_status sf_set_same(const sf_view_set *set)
{
  sf_shot shot;
  char cameras[65] = "";
  sf_status status = sf_shot_load(set->studio, 0, &shot);
  if (status.code == SF_OK) {
    const sf_space space = sf_dataset_space(&shot.data);
    snprintf(cameras, sizeof cameras, "%d %d %d %x", shot.data.total, shot.data.downscale, space.views,
             (unsigned)space.poses);
  }
  sf_shot_free(&shot);
  SF_TRY(sf_ranks_agree(set->ranks, status));
  SF_TRY(sf_ranks_same(set->ranks, "scene", set->studio->scene_sha256));
  if (set->studio->options.backend == SF_BACKEND_FLOAT) /* which rounds otherwise with others */
    SF_TRY(sf_ranks_same(set->ranks, "set of vector instructions", sf_kernels_select(NULL)->name));
  return sf_ranks_same(set->ranks, "data set", cameras);
}

static sf_status render_set(sf_view_set *set, bool *done, int *index)
{
  const int total = set->manifest.total;
  for (int i = 0; i < total && !sf_ranks_rank(set->ranks); i++) done[i] = finished(set, i);
  SF_TRY(sf_ranks_broadcast(set->ranks, done, (size_t)total * sizeof *done));
  return render_missing(set, done, index);
}

sf_status sf_view_set_render(sf_view_set *set, const sf_window *crop)
{
  snprintf(set->manifest_path, sizeof set->manifest_path, "%s/%s", set->folder, SF_MANIFEST_NAME);
  if (sf_ranks_size(set->ranks) > 1) SF_TRY(sf_set_same(set));
  SF_TRY(sf_ranks_agree(set->ranks, take_origin(set, crop)));
  SF_TRY(sf_ranks_same(set->ranks, "model", set->manifest.origin.model_sha256));
  SF_TRY(sf_ranks_agree(set->ranks, begin_set(set)));
  const size_t total = (size_t)set->manifest.total;
  bool *done = calloc(total, sizeof *done);
  int *index = calloc(total, sizeof *index);
  sf_status status = sf_ok();
  if (!done || !index) status = sf_fail(SF_E_MEMORY, "no memory for %zu view%s", total, sf_plural(total));
  status = sf_ranks_agree(set->ranks, status);
  if (status.code == SF_OK) status = render_set(set, done, index);
  free(done), free(index);
  return status;
}
