/* Heading: what was audited, the result in one sentence, the key figures; then what is counted, for a newcomer. */
#include "page/internal.h"
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
  const sf_ledgers *l = &r->ledgers;
  fprintf(out, "<p class=\"lead\">%s at <b>",
          page->whole ? "Computing this view is estimated" : "The audited rays are estimated");
  html_put_energy(out, "energy_spiking_fj", r->ledger.spiking_fj);
  fprintf(out, "</b> with the spiking network and <b>");
  html_put_energy(out, "energy_ann_fj", r->ledger.ann_fj);
  fprintf(out, "</b> with its ReLU twin");
  if (isfinite(saving)) {
    fprintf(out, ": ");
    html_put_saving(out, "energy_saving_percent", saving);
  }
  fprintf(out, ", when additions and multiplications alone are priced (the paper ledger). ");
  fprintf(out, "With integer prices for the widths of the hardware, memory traffic and neuron updates it is <b>");
  html_put_energy(out, "ledgers.list[3].total_fj", l->total[SF_LEDGER_NEURON]);
  fprintf(out, "</b> against <b>");
  html_put_energy(out, "ledgers.list[7].total_fj", l->total[SF_LEDGER_INT_ALL]);
  fprintf(out, "</b>: ");
  html_put_saving(out, "ledgers.list[3].saving_percent", l->saving[SF_LEDGER_NEURON]);
  fprintf(out, ".</p>\n");
}

/* What stands beside the spiking network in every comparison. */
static void twin(FILE *out, const sf_page *page)
{
  const sf_twin *own = &page->report->twin;
  fprintf(out, "<p>The ReLU twin is a count: a dense ReLU network of the same layer sizes on the same samples, every "
               "synapse a MAC, no zeros skipped; it was not trained for this figure.");
  if (own->path) {
    fprintf(out, " A ReLU network that was trained by itself takes ");
    html_put_count(out, "twin.samples", own->samples);
    fprintf(out, " samples and, in the paper ledger, ");
    html_put_energy(out, "twin.fj", own->fj);
    fprintf(out, "; against it ");
    html_put_saving(out, "twin.saving_percent", own->saving_percent);
    fprintf(out, ".");
  }
  fprintf(out, "</p>\n");
}

/* No single ledger settles the question. */
static void other_results(FILE *out, const sf_page *page)
{
  const sf_ledgers *l = &page->report->ledgers;
  const sf_ledger *paper = &page->report->ledger;
  fprintf(out, "<p>The paper ledger is that of \xe2\x80\x9c"
               "Adaptive Time-step Training for Enhancing Spike-Based Neural Radiance Fields\xe2\x80\x9d (PATA).");
  if (!fx_net_constants_per_sample(page->report->net) && paper->ann_hoisted_fj > 0) {
    fprintf(out, " Its twin multiplies the direction of a ray at every sample, the spiking network once per ray; like "
                 "for like, both once per ray: ");
    html_put_saving(out, "ledger.hoisted_saving_percent", sf_saving_percent(paper->spiking_fj, paper->ann_hoisted_fj));
    fprintf(out, ".");
  }
  if (isfinite(l->saving[SF_LEDGER_WIDTH])) {
    fprintf(out, " The same MAC and SOP as integers of the widths that the hardware uses: ");
    html_put_saving(out, "ledgers.list[1].saving_percent", l->saving[SF_LEDGER_WIDTH]);
    fprintf(out, ".");
  }
  fprintf(out, " <a href=\"#ledgers\">Every ledger</a> is below.</p>\n");
}

static void fact_begin(FILE *out, const char *name)
{
  fprintf(out, "<div><dt>%s</dt><dd>", name);
}

/* The verdict and what it rests on. */
static void counts_fact(FILE *out, const sf_page *page)
{
  const sf_three_counts *three = &page->report->three;
  char text[HTML_NUMBER];
  const bool differ = three->agreement.code != SF_OK;
  fact_begin(out, "Three counts");
  fprintf(out, "<span class=\"%s\">%s</span> <small class=\"basis\">", differ ? "bad" : "good",
          differ             ? "differ"
          : three->rays == 0 ? "two agree"
                             : "agree");
  if (three->rays > 0)
    fprintf(out, "%s ray%s in RTL simulation (Verilator, not silicon), ", html_count(text, (uint64_t)three->rays),
            three->rays == 1 ? "" : "s");
  fprintf(out, "%s rays recounted, all rays in the vector core</small></dd></div>\n",
          html_count(text, page->report->measure.checked));
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
  counts_fact(out, page);
  fprintf(out, "</dl>\n");
}

void html_head(FILE *out, const sf_page *page)
{
  const sf_audit_report *r = page->report;
  fprintf(out, "<header>\n<p class=\"kicker\">spikefield energy audit</p>\n<h1>");
  sf_xml_escape(out, html_base_name(r->data));
  fprintf(out, ", view ");
  sf_xml_escape(out, page->view->name);
  fprintf(out, "</h1>\n<p class=\"sub\">");
  sf_xml_escape(out, html_base_name(r->scene));
  fprintf(out, " at %d \xc3\x97 %d pixels, ", page->view->camera.width, page->view->camera.height);
  html_put_count(out, "rays", r->rays);
  fprintf(out, " %s rays audited, one per pixel", r->random_rays ? "random" : "");
  fprintf(out, "%s</p>\n", page->whole ? "" : " (the pictures show one view)");
  result(out, page);
  twin(out, page);
  other_results(out, page);
  facts(out, page);
  fprintf(
      out,
      "<nav aria-label=\"contents\"><a href=\"#basics\">What is being counted</a> <a href=\"#pictures\">What each "
      "pixel costs</a> <a href=\"#energy\">Where the energy goes</a> <a href=\"#spikes\">The spikes</a> "
      "<a href=\"#ledgers\">Other assumptions</a> <a href=\"#prices\">How much hangs on the prices</a> "
      "<a href=\"#quality\">Picture quality</a> <a href=\"#counts\">Three counts</a> "
      "<a href=\"#limits\">What this audit does not show</a> <a href=\"#origin\">To repeat it</a></nav>\n</header>\n");
}
