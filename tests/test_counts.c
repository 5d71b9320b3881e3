/* Counts and their price: the recount, ledgers by hand, comparisons, limits. */
#include "ck_run.h"
#include "energy/energy.h"
#include "cycles/cycles.h"
#include "tests/audit_fixture.h"
#include <math.h>

static void expect(const fx_counts *c, int layer, int event, uint64_t t0, uint64_t t1)
{
  const uint64_t wanted[2] = {t0, t1};
  for (int t = 0; t < SF_T_MAX; t++) {
    uint64_t value = c->layer[layer].event[event][t];
    ck_assert_msg(value == (t < 2 ? wanted[t] : 0), "%s %s step %d: %llu", fx_layer_name(layer), sf_events[event].name,
                  t, (unsigned long long)value);
  }
}

static void expect_layer(const fx_counts *c, int layer, const uint64_t table[SF_EVENTS][2])
{
  for (int e = 0; e < SF_EVENTS; e++) expect(c, layer, e, table[e][0], table[e][1]);
}

TEST(recount_equals_counting_by_hand)
{
  fx_net net = small_net();
  fx_counts c = {0};
  /* mac, sop, spikes, updates, weight, state_r, state_w, special at steps 0 and 1 */
  static const uint64_t d1[SF_EVENTS][2] = {{12, 0}, {0, 0}, {2, 2}, {3, 3}, {12, 0}, {0, 9}, {9, 9}, {0, 0}};
  static const uint64_t d2[SF_EVENTS][2] = {{0, 0}, {6, 6}, {0, 0}, {1, 1}, {6, 3}, {0, 4}, {4, 4}, {1, 1}};
  static const uint64_t c1[SF_EVENTS][2] = {{20, 8}, {0, 0}, {0, 2}, {4, 4}, {20, 0}, {0, 12}, {12, 12}, {0, 0}};
  static const uint64_t c2[SF_EVENTS][2] = {{0, 0}, {0, 10}, {5, 1}, {5, 5}, {0, 10}, {0, 15}, {15, 15}, {0, 0}};
  static const uint64_t c3[SF_EVENTS][2] = {{0, 0}, {15, 3}, {0, 0}, {3, 3}, {15, 0}, {0, 12}, {12, 12}, {3, 3}};
  sf_recount_sample(&net, small_spikes, true, &c);
  expect_layer(&c, FX_D1, d1), expect_layer(&c, FX_D2, d2), expect_layer(&c, FX_C1, c1);
  expect_layer(&c, FX_C2, c2), expect_layer(&c, FX_C3, c3);
  ck_assert_uint_eq(c.samples, 1);
  ck_assert_uint_eq(c.rays, 1);
  sf_recount_sample(&net, small_spikes, false, &c);
  expect(&c, FX_C1, SF_EVENT_MAC, 28, 16);   /* the direction's 12 only once */
  expect(&c, FX_D2, SF_EVENT_WEIGHT, 12, 6); /* what was read for another sample is read again */
  ck_assert_uint_eq(c.samples, 2);
  ck_assert_uint_eq(c.rays, 1);
}

TEST(recount_sees_every_bit)
{
  fx_net net = small_net();
  net.layer[FX_D1].n_out = net.layer[FX_D2].n_in = SF_LANES;
  for (int bit = 0; bit < SF_LANES; bit++) {
    bitmaps one = {0};
    fx_counts c = {0};
    one[FX_D1][1][bit / 64] = (uint64_t)1 << bit % 64;
    one[FX_C2][0][bit / 64] = (uint64_t)1 << bit % 64; /* beyond C2's 5 lanes too: a fault must not vanish */
    sf_recount_sample(&net, (const uint64_t(*)[SF_T_MAX][SF_SPIKE_WORDS])one, false, &c);
    expect(&c, FX_D1, SF_EVENT_SPIKES, 0, 1);
    expect(&c, FX_D2, SF_EVENT_SOP, 0, 3);
    expect(&c, FX_D2, SF_EVENT_WEIGHT, 0, 3);
    expect(&c, FX_C2, SF_EVENT_SPIKES, 1, 0);
    expect(&c, FX_C3, SF_EVENT_SOP, 3, 0);
  }
}

TEST(ledger_equals_pricing_by_hand)
{
  fx_net net = small_net();
  fx_counts c = {0};
  sf_ledger l;
  sf_recount_sample(&net, small_spikes, true, &c);
  ck_assert_uint_eq(sf_energy_fj(&c), 40 * 4600 + 40 * 900);
  ck_assert_uint_eq(sf_energy_ann_fj(&net, 1), 76 * 4600);
  ck_ok(sf_ledger_make(&net, &c, &l));
  ck_assert_uint_eq(l.mac_fj, 184000);
  ck_assert_uint_eq(l.sop_fj, 36000);
  ck_assert_uint_eq(l.spiking_fj, 220000);
  ck_assert_uint_eq(l.h_once_fj, 32 * 4600 + 36000);            /* of h's 16 products only one step's 8 */
  ck_assert_uint_eq(l.h_spikes_fj, 24 * 4600 + (40 + 8) * 900); /* 12 spikes in 24 updates: half of 16 */
  ck_assert_uint_eq(l.ann_fj, 349600);
  ck_assert_uint_eq(l.ann_hoisted_fj, 349600);
  ck_assert_double_eq_tol(sf_saving_percent(l.spiking_fj, l.ann_fj), 37.0709, 1e-4); /* 1 - 220 / 349.6 */
  c.layer[FX_D1].spikes[0]++;                                                        /* 13 in 24: 8.67 of 16, rounded */
  ck_ok(sf_ledger_make(&net, &c, &l));
  ck_assert_uint_eq(l.h_spikes_fj, 24 * 4600 + (40 + 9) * 900);
  sf_recount_sample(&net, small_spikes, false, &c);
  ck_ok(sf_ledger_make(&net, &c, &l));
  ck_assert_uint_eq(l.ann_fj, 2 * 349600);
  ck_assert_uint_eq(l.ann_hoisted_fj, 2 * 349600 - 12 * 4600);
}

/* Radix has multiplied h once as it is; as spikes it would be there at both steps. C2's sums are no firing. */
TEST(radix_ledger_by_hand)
{
  fx_net net = small_net();
  fx_counts c = {0};
  sf_ledger l;
  net.mode = FX_RADIX;
  sf_recount_sample(&net, small_spikes, true, &c);
  expect(&c, FX_C1, SF_EVENT_MAC, 20, 0);
  expect(&c, FX_D2, SF_EVENT_UPDATES, 3, 3);
  expect(&c, FX_C2, SF_EVENT_UPDATES, 10, 5);
  expect(&c, FX_C2, SF_EVENT_STATE_R, 15, 15);
  expect(&c, FX_C2, SF_EVENT_STATE_W, 30, 15);
  expect(&c, FX_C3, SF_EVENT_SPECIAL, 0, 3);
  ck_ok(sf_ledger_make(&net, &c, &l));
  ck_assert_uint_eq(l.spiking_fj, 32 * 4600 + 40 * 900);
  ck_assert_uint_eq(l.h_once_fj, l.spiking_fj);
  ck_assert_uint_eq(l.h_spikes_fj, 24 * 4600 + (40 + 8) * 900);
}

TEST(nothing_counted_costs_nothing)
{
  fx_net net = small_net();
  fx_counts c = {0};
  sf_ledger l;
  ck_ok(sf_ledger_make(&net, &c, &l));
  ck_assert_uint_eq(l.spiking_fj, 0);
  ck_assert_uint_eq(l.h_spikes_fj, 0);
  ck_assert_uint_eq(l.ann_fj, 0);
  ck_assert(isnan(sf_saving_percent(0, 0)));
}

/* 800 x 800 rays of 1024 samples, 8 steps, every neuron fires: the largest frame. */
TEST(largest_frame_does_not_wrap)
{
  __extension__ typedef unsigned __int128 u128;
  OWNED(fx_scene) scene = fixture_scene(&fixture_ingp, 5);
  bitmaps all;
  fx_counts one = {0}, frame = {0};
  sf_ledger l;
  memset(all, 0xff, sizeof all);
  scene.net.steps = 8;
  sf_recount_sample(&scene.net, (const uint64_t(*)[SF_T_MAX][SF_SPIKE_WORDS])all, true, &one);
  const uint64_t samples = (uint64_t)800 * 800 * 1024;
  for (int i = 0; i < SF_LAYERS; i++)
    for (int e = 0; e < SF_EVENTS; e++)
      for (int t = 0; t < SF_T_MAX; t++) frame.layer[i].event[e][t] = one.layer[i].event[e][t] * samples;
  frame.samples = frame.rays = samples;
  u128 exact = (u128)samples * (4096 + 2048 + 8 * 1920) * 4600 + (u128)samples * 8 * 128 * (16 + 128 + 3) * 900;
  ck_assert(exact < UINT64_MAX);
  ck_assert_uint_eq(sf_energy_fj(&frame), (uint64_t)exact);
  ck_assert_uint_eq(sf_energy_ann_fj(&scene.net, samples), samples * 26880 * 4600);
  ck_ok(sf_ledger_make(&scene.net, &frame, &l));
  ck_assert_uint_eq(l.h_spikes_fj, samples * ((4096 + 2048) * 4600 + (8 * 128 * 147 + 8 * 1920) * 900));
}

TEST(too_large_a_total_is_refused)
{
  fx_net net = small_net();
  fx_counts c = {.samples = 1, .rays = 0};
  sf_ledger l;
  c.layer[FX_D1].mac[0] = UINT64_MAX / 4600;
  ck_assert_uint_eq(sf_energy_fj(&c), UINT64_MAX / 4600 * 4600);
  ck_ok(sf_ledger_make(&net, &c, &l));
  c.layer[FX_D1].mac[0]++;
  ck_assert_uint_eq(sf_energy_fj(&c), UINT64_MAX);
  ck_assert_int_eq(sf_ledger_make(&net, &c, &l).code, SF_E_RANGE);
  c.layer[FX_D1].mac[0] = UINT64_MAX - 5, c.layer[FX_D1].mac[1] = 10;
  ck_assert_uint_eq(sf_energy_fj(&c), UINT64_MAX);
  ck_assert_int_eq(sf_ledger_make(&net, &c, &l).code, SF_E_RANGE);
  ck_assert_uint_eq(sf_energy_ann_fj(&net, UINT64_MAX / 2), UINT64_MAX);
  /* Either part fits, the sum does not. */
  c.layer[FX_D1].mac[0] = UINT64_MAX / 4600 / 5 * 3, c.layer[FX_D1].mac[1] = 0;
  ck_ok(sf_ledger_make(&net, &c, &l));
  c.layer[FX_C2].sop[1] = UINT64_MAX / 900 / 5 * 3;
  ck_assert_uint_eq(sf_energy_fj(&c), UINT64_MAX);
  ck_assert_int_eq(sf_ledger_make(&net, &c, &l).code, SF_E_RANGE);
  c.layer[FX_D1].mac[0] = 0;
  ck_ok(sf_ledger_make(&net, &c, &l));
}

/* ---- recount against the core ---- */

TEST(recount_equals_core_on_random_nets)
{
  fx_trace *trace = malloc(sizeof *trace);
  uint64_t spikes = 0;
  for (uint64_t seed = 0; seed < 120; seed++) {
    fixture_sizes sizes = fixture_random_sizes(seed);
    OWNED(fx_scene) scene = fixture_scene(&sizes, seed);
    fx_counts core = {0}, recount = {0};
    int16_t f[32], dir[FX_SH];
    int32_t base[SF_LANES];
    fixture_inputs(seed + 1, 0, dir, FX_SH, 1024);
    fx_net_direction(&scene.net, dir, base, &core);
    for (uint64_t n = 0; n < 5; n++) {
      fx_out out;
      fixture_inputs(seed, n, f, 32, 1500);
      fx_net_sample(&scene.net, f, base, &out, trace, &core);
      sf_recount_sample(&scene.net, (const uint64_t(*)[SF_T_MAX][SF_SPIKE_WORDS])trace->spikes, n == 0, &recount);
      sf_status status = sf_counts_compare(&core, "core", &recount, "recount");
      ck_assert_msg(status.code == SF_OK, "seed %llu: %s", (unsigned long long)seed, status.message);
    }
    ck_assert_uint_eq(core.samples, recount.samples);
    ck_assert_uint_eq(core.rays, recount.rays);
    ck_assert_uint_eq(sf_energy_fj(&core), sf_energy_fj(&recount));
    spikes += sf_event_total(&core, SF_EVENT_SPIKES);
  }
  ck_assert_uint_gt(spikes, 1000); /* the nets were not silent */
  free(trace);
}

TEST(comparison_names_each_planted_difference)
{
  for (int l = 0; l < SF_LAYERS; l++)
    for (int t = 0; t < SF_T_MAX; t++)
      for (int e = 0; e < SF_EVENTS; e++) {
        fx_counts a = {0}, b = {0};
        char expected[200];
        a.layer[l].event[e][t] = UINT64_MAX - 1;
        b.layer[l].event[e][t] = UINT64_MAX;
        sf_status status = sf_counts_compare(&a, "left", &b, "right");
        snprintf(expected, sizeof expected, "%s of layer %s at step %d: left %llu, right %llu", sf_events[e].title,
                 fx_layer_name(l), t, (unsigned long long)UINT64_MAX - 1, (unsigned long long)UINT64_MAX);
        ck_assert_int_eq(status.code, SF_E_DIFFERENCE);
        ck_assert_str_eq(status.message, expected);
      }
}

TEST(comparison_names_the_first_and_ignores_the_rest)
{
  fx_counts a = {0}, b = {0};
  a.grid_bytes = 1, a.march_steps = 2, a.saturated[3] = 3, a.saturated_features = 4;
  ck_ok(sf_counts_compare(&a, "a", &b, "b"));
  b.samples = 6;
  ck_assert_str_eq(sf_counts_compare(&a, "a", &b, "b").message, "samples: a 0, b 6");
  b.layer[FX_C2].sop[1] = 7, b.layer[FX_C1].spikes[5] = 8, b.layer[FX_C1].updates[5] = 9;
  ck_assert_str_eq(sf_counts_compare(&a, "a", &b, "b").message, "spikes of layer C1 at step 5: a 0, b 8");
}

TEST(cycles_of_a_dense_net)
{
  fx_net net = {.layer[FX_D1] = {.n_in = 5, .n_out = SF_LANES},
                .layer[FX_D2] = {.n_in = 1, .n_out = 1}, /* a part of the lanes takes a cycle, too */
                .layer[FX_C3] = {.n_in = SF_LANES, .n_out = 3}};
  ck_assert_uint_eq(sf_cycles_dense(&net), 5 + 1 + 3);
}

TEST(saturation_is_expected_only_where_the_formats_allow_it)
{
  fx_net net = small_net();
  char list[64];
  const uint64_t none[SF_LAYERS] = {0}, density[SF_LAYERS] = {0, 9, 0, 0, 0}, more[SF_LAYERS] = {1, 0, 0, 2, 3};
  ck_assert(!sf_saturation_unexpected(&net, none, list, sizeof list));
  ck_assert_str_eq(list, "none");
  ck_assert(!sf_saturation_unexpected(&net, density, list, sizeof list));
  ck_assert(sf_saturation_unexpected(&net, more, list, sizeof list));
  ck_assert_str_eq(list, "D1,C2,C3");
  for (net.mode = FX_NODECAY; net.mode <= FX_RADIX; net.mode++)
    ck_assert(!sf_saturation_unexpected(&net, more, list, sizeof list));
  sf_saturation_census(more, 4, list, sizeof list);
  ck_assert_str_eq(list, "D1 1 samples, C2 2 samples, C3 3 samples, 4 features");
  sf_saturation_census(none, 0, list, sizeof list);
  ck_assert_str_eq(list, "none");
  sf_saturation_census(more, 4, list, 12); /* too short a text is cut between entries */
  ck_assert_uint_lt(strlen(list), 12);
}
