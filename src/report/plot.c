/* Gnuplot scripts with their data inside. */
#include "report/internal.h"
#include "base/io.h"
#include "fx/layers.h"
#include <math.h>
#include <string.h>

enum { POINTS_MAX = 600 }; /* of a curve over iterations: more than the picture has pixels for */

/* Of both fields; a scene has those of its own. */
static const int betas[] = {SF_RUN_BETA_1E7, SF_RUN_BETA_5E7, SF_RUN_BETA_1E6, SF_RUN_BETA_5E9, SF_RUN_BETA_5E8};
enum { BETAS = 5 };
static const int learned[] = {SF_RUN_BETA_1E7,  SF_RUN_BETA_5E7, SF_RUN_BETA_1E6,   SF_RUN_BETA_5E9, SF_RUN_BETA_5E8,
                              SF_RUN_NO_STAGE1, SF_RUN_NO_EXTRA, SF_RUN_NO_PENALTY, SF_RUN_NO_BUDGET};
enum { LEARNED = 9 };
/* A scene, or how many are averaged. */
static const char *title_of(const sf_reproduction *r, int scenes, const char *what, char *text, size_t size)
{
  char name[256];
  int count = 0;
  for (int s = 0; s < r->count; s++) count += sf_reproduction_chosen(r, s, scenes);
  if (scenes >= 0)
    snprintf(text, size, "%s: %s, profile %s", what, r->scene[scenes].name, r->profile);
  else if (scenes == SF_SCENES_ALL)
    snprintf(text, size, "%s: average of %d %s, profile %s", what, count, count == 1 ? "scene" : "scenes", r->profile);
  else
    snprintf(text, size, "%s: %s, %s, average of %d %s", what, sf_report_field(SF_SCENES_OF - scenes),
             sf_paper_groups[SF_SCENES_OF - scenes].data, count, count == 1 ? "scene" : "scenes");
  sf_plot_quote(name, sizeof name, text);
  snprintf(text, size, "%s", name);
  return text;
}

/* The ANN on the views of the prefixes where it was rendered there, else over all. */
static double ann_psnr(const sf_reproduction *r, int scene)
{
  const double same = sf_reproduction_prefix(r, scene, SF_RUN_ANN, 0);
  return isnan(same) ? sf_reproduction_mean(r, scene, SF_RUN_ANN, SF_METRIC_PSNR, NULL) : same;
}

/* ---- PSNR against steps ---- */

static void plot_steps(FILE *out, const sf_reproduction *r, int scene, const char *name)
{
  char title[640];
  const double ann = ann_psnr(r, scene);
  bool shown[BETAS] = {false};
  title_of(r, scene, "PSNR after every time step", title, sizeof title);
  sf_plot_head(out, name, title, "time steps", "PSNR, dB (float, held-out views)", "outside right top");
  fprintf(out, "set xrange [0.7:%d.3]\nset xtics 1\n", SF_T_MAX);
  for (int i = 0; i < BETAS; i++) {
    fprintf(out, "$steps%d << EOD\n", i);
    for (int t = 0; t < SF_T_MAX; t++) {
      const double psnr = sf_reproduction_prefix(r, scene, betas[i], t);
      if (!isnan(psnr)) fprintf(out, "%d %.6g\n", t + 1, psnr), shown[i] = true;
    }
    fprintf(out, "EOD\n");
  }
  fprintf(out, "plot ");
  for (int i = 0; i < BETAS; i++)
    if (shown[i])
      fprintf(out,
              "$steps%d using 1:2 with linespoints linecolor '%s' linewidth 2 pointtype %d pointsize 1 title '%s', ", i,
              sf_plot_colour[i], 5 + 2 * i, sf_run_kinds[betas[i]].title);
  for (int i = 0; i < BETAS; i++) {
    const double t_r = sf_reproduction_mean(r, scene, betas[i], SF_METRIC_STEPS, NULL);
    if (scene < 0 || !shown[i] || isnan(t_r)) continue;
    fprintf(out,
            "$steps%d using ($1 == %.0f ? $1 : NaN):2 with points linecolor '%s' pointtype 6 pointsize 2.4 notitle, ",
            i, t_r, sf_plot_colour[i]);
  }
  if (scene >= 0)
    fprintf(out, "NaN with points linecolor '#555555' pointtype 6 pointsize 2.4 title 't_r, as learned', ");
  if (!isnan(ann))
    fprintf(out, "%.6g with lines linecolor '#555555' dashtype 2 linewidth 2 title 'ANN (ReLU twin)', ", ann);
  fprintf(out, "NaN notitle\n");
}

static bool has_steps(const sf_reproduction *r, int scene)
{
  for (int i = 0; i < BETAS; i++)
    for (int t = 0; t < SF_T_MAX; t++)
      if (!isnan(sf_reproduction_prefix(r, scene, betas[i], t))) return true;
  return false;
}

/* ---- PSNR against energy ---- */

static void point(FILE *out, const char *block, double x, double y)
{
  fprintf(out, "$%s << EOD\n", block);
  if (!isnan(x) && !isnan(y)) fprintf(out, "%.6g %.6g\n", x, y);
  fprintf(out, "EOD\n");
}

/* PSNR of a learned run on the views of the prefixes: what its scenes show at their own t_r. */
static double psnr_at_t_r(const sf_reproduction *r, int scene, int run)
{
  double sum = 0;
  int n = 0;
  for (int s = 0; s < r->count; s++) {
    const sf_run *one = &r->scene[s].run[run];
    const double t_r = one->value[SF_METRIC_STEPS];
    if (!sf_reproduction_chosen(r, s, scene) || !(t_r >= 1 && t_r <= one->prefixes)) continue;
    sum += one->prefix_psnr[(int)t_r - 1], n++;
  }
  return n ? sum / n : sf_reproduction_mean(r, scene, run, SF_METRIC_PSNR, NULL);
}

static void plot_energy(FILE *out, const sf_reproduction *r, int scene, const char *name)
{
  char title[640], block[16];
  title_of(r, scene, "PSNR against energy", title, sizeof title);
  sf_plot_head(out, name, title, "energy, mJ per frame (counted by the audit, paper ledger)",
               "PSNR, dB (float, held-out views)", "outside right top");
  fprintf(out, "set xrange [0:*]\nset offsets graph 0, graph 0.05, graph 0.08, graph 0.05\n$prefix << EOD\n");
  bool any = false;
  for (int t = 0; t < SF_T_MAX; t++) {
    const double x = sf_reproduction_prefix_energy(r, scene, SF_RUN_BETA_5E7, t),
                 y = sf_reproduction_prefix(r, scene, SF_RUN_BETA_5E7, t);
    if (!isnan(x) && !isnan(y)) fprintf(out, "%.6g %.6g %d\n", x, y, t + 1), any = true;
  }
  fprintf(out, "EOD\n");
  for (int i = 0; i < BETAS; i++) {
    snprintf(block, sizeof block, "beta%d", i);
    point(out, block, sf_reproduction_mean(r, scene, betas[i], SF_METRIC_ENERGY, NULL),
          psnr_at_t_r(r, scene, betas[i]));
  }
  point(out, "ann", sf_reproduction_mean(r, scene, SF_RUN_ANN, SF_METRIC_ENERGY, NULL), ann_psnr(r, scene));
  fprintf(out, "plot ");
  if (any)
    fprintf(out, "$prefix using 1:2 with linespoints linecolor '#999999' pointtype 7 pointsize 0.6 title 'beta = 5e-7, "
                 "t = 1, 2, ...', $prefix using 1:2:3 with labels offset 0,-1 notitle, ");
  for (int i = 0; i < BETAS; i++)
    if (!isnan(sf_reproduction_mean(r, scene, betas[i], SF_METRIC_ENERGY, NULL)))
      fprintf(out, "$beta%d using 1:2 with points linecolor '%s' pointtype %d pointsize 1.8 title '%s', ", i,
              sf_plot_colour[i], 5 + 2 * i, sf_run_kinds[betas[i]].title);
  fprintf(out, "$ann using 1:2 with points linecolor '#000000' pointtype 2 pointsize 1.8 title 'ANN (ReLU twin)'\n");
}

static bool has_energy(const sf_reproduction *r, int scene)
{
  for (int i = 0; i <= BETAS; i++) {
    const int run = i < BETAS ? betas[i] : SF_RUN_ANN;
    if (!isnan(sf_reproduction_mean(r, scene, run, SF_METRIC_ENERGY, NULL)) &&
        !isnan(sf_reproduction_mean(r, scene, run, SF_METRIC_PSNR, NULL)))
      return true;
  }
  return false;
}

/* ---- t* over iterations ---- */

static void plot_t_star(FILE *out, const sf_reproduction *r, int scene, const char *name)
{
  char title[640];
  title_of(r, scene, "t* over the iterations", title, sizeof title);
  sf_plot_head(out, name, title, "iteration", "t*, time steps", "outside right top");
  fprintf(out, "set yrange [0.8:%d.2]\nset ytics 1\nset xrange [0:*]\n", SF_T_MAX);
  for (int i = 0; i < LEARNED; i++) {
    const sf_run *run = &r->scene[scene].run[learned[i]];
    const int stride = run->points / POINTS_MAX + 1;
    fprintf(out, "$t%d << EOD\n", i);
    for (int p = 0; p < run->points; p++)
      if (p % stride == 0 || p == run->points - 1) fprintf(out, "%.0f %.5f\n", run->iteration[p], run->t_star_at[p]);
    fprintf(out, "EOD\n");
  }
  fprintf(out, "plot ");
  for (int i = 0; i < LEARNED; i++)
    if (r->scene[scene].run[learned[i]].points > 0)
      fprintf(out, "$t%d using 1:2 with lines linecolor '%s' linewidth 2 dashtype %d title '%s', ", i,
              sf_plot_colour[i % SF_PLOT_COLOURS], i < BETAS ? 1 : i - BETAS + 2, sf_run_kinds[learned[i]].title);
  fprintf(out, "NaN notitle\n");
}

static bool has_t_star(const sf_reproduction *r, int scene)
{
  for (int i = 0; i < LEARNED; i++)
    if (r->scene[scene].run[learned[i]].points > 1) return true;
  return false;
}

/* ---- worth and price of a step ---- */

static double search_number(const sf_reproduction *r, int scene, int run, const char *key)
{
  return sf_json_number(sf_json_get(r->scene[scene].run[run].summary, "search"), key);
}

static bool has_balance(const sf_reproduction *r, int scene)
{
  for (int i = 0; i < BETAS; i++)
    if (search_number(r, scene, betas[i], "worth") > 0 && search_number(r, scene, betas[i], "price") > 0) return true;
  return false;
}

/* Of every beta the price over t, the worth as a level line, and t* where they cross. */
static void plot_balance(FILE *out, const sf_reproduction *r, int scene, const char *name)
{
  char title[640];
  title_of(r, scene, "What a step is worth and what it costs", title, sizeof title);
  sf_plot_head(out, name, title, "t, time steps", "squared error", "outside right top");
  fprintf(out, "set logscale y\nset format y '%%.0e'\nset xrange [1:%d]\nset samples 200\n", SF_T_MAX);
  for (int i = 0; i < BETAS; i++) {
    fprintf(out, "$b%d << EOD\n", i);
    const double worth = search_number(r, scene, betas[i], "worth"),
                 error = search_number(r, scene, betas[i], "worth_error"), at = r->scene[scene].run[betas[i]].t_star;
    if (worth > 0 && !isnan(at)) fprintf(out, "%.5f %.6g %.6g\n", at, worth, isnan(error) ? 0 : error);
    fprintf(out, "EOD\n");
  }
  fprintf(out, "plot ");
  for (int i = 0; i < BETAS; i++) {
    const double worth = search_number(r, scene, betas[i], "worth"), price = search_number(r, scene, betas[i], "price");
    if (!(worth > 0 && price > 0)) continue;
    const char *colour = sf_plot_colour[i], *what = sf_run_kinds[betas[i]].title;
    fprintf(out,
            "%.6g * exp(x - %.5f) with lines linecolor '%s' title '%s: price', %.6g with lines linecolor '%s' "
            "dashtype 2 title 'worth', $b%d using 1:2:3 with yerrorbars linecolor '%s' pointtype 7 notitle, ",
            price, r->scene[scene].run[betas[i]].t_star, colour, what, worth, colour, i, colour);
  }
  fprintf(out, "NaN notitle\n");
}

/* ---- PSNR against t_r over scenes ---- */

/* A point per scene and seed. */
static void plot_t_r(FILE *out, const sf_reproduction *r, int scene, const char *name)
{
  char text[320], title[320];
  snprintf(text, sizeof text, "PSNR against t_r: every scene and seed, profile %.200s", r->profile);
  sf_plot_quote(title, sizeof title, text);
  sf_plot_head(out, name, title, "t_r, time steps", "PSNR, dB (float, held-out views)", "outside right top");
  fprintf(out, "set xrange [0.7:%d.3]\nset xtics 1\nset offsets 0, 0, graph 0.08, graph 0.08\n", SF_T_MAX);
  for (int i = 0; i < BETAS; i++) {
    fprintf(out, "$beta%d << EOD\n", i);
    for (int s = 0; s < r->count; s++)
      for (int k = 0; k < r->scene[s].seeds; k++) {
        const double *value = r->scene[s].of[k].run[betas[i]].value;
        char quoted[256];
        sf_plot_quote(quoted, sizeof quoted, r->scene[s].name);
        for (char *c = quoted; *c; c++)
          if (*c == ' ' || *c == '"') *c = '_';
        if (!isnan(value[SF_METRIC_STEPS] + value[SF_METRIC_PSNR]))
          fprintf(out, "%.6g %.6g %s\n", value[SF_METRIC_STEPS], value[SF_METRIC_PSNR], quoted);
      }
    fprintf(out, "EOD\n");
  }
  fprintf(out, "plot ");
  for (int i = 0; i < BETAS; i++)
    if (!isnan(sf_reproduction_mean(r, scene, betas[i], SF_METRIC_STEPS, NULL)))
      fprintf(out,
              "$beta%d using 1:2 with points linecolor '%s' pointtype %d pointsize 1.5 title '%s', $beta%d using 1:2:3 "
              "with labels offset 0,0.9 font ',10' textcolor '#777777' notitle, ",
              i, sf_plot_colour[i], 5 + 2 * i, sf_run_kinds[betas[i]].title, i);
  fprintf(out, "NaN notitle\n");
}

static bool has_t_r(const sf_reproduction *r, int scene)
{
  for (int i = 0; i < BETAS; i++)
    if (!isnan(sf_reproduction_mean(r, scene, betas[i], SF_METRIC_STEPS, NULL))) return true;
  return false;
}

/* ---- firing rates over training ---- */

static bool fires(const sf_run *run, int layer)
{
  for (int p = 0; p < run->points; p++)
    if (run->firing[p][layer] > 0) return true;
  return false;
}

static bool has_firing(const sf_reproduction *r, int scene)
{
  for (int i = 0; i < BETAS * 3; i++)
    if (fires(&r->scene[scene].run[betas[i / 3]], i % 3)) return true;
  return false;
}

/* A colour is a budget, a dash is a layer. A field without a density net has two spiking layers. */
static void plot_firing(FILE *out, const sf_reproduction *r, int scene, const char *name)
{
  char title[640];
  title_of(r, scene, "Firing rates over training", title, sizeof title);
  sf_plot_head(out, name, title, "iteration", "spikes per neuron and step", "outside right top");
  fprintf(out, "set xrange [0:*]\nset yrange [0:*]\n");
  for (int i = 0; i < BETAS; i++) {
    const sf_run *run = &r->scene[scene].run[betas[i]];
    const int stride = run->points / POINTS_MAX + 1;
    fprintf(out, "$f%d << EOD\n", i);
    for (int p = 0; p < run->points; p += stride) {
      fprintf(out, "%.0f", run->iteration[p]);
      for (int l = 0; l < 3; l++) fprintf(out, " %.5f", run->firing[p][l]);
      fprintf(out, "\n");
    }
    fprintf(out, "EOD\n");
  }
  fprintf(out, "plot ");
  for (int i = 0; i < BETAS * 3; i++)
    if (fires(&r->scene[scene].run[betas[i / 3]], i % 3))
      fprintf(out, "$f%d using 1:%d with lines linecolor '%s' dashtype %d title '%s, %s', ", i / 3, i % 3 + 2,
              sf_plot_colour[i / 3], i % 3 + 1, sf_run_kinds[betas[i / 3]].title,
              fx_layer_name(fx_spiking_layers[i % 3]));
  fprintf(out, "NaN notitle\n");
}

/* ---- files ---- */

typedef struct plot {
  const char *name;
  bool (*has_data)(const sf_reproduction *r, int scene); /* gnuplot refuses an empty picture */
  void (*write)(FILE *out, const sf_reproduction *r, int scene, const char *name);
  bool overall, averaged, single; /* of all scenes; of those of a field and a set; of every scene */
} plot;

static const plot plots[] = {{"psnr-t_r", has_t_r, plot_t_r, true, false, false},
                             {"psnr-steps", has_steps, plot_steps, false, true, true},
                             {"psnr-energy", has_energy, plot_energy, false, true, true},
                             {"t-star", has_t_star, plot_t_star, false, false, true},
                             {"firing", has_firing, plot_firing, false, false, true},
                             {"balance", has_balance, plot_balance, false, false, true}};

static void plot_name(const sf_reproduction *r, const plot *p, int scenes, char name[300])
{
  if (scenes >= 0)
    snprintf(name, 300, "%s-%s", p->name, r->scene[scenes].name);
  else if (scenes == SF_SCENES_ALL)
    snprintf(name, 300, "%s", p->name);
  else
    snprintf(name, 300, "%s-%s-%s", p->name, sf_paper_groups[SF_SCENES_OF - scenes].backbone,
             sf_paper_groups[SF_SCENES_OF - scenes].layout ? sf_paper_groups[SF_SCENES_OF - scenes].layout : "other");
}

/* Averages over scenes of one field and set: where all are, they are those of all. */
static bool is_wanted(const sf_reproduction *r, const plot *p, int scenes)
{
  int chosen = 0, alike = 0;
  for (int s = 0; s < r->count; s++) {
    chosen += sf_reproduction_chosen(r, s, scenes);
    alike += r->scene[s].group == r->scene[0].group;
  }
  if (scenes >= 0) return p->single;
  if (scenes == SF_SCENES_ALL) return p->overall || (p->averaged && alike == r->count);
  return p->averaged && chosen && alike < r->count;
}

static sf_status write_plot(const sf_reproduction *r, const plot *p, int scene, int *count)
{
  char name[300], quoted[300], path[4096 + 320];
  sf_writer writer;
  plot_name(r, p, scene, name);
  snprintf(path, sizeof path, "%s/plots/%s.gp", r->dir, name);
  sf_plot_quote(quoted, sizeof quoted, name);
  SF_TRY(sf_writer_open(&writer, path));
  p->write(writer.file, r, scene, quoted);
  ++*count;
  return sf_writer_commit(&writer);
}

bool sf_report_plot(const sf_reproduction *r, int scenes, int i, char name[300])
{
  if (i < 0 || i >= (int)(sizeof plots / sizeof *plots)) return false;
  *name = 0;
  if (is_wanted(r, &plots[i], scenes) && plots[i].has_data(r, scenes)) plot_name(r, &plots[i], scenes, name);
  return true;
}

sf_status sf_reproduction_plots(const sf_reproduction *r, int *count)
{
  char dir[4096 + 16], name[300];
  *count = 0;
  snprintf(dir, sizeof dir, "%s/plots", r->dir);
  SF_TRY(sf_make_dir(dir));
  for (int scenes = sf_scenes_of(SF_GROUPS - 1); scenes < r->count; scenes++)
    for (int i = 0; sf_report_plot(r, scenes, i, name); i++)
      if (*name) SF_TRY(write_plot(r, &plots[i], scenes, count));
  return sf_ok();
}
