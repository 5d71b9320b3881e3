/* The error budget: no block's error is over its derived bound, and no bound is idle. */
#include "ck_run.h"
#include "bounds/bounds.h"
#include "quant/quant.h"
#include "tests/tensorf_fixture.h"
#include <math.h>

enum { SHORT = CK_AMOUNT(200000, 50000) };

/* Sums of integers: their bound is zero. */
static bool exact(int id)
{
  return id == SF_BUDGET_CURRENT || id == SF_BUDGET_DECODER_CURRENT || id == SF_BUDGET_RELU || id == SF_BUDGET_BASIS;
}

/* A bound 4 times the largest error seen would say little. */
LOOP_TEST(bound_holds_and_bites, SF_BUDGET_BLOCKS)
{
  const sf_budget_row row = sf_budget_measure((sf_budget_id)_i, SHORT);
  ck_assert_uint_gt(row.inputs, 0);
  ck_assert(sf_budget_has(FX_INGP, (sf_budget_id)_i) || sf_budget_has(FX_TENSORF, (sf_budget_id)_i));
  if (_i == SF_BUDGET_H) ck_assert_int_eq(strtol(strrchr(row.block, '>') + 1, NULL, 10), SF_H_SHIFT);
  ck_assert_msg(row.ratio <= 1, "%s: error %g, bound %g %s", row.block, row.measured, row.bound, row.unit);
  if (exact(_i))
    ck_assert(row.measured == 0 && row.bound == 0);
  else
    ck_assert_msg(row.ratio >= 0.25, "%s: the bound %g is idle, error %g", row.block, row.bound, row.measured);
}

/* One unit more or less in what the fixed block yields is over its bound somewhere. */
LOOP_TEST(planted_unit_is_seen, SF_BUDGET_BLOCKS)
{
  double worst = 0;
  for (int plant = -1; plant <= 1; plant += 2)
    worst = fmax(worst, sf_budget_measure_planted((sf_budget_id)_i, SHORT / 10, plant).ratio);
  ck_assert_msg(worst > 1, "block %d: a unit more is %.3f of the bound", _i, worst);
}

/* ---- pictures ---- */

enum { SIZE = 40 };

/* Hash grids in each input mode; TensoRF around an object, in a box of bound 4, and in NDC; the first of them with
 * settled scales, as fine-tuning leaves it. */
enum { GRIDS = 4, OBJECT = GRIDS, LARGE_BOX, FORWARD, TUNED, CASES };

static void settle(sf_model *m)
{
  const sf_quant_options options = {.background = {1, 1, 1}, .seed = 1};
  sf_quant_report report;
  fx_scene scene;
  ck_ok(sf_quantise_report(&scene, m, "model", &options, &report));
  fx_scene_free(&scene);
  m->scales = report.scales;
  sf_scales_round(m, m->value);
}

/* A trained model's behaviour: thin enough to see through, neurons that fire in part. */
static sf_model make_model(int kind)
{
  if (kind < GRIDS) {
    sf_model m = test_model(SF_NET_SNN, (sf_input_mode)kind, 64, 4, 1);
    m.t_r = 3;
    return m;
  }
  sf_model m = test_smooth_tensorf(kind == FORWARD);
  sf_tensorf *t = &m.config.tensorf;
  t->weight_stop = 0.0005;
  m.config.mode = kind == TUNED ? SF_RADIX : (sf_input_mode)(kind - OBJECT);
  for (int i = 0; i < 3 && kind == LARGE_BOX; i++) t->box[0][i] = -4, t->box[1][i] = 4;
  if (kind == TUNED) settle(&m);
  if (kind == LARGE_BOX) t->near = (float)SF_NEAR, t->far = 1e6f, t->distance_scale = 1.5f;
  return m;
}

/* Cameras in front of the box, in it, and at the origin of a forward-facing scene. */
static sf_dataset make_data(int kind, const sf_model *m)
{
  const float focal = 50 / (SIZE / 2.0f);
  return (sf_dataset){
      .scale = kind < GRIDS ? 1 : m->config.scale, .ndc = kind == FORWARD, .ndc_near = 1, .ndc_focal = {focal, focal}};
}

/* The float renderer's picture in place of a photograph. */
static sf_view make_view(int kind, const sf_model *m, const sf_dataset *data, uint16_t *rgba)
{
  static float origin[SIZE * SIZE][3], direction[SIZE * SIZE][3], rgb[SIZE * SIZE][3];
  const float white[3] = {1, 1, 1}, z = kind == FORWARD ? 0 : kind == OBJECT || kind == TUNED ? 2.4f : 3;
  const sf_view view = {.name = "view",
                        .camera = {.width = SIZE,
                                   .height = SIZE,
                                   .fx = 50,
                                   .fy = 50,
                                   .cx = SIZE / 2.0f,
                                   .cy = SIZE / 2.0f,
                                   .to_world = {1, 0, 0, 0.1f, 0, 1, 0, 0, 0, 0, 1, z}},
                        .image = {SIZE, SIZE, rgba}};
  for (int i = 0; i < SIZE * SIZE; i++)
    sf_dataset_ray(data, &view, (float)(i % SIZE) + 0.5f, (float)(i / SIZE) + 0.5f, origin[i], direction[i]);
  ck_ok(sf_render_rays(m, origin[0], direction[0], SIZE * SIZE, 3, white, rgb[0], NULL, NULL, NULL));
  for (int i = 0; i < SIZE * SIZE; i++) {
    for (int o = 0; o < 3; o++) rgba[4 * i + o] = (uint16_t)lrintf(fminf(rgb[i][o], 1) * 65535);
    rgba[4 * i + 3] = 65535;
  }
  return view;
}

static void refuses(const sf_picture_job *job, const char *why)
{
  const sf_status status = sf_picture_budget_make(job, &(sf_picture_budget){0});
  ck_assert_msg(status.code == SF_E_UNSUPPORTED && strstr(status.message, why), "%s", status.message);
}

/* Another model's weights, sizes, field. */
static void refuses_strangers(const sf_picture_job *job, sf_model *m, fx_scene *scene)
{
  float *w4 = sf_model_param(m, SF_P_C2);
  const size_t last = m->param[SF_P_C2].size - 1;
  for (size_t i = 0; i <= last / 2; i++) {
    const float other = w4[i];
    w4[i] = w4[last - i], w4[last - i] = other;
  }
  refuses(job, "layer C2");
  scene->net.layer[FX_C2].n_out--;
  refuses(job, "its sizes");
  scene->net.layer[FX_C2].n_out++;
  scene->tensorf.res[1]++, scene->grid.entries++;
  refuses(job, "its sizes");
  scene->tensorf.res[1]--, scene->grid.entries--;
  scene->backbone = scene->backbone == FX_TENSORF ? FX_INGP : FX_TENSORF;
  refuses(job, "its sizes");
}

static sf_picture_budget make_picture(int kind)
{
  static uint16_t rgba[SIZE * SIZE * 4];
  OWNED(sf_model) m = make_model(kind);
  fx_scene scene;
  sf_picture_budget budget;
  const sf_dataset data = make_data(kind, &m);
  const sf_view view = make_view(kind, &m, &data, rgba);
  const sf_quant_options options = {.background = {1, 1, 1}, .seed = 1};
  ck_ok(sf_quantise(&scene, &m, "model", &options));
  const sf_picture_job job = {&m, &scene, &data, &view, "scene", 60, 3, NULL, NULL};
  ck_ok(sf_picture_budget_make(&job, &budget));
  refuses_strangers(&job, &m, &scene);
  fx_scene_free(&scene);
  return budget;
}

/* The blocks that do not reach the spikes flip none; those of the density may change which samples are decoded. */
static void flips_where_it_can(const sf_picture_budget *b, bool planes)
{
  const bool density[SF_EXACT_BLOCKS] = {
      [SF_EXACT_ENTRIES] = planes,  [SF_EXACT_ACTIVATION] = true, [SF_EXACT_EXP2] = true,  [SF_EXACT_SIGMOID] = true,
      [SF_EXACT_INTEGRATOR] = true, [SF_EXACT_COMPOSITE] = true,  [SF_EXACT_DECODE] = true};
  for (int id = 0; id < SF_EXACT_BLOCKS; id++)
    for (int l = FX_D1; l <= FX_C2; l++)
      if (density[id]) ck_assert_uint_eq(b->row[1 + id].flips[l], 0);
  const int nets[] = {SF_EXACT_C1, SF_EXACT_C2, SF_EXACT_C3, SF_EXACT_SIGMOID};
  for (int i = 0; i < 4 && planes; i++) ck_assert_uint_eq(b->row[1 + nets[i]].sample_flips, 0);
}

static void has_the_blocks(const sf_picture_budget *b, bool planes)
{
  static const int of_planes[] = {SF_EXACT_PLANE, SF_EXACT_PRODUCT, SF_EXACT_APPEARANCE, SF_EXACT_ACTIVATION,
                                  SF_EXACT_BASIS, SF_EXACT_FEATURE, SF_EXACT_WAVES,      SF_EXACT_DECODE},
                   of_grid[] = {SF_EXACT_D1, SF_EXACT_D2, SF_EXACT_H, SF_EXACT_EXP2};
  for (int i = 0; i < 8; i++) ck_assert_int_eq(b->row[1 + of_planes[i]].block != NULL, planes);
  for (int i = 0; i < 4; i++) ck_assert_int_eq(b->row[1 + of_grid[i]].block != NULL, !planes);
  for (int l = 0; l < SF_LAYERS; l++) ck_assert_int_eq(b->current[l].currents > 0, !planes || l >= FX_C1);
}

static void currents_within_their_bounds(const sf_picture_budget *b, bool planes)
{
  for (int l = planes ? FX_C1 : FX_D1; l < SF_LAYERS; l++) {
    ck_assert_uint_gt(b->current[l].currents, 1000);
    ck_assert_msg(b->current[l].ratio <= 1 && b->current[l].ratio > 1.0 / 16, "layer %d: %g of its bound", l,
                  b->current[l].ratio);
    ck_assert_double_lt(b->current[l].rms, b->current[l].bound);
  }
}

/* What the weight test leaves out: samples, but nearly no light. */
static void weight_test_leaves_out_samples(const sf_picture_budget *b)
{
  const sf_exact_row *decoded = &b->row[1 + SF_EXACT_DECODE];
  ck_assert_uint_gt(decoded->sample_flips, 20);
  ck_assert_uint_eq(decoded->points, b->samples + decoded->sample_flips);
  ck_assert_double_gt(decoded->psnr, 55);
}

/* With no block replaced: the core, bit for bit (checked inside) and without a flip. With all replaced: the float
 * renderer, but for its own rounding in 24 bits (a neuron at its threshold may flip) and that of the grid's scale. */
LOOP_TEST(picture_from_fixed_to_float, CASES)
{
  const bool planes = _i >= GRIDS;
  const sf_picture_budget b = make_picture(_i);
  const sf_exact_row *none = &b.row[0], *all = &b.row[SF_EXACT_ROWS - 1];
  ck_assert_uint_gt(b.samples, 500);
  ck_assert(isinf(none->psnr));
  ck_assert_uint_eq(none->sample_flips, 0);
  ck_assert_uint_eq(none->points, b.samples);
  has_the_blocks(&b, planes);
  flips_where_it_can(&b, planes);
  currents_within_their_bounds(&b, planes);
  if (_i == OBJECT) weight_test_leaves_out_samples(&b);
  for (int l = planes ? FX_C1 : FX_D1; l <= FX_C2; l++) {
    if (l == FX_D2) continue;
    ck_assert_uint_eq(none->flips[l], 0);
    ck_assert_uint_gt(all->flips[l], 0);
    ck_assert_uint_eq(none->decisions[l], b.samples * 64 * 3);
  }
  printf("case %d: fixed %.1f dB, all blocks in double %.1f dB to the float renderer\n", _i, none->psnr_truth,
         all->psnr_truth);
  ck_assert_double_gt(all->psnr_truth, 70);
  ck_assert_double_gt(all->psnr_truth, none->psnr_truth + 10);
}

int ck_timeout = 300; /* a picture of 150 inputs takes seconds, and more under a sanitizer */
