/* sf_train: learns a spiking radiance field and its time budget from posed images. */
#include "quant/quant.h"
#include "tools/train/report.h"
#include "tools/train/watch.h"
#include "base/clock.h"
#include <errno.h>
#include <math.h>
#include <string.h>

/* What the run has saved, and what it could not. */
typedef struct keeper {
  bool good;     /* there is a checkpoint */
  bool told;     /* that there could be none */
  bool finished; /* the model is saved, in place of a checkpoint */
} keeper;

static void warn_full(keeper *k, const sf_status *why)
{
  if (!k->told) fprintf(stderr, "sf_train: warning: %s: no checkpoint, the run goes on\n", why->message);
  k->told = true;
}

/* A disk that is full now may not be later, and a model is smaller: only what must be saved now has to be. */
static sf_status checkpoint(const sf_trainer *trainer, const train_arguments *a, bool now, sf_progress *progress,
                            keeper *k)
{
  const sf_status status = sf_trainer_save(trainer, a->output, true);
  if (!status.code) k->good = true;
  if (now || status.code != SF_E_IO) return status;
  sf_progress_end(progress);
  warn_full(k, &status);
  return sf_ok();
}

/* The evaluation can be interrupted, too. Where no checkpoint can be written, the model itself may still fit. */
static sf_status keep_learned(const sf_trainer *trainer, const train_arguments *a, keeper *k)
{
  const sf_status status = sf_trainer_save(trainer, a->output, true);
  k->good = !status.code;
  if (status.code != SF_E_IO) return status;
  SF_TRY(sf_trainer_save(trainer, a->output, false));
  k->finished = true;
  warn_full(k, &status);
  return sf_ok();
}

static sf_status loop(sf_trainer *trainer, const train_arguments *a, FILE *log, train_watch *watch, sf_train_stats *s,
                      keeper *k)
{
  sf_progress progress;
  train_recent r = {0};
  double tried = sf_seconds();
  k->good = a->resume;
  sf_progress_begin(&progress, a->quiet);
  do {
    sf_status status = sf_trainer_step(trainer, s);
    if (status.code) {
      sf_progress_end(&progress);
      return k->good ? sf_fail(status.code, "%s (last good checkpoint: %s)", status.message, a->output) : status;
    }
    sf_view_training_step(watch->page, sf_trainer_model(trainer), s);
    train_smooth(&r, s);
    train_warn(&progress, s);
    if (s->iteration % 16 == 0 || s->stage == 3) train_log_line(log, s, sf_trainer_model(trainer)->config.steps);
    if (sf_progress_due(&progress)) train_show(&progress, s, &r);
    const bool stop = sf_cli_interrupted() && s->stage != 3;
    if (s->stage != 3 && (stop || sf_seconds() - tried > 60 * a->checkpoint_minutes)) {
      SF_TRY(checkpoint(trainer, a, stop, &progress, k));
      tried = sf_seconds();
    }
    if (stop) {
      sf_progress_end(&progress);
      return sf_fail(SF_E_STOPPED, "interrupted at iteration %lld; continue with --resume (checkpoint: %s)",
                     (long long)s->iteration, a->output);
    }
  } while (s->stage != 3);
  train_show(&progress, s, &r);
  sf_progress_end(&progress);
  return ferror(log) ? sf_fail(SF_E_IO, "%s: cannot write the log", a->log) : sf_ok();
}

static sf_status stopped_evaluation(const train_arguments *a, const keeper *k)
{
  if (k->finished) return sf_fail(SF_E_STOPPED, "interrupted in the evaluation; the model is saved: %s", a->output);
  return sf_fail(SF_E_STOPPED, "interrupted in the evaluation; continue with --resume (checkpoint: %s)", a->output);
}

static sf_status evaluate_prefixes(const sf_model *model, const sf_dataset *one, int before, train_quality *q)
{
  double prefix[SF_T_MAX];
  q->prefixes = model->config.steps;
  SF_TRY(sf_evaluate_prefixes(model, one, 1, prefix));
  for (int i = 0; i < q->prefixes; i++) q->prefix[i] += (prefix[i] - q->prefix[i]) / (before + 1);
  return sf_ok();
}

/* Views with a picture of which something is to be computed. */
static int count_views(const sf_dataset *test, const train_arguments *a)
{
  const int most = !a->eval_views ? test->count : a->eval_views > a->prefix_views ? a->eval_views : a->prefix_views;
  int pictures = 0;
  for (int v = 0; v < test->count; v++) pictures += test->view[v].image.rgba != NULL;
  return pictures < most ? pictures : most;
}

/* View by view, so that it shows where it is and stops when asked to. */
static sf_status evaluate_views(const sf_model *model, const sf_dataset *test, const train_arguments *a,
                                const keeper *k, train_quality *q)
{
  sf_progress progress;
  sf_status status = sf_ok();
  const int all = count_views(test, a);
  const double start = sf_seconds();
  sf_progress_begin(&progress, a->quiet);
  double ssims = 0;
  for (int v = 0, done = 0, compared = 0; done < all && v < test->count && !status.code; v++) {
    const bool whole = !a->eval_views || done < a->eval_views, prefixes = done < a->prefix_views;
    if (!test->view[v].image.rgba) continue;
    if (sf_cli_interrupted()) {
      status = stopped_evaluation(a, k);
      break;
    }
    if (sf_progress_due(&progress)) train_show_evaluation(&progress, done, all, sf_seconds() - start);
    sf_dataset one = *test;
    one.view = &test->view[v], one.count = 1;
    double psnr = 0, ssim = 0;
    if (whole) {
      status = sf_evaluate(model, &one, 1, 0, &psnr, &ssim);
      q->views = done + 1;
      q->width = one.view->camera.width, q->height = one.view->camera.height;
      q->psnr += (psnr - q->psnr) / q->views;
      if (!isnan(ssim)) ssims += ssim, compared++;
      q->ssim = compared ? ssims / compared : NAN;
    }
    if (prefixes && !status.code) status = evaluate_prefixes(model, &one, done, q);
    done++;
  }
  sf_progress_end(&progress);
  if (!status.code && !q->views) status = sf_fail(SF_E_FORMAT, "%s: no view with a picture to evaluate on", test->path);
  return status;
}

static sf_status load_test(sf_dataset *test, const char *data_path, const sf_dataset_options *how,
                           const train_arguments *a, bool cameras_only)
{
  sf_dataset_options options = *how;
  options.limit = !a->eval_views || a->eval_views > a->prefix_views ? a->eval_views : a->prefix_views;
  options.cameras_only = cameras_only;
  return sf_dataset_load(test, data_path, "test", &options);
}

/* The faults of what is evaluated on, before anything is learned. */
static sf_status check_test(const sf_dataset *data, const char *data_path, const sf_dataset_options *how,
                            const train_arguments *a)
{
  sf_dataset test;
  SF_TRY(load_test(&test, data_path, how, a, true));
  sf_dataset_warn(stderr, "sf_train", &test, data);
  const sf_status status = sf_dataset_agree(data, &test);
  sf_dataset_free(&test);
  return status;
}

static sf_status evaluate(const sf_model *model, const char *data_path, const sf_dataset_options *how,
                          const train_arguments *a, const keeper *k, train_quality *q)
{
  sf_dataset test;
  SF_TRY(load_test(&test, data_path, how, a, false));
  q->layout = sf_layout_names[test.layout];
  sf_status status = evaluate_views(model, &test, a, k, q);
  sf_dataset_free(&test);
  return status;
}

static sf_status finish(const sf_trainer *trainer, const char *data_path, const sf_dataset_options *how,
                        const train_arguments *a, const sf_train_stats *s, const keeper *k)
{
  const sf_model *model = sf_trainer_model(trainer);
  train_quality q = {0};
  SF_TRY(evaluate(model, data_path, how, a, k, &q));
  return train_report(a, &model->config, s, &q);
}

static sf_status learn(sf_trainer *trainer, const train_arguments *a, train_watch *watch, sf_train_stats *stats,
                       keeper *k)
{
  if (stats->stage == 3) return sf_ok();
  FILE *log = fopen(a->log, a->resume ? "a" : "w");
  if (!log) return sf_fail(SF_E_IO, "%s: cannot open the log for writing: %s", a->log, strerror(errno));
  setvbuf(log, NULL, _IOLBF, 0);
  sf_status status = loop(trainer, a, log, watch, stats, k);
  if (fclose(log) && !status.code) status = sf_fail(SF_E_IO, "%s: cannot write the log", a->log);
  return status.code ? status : keep_learned(trainer, a, k);
}

static sf_status train_and_report(const char *path, const sf_dataset *data, const sf_dataset_options *how,
                                  const train_arguments *a)
{
  sf_trainer *trainer;
  SF_TRY(sf_trainer_create(&trainer, data, &a->train, a->resume ? a->output : NULL));
  sf_train_stats stats = sf_trainer_stats(trainer);
  sf_status status = sf_ok();
  keeper k = {0};
  train_watch watch;
  status = train_watch_open(&watch, a, path, how);
  if (!status.code && sf_cli_interrupted())
    status = sf_fail(SF_E_STOPPED, "interrupted before the training: nothing was written");
  if (!status.code) status = learn(trainer, a, &watch, &stats, &k);
  if (!status.code) status = finish(trainer, path, how, a, &stats, &k);
  if (!status.code && !k.finished) status = sf_trainer_save(trainer, a->output, false);
  train_watch_close(&watch);
  sf_trainer_free(trainer);
  return status;
}

/* The model to fine-tune, with the scales that sf_export would choose for it. */
static sf_status load_start(const train_arguments *a, const sf_dataset *data, sf_model *model)
{
  const sf_quant_options how = {.widths = {.weight_bits = a->weight_bits ? a->weight_bits : SF_WEIGHT_BITS,
                                           .leak_bits = a->leak_bits ? a->leak_bits : SF_LEAK_FRAC,
                                           .grid_bits = a->grid_bits ? a->grid_bits : SF_GRID_BITS}};
  sf_quant_report report;
  fx_scene scene;
  SF_TRY(sf_model_load(model, a->fine_tune));
  sf_status status = sf_quantise_report(&scene, model, a->fine_tune, &how, &report);
  if (!status.code) {
    fx_scene_free(&scene);
    model->scales = report.scales;
    status = sf_space_check(&model->config.space, a->fine_tune, data);
    if (!status.code && fabsf(model->config.scale - data->scale) > 1e-6f * data->scale)
      status = sf_fail(SF_E_RANGE, "%s: metadata 'scale' is %g, the data has %g (see --scale)", a->fine_tune,
                       (double)model->config.scale, (double)data->scale);
  }
  if (status.code) sf_model_free(model);
  return status;
}

static sf_status run(train_arguments *a, const char *path)
{
  sf_dataset data;
  const sf_dataset_options how = {.downscale = a->downscale, .scale = (float)a->scale, .limit = a->limit};
  SF_TRY(sf_dataset_load(&data, path, "train", &how));
  sf_dataset_warn(stderr, "sf_train", &data, NULL);
  sf_model start = {0};
  sf_status status = check_test(&data, path, &how, a);
  if (!status.code) status = train_settle(a, &data);
  if (!status.code && a->fine_tune && !a->resume) {
    status = load_start(a, &data, &start);
    a->train.start = &start;
  }
  if (!status.code) status = train_and_report(path, &data, &how, a);
  sf_model_free(&start);
  sf_dataset_free(&data);
  return status;
}

int main(int argc, char **argv)
{
  train_arguments a;
  sf_option options[TRAIN_OPTIONS_MAX];
  const char *path[1] = {NULL};
  train_defaults(&a, argc, argv);
  const sf_cli cli = train_cli(&a, options);
  sf_status status = train_parse(&a, path);
  if (!status.code) status = run(&a, path[0]);
  train_arguments_free(&a);
  return sf_cli_finish(&cli, status);
}
