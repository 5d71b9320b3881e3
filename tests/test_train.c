/* Losses, determinism, resume, time budget of the trainer. */
#include "ck_run.h"
#include "base/io.h"
#include "train_fixture.h"
#include <omp.h>

static void set_up(void)
{
  open_scene(6);
}

/* In a box of bound 1, and in one with three cascades and growing steps. */
static sf_train_options run_in_box(int kind)
{
  sf_train_options o = small_run();
  const int finest = o.config.finest_res;
  sf_config_bound(&o.config, kind ? 4 : 1);
  o.config.finest_res = finest;
  return o;
}

LOOP_TEST(same_seed_same_bits_any_threads, 2)
{
  sf_train_options o = run_in_box(_i);
  omp_set_num_threads(1);
  OWNED(trainer) a = start(&data, &o, NULL);
  steps(a, 40);
  omp_set_num_threads(3);
  OWNED(trainer) b = start(&data, &o, NULL);
  steps(b, 40);
  same_model(a, b);
  ck_assert_int_eq(a->stage, 3);
  o.seed = 2;
  OWNED(trainer) c = start(&data, &o, NULL);
  steps(c, 40);
  ck_assert_int_ne(memcmp(a->model.value, c->model.value, a->model.size * sizeof(float)), 0);
}

/* The field is learned with two steps. A run that ends there, and the paper's, unroll all T. */
LOOP_TEST(stage_one_unrolls_two_steps, 3)
{
  sf_train_options o = small_run();
  if (_i == 1) o.stage2 = 0;
  if (_i == 2) o.objective = SF_OBJECTIVE_PAPER;
  OWNED(trainer) t = start(&data, &o, NULL);
  const sf_train_stats s = steps(t, o.stage1 - 1);
  ck_assert_int_eq(s.stage, 1);
  ck_assert_int_eq(s.t_r, _i ? T : 2);
  ck_assert_double_eq(s.t_star, s.t_r);
}

/* Every prefix has 1/T of the whole weight, within five standard errors, and few steps are drawn most often. */
LOOP_TEST(a_drawn_prefix_stands_for_the_mean, SF_T_MAX)
{
  enum { DRAWS = 100000 };
  const int steps_all = _i + 1;
  double share[SF_T_MAX] = {0}, sum = 0;
  int drawn[SF_T_MAX] = {0};
  for (int i = 0; i < DRAWS; i++) {
    float weight;
    const int t = sf_prefix_draw(7, i, steps_all, &weight);
    ck_assert(t >= 1 && t <= steps_all);
    share[t - 1] += weight / (double)DRAWS;
    drawn[t - 1]++;
  }
  for (int t = 1; t <= steps_all; t++) sum += 1.0 / t;
  for (int t = 1; t <= steps_all; t++) {
    const double error = sqrt((sum * t - 1) / DRAWS) / steps_all;
    ck_assert_double_eq_tol(share[t - 1], 1.0 / steps_all, 5 * error + 1e-6);
    if (t > 1) ck_assert_int_lt(drawn[t - 1], drawn[t - 2]);
  }
}

/* t* moves in the first half of stage II at most; then the t_r that it chose is all that is unrolled. */
TEST(the_chosen_steps_are_trained_alone)
{
  sf_train_options o = small_run();
  o.beta = 1e-4;
  OWNED(trainer) t = start(&data, &o, NULL);
  const int search = o.stage1 + o.stage2 / 2;
  sf_train_stats s = steps(t, search);
  const double chosen = s.t_star;
  ck_assert_int_gt(s.search.state, SF_SEARCH_RUNNING);
  ck_assert_int_gt(s.search.measured, 0);
  ck_assert_double_lt(chosen, T - 1);
  for (int i = search; i < o.stage1 + o.stage2; i++) {
    const sf_search_report before = s.search;
    s = steps(t, 1);
    ck_assert_double_eq(s.t_star, chosen);
    ck_assert_int_eq(s.t_r, lround(chosen));
    ck_assert_int_eq(s.search.measured, before.measured);
    ck_assert_int_eq(s.search.state, before.state);
  }
}

/* What is rendered has the intervals of the training's second half. */
LOOP_TEST(the_lattice_settles, 2)
{
  sf_train_options o = run_in_box(_i);
  o.samples = 64; /* few enough for a coarser lattice */
  OWNED(trainer) t = start(&data, &o, NULL);
  const int first = o.stage1, last = o.stage1 + o.stage2;
  sf_train_stats s = steps(t, first);
  ck_assert_int_gt(t->stride, 1);
  ck_assert_int_eq(t->model.config.lattice, o.config.lattice);
  int seen = 0;
  for (int i = first; i < last; i++) {
    const int stride = t->stride < 2 ? 1 : 2;
    s = steps(t, 1);
    const sf_config *c = &t->model.config;
    if (t->progress < 0.5) {
      ck_assert_int_eq(c->lattice, o.config.lattice);
      seen = o.config.lattice / stride;
    } else {
      ck_assert_int_eq(t->stride, 1);
      ck_assert_int_eq(c->lattice, seen);
      ck_assert_float_eq(c->dt_gamma, o.config.dt_gamma * (float)(o.config.lattice / seen));
    }
    ck_assert_int_eq(s.lattice, c->lattice / t->stride);
  }
  ck_assert_int_lt(seen, o.config.lattice);
  sf_steps rendered;
  ck_ok(sf_march_steps(&rendered, &t->model, 1));
  ck_assert_int_eq(memcmp(&rendered, &t->intervals, sizeof rendered), 0);
}

/* Twice its steps would be no model's: in the first case the lattice would be too coarse, in the second dt_gamma too
 * large. */
LOOP_TEST(a_lattice_at_its_limit_settles_as_it_is, 2)
{
  sf_train_options o = run_in_box(_i);
  o.samples = 64;
  if (_i)
    o.config.dt_gamma = 0.75f * SF_GAMMA_MAX;
  else
    o.config.lattice = 2 * SF_LATTICE_MIN - 1;
  OWNED(trainer) t = start(&data, &o, NULL);
  steps(t, o.stage1);
  ck_assert_int_gt(t->stride, 1);
  steps(t, o.stage2);
  ck_assert_int_eq(t->stride, 1);
  ck_assert_int_eq(t->model.config.lattice, o.config.lattice);
  ck_assert_float_eq(t->model.config.dt_gamma, o.config.dt_gamma);
}

LOOP_TEST(resume_continues_bit_identically, 2)
{
  sf_train_options o = run_in_box(_i);
  ck_resume(&o, &o, 17, 16);
  o.stage1 = 2000; /* resumed within the first epoch, which ends after the resume (but under a sanitizer) */
  o.samples = CK_AMOUNT(8192, 4096);
  ck_resume(&o, &o, 6, CK_AMOUNT(30, 14));
}

/* With other views, another scale or another box a checkpoint is not resumed; one that does not say its views is. */
TEST(a_checkpoint_is_of_its_data)
{
  OWNED(sf_dataset) data = load("train");
  sf_train_options o = small_run();
  sf_trainer *t = start(&data, &o, NULL);
  char *text;
  size_t size;
  steps(t, 2);
  const char *const path = in("a.safetensors");
  cJSON *record = cJSON_CreateObject();
  cJSON_AddStringToObject(record, "option.beta", "0.5");
  t->options.record = record;
  ck_ok(sf_trainer_save(t, path, true));
  sf_trainer_free(t);
  sf_tensors set;
  ck_ok(sf_tensors_load(&set, path));
  ck_assert_str_eq(sf_tensors_meta(&set, "option.beta"), "0.5");
  sf_tensors_free(&set);
  cJSON_Delete(record);
  float *const number[] = {&data.view[1].camera.to_world[3],
                           &data.view[0].camera.fx,
                           &data.view[2].brightness,
                           &data.offset[1],
                           &data.ndc_focal[0],
                           &data.ndc_focal[1]};
  for (int i = 0; i < COUNT(number); i++) {
    const float before = *number[i];
    *number[i] += 0.001f;
    ck_bad(sf_trainer_create(&t, &data, &o, path), SF_E_RANGE, path, "other views");
    *number[i] = before;
  }
  data.count--;
  ck_bad(sf_trainer_create(&t, &data, &o, path), SF_E_RANGE, path, "other views");
  data.count++;
  data.scale *= 1.00001f;
  ck_bad(sf_trainer_create(&t, &data, &o, path), SF_E_RANGE, path, "'scale'");
  data.scale /= 1.00001f;
  o.config.bound = 2;
  ck_bad(sf_trainer_create(&t, &data, &o, path), SF_E_RANGE, path, "'bound' is 1, here it is 2");
  o.config.bound = 1;
  ck_ok(sf_read_file(path, 1 << 24, &text, &size));
  *strstr(text + 8, "train.views") = 'T';
  ck_ok(sf_write_file(path, text, size));
  free(text);
  data.view[0].camera.fx += 0.1f;
  sf_trainer_free(start(&data, &o, path));
}

TEST(saved_model_loads_and_saves_equal)
{
  sf_train_options o = small_run();
  OWNED(trainer) t = start(&data, &o, NULL);
  steps(t, 20);
  ck_ok(sf_trainer_save(t, in("a.safetensors"), false));
  ck_ok(sf_trainer_save(t, in("b.safetensors"), false));
  ck_assert(same_files(in("a.safetensors"), in("b.safetensors")));
  sf_model m;
  ck_ok(sf_model_load(&m, in("a.safetensors")));
  for (int i = 0; i < SF_P_COUNT; i++) /* alignment gaps between parameters are not saved */
    ck_assert_int_eq(memcmp(sf_model_param(&m, i), sf_model_param(&t->model, i), m.param[i].size * sizeof(float)), 0);
  ck_assert_int_eq(m.t_r, t->model.t_r);
  sf_model_free(&m);
  sf_trainer *resumed;
  ck_assert_int_eq(sf_trainer_create(&resumed, &data, &o, in("a.safetensors")).code, SF_E_FORMAT); /* no Adam inside */
}

/* One prefix is trained at a t* that no loss moves: beta and alpha are without effect. */
TEST(fixed_steps_freeze_the_budget)
{
  sf_train_options o = small_run();
  o.fixed_steps = 3;
  o.beta = 0;
  sf_trainer *a = start(&data, &o, NULL);
  o.beta = 1;
  o.alpha = 1;
  sf_trainer *b = start(&data, &o, NULL);
  int64_t samples = 0;
  for (int i = 0; i < o.stage1 + o.stage2; i++) {
    const sf_train_stats s = steps(a, 1);
    ck_assert_double_eq(s.loss, steps(b, 1).loss);
    samples += s.samples;
    ck_assert_int_eq(s.t_r, i + 1 < o.stage1 ? 2 : 3);
    ck_assert_double_eq(s.t_star, s.t_r);
    ck_assert_int_eq(s.search.state, SF_SEARCH_NONE);
    ck_assert_double_eq_tol(s.samples_per_second * s.seconds, (double)samples, 1e-6 * (double)samples);
  }
  same_model(a, b);
  sf_trainer_free(a);
  sf_trainer_free(b);
  ck_resume(&o, &o, 20, 10);
  for (o.fixed_steps = -1; o.fixed_steps <= T + 1; o.fixed_steps += T + 2)
    ck_bad(sf_trainer_create(&a, &data, &o, NULL), SF_E_RANGE, "fixed steps", "6");
}

/* Firing costs: fewer rows are read than by the same run without. */
LONG_TEST(charged_neurons_fire_less)
{
  double reads[2], error[2];
  for (int on = 0; on < 2; on++) {
    sf_train_options o = small_run();
    o.fixed_steps = 3;
    o.stage1 = 50, o.stage2 = 200;
    o.charge = on ? 1 : 0;
    OWNED(trainer) t = start(&data, &o, NULL);
    sf_train_stats stats = {0};
    reads[on] = error[on] = 0;
    for (int i = 0; i < 250; i++) {
      ck_ok(sf_trainer_step(t, &stats));
      if (i >= 230) reads[on] += stats.row_reads, error[on] += stats.mse;
    }
    ck_assert_int_eq(t->charge.reads > 0, on);
  }
  ck_assert_double_lt(reads[1], 0.95 * reads[0]);
  ck_assert_double_gt(error[1], 0.9 * error[0]);
}

TEST(a_charged_run_resumes_bit_identically)
{
  sf_train_options o = small_run();
  o.fixed_steps = 2;
  o.charge = 0.5;
  ck_resume(&o, &o, 20, 13);
}

TEST(every_prefix_is_evaluated)
{
  OWNED(sf_dataset) test = load("test");
  const sf_train_options o = small_run();
  OWNED(trainer) t = start(&data, &o, NULL);
  steps(t, 40);
  double prefix[T], psnr, ssim;
  ck_ok(sf_evaluate_prefixes(&t->model, &test, 1, prefix));
  for (int i = 0; i < T; i++) {
    ck_ok(sf_evaluate(&t->model, &test, 1, i + 1, &psnr, &ssim));
    ck_assert_double_eq(prefix[i], psnr);
    if (i) ck_assert_double_ne(prefix[i], prefix[i - 1]);
  }
  ck_ok(sf_evaluate(&t->model, &test, 0, 0, &psnr, &ssim));
  ck_assert_double_eq(prefix[t->model.t_r - 1], psnr);
}

/* The model at the end is the mean over the last fortieth of the run: here each of the last 10 of 400 iterations. */
TEST(the_last_iterations_are_averaged)
{
  sf_train_options o = small_run();
  o.stage1 = 100;
  o.stage2 = 300;
  o.samples = 256;
  OWNED(trainer) t = start(&data, &o, NULL);
  steps(t, 390);
  ck_assert_int_eq(t->averaged, 0);
  double *sum = calloc(t->model.size, sizeof *sum);
  for (int i = 0; i < 9; i++) {
    steps(t, 1);
    ck_assert_int_eq(t->averaged, i + 1);
    for (size_t p = 0; p < t->model.size; p++) sum[p] += t->model.value[p] / 10.0;
  }
  ck_ok(sf_trainer_save(t, in("before.safetensors"), true));
  float *before = calloc(t->model.size, sizeof *before);
  memcpy(before, t->model.value, t->model.size * sizeof *before);
  ck_assert_int_eq(steps(t, 1).stage, 3);
  int moved = 0;
  for (size_t p = 0; p < t->model.size; p++) {
    const double last = t->model.value[p] * 10.0 - sum[p] * 10; /* the value that was averaged last */
    ck_assert_double_eq_tol(last, before[p], 0.05); /* one step of Adam, a few times 3e-3, and 10 roundings */
    moved += fabs(t->model.value[p] - before[p]) > 1e-5;
  }
  ck_assert_int_gt(moved, 1000);
  sf_trainer *resumed = start(&data, &o, in("before.safetensors"));
  steps(resumed, 1);
  same_model(t, resumed);
  free(sum);
  free(before);
  sf_trainer_free(resumed);
}

LONG_TEST(loss_falls_and_both_twins_learn)
{
  for (int net = SF_NET_SNN; net <= SF_NET_ANN; net++) {
    sf_train_options o = small_run();
    o.config.net = net;
    if (net == SF_NET_ANN) o.config.steps = 1;
    o.stage1 = 150;
    o.stage2 = 150;
    OWNED(trainer) t = start(&data, &o, NULL);
    sf_train_stats stats;
    double first = 0, last = 0;
    for (int i = 0; i < 300; i++) {
      ck_ok(sf_trainer_step(t, &stats));
      if (i < 10) first += stats.mse;
      if (i >= 290) last += stats.mse;
    }
    ck_assert_double_lt(last, 0.5 * first);
    ck_assert_double_ge(stats.t_star, 1);
    ck_assert_double_le(stats.t_star, o.config.steps);
  }
}

/* Colour, background and target equal: every term but g2 sum log(1 + 2 sigma) is flat. */
TEST(sparsity_by_hand)
{
  sf_ray_work w;
  ck_ok(sf_ray_work_create(&w, 1));
  const sf_ray ray = {.target = {0.5f, 0.5f, 0.5f}, .background = {0.5f, 0.5f, 0.5f}, .count = 1};
  w.sigma[T - 1][0] = 3;
  for (int c = 0; c < 3; c++) w.colour[T - 1][c] = 0.5f;
  const sf_loss_plan plan = {.steps = T, .regular_at = T, .weight = {[T - 1] = 1}, .inverse_rays = 0.25f};
  const float delta = 0.05f;
  sf_loss_sums sums = {0};
  sf_loss_ray(&plan, &ray, &delta, &w, &sums);
  ck_assert_double_eq_tol(w.dsigma[T - 1][0], 0.25 * 1e-6 * 2 / 7, 1e-9);
  ck_assert_double_eq_tol(sums.regular, 1e-6 * log(7), 1e-8);
  free(w.memory);
}

/* Few rays may all pass by a small box: more are drawn. */
TEST(few_rays_that_miss_are_no_fault)
{
  for (int net = SF_NET_SNN; net <= SF_NET_ANN; net++)
    for (int away = 0; away < 2; away++) {
      OWNED(sf_dataset) small;
      ck_ok(sf_dataset_load(&small, in("scene"), "train",
                            &(sf_dataset_options){.downscale = 1, .scale = away ? 40 : 12}));
      sf_train_options o = small_run();
      o.samples = 256, o.stage1 = 20, o.stage2 = 20, o.config.net = net, o.config.scale = small.scale;
      if (net == SF_NET_ANN) o.config.steps = 1;
      OWNED(trainer) t = start(&small, &o, NULL);
      sf_train_stats stats = {0};
      sf_status status = sf_ok();
      while (!status.code && stats.stage != 3) status = sf_trainer_step(t, &stats);
      if (away)
        ck_bad(status, SF_E_RANGE, "none of 32768 rays", "meets the box");
      else
        ck_ok(status);
    }
}

int ck_timeout = 180;
ck_options ck_program = {.set_up_all = set_up, .tear_down_all = close_scene, .one_process = true};
