/* What can go, kind by kind: the search knows no other difference between a hash grid and TensoRF's planes. */
#include "src/fit/internal.h"

enum { STOP_MAX = 1 << (SF_TRANS_FRAC - 5) };

static bool is_grid(const fx_scene *scene)
{
  return scene->backbone == FX_INGP;
}

static bool drop(bool *flag, int n, int at, int least)
{
  if (!flag[at] || sf_count_kept(flag, n) <= least) return false;
  flag[at] = false;
  return true;
}

static int one(const fx_scene *scene)
{
  (void)scene;
  return 1;
}

/* ---- of any scene ---- */

static int neurons(const fx_scene *scene)
{
  (void)scene;
  return FX_C3 * SF_LANES; /* of D1 to C2 */
}

static bool cut_neuron(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim, int place)
{
  const int layer = place / SF_LANES, neuron = place % SF_LANES;
  (void)scene, (void)use;
  if (layer == FX_D2 && neuron == 0) return false; /* the density */
  return drop(trim->neuron[layer], SF_LANES, neuron, sf_trim_least(trim, layer));
}

static int cell_classes(const fx_scene *scene)
{
  (void)scene;
  return SF_CELL_CLASSES - 1; /* class 0 is as good as opaque, or unseen */
}

static bool cut_cells(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim, int place)
{
  (void)scene, (void)use;
  return drop(trim->cells, SF_CELL_CLASSES, place + 1, 0);
}

static bool cut_step(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim, int place)
{
  (void)scene, (void)use, (void)place;
  if (trim->steps < 2) return false;
  trim->steps--;
  return true;
}

/* Two octaves more. */
static bool raise(int32_t *stop)
{
  if (*stop > STOP_MAX) return false;
  *stop = 4 * *stop + 3;
  return true;
}

static bool cut_ray_end(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim, int place)
{
  (void)scene, (void)use, (void)place;
  return raise(&trim->trans_stop);
}

/* ---- of a hash grid ---- */

static int levels(const fx_scene *scene)
{
  return is_grid(scene) ? scene->grid.levels : 0;
}

static bool cut_level(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim, int place)
{
  (void)scene, (void)use;
  return drop(trim->level, FX_LEVELS_MAX, place, 1);
}

static bool cut_table(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim, int place)
{
  (void)use;
  if (!trim->level[place] || sf_trim_smaller(scene, trim, place) < 0) return false;
  trim->log2_size[place] = sf_trim_smaller(scene, trim, place);
  return true;
}

static int directions(const fx_scene *scene)
{
  return is_grid(scene);
}

static bool cut_direction(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim, int place)
{
  (void)scene, (void)use, (void)place;
  if (trim->directions < 2) return false;
  trim->directions--;
  return true;
}

/* ---- of TensoRF's planes ---- */

/* What an axis loses in one cut, and the distance of samples gains: a part of these. */
static const int parts[] = {4, 12};
enum { PARTS = sizeof parts / sizeof parts[0] };

static int pairs(const fx_scene *scene)
{
  return is_grid(scene) ? 0 : SF_FACTORS * FX_PAIRS;
}

static int components(const fx_scene *scene)
{
  return pairs(scene) * FX_COMPONENTS_MAX;
}

static bool cut_component(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim, int place)
{
  const int pair = place / FX_COMPONENTS_MAX;
  (void)scene, (void)use;
  return drop(trim->planes.component[pair / FX_PAIRS][pair % FX_PAIRS], FX_COMPONENTS_MAX, place % FX_COMPONENTS_MAX,
              1);
}

static bool cut_line(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim, int place)
{
  return sf_trim_line(scene, use, trim, (sf_factors_id)(place / FX_PAIRS), place % FX_PAIRS);
}

static int features(const fx_scene *scene)
{
  return is_grid(scene) ? 0 : FX_APPEARANCE_MAX;
}

static bool cut_feature(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim, int place)
{
  (void)scene, (void)use;
  return drop(trim->planes.feature, FX_APPEARANCE_MAX, place, 1);
}

static int sines(const fx_scene *scene)
{
  return is_grid(scene) ? 0 : 2;
}

static bool cut_sines(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim, int place)
{
  int32_t *orders = place ? &trim->planes.view_freqs : &trim->planes.feature_freqs;
  (void)scene, (void)use;
  if (!*orders) return false;
  --*orders;
  return true;
}

static int points(const fx_scene *scene)
{
  return is_grid(scene) ? 0 : 3 * PARTS;
}

static bool cut_points(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim, int place)
{
  (void)scene, (void)use;
  return sf_trim_points(trim, place % 3, parts[place / 3]);
}

static int one_of_planes(const fx_scene *scene)
{
  return !is_grid(scene);
}

static bool cut_box(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim, int place)
{
  (void)place;
  return sf_trim_box(scene, use, trim);
}

static int strides(const fx_scene *scene)
{
  return is_grid(scene) ? 0 : PARTS;
}

static bool cut_stride(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim, int place)
{
  (void)use;
  const int32_t longer = trim->planes.stride_q16 + trim->planes.stride_q16 / parts[place];
  if ((double)longer * scene->step_q24 > 65536.0 * (1 << SF_DELTA_FRAC) / 8) return false; /* an eighth of the box */
  trim->planes.stride_q16 = longer;
  return true;
}

static bool cut_dim(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim, int place)
{
  (void)scene, (void)use, (void)place;
  return raise(&trim->planes.weight_stop);
}

const sf_cut_kind sf_cut_kinds[] = {
    {false, false, neurons, cut_neuron},
    {true, true, levels, cut_level},
    {true, true, levels, cut_table},
    {false, false, components, cut_component},
    {true, true, pairs, cut_line},
    {false, false, features, cut_feature},
    {true, false, sines, cut_sines},
    {true, true, points, cut_points},
    {true, true, one_of_planes, cut_box},
    {true, false, strides, cut_stride},
    {false, false, one_of_planes, cut_dim},
    {false, false, cell_classes, cut_cells},
    {false, false, directions, cut_direction},
    {true, false, one, cut_step},
    {false, false, one, cut_ray_end},
};
const int sf_cut_kind_count = sizeof sf_cut_kinds / sizeof sf_cut_kinds[0];
