/* For test_html.c: the whole judgement of a page, and of the audit that it shows. */
#ifndef SF_TESTS_HTML_JUDGE_H
#define SF_TESTS_HTML_JUDGE_H
#include "energy/energy.h"
#include "tests/html_page.h"

static inline void check_ledgers(faults *f, const char *page, const sf_ledgers *l)
{
  for (int g = 0; g < SF_LEDGERS; g++)
    for (int p = 0; p < SF_PARTS; p++) {
      char key[96];
      int count = 0;
      snprintf(key, sizeof key, "data-key=\"ledgers.list[%d].parts_fj.%s\"", g, sf_part_names[p]);
      for (const char *at = page; (at = strstr(at, key)); at++) count++;
      const int wanted = l->part[g][p] == 0 ? 0 : 2; /* a bar and a cell */
      if (count < wanted) fault(f, "%s: %d of %d", key, count, wanted);
    }
}

static inline void check_unit(faults *f, const char *page, int row, int part, const uint64_t events[SF_T_MAX])
{
  uint64_t all = 0;
  char key[96];
  for (int t = 0; t < SF_T_MAX; t++) all += events[t];
  snprintf(key, sizeof key, "data-key=\"ledgers.list[%d].rows[%d].unit_fj.%s\"", SF_LEDGER_NEURON, row,
           sf_part_names[part]);
  if (all && !strstr(page, key)) fault(f, "no %s", key);
}

/* What happened in a layer has its price on the page. */
static inline void check_units(faults *f, const char *page, const fx_counts *c)
{
  for (int l = 0; l < SF_LAYERS; l++) {
    check_unit(f, page, l, SF_PART_MAC, c->layer[l].mac);
    check_unit(f, page, l, SF_PART_SOP, c->layer[l].sop);
    check_unit(f, page, l, SF_PART_WEIGHT, c->layer[l].weight);
    check_unit(f, page, l, SF_PART_STATE, c->layer[l].updates);
    check_unit(f, page, l, SF_PART_NEURON, c->layer[l].updates);
    check_unit(f, page, l, SF_PART_SPECIAL, c->layer[l].special);
  }
}

static inline void check_counts(faults *f, const char *page, int steps)
{
  for (int l = 0; l < SF_LAYERS; l++)
    for (int t = 0; t < steps; t++)
      for (int e = 0; e < SF_EVENTS; e++) {
        char key[96];
        snprintf(key, sizeof key, "data-key=\"rtl_subset.core.layers[%d].%s[%d]\"", l, sf_events[e].name, t);
        if (!strstr(page, key)) fault(f, "no %s", key);
      }
}

/* The words left of zero have room, on small screens too, where a letter is 8 units wide. */
static inline void check_room(faults *f, const char *page)
{
  static const char words[] = "\" y=\"12\" class=\"mut end\">\xe2\x86\x90 spends more<";
  for (const char *at = page; (at = strstr(at, words)); at++) {
    const char *x = at;
    while (x > page && x[-1] != '"') x--;
    if (strtod(x, NULL) < 8 * 13) fault(f, "\"spends more\" ends at x = %g", strtod(x, NULL));
  }
}

static inline void check_figures(faults *f, const char *page, const sf_audit_report *r)
{
  const int steps = r->net->steps;
  check_element(f, page, "figure", "fig-basics", "<svg", 2);
  check_element(f, page, "figure", "fig-golden", "<img", 1);
  check_element(f, page, "figure", "fig-energy-map", "<img", 1);
  check_element(f, page, "figure", "fig-samples-map", "<img", 1);
  check_element(f, page, "figure", "fig-steps-map", "<img", 1);
  int cells = 0; /* layers and steps that cost something */
  for (int l = 0; l < SF_LAYERS; l++)
    for (int t = 0; t < steps; t++) cells += r->measure.core.layer[l].mac[t] + r->measure.core.layer[l].sop[t] > 0;
  check_bars(f, page, "svg-by-step", "width", cells);
  check_bars(f, page, "svg-by-layer", "width", cells);
  check_element(f, page, "figure", "fig-raster", "<path class=\"tick", 3);
  check_bars(f, page, "svg-rates-d1", "height", steps);
  check_bars(f, page, "svg-rates-c1", "height", steps);
  check_bars(f, page, "svg-rates-c2", "height", steps);
  check_bars(f, page, "svg-savings", "width", SF_SPIKING_LEDGERS);
  check_bars(f, page, "svg-readings", "width", 3);
  check_room(f, page);
  for (int g = 0; g < SF_SPIKING_LEDGERS; g++) {
    char id[64];
    snprintf(id, sizeof id, "svg-ledger-%s", sf_ledger_texts[g].key);
    check_bars(f, page, id, "width", 3);
  }
  check_element(f, page, "figure", "fig-tornado", "<rect", 8);
  check_element(f, page, "svg", "svg-break-even", "class=\"dot chosen\"", SF_SPIKING_LEDGERS);
  check_element(f, page, "svg", "svg-quality", "<circle", SF_T_MAX);
  check_element(f, page, "table", "table-prices", "<tr>", r->ledgers.technology.count + 1);
  check_element(f, page, "table", "table-units", "<tr>", 20);
  check_element(f, page, "table", "table-three", "equal", SF_EVENTS + SF_TRAFFIC_EVENTS + 1);
  check_element(f, page, "ul", "not-modelled", "<li>", 3);
  check_element(f, page, "ul", "criticism", "<li>", 3);
  check_element(f, page, "pre", "command", "energy_audit", 1);
}

/* The result stands in front, with where each number is from. */
static inline void check_head(faults *f, const char *page)
{
  static const char *const keys[] = {"energy_spiking_fj",
                                     "energy_ann_fj",
                                     "energy_saving_percent",
                                     "ledgers.list[3].total_fj",
                                     "ledgers.list[8].total_fj",
                                     "ledgers.list[3].saving_percent",
                                     "ledgers.list[4].saving_percent",
                                     "ledgers.list[1].saving_percent",
                                     "ledger.hoisted_saving_percent",
                                     "rays",
                                     "t_r",
                                     "samples",
                                     "samples_per_ray",
                                     "page.psnr_fixed",
                                     "page.ssim_fixed"};
  const char *end = strstr(page, "</header>");
  for (size_t i = 0; i < sizeof keys / sizeof *keys; i++) {
    char data[96];
    snprintf(data, sizeof data, "<data data-key=\"%s\"", keys[i]);
    const char *at = strstr(page, data);
    if (!at || !end || at > end) fault(f, "the header has no %s", keys[i]);
  }
}

static inline faults judge(const char *page, const sf_audit_report *r)
{
  faults f = {0};
  cJSON *json = page_json(page);
  check_tags(&f, page);
  check_references(&f, page);
  check_head(&f, page);
  check_figures(&f, page, r);
  check_ledgers(&f, page, &r->ledgers);
  check_counts(&f, page, r->net->steps);
  check_units(&f, page, &r->measure.core);
  if (!json) fault(&f, "no JSON");
  if (check_numbers(&f, page, json) < 150) fault(&f, "fewer than 150 numbers");
  cJSON_Delete(json);
  return f;
}
#endif
