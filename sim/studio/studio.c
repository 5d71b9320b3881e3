#include "sim/studio/studio.h"
#include "base/sha256.h"
#include "quant/quant.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

const char *const sf_backend_names[] = {"float", "fixed", "rtl", "board"};

static sf_status open_model(sf_studio *studio)
{
  const char *scene = studio->options.scene, *slash = strrchr(scene, '/');
  if (studio->options.model)
    snprintf(studio->model_path, sizeof studio->model_path, "%s", studio->options.model);
  else
    snprintf(studio->model_path, sizeof studio->model_path, "%.*smodel.safetensors",
             slash ? (int)(slash - scene) + 1 : 0, scene);
  SF_TRY(sf_model_load(&studio->model, studio->model_path));
  const bool planes = sf_model_decodes(&studio->model);
  if (planes != (studio->scene.backbone == FX_TENSORF))
    return sf_fail(SF_E_RANGE, "%s: the model's field is %s, the scene's is not", studio->model_path,
                   planes ? "TensoRF's" : "a hash grid");
  if (studio->scene.net.steps > studio->model.config.steps)
    return sf_fail(SF_E_RANGE, "%s: the model has %d time steps, %d are asked for", studio->model_path,
                   studio->model.config.steps, studio->scene.net.steps);
  return sf_ok();
}

sf_status sf_studio_open(sf_studio *studio, const sf_studio_options *options)
{
  *studio = (sf_studio){.options = *options};
  SF_TRY(fx_scene_load(&studio->scene, options->scene));
  SF_TRY(sf_sha256_file(options->scene, studio->scene_sha256));
  if (options->steps) studio->scene.net.steps = options->steps;
  if (options->backend == SF_BACKEND_FLOAT) return open_model(studio);
  if (options->backend == SF_BACKEND_FIXED) return sf_ok();
  if (options->backend == SF_BACKEND_BOARD)
    return sf_board_open(&studio->board, options->port, options->patience, &studio->scene, options->scene);
  const sf_dut_options how = {.seed = options->seed};
  return sf_ray_dut_open(&studio->rays, &studio->scene, &how);
}

void sf_studio_close(sf_studio *studio)
{
  sf_ray_dut_close(studio->rays);
  sf_board_close(studio->board);
  sf_model_free(&studio->model);
  fx_scene_free(&studio->scene);
  *studio = (sf_studio){0};
}

sf_status sf_shot_load(const sf_studio *studio, int index, sf_shot *shot)
{
  const sf_studio_options *o = &studio->options;
  *shot = (sf_shot){.index = index, .psnr = NAN, .ssim = NAN};
  sf_dataset_options how = {.downscale = o->downscale, .scale = o->scale, .first = index, .limit = 1};
  SF_TRY(sf_fx_dataset_load(&shot->data, &studio->scene, o->scene, o->data, o->split, &how));
  if (shot->data.count == 0) return sf_ok();
  shot->view = &shot->data.view[0];
  shot->window = (sf_window){0, 0, shot->view->camera.width, shot->view->camera.height};
  if (o->backend != SF_BACKEND_FLOAT) return sf_ok();
  SF_TRY(sf_space_check(&studio->model.config.space, studio->model_path, &shot->data));
  if (studio->model.config.scale != shot->data.scale)
    return sf_fail(SF_E_RANGE, "%s: trained at scale %g, %s is read at %g; give --scale %.9g", studio->model_path,
                   (double)studio->model.config.scale, o->data, (double)shot->data.scale,
                   (double)studio->model.config.scale);
  return sf_ok();
}

/* A data set without pictures, in the space of the scene. */
static sf_status no_data(const sf_studio *studio, sf_dataset *data)
{
  const fx_units *units = &studio->scene.units;
  if (units->data_ndc > 0)
    return sf_fail(SF_E_USAGE, "%s: a forward-facing scene: its data set has to be named, for where its rays begin",
                   studio->options.scene);
  *data = (sf_dataset){.view = calloc(1, sizeof *data->view), .downscale = 1};
  if (!data->view) return sf_fail(SF_E_MEMORY, "no memory for a camera");
  data->count = 1;
  data->scale = data->own_scale = units->model_scale > 0 ? (float)units->model_scale : 1;
  return sf_ok();
}

sf_status sf_shot_from(const sf_studio *studio, const sf_camera *camera, sf_shot *shot)
{
  if (studio->options.data)
    SF_TRY(sf_shot_load(studio, 0, shot));
  else
    *shot = (sf_shot){.psnr = NAN, .ssim = NAN};
  if (!studio->options.data) SF_TRY(no_data(studio, &shot->data));
  if (shot->data.count == 0)
    return sf_fail(SF_E_FORMAT, "%s: has no %s view", studio->options.data, studio->options.split);
  sf_view *view = &shot->data.view[0];
  sf_image_free(&view->image);
  snprintf(view->name, sizeof view->name, "camera");
  view->camera = *camera;
  shot->view = view;
  shot->window = (sf_window){0, 0, camera->width, camera->height};
  return sf_ok();
}

static sf_status render(const sf_studio *studio, sf_shot *shot)
{
  const sf_golden_job job = {.scene = &studio->scene,
                             .data = &shot->data,
                             .view = shot->view,
                             .window = shot->window,
                             .kernels = studio->options.kernels,
                             .tick = studio->tick,
                             .user = studio->user};
  if (studio->options.backend == SF_BACKEND_FLOAT) return sf_golden_float(&job, &studio->model, &shot->golden);
  if (studio->options.backend == SF_BACKEND_FIXED) return sf_golden_fixed(&job, &shot->golden);
  const sf_status status = studio->board ? sf_golden_board(&job, studio->board, &shot->golden)
                                         : sf_golden_rtl(&job, studio->rays, &shot->golden);
  if (status.code != SF_E_DIFFERENCE) return status;
  return sf_fail(status.code, "%s: %s", studio->options.scene, status.message);
}

static void background_of(const sf_studio *studio, float background[3])
{
  for (int c = 0; c < 3; c++) background[c] = (float)studio->scene.background[c] / 65536;
}

sf_status sf_shot_save_truth(const sf_studio *studio, const sf_shot *shot, const char *path)
{
  float background[3];
  background_of(studio, background);
  if (!shot->view->image.rgba) return sf_fail(SF_E_FORMAT, "%s: view %s has no picture", path, shot->view->name);
  return sf_golden_save_truth(&shot->golden, &shot->view->image, shot->window.x, shot->window.y, background, path);
}

static sf_status measure(const sf_studio *studio, sf_shot *shot)
{
  float background[3];
  background_of(studio, background);
  if (!shot->view->image.rgba) return sf_ok();
  return sf_golden_quality(&shot->golden, &shot->view->image, shot->window.x, shot->window.y, background, &shot->psnr,
                           &shot->ssim);
}

sf_status sf_shot_render(const sf_studio *studio, sf_shot *shot)
{
  int planes = studio->options.backend == SF_BACKEND_FLOAT ? SF_FLOAT_PLANES : SF_PLANES;
  sf_golden_free(&shot->golden);
  SF_TRY(sf_golden_create(&shot->golden, shot->window.width, shot->window.height, planes));
  SF_TRY(render(studio, shot));
  return measure(studio, shot);
}

static sf_status take_colours(sf_shot *shot, const sf_exr_channel *channel, int n, const char *path)
{
  int found = 0;
  for (int i = 0; i < n; i++)
    for (sf_plane p = SF_PLANE_R; p <= SF_PLANE_B; p++)
      if (!strcmp(channel[i].name, sf_plane_names[p]) && channel[i].type != SF_EXR_UINT) {
        const size_t pixels = (size_t)shot->window.width * (size_t)shot->window.height;
        memcpy(shot->golden.plane[p], channel[i].data, pixels * sizeof(float));
        found++;
      }
  return found == 3 ? sf_ok() : sf_fail(SF_E_FORMAT, "%s: no channels R, G and B", path);
}

sf_status sf_shot_measure(const sf_studio *studio, sf_shot *shot, const char *path)
{
  int width, height, n;
  sf_exr_channel *channel;
  sf_golden_free(&shot->golden);
  SF_TRY(sf_golden_create(&shot->golden, shot->window.width, shot->window.height, SF_FLOAT_PLANES));
  SF_TRY(sf_exr_load(path, &width, &height, &channel, &n));
  sf_status status = sf_ok();
  if (width != shot->window.width || height != shot->window.height)
    status = sf_fail(SF_E_FORMAT, "%s: %d x %d pixels, expected %d x %d", path, width, height, shot->window.width,
                     shot->window.height);
  if (status.code == SF_OK) status = take_colours(shot, channel, n, path);
  sf_exr_free(channel, n);
  return status.code == SF_OK ? measure(studio, shot) : status;
}

sf_status sf_shot_save(const sf_studio *studio, const sf_shot *shot, const char *path)
{
  const sf_golden_label label = {.net = &studio->scene.net,
                                 .scene_sha256 = studio->scene_sha256,
                                 .view = shot->view->name,
                                 .split = studio->options.split,
                                 .window = shot->window,
                                 .downscale = shot->data.downscale,
                                 .ndc = shot->data.ndc};
  return sf_golden_save_labelled(&shot->golden, path, &label);
}

void sf_shot_free(sf_shot *shot)
{
  sf_golden_free(&shot->golden);
  sf_dataset_free(&shot->data);
  shot->view = NULL;
}

static sf_status read_number(const char **text, char stop, int *value)
{
  char *end;
  long n = strtol(*text, &end, 10);
  if (end == *text || **text < '0' || **text > '9' || *end != stop || n > 1 << 24)
    return sf_fail(SF_E_USAGE, "--crop expects X,Y,WIDTH,HEIGHT in whole pixels");
  *value = (int)n;
  *text = end + (stop != 0);
  return sf_ok();
}

sf_status sf_window_parse(const char *text, sf_window *crop)
{
  SF_TRY(read_number(&text, ',', &crop->x));
  SF_TRY(read_number(&text, ',', &crop->y));
  SF_TRY(read_number(&text, ',', &crop->width));
  SF_TRY(read_number(&text, 0, &crop->height));
  if (crop->width < 1 || crop->height < 1) return sf_fail(SF_E_USAGE, "--crop is out of range: it has no pixels");
  return sf_ok();
}
