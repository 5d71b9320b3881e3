/* An audit and the comparison of two, whole: text, JSON, CSV. The energies in them are those that test_ledger makes by
 * hand. */
#include "ck_run.h"
#include "tests/audit_report_fixture.h"
#include "tests/expected.h"
#include "tests/technology_fixture.h"

typedef struct audit {
  fx_net net;
  sf_audit_report report;
} audit;

/* Energies of what was counted. */
static void price(audit *a, const char *prices)
{
  sf_audit_report *r = &a->report;
  static sf_technology tech;
  const fx_scene scene = {.backbone = FX_INGP, .net = a->net};
  const sf_counted counted = {&scene, &r->measure.core, &r->measure.memory, &r->traffic, r->cache};
  ck_ok(load_text(&tech, prices));
  snprintf(tech.path, sizeof tech.path, "t.tech");
  ck_ok(sf_ledgers_make(&tech, &counted, &r->ledgers));
  ck_ok(sf_ledger_make(&a->net, &r->measure.core, &r->ledger));
}

/* One sample of one ray, everywhere the same counts. */
static audit *new_audit(void)
{
  audit *a = calloc(1, sizeof *a);
  a->net = small_net();
  a->report = (sf_audit_report){.scene = "s.snn",
                                .data = "lego",
                                .split = "test",
                                .sha256 = "0a",
                                .net = &a->net,
                                .rays = 4,
                                .seed = 11,
                                .views = 0.5,
                                .seconds = 2.5,
                                .cache = {8192, 4},
                                .entries = 5,
                                .traffic = small_traffic};
  sf_measure *m = &a->report.measure;
  sf_three_counts *three = &a->report.three;
  sf_recount_sample(&a->net, small_spikes, true, &m->core);
  sf_audit_report *r = &a->report;
  r->traffic.special = 7;
  m->core.grid_bytes = r->traffic.table_bytes;
  m->recount = m->checked_core = m->core;
  m->memory = small_memory, m->rays = 4, m->checked = 3;
  three->wanted = 2, three->rays = 1;
  three->core = three->rtl = three->recount = m->core;
  three->core_traffic = three->rtl_traffic = three->recount_traffic = r->traffic;
  three->rtl_events = SF_TRAFFIC_AT_PORTS;
  three->cycles = 900, three->busy = 800, three->stalls = 17;
  a->report.twin = (sf_twin){.path = "twin.safetensors", .samples = 6, .macs = 9, .fj = 6 * 9 * 4600};
  a->report.twin.saving_percent = 12.5;
  price(a, plain);
  return a;
}

TEST(an_audit_whole)
{
  audit *a = new_audit();
  ck_expected_text("audit.txt", out, sf_report_print(out, &a->report));
  ck_expected_text("audit.csv", out, sf_report_csv(out, &a->report));
  ck_expected_json("audit.json", sf_report_json(&a->report), 3);
  free(a);
}

/* Random rays of a decoder that saturates; nothing was counted again. */
TEST(an_audit_of_what_was_left_out)
{
  audit *a = new_audit();
  sf_audit_report *r = &a->report;
  a->net.layer[FX_D1] = a->net.layer[FX_D2] = (fx_layer){.n_in = 0};
  r->random_rays = true, r->entries = 0, r->traffic.lookups = r->traffic.misses = 0, r->twin.path = NULL;
  r->measure.recount = r->measure.checked_core = (fx_counts){.samples = 0};
  r->measure.core.saturated_samples[FX_C2] = 3, r->measure.core.saturated_samples[FX_C3] = 2;
  r->measure.core.saturated_features = 5, r->measure.core.saturated[FX_C2] = 8;
  r->measure.core.march_steps = 21, r->measure.core.field_samples = 30, r->measure.core.field_mac = 33;
  r->measure.checked = 0;
  r->three = (sf_three_counts){.wanted = 0};
  price(a, plain);
  ck_expected_text("audit-left-out.txt", out, sf_report_print(out, r));
  ck_expected_json("audit-left-out.json", sf_report_json(r), 2);
  free(a);
}

/* A word for each way in which rows may disagree. */
TEST(an_audit_that_disagrees)
{
  audit *a = new_audit();
  sf_audit_report *r = &a->report;
  r->three.rtl.layer[FX_C3].sop[0] += 5;
  r->three.recount_traffic.misses++, r->three.rtl_traffic.lookups++, r->three.rtl_traffic.places++;
  r->three.agreement = sf_fail(SF_E_DIFFERENCE, "SOP of layer C3");
  r->measure.checked_core.layer[FX_C1].mac[0]++;
  char *text = printed_report(r);
  const char *begin = strstr(text, "three counts"), *end = strstr(text, "SOP of layer C3\n");
  ck_assert(begin && end);
  char *part = strndup(begin, (size_t)(end - begin));
  ck_expected("audit-difference.txt", part);
  free(part), free(text);
  cJSON *json = sf_report_json(r);
  ck_assert(cJSON_IsFalse(cJSON_GetObjectItem(json, "core_equals_recount")));
  ck_assert(cJSON_IsFalse(cJSON_GetObjectItem(json, "core_equals_rtl_equals_recount")));
  cJSON_Delete(json);
  /* No recounted sample, but a difference all the same. */
  r->measure.recount = (fx_counts){.samples = 0};
  json = sf_report_json(r);
  ck_assert(cJSON_IsFalse(cJSON_GetObjectItem(json, "core_equals_recount")));
  cJSON_Delete(json);
  r->three.wanted = 3, r->three.rays = 0, r->three.agreement = sf_ok();
  r->measure.checked_core = (fx_counts){.samples = 0};
  text = printed_report(r);
  ck_assert_ptr_nonnull(strstr(text, "accelerator: no ray has samples, nothing to run\n"));
  ck_assert_ptr_nonnull(strstr(text, "recount: no ray has samples, nothing to count again\n"));
  free(text), free(a);
}

/* The words about a saving, by its sign. */
TEST(an_audit_says_whether_it_is_less)
{
  static const struct {
    double paper, all, shared;
    const char *words[3];
  } rows[] = {{25, 5, 3, {", 25.00% less than the twin;", ", 5.00% less than an integer", "it is 3.00% less.\n"}},
              {-25, 5, 0, {", 25.00% more than", ", 5.00% less than", "it is 0.00% less: THE SAVING VANISHES.\n"}},
              {25, 5, -1, {", 25.00% less", ", 5.00% less than", "it is 1.00% more: THE SAVING VANISHES.\n"}},
              {0, -5, -3, {", 0.00% less", ", 5.00% more than", "it is 3.00% more.\n"}},
              {0, 0, -3, {", 0.00% less", ", 0.00% less than", "it is 3.00% more.\n"}}};
  audit *a = new_audit();
  double *saving = a->report.ledgers.saving;
  for (int i = 0; i < COUNT(rows); i++) {
    saving[SF_LEDGER_PAPER] = rows[i].paper, saving[SF_LEDGER_NEURON] = rows[i].all;
    saving[SF_LEDGER_SHARED] = rows[i].shared;
    char *text = printed_report(&a->report);
    for (int w = 0; w < 3; w++) ck_assert_msg(strstr(text, rows[i].words[w]) != NULL, "row %d, word %d", i, w);
    free(text);
  }
  for (int i = 0; i < 2; i++) {
    saving[SF_LEDGER_PAPER] = i ? 1 : NAN, saving[SF_LEDGER_NEURON] = i ? NAN : 1;
    char *text = printed_report(&a->report);
    ck_assert_ptr_null(strstr(text, "In the paper's metric"));
    free(text);
  }
  free(a);
}

/* ---- comparison ---- */

/* As from a file. */
static cJSON *read_back(const audit *a)
{
  cJSON *json = sf_report_json(&a->report);
  char *text = cJSON_PrintUnformatted(json);
  cJSON_Delete(json);
  json = cJSON_Parse(text);
  free(text);
  return json;
}

static cJSON *member(cJSON *json, const char *a, const char *b, const char *c)
{
  json = cJSON_GetObjectItemCaseSensitive(json, a);
  json = b ? cJSON_GetObjectItemCaseSensitive(json, b) : json;
  return c ? cJSON_GetObjectItemCaseSensitive(json, c) : json;
}

/* Of another scene: more spikes, more views, other prices and another cache. */
static audit *other_audit(void)
{
  audit *a = new_audit();
  sf_audit_report *r = &a->report;
  bitmaps more;
  memcpy(more, small_spikes, sizeof more);
  more[FX_C2][0][0] = 0x7, more[FX_C1][0][0] = 0x6;
  r->measure.core = (fx_counts){.samples = 0};
  for (int i = 0; i < 5; i++)
    sf_recount_sample(&a->net, (const uint64_t(*)[SF_T_MAX][SF_SPIKE_WORDS])more, i % 2, &r->measure.core);
  r->measure.core.grid_bytes = 77;
  r->scene = "t.snn", r->views = 2, r->cache = (fx_cache_shape){4096, 2}, r->seed = 12;
  r->traffic.misses = 5, r->traffic.lookups = 11;
  char text[1024];
  snprintf(text, sizeof text, "%s\n%s", plain, "sram.4096 60 fJ made up\nspecial 30 pJ made up\n");
  memcpy(strstr(text, "0.008 nJ"), "0.006 nJ", 8);
  price(a, text);
  return a;
}

static void compare(const char *name, const cJSON *a, const cJSON *b)
{
  cJSON *comparison;
  char file[80];
  ck_ok(sf_audits_compare(a, "a.json", b, "b.json", &comparison));
  snprintf(file, sizeof file, "%s.txt", name);
  ck_expected_text(file, out, sf_comparison_print(out, comparison));
  snprintf(file, sizeof file, "%s.json", name);
  ck_expected_json(file, comparison, 2);
}

TEST(comparison_whole)
{
  audit *x = new_audit(), *y = other_audit();
  cJSON *a = read_back(x), *b = read_back(y);
  /* Parts, ledgers, prices and events that one of them has. */
  cJSON_DeleteItemFromObject(member(a, "counts", "traffic", NULL), "misses");
  cJSON_DeleteItemFromObject(member(b, "counts", "traffic", NULL), "products");
  cJSON *list_a = member(a, "ledgers", "list", NULL), *list_b = member(b, "ledgers", "list", NULL);
  cJSON_DeleteItemFromObject(member(cJSON_GetArrayItem(list_a, SF_LEDGER_NEURON), "parts_fj", NULL, NULL), "fill");
  cJSON_DeleteItemFromObject(member(cJSON_GetArrayItem(list_b, SF_LEDGER_NEURON), "parts_fj", NULL, NULL), "mac");
  cJSON_DeleteItemFromObject(member(b, "titles", "parts", NULL), "fill");
  cJSON_DeleteItemFromArray(list_a, SF_LEDGER_INT_SHARED);
  cJSON_DeleteItemFromArray(list_b, SF_LEDGER_SHARED);
  cJSON_DeleteItemFromArray(list_b, SF_LEDGER_PAPER);
  compare("comparison", a, b);
  cJSON_Delete(a), cJSON_Delete(b), free(x), free(y);
}

/* Arithmetic alone can be compared with a report of the scheme before. */
TEST(comparison_with_the_scheme_before)
{
  audit *x = new_audit(), *y = other_audit();
  cJSON *a = read_back(x), *b = read_back(y);
  cJSON_SetValuestring(cJSON_GetObjectItem(b, "format"), SF_AUDIT_FORMAT_1);
  cJSON_DeleteItemFromObject(b, "cache");
  cJSON_DeleteItemFromObject(b, "seed");
  compare("comparison-scheme-1", a, b);
  cJSON_Delete(a), cJSON_Delete(b), free(x), free(y);
}

/* A ledger each, and not the same one. */
TEST(comparison_of_nothing_in_common)
{
  audit *x = new_audit(), *y = other_audit();
  cJSON *a = read_back(x), *b = read_back(y), *list = member(a, "ledgers", "list", NULL);
  while (cJSON_GetArraySize(list) > 1) cJSON_DeleteItemFromArray(list, 1);
  list = member(b, "ledgers", "list", NULL);
  cJSON_DeleteItemFromArray(list, 0);
  while (cJSON_GetArraySize(list) > 1) cJSON_DeleteItemFromArray(list, 1);
  compare("comparison-apart", a, b);
  cJSON_Delete(a), cJSON_Delete(b), free(x), free(y);
}

TEST(comparison_of_the_same)
{
  audit *x = new_audit();
  cJSON *a = read_back(x), *comparison;
  ck_ok(sf_audits_compare(a, "a", a, "b", &comparison));
  ck_assert_int_eq(cJSON_GetArraySize(member(comparison, "settings", NULL, NULL)), 0);
  ck_assert_int_eq(cJSON_GetArraySize(member(comparison, "events_per_view", NULL, NULL)), 0);
  ck_assert_int_eq(cJSON_GetArraySize(member(comparison, "ledgers", NULL, NULL)), SF_LEDGERS);
  ck_assert_int_eq(cJSON_GetArraySize(member(comparison, "energies_mj_per_view", "everything", "parts")), 0);
  cJSON_Delete(comparison), cJSON_Delete(a), free(x);
}

/* What makes a report no audit, one thing at a time, on either side. */
static void spoil(cJSON *json, int how)
{
  cJSON *list = member(json, "ledgers", "list", NULL), *first = cJSON_GetArrayItem(list, 0);
  cJSON *last = cJSON_GetArrayItem(list, SF_LEDGERS - 1);
  switch (how) {
  case 0:
    cJSON_SetValuestring(member(json, "format", NULL, NULL), "spikefield-audit-3");
    break;
  case 1:
    cJSON_DeleteItemFromObject(json, "views");
    break;
  case 2:
    cJSON_SetNumberValue(member(json, "views", NULL, NULL), 0);
    break;
  case 3:
    cJSON_SetNumberValue(member(json, "views", NULL, NULL), -1);
    break;
  case 4:
    cJSON_DeleteItemFromObject(last, "key");
    break;
  case 5:
    cJSON_DeleteItemFromObject(first, "title");
    break;
  case 6:
    cJSON_DeleteItemFromObject(first, "mj_per_view");
    break;
  case 7:
    cJSON_DeleteItemFromObject(first, "parts_fj");
    break;
  case 8:
    cJSON_DeleteItemFromArray(member(first, "rows", NULL, NULL), 0);
    break;
  case 9:
    while (cJSON_GetArraySize(list)) cJSON_DeleteItemFromArray(list, 0);
    break;
  case 10:
    cJSON_DeleteItemFromArray(member(json, "counts", "layers", NULL), 0);
    break;
  default:
    cJSON_DeleteItemFromObject(member(json, "ledgers", "technology", NULL), "prices");
    break;
  }
}

LOOP_TEST(what_is_no_audit_is_refused, 12)
{
  audit *x = new_audit();
  cJSON *good = read_back(x), *bad = read_back(x), *comparison = good;
  spoil(bad, _i);
  ck_bad(sf_audits_compare(good, "good", bad, "second", &comparison), SF_E_FORMAT, "second: not a report",
         SF_AUDIT_FORMAT_1);
  ck_assert_ptr_null(comparison);
  ck_bad(sf_audits_compare(bad, "first", good, "good", &comparison), SF_E_FORMAT, "first: not a report",
         SF_AUDIT_FORMAT);
  cJSON_Delete(good), cJSON_Delete(bad), free(x);
}

ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};
