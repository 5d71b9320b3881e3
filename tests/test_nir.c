/* NIR graphs read back with libhdf5 and simulated as their nodes, edges and metadata say: the spikes, membranes and
 * outputs of the core and of the float oracle. */
#ifdef SF_HDF5
#include "ck_run.h"

#include "exchange/exchange.h"
#include "tests/float_fixture.h"
#include "tests/tensorf_fixture.h"
#include "tests/folder_fixture.h"
#include "tests/fx_fixture.h"
#include "tests/random_net.h"
#include <hdf5.h>
#include "tests/nir_graph.h"

enum { GRAPHS = 12, INPUTS = 12 };

/* ---- the fixed-point core ---- */

static graph shared;

static void set_inputs(graph *g, const char *name, const int16_t *value)
{
  const int i = find(g, name);
  for (int a = 0; i >= 0 && a < g->node[i].rows; a++) g->node[i].out[a] = value[a];
}

static void same_layer(graph *g, const char *name, const fx_net *net, const fx_trace *trace, int l, int t)
{
  const node *n = need(g, name);
  const double lsb = l == FX_C2 ? 1.0 / (1 << SF_AC_FRAC) : 1;
  ck_assert_int_eq(n->rows, net->layer[l].n_out);
  for (int o = 0; o < n->rows; o++) {
    ck_assert_msg(n->before[o] == trace->membrane[l][t][o] * lsb, "%s step %d neuron %d: %.9g, core %d", name, t, o,
                  n->before[o] / lsb, trace->membrane[l][t][o]);
    ck_assert_int_eq(n->out[o] == 1, trace->spikes[l][t][o / 64] >> (o % 64) & 1);
  }
}

static void same_output(graph *g, const char *name, const fx_net *net, const fx_trace *trace, int l, int t)
{
  const node *n = need(g, name);
  ck_assert_int_eq(n->rows, net->layer[l].n_out);
  for (int o = 0; o < n->rows; o++) ck_assert(n->out[o] == trace->current[l][t][o]);
}

static void same_as_core(graph *g, const fx_net *net, const int16_t *f, const int16_t *dir)
{
  int32_t base[SF_LANES];
  static fx_trace trace;
  fx_out out;
  fx_net_direction(net, dir, base, NULL);
  fx_net_sample(net, f, base, &out, &trace, NULL);
  begin(g);
  set_inputs(g, "features", f);
  set_inputs(g, fx_net_decodes(net) ? "inputs" : "direction", dir);
  ck_assert(g->steps == net->steps);
  const bool density = !fx_net_decodes(net);
  ck_assert(density == (find(g, "density") >= 0));
  for (int t = 0; t < net->steps; t++) {
    step(g, t);
    if (density) same_layer(g, "D1", net, &trace, FX_D1, t);
    if (density) same_output(g, "density", net, &trace, FX_D2, t);
    same_layer(g, "C1", net, &trace, FX_C1, t);
    same_layer(g, "C2", net, &trace, FX_C2, t);
    same_output(g, "colour", net, &trace, FX_C3, t);
  }
}

static void ck_scene(const fx_scene *scene, random_source *r, bool extreme)
{
  ck_ok(sf_nir_write_scene(in("scene.nir"), scene));
  read_graph(&shared, in("scene.nir"));
  for (int s = 0; s < INPUTS; s++) {
    int16_t f[SF_FEATURE_MAX], dir[SF_DIR_MAX];
    draw_values(r, f, SF_FEATURE_MAX, extreme);
    draw_values(r, dir, SF_DIR_MAX, extreme);
    same_as_core(&shared, &scene->net, f, dir);
  }
  free_graph(&shared);
}

/* _i: from typical nets to those of all corners. */
LOOP_TEST(scene_gives_the_spikes_of_the_core, 6)
{
  static random_net n;
  random_source r = {(uint64_t)_i, 0};
  for (int i = 0; i < GRAPHS; i++) {
    random_net_make(&n, &r, _i > 0);
    n.net.mode = (_i == 0 ? i : n.net.mode) % FX_RADIX; /* of the modes that a graph has */
    ck_scene(&(fx_scene){.net = n.net}, &r, _i > 0);
  }
}

LOOP_TEST(biases_and_decoders_too, 4)
{
  random_source r = {(uint64_t)_i, 0};
  for (uint64_t seed = 0; seed < GRAPHS; seed++) {
    const uint64_t number = seed + (uint64_t)(_i * GRAPHS);
    const fixture_sizes sizes = seed % 2 ? fixture_random_decoder(number) : fixture_random_sizes(number);
    OWNED(fx_scene) scene = fixture_scene(&sizes, number);
    scene.net.mode %= FX_RADIX;
    ck_scene(&scene, &r, true);
  }
}

/* ---- the float oracle ---- */

/* Rounding decides only where membrane and threshold are this near: sums of 128 products of about 1 in fp32. */
static const double NEAR = 1e-4;

/* False: some membrane came too near to its threshold to say. */
static bool same_as_oracle(graph *g, const sf_net_trace *trace, int steps)
{
  static const char *const name[3] = {"D1", "C1", "C2"};
  static const int layer[3] = {0, 2, 3};
  const int first = find(g, "D1") < 0;
  for (int t = 0; t < steps; t++) {
    step(g, t);
    for (int l = first; l < 3; l++) {
      const node *n = need(g, name[l]);
      for (int o = 0; o < n->rows; o++) {
        if (fabs(n->before[o] - n->theta) < NEAR) return false;
        ck_assert_double_eq_tol(n->before[o], (double)trace->membrane[layer[l]][t][o], NEAR);
        ck_assert_int_eq(n->out[o] == 1, trace->spike[layer[l]][t][o]);
      }
    }
    for (int o = 0; o < 3; o++)
      ck_assert_double_eq_tol(need(g, "colour")->out[o], (double)trace->current[4][t][o], NEAR);
  }
  return true;
}

LOOP_TEST(model_gives_the_spikes_of_the_oracle, SF_NODECAY + 1)
{
  enum { STEPS = 5, SAMPLES = 60 };
  static sf_net_trace trace;
  OWNED(sf_model) m = test_model(SF_NET_SNN, (sf_input_mode)_i, 64, STEPS, 0.5f);
  m.t_r = STEPS;
  ck_ok(sf_nir_write_model(in("model.nir"), &m));
  read_graph(&shared, in("model.nir"));
  ck_assert(shared.steps == STEPS);
  int certain = 0, fired = 0;
  for (int s = 0; s < SAMPLES; s++) {
    float f[32], sh[SF_DIR_FEATURES], sigma[STEPS], colour[3 * STEPS];
    for (int i = 0; i < 8; i++) f[i] = test_random(1000000 + (uint64_t)(100 * s + i));
    for (int i = 0; i < SF_DIR_FEATURES; i++) sh[i] = test_random(1000050 + (uint64_t)(100 * s + i));
    memset(&trace, 0, sizeof trace);
    sf_net_sample(&m, f, sh, STEPS, sigma, colour, &trace);
    begin(&shared);
    for (int i = 0; i < 8; i++) need(&shared, "features")->out[i] = (double)f[i];
    for (int i = 0; i < SF_DIR_FEATURES; i++) need(&shared, "direction")->out[i] = (double)sh[i];
    certain += same_as_oracle(&shared, &trace, STEPS);
    for (int o = 0; o < 64; o++) fired += trace.spike[3][STEPS - 1][o];
  }
  ck_assert_int_ge(certain, SAMPLES / 2);
  ck_assert_int_gt(fired, 0);
  free_graph(&shared);
}

LOOP_TEST(tensorf_gives_the_spikes_of_the_oracle, 2)
{
  enum { STEPS = 4, SAMPLES = 40 };
  static sf_net_trace trace;
  OWNED(sf_model) m = test_tensorf(SF_NET_SNN, _i, 64, STEPS);
  m.t_r = STEPS;
  const int inputs = sf_tensorf_inputs(&m.config.tensorf);
  ck_ok(sf_nir_write_model(in("tensorf.nir"), &m));
  read_graph(&shared, in("tensorf.nir"));
  ck_assert(find(&shared, "features") < 0 && need(&shared, "inputs")->rows == inputs);
  int certain = 0;
  for (uint64_t s = 0; s < SAMPLES; s++) {
    float values[SF_DECODER_MAX], colour[3 * STEPS];
    begin(&shared);
    for (int i = 0; i < inputs; i++) {
      values[i] = test_random(2000000 + 200 * s + (uint64_t)i);
      need(&shared, "inputs")->out[i] = (double)values[i];
    }
    memset(&trace, 0, sizeof trace);
    sf_net_sample(&m, values, NULL, STEPS, NULL, colour, &trace);
    certain += same_as_oracle(&shared, &trace, STEPS);
  }
  ck_assert_int_ge(certain, SAMPLES / 2);
  free_graph(&shared);
}

/* And a net whose steps are the samples of a ray, and one of mode radix. */
LOOP_TEST(the_relu_twin_is_refused, 3)
{
  OWNED(sf_model) m = test_model(_i ? SF_NET_SNN : SF_NET_ANN, _i == 2 ? SF_RADIX : SF_HYBRID, 32, 1, 0.5f);
  m.config.along = _i == 1;
  const sf_status status = sf_nir_write_model(in("twin.nir"), &m);
  ck_assert_int_eq(status.code, SF_E_UNSUPPORTED);
  ck_assert_ptr_null(fopen(in("twin.nir"), "r"));
}

TEST(a_scene_of_radix_is_refused)
{
  static random_net n;
  random_source r = {78, 0};
  random_net_make(&n, &r, false);
  fx_scene scene = {.net = n.net};
  scene.net.mode = FX_RADIX;
  ck_assert_int_eq(sf_nir_write_scene(in("radix.nir"), &scene).code, SF_E_UNSUPPORTED);
  ck_assert_ptr_null(fopen(in("radix.nir"), "r"));
}

TEST(same_scene_same_bytes)
{
  static random_net n;
  random_source r = {77, 0};
  random_net_make(&n, &r, false);
  const fx_scene scene = {.net = n.net};
  ck_ok(sf_nir_write_scene(in("a.nir"), &scene));
  ck_ok(sf_nir_write_scene(in("b.nir"), &scene));
  ck_assert(same_files(in("a.nir"), in("b.nir")));
  ck_assert_int_eq(sf_nir_write_scene(in("missing/a.nir"), &scene).code, SF_E_IO);
}

/* ---- for tests/chain/read_nir.py: a scene's graph, inputs, and what the core makes of them ---- */

static void write_row(FILE *out, const char *name, const int16_t *value, int n)
{
  fprintf(out, "%s", name);
  for (int i = 0; i < n; i++) fprintf(out, " %d", value[i]);
  fprintf(out, "\n");
}

static void write_spikes(FILE *out, const fx_net *net, const fx_trace *trace)
{
  static const char *const name[SF_LAYERS] = {"D1", 0, "C1", "C2", 0};
  for (int t = 0; t < net->steps; t++)
    for (int l = 0; l < SF_LAYERS; l++) {
      if (!name[l]) continue;
      fprintf(out, "spikes %s %d", name[l], t);
      for (int o = 0; o < net->layer[l].n_out; o++)
        if (trace->spikes[l][t][o / 64] >> (o % 64) & 1) fprintf(out, " %d", o);
      fprintf(out, "\n");
    }
}

static int leave_case(const char *where, int mode)
{
  static random_net n;
  static fx_trace trace;
  random_source r = {(uint64_t)mode + 5, 0};
  char path[4096];
  random_net_make(&n, &r, false);
  n.net.mode = mode;
  const fx_scene scene = {.net = n.net};
  snprintf(path, sizeof path, "%s/%d.nir", where, mode);
  if (sf_nir_write_scene(path, &scene).code != SF_OK) return 1;
  snprintf(path, sizeof path, "%s/%d.txt", where, mode);
  FILE *out = fopen(path, "w");
  for (int s = 0; out && s < INPUTS; s++) {
    int16_t f[SF_FEATURE_MAX], dir[SF_DIR_MAX];
    int32_t base[SF_LANES];
    fx_out result;
    draw_values(&r, f, SF_FEATURE_MAX, false);
    draw_values(&r, dir, SF_DIR_MAX, false);
    fx_net_direction(&n.net, dir, base, NULL);
    fx_net_sample(&n.net, f, base, &result, &trace, NULL);
    write_row(out, "features", f, n.net.layer[FX_D1].n_in);
    write_row(out, "direction", dir, fx_net_constants(&n.net));
    write_spikes(out, &n.net, &trace);
  }
  return !out || fclose(out);
}

ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};

int main(void)
{
  const char *where = getenv("SF_CROSSCHECK");
  if (where) return leave_case(where, FX_HYBRID) || leave_case(where, FX_DECAY) || leave_case(where, FX_NODECAY);
  return ck_main();
}
#else
int main(void)
{
  puts("test_nir: skipped: this build has no HDF5 (libhdf5-dev)");
  return 77;
}
#endif
