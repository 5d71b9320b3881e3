/* The energies that the paper prints, recomputed from the protocol that its tables imply: with F MACs per sample, R of
 * them with a real-valued input, T steps and firing rate fr,
 *     ANN      E = 4.6 pJ * F * samples
 *     spiking  E = (4.6 pJ * R + 0.9 pJ * fr * T * (F - R)) * samples
 * The ANN row gives the samples. A reading of R holds water when one rate explains all rows of its group, or two: one
 * of the first step and one of the later ones. */
#include "energy/energy.h"
#include <math.h>

enum { SPIKING_ROWS = 3 };
static const double mac_pj = 4.6, sop_pj = 0.9;

typedef struct group {
  const char *backbone, *data;
  double macs; /* F */
  double ann_mj;
  const char *beta[SPIKING_ROWS];                                     /* or what else names the row */
  double steps[SPIKING_ROWS], mj[SPIKING_ROWS], saving[SPIKING_ROWS]; /* saving NAN: not printed */
} group;

/* R = once + per_step * T. */
typedef struct reading {
  const char *backbone, *data; /* data NULL: all of the backbone */
  const char *name;
  double once, per_step;
} reading;

/* INGP decoder: f[32] -> 128 -> 16, [d16 | h15] -> 128 -> 128 -> 3. TensoRF decoder: 150 or 30 -> 128 -> 128 -> 3. */
static const group groups[] = {
    {"INGP",
     "Synthetic",
     26880,
     955.27,
     {"1e-7", "5e-7", "1e-6"},
     {5.125, 3.625, 2.875},
     {643.39, 492.25, 405.33},
     {32.65, 48.47, 57.57}},
    {"INGP",
     "Synthetic, t fixed",
     26880,
     955.27,
     {"t+1", "t", "t-1"},
     {4.625, 3.625, 2.625},
     {623.01, 491.70, 398.37},
     {NAN, NAN, NAN}},
    {"INGP", "Mip-360", 26880, 18980, {"1e-7", "5e-7", "1e-6"}, {6, 4.857, 4}, {15600, 13660, 11870}, {NAN, NAN, NAN}},
    {"TensoRF",
     "Synthetic",
     35968,
     1261,
     {"5e-9", "5e-8", "5e-7"},
     {5.625, 3.875, 2},
     {885.2, 815.2, 748.4},
     {NAN, NAN, NAN}},
    {"TensoRF",
     "LLFF",
     20608,
     11910,
     {"5e-9", "5e-8", "5e-7"},
     {5.625, 4.125, 1.875},
     {6341, 5314, 3704},
     {NAN, NAN, NAN}},
};
static const reading readings[] = {
    {"INGP", NULL, "R = 4096: D1", 32 * 128, 0},
    {"INGP", NULL, "R = 8064: D1 and C1, once", 32 * 128 + 31 * 128, 0},
    {"INGP", NULL, "R = 6144 + 1920 T: h at every step", 32 * 128 + 16 * 128, 15 * 128},
    {"TensoRF", "Synthetic", "R = 19200: input layer", 150 * 128, 0},
    {"TensoRF", "LLFF", "R = 3840: input layer", 30 * 128, 0},
};

static bool same(const char *a, const char *b)
{
  while (*a && *a == *b) a++, b++;
  return *a == *b;
}

/* Energy of a row per sample = real + spiking * (first + later * (T - 1)): the two rates that make the sum of the
 * squares of the relative residuals least, by the normal equations. */
static void fit_two_rates(sf_published_row *row, double spiking)
{
  double xx = 0, xy = 0, yy = 0, xe = 0, ye = 0;
  for (int i = 1; i <= SPIKING_ROWS; i++) {
    const double energy = row[i].published_mj * 1e9 / row[i].samples;
    const double x = spiking / energy, y = x * (row[i].steps - 1), e = 1 - mac_pj * row[i].real_macs / energy;
    xx += x * x, xy += x * y, yy += y * y, xe += x * e, ye += y * e;
  }
  const double det = xx * yy - xy * xy, first = (xe * yy - ye * xy) / det, later = (ye * xx - xe * xy) / det;
  for (int i = 1; i <= SPIKING_ROWS; i++) {
    sf_published_row *p = &row[i];
    p->first_rate = first, p->later_rate = later;
    p->two_rates_mj = (mac_pj * p->real_macs + spiking * (first + later * (p->steps - 1))) * p->samples * 1e-9;
    p->two_rates_residual_percent = 100 * (p->two_rates_mj / p->published_mj - 1);
  }
}

static void fill_group(const group *g, const reading *r, sf_published_row *row)
{
  double samples = g->ann_mj * 1e9 / (mac_pj * g->macs), mean = 0;
  row[0] = (sf_published_row){.backbone = g->backbone,
                              .data = g->data,
                              .reading = r->name,
                              .macs = g->macs,
                              .real_macs = g->macs,
                              .published_mj = g->ann_mj,
                              .samples = samples,
                              .rate = NAN,
                              .mean_rate = NAN,
                              .first_rate = NAN,
                              .later_rate = NAN,
                              .two_rates_mj = NAN,
                              .two_rates_residual_percent = NAN,
                              .saving_percent = NAN,
                              .published_saving_percent = NAN};
  row[0].recomputed_mj = mac_pj * g->macs * samples * 1e-9;
  for (int i = 0; i < SPIKING_ROWS; i++) {
    sf_published_row *p = &row[i + 1];
    *p = row[0];
    p->beta = g->beta[i], p->steps = g->steps[i], p->published_mj = g->mj[i];
    p->real_macs = r->once + r->per_step * p->steps;
    p->rate = (p->published_mj * 1e9 / samples - mac_pj * p->real_macs) /
              (sop_pj * p->steps * (g->macs - r->once - r->per_step));
    p->saving_percent = 100 * (1 - p->published_mj / g->ann_mj);
    p->published_saving_percent = g->saving[i];
    mean += p->rate / SPIKING_ROWS;
  }
  for (int i = 1; i <= SPIKING_ROWS; i++) {
    sf_published_row *p = &row[i];
    p->mean_rate = mean;
    p->recomputed_mj =
        (mac_pj * p->real_macs + sop_pj * mean * p->steps * (g->macs - r->once - r->per_step)) * samples * 1e-9;
    p->residual_percent = 100 * (p->recomputed_mj / p->published_mj - 1);
  }
  fit_two_rates(row, sop_pj * (g->macs - r->once - r->per_step));
}

int sf_published_rows(sf_published_row rows[SF_PUBLISHED_MAX])
{
  int n = 0;
  for (size_t g = 0; g < sizeof groups / sizeof *groups; g++)
    for (size_t r = 0; r < sizeof readings / sizeof *readings; r++) {
      if (!same(readings[r].backbone, groups[g].backbone)) continue;
      if (readings[r].data && !same(readings[r].data, groups[g].data)) continue;
      fill_group(&groups[g], &readings[r], &rows[n]);
      n += 1 + SPIKING_ROWS;
    }
  return n;
}

static bool possible(double rate)
{
  return rate >= 0 && rate <= 1;
}

void sf_published_print(FILE *out)
{
  sf_published_row rows[SF_PUBLISHED_MAX];
  int n = sf_published_rows(rows);
  fprintf(out,
          "Published energies, recomputed as E = 4.6 pJ R + 0.9 pJ fr T (F - R) per sample, one rate fr per group;\n"
          "then with two rates, one of the first time step and one of the later ones: fr T = first + later (T - 1).\n"
          "The ANN row gives the samples of a view; a group whose rates agree is a reading that fits the paper.\n");
  for (int i = 0; i < n; i++) {
    const sf_published_row *p = &rows[i];
    if (!p->beta) {
      fprintf(out, "\n%s, %s; F = %.0f; %s; %.2f M samples per view; ANN %.5g mJ\n", p->backbone, p->data, p->macs,
              p->reading, p->samples * 1e-6, p->published_mj);
      fprintf(out, "  two rates: first step %.3f, later steps %.3f%s\n", p[1].first_rate, p[1].later_rate,
              possible(p[1].first_rate) && possible(p[1].later_rate) ? "" : ": impossible");
      fprintf(out, "  %-6s %6s %10s %8s %8s %10s %10s %9s %10s %9s %8s\n", "beta", "T", "R", "fr row", "fr mean",
              "paper mJ", "one rate", "residual", "two rates", "residual", "saving");
      continue;
    }
    fprintf(out, "  %-6s %6.3f %10.0f %8.3f %8.3f %10.2f %10.2f %+8.2f%% %10.2f %+8.2f%% %7.2f%%", p->beta, p->steps,
            p->real_macs, p->rate, p->mean_rate, p->published_mj, p->recomputed_mj, p->residual_percent,
            p->two_rates_mj, p->two_rates_residual_percent, p->saving_percent);
    if (!isnan(p->published_saving_percent)) fprintf(out, " (paper %.2f%%)", p->published_saving_percent);
    fprintf(out, "%s\n", possible(p->rate) ? "" : "  impossible rate");
  }
}

cJSON *sf_published_json(void)
{
  sf_published_row rows[SF_PUBLISHED_MAX];
  int n = sf_published_rows(rows);
  cJSON *list = cJSON_CreateArray();
  for (int i = 0; list && i < n; i++) {
    const sf_published_row *p = &rows[i];
    cJSON *row = cJSON_CreateObject();
    cJSON_AddStringToObject(row, "backbone", p->backbone);
    cJSON_AddStringToObject(row, "data", p->data);
    cJSON_AddStringToObject(row, "reading", p->reading);
    cJSON_AddStringToObject(row, "method", p->beta ? p->beta : "ANN");
    sf_json_add_real(row, "steps", p->beta ? p->steps : NAN);
    sf_json_add_real(row, "macs", p->macs);
    sf_json_add_real(row, "real_macs", p->real_macs);
    sf_json_add_real(row, "samples", p->samples);
    sf_json_add_real(row, "rate", p->rate);
    sf_json_add_real(row, "mean_rate", p->mean_rate);
    sf_json_add_real(row, "published_mj", p->published_mj);
    sf_json_add_real(row, "recomputed_mj", p->recomputed_mj);
    sf_json_add_real(row, "residual_percent", p->residual_percent);
    sf_json_add_real(row, "first_rate", p->first_rate);
    sf_json_add_real(row, "later_rate", p->later_rate);
    sf_json_add_real(row, "two_rates_mj", p->two_rates_mj);
    sf_json_add_real(row, "two_rates_residual_percent", p->two_rates_residual_percent);
    sf_json_add_real(row, "saving_percent", p->saving_percent);
    sf_json_add_real(row, "published_saving_percent", p->published_saving_percent);
    cJSON_AddItemToArray(list, row);
  }
  return list;
}
