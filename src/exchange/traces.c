/* Spikes and membranes of the core in the files of SANA-FE (Boyle et al.), the order of its rows included: by time
 * step, then by the name of the group, then by neuron. */
#include "energy/energy.h"
#include "exchange/exchange.h"
#include "base/io.h"
#include "base/text.h"
#include "base/rng.h"
#include <inttypes.h>
#include <string.h>

/* As in sf_cosim. */
enum { STREAM_VIEW = 1, STREAM_X, STREAM_Y };
enum { SPIKES, POTENTIALS, SAMPLES, FILES, GROUPS = 3 };
static const int group[GROUPS] = {FX_C1, FX_C2, FX_D1};
static const char *const file_name[FILES] = {"spikes.csv", "potentials.csv", "samples.csv"};

typedef struct tracer {
  const fx_scene *scene;
  const sf_dataset *data;
  const sf_traces_options *options;
  sf_traces_report *report;
  sf_writer writer[FILES];
  int ray, view, x, y;
  uint64_t sample; /* of the ray */
  int32_t base[SF_LANES];
  fx_trace trace;
} tracer;

static bool fired(const fx_trace *trace, int l, int t, int n)
{
  return trace->spikes[l][t][n / 64] >> (n % 64) & 1;
}

static void write_header(const tracer *w)
{
  fprintf(w->writer[SPIKES].file, "neuron,timestep\n");
  FILE *out = w->writer[POTENTIALS].file;
  fprintf(out, "timestep,");
  for (int g = 0; g < GROUPS; g++)
    for (int n = 0; n < w->scene->net.layer[group[g]].n_out; n++)
      fprintf(out, "neuron %s.%d,", fx_layer_name(group[g]), n);
  fprintf(out, "\n");
  fprintf(w->writer[SAMPLES].file, "timestep,ray,view,x,y,sample\n");
}

static void write_step(tracer *w, int t)
{
  const uint64_t now = ++w->report->timesteps;
  FILE *spikes = w->writer[SPIKES].file, *potentials = w->writer[POTENTIALS].file;
  fprintf(potentials, "%" PRIu64 ",", now);
  for (int g = 0; g < GROUPS; g++) {
    const int l = group[g];
    const fx_layer *layer = &w->scene->net.layer[l];
    for (int n = 0; n < layer->n_out; n++) {
      const bool spike = fired(&w->trace, l, t, n);
      if (spike) fprintf(spikes, "%s.%d,%" PRIu64 "\n", fx_layer_name(l), n, now);
      fprintf(potentials, "%" PRId32 ",", fx_membrane_left(&w->scene->net, &w->trace, l, t, n));
      w->report->spikes += spike;
    }
  }
  fprintf(potentials, "\n");
}

/* fx_net_fn */
static sf_status evaluate(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  tracer *w = user;
  const fx_net *net = &w->scene->net;
  fx_net_next(net, ray->dir, first, f, w->base, out, &w->trace, NULL);
  FILE *samples = w->writer[SAMPLES].file;
  fprintf(samples, "%" PRIu64 ",%d,", w->report->timesteps + 1, w->ray);
  sf_csv_text(samples, w->data->view[w->view].name);
  fprintf(samples, ",%d,%d,%" PRIu64 "\n", w->x, w->y, w->sample);
  for (int t = 0; t < net->steps; t++) write_step(w, t);
  w->report->rays += w->sample++ == 0;
  w->report->samples++;
  return sf_ok();
}

static sf_status trace_ray(tracer *w)
{
  const uint64_t seed = w->options->seed, number = (uint64_t)w->ray;
  w->view = w->options->view >= 0 ? w->options->view
                                  : (int)sf_random_below(seed, STREAM_VIEW, number, (uint64_t)w->data->count);
  const sf_camera *camera = &w->data->view[w->view].camera;
  w->x = (int)sf_random_below(seed, STREAM_X, number, (uint64_t)camera->width);
  w->y = (int)sf_random_below(seed, STREAM_Y, number, (uint64_t)camera->height);
  w->sample = 0;
  fx_ray ray;
  fx_pixel pixel;
  fx_counts march = {0};
  SF_TRY(sf_pixel_ray(w->scene, w->data, &w->data->view[w->view], w->x, w->y, &ray));
  return fx_render_ray(w->scene, &ray, evaluate, w, &pixel, &march);
}

static sf_status trace_rays(tracer *w, const char *folder)
{
  char path[4096];
  SF_TRY(sf_make_dir(folder));
  for (int i = 0; i < FILES; i++) {
    snprintf(path, sizeof path, "%s/%s", folder, file_name[i]);
    SF_TRY(sf_writer_open(&w->writer[i], path));
  }
  write_header(w);
  for (; w->ray < w->options->rays; w->ray++) SF_TRY(trace_ray(w));
  if (!w->report->samples)
    return sf_fail(SF_E_FORMAT, "%s: none of %d rays has a sample: no traces", w->data->path, w->options->rays);
  for (int i = 0; i < FILES; i++) SF_TRY(sf_writer_commit(&w->writer[i]));
  return sf_ok();
}

sf_status sf_traces_write(const char *folder, const fx_scene *scene, const sf_dataset *data,
                          const sf_traces_options *options, sf_traces_report *report)
{
  tracer w = {.scene = scene, .data = data, .options = options, .report = report};
  memset(report, 0, sizeof *report);
  if (options->view >= data->count)
    return sf_fail(SF_E_USAGE, "view %d is out of range: %s has %d", options->view, data->path, data->count);
  const sf_status status = trace_rays(&w, folder);
  for (int i = 0; i < FILES; i++) sf_writer_abort(&w.writer[i]);
  return status;
}
