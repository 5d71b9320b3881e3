/* Heading: what was audited, the result in one sentence, the key figures; then what is counted, for a newcomer. */
#include "src/audit/html.h"
#include <math.h>
#include <string.h>

const char *html_base_name(const char *path)
{
  const char *slash = strrchr(path, '/');
  return slash && slash[1] ? slash + 1 : path;
}

static void result(FILE *out, const sf_page *page)
{
  const sf_audit_report *r = page->report;
  const double saving = sf_saving_percent(r->ledger.spiking_fj, r->ledger.ann_fj);
  fprintf(out, "<p class=\"lead\">%s <b>", page->whole ? "Computing this view takes" : "The audited rays take");
  html_put_energy(out, "energy_spiking_fj", r->ledger.spiking_fj);
  fprintf(out, "</b> with the spiking network and <b>");
  html_put_energy(out, "energy_ann_fj", r->ledger.ann_fj);
  fprintf(out, "</b> with the same network in its ordinary, non-spiking form");
  if (isfinite(saving)) {
    fprintf(out, ": ");
    html_put_saving(out, "energy_saving_percent", saving);
  }
  fprintf(out, ", when additions and multiplications alone are priced, as the literature does.</p>\n");
}

/* No single ledger settles the question. */
static void other_results(FILE *out, const sf_page *page)
{
  const sf_ledgers *l = &page->report->ledgers;
  if (!isfinite(l->saving[SF_LEDGER_WIDTH]) || !isfinite(l->saving[SF_LEDGER_NEURON])) return;
  fprintf(out, "<p>Priced as integers of the widths that the hardware uses, and against a twin of integers, ");
  html_put_saving(out, "ledgers.list[1].saving_percent", l->saving[SF_LEDGER_WIDTH]);
  fprintf(out, "; with memory traffic and neuron updates priced too, ");
  html_put_saving(out, "ledgers.list[3].saving_percent", l->saving[SF_LEDGER_NEURON]);
  fprintf(out, ". <a href=\"#ledgers\">Every ledger</a> is below.</p>\n");
}

static void fact_begin(FILE *out, const char *name)
{
  fprintf(out, "<div><dt>%s</dt><dd>", name);
}

static void facts(FILE *out, const sf_page *page)
{
  const sf_audit_report *r = page->report;
  const int t_r = r->net->steps;
  fprintf(out, "<dl class=\"facts\">\n");
  fact_begin(out, "Time steps t<sub>r</sub>");
  fprintf(out, "<data data-key=\"t_r\" value=\"%d\">%d</data> <small>of T = %d</small></dd></div>\n", t_r, t_r,
          page->trained_steps ? page->trained_steps : SF_T_MAX);
  fact_begin(out, "Samples");
  html_put_count(out, "samples", r->measure.core.samples);
  fprintf(out, " <small>");
  html_put_real(out, "samples_per_ray", (double)r->measure.core.samples / (double)r->rays, "%.2f");
  fprintf(out, " per ray</small></dd></div>\n");
  fact_begin(out, "PSNR, fixed point");
  html_put_real(out, "page.psnr_fixed", page->prefix[t_r - 1].psnr, "%.2f");
  fprintf(out, " <small class=\"unit\">dB</small></dd></div>\n");
  fact_begin(out, "PSNR, float");
  html_put_real(out, "page.psnr_float", page->psnr_float, "%.2f");
  fprintf(out, " <small%s</small></dd></div>\n", isfinite(page->psnr_float) ? " class=\"unit\">dB" : ">not measured");
  fact_begin(out, "SSIM, fixed point");
  html_put_real(out, "page.ssim_fixed", page->prefix[t_r - 1].ssim, "%.4f");
  fprintf(out, "</dd></div>\n");
  fact_begin(out, "Three counts");
  const bool differ = r->three.agreement.code != SF_OK;
  fprintf(out, "<span class=\"%s\">%s</span></dd></div>\n</dl>\n", differ ? "bad" : "good",
          differ               ? "differ"
          : r->three.rays == 0 ? "two agree"
                               : "agree");
}

void html_head(FILE *out, const sf_page *page)
{
  const sf_audit_report *r = page->report;
  fprintf(out, "<header>\n<p class=\"kicker\">spikefield energy audit</p>\n<h1>");
  html_escape(out, html_base_name(r->data));
  fprintf(out, ", view ");
  html_escape(out, page->view->name);
  fprintf(out, "</h1>\n<p class=\"sub\">");
  html_escape(out, html_base_name(r->scene));
  fprintf(out, " at %d \xc3\x97 %d pixels, ", page->view->camera.width, page->view->camera.height);
  html_put_count(out, "rays", r->rays);
  fprintf(out, " %s rays audited, one per pixel", r->random_rays ? "random" : "");
  fprintf(out, "%s</p>\n", page->whole ? "" : " (the pictures show one view)");
  result(out, page);
  other_results(out, page);
  facts(out, page);
  fprintf(out,
          "<nav aria-label=\"contents\"><a href=\"#basics\">What is counted</a> <a href=\"#pictures\">Pictures</a> "
          "<a href=\"#energy\">Layers and steps</a> <a href=\"#spikes\">Spikes</a> <a href=\"#ledgers\">Ledgers</a> "
          "<a href=\"#prices\">Prices</a> <a href=\"#quality\">Quality</a> <a href=\"#counts\">Three counts</a> "
          "<a href=\"#limits\">Limits</a> <a href=\"#origin\">To repeat it</a></nav>\n</header>\n");
}
