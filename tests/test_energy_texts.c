/* Prices, ledgers and published tables whole, kept as texts; the paper's metric at its limits. */
#include "ck_run.h"
#include "tests/audit_fixture.h"
#include "tests/expected.h"
#include "tests/fx_tensorf_fixture.h"
#include "tests/technology_fixture.h"
#include <math.h>

static const char measured[] = "register 1.3 pJ g\nmac 5 pJ h\ntwin_mac 4.1 pJ h\nsop 700 fJ h\nneuron_update 9 pJ h\n"
                               "integrator_update 8 pJ h\nspecial 30 pJ h\ntag_lookup 190 fJ h\n";

static void load_both(sf_technology tech[2])
{
  char text[2000];
  ck_ok(load_text(&tech[0], crooked));
  snprintf(text, sizeof text, "%s%s", crooked, measured);
  ck_ok(load_text(&tech[1], text));
  for (int i = 0; i < 2; i++) snprintf(tech[i].path, sizeof tech[i].path, "%d.tech", i);
}

/* ---- prices ---- */

static void say_price(FILE *out, uint64_t fj, bool *between)
{
  fprintf(out, " %llu%s", (unsigned long long)fj, *between ? "*" : "");
  *between = false;
}

static void prices(FILE *out)
{
  static const int widths[] = {1, 2, 4, 7, 8, 9, 12, 15, 16, 17, 31, 32, 33, 63, 64, 65, 100, 256};
  static const uint64_t bytes[] = {0,    1,    1023,  1024,  1025,  2048,  4096,      8191,
                                   8192, 8193, 20000, 65535, 65536, 65537, UINT64_MAX};
  sf_technology tech[2];
  bool between = false;
  load_both(tech);
  for (int i = 0; i < 2; i++) {
    for (int p = 0; p < tech[i].count; p++)
      fprintf(out, "%s at %u: %llu '%s' '%s'\n", tech[i].price[p].key, tech[i].price[p].at,
              (unsigned long long)tech[i].price[p].fj, tech[i].price[p].text, tech[i].price[p].source);
    fprintf(out, "register");
    for (int w = 0; w < COUNT(widths); w++) say_price(out, sf_price_register(&tech[i], widths[w], &between), &between);
    fprintf(out, "\n");
  }
  fprintf(out, "add");
  for (int w = 0; w < COUNT(widths); w++) say_price(out, sf_price_add(&tech[0], widths[w], &between), &between);
  for (int w = 0; w < COUNT(widths); w++) {
    fprintf(out, "\nmultiply %d by:", widths[w]);
    for (int v = 0; v < COUNT(widths); v++)
      say_price(out, sf_price_multiply(&tech[0], widths[w], widths[v], &between), &between);
  }
  fprintf(out, "\naccess");
  for (int b = 0; b < COUNT(bytes); b++) say_price(out, sf_price_access(&tech[0], bytes[b], &between), &between);
  fprintf(out, "\n");
  for (int f = 0; f < SF_PRICE_KEYS; f++) {
    uint64_t fj[2] = {0, 0};
    bool there[2];
    for (int i = 0; i < 2; i++) there[i] = sf_price_measured(&tech[i], (sf_price_family)f, &fj[i]);
    fprintf(out, "family %d: %d %llu, %d %llu\n", f, there[0], (unsigned long long)fj[0], there[1],
            (unsigned long long)fj[1]);
  }
}

/* Falling lines end at the nearer price, and free memories cost nothing. */
static void falling_prices(FILE *out)
{
  sf_technology t;
  char text[2000];
  bool between = false;
  snprintf(text, sizeof text,
           "name n\ntitle t\nfp32_mac 1 fJ a\nfp32_add 1 fJ a\ndram 5 fJ a\nint_add.16 40 fJ a\nint_add.32 10 fJ a\n"
           "int_multiply.8 100 fJ a\nint_multiply.4 900 fJ a\nsram.64 0 fJ a\nsram.256 9 fJ a\n");
  ck_ok(load_text(&t, text));
  for (int w = 1; w < 60; w += 3) say_price(out, sf_price_add(&t, w, &between), &between);
  fprintf(out, "\n");
  for (int w = 1; w < 20; w++) say_price(out, sf_price_multiply(&t, w, 7, &between), &between);
  fprintf(out, "\n");
  for (uint64_t b = 32; b < 600; b *= 2) say_price(out, sf_price_access(&t, b, &between), &between);
  fprintf(out, "\n");
}

TEST(prices_whole)
{
  ck_expected_text("prices.txt", out, prices(out); falling_prices(out));
}

/* ---- units and ledgers ---- */

static fx_scene small_scene(void)
{
  return (fx_scene){.backbone = FX_INGP, .net = small_net(), .grid = {.levels = 3, .entries = 50}};
}

static void units(FILE *out)
{
  fx_scene scene[2] = {small_scene(), tensorf_scene()};
  sf_technology tech[2];
  load_both(tech);
  for (int s = 0; s < 2; s++)
    for (int i = 0; i < 2; i++)
      for (int g = 0; g < SF_LEDGERS; g++)
        for (int r = 0; r < SF_ROWS; r++) {
          const sf_counted counted = {.scene = &scene[s], .cache = {4096, 2}};
          fprintf(out, "%d %s, %s, %s:", i, s ? "TensoRF" : "INGP", sf_ledger_texts[g].key, sf_row_name(r));
          for (int p = 0; p < SF_PARTS; p++) {
            sf_unit_price unit = sf_unit_price_of(&tech[i], &counted, g, r, p);
            say_price(out, unit.fj, &unit.interpolated);
          }
          fprintf(out, "\n");
        }
  fx_scene_free(&scene[1]);
}

TEST(what_an_event_costs)
{
  ck_expected_text("units.txt", out, units(out));
}

static void say_traffic(FILE *out, const char *title, const sf_traffic *t)
{
  fprintf(out, "%s:", title);
  for (int e = 0; e < SF_TRAFFIC_EVENTS; e++) fprintf(out, " %llu", (unsigned long long)t->event[e]);
  fprintf(out, "\n");
}

static fx_counts counts_of(const fx_net *net, bool decoder)
{
  fx_counts c = {.field_samples = decoder ? 31 : 0, .field_mac = decoder ? 77 : 0, .grid_bytes = 55};
  uint64_t spikes[SF_LAYERS][SF_T_MAX][SF_SPIKE_WORDS] = {{{0}}};
  for (int l = 0; l < SF_LAYERS; l++)
    for (int t = 0; t < net->steps; t++)
      for (int n = 0; n < net->layer[l].n_out && fx_layer_fires(l); n++)
        spikes[l][t][n / 64] |= (uint64_t)(sf_random_u64(3, (uint64_t)(16 * l + t), (uint64_t)n) % 3 == 0) << n % 64;
  for (int i = 0; i < 7; i++)
    sf_recount_sample(net, (const uint64_t(*)[SF_T_MAX][SF_SPIKE_WORDS])spikes, i % 3 == 0, &c);
  return c;
}

static void ledgers(FILE *out)
{
  fx_scene scene[2] = {small_scene(), tensorf_scene()};
  sf_technology tech[2];
  load_both(tech);
  for (int s = 0; s < 2; s++) {
    const fx_counts c = counts_of(&scene[s].net, s);
    const fx_memory_counts memory = {.lookups = 91, .misses = 13, .groups = 2, .rows = {3, 5, 7}};
    const sf_traffic of = sf_traffic_of(&scene[s], &c, &memory, 6),
                     again = sf_traffic_recount(&scene[s], &c, &memory, 31, 6);
    const sf_counted counted = {&scene[s], &c, &memory, &of, {4096, 2}};
    static sf_ledgers l;
    sf_ledger paper;
    say_traffic(out, "traffic", &of), say_traffic(out, "recounted", &again);
    fprintf(out, "table of %llu bytes\n", (unsigned long long)sf_table_size(&scene[s]));
    ck_ok(sf_ledgers_make(&tech[s], &counted, &l));
    ck_ok(sf_ledger_make(&scene[s].net, &c, &paper));
    sf_ledgers_print(out, &l, 2.5), sf_ledger_print(out, &paper, 2.5);
    for (int i = 0; i < SF_BREAK_EVENS; i++)
      fprintf(out, "%s against %s: %.6g\n", sf_ledger_texts[l.break_even[i].ledger].key,
              sf_ledger_texts[l.break_even[i].twin].key, l.break_even[i].rate);
    for (int i = 0; i < l.sensitivities; i++)
      fprintf(out, "%s swings %.6g of %s\n", tech[s].price[l.sensitivity[i].price].key, l.sensitivity[i].swing,
              sf_ledger_texts[l.sensitivity[i].ledger].key);
    for (int g = 0; g < SF_LEDGERS; g++)
      for (int r = 0; r < SF_ROWS; r++) {
        fprintf(out, "%s %s:", sf_ledger_texts[g].key, sf_row_name(r));
        for (int t = 0; t < 4; t++) fprintf(out, " %llu", (unsigned long long)l.cell[g][r][t]);
        fprintf(out, "\n");
      }
    sf_ledgers_print(out, &l, 0), sf_ledger_print(out, &paper, 0); /* of no view at all */
  }
  fx_scene_free(&scene[1]);
}

TEST(ledgers_whole)
{
  ck_expected_text("ledgers.txt", out, ledgers(out));
}

/* Words that depend on what came out. */
TEST(break_even_in_words)
{
  static const struct {
    double measured, rate;
    const char *words;
  } rows[] = {{0.2, NAN, "none: dearer even if no neuron fired\n"},
              {0, NAN, "none: no neuron fired\n"},
              {0.2, 1.01, "none: cheaper even if every neuron fired at every step\n"},
              {0.2, 1, " 100.00%\n"},
              {0.2, 0.125, " 12.50%\n"}};
  for (int i = 0; i < COUNT(rows); i++) {
    static sf_ledgers l;
    static char *text;
    static size_t size;
    l.rate = rows[i].measured;
    for (int e = 0; e < SF_BREAK_EVENS; e++)
      l.break_even[e] = (sf_break_even){e % SF_SPIKING_LEDGERS, SF_LEDGER_ANN, rows[i].rate};
    FILE *out = open_memstream(&text, &size);
    sf_ledgers_print(out, &l, 1);
    fclose(out);
    ck_assert_msg(strstr(text, rows[i].words) != NULL, "row %d", i);
    free(text);
  }
}

TEST(published_tables_whole)
{
  ck_expected_text("published.txt", out, sf_published_print(out));
  ck_expected_json("published.json", sf_published_json(), 3);
}

/* ---- the paper's metric ---- */

TEST(paper_ledger_at_its_limits)
{
  fx_net net = small_net();
  fx_counts c = counts_of(&net, false), too_few = c;
  sf_ledger l;
  ck_ok(sf_ledger_make(&net, &c, &l));
  too_few.rays = 1000;
  ck_bad(sf_ledger_make(&net, &too_few, &l), SF_E_RANGE, "fewer than the direction's 12000", "C1 counts");
  /* Directions that are all of C1's MACs are right. */
  fx_counts all = {.rays = 2};
  all.layer[FX_C1].mac[0] = 24;
  ck_ok(sf_ledger_make(&net, &all, &l));
  ck_assert_uint_eq(l.h_once_fj, 24 * 4600);
  ck_assert_uint_eq(l.h_spikes_fj, 24 * 4600); /* no neuron was updated: nothing to share */
  all.layer[FX_C1].mac[0] = 23;
  ck_assert_int_eq(sf_ledger_make(&net, &all, &l).code, SF_E_RANGE);
  net.steps = 0, all.layer[FX_C1].mac[0] = 24;
  ck_assert_int_eq(sf_ledger_make(&net, &all, &l).code, SF_E_RANGE);
  /* 5 of 8 updates spike: 3 MACs of h are 2 SOPs. */
  net = small_net();
  all = (fx_counts){.samples = 3};
  all.layer[FX_C1].mac[0] = 3, all.layer[FX_C2].spikes[0] = 5, all.layer[FX_C2].updates[0] = 8;
  ck_ok(sf_ledger_make(&net, &all, &l));
  ck_assert_uint_eq(l.h_spikes_fj, 2 * 900);
  ck_assert_uint_eq(l.h_once_fj, 1 * 4600);
  ck_assert_uint_eq(l.ann_fj, 3 * 76 * 4600);
  ck_assert_uint_eq(l.ann_hoisted_fj, 3 * 64 * 4600); /* no ray, so no direction */
  /* What just fits, and what does not. */
  all = (fx_counts){.samples = UINT64_MAX / 4600 / 76};
  ck_ok(sf_ledger_make(&net, &all, &l));
  all.samples++;
  ck_bad(sf_ledger_make(&net, &all, &l), SF_E_RANGE, "does not fit", "audit fewer views");
  ck_assert(isnan(sf_saving_percent(5, 0)));
  ck_assert_double_eq(sf_saving_percent(5, 10), 50);
  sf_twin twin = {.samples = 10, .macs = 7};
  sf_technology tech;
  ck_ok(load_text(&tech, crooked));
  ck_ok(sf_twin_price(&tech, 32900, &twin));
  ck_assert_uint_eq(twin.fj, 329000);
  ck_assert_double_eq(twin.saving_percent, 90);
  twin.samples = UINT64_MAX / 2;
  ck_bad(sf_twin_price(&tech, 1, &twin), SF_E_RANGE, "the energy of the twin", "64 bits");
}

ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};
