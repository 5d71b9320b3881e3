/* TensoRF's field with fewer components, features and sines, on fewer points, in a smaller box. */
#include "fx/cache.h"
#include "fx/tensorf.h"
#include "src/quant/internal.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { POWER_SHIFT = 12 };

static sf_status use_create(sf_trim_use *use, const fx_scene *scene)
{
  (void)use, (void)scene;
  return sf_ok();
}

static void use_product(sf_trim_use *use, sf_factors_id which, int pair, int c, int64_t product, uint32_t weight)
{
  const uint64_t power = (uint64_t)(product * product) * (weight >> POWER_SHIFT);
  if (!product) return;
#pragma omp atomic
  use->component[which][pair][c] += 1;
  if (!power) return;
#pragma omp atomic
  use->power[which][pair][c] += power;
}

void sf_trim_use_factors(sf_trim_use *use, const fx_tensorf *field, sf_factors_id which, const uint32_t pos[3],
                         uint32_t weight)
{
  const fx_factors *factors = sf_factors_of(field, which);
  int32_t exact[FX_PAIRS * FX_COMPONENTS_MAX];
  int16_t rounded[FX_PAIRS * FX_COMPONENTS_MAX];
  const bool density = which == SF_OF_DENSITY;
  if (density)
    fx_tensorf_density_products(field, pos, exact);
  else
    fx_tensorf_products(field, pos, rounded);
  for (int pair = 0, n = 0; pair < FX_PAIRS; pair++)
    for (int c = 0; c < factors->components[pair]; c++, n++) {
      const int64_t power_of = density ? exact[n] >> 15 : rounded[n];
      use_product(use, which, pair, c, density && exact[n] && !power_of ? 1 : power_of, weight);
    }
}

/* ---- what stays ---- */

static void all(const fx_scene *scene, sf_trim *trim)
{
  const fx_tensorf *field = &scene->tensorf;
  sf_trim_planes *p = &trim->planes;
  for (int which = 0; which < SF_FACTORS; which++)
    for (int pair = 0; pair < FX_PAIRS; pair++)
      for (int c = 0; c < sf_factors_of(field, which)->components[pair]; c++) p->component[which][pair][c] = true;
  for (int f = 0; f < field->features; f++) p->feature[f] = true;
  p->feature_freqs = field->feature_freqs, p->view_freqs = field->view_freqs;
  for (int axis = 0; axis < 3; axis++) p->high[axis] = field->res[axis] - 1, p->points[axis] = field->res[axis];
  p->stride_q16 = SF_STRIDE_ONE;
  p->weight_stop = field->weight_stop;
}

/* What a decoder's input is made of: a feature, or an axis; the order of a sine, or -1. */
typedef struct origin {
  int feature, axis, order;
} origin;

static origin origin_of(const fx_tensorf *f, int i)
{
  const int n = f->features, own = n * f->feature_freqs;
  if (i < n) return (origin){i, -1, -1};
  if ((i -= n) < 3) return (origin){-1, i, -1};
  if ((i -= 3) < 2 * own) return (origin){i % own / f->feature_freqs, -1, i % f->feature_freqs};
  i -= 2 * own;
  return (origin){-1, i % (3 * f->view_freqs) / f->view_freqs, i % f->view_freqs};
}

static bool input_stays(const fx_tensorf *field, const sf_trim_planes *p, int i)
{
  const origin from = origin_of(field, i);
  if (from.axis >= 0) return from.order < p->view_freqs;
  return p->feature[from.feature] && from.order < p->feature_freqs;
}

/* Whether a weight of an input that stays and that `of` describes (-1: any) is not 0. */
static bool inputs_matter(const fx_scene *scene, const sf_trim *trim, origin of)
{
  for (int i = 0; i < scene->net.layer[FX_C1].n_in; i++) {
    const origin from = origin_of(&scene->tensorf, i);
    const bool meant = (of.feature < 0 ? (from.feature >= 0) == (of.axis < 0) : from.feature == of.feature) &&
                       (of.order < 0 || from.order == of.order);
    if (meant && input_stays(&scene->tensorf, &trim->planes, i) &&
        sf_row_matters(&scene->net.layer[FX_C1], i, trim->neuron[FX_C1]))
      return true;
  }
  return false;
}

static void drop_inputs(const fx_scene *scene, sf_trim *trim)
{
  sf_trim_planes *p = &trim->planes;
  while (p->feature_freqs && !inputs_matter(scene, trim, (origin){-1, -1, p->feature_freqs - 1})) p->feature_freqs--;
  while (p->view_freqs && !inputs_matter(scene, trim, (origin){-1, 0, p->view_freqs - 1})) p->view_freqs--;
  for (int f = 0; f < scene->tensorf.features; f++)
    if (sf_count_kept(p->feature, FX_APPEARANCE_MAX) > 1 && !inputs_matter(scene, trim, (origin){f, -1, -1}))
      p->feature[f] = false;
}

static double basis_power(const fx_tensorf *field, const sf_trim_planes *p, int row)
{
  double sum = 0;
  for (int f = 0; f < field->features; f++) {
    const double w = field->basis[(size_t)row * FX_APPEARANCE_MAX + (size_t)f];
    sum += p->feature[f] ? w * w : 0;
  }
  return sum;
}

static void exact(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim)
{
  const fx_tensorf *field = &scene->tensorf;
  sf_trim_planes *p = &trim->planes;
  drop_inputs(scene, trim);
  for (int which = 0; which < SF_FACTORS; which++)
    for (int pair = 0, row = 0; pair < FX_PAIRS; pair++)
      for (int c = 0; c < sf_factors_of(field, which)->components[pair]; c++, row++) {
        const bool matters =
            use->component[which][pair][c] && (which == SF_OF_DENSITY || basis_power(field, p, row) > 0);
        if (!matters && sf_count_kept(p->component[which][pair], FX_COMPONENTS_MAX) > 1)
          p->component[which][pair][c] = false;
      }
}

bool sf_trim_line(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim, sf_factors_id which, int pair)
{
  const fx_factors *factors = sf_factors_of(&scene->tensorf, which);
  bool *kept = trim->planes.component[which][pair];
  const int n = sf_count_kept(kept, FX_COMPONENTS_MAX);
  int row = 0;
  for (int before = 0; before < pair; before++) row += factors->components[before];
  if (n <= FX_LINE) return false;
  for (int gone = (n - 1) % FX_LINE + 1; gone > 0; gone--) {
    double least = INFINITY;
    int at = -1;
    for (int c = 0; c < factors->components[pair]; c++) {
      const double power = (double)use->power[which][pair][c] *
                           (which == SF_OF_DENSITY ? 1 : basis_power(&scene->tensorf, &trim->planes, row + c));
      if (kept[c] && power < least) at = c, least = power;
    }
    kept[at] = false;
  }
  return true;
}

/* ---- the result ---- */

static void inputs(const fx_scene *scene, const sf_trim *trim, bool *row)
{
  for (int i = 0; i < scene->net.layer[FX_C1].n_in; i++) row[i] = input_stays(&scene->tensorf, &trim->planes, i);
}

static void set_sizes(const fx_scene *scene, const sf_trim *trim, fx_scene *result)
{
  const sf_trim_planes *p = &trim->planes;
  fx_tensorf *to = &result->tensorf;
  for (int pair = 0; pair < FX_PAIRS; pair++) {
    to->density.components[pair] = sf_count_kept(p->component[SF_OF_DENSITY][pair], FX_COMPONENTS_MAX);
    to->appearance.components[pair] = sf_count_kept(p->component[SF_OF_APPEARANCE][pair], FX_COMPONENTS_MAX);
    to->res[pair] = p->points[pair];
  }
  to->features = sf_count_kept(p->feature, FX_APPEARANCE_MAX);
  to->feature_freqs = p->feature_freqs, to->view_freqs = p->view_freqs;
  to->weight_stop = p->weight_stop;
  const double stride = (double)scene->step_q24 * p->stride_q16 / SF_STRIDE_ONE;
  result->step_q24 = (int32_t)fmin(nearbyint(stride), 1 << SF_DELTA_FRAC);
  sf_planes_set_box(scene, p, result);
}

static void pack(const int8_t *from, int8_t *to, size_t points, int n, const bool *kept)
{
  int index[FX_COMPONENTS_MAX], left = 0;
  for (int c = 0; c < n; c++)
    if (kept[c]) index[left++] = c;
  if (left == n) {
    memcpy(to, from, points * (size_t)n);
    return;
  }
  for (size_t i = 0; i < points; i++, from += n, to += left)
    for (int c = 0; c < left; c++) to[c] = from[index[c]];
}

static void pack_basis(const fx_tensorf *from, const sf_trim_planes *p, fx_tensorf *to)
{
  int8_t *row = to->basis;
  for (int pair = 0, at = 0; pair < FX_PAIRS; pair++)
    for (int c = 0; c < from->appearance.components[pair]; c++, at++) {
      if (!p->component[SF_OF_APPEARANCE][pair][c]) continue;
      for (int f = 0, lane = 0; f < from->features; f++)
        if (p->feature[f]) row[lane++] = from->basis[(size_t)at * FX_APPEARANCE_MAX + (size_t)f];
      row += FX_APPEARANCE_MAX;
    }
}

static sf_status fill(const fx_scene *scene, const sf_trim *trim, sf_trim_use *use, const char *name, fx_scene *result)
{
  const sf_trim_planes *p = &trim->planes;
  const fx_tensorf *from;
  SF_TRY(sf_planes_shape(scene, p, use, name, &from));
  for (int which = 0; which < SF_FACTORS; which++) {
    const fx_factors *old = sf_factors_of(from, which), *new = sf_factors_of(&result->tensorf, which);
    for (int pair = 0; pair < FX_PAIRS; pair++) {
      const int *axes = fx_pair_axes[pair], n = old->components[pair];
      const bool *kept = p->component[which][pair];
      pack(old->plane[pair], new->plane[pair], (size_t)from->res[axes[0]] * (size_t)from->res[axes[1]], n, kept);
      pack(old->line[pair], new->line[pair], (size_t)from->res[axes[2]], n, kept);
    }
  }
  pack_basis(&scene->tensorf, p, &result->tensorf);
  return sf_planes_crop(scene, p, name, result);
}

const sf_field_trimmer sf_planes_trimmer = {.use_create = use_create,
                                            .all = all,
                                            .exact = exact,
                                            .inputs = inputs,
                                            .set_sizes = set_sizes,
                                            .fill = fill,
                                            .zero_unread = sf_planes_zero_unread};
