#include "tools/train/report.h"
#include "field/field.h"
#include "energy/along.h"
#include "base/json.h"
#include <math.h>

static double psnr_of(double mse)
{
  return mse > 0 ? -10 * log10(mse) : 99;
}

/* JSON has no infinity. */
static void log_error(FILE *log, const char *name, double error)
{
  if (isinf(error))
    fprintf(log, ",\"%s\":null", name);
  else
    fprintf(log, ",\"%s\":%.3g", name, error);
}

void train_log_line(FILE *log, const sf_train_stats *s, int steps)
{
  fprintf(log,
          "{\"iteration\":%lld,\"stage\":%d,\"seconds\":%.3f,\"loss\":%.9g,\"mse\":%.9g,\"psnr\":%.4f,\"t_star\":%.6f,"
          "\"t_r\":%d,\"rays\":%d,\"samples\":%d,"
          "\"lattice\":%d,"
          "\"occupied\":%.6f,\"tau\":[%.5f,%.5f,%.5f,%.5f,%.5f],\"firing\":[%.5f,%.5f,%.5f],\"quiet\":[%d,%d,%d],"
          "\"revived\":[%d,%d,%d]",
          (long long)s->iteration, s->stage, s->seconds, s->loss, s->mse, psnr_of(s->mse), s->t_star, s->t_r, s->rays,
          s->samples, s->lattice, s->occupied, s->tau[0], s->tau[1], s->tau[2], s->tau[3], s->tau[4], s->firing[0],
          s->firing[1], s->firing[2], s->quiet[0], s->quiet[1], s->quiet[2], s->revived[0], s->revived[1],
          s->revived[2]);
  if (s->search.measured) {
    const sf_search_report *r = &s->search;
    fprintf(log, ",\"worth\":%.6g,\"price\":%.6g", r->worth, r->price);
    log_error(log, "worth_error", r->worth_error);
    log_error(log, "price_error", r->price_error);
    fprintf(log, ",\"prefix_mse\":[");
    for (int i = 0; i < steps; i++) fprintf(log, "%s%.6g", i ? "," : "", r->prefix_mse[i]);
    fprintf(log, "]");
  }
  fprintf(log, "}\n");
}

void train_smooth(train_recent *r, const sf_train_stats *s)
{
  const double keep = r->mse > 0 ? 0.95 : 0;
  r->mse = keep * r->mse + (1 - keep) * s->mse;
}

void train_show(sf_progress *p, const sf_train_stats *s, const train_recent *r)
{
  const double left = s->progress > 1e-6 ? s->seconds * (1 - s->progress) / s->progress : 0;
  sf_progress_show(p, "stage %s %5.1f%%  ETA %d:%02d  PSNR %.2f dB  t* %.2f  iteration %lld",
                   s->stage == 1 ? "I " : "II", 100 * s->progress, (int)left / 60, (int)left % 60, psnr_of(r->mse),
                   s->t_star, (long long)s->iteration);
}

void train_show_evaluation(sf_progress *p, int done, int all, double seconds)
{
  char eta[40] = "";
  const double left = done ? seconds * (all - done) / done : 0;
  if (done) snprintf(eta, sizeof eta, "  ETA %d:%02d", (int)left / 60, (int)left % 60);
  sf_progress_show(p, "evaluation: view %d of %d%s", done + 1, all, eta);
}

void train_warn(sf_progress *progress, const sf_train_stats *s)
{
  for (int l = 0; l < FX_SPIKING; l++)
    if (s->event[l]) {
      sf_progress_end(progress);
      fprintf(stderr, "sf_train: warning: iteration %lld: the neurons of %s %s: brought back to the threshold\n",
              (long long)s->iteration, fx_layer_name(fx_spiking_layers[l]),
              s->event[l] < 0 ? "were silent" : "fired all the time");
    }
}

/* dB between the best prefix and t_r, on the rays of the search. */
static double train_behind(const sf_search_report *r, int t_r, int steps)
{
  double best = r->prefix_mse[0];
  for (int i = 1; i < steps; i++) best = fmin(best, r->prefix_mse[i]);
  return psnr_of(best) - psnr_of(r->prefix_mse[t_r - 1]);
}

static cJSON *search_json(const sf_config *c, const sf_search_report *r)
{
  cJSON *json = cJSON_CreateObject();
  cJSON_AddStringToObject(json, "state", sf_search_names[r->state]);
  cJSON_AddNumberToObject(json, "measured", r->measured);
  cJSON_AddNumberToObject(json, "beta", r->beta);
  cJSON_AddNumberToObject(json, "worth", r->worth);
  cJSON_AddNumberToObject(json, "worth_error", r->worth_error);
  cJSON_AddNumberToObject(json, "price", r->price);
  cJSON_AddNumberToObject(json, "price_error", r->price_error);
  cJSON_AddItemToObject(json, "prefix_mse", cJSON_CreateDoubleArray(r->prefix_mse, c->steps));
  cJSON_AddNumberToObject(json, "saving_estimate", r->saving);
  cJSON_AddNumberToObject(json, "step_mj_per_frame", r->step_energy);
  return json;
}

/* Nets that no audit counts: those along rays, and the twin. */
static bool is_priced(const sf_config *c, const train_quality *q)
{
  return q->views > 0 && (c->along || c->net == SF_NET_ANN);
}

/* Means of a view. */
static cJSON *cost_json(const sf_model *m, const train_quality *q)
{
  const fx_cost cost = sf_float_cost(m, &q->events);
  cJSON *json = cJSON_CreateObject();
  cJSON_AddNumberToObject(json, "samples", (double)q->events.samples / q->views);
  cJSON_AddNumberToObject(json, "macs", (double)cost.macs / q->views);
  cJSON_AddNumberToObject(json, "sops", (double)cost.sops / q->views);
  cJSON_AddNumberToObject(json, "energy_mj", (double)sf_cost_fj(&cost) * 1e-12 / q->views);
  return json;
}

static cJSON *make_summary(const train_arguments *a, const sf_model *m, const sf_train_stats *s, const train_quality *q)
{
  const sf_config *c = &m->config;
  static const char *const net[] = {"snn", "ann"}, *const mode[] = {"hybrid", "decay", "no-decay", "radix"};
  cJSON *json = cJSON_CreateObject();
  sf_json_add_text(json, "model", a->output);
  cJSON_AddStringToObject(json, "backbone", sf_field_of(c)->name);
  cJSON_AddStringToObject(json, "layout", q->layout);
  cJSON_AddStringToObject(json, "net", net[c->net]);
  cJSON_AddStringToObject(json, "mode", mode[c->mode]);
  cJSON_AddNumberToObject(json, "beta", a->train.beta);
  cJSON_AddNumberToObject(json, "seed", (double)a->train.seed);
  cJSON_AddNumberToObject(json, "iterations", (double)s->iteration);
  cJSON_AddNumberToObject(json, "seconds", s->seconds);
  if (sf_ranks_size(a->train.ranks) > 1) {
    cJSON_AddNumberToObject(json, "ranks", sf_ranks_size(a->train.ranks));
    cJSON_AddNumberToObject(json, "sent_bytes", (double)sf_ranks_sent(a->train.ranks));
  }
  cJSON_AddNumberToObject(json, "samples_per_second", s->samples_per_second);
  cJSON_AddNumberToObject(json, "T", c->steps);
  cJSON_AddNumberToObject(json, "t_r", s->t_r);
  cJSON_AddNumberToObject(json, "t_star", s->t_star);
  if (s->search.state != SF_SEARCH_NONE) cJSON_AddItemToObject(json, "search", search_json(c, &s->search));
  if (sf_field_of(c)->lattice) cJSON_AddNumberToObject(json, "lattice", c->lattice);
  cJSON_AddItemToObject(json, "tau", cJSON_CreateDoubleArray(s->tau, SF_LAYERS));
  cJSON_AddItemToObject(json, "firing", cJSON_CreateDoubleArray(s->firing, 3));
  cJSON_AddNumberToObject(json, "charge", a->train.charge);
  cJSON_AddNumberToObject(json, "opaque", a->train.objective == SF_OBJECTIVE_PAPER ? 0 : a->train.opaque);
  cJSON_AddNumberToObject(json, "near_camera", a->train.objective == SF_OBJECTIVE_PAPER ? 0 : a->train.near_camera);
  cJSON_AddNumberToObject(json, "distortion", a->train.objective == SF_OBJECTIVE_PAPER ? 0 : a->train.distortion);
  cJSON_AddNumberToObject(json, "stop", c->stop);
  if (sf_model_decodes(m)) cJSON_AddNumberToObject(json, "weight_stop", c->tensorf.weight_stop);
  cJSON_AddNumberToObject(json, "row_reads", s->row_reads);
  cJSON_AddItemToObject(json, "quiet", cJSON_CreateIntArray(s->quiet, 3));
  cJSON_AddItemToObject(json, "revived", cJSON_CreateIntArray(s->revived, 3));
  cJSON_AddNumberToObject(json, "psnr", q->psnr);
  cJSON_AddNumberToObject(json, "ssim", q->ssim);
  cJSON_AddNumberToObject(json, "views", q->views);
  cJSON_AddNumberToObject(json, "width", q->width);
  cJSON_AddNumberToObject(json, "height", q->height);
  if (c->along) cJSON_AddBoolToObject(json, "along_ray", true);
  if (is_priced(c, q)) cJSON_AddItemToObject(json, "frame", cost_json(m, q));
  if (q->prefixes) cJSON_AddItemToObject(json, "prefix_psnr", cJSON_CreateDoubleArray(q->prefix, q->prefixes));
  return json;
}

static void print_estimate(double value, double error)
{
  printf("%.2e", value);
  if (!isinf(error)) printf(" +- %.1e", error);
}

static void print_search(const train_arguments *a, const sf_train_stats *s)
{
  const sf_search_report *r = &s->search;
  const sf_train_options *o = &a->train;
  if (r->state == SF_SEARCH_NONE) return;
  printf("%s: search for t*: %s; ", a->output, sf_search_names[r->state]);
  if (!r->measured) {
    printf("the run has no time for it, t_r is where it starts\n");
    return;
  }
  printf("one more step is worth ");
  print_estimate(r->worth, r->worth_error);
  printf(" and costs ");
  print_estimate(r->price, r->price_error);
  printf(r->measured == 1 ? " (measured once)\n" : "\n");
  if (o->target_loss > 0 || o->target_saving > 0)
    printf("%s: that is beta = %.2e; about %.1f %% of the ReLU twin's energy saved, %.2f dB behind the best prefix\n",
           a->output, r->beta, 100 * r->saving, train_behind(r, s->t_r, a->train.config.steps));
}

static void print_cost(const train_arguments *a, const sf_model *m, const train_quality *q)
{
  const fx_cost cost = sf_float_cost(m, &q->events);
  const double samples = (double)q->events.samples;
  if (!is_priced(&m->config, q) || !(samples > 0)) return;
  printf("%s: %.4g mJ a view: %.0f samples, each with %.0f products and %.0f additions that spikes cause\n", a->output,
         (double)sf_cost_fj(&cost) * 1e-12 / q->views, samples / q->views, (double)cost.macs / samples,
         (double)cost.sops / samples);
}

static void print_text(const train_arguments *a, const sf_model *m, const sf_train_stats *s, const train_quality *q)
{
  const sf_config *c = &m->config;
  printf("%s: %lld iterations in %.0f s; t_r = %d of T = %d (t* = %.2f); held-out PSNR %.2f dB", a->output,
         (long long)s->iteration, s->seconds, s->t_r, c->steps, s->t_star, q->psnr);
  if (!isnan(q->ssim)) printf(", SSIM %.4f", q->ssim);
  printf(" over %d views\n", q->views);
  print_search(a, s);
  print_cost(a, m, q);
  if (a->train.charge > 0) printf("%s: %.0f reads of weights per sample, 8 bytes each\n", a->output, s->row_reads);
  if (sf_field_of(c)->lattice)
    printf("%s: samples lie 2 sqrt(3) / %d apart%s\n", a->output, c->lattice,
           c->dt_gamma > 0 ? " near the camera" : "");
  if (sf_model_decodes(m))
    printf("%s: samples that take at most %.2g of their ray's light are not decoded\n", a->output,
           c->tensorf.weight_stop);
  if (!q->prefixes) return;
  printf("%s: PSNR at 1..%d steps:", a->output, q->prefixes);
  for (int i = 0; i < q->prefixes; i++) printf(" %.2f", q->prefix[i]);
  printf(" dB\n");
}

sf_status train_report(const train_arguments *a, const sf_model *model, const sf_train_stats *s, const train_quality *q)
{
  cJSON *json = make_summary(a, model, s, q);
  const sf_status saved = a->summary ? sf_json_save(json, a->summary) : sf_ok();
  if (a->json) {
    SF_TRY(sf_json_print(json, false));
  } else {
    cJSON_Delete(json);
    print_text(a, model, s, q);
  }
  return saved;
}
