/* What the quantiser makes of small models, number by number: scenes, scales and errors, against kept numbers. Rays and
 * positions of these scenes. */
#include "quant_fixture.h"
#include "src/quant/internal.h"
#include "tensorf_fixture.h"
#include "tests/expected.h"

static const double SHARE = 1e-3; /* mathematical libraries may differ in a last bit, and a weight with it */

/* Sums that see each number and where it is. */
static void say_bytes(FILE *out, const char *title, const int8_t *list, size_t n)
{
  int64_t sum = 0, size = 0, places = 0;
  for (size_t i = 0; i < n; i++) sum += list[i], size += abs(list[i]), places += abs(list[i]) * (int64_t)(1 + i % 97);
  fprintf(out, "  %s %zu: %lld %lld %lld\n", title, n, (long long)(sum + size), (long long)size, (long long)places);
}

static void say_scale(FILE *out, const char *title, const fx_scale *s)
{
  fprintf(out, " %s %d>>%d+%d", title, s->mul, s->shift, s->bias);
}

static void say_net(FILE *out, const fx_scene *s, const sf_quant_report *r)
{
  for (int l = fx_net_first_layer(&s->net); l < SF_LAYERS; l++) {
    const fx_layer *layer = &s->net.layer[l];
    fprintf(out, "  layer %d: %d to %d k %d theta %d bias %d unit %.6g scale %.6g error %.4g clipped %d\n", l,
            layer->n_in, layer->n_out, layer->k, layer->theta, layer->bias, r->layer[l].unit, s->units.current_scale[l],
            r->layer[l].error, r->layer[l].clipped);
    say_bytes(out, "weights", layer->w, (size_t)fx_layer_rows(layer) * SF_LANES);
  }
  fprintf(out, "  mode %d steps %d", s->net.mode, s->net.steps);
  say_scale(out, "exp", &s->net.exp_in), say_scale(out, "sigmoid", &s->net.sigmoid_in);
  fprintf(out, "\n");
}

static void say_grid(FILE *out, const fx_scene *s)
{
  const fx_grid *g = &s->grid;
  for (int l = 0; l < g->levels; l++)
    fprintf(out, "  level %d: scale %d stride %d size %d offset %d shift %d unit %.6g\n", l, g->scale_q16[l],
            g->stride[l], g->log2_size[l], (int)g->offset[l], g->shift[l], s->units.feature_scale[l]);
  say_bytes(out, "table", g->table, 2 * (size_t)g->entries);
}

static void say_factors(FILE *out, const fx_scene *s)
{
  const fx_tensorf *t = &s->tensorf;
  static const int axes[3][3] = {{0, 1, 2}, {0, 2, 1}, {1, 2, 0}};
  fprintf(out, "  grid %d %d %d activation %d stop %d features %d freqs %d %d frac %d", t->res[0], t->res[1], t->res[2],
          t->activation, t->weight_stop, t->features, t->feature_freqs, t->view_freqs, t->encoding_frac);
  say_scale(out, "density", &t->density_in), say_scale(out, "sigma", &t->sigma_out);
  say_scale(out, "feature", &t->feature_in), say_scale(out, "phase", &t->phase_in);
  fprintf(out, "\n");
  int components = 0;
  for (int w = 0; w < 2; w++)
    for (int p = 0; p < 3; p++) {
      const fx_factors *f = sf_factors_of(t, w);
      const size_t n = (size_t)f->components[p];
      say_bytes(out, "plane", f->plane[p], n * (size_t)(t->res[axes[p][0]] * t->res[axes[p][1]]));
      say_bytes(out, "line", f->line[p], n * (size_t)t->res[axes[p][2]]);
      if (w) components += (int)n;
    }
  say_bytes(out, "basis", t->basis, (size_t)components * FX_APPEARANCE_MAX);
}

static void say_scene(FILE *out, const fx_scene *s, const sf_quant_report *r)
{
  const fx_units *u = &s->units;
  int64_t cells = 0;
  for (int64_t i = 0; i < sf_cells_of(s) / 8; i++) cells += __builtin_popcount(s->occupancy[i]) * (1 + i % 7);
  fprintf(out,
          "  cells %d, bound %d: %lld step %d gamma %d near %d longest %d samples %d stop %d background %d %d %d\n",
          s->occ_res, s->log2_bound, (long long)cells, s->step_q24, s->gamma_q24, s->near_q16, s->longest_q16,
          s->max_samples, s->trans_stop, s->background[0], s->background[1], s->background[2]);
  fprintf(out,
          "  box %.7g of %.7g %.7g %.7g model %.6g data %.6g %.6g %.6g %.6g %.9g stretch %.6g %.6g %.6g near %.6g far "
          "%.6g dir %.6g\n",
          u->to_box_scale, u->to_box_offset[0], u->to_box_offset[1], u->to_box_offset[2], u->model_scale, u->data_scale,
          u->data_bound, u->data_ndc, u->data_views, u->data_poses, u->stretch[0], u->stretch[1], u->stretch[2],
          u->near, u->far, u->dir_scale);
  say_net(out, s, r);
  if (s->backbone == FX_INGP)
    say_grid(out, s);
  else
    say_factors(out, s);
  fprintf(out, "  features %.4g clipped %d samples %d widths %d %d %d %d unused %d %d %d %d packed %d\n",
          r->feature_error, (int)r->grid_clipped, r->samples, r->widths.weight_bits, r->widths.feature_bits,
          r->widths.leak_bits, r->widths.grid_bits, r->unused.weight_bits, r->unused.feature_bits, r->unused.leak_bits,
          r->unused.grid_bits, (int)r->packed_bytes);
  const float *lsb = (const float *)&r->scales.lsb;
  double sum[2] = {0};
  for (int i = 0; i < (int)SF_SCALES; i++) sum[0] += (double)lsb[i], sum[1] += (double)lsb[i] * (1 + i % 17);
  fprintf(out, "  scales %d %d %d: %.6g %.6g\n", r->scales.weight_bits, r->scales.grid_bits, r->scales.leak_bits,
          sum[0], sum[1]);
}

static void say_ray(FILE *out, const fx_scene *s, const float o[3], const float d[3])
{
  fx_ray r;
  memset(&r, 0, sizeof r);
  const sf_status status = sf_fx_ray_make(s, o, d, &r);
  fprintf(out, "%g %g %g to %g %g %g:", (double)o[0], (double)o[1], (double)o[2], (double)d[0], (double)d[1],
          (double)d[2]);
  if (status.code) fprintf(out, " %d %s\n", status.code, status.message);
  if (status.code) return;
  fprintf(out, " %d points first %lld from", r.count, (long long)r.first_q16);
  for (int i = 0; i < 3; i++) fprintf(out, " %.9g", ldexp((double)r.origin[i], -FX_RAY_FRAC));
  fprintf(out, " by");
  for (int i = 0; i < 3; i++) fprintf(out, " %.7g", ldexp((double)r.step[i], -FX_RAY_FRAC));
  fprintf(out, " unit %d %d %d dir", r.unit[0], r.unit[1], r.unit[2]);
  for (int i = 0; i < FX_SH; i++) fprintf(out, " %d", r.dir[i]);
  fprintf(out, "\n");
}

static void rays(FILE *out, const fx_scene *scene)
{
  static const float from[][3] = {{2, 0.3f, -0.2f}, {0.1f, 0.2f, 0.3f}, {-0.4f, -3, 0.1f}, {0.2f, 0.1f, 5},
                                  {1, 1, 1},        {0, 0, 2e6f},       {0, 2, 0},         {NAN, 0, 0}};
  static const float to[][3] = {{-1, 0.1f, 0.2f}, {0.3f, 0.5f, -0.9f}, {0, 1, 0},        {0, 0, -1},
                                {-2, -2, -2},     {0, 0, 0},           {INFINITY, 0, 0}, {1e-3f, -1, 1e-6f}};
  for (int i = 0; i < COUNT(from); i++)
    for (int k = 0; k < COUNT(to); k++) say_ray(out, scene, from[i], to[k]);
  for (int i = 0; i < COUNT(from); i++) {
    uint32_t box[3] = {0};
    const float half[3] = {from[i][0] / 4, from[i][1] / 4, from[i][2] / 4};
    const sf_status status = sf_fx_position_make(scene, half, box);
    fprintf(out, "place %d: %d %s %u %u %u\n", i, status.code, status.message, box[0], box[1], box[2]);
  }
  fprintf(out, "frac %d sigma %.6g %.6g colour %.6g %.6g\n", sf_fx_dir_frac(scene), sf_fx_sigma_value(scene, 1),
          sf_fx_sigma_value(scene, 4096), sf_fx_colour_value(1), sf_fx_colour_value(65535));
}

static void say_model(FILE *out, const char *title, const sf_model *m, const sf_quant_options *o, bool with_rays)
{
  OWNED(fx_scene) scene;
  sf_quant_report report;
  fprintf(out, "%s\n", title);
  const sf_status status = sf_quantise_report(&scene, m, "model", o, &report);
  if (status.code)
    fprintf(out, "  %d %s\n", status.code, status.message);
  else
    say_scene(out, &scene, &report);
  if (!status.code && with_rays) rays(out, &scene);
}

/* In a box of 4, where steps grow. */
static sf_model large_model(void)
{
  sf_model m;
  sf_config c = sf_config_default();
  sf_config_bound(&c, 4);
  c.hidden = 16, c.levels = 2, c.log2_hash = 8, c.finest_res = 64, c.occ_res = 16, c.steps = 2;
  ck_ok(sf_model_create(&m, &c));
  fill(&m, SF_P_GRID, 0.3f), fill(&m, SF_P_D1, 1), fill(&m, SF_P_D2, 0.5f), fill(&m, SF_P_C1, 0.5f);
  fill(&m, SF_P_C2, 0.3f), fill(&m, SF_P_C3, 0.3f);
  memset(m.occupancy, 255, sf_config_cells(&c) / 8);
  return m;
}

static void grids(FILE *out)
{
  static const sf_quant_options narrow = {
      .steps = 2, .background = {0, 0.5f, 0.25f}, .seed = 5, .widths = {4, 9, 6, 3}};
  OWNED(sf_model) m = make_model(16, 2, SF_HYBRID), large = large_model();
  m.config.space = (sf_space){.scale = 0.6f, .bound = 2, .ndc = 0, .views = 77, .poses = 123456789, .picture = 5};
  say_model(out, "hash grid", &m, &plain, false);
  say_model(out, "hash grid, large and narrow", &large, &narrow, true);
  OWNED(fx_scene) scene;
  sf_quant_report report;
  ck_ok(sf_quantise_report(&scene, &m, "model", &(sf_quant_options){.seed = 2, .widths = {.weight_bits = 5}}, &report));
  m.scales = report.scales;
  say_model(out, "hash grid, its scales settled", &m, &(sf_quant_options){.seed = 3}, false);
  m.config.mode = SF_HYBRID + 1;
  say_model(out, "hash grid, settled for other widths", &m,
            &(sf_quant_options){.seed = 3, .widths = {.weight_bits = 6}}, false);
}

/* Few components and features: inputs of C1 take the time. */
static sf_model few_planes(void)
{
  sf_model m;
  sf_config c = sf_tensorf_default(2 / 3.0f, 0);
  static const int32_t sizes[3][3] = {{9, 7, 12}, {8, 4, 4}, {4, 8, 12}};
  c.hidden = 16, c.steps = 2, c.occ_res = 8;
  memcpy(c.tensorf.resolution, sizes[0], sizeof sizes[0]);
  memcpy(c.tensorf.density, sizes[1], sizeof sizes[1]), memcpy(c.tensorf.appearance, sizes[2], sizeof sizes[2]);
  c.tensorf.features = 5, c.tensorf.feature_freqs = 2, c.tensorf.view_freqs = 1;
  ck_ok(sf_model_create(&m, &c));
  for (int id = 0; id < SF_P_COUNT; id++)
    if (m.param[id].size) fill(&m, (sf_param_id)id, id < SF_P_BASIS ? 0.5f : 0.3f);
  m.t_r = 2;
  return m;
}

static void planes(FILE *out)
{
  static const sf_quant_options narrow = {
      .steps = 1, .background = {0, 0.5f, 0.25f}, .seed = 5, .widths = {5, 0, 7, 4}};
  for (int ndc = 0; ndc < 2; ndc++) {
    OWNED(sf_model) m = ndc ? test_tensorf(SF_NET_SNN, 1, 16, 2) : few_planes();
    m.t_r = 2;
    say_model(out, ndc ? "planes in NDC" : "planes, narrow", &m, ndc ? &plain : &narrow, ndc);
  }
}

TEST(hash_grids)
{
  ck_expected_text_about("quant-grid.txt", out, grids(out), SHARE);
}

TEST(planes_and_lines)
{
  ck_expected_text_about("quant-planes.txt", out, planes(out), SHARE);
}

/* A factor as 16 significant bits and a shift: the nearest one, or as many bits as the shifter leaves. */
TEST(factors_as_shifts)
{
  for (int i = -60; i < 60; i++)
    for (int most = 5; most < 45; most += 13) {
      const double factor = ldexp(1 + 0.3 * ((i + 60) % 3), i);
      fx_scale s = {-1, -1, -1};
      const bool fits = sf_quant_scale(factor, most, 7, &s);
      ck_assert_msg(fits == (factor < 65535.5), "%g with %d", factor, most);
      if (!fits) continue;
      ck_assert(s.shift >= 0 && s.shift <= most && s.mul >= 0 && s.mul <= 65535 && s.bias == 7);
      const double step = ldexp(1, -s.shift);
      ck_assert_msg(fabs(s.mul * step - factor) <= 0.5 * step * (1 + 1e-9), "%g: %d >> %d", factor, s.mul, s.shift);
      ck_assert_msg(s.mul >= 32768 || s.shift == most || s.shift == 0, "%g: %d >> %d", factor, s.mul, s.shift);
    }
}
