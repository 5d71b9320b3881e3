/* Ledgers against pricing by hand. */
#include "ck_run.h"
#include "tests/audit_report_fixture.h"
#include "tests/technology_fixture.h"
#include <math.h>

static sf_technology tech; /* the plain one */
static sf_ledgers *l;      /* of the small net, priced by it */

static fx_counts small_counts(const fx_net *net)
{
  fx_counts c = {0};
  sf_recount_sample(net, small_spikes, true, &c);
  return c;
}

/* What is counted is priced with a cache of 8192 bytes. */
static sf_status make_ledgers(const sf_technology *tech, const fx_net *net, const fx_counts *counts,
                              const sf_traffic *traffic, sf_ledgers *l)
{
  const fx_scene scene = {.backbone = FX_INGP, .net = *net};
  const sf_counted counted = {&scene, counts, &small_memory, traffic, {8192, 4}};
  SF_TRY(sf_ledgers_make(tech, &counted, l));
  for (int g = 0; g < SF_SPIKING_LEDGERS; g++) ck_assert_uint_eq(sf_ledger_fj(tech, &counted, g), l->total[g]);
  return sf_ok();
}

static sf_ledgers *small_ledgers(const sf_technology *tech)
{
  sf_ledgers *l = malloc(sizeof *l);
  const fx_net net = small_net();
  const fx_counts c = small_counts(&net);
  ck_ok(make_ledgers(tech, &net, &c, &small_traffic, l));
  return l;
}

TEST(paper_ledger_is_the_papers_metric)
{
  const fx_net net = small_net();
  const fx_counts c = small_counts(&net);
  ck_assert_uint_eq(l->total[SF_LEDGER_PAPER], sf_energy_fj(&c));
  ck_assert_uint_eq(l->total[SF_LEDGER_ANN], sf_energy_ann_fj(&net, 1));
  ck_assert_uint_eq(l->part[SF_LEDGER_PAPER][SF_PART_MAC], 40 * 4600);
  ck_assert_uint_eq(l->part[SF_LEDGER_PAPER][SF_PART_SOP], 40 * 900);
  ck_assert_uint_eq(l->cell[SF_LEDGER_PAPER][FX_C1][0], 20 * 4600);
  ck_assert_uint_eq(l->cell[SF_LEDGER_PAPER][FX_C1][1], 8 * 4600);
  ck_assert_uint_eq(l->cell[SF_LEDGER_PAPER][FX_C3][1], 3 * 900);
  ck_assert_uint_eq(l->cell[SF_LEDGER_PAPER][SF_ROW_FIELD][0], 0);
  ck_assert_double_eq_tol(l->saving[SF_LEDGER_PAPER], 37.0709, 1e-4);
  ck_assert(!l->interpolated[SF_LEDGER_PAPER]);
  ck_assert(isnan(l->saving[SF_LEDGER_INT]));
}

/* Sums are as wide as they get: D1 8 + 11 + 2 bits, C1 8 + 11 + 3; D2 and C2 8 + 2, C3 8 + 3. */
TEST(width_ledger_by_hand)
{
  ck_assert_uint_eq(l->cell[SF_LEDGER_WIDTH][FX_D1][0], 12 * (96 + 21));
  ck_assert_uint_eq(l->cell[SF_LEDGER_WIDTH][FX_C1][0], 20 * (96 + 22));
  ck_assert_uint_eq(l->cell[SF_LEDGER_WIDTH][FX_C1][1], 8 * (96 + 22));
  ck_assert_uint_eq(l->cell[SF_LEDGER_WIDTH][FX_D2][0], 6 * 10);
  ck_assert_uint_eq(l->cell[SF_LEDGER_WIDTH][FX_C2][1], 10 * 10);
  ck_assert_uint_eq(l->cell[SF_LEDGER_WIDTH][FX_C3][0], 15 * 11);
  ck_assert_uint_eq(l->part[SF_LEDGER_WIDTH][SF_PART_MAC], 12 * 117 + 28 * 118);
  ck_assert_uint_eq(l->part[SF_LEDGER_WIDTH][SF_PART_SOP], 12 * 10 + 10 * 10 + 18 * 11);
  ck_assert(l->interpolated[SF_LEDGER_WIDTH]);
  ck_assert_uint_eq(l->total[SF_LEDGER_INT], 76 * (64 + 32)); /* every synapse once: 1 ray of 1 sample */
}

TEST(memory_ledger_by_hand)
{
  const uint64_t *part = l->part[SF_LEDGER_MEMORY], *twin = l->part[SF_LEDGER_INT_MEMORY];
  /* rows, an access each: 4 of D1, 3 of D2, 5 of C1, 2 of C2, 5 of C3 */
  ck_assert_uint_eq(part[SF_PART_WEIGHT], (4 + 3 + 5 + 2 + 5) * 80);
  /* written at both steps, read at the second: 12 membranes, 1 density, 3 colours */
  ck_assert_uint_eq(part[SF_PART_STATE], 3 * (12 * 24 + 28 + 3 * 20));
  ck_assert_uint_eq(part[SF_PART_LOOKUP], 10 * 80);
  ck_assert_uint_eq(part[SF_PART_FILL], 4 * (2 * 8000 + 2 * 80));
  ck_assert_uint_eq(part[SF_PART_FRAME], 6 * 8000);
  ck_assert_uint_eq(part[SF_PART_NEURON], 0);
  ck_assert_uint_eq(part[SF_PART_PRODUCT], 0);
  ck_assert_uint_eq(part[SF_PART_MAC], l->part[SF_LEDGER_WIDTH][SF_PART_MAC]);
  ck_assert_uint_eq(l->cell[SF_LEDGER_MEMORY][SF_ROW_FIELD][0], 800 + 64640);
  ck_assert_uint_eq(l->cell[SF_LEDGER_MEMORY][SF_ROW_RAY][0], 48000);
  ck_assert_uint_eq(twin[SF_PART_WEIGHT], (4 + 3 + 5 + 4 + 5) * 80);
  ck_assert_uint_eq(twin[SF_PART_STATE], 2 * (3 + 2 + 4 + 5) * 8); /* D1, h, C1, C2 written and read */
  ck_assert_uint_eq(twin[SF_PART_LOOKUP], part[SF_PART_LOOKUP]);
  ck_assert_uint_eq(twin[SF_PART_FILL], part[SF_PART_FILL]);
  ck_assert_uint_eq(twin[SF_PART_FRAME], part[SF_PART_FRAME]);
}

/* Rows of 64 bits or less are an access, of 65 two, and so on; what holds them all chooses its price. */
TEST(rows_are_accesses)
{
  const fx_layer wide = {.n_in = 10, .n_out = 17}, narrow = {.n_in = 10, .n_out = 8};
  ck_assert_uint_eq(sf_row_accesses(&wide), 3);
  ck_assert_uint_eq(sf_row_accesses(&narrow), 1);
  ck_assert_uint_eq(sf_weights_size(&wide), 170);
}

TEST(neuron_ledger_by_hand)
{
  const uint64_t *part = l->part[SF_LEDGER_NEURON], *twin = l->part[SF_LEDGER_INT_ALL];
  /* 24 spiking updates, 2 of density (28 bits), 6 of colour (20 bits); leak of 13 bits */
  ck_assert_uint_eq(part[SF_PART_NEURON], 24 * (24 * 13 + 4 * 24) + 2 * (28 * 13 + 2 * 28) + 6 * (20 * 13 + 2 * 20));
  /* argument x 16 bits, 16 x 12 bits, two sums, two entries of 4 bytes */
  ck_assert_uint_eq(part[SF_PART_SPECIAL], 2 * (10 * 16 + 192 + 2 * 28 + 160) + 6 * (11 * 16 + 192 + 2 * 20 + 160) +
                                               1 * (20 * 16 + 192 + 2 * 20 + 160));
  ck_assert_uint_eq(twin[SF_PART_NEURON], 14 * (32 * 16 + 32));
  ck_assert_uint_eq(twin[SF_PART_SPECIAL], 1 * (32 * 16 + 192 + 2 * 28 + 160) + 3 * (32 * 16 + 192 + 2 * 20 + 160) +
                                               1 * (20 * 16 + 192 + 2 * 20 + 160));
  /* entries of 8 bits times corners of 17; a sample composited */
  ck_assert_uint_eq(part[SF_PART_PRODUCT],
                    50 * (17 * 8 + 24) + 1 * (28 * 24 + 21 * 21 + 3 * 21 * 20 + 21 * 32 + 4 * 41 + 2 * 21));
  /* levels found; 16 harmonics of two products each */
  ck_assert_uint_eq(part[SF_PART_PLACE],
                    5 * (3 * 24 * 32 + 3 * 32 + 4 * 9 * 9 + 4 * 17 * 9 + 4 * 17 + 2 * 12 * 32 + 8 * 32) +
                        1 * (6 * 16 * 16 + 9 * 18 + 32 * 18 * 18));
  ck_assert_uint_eq(twin[SF_PART_PRODUCT], part[SF_PART_PRODUCT]);
  ck_assert_uint_eq(twin[SF_PART_PLACE], part[SF_PART_PLACE]);
}

/* Radix asks for each special function once a sample, as the twin does, multiplies h once, and has no leak. What
 * integrates are sums of 24 bits. The spikes are those of the other mode. */
TEST(radix_asks_once_and_does_not_leak)
{
  fx_net net = small_net();
  net.mode = FX_RADIX;
  const fx_counts c = small_counts(&net);
  sf_ledgers *radix = malloc(sizeof *radix);
  ck_ok(make_ledgers(&tech, &net, &c, &small_traffic, radix));
  const uint64_t *const here = radix->part[SF_LEDGER_NEURON], *const other = l->part[SF_LEDGER_NEURON];
  const uint64_t field = 1 * (20 * 16 + 192 + 2 * 20 + 160); /* of the ray, not of the nets */
  const uint64_t means = 2 * (24 * 17 + 24);                 /* of two h */
  ck_assert_uint_eq(2 * (here[SF_PART_SPECIAL] - field - means), other[SF_PART_SPECIAL] - field);
  static const bool differs[SF_PARTS] = {
      [SF_PART_MAC] = true, [SF_PART_STATE] = true, [SF_PART_NEURON] = true, [SF_PART_SPECIAL] = true};
  for (int part = 0; part < SF_PARTS; part++)
    if (!differs[part]) ck_assert_uint_eq(here[part], other[part]);
  ck_assert_uint_eq(other[SF_PART_MAC] - here[SF_PART_MAC], 8 * (12 * 8 + 22)); /* h's products of one step */
  /* D1 and C1 as in the other mode; C2's 5 neurons three times, D2's 3 outputs and C3's 3 in both steps */
  ck_assert_uint_eq(here[SF_PART_NEURON], (14 + 15) * 2 * 24 + (6 + 6) * 24);
  ck_assert_uint_eq(here[SF_PART_STATE], 24 * (14 + 7 + 15 + 10 + (6 + 3) * 2));
  ck_assert_mem_eq(radix->part[SF_LEDGER_INT_ALL], l->part[SF_LEDGER_INT_ALL], sizeof l->part[SF_LEDGER_INT_ALL]);
  free(radix);
}

/* Rows alone differ: values need all of D1's 4 and of h's 2 once for the group, and the direction's 3 once. */
TEST(shared_ledger_by_hand)
{
  const uint64_t *part = l->part[SF_LEDGER_SHARED], *twin = l->part[SF_LEDGER_INT_SHARED];
  ck_assert_uint_eq(part[SF_PART_WEIGHT], (4 + 1 + (2 + 3) + 2 + 4) * 80);
  ck_assert_uint_eq(twin[SF_PART_WEIGHT], (4 + 3 + (2 + 3) + 4 + 5) * 80);
  for (int p = 0; p < SF_PARTS; p++) {
    if (p == SF_PART_WEIGHT) continue;
    ck_assert_uint_eq(part[p], l->part[SF_LEDGER_NEURON][p]);
    ck_assert_uint_eq(twin[p], l->part[SF_LEDGER_INT_ALL][p]);
  }
}

/* Of many samples each group reads once, of biases too; of rays each 16. */
TEST(groups_share_rows)
{
  fx_net net = small_net();
  net.layer[FX_C1].bias = 5, net.layer[FX_C2].bias = 1;
  const fx_counts c = {.samples = 40, .rays = 17};
  const fx_memory_counts memory = {.groups = 3, .rows = {7, 8, 9}};
  const sf_traffic none = {.event = {0}};
  const fx_scene scene = {.backbone = FX_INGP, .net = net};
  const sf_counted counted = {&scene, &c, &memory, &none, {8192, 4}};
  sf_ledgers *l = malloc(sizeof *l);
  ck_ok(sf_ledgers_make(&tech, &counted, l));
  const uint64_t(*cell)[SF_T_MAX] = (const uint64_t(*)[SF_T_MAX])l->cell[SF_LEDGER_SHARED];
  ck_assert_uint_eq(cell[FX_D1][0], 3 * 4 * 80);
  ck_assert_uint_eq(cell[FX_D2][0], 7 * 80);
  ck_assert_uint_eq(cell[FX_C1][0], (3 * 2 + 2 * 3 + 2) * 80); /* h; directions of two times 16 rays, and the biases */
  ck_assert_uint_eq(cell[FX_C2][0], (8 + 3) * 80);
  ck_assert_uint_eq(cell[FX_C3][0], 9 * 80);
  ck_assert_uint_eq(l->part[SF_LEDGER_INT_SHARED][SF_PART_WEIGHT], (3 * (4 + 3 + 2 + 4 + 5) + 2 * 3) * 80);
  free(l);
}

/* Prices that were measured stand in place of those of the widths: each operation has its own, the twin's ReLU none. */
TEST(measured_operations_by_hand)
{
  char text[1024];
  sf_technology measured;
  snprintf(text, sizeof text, "%s\n%s", plain,
           "mac 5 pJ made up\ntwin_mac 4 pJ made up\nsop 700 fJ made up\nneuron_update 9 pJ made up\n"
           "integrator_update 8 pJ made up\nspecial 30 pJ made up\n");
  ck_ok(load_text(&measured, text));
  ck_assert_int_eq(measured.count, 16);
  sf_ledgers *m = small_ledgers(&measured);
  const uint64_t *part = m->part[SF_LEDGER_NEURON], *twin = m->part[SF_LEDGER_INT_ALL];
  ck_assert_uint_eq(part[SF_PART_MAC], 40 * 5000);
  ck_assert_uint_eq(part[SF_PART_SOP], 40 * 700);
  ck_assert_uint_eq(part[SF_PART_NEURON], 24 * 9000 + 8 * 8000);
  ck_assert_uint_eq(part[SF_PART_SPECIAL], 9 * 30000);
  ck_assert_uint_eq(twin[SF_PART_MAC], 76 * 4000);
  ck_assert_uint_eq(twin[SF_PART_NEURON], l->part[SF_LEDGER_INT_ALL][SF_PART_NEURON]);
  ck_assert_uint_eq(twin[SF_PART_SPECIAL], 5 * 30000);
  ck_assert(!m->interpolated[SF_LEDGER_WIDTH]);
  for (int p = SF_PART_WEIGHT; p <= SF_PART_FRAME; p++) ck_assert_uint_eq(part[p], l->part[SF_LEDGER_NEURON][p]);
  ck_assert_uint_eq(m->total[SF_LEDGER_PAPER], l->total[SF_LEDGER_PAPER]);
  for (int g = 0; g < SF_LEDGERS; g++) /* no ray has a MAC */
    ck_assert_uint_eq(m->unit[g][SF_ROW_RAY][SF_PART_MAC].fj, l->unit[g][SF_ROW_RAY][SF_PART_MAC].fj);
  free(m);
  snprintf(text, sizeof text, "%s\nsop.8 700 fJ made up\n", plain);
  ck_bad(load_text(&measured, text), SF_E_FORMAT, "key 'sop.8' takes no '.8'", "");
}

TEST(cells_and_parts_add_up)
{
  sf_technology tech;
  ck_ok(sf_technology_load(&tech, "share/tech/45nm.tech"));
  OWNED(fx_scene) scene = fixture_scene(&fixture_ingp, 5);
  sf_ledgers *l = malloc(sizeof *l);
  fx_counts c = {0};
  uint64_t spikes[SF_LAYERS][SF_T_MAX][SF_SPIKE_WORDS];
  for (uint64_t i = 0; i < sizeof spikes / 8; i++)
    (&spikes[0][0][0])[i] = sf_random_u64(1, 2, i) & sf_random_u64(1, 3, i);
  for (int i = 0; i < 9; i++)
    sf_recount_sample(&scene.net, (const uint64_t(*)[SF_T_MAX][SF_SPIKE_WORDS])spikes, i % 3 == 0, &c);
  const sf_traffic traffic = sf_traffic_recount(&scene, &c, &(fx_memory_counts){0}, 0, 4);
  ck_assert_uint_eq(traffic.table_bytes, 9 * 16 * 8 * 2);
  ck_assert_uint_eq(traffic.frame_bytes, 4 * 48);
  const fx_memory_counts memory = {.groups = 1};
  const sf_counted counted = {&scene, &c, &memory, &traffic, sf_cache_built};
  ck_ok(sf_ledgers_make(&tech, &counted, l));
  for (int g = 0; g < SF_LEDGERS; g++) {
    uint64_t cells = 0, parts = 0;
    for (int r = 0; r < SF_ROWS; r++)
      for (int t = 0; t < SF_T_MAX; t++) cells += l->cell[g][r][t];
    for (int p = 0; p < SF_PARTS; p++) parts += l->part[g][p];
    ck_assert_uint_eq(cells, l->total[g]);
    ck_assert_uint_eq(parts, l->total[g]);
    ck_assert_uint_gt(l->total[g], 0);
  }
  ck_assert_uint_eq(l->total[SF_LEDGER_PAPER], sf_energy_fj(&c));
  ck_assert_uint_eq(l->total[SF_LEDGER_ANN], sf_energy_ann_fj(&scene.net, 9)); /* not hoisted */
  /* The integer twin has the direction's products once per ray: 3 rays, 9 samples. */
  ck_assert_uint_eq(l->total[SF_LEDGER_INT], (9 * 26880 - 6 * 2048) * (uint64_t)300);
  free(l);
}

/* What spikes cost at `scale` times the measured rate: SOPs, and rows that spikes read, at most all there are. */
static double scaled_cost(const sf_break_even *b, double scale)
{
  static const struct {
    int layer;
    double rows; /* of the one sample */
  } read[] = {{FX_D2, 3}, {FX_C2, 2}, {FX_C3, 5}};
  const fx_net net = small_net();
  double fj = scale * (double)l->part[b->ledger][SF_PART_SOP];
  for (int i = 0; i < COUNT(read) && b->ledger >= SF_LEDGER_MEMORY; i++)
    fj += 80 * fmin(scale * read[i].rows, net.layer[read[i].layer].n_in);
  return fj;
}

/* At the break-even rate, counts scaled to it cost what the twin costs. */
TEST(break_even_rate_breaks_even)
{
  ck_assert_double_eq_tol(l->rate, 0.5, 1e-12); /* 12 spikes in 24 updates */
  const sf_break_even *paper = &l->break_even[SF_LEDGER_PAPER];
  ck_assert_int_eq(paper->twin, SF_LEDGER_ANN);
  ck_assert_double_eq_tol(paper->rate, 0.5 * (349600 - 184000) / 36000.0, 1e-9);
  for (int i = 0; i < SF_BREAK_EVENS; i++) {
    const sf_break_even *b = &l->break_even[i];
    const double total = (double)l->total[b->ledger], twin = (double)l->total[b->twin];
    const double spikes = scaled_cost(b, 1);
    if (twin < total - spikes)
      ck_assert(isnan(b->rate));
    else
      ck_assert_double_eq_tol(total - spikes + scaled_cost(b, b->rate / l->rate), twin, 1e-6 * twin);
  }
  ck_assert_int_eq(l->break_even[SF_OWN_BREAK_EVENS].twin, SF_LEDGER_ANN);
}

TEST(sensitivity_is_the_saving_at_other_prices)
{
  ck_assert_int_eq(l->sensitivities, 10);
  bool seen[10] = {false};
  for (int i = 0; i < l->sensitivities; i++) {
    const sf_sensitivity *s = &l->sensitivity[i];
    double largest = 0;
    seen[s->price] = true;
    for (int more = 0; more < 2; more++) {
      sf_technology other = tech;
      other.price[s->price].fj = more ? other.price[s->price].fj * 3 / 2 : other.price[s->price].fj / 2;
      sf_ledgers *o = small_ledgers(&other);
      for (int g = 0; g < SF_SPIKING_LEDGERS; g++) {
        ck_assert_double_eq(more ? s->more[g] : s->less[g], o->saving[g]);
        largest = fmax(largest, fabs(o->saving[g] - l->saving[g]));
      }
      free(o);
    }
    ck_assert_double_eq(s->swing, largest);
    if (i > 0) ck_assert_double_le(s->swing, l->sensitivity[i - 1].swing);
  }
  for (int i = 0; i < 10; i++) ck_assert(seen[i]);
  ck_assert_double_gt(l->sensitivity[0].swing, 1);
}

/* A net without density layers: a decoder whose inputs all come with the sample. */
TEST(a_decoder_alone_has_no_density_rows)
{
  fx_net net = {.steps = 1};
  fx_counts c = {.samples = 2, .rays = 1};
  static const int size[SF_LAYERS][2] = {{0, 0}, {0, 0}, {150, 128}, {128, 128}, {128, 3}};
  for (int i = 0; i < SF_LAYERS; i++) net.layer[i].n_in = size[i][0], net.layer[i].n_out = size[i][1];
  c.layer[FX_C1].mac[0] = c.layer[FX_C1].weight[0] = 2 * 19200;
  sf_ledgers *l = malloc(sizeof *l);
  ck_ok(make_ledgers(&tech, &net, &c, &small_traffic, l));
  ck_assert_uint_eq(l->total[SF_LEDGER_ANN], 2 * 35968 * (uint64_t)4600);
  ck_assert_uint_eq(l->total[SF_LEDGER_INT], 2 * 35968 * (uint64_t)96);
  ck_assert_uint_eq(l->total[SF_LEDGER_WIDTH], 2 * 19200 * (uint64_t)(96 + 27));
  for (int g = 0; g < SF_LEDGERS; g++)
    for (int r = FX_D1; r <= FX_D2; r++) ck_assert_uint_eq(l->cell[g][r][0], 0);
  ck_assert(isnan(l->break_even[0].rate)); /* no spike */
  free(l);
}

TEST(too_much_energy_is_refused)
{
  const fx_net net = small_net();
  fx_counts c = small_counts(&net);
  sf_ledgers *l = malloc(sizeof *l);
  const sf_traffic much = {.frame_bytes = UINT64_MAX / 1100};
  ck_assert_int_eq(make_ledgers(&tech, &net, &c, &much, l).code, SF_E_RANGE); /* at 1.5 times the price */
  const sf_traffic less = {.frame_bytes = UINT64_MAX / 1600};
  ck_ok(make_ledgers(&tech, &net, &c, &less, l));
  c.layer[FX_D2].sop[0] = UINT64_MAX - 1;
  ck_assert_int_eq(make_ledgers(&tech, &net, &c, &small_traffic, l).code, SF_E_RANGE);
  free(l);
}

TEST(report_and_json_show_every_ledger)
{
  char *text = NULL;
  size_t size;
  FILE *out = open_memstream(&text, &size);
  sf_ledgers_print(out, l, 1);
  fclose(out);
  for (int g = 0; g < SF_LEDGERS; g++) ck_assert_ptr_nonnull(strstr(text, sf_ledger_texts[g].title));
  for (int i = 0; i < tech.count; i++) ck_assert_ptr_nonnull(strstr(text, tech.price[i].source));
  free(text);
  cJSON *json = sf_ledgers_json(l, 1);
  text = cJSON_PrintUnformatted(json);
  cJSON_Delete(json);
  json = cJSON_Parse(text);
  const cJSON *list = cJSON_GetObjectItem(json, "list");
  ck_assert_int_eq(cJSON_GetArraySize(list), SF_LEDGERS);
  for (int g = 0; g < SF_LEDGERS; g++) {
    const cJSON *ledger = cJSON_GetArrayItem(list, g);
    ck_assert_double_eq(cJSON_GetObjectItem(ledger, "total_fj")->valuedouble, (double)l->total[g]);
    const cJSON *rows = cJSON_GetObjectItem(ledger, "rows");
    ck_assert_int_eq(cJSON_GetArraySize(rows), SF_ROWS);
    const cJSON *c1 = cJSON_GetObjectItem(cJSON_GetArrayItem(rows, FX_C1), "fj");
    ck_assert_int_eq(cJSON_GetArraySize(c1), 2);
    ck_assert_double_eq(cJSON_GetArrayItem(c1, 1)->valuedouble, (double)l->cell[g][FX_C1][1]);
  }
  cJSON_Delete(json);
  free(text);
}

static void set_up(void)
{
  make_folder();
  tech = plain_technology();
  l = small_ledgers(&tech);
}

static void tear_down(void)
{
  free(l);
  remove_folder();
}

ck_options ck_program = {.set_up = set_up, .tear_down = tear_down};
