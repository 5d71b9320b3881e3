/* Energies and fixed-point quality of the audited frames, and t* over the iterations. */
#include "report/internal.h"
#include "energy/energy.h"
#include "base/io.h"
#include <dirent.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { VIEWS_MAX = 1024, LOG_LIMIT = 256 << 20 };

typedef struct frames {
  sf_reproduction *report;
  const char *dir;
  int view[VIEWS_MAX], count;
} frames;

static int compare_views(const void *a, const void *b)
{
  return *(const int *)a - *(const int *)b;
}

/* Views K with a file PREFIX-K.json, in order: sums must not depend on the folder's. */
static void list_views(frames *f, const char *prefix)
{
  DIR *folder = opendir(f->dir);
  const size_t n = strlen(prefix);
  f->count = 0;
  if (!folder) return;
  for (const struct dirent *e; (e = readdir(folder)) && f->count < VIEWS_MAX;) {
    char *end;
    if (strncmp(e->d_name, prefix, n) || e->d_name[n] < '0' || e->d_name[n] > '9') continue;
    const long view = strtol(e->d_name + n, &end, 10);
    if (strcmp(end, ".json") == 0 && view < 1 << 20) f->view[f->count++] = (int)view;
  }
  closedir(folder);
  qsort(f->view, (size_t)f->count, sizeof *f->view, compare_views);
}

static sf_status open_json(sf_reproduction *r, const char *dir, const char *prefix, int view, cJSON **json)
{
  char path[4096 + 512];
  snprintf(path, sizeof path, "%s/%s%d.json", dir, prefix, view);
  return sf_report_read_json(r, path, json);
}

static double mean(double sum, int count)
{
  return count ? sum / count : NAN;
}

/* ---- audits ---- */

static sf_status check_agreement(frames *f, const cJSON *audit, int view)
{
  static const char *const key[] = {"core_equals_recount", "core_equals_rtl_equals_recount"};
  for (int i = 0; i < 2; i++)
    if (cJSON_IsFalse(sf_json_get(audit, key[i])))
      SF_TRY(sf_report_problem(f->report, "%s: the audit of view %d says %s: false", f->dir, view, key[i]));
  const cJSON *difference = sf_json_get(audit, "difference");
  if (!cJSON_IsString(difference)) return sf_ok();
  return sf_report_problem(f->report, "%s: the audit of view %d: %s", f->dir, view, difference->valuestring);
}

/* The rendering's own counts are a second reading of the same frame. */
static sf_status add_fixed(frames *f, int view, double audited_fj, double *sum, int *count, sf_run *run)
{
  cJSON *json;
  SF_TRY(open_json(f->report, f->dir, "fixed-", view, &json));
  if (!json) return sf_ok();
  const double psnr = sf_json_number(json, "psnr"), fj = sf_json_number(json, "energy_fj");
  const cJSON *crop = sf_json_get(json, "crop"), *w = cJSON_GetArrayItem(crop, 2), *h = cJSON_GetArrayItem(crop, 3);
  if (cJSON_IsNumber(w) && cJSON_IsNumber(h)) run->width = w->valueint, run->height = h->valueint;
  cJSON_Delete(json);
  if (!isnan(psnr)) *sum += psnr, ++*count;
  if (!isnan(audited_fj) && fj != audited_fj)
    return sf_report_problem(f->report, "%s: view %d: %.0f fJ in the rendering, %.0f fJ in the audit", f->dir, view, fj,
                             audited_fj);
  return sf_ok();
}

static sf_status add_float(frames *f, int view, double *sum, int *count)
{
  cJSON *json;
  SF_TRY(open_json(f->report, f->dir, "float-", view, &json));
  const double psnr = sf_json_number(json, "psnr");
  cJSON_Delete(json);
  if (!isnan(psnr)) *sum += psnr, ++*count;
  return sf_ok();
}

static sf_status load_spiking(frames *f, sf_run *run)
{
  double spiking = 0, twin = 0, fixed = 0, real = 0;
  int fixed_count = 0, real_count = 0;
  list_views(f, "audit-");
  for (int i = 0; i < f->count; i++) {
    cJSON *audit;
    SF_TRY(open_json(f->report, f->dir, "audit-", f->view[i], &audit));
    const double a = sf_json_number(audit, "energy_spiking_fj"), b = sf_json_number(audit, "energy_ann_fj");
    sf_status status = audit ? check_agreement(f, audit, f->view[i]) : sf_ok();
    const bool broken = audit && (isnan(a) || isnan(b));
    cJSON_Delete(audit);
    SF_TRY(status);
    if (broken) SF_TRY(sf_report_problem(f->report, "%s/audit-%d.json: no energies", f->dir, f->view[i]));
    if (!isnan(a) && !isnan(b)) spiking += a, twin += b, run->audits++;
    SF_TRY(add_fixed(f, f->view[i], a, &fixed, &fixed_count, run));
    SF_TRY(add_float(f, f->view[i], &real, &real_count));
  }
  run->value[SF_METRIC_ENERGY] = mean(spiking * 1e-12, run->audits);
  run->value[SF_METRIC_TWIN] = mean(twin * 1e-12, run->audits);
  run->value[SF_METRIC_FIXED] = mean(fixed, fixed_count);
  run->value[SF_METRIC_FLOAT] = mean(real, real_count);
  if (fixed_count == real_count) run->value[SF_METRIC_LOSS] = run->value[SF_METRIC_FIXED] - run->value[SF_METRIC_FLOAT];
  return sf_ok();
}

static sf_status load_prefixes(frames *f, sf_run *run)
{
  for (int t = 1; t <= SF_T_MAX; t++) {
    char prefix[32];
    double sum = 0;
    int count = 0;
    snprintf(prefix, sizeof prefix, "prefix-%d-", t);
    list_views(f, prefix);
    for (int i = 0; i < f->count; i++) {
      cJSON *json;
      SF_TRY(open_json(f->report, f->dir, prefix, f->view[i], &json));
      const double fj = sf_json_number(json, "energy_spiking_fj");
      cJSON_Delete(json);
      if (!isnan(fj)) sum += fj, count++;
    }
    run->prefix_energy[t - 1] = mean(sum * 1e-12, count);
  }
  return sf_ok();
}

/* ---- the ANN ---- */

/* fJ per sample of the ReLU twin: an audit's twin ledger over its samples. All runs of a scene have the same nets. */
static sf_status twin_price(sf_reproduction *r, const char *reference, int view, double *fj)
{
  cJSON *audit;
  SF_TRY(open_json(r, reference, "audit-", view, &audit));
  *fj = sf_json_number(audit, "energy_ann_fj") / sf_json_number(audit, "samples");
  cJSON_Delete(audit);
  return sf_ok();
}

static sf_status load_ann(frames *f, const char *reference, sf_run *run)
{
  double energy = 0, psnr = 0;
  int rendered = 0;
  list_views(f, "float-");
  for (int i = 0; i < f->count; i++) {
    cJSON *json;
    double price;
    SF_TRY(open_json(f->report, f->dir, "float-", f->view[i], &json));
    const double samples = sf_json_number(json, "samples"), p = sf_json_number(json, "psnr");
    cJSON_Delete(json);
    SF_TRY(twin_price(f->report, reference, f->view[i], &price));
    if (!isnan(samples * price)) energy += samples * price, run->audits++;
    if (!isnan(p)) psnr += p, rendered++;
  }
  run->value[SF_METRIC_ENERGY] = mean(energy * 1e-12, run->audits);
  run->value[SF_METRIC_FLOAT] = mean(psnr, rendered);
  return sf_ok();
}

sf_status sf_report_load_frames(sf_reproduction *r, const char *dir, const char *reference, bool ann, sf_run *run)
{
  frames *f = calloc(1, sizeof *f);
  if (!f) return sf_fail(SF_E_MEMORY, "%s: no memory for the views", dir);
  f->report = r, f->dir = dir;
  sf_status status = ann ? load_ann(f, reference, run) : load_spiking(f, run);
  if (!status.code && !ann) status = load_prefixes(f, run);
  free(f);
  return status;
}

/* ---- the log ---- */

static sf_status add_point(sf_run *run, int *room, double iteration, double t_star, const cJSON *firing)
{
  while (run->points > 0 && run->iteration[run->points - 1] >= iteration) run->points--;
  if (run->points == *room) {
    *room = *room ? 2 * *room : 256;
    double *x = realloc(run->iteration, (size_t)*room * sizeof *x);
    if (x) run->iteration = x;
    double *y = realloc(run->t_star_at, (size_t)*room * sizeof *y);
    if (y) run->t_star_at = y;
    void *z = realloc(run->firing, (size_t)*room * sizeof *run->firing);
    if (z) run->firing = z;
    if (!x || !y || !z) return sf_fail(SF_E_MEMORY, "no memory for the points of a log");
  }
  for (int l = 0; l < 3; l++) {
    const cJSON *rate = cJSON_GetArrayItem(firing, l);
    run->firing[run->points][l] = cJSON_IsNumber(rate) ? rate->valuedouble : NAN;
  }
  run->iteration[run->points] = iteration, run->t_star_at[run->points++] = t_star;
  return sf_ok();
}

sf_status sf_report_load_log(const char *path, sf_run *run)
{
  char *text;
  size_t size;
  int room = 0;
  if (access(path, F_OK)) return sf_ok();
  SF_TRY(sf_read_file(path, LOG_LIMIT, &text, &size));
  sf_status status = sf_ok();
  for (char *line = text, *next; line && !status.code; line = next) {
    next = strchr(line, '\n');
    if (next) *next++ = 0;
    cJSON *json = cJSON_Parse(line);
    const double x = sf_json_number(json, "iteration"), y = sf_json_number(json, "t_star");
    if (!isnan(x) && !isnan(y)) status = add_point(run, &room, x, y, sf_json_get(json, "firing"));
    cJSON_Delete(json);
  }
  free(text);
  return status;
}
