#include "src/fx/round.h"
#include "src/fx/check.h"
#include "src/fx/check_tensorf.h"
#include "src/fx/range.h"
#include "src/fx/real.h"
#include "src/fx/unit.h"
#include "src/fx/nofloat.h"

enum { ENTRIES_MAX = 1 << 28, HASH_BITS_MAX = 27, OCCUPANCY_MAX = 256, SAMPLES_MAX = 1024 };
enum { BOUND_LOG2_MAX = 6, GAMMA_MAX = 1 << 21, NEAR_MAX = 1 << 30 };

static sf_status inputs(const fx_layer *layer, int id, const char *path, int low, int high)
{
  return in_range(path, fx_layer_name(id), "n_in", layer[id].n_in, low, high);
}

static sf_status outputs(const fx_layer *layer, int id, const char *path, int low, int high)
{
  return in_range(path, fx_layer_name(id), "n_out", layer[id].n_out, low, high);
}

/* A decoder has no D1 and D2; the inputs of C1 are as many as the sum of its current has bits for. */
static sf_status check_inputs(const fx_net *net, const char *path)
{
  const fx_layer *l = net->layer;
  const bool decodes = fx_net_decodes(net);
  const int n_h = l[FX_D2].n_out - 1;
  SF_TRY(inputs(l, FX_D1, path, decodes ? 0 : 2, decodes ? 0 : SF_FEATURE_MAX));
  SF_TRY(outputs(l, FX_D1, path, 0, SF_LANES));
  SF_TRY(inputs(l, FX_D2, path, l[FX_D1].n_out, l[FX_D1].n_out));
  SF_TRY(outputs(l, FX_D2, path, !decodes, decodes ? 0 : SF_OUT_MAX));
  if (decodes) return inputs(l, FX_C1, path, 1, SF_DIR_MAX);
  return inputs(l, FX_C1, path, n_h > 0 ? n_h : 1, n_h + FX_SH);
}

static sf_status check_chain(const fx_net *net, const char *path)
{
  static const int bias_max[SF_LAYERS] = {[FX_C1] = FX_INPUT_MAX, [FX_C2] = 1, [FX_C3] = 1};
  const fx_layer *l = net->layer;
  SF_TRY(check_inputs(net, path));
  for (int id = 0; id < SF_LAYERS; id++) SF_TRY(in_range(path, fx_layer_name(id), "bias", l[id].bias, 0, bias_max[id]));
  SF_TRY(outputs(l, FX_C1, path, 1, SF_LANES));
  SF_TRY(inputs(l, FX_C2, path, l[FX_C1].n_out, l[FX_C1].n_out));
  SF_TRY(outputs(l, FX_C2, path, 1, SF_LANES));
  SF_TRY(inputs(l, FX_C3, path, l[FX_C2].n_out, l[FX_C2].n_out));
  return outputs(l, FX_C3, path, 3, 3);
}

/* The farthest cell corner of a dense level must lie inside it; a level must end before the next one begins. */
static sf_status check_level(const fx_grid *grid, int i, const char *path)
{
  char owner[32] = "grid.level";
  const int64_t end = i + 1 < grid->levels ? grid->offset[i + 1] : grid->entries;
  owner[10] = (char)('0' + i / 10), owner[11] = (char)('0' + i % 10);
  SF_TRY(in_range(path, owner, "scale_q16", grid->scale_q16[i], 1, INT32_MAX));
  SF_TRY(in_range(path, owner, "shift", grid->shift[i], 0, 31));
  SF_TRY(in_range(path, owner, "stride", grid->stride[i], 0, 600));
  SF_TRY(in_range(path, owner, "offset", grid->offset[i], 0, grid->entries));
  if (!grid->stride[i]) {
    SF_TRY(in_range(path, owner, "log2_size", grid->log2_size[i], 0, HASH_BITS_MAX));
    return in_range(path, owner, "entries", end - grid->offset[i], (int64_t)1 << grid->log2_size[i], ENTRIES_MAX);
  }
  const int64_t stride = grid->stride[i];
  const int64_t far_q8 = fx_rshift_round((((int64_t)1 << SF_POS_FRAC) - 1) * grid->scale_q16[i], 32) + 128;
  SF_TRY(in_range(path, owner, "stride", stride, (far_q8 >> 8) + 2, 600));
  return in_range(path, owner, "entries", end - grid->offset[i], stride * stride * stride, ENTRIES_MAX);
}

static sf_status check_grid(const fx_grid *grid, int n_feature, const char *path)
{
  SF_TRY(in_range(path, "grid", "levels", grid->levels, 1, FX_LEVELS_MAX));
  SF_TRY(in_range(path, fx_layer_name(FX_D1), "n_in", n_feature, grid->levels * FX_GRID_FEATURES,
                  grid->levels * FX_GRID_FEATURES));
  SF_TRY(in_range(path, "grid", "entries", grid->entries, 1, ENTRIES_MAX));
  SF_TRY(in_range(path, "grid.level00", "offset", grid->offset[0], 0, 0));
  for (int i = 0; i < grid->levels; i++) SF_TRY(check_level(grid, i, path));
  return sf_ok();
}

/* What holds the field of the scene. A decoder without one is a net for fx_net_*: there are no rays through it. */
static sf_status check_field(const fx_scene *scene, const char *path)
{
  const fx_layer *layer = scene->net.layer;
  SF_TRY(in_range(path, "scene", "backbone", scene->backbone, FX_INGP, FX_TENSORF));
  if (scene->backbone == FX_INGP && !fx_net_decodes(&scene->net))
    return check_grid(&scene->grid, layer[FX_D1].n_in, path);
  SF_TRY(in_range(path, "grid", "levels", scene->grid.levels, 0, 0));
  if (scene->backbone == FX_INGP) return sf_ok();
  SF_TRY(outputs(layer, FX_D1, path, 0, 0));
  return fx_check_tensorf_sizes(&scene->tensorf, layer[FX_C1].n_in, path);
}

/* What the cascades and the table of steps are made from. */
static sf_status check_steps(const fx_scene *scene, const char *path)
{
  const bool ingp = scene->backbone == FX_INGP; /* TensoRF's fields have one box and equal steps */
  SF_TRY(in_range(path, "scene", "log2_bound", scene->log2_bound, 0, ingp ? BOUND_LOG2_MAX : 0));
  SF_TRY(in_range(path, "scene", "gamma_q24", scene->gamma_q24, 0, ingp ? GAMMA_MAX : 0));
  if (!scene->gamma_q24) return sf_ok();
  SF_TRY(in_range(path, "scene", "step_q24", scene->step_q24, 1, 1 << SF_DELTA_FRAC));
  SF_TRY(in_range(path, "scene", "near_q16", scene->near_q16, 0, NEAR_MAX));
  const int64_t diagonal = ((int64_t)29058991 << 16) / scene->step_q24; /* sqrt(3) in Q24: no step is longer */
  return in_range(path, "scene", "longest_q16", scene->longest_q16, 1 << 16,
                  diagonal < INT32_MAX ? diagonal : INT32_MAX);
}

sf_status fx_check_sizes(const fx_scene *scene, const char *path)
{
  SF_TRY(check_chain(&scene->net, path));
  SF_TRY(check_field(scene, path));
  SF_TRY(in_range(path, "scene", "occ_res", scene->occ_res, 2, OCCUPANCY_MAX));
  if (scene->occ_res & (scene->occ_res - 1))
    return sf_fail(SF_E_RANGE, "%s: scene.occ_res is %d, expected a power of two", path, scene->occ_res);
  return check_steps(scene, path);
}

static sf_status check_weights(const fx_layer *layer, const char *tensor, const char *path)
{
  if (!layer->w) return sf_fail(SF_E_FORMAT, "%s: tensor '%s' is missing", path, tensor);
  for (int i = 0; i < fx_layer_rows(layer); i++)
    for (int o = 0; o < SF_LANES; o++) {
      const int8_t w = layer->w[(size_t)i * SF_LANES + o];
      if (w == INT8_MIN)
        return sf_fail(SF_E_RANGE, "%s: tensor '%s'[%d][%d] is -128, expected -127..127", path, tensor, i, o);
      if (o >= layer->n_out && w)
        return sf_fail(SF_E_RANGE, "%s: tensor '%s'[%d][%d] is %d, expected 0: the layer has %d outputs", path, tensor,
                       i, o, w, layer->n_out);
    }
  return sf_ok();
}

int fx_largest_h(const fx_layer *d2)
{
  int largest = 0;
  for (int o = 1; o < d2->n_out; o++) {
    int positive = 0, negative = 0;
    for (int i = 0; i < d2->n_in; i++) {
      const int w = d2->w[(size_t)i * SF_LANES + (size_t)o];
      *(w > 0 ? &positive : &negative) += w;
    }
    if (largest < positive >> SF_H_SHIFT) largest = positive >> SF_H_SHIFT;
    if (largest < -(negative >> SF_H_SHIFT)) largest = -(negative >> SF_H_SHIFT);
  }
  return largest;
}

/* Of radix, a membrane at its upper rail must fire again at the next step: fx/plif.c. */
static sf_status check_layer(const fx_layer *layer, int id, int mode, const char *path)
{
  const int highest = mode == FX_RADIX ? FX_MEMBRANE_MAX / 2 : FX_MEMBRANE_MAX;
  const bool spiking = fx_layer_fires(id) && layer->n_out > 0;
  SF_TRY(in_range(path, fx_layer_name(id), "k", layer->k, 0, FX_LEAK_ONE));
  SF_TRY(in_range(path, fx_layer_name(id), "theta", layer->theta, spiking, spiking ? highest : 0));
  return check_weights(layer, fx_layer_table[id].tensor, path);
}

static sf_status check_scale(const fx_scale *scale, const char *name, int bias_low, int bias_high, const char *path)
{
  SF_TRY(in_range(path, name, "mul", scale->mul, 0, 65535));
  SF_TRY(in_range(path, name, "shift", scale->shift, 0, 31));
  return in_range(path, name, "bias", scale->bias, bias_low, bias_high);
}

static sf_status check_net(const fx_net *net, const char *path)
{
  const int bias = 1 << (FX_EXP2_BITS - 1);
  SF_TRY(in_range(path, "net", "mode", net->mode, FX_HYBRID, FX_RADIX));
  SF_TRY(in_range(path, "net", "t_r", net->steps, 1, SF_T_MAX));
  SF_TRY(check_scale(&net->exp_in, "exp_in", -bias, bias - 1, path));
  SF_TRY(check_scale(&net->sigmoid_in, "sigmoid_in", 0, 0, path));
  for (int id = 0; id < SF_LAYERS; id++) SF_TRY(check_layer(&net->layer[id], id, net->mode, path));
  return in_range(path, fx_layer_name(FX_D2), "largest h", fx_largest_h(&net->layer[FX_D2]), 0, FX_INPUT_MAX);
}

sf_status fx_scene_check(const fx_scene *scene, const char *path)
{
  SF_TRY(fx_check_sizes(scene, path));
  SF_TRY(check_net(&scene->net, path));
  if (scene->backbone == FX_TENSORF)
    SF_TRY(fx_check_tensorf(&scene->tensorf, path));
  else if (!scene->grid.table)
    return sf_fail(SF_E_FORMAT, "%s: tensor 'grid.table' is missing", path);
  if (!scene->occupancy) return sf_fail(SF_E_FORMAT, "%s: tensor 'occupancy' is missing", path);
  SF_TRY(in_range(path, "scene", "step_q24", scene->step_q24, 1, 1 << SF_DELTA_FRAC));
  SF_TRY(in_range(path, "scene", "max_samples", scene->max_samples, 1, SAMPLES_MAX));
  SF_TRY(in_range(path, "scene", "trans_stop", scene->trans_stop, 0, FX_TRANS_ONE - 1));
  for (int o = 0; o < 3; o++) {
    const char *const field[] = {"background[0]", "background[1]", "background[2]"};
    SF_TRY(in_range(path, "scene", field[o], scene->background[o], 0, 1 << 16));
  }
  return fx_reals_check(scene, path);
}
