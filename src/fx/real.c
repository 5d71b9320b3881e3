/* The one file of src/fx that may handle floating-point: a scene carries a few real numbers (units and the placement
 * of the box) for quant/ and for reports. They pass through here as text; no arithmetic of the core sees them. */
#include "src/fx/real.h"
#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { REALS = 5 + FX_LEVELS_MAX + SF_LAYERS, TENSORF_REALS = 5, OPTIONAL = 7 };

typedef struct real_field {
  const char *key;
  size_t offset;
  bool positive;
} real_field;

/* clang-format off */
#define REAL(field, positive) {#field, offsetof(fx_scene, units.field), positive}
#define TENSORF_REAL(field, positive) {"tensorf." #field, offsetof(fx_scene, units.field), positive}
/* clang-format on */
/* The scales of currents and features serve reports only: 0 where unknown. */
static const real_field reals[REALS] = {
    REAL(to_box_scale, true),       REAL(to_box_offset[0], false),  REAL(to_box_offset[1], false),
    REAL(to_box_offset[2], false),  REAL(dir_scale, true),          REAL(feature_scale[0], false),
    REAL(feature_scale[1], false),  REAL(feature_scale[2], false),  REAL(feature_scale[3], false),
    REAL(feature_scale[4], false),  REAL(feature_scale[5], false),  REAL(feature_scale[6], false),
    REAL(feature_scale[7], false),  REAL(feature_scale[8], false),  REAL(feature_scale[9], false),
    REAL(feature_scale[10], false), REAL(feature_scale[11], false), REAL(feature_scale[12], false),
    REAL(feature_scale[13], false), REAL(feature_scale[14], false), REAL(feature_scale[15], false),
    REAL(current_scale[0], false),  REAL(current_scale[1], false),  REAL(current_scale[2], false),
    REAL(current_scale[3], false),  REAL(current_scale[4], false),
};

static const real_field tensorf_reals[TENSORF_REALS] = {
    TENSORF_REAL(stretch[0], true), TENSORF_REAL(stretch[1], true), TENSORF_REAL(stretch[2], true),
    TENSORF_REAL(near, false),      TENSORF_REAL(far, true),
};

/* Not in the file when 0. */
static const real_field optional[OPTIONAL] = {REAL(model_scale, true), REAL(data_scale, true), REAL(data_bound, true),
                                              REAL(data_ndc, true),    REAL(data_views, true), REAL(data_poses, true),
                                              REAL(data_picture, true)};

/* Those of the scene's backbone. */
static int reals_of(const fx_scene *scene)
{
  return scene->backbone == FX_TENSORF ? REALS + TENSORF_REALS : REALS;
}

static const real_field *real(int i)
{
  return i < REALS ? &reals[i] : &tensorf_reals[i - REALS];
}

static double *field_of(const fx_scene *scene, const real_field *field)
{
  /* cppcheck-suppress invalidPointerCast ; offsetof a double of the same struct */
  return (double *)((char *)scene + field->offset);
}

static sf_status check_real(const fx_scene *scene, const real_field *field, const char *path)
{
  const double value = *field_of(scene, field);
  if (isfinite(value) && (!field->positive || value > 0)) return sf_ok();
  return sf_fail(SF_E_RANGE, "%s: metadata '%s' is %g, expected a finite%s number", path, field->key, value,
                 field->positive ? " positive" : "");
}

static void write_real(cJSON *metadata, const fx_scene *scene, const real_field *field)
{
  char text[64];
  snprintf(text, sizeof text, "%a", *field_of(scene, field));
  cJSON_AddStringToObject(metadata, field->key, text);
}

void fx_reals_write(cJSON *metadata, const fx_scene *scene)
{
  for (int i = 0; i < reals_of(scene); i++) write_real(metadata, scene, real(i));
  for (const real_field *o = optional; o < optional + OPTIONAL; o++)
    if (*field_of(scene, o) != 0) write_real(metadata, scene, o);
}

static sf_status read_real(const cJSON *metadata, fx_scene *scene, const real_field *field, const char *path)
{
  const char *text = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(metadata, field->key));
  char *end = NULL;
  if (!text) return sf_fail(SF_E_FORMAT, "%s: metadata '%s' is missing", path, field->key);
  *field_of(scene, field) = strtod(text, &end);
  if (end == text || *end)
    return sf_fail(SF_E_FORMAT, "%s: metadata '%s' is '%.40s', expected a number", path, field->key, text);
  return sf_ok();
}

sf_status fx_reals_read(const cJSON *metadata, fx_scene *scene, const char *path)
{
  for (int i = 0; i < reals_of(scene); i++) SF_TRY(read_real(metadata, scene, real(i), path));
  for (const real_field *o = optional; o < optional + OPTIONAL; o++) {
    if (!cJSON_HasObjectItem(metadata, o->key)) continue;
    SF_TRY(read_real(metadata, scene, o, path));
    SF_TRY(check_real(scene, o, path));
  }
  return fx_reals_check(scene, path);
}

/* The direction features are shifted into place: sh.c. */
static bool is_direction_lsb(double value)
{
  int exponent;
  return frexp(value, &exponent) == 0.5 && exponent <= 1 && exponent > -FX_DIR_FRAC_MAX;
}

sf_status fx_reals_check(const fx_scene *scene, const char *path)
{
  for (int i = 0; i < reals_of(scene); i++) SF_TRY(check_real(scene, real(i), path));
  for (const real_field *o = optional; o < optional + OPTIONAL; o++)
    if (*field_of(scene, o) != 0) SF_TRY(check_real(scene, o, path));
  if (!is_direction_lsb(scene->units.dir_scale))
    return sf_fail(SF_E_RANGE, "%s: metadata 'dir_scale' is %g, expected a power of two, 2^-%d to 1", path,
                   scene->units.dir_scale, FX_DIR_FRAC_MAX);
  const double near = scene->units.near, far = scene->units.far;
  if (scene->backbone == FX_TENSORF && !(near >= 0 && near < far))
    return sf_fail(SF_E_RANGE, "%s: metadata 'tensorf.near' is %g and 'tensorf.far' %g, expected 0 <= near < far", path,
                   near, far);
  return sf_ok();
}
