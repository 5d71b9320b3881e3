/* What short runs of the trainer do, iteration by iteration, and what becomes of the parameters: numbers that are kept,
 * with the portable kernels. */
#include "ck_run.h"
#include "expected.h"
#include "train_fixture.h"
#include <omp.h>

static const double TOLERANCE = 1e-3; /* mathematical libraries may differ in a last bit, which grows */

static void say_iteration(FILE *out, const sf_train_stats *s, const sf_trainer *t)
{
  fprintf(out,
          "%d stage %d progress %.6g loss %.6g mse %.6g t* %.6g t_r %d rays %d samples %d lattice %d occupied %.4g",
          (int)s->iteration, s->stage, s->progress, s->loss, s->mse, s->t_star, s->t_r, s->rays, s->samples, s->lattice,
          s->occupied);
  fprintf(out, " firing %.5g %.5g %.5g reads %.5g stride %d epoch %.5g all %d\n", s->firing[0], s->firing[1],
          s->firing[2], s->row_reads, t->stride, t->epoch, (int)t->samples);
}

static void say_search(FILE *out, const sf_search_report *s)
{
  fprintf(out, "  search %s measured %d worth %.5g +- %.5g price %.5g +- %.5g beta %.5g saving %.5g step %.5g prefixes",
          sf_search_names[s->state], s->measured, s->worth, s->worth_error, s->price, s->price_error, s->beta,
          s->saving, s->step_energy);
  for (int i = 0; i < T; i++) fprintf(out, " %.5g", s->prefix_mse[i]);
  fprintf(out, "\n");
}

/* Sums that do not cancel. */
static void say_parameters(FILE *out, const sf_trainer *t)
{
  for (int id = 0; id < SF_P_COUNT; id++) {
    const sf_param *p = &t->model.param[id];
    double sum[4] = {0};
    if (!p->name || !p->size) continue;
    for (size_t i = 0; i < p->size; i++) {
      const double value = (double)t->model.value[p->offset + i];
      sum[0] += fabs(value), sum[1] += value * value;
      sum[2] += fabs((double)t->moment1[p->offset + i]), sum[3] += (double)t->moment2[p->offset + i];
    }
    fprintf(out, "  %s %.5g %.5g moments %.5g %.5g\n", p->name, sum[0], sum[1], sum[2], sum[3]);
  }
}

/* every: a line for each so many iterations. */
static void say_run(FILE *out, const char *title, const sf_train_options *o, int every)
{
  OWNED(trainer) t = start(&data, o, NULL);
  sf_train_stats s = {0};
  fprintf(out, "%s\n", title);
  for (int i = 0; s.stage != 3; i++) {
    s = steps(t, 1);
    if (i % every == every - 1) say_iteration(out, &s, t);
  }
  say_search(out, &s.search);
  fprintf(out, "  tau");
  for (int l = 0; l < SF_LAYERS; l++) fprintf(out, " %.5g", s.tau[l]);
  fprintf(out, " averaged %d charge %.5g %.5g\n", t->averaged, t->charge.error, t->charge.reads);
  say_parameters(out, t);
}

static sf_train_options quick_run(void)
{
  sf_train_options o = small_run();
  o.config.hidden = 16, o.config.steps = 4, o.config.lattice = 64, o.config.levels = 2, o.samples = 256;
  return o;
}

static void searches(FILE *out)
{
  sf_train_options o = quick_run();
  o.stage1 = 4, o.stage2 = 44, o.beta = 3e-6;
  say_run(out, "beta", &o, 4);
  o.config.mode = SF_HYBRID, o.objective = SF_OBJECTIVE_PAPER, o.stage2 = 30, o.beta = 1e-5;
  say_run(out, "the paper's objective", &o, 4);
  o.config.mode = SF_RADIX, o.objective = SF_OBJECTIVE_PREFIXES, o.price = SF_PRICE_ENERGY, o.stage2 = 12,
  o.beta = 1e-2, o.search_rate = 2, o.alpha = 1;
  say_run(out, "the price of energy", &o, 4);
  o = quick_run();
  o.stage1 = 4, o.stage2 = 24, o.target_loss = 0.3;
  say_run(out, "a target of loss", &o, 4);
  o.target_loss = 0, o.target_saving = 60;
  say_run(out, "a target of saving", &o, 4);
}

static void plain_runs(FILE *out)
{
  sf_train_options o = quick_run();
  o.stage1 = 4, o.stage2 = 8, o.fixed_steps = 3, o.charge = 1;
  say_run(out, "three steps, charged", &o, 2);
  o.charge = 0, o.no_extra = o.no_distill = o.no_scaling = true;
  say_run(out, "without the further losses", &o, 4);
  o.no_extra = o.no_distill = o.no_scaling = false, o.no_stage1 = true, o.background = 1, o.alpha *= 5;
  say_run(out, "without stage I, on white", &o, 4);
  o = quick_run();
  o.config.net = SF_NET_ANN, o.config.mode = SF_HYBRID, o.config.steps = 1, o.stage1 = 4, o.stage2 = 8,
  o.background = 2;
  say_run(out, "the twin, on black", &o, 4);
  o = quick_run();
  o.config.mode = SF_HYBRID, o.config.along = 1, o.config.steps = 1, o.stage1 = 4, o.stage2 = 8;
  say_run(out, "along rays", &o, 4);
  o = quick_run();
  const int finest = o.config.finest_res;
  sf_config_bound(&o.config, 4);
  o.config.finest_res = finest, o.stage1 = 4, o.stage2 = 8, o.seed = 3, o.lr_grid *= 2;
  say_run(out, "in three cascades", &o, 4);
}

static sf_train_options planes_run(sf_net_kind net)
{
  sf_train_options o = sf_train_defaults_tensorf(&data);
  o.config.net = net, o.config.steps = net == SF_NET_ANN ? 1 : 3, o.config.hidden = 16;
  o.config.occ_res = 16, o.voxels = 20, o.rays = 64, o.samples = 2048, o.stage1 = 20, o.stage2 = 40;
  for (int a = 0; a < 3; a++) o.config.tensorf.resolution[a] = 12 + a;
  return o;
}

static void say_forward_run(FILE *out)
{
  const sf_dataset before = data;
  sf_view view[6];
  data = facing_forward(&before, view);
  sf_train_options o = planes_run(SF_NET_SNN);
  say_run(out, "TensoRF in NDC", &o, 5);
  data = before;
}

static void planes(FILE *out)
{
  sf_train_options o = planes_run(SF_NET_SNN);
  o.stage1 = 6, o.stage2 = 12;
  say_run(out, "TensoRF", &o, 3);
  o = planes_run(SF_NET_ANN);
  say_run(out, "TensoRF's twin", &o, 5);
  say_forward_run(out);
}

/* What a checkpoint holds, and what it is called. */
static void say_checkpoint(FILE *out, const sf_train_options *o, int iterations)
{
  OWNED(trainer) t = start(&data, o, NULL);
  sf_tensors set;
  steps(t, iterations);
  for (int whole = 0; whole < 2; whole++) {
    ck_ok(sf_trainer_save(t, in("c.safetensors"), whole));
    ck_ok(sf_tensors_load(&set, in("c.safetensors")));
    fprintf(out, whole ? "checkpoint\n" : "model\n");
    for (int i = 0; i < set.count; i++) {
      const sf_tensor *s = &set.tensor[i];
      fprintf(out, "  %s %d:", s->name, s->type);
      for (int d = 0; d < s->dims; d++) fprintf(out, " %d", (int)s->shape[d]);
      fprintf(out, "\n");
    }
    const cJSON *word;
    cJSON_ArrayForEach(word, set.metadata)
    {
      if (strcmp(word->string, "train.seconds") != 0) fprintf(out, "  %s = %s\n", word->string, word->valuestring);
    }
    sf_tensors_free(&set);
  }
}

static void checkpoints(FILE *out)
{
  sf_train_options o = quick_run();
  sf_config_bound(&o.config, 2);
  o.config.finest_res = 64, o.fixed_steps = 2, o.charge = 1, o.stage1 = 2, o.stage2 = 80, o.seed = 9;
  say_checkpoint(out, &o, 81);
  o = planes_run(SF_NET_SNN);
  o.stage1 = 6, o.stage2 = 12;
  say_checkpoint(out, &o, 9);
}

TEST(checkpoints_whole)
{
  ck_expected_text_about("train-checkpoint.txt", out, checkpoints(out), TOLERANCE);
}

TEST(runs_that_search)
{
  ck_expected_text_about("train-search.txt", out, searches(out), TOLERANCE);
}

TEST(runs_of_a_hash_grid)
{
  ck_expected_text_about("train-grid.txt", out, plain_runs(out), TOLERANCE);
}

TEST(runs_of_planes)
{
  ck_expected_text_about("train-planes.txt", out, planes(out), TOLERANCE);
}

/* Of nothing in an empty box: white pictures are met exactly, black ones not at all. */
TEST(scores_of_an_empty_box)
{
  sf_view view[4] = {{.image.rgba = NULL}};
  const sf_dataset set = {.path = "set", .view = view, .count = 4};
  sf_train_options o = quick_run();
  OWNED(trainer) t = start(&data, &o, NULL);
  memset(t->model.occupancy, 0, sf_config_cells(&o.config) / 8);
  for (int v = 1; v < 4; v++) {
    const int width = v == 3 ? 10 : 11, height = 12, pixels = width * height;
    view[v].camera = data.view[0].camera;
    view[v].image = (sf_image){width, height, malloc((size_t)pixels * 4 * sizeof(uint16_t))};
    for (int i = 0; i < 4 * pixels; i++) view[v].image.rgba[i] = v == 2 && i % 4 < 3 ? 0 : 65535;
  }
  double psnr, ssim[2];
  ck_ok(sf_evaluate(&t->model, &set, 1, 1, &psnr, &ssim[0]));
  ck_assert_double_eq(psnr, 99);
  ck_assert_double_eq_tol(ssim[0], 1, 1e-6);
  ck_ok(sf_evaluate(&t->model, &set, 2, 0, &psnr, &ssim[1])); /* the first has no picture */
  ck_assert_double_eq(psnr, 49.5);
  ck_assert_double_lt(ssim[1], 0.51);
  ck_ok(sf_evaluate(&t->model, &set, 0, 1, &psnr, &ssim[0]));
  ck_assert_double_eq(psnr, 66);
  ck_assert_double_eq(ssim[0], ssim[1]); /* the third is too narrow for one */
  for (int i = 0; i < 10 * 12; i++) view[3].image.rgba[4 * i] = 0, view[3].image.rgba[4 * i + 3] = 0; /* see-through */
  free(view[1].image.rgba), free(view[2].image.rgba);
  view[1].image.rgba = view[2].image.rgba = NULL;
  ck_ok(sf_evaluate(&t->model, &set, 0, 1, &psnr, &ssim[0]));
  ck_assert_double_eq(psnr, 99);
  ck_assert(isnan(ssim[0]));
  free(view[3].image.rgba);
  view[3].image.rgba = NULL;
  ck_bad(sf_evaluate(&t->model, &set, 0, 1, &psnr, &ssim[0]), SF_E_FORMAT, "set: no view", "picture");
}

/* By what the data are. */
static void defaults(FILE *out)
{
  static const int widths[] = {200, 599, 600, 602, 800, 1000, 1008, 1600};
  for (int layout = 0; layout < 4; layout++)
    for (int w = 0; w < COUNT(widths); w++) {
      sf_view view = {.camera = data.view[0].camera};
      sf_dataset d = {.layout = (sf_layout)layout, .view = &view, .count = w == 4 ? 0 : 1, .scale = 0.5f, .bound = 4};
      view.camera.width = widths[w], d.ndc = layout == SF_LAYOUT_LLFF;
      const sf_train_options o = sf_train_defaults_tensorf(&d);
      const sf_tensorf *f = &o.config.tensorf;
      fprintf(out, "%s of %d: rates %g %g background %d rays %d samples %d voxels %d box", sf_layout_names[layout],
              widths[w], o.lr_grid, o.lr_net, o.background, o.rays, o.samples, o.voxels);
      for (int i = 0; i < 6; i++) fprintf(out, " %.4g", (double)f->box[i / 3][i % 3]);
      fprintf(out, " grid %d %d %d bound %d scale %g hidden %d\n", f->resolution[0], f->resolution[1], f->resolution[2],
              o.config.bound, (double)o.config.scale, o.config.hidden);
    }
  const sf_train_options o = sf_train_defaults();
  fprintf(out, "beta %g objective %d price %d search %g alpha %g stages %d %d minutes %g samples %d rates %g %g\n",
          o.beta, o.objective, o.price, o.search_rate, o.alpha, o.stage1, o.stage2, o.minutes, o.samples, o.lr_grid,
          o.lr_net);
}

TEST(defaults_by_the_data)
{
  ck_expected_text("train-defaults.txt", out, defaults(out));
}

/* Before anything has asked which kernels there are. */
static void set_up(void)
{
  setenv("SPIKEFIELD_CPU", "portable", 1);
  omp_set_num_threads(1);
  open_scene(6);
}

int ck_timeout = 180;
ck_options ck_program = {.set_up_all = set_up, .tear_down_all = close_scene, .one_process = true};
