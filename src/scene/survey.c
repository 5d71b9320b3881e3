/* What looks wrong with the cameras and pictures of a data set, without a model of the scene. */
#include "src/scene/capture.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static double median(double *value, int n)
{
  qsort(value, (size_t)n, sizeof *value, sf_ascending);
  return value[n / 2];
}

/* Names the first of the views found, and says how many they are. */
typedef struct finding {
  int count;
  const sf_view *first;
  double value; /* of the first */
} finding;

static void find(finding *f, const sf_view *view, double value)
{
  if (!f->count++) f->first = view, f->value = value;
}

/* ---- pictures ---- */

/* Stops of light off the middle one; 4 deviations of a normal distribution, and at least a factor 1.5. */
static sf_status survey_exposure(sf_dataset *data, double *space)
{
  finding f = {0};
  const double dark = 1e-3;
  for (int i = 0; i < data->count; i++) space[i] = log2(fmax((double)data->view[i].brightness, dark));
  const double middle = median(space, data->count);
  for (int i = 0; i < data->count; i++) space[i] = fabs(space[i] - middle);
  const double limit = fmax(4 * 1.4826 * median(space, data->count), log2(1.5));
  for (int i = 0; i < data->count; i++) {
    const double stops = log2(fmax((double)data->view[i].brightness, dark)) - middle;
    if (fabs(stops) > limit) find(&f, &data->view[i], stops);
  }
  if (!f.count) return sf_ok();
  return sf_warn(data, "exposure: %d of %d pictures are unlike the others, the first is %s: %+.1f stops", f.count,
                 data->count, f.first->name, f.value);
}

/* ---- cameras ---- */

static sf_status survey_focal(sf_dataset *data, double *space)
{
  finding odd = {0}, wide = {0}, skew = {0}, off = {0};
  for (int i = 0; i < data->count; i++) {
    const sf_camera *c = &data->view[i].camera;
    space[i] = (double)c->fx / c->width;
  }
  const double middle = median(space, data->count);
  for (int i = 0; i < data->count; i++) {
    const sf_view *view = &data->view[i];
    const sf_camera *c = &view->camera;
    const double degrees = 2 * atan(0.5 * c->width / (double)c->fx) * 180 / M_PI, ratio = (double)(c->fx / c->fy);
    const double shift = fmax(fabs((double)c->cx / c->width - 0.5), fabs((double)c->cy / c->height - 0.5));
    if (fabs(log2((double)c->fx / c->width / middle)) > 1) find(&odd, view, (double)c->fx);
    if (degrees < 5 || degrees > 130) find(&wide, view, degrees);
    if (fabs(ratio - 1) > 0.05) find(&skew, view, ratio);
    if (shift > 0.2) find(&off, view, 100 * shift);
  }
  if (odd.count)
    SF_TRY(sf_warn(data, "focal length: %d views are more than a factor 2 off the middle one, the first is %s: %.1f px",
                   odd.count, odd.first->name, odd.value));
  if (wide.count)
    SF_TRY(sf_warn(data, "field of view: %.0f degrees in %s (%d views)", wide.value, wide.first->name, wide.count));
  if (skew.count)
    SF_TRY(sf_warn(data, "focal length: fx / fy is %.3f in %s (%d views): were the pictures stretched?", skew.value,
                   skew.first->name, skew.count));
  if (off.count)
    SF_TRY(sf_warn(data, "optical centre: %.0f %% of the picture off its middle in %s (%d views)", off.value,
                   off.first->name, off.count));
  return sf_ok();
}

static double gap(const sf_view *a, const sf_view *b, int column)
{
  double sum = 0;
  for (int i = 0; i < 3; i++) {
    const double d = (double)a->camera.to_world[4 * i + column] - (double)b->camera.to_world[4 * i + column];
    sum += d * d;
  }
  return sqrt(sum);
}

static sf_status survey_positions(sf_dataset *data, double *space)
{
  finding far = {0}, same = {0};
  const sf_view *twin = NULL;
  double middle[3], spread;
  for (int k = 0; k < 3; k++) {
    for (int i = 0; i < data->count; i++) space[i] = (double)data->view[i].camera.to_world[4 * k + 3];
    middle[k] = median(space, data->count);
  }
  sf_view centre = {.camera.to_world = {[3] = (float)middle[0], [7] = (float)middle[1], [11] = (float)middle[2]}};
  for (int i = 0; i < data->count; i++) space[i] = gap(&data->view[i], &centre, 3);
  spread = median(space, data->count);
  for (int i = 0; i < data->count; i++) {
    const sf_view *view = &data->view[i];
    const double away = gap(view, &centre, 3) / fmax(spread, 1e-9);
    if (away > 6) find(&far, view, away);
    for (int k = 0; k < i; k++) {
      if (gap(view, &data->view[k], 3) > 1e-5 * spread || gap(view, &data->view[k], 2) > 1e-4 ||
          gap(view, &data->view[k], 0) > 1e-4)
        continue;
      if (!same.count) twin = &data->view[k];
      find(&same, view, 0);
      break;
    }
  }
  if (far.count)
    SF_TRY(sf_warn(data, "position: %d views are far outside, the first is %s: %.0f times the middle distance",
                   far.count, far.first->name, far.value));
  if (same.count && data->count > 1)
    SF_TRY(sf_warn(data, "pose: %d views have the pose of another, the first is %s: that of %s", same.count,
                   same.first->name, twin->name));
  return sf_ok();
}

/* ---- the box ---- */

/* A quarter of the views show more than the value that decides: what only some of them show is cut off, too. What fills
 * less of the box, or of its finest part, [-1, 1]^3, has few cells and samples, and may be nearer to a camera than
 * SF_NEAR. */
sf_status sf_dataset_survey_box(sf_dataset *data, double half)
{
  const double quarter = 0.75, least = 0.15 * fmin(half, 1), room = 0.85;
  int n = 0;
  double *space = malloc((size_t)data->count * sizeof *space + 1);
  if (!space) return sf_fail(SF_E_MEMORY, "%s: no memory for %d views", data->path, data->count);
  for (int i = 0; i < data->count; i++)
    if (data->view[i].shown > 0) space[n++] = (double)data->view[i].shown;
  qsort(space, (size_t)n, sizeof *space, sf_ascending);
  const double shown = n ? space[(int)(quarter * (n - 1))] : half;
  free(space);
  if (shown <= half && shown >= least) return sf_ok();
  const double better = room * (double)data->scale * (shown > half ? half : fmin(half, 1)) / shown;
  if (shown > half)
    return sf_warn(data,
                   "box: the pictures show what lies beyond [-%g, %g]^3: it would have to reach to %.3g. Try --scale "
                   "%.2g (now %.3g), or a larger --bound",
                   half, half, shown, better, (double)data->scale);
  return sf_warn(
      data, "box: what the pictures show lies within %.2g of the middle of [-%g, %g]^3. Try --scale %.2g (now %.3g)",
      shown, half, half, better, (double)data->scale);
}

sf_status sf_dataset_survey(sf_dataset *data)
{
  if (data->count < 1) return sf_ok();
  double *space = malloc((size_t)data->count * sizeof *space);
  if (!space) return sf_fail(SF_E_MEMORY, "%s: no memory for %d views", data->path, data->count);
  sf_status status = survey_exposure(data, space);
  if (status.code == SF_OK) status = survey_focal(data, space);
  if (status.code == SF_OK) status = survey_positions(data, space);
  free(space);
  return status.code || data->ndc ? status : sf_dataset_survey_box(data, data->bound);
}
