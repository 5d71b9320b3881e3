/* The TensoRF trainer: the schedule, what growing keeps, the mask, reproducibility, resuming. */
#include "ck_run.h"
#include "vm_fixture.h"
#include <omp.h>

static void set_up(void)
{
  open_scene(8);
}

static void to_box(const sf_tensorf *f, const float p[3], float x[3])
{
  for (int a = 0; a < 3; a++) x[a] = (p[a] - f->box[0][a]) / (f->box[1][a] - f->box[0][a]);
}

/* Random points of the box in model units. */
static void point(const sf_tensorf *f, int i, float p[3])
{
  for (int a = 0; a < 3; a++)
    p[a] = f->box[0][a] + (f->box[1][a] - f->box[0][a]) * sf_random_float(11, 1, 3 * (uint64_t)i + a);
}

/* From n to 2n - 1, 3n - 2 and 4n - 3 points along the axes every old point stays one, and bilinear values stay
 * bilinear: nothing changes. */
TEST(upsampling_keeps_the_field)
{
  const sf_train_options o = small_vm(SF_NET_ANN);
  OWNED(trainer) t = start(&data, &o, NULL);
  enum { N = 300 };
  float before[N], p[N][3], x[3], features[2][SF_APPEARANCE_MAX];
  for (int i = 0; i < N; i++) {
    point(&t->model.config.tensorf, i, p[i]);
    to_box(&t->model.config.tensorf, p[i], x);
    before[i] = sf_tensorf_density_feature(&t->model, x);
  }
  sf_tensorf_appearance(&t->model, x, features[0]);
  sf_tensorf finer = t->model.config.tensorf;
  for (int a = 0; a < 3; a++) finer.resolution[a] = (2 + a) * (finer.resolution[a] - 1) + 1;
  ck_ok(sf_vm_resample(t, &finer, (double[3]){0, 0, 0}, (double[3]){1.0 / 2, 1.0 / 3, 1.0 / 4}));
  for (int i = 0; i < N; i++) {
    to_box(&t->model.config.tensorf, p[i], x);
    ck_assert_float_eq_tol(sf_tensorf_density_feature(&t->model, x), before[i], 1e-5f); /* 48 products of 0.01 */
  }
  sf_tensorf_appearance(&t->model, x, features[1]);
  for (int i = 0; i < 27; i++) ck_assert_float_eq_tol(features[1][i], features[0][i], 1e-5f);
  for (size_t i = 0; i < t->model.size; i++) ck_assert_float_eq(t->moment2[i], 0);
}

/* Shrinking cuts at grid points: the same field inside. Rays have another step then, so that a picture changes by the
 * error of its quadrature alone. */
TEST(shrinking_keeps_what_is_seen)
{
  const sf_train_options o = small_vm(SF_NET_ANN);
  OWNED(trainer) t = start(&data, &o, NULL);
  put_ball(&t->model);
  enum { N = 24 * 24 };
  static float origin[N][3], direction[N][3], rgb[2][N][3], alpha[2][N];
  const float white[3] = {1, 1, 1};
  for (int i = 0; i < N; i++)
    sf_dataset_ray(&data, &data.view[0], (float)(i % 24) + 0.5f, (float)(i / 24) + 0.5f, origin[i], direction[i]);
  const float step = sf_tensorf_step(&t->model.config.tensorf);
  ck_ok(sf_render_rays(&t->model, origin[0], direction[0], N, 1, white, rgb[0][0], NULL, alpha[0], NULL));
  OWNED(sf_model) whole = {0};
  ck_ok(sf_model_create(&whole, &t->model.config));
  memcpy(whole.value, t->model.value, whole.size * sizeof *whole.value);
  ck_ok(sf_vm_mask(t, 1, false));
  ck_assert_double_lt(t->occupied, 0.5);
  ck_ok(sf_vm_shrink(t));
  ck_ok(sf_vm_mask(t, 1, false));
  const sf_tensorf *f = &t->model.config.tensorf;
  ck_assert_int_lt(f->resolution[0], 16);
  for (int i = 0; i < 300; i++) {
    float p[3], x[3], y[3];
    point(f, i, p);
    to_box(f, p, x);
    to_box(&whole.config.tensorf, p, y);
    const float expected = sf_tensorf_density_feature(&whole, y);
    ck_assert_float_eq_tol(sf_tensorf_density_feature(&t->model, x), expected, 1e-4f * (1 + expected));
  }
  ck_ok(sf_render_rays(&t->model, origin[0], direction[0], N, 1, white, rgb[1][0], NULL, alpha[1], NULL));
  ck_assert_float_eq_tol(sf_tensorf_step(f), step, 1e-5f); /* voxels are as long as before, so the steps are */
  double largest = 0, error = 0;
  for (int i = 0; i < N; i++) {
    error = fmax(error, fabs((double)alpha[1][i] - (double)alpha[0][i]));
    largest = fmax(largest, (double)alpha[0][i]);
  }
  ck_assert_double_gt(largest, 0.99);
  ck_assert_double_lt(error, 0.1); /* at the rim: a sample's place within its interval of half a voxel */
}

/* No point whose alpha is above four times the threshold lies in a cell that the mask drops: the mask looks at the
 * corners of cells, and this field changes by less than that between them. Most of the box goes. */
LOOP_TEST(mask_keeps_what_is_visible, 2)
{
  const double share = _i ? 0.1 : 1; /* of the threshold */
  const sf_train_options o = small_vm(SF_NET_ANN);
  OWNED(trainer) t = start(&data, &o, NULL);
  put_ball(&t->model);
  ck_ok(sf_vm_mask(t, share, false));
  const sf_tensorf *f = &t->model.config.tensorf;
  int visible = 0;
  for (int i = 0; i < 20000; i++) {
    float x[3];
    int cell[3];
    for (int a = 0; a < 3; a++) {
      x[a] = sf_random_float(12, 1, 3 * (uint64_t)i + a);
      cell[a] = (int)(x[a] * 16);
    }
    const float sigma = sf_tensorf_sigma(f, sf_tensorf_density_feature(&t->model, x));
    const double alpha = 1 - exp(-(double)sigma / 25 * (double)sf_tensorf_step(f));
    if (alpha < 4e-4 * share) continue;
    const int bit = (cell[2] * 16 + cell[1]) * 16 + cell[0];
    visible++;
    ck_assert_msg(t->model.occupancy[bit / 8] >> (bit % 8) & 1, "alpha %g at %g %g %g is masked", alpha, (double)x[0],
                  (double)x[1], (double)x[2]);
  }
  ck_assert_int_gt(visible, 200);
  ck_assert_double_lt(t->occupied, 0.5);
  const double once = t->occupied;
  memset(t->model.occupancy, 0, 16 * 16 * 16 / 16);
  ck_ok(sf_vm_mask(t, share, true)); /* a later mask takes no cell back */
  ck_assert_double_lt(t->occupied, once);
}

/* The first mask of a young field keeps fainter cells than that of one that has learned for longer; both cut the same
 * box. */
TEST(young_masks_keep_more)
{
  double occupied[2];
  sf_tensorf field[2];
  for (int old = 0; old < 2; old++) {
    const sf_train_options o = small_vm(SF_NET_ANN);
    OWNED(trainer) t = start(&data, &o, NULL);
    put_ball(&t->model);
    t->iteration = old ? 5000 : 50;
    t->progress = 2000 / 30e3;
    ck_ok(sf_vm_grow(t));
    ck_assert_int_eq(t->vm->event, 1);
    occupied[old] = t->occupied;
    field[old] = t->model.config.tensorf;
  }
  ck_assert_double_gt(occupied[0], 1.05 * occupied[1]);
  ck_assert_mem_eq(field[0].box, field[1].box, sizeof field[0].box);
}

/* Every event at its share of the run, the optimiser new there, the finest grid of as many voxels as asked for. Masks
 * come at 2000 and 4000 of 30 000 iterations, in NDC at 2500 of 25 000; the first alone shrinks the box. */
LOOP_TEST(schedule_scales_with_the_run, 2)
{
  static const int at[2][5] = {{20, 30, 40, 55, 70}, {20, 25, 30, 40, 55}}, masks[2][2] = {{20, 40}, {25, 25}};
  sf_view view[8];
  const sf_dataset forward = facing_forward(&data, view);
  sf_train_options o = small_vm(SF_NET_ANN);
  if (_i) o.config.tensorf.ndc = 1, o.lr_grid = 1e-6; /* a field that stays: its mask shrinks nothing */
  o.stage1 = 50, o.stage2 = _i ? 200 : 250, o.config.hidden = 16, o.rays = 64;
  OWNED(trainer) t = start(_i ? &forward : &data, &o, NULL);
  float box[2][3];
  for (int i = 0, event = 0; i < 80; i++) {
    const bool mask = i == masks[_i][0] || i == masks[_i][1];
    uint8_t before[16 * 16 * 16 / 8];
    memcpy(before, t->model.occupancy, sizeof before);
    steps(t, 1);
    if (event < 5 && i == at[_i][event]) event++;
    ck_assert_msg(t->vm->event == event, "iteration %d: %d events, expected %d", i, t->vm->event, event);
    if (event) ck_assert_int_eq(t->vm->fresh, at[_i][event - 1 - (_i && event == 2)]); /* a mask alone renews nothing */
    if (!mask) ck_assert_mem_eq(before, t->model.occupancy, sizeof before);
    if (!_i && i == masks[_i][1]) ck_assert_mem_ne(before, t->model.occupancy, sizeof before);
    if (i == masks[_i][0]) memcpy(box, t->model.config.tensorf.box, sizeof box);
    if (i == masks[_i][0] + 1) { /* cells that a mask would take, and a box that would be smaller */
      memset(t->model.occupancy, 0xff, sizeof before);
      memset(t->model.occupancy, 0, 5 * 16 * 16 / 8);
    }
    if (i >= masks[_i][0]) ck_assert_mem_eq(box, t->model.config.tensorf.box, sizeof box);
  }
  const int32_t *r = t->model.config.tensorf.resolution;
  const double voxels = (double)r[0] * r[1] * r[2];
  ck_assert_double_gt(voxels, 0.75 * 24 * 24 * 24); /* rounded down along each axis */
  ck_assert_double_le(voxels, 24 * 24 * 24);
}

/* The whole way of a short run, spiking: the same bits with one thread and with three. */
TEST(threads_do_not_matter)
{
  const sf_train_options o = small_vm(SF_NET_SNN);
  sf_trainer *t[2];
  const int threads = omp_get_max_threads();
  for (int i = 0; i < 2; i++) {
    omp_set_num_threads(i ? 3 : 1);
    t[i] = start(&data, &o, NULL);
    const sf_train_stats s = steps(t[i], 40);
    ck_assert_int_eq(s.stage, 3);
  }
  omp_set_num_threads(threads);
  ck_assert_mem_eq(&t[0]->model.config, &t[1]->model.config, sizeof t[0]->model.config);
  same_model(t[0], t[1]);
  for (int i = 0; i < 2; i++) sf_trainer_free(t[i]);
}

/* The checkpoint is one of after the field has grown. */
TEST(resume_is_the_same_run)
{
  const sf_train_options o = small_vm(SF_NET_SNN), other = small_run();
  ck_resume(&o, &o, 21, 19);
  sf_trainer *none;
  ck_bad(sf_trainer_create(&none, &data, &other, in("part.safetensors")), SF_E_RANGE, "part.safetensors", "tensorf");
}

/* Biases far below the threshold: neither scaled nor new weights would fire again. */
LONG_TEST(a_layer_that_its_biases_silence_comes_back)
{
  sf_train_options o = small_vm(SF_NET_SNN);
  o.stage1 = 400, o.stage2 = 0, o.lr_net = 3e-4;
  OWNED(trainer) t = start(&data, &o, NULL);
  steps(t, 70);
  for (size_t i = 0; i < t->model.param[SF_P_C1_BIAS].size; i++) sf_model_param(&t->model, SF_P_C1_BIAS)[i] = -20;
  sf_train_stats s = {0};
  for (int i = 0; i < 200 && !s.event[1]; i++) ck_ok(sf_trainer_step(t, &s));
  ck_assert_int_eq(s.event[1], -1);
  s = steps(t, 10);
  ck_assert_double_gt(s.firing[1], 0.01);
}

/* Twin and spiking net learn: the error of 150 iterations on a plain scene falls well below that of a white picture. */
LONG_TEST(it_learns)
{
  for (int net = SF_NET_SNN; net <= SF_NET_ANN; net++) {
    sf_train_options o = small_vm(net);
    o.stage1 = 40, o.stage2 = 110, o.rays = 512;
    OWNED(trainer) t = start(&data, &o, NULL);
    double psnr, ssim;
    const sf_train_stats first = steps(t, 1), last = steps(t, 149);
    ck_ok(sf_evaluate(sf_trainer_model(t), &data, 2, 0, &psnr, &ssim));
    ck_assert_msg(last.mse < 0.3 * first.mse && psnr > 15, "%s: error %g, was %g; %g dB", net ? "twin" : "spiking",
                  last.mse, first.mse, psnr);
    ck_assert_double_gt(last.occupied, 0);
  }
}

/* One pass decodes all steps: the same pictures as those of each number of steps alone. */
TEST(every_prefix_is_evaluated)
{
  const sf_train_options o = small_vm(SF_NET_SNN);
  OWNED(trainer) t = start(&data, &o, NULL);
  double prefix[SF_T_MAX], psnr, ssim;
  steps(t, 40);
  const sf_model *m = sf_trainer_model(t);
  ck_ok(sf_evaluate_prefixes(m, &data, 2, prefix));
  for (int i = 0; i < m->config.steps; i++) {
    ck_ok(sf_evaluate(m, &data, 2, i + 1, &psnr, &ssim));
    ck_assert_double_eq(prefix[i], psnr);
    if (i) ck_assert_double_ne(prefix[i], prefix[i - 1]);
  }
}

/* A field that is not finite ends the run with its name; what is refused is not saved. */
TEST(nan_is_found)
{
  const sf_train_options o = small_vm(SF_NET_ANN);
  OWNED(trainer) t = start(&data, &o, NULL);
  sf_train_stats s;
  t->model.value[t->model.param[SF_P_DENSITY_LINE].offset] = NAN;
  for (size_t i = 0; i < t->model.param[SF_P_DENSITY_LINE].size; i++)
    t->model.value[t->model.param[SF_P_DENSITY_LINE].offset + i] = NAN;
  ck_assert_int_ne(sf_trainer_step(t, &s).code, SF_OK);
  const sf_status status = sf_trainer_save(t, in("bad.safetensors"), true);
  ck_assert_int_ne(status.code, SF_OK);
  ck_assert_ptr_nonnull(strstr(status.message, "density_line.0"));
}

/* Blender scenes have TensoRF's box in their units; others, whose unit may be anything, the box of the data. */
TEST(the_box_is_that_of_the_layout)
{
  sf_config c, plain = sf_tensorf_default(data.scale, 0);
  float *const place = data.view[0].camera.to_world;
  data.count = 1;
  for (float distance = 1; distance < 200; distance *= 1.5f) { /* world units; 2 before and behind the middle */
    data.scale = distance < 10 ? 0.8f : 0.03f;
    plain = sf_tensorf_default(data.scale, 0);
    place[3] = 0, place[7] = 0.6f * distance * data.scale, place[11] = 0.8f * distance * data.scale;
    c = sf_train_defaults_tensorf(&data).config;
    const float near = c.tensorf.near / data.scale, far = c.tensorf.far / data.scale;
    ck_assert_float_eq_tol(near, fmaxf(fminf(2, distance - 2), fminf(2, (float)SF_NEAR / data.scale)), 1e-4f);
    ck_assert_float_eq_tol(far, fmaxf(6, distance + 2), 1e-4f);
    c.tensorf.near = plain.tensorf.near, c.tensorf.far = plain.tensorf.far;
    ck_assert_int_eq(memcmp(&c.tensorf, &plain.tensorf, sizeof c.tensorf), 0);
  }
  data.layout = SF_LAYOUT_COLMAP, data.bound = 2;
  for (data.scale = 0.01f; data.scale < 200; data.scale *= 100) {
    c = sf_train_defaults_tensorf(&data).config;
    ck_assert_float_eq(c.scale, data.scale);
    for (int a = 0; a < 3; a++) {
      ck_assert(c.tensorf.box[0][a] == -2 && c.tensorf.box[1][a] == 2);
      ck_assert_int_eq(c.tensorf.resolution[a], 128);
    }
    ck_assert(c.tensorf.near == (float)SF_NEAR && c.tensorf.far > 1e5f);
    ck_assert_float_eq(c.tensorf.distance_scale, 18.75f);
    ck_ok(sf_config_check(&c));
  }
  data.ndc = true;
  c = sf_train_defaults_tensorf(&data).config, plain = sf_tensorf_default(data.scale, 1);
  ck_assert_int_eq(memcmp(&c.tensorf, &plain.tensorf, sizeof c.tensorf), 0);
}

TEST(rays_that_all_miss_the_box_are_refused)
{
  sf_train_options o = small_vm(SF_NET_SNN);
  sf_train_stats stats;
  o.config.tensorf.near = 100, o.config.tensorf.far = 101;
  OWNED(trainer) t = start(&data, &o, NULL);
  ck_bad(sf_trainer_step(t, &stats), SF_E_RANGE, "iteration 0: none of", "meets the box");
}

int ck_timeout = 300;
ck_options ck_program = {.set_up = set_up, .tear_down = close_scene};
