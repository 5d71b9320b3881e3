/* The golden model for SystemVerilog benches against the core itself: beats and samples, results, spikes, rows,
 * membranes, counters; what it refuses; many handles in many threads. */
#include "ck_run.h"
#include "spikefield/sf_golden_dpi.h"
#include "tests/lib_fixture.h"
#include "tests/random_net.h"
#include <pthread.h>

enum { SAMPLES = 24, THREADS = 4 };
static int16_t direction[FX_SH], features[SF_FEATURE_MAX];

static void *open_golden(void)
{
  void *golden = sf_golden_open(in("s.snn"), 0);
  ck_assert_ptr_nonnull(golden);
  ck_assert_str_eq(sf_golden_error(golden), "");
  return golden;
}

static void draw_sample(uint64_t seed, int sample)
{
  random_source r = {seed, (uint64_t)sample * 100};
  memset(features, 0, sizeof features);
  memset(direction, 0, sizeof direction);
  draw_values(&r, features, core.net.layer[FX_D1].n_in, false);
  draw_values(&r, direction, fx_net_constants(&core.net), false);
}

static bool begins_ray(int sample)
{
  return sample % 5 == 0;
}

static int send(void *golden, const int16_t *value, int n, bool user, bool last)
{
  int got = 0;
  for (int i = 0; i < n; i += 4) {
    uint64_t data = 0;
    for (int v = 0; v < 4 && i + v < n; v++) data |= (uint64_t)(uint16_t)value[i + v] << (16 * v);
    got = sf_golden_beat(golden, data, user && i == 0, last && i + 4 >= n);
    if (i + 4 < n) ck_assert_int_eq(got, 0);
  }
  return got;
}

static int send_sample(void *golden, bool first)
{
  const int n_dir = fx_net_constants(&core.net);
  if (first) ck_assert_int_eq(send(golden, direction, n_dir, true, false), 0);
  return send(golden, features, core.net.layer[FX_D1].n_in, false, true);
}

static void same_trace(void *golden, const fx_trace *trace)
{
  for (int l = 0; l < SF_LAYERS; l++)
    for (int t = 0; t < core.net.steps; t++) {
      uint32_t spikes[SF_GOLDEN_WORDS];
      sf_golden_spikes(golden, l, t, spikes);
      for (int n = 0; n < SF_LANES; n++) {
        const bool fired = trace->spikes[l][t][n / 64] >> (n % 64) & 1, has = n < core.net.layer[l].n_out;
        ck_assert_int_eq(spikes[n / 32] >> (n % 32) & 1, fired);
        ck_assert_int_eq(sf_golden_membrane(golden, l, t, n), has ? fx_membrane_left(&core.net, trace, l, t, n) : 0);
        ck_assert_int_eq(sf_golden_current(golden, l, t, n), has ? trace->current[l][t][n] : 0);
      }
    }
}

static void same_words(const uint32_t *words, const uint64_t *bits)
{
  for (int n = 0; n < 32 * SF_GOLDEN_WORDS; n++)
    ck_assert_uint_eq(words[n / 32] >> (n % 32) & 1, n < SF_LANES ? bits[n / 64] >> (n % 64) & 1 : 0);
}

static void same_rows(void *golden, const fx_trace *trace)
{
  uint32_t rows[SF_GOLDEN_WORDS];
  uint64_t any[SF_SPIKE_WORDS] = {0};
  for (int t = 0; t < core.net.steps; t++) {
    sf_golden_rows(golden, FX_C2, t, rows);
    same_words(rows, trace->spikes[FX_C1][t]);
    for (int word = 0; word < SF_SPIKE_WORDS; word++) any[word] |= trace->spikes[FX_C2][t][word];
  }
  sf_golden_rows(golden, FX_C3, 0, rows);
  same_words(rows, any);
}

static void same_counters(void *golden, const fx_counts *counts)
{
  ck_assert_uint_eq(sf_golden_counter(golden, 56), counts->samples);
  ck_assert_uint_eq(sf_golden_counter(golden, 57), counts->rays);
  for (int l = 0; l < SF_LAYERS; l++)
    for (int t = 0; t < SF_T_MAX; t++) {
      const fx_layer_counts *c = &counts->layer[l];
      const uint64_t expected[8] = {c->mac[t],    c->sop[t],     c->spikes[t],  c->updates[t],
                                    c->weight[t], c->state_r[t], c->state_w[t], c->special[t]};
      for (int e = 0; e < 8; e++) ck_assert_uint_eq(sf_golden_counter(golden, (e * 8 + l) * 8 + t), expected[e]);
    }
  ck_assert_uint_gt(counts->layer[FX_C2].spikes[0], 0);
}

TEST(beats_are_samples_of_the_core)
{
  void *golden = open_golden(), *twin = open_golden();
  fx_counts counts = {0};
  fx_trace trace;
  fx_out out;
  int32_t base[SF_LANES];
  for (int i = 0; i < SAMPLES; i++) {
    draw_sample(1, i);
    if (begins_ray(i)) fx_net_direction(&core.net, direction, base, &counts);
    fx_net_sample(&core.net, features, base, &out, &trace, &counts);
    ck_assert_int_eq(send_sample(golden, begins_ray(i)), 1);
    uint32_t d[8], f[16];
    for (int k = 0; k < 16; k++) f[k] = (uint16_t)features[2 * k] | (uint32_t)(uint16_t)features[2 * k + 1] << 16;
    for (int k = 0; k < 8; k++) d[k] = (uint16_t)direction[2 * k] | (uint32_t)(uint16_t)direction[2 * k + 1] << 16;
    ck_assert_int_eq(sf_golden_sample(twin, begins_ray(i), d, f), 1);
    void *const both[2] = {golden, twin};
    for (int g = 0; g < 2; g++) {
      ck_assert_uint_eq(sf_golden_density(both[g]), out.sigma);
      for (int c = 0; c < 3; c++) ck_assert_uint_eq(sf_golden_colour(both[g], c), out.colour[c]);
      same_trace(both[g], &trace);
      same_rows(both[g], &trace);
    }
  }
  same_counters(golden, &counts);
  same_counters(twin, &counts);
  sf_golden_clear_counters(golden);
  ck_assert_uint_eq(sf_golden_counter(golden, 56), 0);
  sf_golden_close(golden);
  sf_golden_close(twin);
}

TEST(sizes_and_steps)
{
  void *golden = sf_golden_open(in("s.snn"), core.net.steps == 1 ? 2 : 1);
  ck_assert_int_eq(sf_golden_steps(golden), core.net.steps == 1 ? 2 : 1);
  for (int l = 0; l < SF_LAYERS; l++) {
    ck_assert_int_eq(sf_golden_inputs(golden, l), core.net.layer[l].n_in);
    ck_assert_int_eq(sf_golden_outputs(golden, l), core.net.layer[l].n_out);
  }
  sf_golden_close(golden);
}

TEST(what_it_refuses)
{
  void *golden = sf_golden_open(in("absent.snn"), 0);
  ck_assert_ptr_nonnull(strstr(sf_golden_error(golden), "absent.snn"));
  ck_assert_int_eq(sf_golden_beat(golden, 0, 1, 0), -1);
  ck_assert_int_eq(sf_golden_outputs(golden, 0), 0);
  sf_golden_close(golden);
  golden = sf_golden_open(in("s.snn"), 9);
  ck_assert_ptr_nonnull(strstr(sf_golden_error(golden), "steps"));
  sf_golden_close(golden);

  golden = open_golden();
  draw_sample(2, 0);
  ck_assert_int_eq(sf_golden_density(golden), 0);
  ck_assert_int_eq(send_sample(golden, false), -1);
  ck_assert_ptr_nonnull(strstr(sf_golden_error(golden), "direction"));
  ck_assert_int_eq(sf_golden_beat(golden, 0, 1, 1), -1);
  ck_assert_ptr_nonnull(strstr(sf_golden_error(golden), "too short"));
  ck_assert_int_eq(send(golden, direction, core.net.layer[FX_C1].n_in - core.net.layer[FX_D2].n_out + 1, true, false),
                   0);
  ck_assert_int_eq(send(golden, features, core.net.layer[FX_D1].n_in, false, false), -1);
  ck_assert_ptr_nonnull(strstr(sf_golden_error(golden), "too long"));
  ck_assert_int_eq(sf_golden_beat(golden, 0x0800, 1, 0), -1);
  ck_assert_ptr_nonnull(strstr(sf_golden_error(golden), "2048"));
  ck_assert_int_eq(send_sample(golden, true), 1);
  ck_assert_str_eq(sf_golden_error(golden), "");
  ck_assert_uint_eq(sf_golden_counter(golden, -1), 0);
  ck_assert_uint_eq(sf_golden_counter(golden, 512), 0);
  ck_assert_int_eq(sf_golden_membrane(golden, FX_C1, core.net.steps, 0), 0);
  ck_assert_int_eq(sf_golden_membrane(golden, -1, 0, 0), 0);
  ck_assert_uint_eq(sf_golden_colour(golden, 3), 0);
  sf_golden_close(golden);
  sf_golden_close(NULL);
  ck_assert_str_ne(sf_golden_error(NULL), "");
}

static void *run_thread(void *sum)
{
  void *golden = sf_golden_open(in("s.snn"), 0);
  for (int i = 0; i < 40; i++) {
    sf_golden_sample(golden, i % 7 == 0, (uint32_t[8]){(uint32_t)i}, (uint32_t[16]){(uint32_t)i * 37 % 2047});
    *(uint64_t *)sum = *(uint64_t *)sum * 31 + sf_golden_density(golden) + sf_golden_colour(golden, i % 3);
  }
  sf_golden_close(golden);
  return NULL;
}

TEST(handles_do_not_share)
{
  uint64_t alone = 0, sum[THREADS] = {0};
  pthread_t thread[THREADS];
  run_thread(&alone);
  for (int i = 0; i < THREADS; i++) ck_assert_int_eq(pthread_create(&thread[i], NULL, run_thread, &sum[i]), 0);
  for (int i = 0; i < THREADS; i++) pthread_join(thread[i], NULL);
  for (int i = 0; i < THREADS; i++) ck_assert_uint_eq(sum[i], alone);
  ck_assert_uint_ne(alone, 0);
}

ck_options ck_program = {.set_up = open_fixture, .tear_down = close_fixture};
