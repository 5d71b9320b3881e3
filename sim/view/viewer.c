/* The viewer: its scene and its data set. */
#include "sim/view/internal.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- what is looked at ---- */

static sf_status look_at_view(sf_viewer *v, int index, sf_sight *sight)
{
  const sf_shot *shot;
  pthread_mutex_lock(&v->photo_turn);
  const sf_status status = sf_viewer_photo(v, index, &shot);
  if (status.code == SF_OK) sight->view = *shot->view, sight->view.image = (sf_image){0}, sight->index = index;
  pthread_mutex_unlock(&v->photo_turn);
  return status;
}

sf_status sf_sight_of(sf_viewer *v, const sf_view_ask *ask, sf_sight *sight)
{
  *sight = (sf_sight){.data = v->data, .view = *v->data.view, .index = -1};
  sight->steps = ask->steps > 0 ? ask->steps : v->fixed.scene.net.steps;
  if (ask->has_camera && ask->view >= 0) return sf_fail(SF_E_USAGE, "camera: a view has one already");
  if (ask->view >= 0)
    SF_TRY(look_at_view(v, ask->view, sight));
  else
    sight->view.camera = ask->has_camera ? ask->camera : v->home;
  const sf_camera *camera = &sight->view.camera;
  sight->window = (sf_window){0, 0, camera->width, camera->height};
  if (ask->window[2] == 0) return sf_ok();
  sight->window = (sf_window){ask->window[0], ask->window[1], ask->window[2], ask->window[3]};
  if (sight->window.x + sight->window.width > camera->width || sight->window.y + sight->window.height > camera->height)
    return sf_fail(SF_E_USAGE, "window: outside the picture of %d x %d pixels", camera->width, camera->height);
  return sf_ok();
}

sf_status sf_viewer_photo(sf_viewer *v, int index, const sf_shot **shot)
{
  *shot = &v->photo;
  if (!v->options.data) return sf_fail(SF_E_RANGE, "there is no data set: start sf_view with one behind the scene");
  if (v->photo.view && v->photo.index == index) return sf_ok();
  sf_shot_free(&v->photo);
  const sf_status status = sf_shot_load(&v->fixed, index, &v->photo);
  if (status.code == SF_OK && v->photo.view) return sf_ok();
  sf_shot_free(&v->photo);
  SF_TRY(status);
  return sf_fail(SF_E_RANGE, "view %d is out of range: there are %d", index, v->views);
}

sf_status sf_viewer_need_model(const sf_viewer *v, int steps)
{
  if (!v->real.model_path[0])
    return sf_fail(SF_E_RANGE, "there is no float model: start sf_view with --model model.safetensors");
  if (steps <= v->real.model.config.steps) return sf_ok();
  return sf_fail(SF_E_RANGE, "the float model has %d time steps, %d are asked for", v->real.model.config.steps, steps);
}

sf_status sf_viewer_core(sf_viewer *v, int steps, fx_core **core)
{
  const int i = steps - 1;
  if (!v->core[i]) SF_TRY(fx_core_open(&v->core[i], &v->at[i], NULL));
  *core = v->core[i];
  return sf_ok();
}

/* ---- beginning and end ---- */

double sf_viewer_middle(const fx_scene *scene, int axis)
{
  const double stretch = scene->units.stretch[axis] > 0 ? scene->units.stretch[axis] : 1;
  return (0.5 / stretch - scene->units.to_box_offset[axis]) / scene->units.to_box_scale;
}

/* Where no view tells: before the middle of the box, which then fills the picture. */
static sf_camera camera_of(const fx_scene *scene)
{
  const double away = 1.6 / scene->units.to_box_scale;
  sf_camera camera = {.width = 400, .height = 400, .fx = 500, .fy = 500, .cx = 200, .cy = 200};
  static const float turn[12] = {1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0}; /* from -y, z up */
  memcpy(camera.to_world, turn, sizeof turn);
  for (int i = 0; i < 3; i++) camera.to_world[4 * i + 3] = (float)(sf_viewer_middle(scene, i) - (i == 1 ? away : 0));
  return camera;
}

static sf_status open_data(sf_viewer *v)
{
  sf_shot shot;
  const sf_camera none = camera_of(&v->fixed.scene);
  if (v->options.data) {
    SF_TRY(sf_shot_load(&v->fixed, 0, &shot));
    if (!shot.view) {
      sf_shot_free(&shot);
      return sf_fail(SF_E_FORMAT, "%s: has no %s view", v->options.data, v->fixed.options.split);
    }
    v->views = shot.data.total;
  } else
    SF_TRY(sf_shot_from(&v->fixed, &none, &shot));
  v->home = shot.view->camera;
  v->data = shot.data; /* moved */
  sf_image_free(&v->data.view->image);
  return sf_ok();
}

static sf_status open_model(sf_viewer *v)
{
  const sf_studio_options how = {.backend = SF_BACKEND_FLOAT, .scene = v->options.scene, .model = v->options.model};
  if (!v->options.model) return sf_ok();
  SF_TRY(sf_studio_open(&v->real, &how));
  return v->options.data ? sf_space_check(&v->real.model.config.space, v->real.model_path, &v->data) : sf_ok();
}

static sf_status open_all(sf_viewer *v)
{
  const sf_viewer_options *o = &v->options;
  if (o->replay) SF_TRY(sf_viewer_load_difference(v));
  const sf_studio_options how = {.backend = SF_BACKEND_FIXED,
                                 .scene = o->scene,
                                 .data = o->data,
                                 .split = o->split ? o->split : "test",
                                 .downscale = o->downscale,
                                 .scale = o->scale};
  SF_TRY(sf_studio_open(&v->fixed, &how));
  v->file_steps = v->fixed.scene.net.steps;
  if (o->steps) v->fixed.scene.net.steps = o->steps;
  for (int t = 0; t < SF_T_MAX; t++) v->at[t] = v->fixed.scene, v->at[t].net.steps = t + 1;
  SF_TRY(sf_technology_find(&v->technology, "45nm"));
  SF_TRY(open_data(v));
  return open_model(v);
}

sf_status sf_viewer_open(sf_viewer **viewer, const sf_viewer_options *options)
{
  sf_viewer *v = *viewer = calloc(1, sizeof *v);
  if (!v) return sf_fail(SF_E_MEMORY, "no memory for the viewer");
  v->options = *options;
  pthread_mutex_init(&v->drawing, NULL), pthread_mutex_init(&v->rtl_turn, NULL);
  pthread_mutex_init(&v->photo_turn, NULL);
  return open_all(v);
}

void sf_viewer_warn(const sf_viewer *v, FILE *out, const char *program)
{
  sf_dataset_warn(out, program, &v->data, NULL);
}

void sf_viewer_close(sf_viewer *v)
{
  if (!v) return;
  for (int t = 0; t < SF_T_MAX; t++) fx_core_close(v->core[t]);
  sf_shot_free(&v->photo);
  sf_dataset_free(&v->data);
  if (v->rtl.scene_sha256[0]) sf_studio_close(&v->rtl);
  sf_studio_close(&v->real);
  sf_studio_close(&v->fixed);
  cJSON_Delete(v->difference);
  free(v->replay), free(v->scene_path);
  pthread_mutex_destroy(&v->drawing), pthread_mutex_destroy(&v->rtl_turn), pthread_mutex_destroy(&v->photo_turn);
  free(v);
}
