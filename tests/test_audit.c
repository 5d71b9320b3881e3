/* Reports of an audit: JSON, text, differences. */
#include "ck_run.h"
#include "base/text.h"
#include "energy/energy.h"
#include "tests/audit_report_fixture.h"

static const cJSON *at(const cJSON *json, const char *key)
{
  const cJSON *item = cJSON_GetObjectItemCaseSensitive(json, key);
  ck_assert_msg(item != NULL, "JSON has no '%s'", key);
  return item;
}

TEST(json_keeps_every_digit)
{
  fx_net net = small_net();
  fx_counts c = {0};
  c.layer[FX_C2].sop[1] = 9007199254740993u; /* 2^53 + 1: a double cannot hold it */
  cJSON *json = sf_counts_json(&net, &c);
  char *text = cJSON_PrintUnformatted(json);
  ck_assert_msg(strstr(text, "\"sop\":[0,9007199254740993]") != NULL, "%s", text);
  cJSON *again = cJSON_Parse(text);
  ck_assert_ptr_nonnull(again);
  ck_assert_int_eq(cJSON_GetArraySize(at(again, "layers")), SF_LAYERS);
  free(text);
  cJSON_Delete(json), cJSON_Delete(again);
}

/* Each ill-formed byte is one replacement. */
TEST(text_from_outside_becomes_utf8)
{
  static const struct {
    const char *text, *wanted;
  } rows[] = {{"", ""},
              {"sc\xff.snn", "sc\xef\xbf\xbd.snn"},
              {"\xc3\xa9 \xe2\x82\xac \xf0\x9f\x98\x80", "\xc3\xa9 \xe2\x82\xac \xf0\x9f\x98\x80"},
              {"\xe2\x82", "\xef\xbf\xbd\xef\xbf\xbd"},                 /* cut off */
              {"\xc0\xaf\x80", "\xef\xbf\xbd\xef\xbf\xbd\xef\xbf\xbd"}, /* too long a form */
              {"\xed\xa0\x80", "\xef\xbf\xbd\xef\xbf\xbd\xef\xbf\xbd"}, /* half a pair */
              {"\xf4\x90\x80\x80", "\xef\xbf\xbd\xef\xbf\xbd\xef\xbf\xbd\xef\xbf\xbd"}};
  for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
    cJSON *json = cJSON_CreateObject();
    char *text = NULL;
    size_t size;
    FILE *out = open_memstream(&text, &size);
    sf_json_add_text(json, "t", rows[i].text);
    ck_assert_str_eq(at(json, "t")->valuestring, rows[i].wanted);
    sf_xml_escape(out, rows[i].text);
    fclose(out);
    ck_assert_str_eq(text, rows[i].wanted);
    free(text);
    cJSON_Delete(json);
  }
}

static sf_audit_report *small_report(const fx_net *net)
{
  sf_audit_report *r = calloc(1, sizeof *r);
  *r =
      (sf_audit_report){.scene = "s", .data = "d", .split = "test", .sha256 = "0", .net = net, .rays = 4, .views = 0.5};
  return r;
}

TEST(report_json_holds_what_was_counted)
{
  const fx_net net = small_net();
  sf_audit_report *r = small_report(&net);
  sf_recount_sample(&net, small_spikes, true, &r->measure.core);
  r->measure.recount = r->measure.checked_core = r->measure.core;
  ck_ok(sf_ledger_make(&net, &r->measure.core, &r->ledger));
  cJSON *json = sf_report_json(r);
  char *text = cJSON_PrintUnformatted(json);
  cJSON_Delete(json);
  json = cJSON_Parse(text);
  ck_assert_double_eq(at(json, "energy_spiking_fj")->valuedouble, 220000);
  ck_assert_double_eq(at(json, "energy_ann_fj")->valuedouble, 349600);
  ck_assert_double_eq_tol(at(json, "energy_saving_percent")->valuedouble, 37.0709, 1e-4);
  ck_assert_double_eq_tol(at(json, "energy_spiking_mj_per_view")->valuedouble, 4.4e-7, 1e-18);
  ck_assert_double_eq(at(json, "samples_per_ray")->valuedouble, 0.25);
  ck_assert(cJSON_IsTrue(at(json, "core_equals_recount")));
  ck_assert(cJSON_IsNull(at(json, "core_equals_rtl_equals_recount"))); /* no ray was run there */
  ck_assert_int_ge(cJSON_GetArraySize(at(json, "not_modelled")), 5);
  ck_assert_int_ge(cJSON_GetArraySize(at(json, "criticism")), 4);
  const cJSON *c1 = cJSON_GetArrayItem(at(at(json, "counts"), "layers"), FX_C1);
  ck_assert_double_eq(cJSON_GetArrayItem(at(c1, "firing_rate"), 1)->valuedouble, 0.5);
  free(text), free(r);
  cJSON_Delete(json);
}

TEST(report_says_that_counts_differ)
{
  const fx_net net = small_net();
  sf_audit_report *r = small_report(&net);
  r->three.rays = 1, r->three.wanted = 1;
  r->three.core.layer[FX_C3].sop[0] = 5;
  r->three.agreement = sf_counts_compare(&r->three.core, "core", &r->three.rtl, "accelerator");
  cJSON *json = sf_report_json(r);
  ck_assert(cJSON_IsFalse(at(json, "core_equals_rtl_equals_recount")));
  ck_assert_str_eq(at(json, "difference")->valuestring, "SOP of layer C3 at step 0: core 5, accelerator 0");
  char *text = printed_report(r);
  ck_assert_ptr_nonnull(strstr(text, "DIFFERENCE: SOP of layer C3 at step 0"));
  ck_assert_ptr_nonnull(strstr(text, "not modelled, by any ledger:"));
  free(text), free(r);
  cJSON_Delete(json);
}

/* The first ray of the accelerator can be the one that differs: there is nothing but the difference then. */
TEST(report_says_that_the_first_ray_differs)
{
  const fx_net net = small_net();
  sf_audit_report *r = small_report(&net);
  r->three.wanted = 16;
  r->three.agreement = sf_fail(SF_E_DIFFERENCE, "ray 0: sample 0: red: core 1, accelerator 0");
  cJSON *json = sf_report_json(r);
  ck_assert(cJSON_IsFalse(at(json, "core_equals_rtl_equals_recount")));
  char *text = printed_report(r);
  ck_assert_ptr_nonnull(strstr(text, "DIFFERENCE: ray 0: sample 0"));
  ck_assert_ptr_null(strstr(text, "nothing to run"));
  free(text), free(r);
  cJSON_Delete(json);
}
