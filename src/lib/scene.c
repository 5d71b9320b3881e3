/* Opening, closing and describing a scene. */
#include "src/lib/internal.h"
#include "fx/scene.h"
#include <locale.h>
#include <stdlib.h>
#include <string.h>

_Static_assert((int)SPIKEFIELD_RADIX == (int)FX_RADIX, "fx_input_mode and spikefield_mode differ");

typedef struct source {
  const char *name;
  const void *data; /* NULL: `name` is a file */
  size_t size;
} source;

/* The host program may have chosen a locale that writes 0,5; the numbers of a file are the C locale's. */
static sf_status load(fx_scene *scene, const source *from)
{
  locale_t plain = newlocale(LC_ALL_MASK, "C", (locale_t)0);
  if (!plain) return sf_fail(SF_E_MEMORY, "%s: no memory for a locale", from->name);
  locale_t old = uselocale(plain);
  const sf_status status =
      from->data ? fx_scene_load_memory(scene, from->data, from->size, from->name) : fx_scene_load(scene, from->name);
  uselocale(old);
  freelocale(plain);
  return status;
}

static sf_status open_scene(spikefield_scene **scene, const source *from)
{
  *scene = NULL;
  spikefield_scene *made = malloc(sizeof *made);
  if (!made) return sf_fail(SF_E_MEMORY, "%s: no memory for a scene", from->name);
  const sf_status status = load(&made->fx, from);
  if (status.code == SF_OK)
    *scene = made;
  else
    free(made);
  return status;
}

static sf_status open_file(spikefield_scene **scene, const char *path)
{
  LIB_REQUIRE(scene);
  *scene = NULL;
  LIB_REQUIRE(path);
  return open_scene(scene, &(source){.name = path});
}

static sf_status open_memory(spikefield_scene **scene, const void *data, size_t size, const char *name)
{
  LIB_REQUIRE(scene);
  *scene = NULL;
  LIB_REQUIRE(data);
  return open_scene(scene, &(source){.name = name ? name : "memory", .data = data, .size = size});
}

spikefield_status spikefield_scene_open(spikefield_scene **scene, const char *path)
{
  return lib_status(open_file(scene, path));
}

spikefield_status spikefield_scene_open_memory(spikefield_scene **scene, const void *data, size_t size,
                                               const char *name)
{
  return lib_status(open_memory(scene, data, size, name));
}

void spikefield_scene_close(spikefield_scene *scene)
{
  if (!scene) return;
  fx_scene_free(&scene->fx);
  free(scene);
}

static void describe_net(const fx_net *net, spikefield_scene_info *info)
{
  for (int l = 0; l < SF_LAYERS; l++) {
    const fx_layer *layer = &net->layer[l];
    info->inputs[l] = layer->n_in, info->outputs[l] = layer->n_out;
    info->theta[l] = fx_net_theta(net, l), info->leak_q12[l] = layer->k;
    info->weight_bytes += (int64_t)fx_layer_rows(layer) * layer->n_out;
  }
  info->mode = (spikefield_mode)net->mode, info->steps = net->steps;
  info->features = fx_net_inputs(net);
  info->directions = fx_net_harmonics(net);
}

static sf_status describe(const spikefield_scene *scene, spikefield_scene_info *info)
{
  LIB_REQUIRE(scene);
  LIB_REQUIRE(info);
  const fx_scene *fx = &scene->fx;
  memset(info, 0, sizeof *info);
  describe_net(&fx->net, info);
  info->grid_levels = fx->grid.levels, info->grid_entries = fx->grid.entries;
  info->grid_bytes = fx->backbone == FX_TENSORF ? fx_tensorf_bytes(&fx->tensorf) : fx->grid.entries * FX_GRID_FEATURES;
  info->occupancy_res = fx->occ_res, info->occupancy_bytes = (int64_t)fx_occupancy_bytes(fx);
  info->max_samples = fx->max_samples, info->step_q24 = fx->step_q24;
  memcpy(info->background_q16, fx->background, sizeof info->background_q16);
  info->to_box_scale = fx->units.to_box_scale, info->direction_lsb = fx->units.dir_scale;
  memcpy(info->to_box_offset, fx->units.to_box_offset, sizeof info->to_box_offset);
  for (int a = 0; a < 3; a++) info->stretch[a] = fx->backbone == FX_TENSORF ? fx->units.stretch[a] : 1;
  info->step = (double)fx->step_q24 / (1 << SF_DELTA_FRAC) / fx->units.to_box_scale;
  return sf_ok();
}

spikefield_status spikefield_scene_describe(const spikefield_scene *scene, spikefield_scene_info *info)
{
  return lib_status(describe(scene, info));
}

sf_status lib_view(const spikefield_scene *scene, const spikefield_options *options, fx_scene *view)
{
  LIB_REQUIRE(scene);
  *view = scene->fx;
  if (!options) return sf_ok();
  if (options->steps < 0 || options->steps > SPIKEFIELD_STEPS_MAX)
    return sf_fail(SF_E_RANGE, "options: steps is %d, expected 0..%d", options->steps, SPIKEFIELD_STEPS_MAX);
  if (options->steps) view->net.steps = options->steps;
  return sf_ok();
}
