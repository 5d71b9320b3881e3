/* The paper's tables against what the ledgers make of them. */
#include "ck_run.h"
#include "energy/energy.h"
#include <math.h>

static const sf_published_row *find_row(const sf_published_row *rows, int n, const char *backbone, const char *data,
                                        const char *reading, const char *beta)
{
  for (int i = 0; i < n; i++)
    if (!strcmp(rows[i].backbone, backbone) && !strcmp(rows[i].data, data) && rows[i].beta &&
        !strcmp(rows[i].beta, beta) && !strncmp(rows[i].reading, reading, strlen(reading)))
      return &rows[i];
  ck_abort_msg("no row %s %s %s %s", backbone, data, reading, beta);
  return NULL;
}

/* Rates worked out by hand from the table's printed digits, to 3 places. */
TEST(published_rates)
{
  static const struct {
    const char *backbone, *data, *reading, *beta;
    double rate;
  } wanted[] = {
      {"TensoRF", "Synthetic", "R = 19200", "5e-9", 0.328}, {"TensoRF", "Synthetic", "R = 19200", "5e-8", 0.319},
      {"TensoRF", "Synthetic", "R = 19200", "5e-7", 0.327}, {"TensoRF", "LLFF", "R = 3840", "5e-9", 0.386},
      {"TensoRF", "LLFF", "R = 3840", "5e-8", 0.396},       {"TensoRF", "LLFF", "R = 3840", "5e-7", 0.418},
      {"INGP", "Synthetic", "R = 4096", "1e-7", 0.613},     {"INGP", "Synthetic", "R = 4096", "1e-6", 0.570},
      {"INGP", "Synthetic", "R = 8064", "1e-7", 0.532},     {"INGP", "Synthetic", "R = 8064", "1e-6", 0.316},
  };
  sf_published_row rows[SF_PUBLISHED_MAX];
  int n = sf_published_rows(rows);
  ck_assert_int_le(n, SF_PUBLISHED_MAX);
  for (size_t i = 0; i < sizeof wanted / sizeof *wanted; i++) {
    const sf_published_row *row =
        find_row(rows, n, wanted[i].backbone, wanted[i].data, wanted[i].reading, wanted[i].beta);
    ck_assert_msg(fabs(row->rate - wanted[i].rate) <= 0.0006, "%s %s %s: %f", row->backbone, row->data, row->beta,
                  row->rate);
  }
  /* A net that prices h at every step cannot cost as little as the paper's third INGP row. */
  ck_assert(find_row(rows, n, "INGP", "Synthetic", "R = 6144", "1e-6")->rate < 0);
}

TEST(published_residuals)
{
  sf_published_row rows[SF_PUBLISHED_MAX];
  int n = sf_published_rows(rows), printed = 0;
  ck_assert_int_eq(n, 4 * (3 + 3 + 3 + 1 + 1)); /* an ANN row and three betas per group and reading */
  for (int i = 0; i < n; i++) {
    const sf_published_row *r = &rows[i];
    double residual = 100 * (r->recomputed_mj / r->published_mj - 1);
    ck_assert_double_eq_tol(r->residual_percent, residual, 1e-9);
    if (!r->beta) {
      ck_assert_double_eq_tol(r->residual_percent, 0, 1e-9); /* it defines the samples */
      continue;
    }
    double again =
        (4.6 * r->real_macs + 0.9 * r->rate * r->steps * (r->macs - (r->reading[4] == '6' ? 8064 : r->real_macs))) *
        r->samples * 1e-9;
    ck_assert_double_eq_tol(again, r->published_mj, 1e-9 * r->published_mj); /* the implied rate gives the row back */
    if (!strcmp(r->backbone, "TensoRF"))
      ck_assert_double_le(fabs(r->residual_percent), strcmp(r->data, "LLFF") ? 0.5 : 2.5);
    again = (4.6 * r->real_macs + 0.9 * (r->first_rate + r->later_rate * (r->steps - 1)) *
                                      (r->macs - (r->reading[4] == '6' ? 8064 : r->real_macs))) *
            r->samples * 1e-9;
    ck_assert_double_eq_tol(again, r->two_rates_mj, 1e-9 * again);
    ck_assert_double_eq_tol(r->two_rates_residual_percent, 100 * (again / r->published_mj - 1), 1e-9);
    if (!strcmp(r->backbone, "TensoRF")) { /* the aim: within 1 % */
      ck_assert_double_le(fabs(r->two_rates_residual_percent), 0.4);
      ck_assert(r->first_rate > 0.3 && r->first_rate < 0.5 && r->later_rate > 0.3 && r->later_rate < 0.4);
    }
    if (isnan(r->published_saving_percent)) continue;
    ck_assert_double_le(fabs(r->saving_percent - r->published_saving_percent), 0.006); /* two printed digits */
    printed++;
  }
  ck_assert_int_eq(printed, 9);
  /* least squares: no neighbouring pair of rates does better */
  const sf_published_row *llff = find_row(rows, n, "TensoRF", "LLFF", "R", "5e-9");
  double least = 0;
  for (int i = 0; i < 3; i++) least += pow(llff[i].two_rates_residual_percent, 2);
  for (int k = 0; k < 4; k++) {
    const double first = llff->first_rate + (k == 0 ? 1e-3 : k == 1 ? -1e-3 : 0);
    const double later = llff->later_rate + (k == 2 ? 1e-3 : k == 3 ? -1e-3 : 0);
    double sum = 0;
    for (int i = 0; i < 3; i++) {
      const double mj = (4.6 * 3840 + 0.9 * (first + later * (llff[i].steps - 1)) * 16768) * llff->samples * 1e-9;
      sum += pow(100 * (mj / llff[i].published_mj - 1), 2);
    }
    ck_assert_double_gt(sum, least);
  }
  ck_assert_double_eq_tol(find_row(rows, n, "TensoRF", "Synthetic", "R", "5e-9")->samples, 7.6e6, 0.05e6);
  ck_assert_double_eq_tol(find_row(rows, n, "TensoRF", "LLFF", "R", "5e-9")->samples, 126e6, 0.5e6);
  ck_assert_double_eq_tol(find_row(rows, n, "INGP", "Synthetic", "R", "1e-7")->samples, 7.7e6, 0.05e6);
}
