/* Traces in SANA-FE's files: every spike and membrane against the naive nets, sample by sample. */
#include "ck_run.h"
#include "energy/energy.h"
#include "exchange/exchange.h"
#include "tests/folder_fixture.h"
#include "tests/fx_fixture.h"

enum { VIEWS = 2, SIZE = 8, RAYS = 40, LINE = 1 << 16, STEPS = 4 };

static sf_view view[VIEWS];
static sf_dataset data;

/* Two cameras that look at the middle of the box. */
static void make_data(void)
{
  make_folder();
  for (int v = 0; v < VIEWS; v++) {
    snprintf(view[v].name, sizeof view[v].name, "r_%d", v);
    view[v].camera =
        (sf_camera){.width = SIZE, .height = SIZE, .fx = SIZE, .fy = SIZE, .cx = SIZE / 2., .cy = SIZE / 2.};
    for (int a = 0; a < 3; a++) view[v].camera.to_world[5 * a] = 1;
    view[v].camera.to_world[11] = 2 + (float)v;
  }
  data = (sf_dataset){.path = "made", .view = view, .count = VIEWS, .total = VIEWS, .scale = 1, .bound = 1};
}

static FILE *open_file(const char *name)
{
  FILE *file = fopen(in(name), "r");
  ck_assert_msg(file != NULL, "%s is missing", name);
  return file;
}

static void next_line(FILE *file, char line[LINE])
{
  ck_assert_ptr_nonnull(fgets(line, LINE, file));
}

/* ---- what must stand there ---- */

typedef struct expectation {
  const fx_net *net;
  FILE *spikes, *potentials;
  unsigned long long now, spike_lines;
  int32_t base[SF_LANES];
  fx_trace trace;
} expectation;

static const int group[3] = {FX_C1, FX_C2, FX_D1};

static void ck_group(expectation *e, int l, int t, char **rest)
{
  char line[64], text[64];
  for (int n = 0; n < e->net->layer[l].n_out; n++) {
    const bool fired = e->trace.spikes[l][t][n / 64] >> (n % 64) & 1;
    const long v = strtol(*rest, rest, 10);
    const int32_t expected = e->trace.membrane[l][t][n] - (fired ? fx_net_theta(e->net, l) : 0);
    if (*(*rest)++ != ',' || v != expected)
      ck_abort_msg("%s.%d at %llu: %ld instead of %d", fx_layer_name(l), n, e->now, v, expected);
    if (!fired) continue;
    snprintf(text, sizeof text, "%s.%d,%llu\n", fx_layer_name(l), n, e->now);
    if (!fgets(line, sizeof line, e->spikes) || strcmp(line, text)) ck_abort_msg("no line %s", text);
    e->spike_lines++;
  }
}

/* fx_net_fn */
static sf_status expect(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  expectation *e = user;
  static char line[LINE];
  fx_counts counts = {0};
  naive_sample(e->net, f, ray->dir, first, out, &e->trace, &counts);
  for (int t = 0; t < e->net->steps; t++) {
    char *rest;
    next_line(e->potentials, line);
    ck_assert_uint_eq(strtoull(line, &rest, 10), ++e->now);
    ck_assert_int_eq(*rest++, ',');
    for (int g = 0; g < 3; g++) ck_group(e, group[g], t, &rest);
    ck_assert_str_eq(rest, "\n");
  }
  return sf_ok();
}

static void ck_headers(expectation *e)
{
  static char line[LINE], expected[LINE];
  next_line(e->spikes, line);
  ck_assert_str_eq(line, "neuron,timestep\n");
  int at = snprintf(expected, LINE, "timestep,");
  for (int g = 0; g < 3; g++)
    for (int n = 0; n < e->net->layer[group[g]].n_out; n++)
      at += snprintf(expected + at, (size_t)(LINE - at), "neuron %s.%d,", fx_layer_name(group[g]), n);
  next_line(e->potentials, line);
  line[strcspn(line, "\n")] = 0;
  ck_assert_str_eq(line, expected);
}

/* Rays in the order of samples.csv, which says where each is. */
static void ck_traces(const fx_scene *scene, const sf_traces_report *report, int only)
{
  static expectation e;
  char line[LINE];
  e = (expectation){.net = &scene->net, .spikes = open_file("spikes.csv"), .potentials = open_file("potentials.csv")};
  FILE *samples = open_file("samples.csv");
  ck_headers(&e);
  next_line(samples, line);
  ck_assert_str_eq(line, "timestep,ray,view,x,y,sample\n");
  unsigned long long timestep, sample;
  int number, v, x, y, rays = 0;
  while (fgets(line, LINE, samples)) {
    ck_assert_int_eq(sscanf(line, "%llu,%d,r_%d,%d,%d,%llu", &timestep, &number, &v, &x, &y, &sample), 6);
    if (sample) continue;
    ck_assert(only < 0 || v == only);
    ck_assert_uint_eq(timestep, e.now + 1);
    fx_ray ray;
    fx_pixel pixel;
    fx_counts counts = {0};
    ck_ok(sf_pixel_ray(scene, &data, &view[v], x, y, &ray));
    ck_ok(fx_render_ray(scene, &ray, expect, &e, &pixel, &counts));
    rays++;
  }
  ck_assert_ptr_null(fgets(line, LINE, e.spikes));
  ck_assert_ptr_null(fgets(line, LINE, e.potentials));
  ck_assert_int_eq(report->rays, rays);
  ck_assert_uint_eq(report->timesteps, e.now);
  ck_assert_uint_eq(report->samples * (uint64_t)scene->net.steps, e.now);
  ck_assert_uint_eq(report->spikes, e.spike_lines);
  fclose(e.spikes), fclose(e.potentials), fclose(samples);
}

LOOP_TEST(every_spike_and_membrane_is_the_nets, FX_RADIX + 1)
{
  const fixture_sizes sizes = {4, 20, 9, 7, 70, 33, STEPS, _i, {0}};
  OWNED(fx_scene) scene = fixture_scene(&sizes, 3);
  scene.step_q24 = 500000; /* some 30 samples along a ray */
  sf_traces_report report;
  for (int only = -1; only < VIEWS; only++) {
    ck_ok(sf_traces_write(folder, &scene, &data, &(sf_traces_options){.view = only, .rays = RAYS, .seed = 5}, &report));
    ck_assert_int_gt(report.rays, 3);
    ck_assert_uint_gt(report.spikes, 100);
    ck_traces(&scene, &report, only);
  }
}

TEST(names_of_views_are_quoted)
{
  const fixture_sizes sizes = {4, 20, 9, 7, 70, 33, STEPS, FX_HYBRID, {0}};
  OWNED(fx_scene) scene = fixture_scene(&sizes, 3);
  scene.step_q24 = 500000;
  sf_traces_report report;
  char line[LINE];
  strcpy(view[0].name, "r,\"0");
  ck_ok(sf_traces_write(folder, &scene, &data, &(sf_traces_options){.view = 0, .rays = RAYS, .seed = 5}, &report));
  FILE *samples = open_file("samples.csv");
  next_line(samples, line);
  next_line(samples, line);
  ck_assert_msg(strstr(line, ",\"r,\"\"0\",") != NULL, "%s", line);
  fclose(samples);
}

TEST(refusals_leave_nothing)
{
  const fixture_sizes sizes = {4, 20, 9, 7, 70, 33, STEPS, FX_HYBRID, {0}};
  OWNED(fx_scene) scene = fixture_scene(&sizes, 3);
  sf_traces_report report;
  ck_bad(sf_traces_write(folder, &scene, &data, &(sf_traces_options){.view = VIEWS, .rays = 1}, &report), SF_E_USAGE,
         "view 2", "has 2");
  memset(scene.occupancy, 0, 64);
  ck_bad(sf_traces_write(folder, &scene, &data, &(sf_traces_options){.view = -1, .rays = 3}, &report), SF_E_FORMAT,
         "made", "none of 3 rays");
  ck_assert_int_eq(entries(), 0);
}

ck_options ck_program = {.set_up = make_data, .tear_down = remove_folder};
