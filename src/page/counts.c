/* Three counts of each event, per layer and step; saturation; what the audit leaves out. */
#include "page/internal.h"
#include <inttypes.h>

static bool same(uint64_t a, uint64_t b, uint64_t c)
{
  return a == b && b == c;
}

/* What lies outside the nets has no layer. */
static void traffic_row(FILE *out, const sf_three_counts *s, const char *title, const char *name, uint64_t core,
                        uint64_t rtl, uint64_t recount)
{
  char key[64];
  fprintf(out, "<tr><th>%s</th><td class=\"n\">", title);
  snprintf(key, sizeof key, "rtl_subset.core.traffic.%s", name);
  html_put_count(out, key, core);
  fprintf(out, "</td><td class=\"n\">");
  snprintf(key, sizeof key, "rtl_subset.rtl.traffic.%s", name);
  if (s->no_rtl_traffic)
    fprintf(out, "\xe2\x80\x93");
  else
    html_put_count(out, key, rtl);
  fprintf(out, "</td><td class=\"n\">");
  snprintf(key, sizeof key, "rtl_subset.recount.traffic.%s", name);
  html_put_count(out, key, recount);
  const bool equal = core == recount && (s->no_rtl_traffic || core == rtl);
  fprintf(out, "</td><td class=\"%s</td></tr>\n", equal ? "good\">equal" : "bad\">DIFFERENT");
}

static void totals(FILE *out, const sf_page *page)
{
  const sf_three_counts *s = &page->report->three;
  char key[64];
  fprintf(out, "<div class=\"scroll\"><table id=\"table-three\"><caption>All layers and steps "
               "together</caption>\n<thead><tr><th>event</th>"
               "<th class=\"n\">core</th><th class=\"n\">accelerator</th><th "
               "class=\"n\">recount</th><th></th></tr></thead>\n<tbody>\n");
  for (int e = 0; e < SF_EVENTS; e++) {
    const uint64_t n[3] = {sf_event_total(&s->core, e), sf_event_total(&s->rtl, e), sf_event_total(&s->recount, e)};
    static const char *const name[3] = {"core", "rtl", "recount"};
    fprintf(out, "<tr><th>%s</th>", sf_events[e].title);
    for (int i = 0; i < 3; i++) {
      snprintf(key, sizeof key, "rtl_subset.%s.total.%s", name[i], sf_events[e].name);
      fprintf(out, "<td class=\"n\">");
      html_put_count(out, key, n[i]);
      fprintf(out, "</td>");
    }
    fprintf(out, same(n[0], n[1], n[2]) ? "<td class=\"good\">equal</td></tr>\n"
                                        : "<td class=\"bad\">DIFFERENT</td></tr>\n");
  }
  for (int e = 0; e < SF_TRAFFIC_EVENTS; e++)
    traffic_row(out, s, sf_traffic_events[e].title, sf_traffic_events[e].name, s->core_traffic.event[e],
                s->rtl_traffic.event[e], s->recount_traffic.event[e]);
  const uint64_t fj[3] = {sf_energy_fj(&s->core), sf_energy_fj(&s->rtl), sf_energy_fj(&s->recount)};
  fprintf(out, "<tr><th>paper ledger, fJ</th><td class=\"n\">");
  html_put_count(out, "rtl_subset.core_fj", fj[0]);
  fprintf(out, "</td><td class=\"n\">");
  html_put_count(out, "rtl_subset.rtl_fj", fj[1]);
  fprintf(out, "</td><td class=\"n\">");
  html_put_count(out, "rtl_subset.recount_fj", fj[2]);
  fprintf(out, "</td><td class=\"%s</td></tr>\n</tbody></table></div>\n",
          same(fj[0], fj[1], fj[2]) ? "good\">equal" : "bad\">DIFFERENT");
}

static void cell(FILE *out, const sf_page *page, int l, int t, int e)
{
  const sf_three_counts *s = &page->report->three;
  const uint64_t core = s->core.layer[l].event[e][t], rtl = s->rtl.layer[l].event[e][t],
                 recount = s->recount.layer[l].event[e][t];
  char key[80], text[HTML_NUMBER];
  snprintf(key, sizeof key, "rtl_subset.core.layers[%d].%s[%d]", l, sf_events[e].name, t);
  if (same(core, rtl, recount)) {
    fprintf(out, "<td class=\"n%s\">", core ? "" : " mut");
    html_put_count(out, key, core);
  } else {
    fprintf(out, "<td class=\"n bad\">core ");
    html_put_count(out, key, core);
    fprintf(out, "<br/>accelerator %s", html_count(text, rtl));
    fprintf(out, "<br/>recount %s", html_count(text, recount));
  }
  fprintf(out, "</td>");
}

static void by_layer_and_step(FILE *out, const sf_page *page)
{
  fprintf(out, "<div class=\"scroll\"><table id=\"table-counts\"><caption>Per layer and step; one number where all "
               "three are equal</caption>\n"
               "<thead><tr><th>layer</th><th class=\"n\">step</th>");
  for (int e = 0; e < SF_EVENTS; e++) fprintf(out, "<th class=\"n\">%s</th>", sf_events[e].title);
  fprintf(out, "</tr></thead>\n<tbody>\n");
  for (int l = 0; l < SF_LAYERS; l++) {
    if (page->report->net->layer[l].n_out == 0) continue;
    for (int t = 0; t < page->report->net->steps; t++) {
      fprintf(out, "<tr%s><th><i class=\"key l%d\"></i>%s</th><td class=\"n\">%d</td>", t ? "" : " class=\"first\"", l,
              fx_layer_name(l), t + 1);
      for (int e = 0; e < SF_EVENTS; e++) cell(out, page, l, t, e);
      fprintf(out, "</tr>\n");
    }
  }
  fprintf(out, "</tbody></table></div>\n<p class=\"note\">D2 and C3 fetch a row of weights once per sample, at the "
               "first step at which its neuron fires: later steps fetch little.</p>\n");
}

void html_counts(FILE *out, const sf_page *page)
{
  const sf_three_counts *s = &page->report->three;
  char samples[HTML_NUMBER], rays[HTML_NUMBER];
  fprintf(out,
          "<section id=\"counts\">\n<h2>Three counts of every event</h2>\n<p>Each event is counted by the fixed-point "
          "core as it computes, and once more from the recorded spikes by code that shares nothing with it; for the "
          "rays below the Verilog accelerator counts too, in registers of its own. The three must be equal, for every "
          "event, layer and step.</p>\n<p>");
  if (page->report->measure.recount.samples)
    fprintf(out, "Core = recount for all %s samples of %s rays. ",
            html_count(samples, page->report->measure.recount.samples),
            html_count(rays, page->report->measure.checked));
  else
    fprintf(out, "Nothing was counted again. ");
  if (s->rays == 0 && s->agreement.code == SF_OK) {
    fprintf(out, "The accelerator was left out.</p>\n</section>\n");
    return;
  }
  fprintf(out, "<data data-key=\"rtl_subset.rays\" value=\"%d\">%d</data> rays with ", s->rays, s->rays);
  html_put_count(out, "rtl_subset.samples", s->core.samples);
  fprintf(out, " samples, drawn with seed ");
  html_put_count(out, "seed", page->report->seed);
  if (s->agreement.code == SF_OK) {
    fprintf(out, ": <b class=\"good\">core = accelerator = recount</b>, difference 0 fJ.</p>\n");
  } else {
    fprintf(out, ": <b class=\"bad\">the counts differ</b>. ");
    sf_xml_escape(out, s->agreement.message);
    fprintf(out, "</p>\n");
  }
  totals(out, page);
  by_layer_and_step(out, page);
  fprintf(out, "</section>\n");
}

/* ---- limits ---- */

static void census(FILE *out, const sf_page *page)
{
  const fx_counts *c = &page->report->measure.core;
  const int first = fx_net_first_layer(page->report->net);
  char list[64];
  uint64_t clipped = c->saturated_features;
  for (int l = 0; l < SF_LAYERS; l++) clipped += c->saturated_samples[l];
  fprintf(out, "<h3>Saturation</h3>\n<p>Fixed-point numbers have a largest value; a result beyond it is clipped to it. "
               "Samples in which that happened, of ");
  html_put_count(out, "samples", c->samples);
  fprintf(out, ":</p>\n<div class=\"scroll\"><table class=\"narrow\" id=\"table-saturation\"><thead><tr>");
  for (int l = first; l < SF_LAYERS; l++) fprintf(out, "<th class=\"n\">%s</th>", fx_layer_name(l));
  fprintf(out, "<th class=\"n\">grid features</th></tr></thead>\n<tbody><tr>");
  for (int l = first; l < SF_LAYERS; l++) {
    char key[40];
    snprintf(key, sizeof key, "saturated_samples.%s", fx_layer_name(l));
    fprintf(out, "<td class=\"n\">");
    html_put_count(out, key, c->saturated_samples[l]);
    fprintf(out, "</td>");
  }
  fprintf(out, "<td class=\"n\">");
  html_put_count(out, "counts.saturated_features", c->saturated_features);
  fprintf(out, "</td></tr></tbody></table></div>\n");
  if (sf_saturation_unexpected(page->report->net, c->saturated_samples, list, sizeof list)) {
    fprintf(out, "<p class=\"bad\">Unexpected in ");
    sf_xml_escape(out, list);
    fprintf(out, ": the number formats rule it out.</p>\n");
  } else if (clipped == 0) {
    fprintf(out, "<p>None saturated.</p>\n");
  } else {
    fprintf(
        out,
        "<p>Density (D2) may saturate: such a sample is opaque long before. The other layers are as expected.</p>\n");
  }
}

static void list(FILE *out, const char *id, const char *title, const char *const *text)
{
  fprintf(out, "<div><h3>%s</h3>\n<ul id=\"%s\">\n", title, id);
  for (; *text; text++) {
    fprintf(out, "<li>");
    sf_xml_escape(out, *text);
    fprintf(out, "</li>\n");
  }
  fprintf(out, "</ul></div>\n");
}

void html_limits(FILE *out, const sf_page *page)
{
  fprintf(out, "<section id=\"limits\">\n<h2>What this audit does not show</h2>\n<div class=\"grid\">\n");
  list(out, "not-modelled", "Not modelled", sf_not_modelled);
  list(out, "criticism", "Known criticism of the metric", sf_criticism);
  fprintf(out, "</div>\n");
  census(out, page);
  fprintf(out, "</section>\n");
}
