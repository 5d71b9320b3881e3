/* TensoRF's planes and lines as a field: they give the density, and a colour decoder reads the rest. tensorf.c is their
 * oracle. */
#include "field/field.h"
#include <string.h>

static sf_status check(const sf_config *c)
{
  if (c->bound != 1 || c->dt_gamma > 0)
    return sf_fail(SF_E_RANGE, "model config: bound = %d and dt_gamma = %g with TensoRF, expected 1 and 0", c->bound,
                   (double)c->dt_gamma);
  return sf_tensorf_check(&c->tensorf);
}

static int inputs(const sf_config *config)
{
  return sf_tensorf_inputs(&config->tensorf);
}

static void lay_out(sf_model *m, sf_param param[SF_P_COUNT])
{
  static const char *const name[4][3] = {{"density_plane.0", "density_plane.1", "density_plane.2"},
                                         {"density_line.0", "density_line.1", "density_line.2"},
                                         {"app_plane.0", "app_plane.1", "app_plane.2"},
                                         {"app_line.0", "app_line.1", "app_line.2"}};
  const sf_tensorf *f = &m->config.tensorf;
  param[SF_P_BASIS] = (sf_param){.name = "basis_mat.weight", .shape = {f->features, sf_tensorf_products(f)}, .dims = 2};
  for (int i = 0; i < 3; i++) {
    const int *axis = sf_tensorf_axis[i];
    const int64_t width = f->resolution[axis[0]], height = f->resolution[axis[1]], length = f->resolution[axis[2]];
    for (int k = 0; k < 2; k++) {
      const int64_t channels = k ? f->appearance[i] : f->density[i];
      param[SF_P_DENSITY_PLANE + 6 * k + i] =
          (sf_param){.name = name[2 * k][i], .shape = {height, width, channels}, .dims = 3};
      param[SF_P_DENSITY_LINE + 6 * k + i] =
          (sf_param){.name = name[2 * k + 1][i], .shape = {length, channels}, .dims = 2};
    }
  }
}

static sf_status steps(sf_steps *s, const sf_config *config, int stride)
{
  sf_steps_equal(s, &config->tensorf, stride);
  return sf_ok();
}

static int numbers(sf_config *config, sf_number number[SF_NUMBERS_MAX])
{
  sf_tensorf *t = &config->tensorf;
  const sf_number table[] = {{"ndc", .integer = &t->ndc},
                             {"box_min_x", .number = &t->box[0][0]},
                             {"box_min_y", .number = &t->box[0][1]},
                             {"box_min_z", .number = &t->box[0][2]},
                             {"box_max_x", .number = &t->box[1][0]},
                             {"box_max_y", .number = &t->box[1][1]},
                             {"box_max_z", .number = &t->box[1][2]},
                             {"resolution_x", .integer = &t->resolution[0]},
                             {"resolution_y", .integer = &t->resolution[1]},
                             {"resolution_z", .integer = &t->resolution[2]},
                             {"density_0", .integer = &t->density[0]},
                             {"density_1", .integer = &t->density[1]},
                             {"density_2", .integer = &t->density[2]},
                             {"appearance_0", .integer = &t->appearance[0]},
                             {"appearance_1", .integer = &t->appearance[1]},
                             {"appearance_2", .integer = &t->appearance[2]},
                             {"features", .integer = &t->features},
                             {"feature_freqs", .integer = &t->feature_freqs},
                             {"view_freqs", .integer = &t->view_freqs},
                             {"activation", .integer = &t->activation},
                             {"density_shift", .number = &t->shift},
                             {"distance_scale", .number = &t->distance_scale},
                             {"step_ratio", .number = &t->step_ratio},
                             {"near", .number = &t->near},
                             {"far", .number = &t->far}};
  _Static_assert(sizeof table / sizeof *table <= SF_NUMBERS_MAX, "numbers of a field");
  memcpy(number, table, sizeof table);
  return sizeof table / sizeof *table;
}

const sf_field sf_field_planes = {
    .name = "tensorf",
    .weights = {NULL, NULL, "renderModule.mlp.0.weight", "renderModule.mlp.2.weight", "renderModule.mlp.4.weight"},
    .bias = {NULL, NULL, "renderModule.mlp.0.bias", "renderModule.mlp.2.bias", "renderModule.mlp.4.bias"},
    .scales = SF_SCALES,
    .check = check,
    .inputs = inputs,
    .lay_out = lay_out,
    .steps = steps,
    .numbers = numbers};
