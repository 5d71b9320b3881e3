/* The data of a scene: read as the scene was trained, and refused where it is another scene's. */
#include "quant/quant.h"
#include <math.h>

static bool is_tensorf(const fx_scene *scene)
{
  return scene->backbone == FX_TENSORF;
}

/* What an older file without a record still tells. TensoRF's rays in NDC, and no others, begin at 0 and have no end. */
static sf_status check_unrecorded(const fx_scene *scene, const char *name, sf_dataset *data)
{
  const float scale = (float)scene->units.model_scale;
  const int bound = is_tensorf(scene) ? data->bound : 1 << scene->log2_bound;
  const sf_space ndc = {
      .scale = data->own_scale, .bound = data->bound, .ndc = scene->units.near == 0 && scene->units.far >= 1e5};
  if (is_tensorf(scene)) SF_TRY(sf_space_check(&ndc, name, data));
  if (!(scale > 0)) return sf_ok();
  if (fabsf(scale - data->own_scale) <= 0.01f * scale && bound == data->bound) return sf_ok();
  return sf_warn(data,
                 "%s: trained at scale %.4g and bound %d, %s has scale %.4g and bound %d: is this the "
                 "data that it learned from?",
                 name, (double)scale, bound, data->list, (double)data->own_scale, data->bound);
}

/* A file may hold any number. */
static int32_t whole(double number)
{
  return number >= 1 && number <= 1e9 ? (int32_t)number : 0;
}

static sf_status check_space(const fx_scene *scene, const char *name, sf_dataset *data)
{
  const fx_units *units = &scene->units;
  const sf_space learned = {.scale = (float)units->data_scale,
                            .bound = whole(units->data_bound),
                            .ndc = whole(units->data_ndc),
                            .views = whole(units->data_views),
                            .poses = whole(units->data_poses),
                            .picture = whole(units->data_picture)};
  return learned.scale > 0 ? sf_space_check(&learned, name, data) : check_unrecorded(scene, name, data);
}

sf_status sf_fx_dataset_load(sf_dataset *data, const fx_scene *scene, const char *name, const char *dir,
                             const char *split, const sf_dataset_options *options)
{
  const float scale = (float)scene->units.model_scale;
  sf_dataset_options how = *options;
  *data = (sf_dataset){0};
  if (scale > 0 && how.scale != 0 && how.scale != scale)
    return sf_fail(SF_E_RANGE, "%s: trained at scale %g, %s is to be read at %g; give --scale %.9g or none", name,
                   (double)scale, dir, (double)how.scale, (double)scale);
  if (scale > 0) how.scale = scale;
  SF_TRY(sf_dataset_load(data, dir, split, &how));
  const sf_status status = check_space(scene, name, data);
  if (status.code) sf_dataset_free(data);
  return status;
}
