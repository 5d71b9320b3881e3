/* Speed of the trainer's parts, each beside its ceiling and its naive version. usage: bench OUT.json [SCENE.snn
 * TWIN.safetensors DATA] Ceilings are measured on the spot: multiply-adds per second of all threads (of bfloat16 pairs
 * where the kernels use them) over the operations of one sample with every product dense, memory bandwidth over the
 * bytes, or random reads of a table as large as one level over the 128 corners of one sample. Naive: the oracle where
 * there is one, else the portable build of the kernels; for Adam the textbook's loop over every parameter. */
#include "bench.h"
#include "float_fixture.h"
#include "base/clock.h"
#include "base/io.h"
#include "src/fx/core.h"
#include "train/internal.h"
#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

/* Multiply-adds of one sample's forward pass. */
static double operations(int steps)
{
  return 32 * 128 + 16 * 128 + steps * (128.0 * 16 + 15 * 128 + 128 * 128 + 128 * 3);
}

/* Bytes of Adam per parameter where a share of the cache lines has gradients: every gradient is read; of what is
 * touched, 3 more floats are read and 4 written. */
static double adam_bytes(double touched)
{
  return 4 + touched * 28;
}

void put(cJSON *json, const char *name, double value, const char *unit, double ceiling, double naive)
{
  cJSON *entry = cJSON_AddObjectToObject(json, name);
  cJSON_AddNumberToObject(entry, "value", value);
  cJSON_AddStringToObject(entry, "unit", unit);
  if (isfinite(ceiling))
    cJSON_AddNumberToObject(entry, "ceiling", ceiling);
  else
    cJSON_AddNullToObject(entry, "ceiling");
  if (isfinite(naive))
    cJSON_AddNumberToObject(entry, "naive", naive);
  else
    cJSON_AddNullToObject(entry, "naive");
  const bool less = !strcmp(unit, "s");
  printf("%-28s %12.4g %-10s", name, value, unit);
  if (isfinite(ceiling))
    printf("  ceiling %10.4g (%4.1f %%)", ceiling, 100 * (less ? ceiling / value : value / ceiling));
  if (isfinite(naive)) printf("  naive %10.4g (x %.1f)", naive, less ? naive / value : value / naive);
  printf("\n");
}

/* gain: of the inputs of D1 and C1. At 1 some 8 and 16 % of them fire, at 4 some 36 and 39 %, as in trained nets. */
static sf_model full_model(sf_net_kind net, sf_input_mode mode, int steps, float gain)
{
  sf_config c = sf_config_default();
  c.net = net;
  c.mode = mode;
  c.steps = steps;
  sf_model m;
  if (sf_model_create(&m, &c).code) exit(1);
  for (size_t i = 0; i < m.size; i++) m.value[i] = 0.1f * test_random(i);
  for (int i = 0; i < 128 * 32; i++) sf_model_param(&m, SF_P_D1)[i] *= 5 * gain;
  for (int i = 0; i < 128 * 31; i++) sf_model_param(&m, SF_P_C1)[i] *= 10 * gain;
  for (int i = 0; i < 128 * 128; i++) sf_model_param(&m, SF_P_C2)[i] *= 3.5f;
  return m;
}

/* Samples per second of all threads over `seconds`. In radix mode of the last prefix, as in most iterations. */
static double nets(const sf_kernels *k, const sf_model *m, bool with_backward, double seconds)
{
  double total = 0;
  const sf_net_view view = sf_net_view_of(m);
  sf_net_words *net = sf_aligned_alloc(sizeof *net);
  k->prepare(&view, net);
  const int steps = m->config.steps;
#pragma omp parallel reduction(+ : total)
  {
    sf_block *b = sf_aligned_alloc(sizeof *b);
    sf_net_scratch *w = sf_aligned_alloc(sizeof *w);
    sf_net_grad *g = sf_aligned_alloc(sizeof *g);
    float *ds = sf_aligned_alloc(SF_T_MAX * SF_BLOCK * 4), *dc = sf_aligned_alloc(SF_T_MAX * 3 * SF_BLOCK * 4),
          *df = sf_aligned_alloc(32 * SF_BLOCK * 4);
    for (int i = 0; i < 32 * SF_BLOCK; i++) b->f[i] = test_random(i);
    for (int i = 0; i < 16 * SF_BLOCK; i++) b->sh[i] = test_random(99999 + i);
    for (int i = 0; i < SF_T_MAX * 3 * SF_BLOCK; i++) dc[i] = 1e-3f * test_random(5000 + i);
    b->from = steps - 1;
    double start = sf_seconds(), now = start;
    long blocks = 0;
    for (; now - start < seconds; now = sf_seconds(), blocks += 8)
      for (int i = 0; i < 8; i++) {
        k->forward(net, b, steps, with_backward ? steps : 0, w);
        if (with_backward) k->backward(net, b, steps, ds, dc, df, g, w);
      }
    total += (double)blocks * SF_BLOCK / (now - start);
    free(b), free(w), free(g), free(ds), free(dc), free(df);
  }
  free(net);
  return total;
}

static double naive_forward(const sf_model *m)
{
  double total = 0;
#pragma omp parallel reduction(+ : total)
  {
    float f[32], sh[16], sigma[8], colour[24];
    for (int i = 0; i < 32; i++) f[i] = test_random(i);
    for (int i = 0; i < 16; i++) sh[i] = test_random(99 + i);
    double start = sf_seconds();
    long n = 0;
    for (; sf_seconds() - start < 0.5; n++) sf_net_sample(m, f, sh, m->config.steps, sigma, colour, NULL);
    total += (double)n / (sf_seconds() - start);
  }
  return total;
}

static void bench_nets(cJSON *json, const ceilings *c)
{
  const sf_kernels *best = sf_kernels_training(), *portable = sf_kernels_select("portable");
  static const struct {
    const char *name;
    sf_net_kind net;
    sf_input_mode mode;
    int steps;
    float gain;
  } cases[] = {{"t8", SF_NET_SNN, SF_HYBRID, 8, 1},      {"t8.busy", SF_NET_SNN, SF_HYBRID, 8, 4},
               {"t3", SF_NET_SNN, SF_HYBRID, 3, 1},      {"t1", SF_NET_SNN, SF_HYBRID, 1, 1},
               {"t8.radix", SF_NET_SNN, SF_RADIX, 8, 1}, {"t3.radix", SF_NET_SNN, SF_RADIX, 3, 1},
               {"ann", SF_NET_ANN, SF_HYBRID, 1, 1}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    sf_model m = full_model(cases[i].net, cases[i].mode, cases[i].steps, cases[i].gain);
    const int products = cases[i].mode == SF_RADIX ? 1 : cases[i].steps; /* of a layer that waits: one */
    const double most = c->fma / operations(products);
    char name[64];
    snprintf(name, sizeof name, "train.nets.fwd.%s", cases[i].name);
    put(json, name, nets(best, &m, false, 1), "samples/s", most, naive_forward(&m));
    snprintf(name, sizeof name, "train.nets.fwdbwd.%s", cases[i].name);
    put(json, name, nets(best, &m, true, 1), "samples/s", most / 3, nets(portable, &m, true, 1));
    sf_model_free(&m);
  }
}

enum { GRID_BLOCKS = 1024 };

typedef struct grid_rig {
  sf_model model;
  float *x, *f, *grad;
} grid_rig;

/* Samples per second of all threads, forward or backward. */
static double grid(const grid_rig *r, const sf_kernels *k, bool backward)
{
  const double start = sf_seconds();
#pragma omp parallel for schedule(dynamic, 1)
  for (int l = 0; l < 16; l++)
    for (int b = 0; b < GRID_BLOCKS; b++) {
      float *f = r->f + (b * 16 + l) * 2 * SF_BLOCK;
      const float *x = r->x + b * 3 * SF_BLOCK;
      if (backward)
        k->grid_backward(&r->model.level[l], x, f, r->grad);
      else
        k->grid_forward(&r->model.level[l], r->model.value, x, f);
    }
  return GRID_BLOCKS * SF_BLOCK / (sf_seconds() - start);
}

static double naive_grid(const grid_rig *r)
{
  const double start = sf_seconds();
#pragma omp parallel for
  for (int s = 0; s < GRID_BLOCKS * SF_BLOCK; s++) {
    float at[3] = {r->x[s], r->x[s + 1], r->x[s + 2]}, out[32];
    sf_grid_features(&r->model, at, out);
    r->f[s] = out[0];
  }
  return GRID_BLOCKS * SF_BLOCK / (sf_seconds() - start);
}

static void bench_grid(cJSON *json, const ceilings *c)
{
  const sf_kernels *k = sf_kernels_training(), *portable = sf_kernels_select("portable");
  grid_rig r = {.model = full_model(SF_NET_SNN, SF_HYBRID, 8, 1),
                .x = sf_aligned_alloc(GRID_BLOCKS * 3 * SF_BLOCK * sizeof(float)),
                .f = sf_aligned_alloc(GRID_BLOCKS * 32 * SF_BLOCK * sizeof(float))};
  r.grad = sf_aligned_alloc(r.model.size * sizeof(float));
  for (int i = 0; i < GRID_BLOCKS * 3 * SF_BLOCK; i++) r.x[i] = sf_random_float(1, 2, i);
  const double most = c->reads / 128, forward = grid(&r, k, false), backward = grid(&r, k, true);
  const double naive_backward = grid(&r, portable, true);
  put(json, "train.grid.fwd", forward, "samples/s", most, naive_grid(&r));
  put(json, "train.grid.bwd", backward, "samples/s", most / 2, naive_backward); /* read and written */
  free(r.x), free(r.f), free(r.grad);
  sf_model_free(&r.model);
}

/* Kingma and Ba's loop over every parameter. */
static void naive_adam(size_t n, float *value, const float *g, float *m, float *v)
{
#pragma omp parallel for
  for (size_t i = 0; i < n; i++) {
    m[i] = 0.9f * m[i] + 0.1f * g[i];
    v[i] = 0.99f * v[i] + 0.01f * g[i] * g[i];
    value[i] -= 1e-2f * (m[i] / 0.1f) / (sqrtf(v[i] / 0.01f) + 1e-15f);
  }
}

static void bench_adam(cJSON *json, const ceilings *c)
{
  sf_model m = full_model(SF_NET_SNN, SF_HYBRID, 8, 1);
  float *g = sf_aligned_alloc(m.size * 4), *a = sf_aligned_alloc(m.size * 4), *v = sf_aligned_alloc(m.size * 4);
  const sf_kernels *kernels = sf_kernels_training();
  sf_adam adam = {1e-2, 0.9, 0.99, 1e-15, 1, 0};
  double best = 1e9, naive = 1e9;
  const double touched = 0.4; /* of the cache lines, as in an iteration of 16384 samples on lego */
  for (int i = 0; i < 5; i++) {
    for (size_t j = 0; j + 16 <= m.size; j += 16)
      if (sf_random_float(1, i, j) < touched) g[j + j / 16 % 16] = 1e-3f;
    double start = sf_seconds();
#pragma omp parallel for schedule(dynamic, 1)
    for (int l = 0; l < 16; l++) {
      const size_t at = 2 * m.level[l].offset;
      kernels->adam(&adam, (size_t)2 * m.level[l].entries, m.value + at, g + at, a + at, v + at);
    }
    best = fmin(best, sf_seconds() - start);
    start = sf_seconds();
    naive_adam(m.size, m.value, g, a, v);
    naive = fmin(naive, sf_seconds() - start);
  }
  put(json, "train.adam", m.size / best, "params/s", c->bytes / adam_bytes(touched), m.size / naive);
  free(g), free(a), free(v);
  sf_model_free(&m);
}

/* Samples per second of the iterations after the first 16. */
static sf_status iterations(const sf_dataset *data, const sf_kernels *kernels, int count, double *rate)
{
  sf_train_options options = sf_train_defaults();
  options.stage1 = 400;
  options.stage2 = 0;
  options.no_scaling = true;
  options.samples = 1 << 16;
  sf_trainer *t = NULL;
  sf_status status = sf_trainer_create(&t, data, &options, NULL);
  double samples = 0, seconds = 0;
  sf_train_stats s = {0};
  for (int i = 0; i < count && !status.code; i++) {
    const double before = s.seconds;
    t->kernels = i < 16 ? sf_kernels_training() : kernels;
    status = sf_trainer_step(t, &s);
    if (i >= 16) samples += s.samples, seconds += s.seconds - before;
  }
  sf_trainer_free(t);
  *rate = samples / seconds;
  return status;
}

/* The parts' ceilings one after another: nets, which multiply once for all radix spikes, grid, and Adam over a table of
 * which an iteration touches everything. */
static double iteration_ceiling(const ceilings *c)
{
  const double parameters = 12.2e6, samples = 1 << 16;
  return 1 / (3 * operations(1) / c->fma + 3 * 128 / c->reads + parameters * adam_bytes(1) / c->bytes / samples);
}

static sf_status bench_iteration(cJSON *json, const ceilings *c)
{
  char folder[] = "/tmp/spikefield-bench-XXXXXX", command[64];
  if (!mkdtemp(folder)) return sf_fail(SF_E_IO, "%s: cannot create", folder);
  const sf_procedural_options o = {.width = 128, .height = 128, .train_views = 20, .test_views = 1, .seed = 1};
  sf_dataset data = {0};
  double rate = 0, naive = 0;
  sf_status status = sf_procedural_write("textured", folder, &o, NULL, NULL);
  if (!status.code) status = sf_dataset_load(&data, folder, "train", &(sf_dataset_options){.downscale = 1});
  if (!status.code) status = iterations(&data, sf_kernels_training(), 64, &rate);
  if (!status.code) status = iterations(&data, sf_kernels_select("portable"), 20, &naive);
  if (!status.code) put(json, "train.iteration.t8", rate, "samples/s", iteration_ceiling(c), naive);
  if (!status.code) status = bench_tensorf(json, c, &data);
  sf_dataset_free(&data);
  snprintf(command, sizeof command, "rm -rf %s", folder);
  if (system(command) && !status.code) status = sf_fail(SF_E_IO, "%s: cannot remove", folder);
  struct rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  put(json, "train.memory", (double)usage.ru_maxrss / 1024, "MiB", NAN, NAN);
  return status;
}

static const char *const parts[] = {"nets", "grid", "adam", "iteration", "fixed", "rtl", NULL};

/* --only PART in front of the other arguments; NULL: all. Exits on what is not understood. */
static const char *only_part(int *argc, char ***argv)
{
  if (*argc < 2 || (*argv)[1][0] != '-') return NULL;
  const bool only = !strcmp((*argv)[1], "--only") && *argc > 2;
  for (int i = 0; only && parts[i]; i++)
    if (!strcmp((*argv)[2], parts[i])) {
      *argc -= 2, *argv += 2;
      return parts[i];
    }
  const bool help = !strcmp((*argv)[1], "--help") || !strcmp((*argv)[1], "-h");
  fprintf(help ? stdout : stderr,
          "usage: bench [--only nets|grid|adam|iteration|fixed|rtl] [FILE.json [SCENE.snn TWIN.safetensors DATA]]\n"
          "`make bench` starts it, `make bench ONLY=rtl` one part\n");
  exit(help ? 0 : 2);
}

int main(int argc, char **argv)
{
  const char *only = only_part(&argc, &argv);
#define WANTED(part) (!only || !strcmp(only, part))
  cJSON *json = cJSON_CreateObject();
  const char *kernels = sf_kernels_training()->name;
  sf_status status = sf_ok();
  if (!only || strcmp(only, "rtl")) {
    const ceilings c = ceilings_measure(kernels);
    printf("%d threads, kernels %s: %.0f G multiply-adds/s, %.1f GB/s read, %.2f G random reads/s of 4 MiB\n",
           omp_get_max_threads(), kernels, c.fma * 1e-9, c.bytes * 1e-9, c.reads * 1e-9);
    if (WANTED("nets")) bench_nets(json, &c);
    if (WANTED("grid")) bench_grid(json, &c);
    if (WANTED("adam")) bench_adam(json, &c);
    if (WANTED("iteration")) status = bench_iteration(json, &c);
    if (!status.code && WANTED("fixed"))
      status = bench_fixed(json, &c, argc > 4 ? argv[2] : NULL, argc > 4 ? argv[3] : NULL, argc > 4 ? argv[4] : NULL);
  }
  if (!status.code && WANTED("rtl")) status = bench_rtl(json);
  if (!status.code && argc > 1) status = sf_json_save(json, argv[1]);
  cJSON_Delete(json);
  if (status.code) fprintf(stderr, "bench: %s\n", status.message);
  return status.code != SF_OK;
}
