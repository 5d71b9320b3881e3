/* sf_train: learns a spiking radiance field and its time budget from posed images. */
#include "quant/quant.h"
#include "tools/train/keeper.h"
#include "tools/train/report.h"
#include "tools/train/watch.h"
#include "cli/finish_ranks.h"
#include "base/clock.h"
#include <errno.h>
#include <math.h>
#include <string.h>

/* After an iteration: rank 0 tells and saves; each says whether it was interrupted. */
typedef struct teller {
  sf_progress progress;
  train_recent recent;
  FILE *log;
  train_watch *watch;
  double tried; /* to save */
} teller;

static sf_status after_step(const sf_trainer *trainer, const train_arguments *a, const sf_train_stats *s, teller *w,
                            keeper *k)
{
  const bool stop = sf_cli_interrupted() && s->stage != 3;
  if (sf_ranks_rank(a->train.ranks)) return stop ? sf_fail(SF_E_STOPPED, "interrupted") : sf_ok();
  sf_view_training_step(w->watch->page, sf_trainer_model(trainer), s);
  train_smooth(&w->recent, s);
  train_warn(&w->progress, s);
  if (s->iteration % 16 == 0 || s->stage == 3) train_log_line(w->log, s, sf_trainer_model(trainer)->config.steps);
  if (sf_progress_due(&w->progress)) train_show(&w->progress, s, &w->recent);
  if (stop) return sf_fail(SF_E_STOPPED, "interrupted");
  if (s->stage != 3 && sf_seconds() - w->tried > 60 * a->checkpoint_minutes) {
    SF_TRY(keeper_checkpoint(trainer, a, false, &w->progress, k));
    w->tried = sf_seconds();
  }
  return sf_ok();
}

static sf_status interrupted(const sf_trainer *trainer, const train_arguments *a, const sf_train_stats *s, teller *w,
                             keeper *k)
{
  SF_TRY(keeper_checkpoint(trainer, a, true, &w->progress, k));
  sf_progress_end(&w->progress);
  return sf_fail(SF_E_STOPPED, "interrupted at iteration %lld; continue with --resume (checkpoint: %.300s%s%.300s)",
                 (long long)s->iteration, a->output, k->aside ? "; what was there is " : "",
                 k->aside ? keeper_before(a) : "");
}

static sf_status loop(sf_trainer *trainer, const train_arguments *a, FILE *log, train_watch *watch, sf_train_stats *s,
                      keeper *k)
{
  teller w = {.log = log, .watch = watch, .tried = sf_seconds()};
  k->good = a->resume;
  sf_progress_begin(&w.progress, a->quiet);
  do {
    sf_status status = sf_trainer_step(trainer, s);
    const bool trained = !status.code;
    if (trained) status = after_step(trainer, a, s, &w, k);
    if (!sf_ranks_lost(a->train.ranks)) status = sf_ranks_agree(a->train.ranks, status);
    if (trained && status.code == SF_E_STOPPED && !sf_ranks_lost(a->train.ranks))
      return interrupted(trainer, a, s, &w, k);
    if (status.code) {
      sf_progress_end(&w.progress);
      return k->good ? sf_fail(status.code, "%.300s (last good checkpoint: %.90s)", status.message, a->output) : status;
    }
  } while (s->stage != 3);
  if (!log) return sf_ok();
  train_show(&w.progress, s, &w.recent);
  sf_progress_end(&w.progress);
  return sf_ok();
}

static sf_status stopped_evaluation(const train_arguments *a, const keeper *k)
{
  if (k->finished) return sf_fail(SF_E_STOPPED, "interrupted in the evaluation; the model is saved: %s", a->output);
  return sf_fail(SF_E_STOPPED, "interrupted in the evaluation; continue with --resume (checkpoint: %s)", a->output);
}

/* Views with a picture of which something is to be computed. */
static int count_views(const sf_dataset *test, const train_arguments *a)
{
  const int most = !a->eval_views ? test->count : a->eval_views > a->prefix_views ? a->eval_views : a->prefix_views;
  int pictures = 0;
  for (int v = 0; v < test->count; v++) pictures += test->view[v].image.rgba != NULL;
  return pictures < most ? pictures : most;
}

/* A view is a unit of work. */
typedef struct examination {
  const sf_model *model;
  const sf_dataset *test;
  const train_arguments *a;
  train_quality *q;
  sf_progress progress;
  double start, ssims;
  int all, done, compared;
  sf_status status;
} examination;

typedef struct view_quality {
  sf_status status;
  double psnr, ssim, prefix[SF_T_MAX];
  sf_ray_events events;
} view_quality;

static bool is_whole(const examination *e, int unit)
{
  return !e->a->eval_views || unit < e->a->eval_views;
}

/* Number `unit` of those with a picture. */
static sf_dataset one_view(const examination *e, int unit)
{
  sf_dataset one = *e->test;
  for (one.view = e->test->view; !one.view->image.rgba || unit--;) one.view++;
  one.count = 1;
  return one;
}

static void show_examination(void *user)
{
  examination *e = user;
  if (sf_progress_due(&e->progress)) train_show_evaluation(&e->progress, e->done, e->all, sf_seconds() - e->start);
}

static void examine(void *user, uint64_t unit, void *result)
{
  examination *e = user;
  view_quality *v = result;
  const sf_dataset one = one_view(e, (int)unit);
  if (sf_ranks_size(e->a->train.ranks) == 1) show_examination(e);
  v->events = (sf_ray_events){0};
  if (is_whole(e, (int)unit)) v->status = sf_evaluate_counted(e->model, &one, 1, 0, &v->psnr, &v->ssim, &v->events);
  if ((int)unit < e->a->prefix_views && !v->status.code) v->status = sf_evaluate_prefixes(e->model, &one, 1, v->prefix);
  v->status = sf_ranks_named(e->a->train.ranks, v->status);
}

static bool take_view(void *user, uint64_t unit, const void *result)
{
  examination *e = user;
  const view_quality *v = result;
  train_quality *q = e->q;
  const sf_dataset one = one_view(e, (int)unit);
  e->status = v->status;
  if (is_whole(e, (int)unit)) {
    q->views = (int)unit + 1;
    q->width = one.view->camera.width, q->height = one.view->camera.height;
    q->psnr += (v->psnr - q->psnr) / q->views;
    sf_events_add(&q->events, &v->events);
    if (!isnan(v->ssim)) e->ssims += v->ssim, e->compared++;
    q->ssim = e->compared ? e->ssims / e->compared : NAN;
  }
  if ((int)unit < e->a->prefix_views) {
    q->prefixes = e->model->config.steps;
    for (int i = 0; i < q->prefixes; i++) q->prefix[i] += (v->prefix[i] - q->prefix[i]) / (double)(unit + 1);
  }
  e->done++;
  return !v->status.code;
}

/* View by view, so that it shows where it is and stops when asked to. */
static sf_status evaluate_views(const sf_model *model, const sf_dataset *test, const train_arguments *a,
                                const keeper *k, train_quality *q)
{
  examination e = {.model = model, .test = test, .a = a, .q = q, .start = sf_seconds()};
  e.all = count_views(test, a);
  const sf_deal deal = {.end = (uint64_t)e.all,
                        .result_size = sizeof(view_quality),
                        .work = examine,
                        .take = take_view,
                        .tick = show_examination,
                        .user = &e};
  sf_progress_begin(&e.progress, a->quiet);
  sf_status status = sf_ranks_deal(a->train.ranks, &deal);
  sf_progress_end(&e.progress);
  if (status.code == SF_E_STOPPED) return stopped_evaluation(a, k);
  if (!status.code) status = e.status;
  if (!status.code && !q->views && !sf_ranks_rank(a->train.ranks))
    status = sf_fail(SF_E_FORMAT, "%s: no view with a picture to evaluate on", test->path);
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
  if (!sf_ranks_rank(a->train.ranks)) sf_dataset_warn(stderr, "sf_train", &test, data);
  const sf_status status = sf_dataset_agree(data, &test);
  sf_dataset_free(&test);
  return status;
}

static sf_status evaluate(const sf_model *model, const char *data_path, const sf_dataset_options *how,
                          const train_arguments *a, const keeper *k, train_quality *q)
{
  sf_dataset test;
  const sf_status loaded = load_test(&test, data_path, how, a, false), all = sf_ranks_agree(a->train.ranks, loaded);
  if (all.code && !loaded.code) sf_dataset_free(&test);
  SF_TRY(all);
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
  return sf_ranks_rank(a->train.ranks) ? sf_ok() : train_report(a, model, s, &q);
}

static sf_status open_log(const train_arguments *a, FILE **log)
{
  *log = NULL;
  if (sf_ranks_rank(a->train.ranks)) return sf_ok();
  *log = fopen(a->log, a->resume ? "a" : "w");
  if (!*log) return sf_fail(SF_E_IO, "%s: cannot open the log for writing: %s", a->log, strerror(errno));
  setvbuf(*log, NULL, _IOLBF, 0);
  return sf_ok();
}

static sf_status learn(sf_trainer *trainer, const train_arguments *a, train_watch *watch, sf_train_stats *stats,
                       keeper *k)
{
  FILE *log;
  if (stats->stage == 3) return sf_ok();
  SF_TRY(sf_ranks_agree(a->train.ranks, open_log(a, &log)));
  sf_status status = loop(trainer, a, log, watch, stats, k);
  const bool cut = log && ferror(log);
  const bool logged = !log || (!fclose(log) && !cut);
  if (!status.code) status = keeper_learned(trainer, a, k);
  if (!status.code && !logged)
    status = sf_fail(SF_E_IO, "%s: cannot write the log; the model is saved: %s", a->log, a->output);
  return sf_ranks_lost(a->train.ranks) ? status : sf_ranks_agree(a->train.ranks, status);
}

static sf_status train_and_report(const char *path, const sf_dataset *data, const sf_dataset_options *how,
                                  const train_arguments *a)
{
  sf_trainer *trainer;
  sf_ranks *ranks = a->train.ranks;
  SF_TRY(sf_trainer_create(&trainer, data, &a->train, a->resume ? a->output : NULL));
  sf_train_stats stats = sf_trainer_stats(trainer);
  sf_status status;
  keeper k = {0};
  train_watch watch;
  status = train_watch_open(&watch, a, path, how);
  if (!status.code && sf_cli_interrupted())
    status = sf_fail(SF_E_STOPPED, "interrupted before the training: nothing was written");
  status = sf_ranks_agree(ranks, status);
  if (!status.code) status = learn(trainer, a, &watch, &stats, &k);
  if (!status.code) status = finish(trainer, path, how, a, &stats, &k);
  if (!status.code && !sf_ranks_rank(ranks)) status = keeper_finish(trainer, a, &k);
  train_watch_close(&watch);
  sf_trainer_free(trainer);
  return status;
}

/* The model to fine-tune, with the scales that sf_export would choose for it. */
static sf_status load_start(const train_arguments *a, sf_dataset *data, sf_model *model)
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

static sf_status prepare(train_arguments *a, const char *path, const sf_dataset_options *how, sf_dataset *data,
                         sf_model *start)
{
  SF_TRY(sf_dataset_load(data, path, "train", how));
  if (!sf_ranks_rank(a->train.ranks)) sf_dataset_warn(stderr, "sf_train", data, NULL);
  SF_TRY(check_test(data, path, how, a));
  SF_TRY(train_settle(a, data));
  const int told = data->warnings;
  if (a->fine_tune && !a->resume) {
    SF_TRY(load_start(a, data, start));
    a->train.start = start;
  } else if (a->train.config.backbone == SF_INGP && !data->ndc) {
    SF_TRY(sf_dataset_survey_box(data, a->train.config.bound));
  }
  const sf_dataset more = {.warning = data->warning + told, .warnings = data->warnings - told};
  if (!sf_ranks_rank(a->train.ranks)) sf_dataset_warn(stderr, "sf_train", &more, NULL);
  return sf_ok();
}

static sf_status run(train_arguments *a, const char *path)
{
  sf_dataset data = {0};
  sf_model start = {0};
  const sf_dataset_options how = {.downscale = a->downscale, .scale = (float)a->scale, .limit = a->limit};
  sf_status status = sf_ranks_agree(a->train.ranks, prepare(a, path, &how, &data, &start));
  if (!status.code) status = train_and_report(path, &data, &how, a);
  sf_model_free(&start);
  sf_dataset_free(&data);
  return status;
}

/* An iteration is short, a checkpoint need not be: a rank that was told to stop waits for the others. */
static const double patience = 60;

int main(int argc, char **argv)
{
  train_arguments a;
  sf_option options[TRAIN_OPTIONS_MAX];
  const char *path[1] = {NULL};
  sf_ranks *ranks = NULL;
  train_defaults(&a, argc, argv);
  const sf_cli cli = train_cli(&a, options);
  sf_status status = train_parse(&a, path);
  if (status.code != SF_E_USAGE) {
    const sf_ranks_options how = {.interrupted = sf_cli_interrupted, .argc = argc, .argv = argv, .patience = patience};
    const sf_status opened = sf_ranks_open(&ranks, &how);
    status = opened.code ? opened : sf_ranks_agree(ranks, status);
    a.train.ranks = ranks;
    a.quiet |= sf_ranks_rank(ranks) > 0;
  }
  if (!status.code) status = run(&a, path[0]);
  train_arguments_free(&a);
  return sf_cli_finish_ranks(&cli, ranks, status);
}
