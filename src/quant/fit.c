/* Weights of one layer to integers by the error of its currents. With integer inputs x and float currents c,
 *
 *   E(u, q) = mean (c - u q.x)^2 = mean c^2 - 2 u q.B + u^2 q.A q      A = mean x x^T,  B = mean x c
 *
 * so one pass over the calibration rows serves every candidate. First the unit u: rounding of the float weights for
 * each candidate. Then coordinate descent on q, which lets the rounding errors of correlated inputs cancel and takes
 * up the bias of inputs that are rounded down (h = current >> 3). A ridge towards the float weights keeps directions
 * that the samples hardly show where training left them. */
#include "src/quant/internal.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Of the widest: TensoRF's basis matrix, or a layer and its bias. */
enum { BASIS = FX_PAIRS * FX_COMPONENTS_MAX, INPUTS_MAX = BASIS > SF_LANES ? BASIS : SF_LANES + 1 };
enum { CANDIDATES = 40, PATIENCE = 8, SWEEPS = 6 };
static const double STEP = 0.6 / (CANDIDATES - 1), SMALLEST_FACTOR = 0.05, RIDGE = 1e-3;

typedef struct moments {
  int n_in, n_out;
  double *a;     /* [n_in][n_in] */
  double *b;     /* [n_out][n_in] */
  double energy; /* mean of sum c^2 */
} moments;

static void moments_free(moments *m)
{
  free(m->a), free(m->b);
  memset(m, 0, sizeof *m);
}

enum { ROWS = 4 };

/* Rows that are added at once. Those that are not there are zeros. */
typedef struct row_block {
  double x[ROWS][INPUTS_MAX], target[ROWS][SF_LANES];
  int active[INPUTS_MAX], count; /* inputs that are not 0 in at least one row */
} row_block;

static void read_rows(row_block *block, const moments *m, const int16_t *x, const float *target, int rows)
{
  block->count = 0;
  for (int n = 0; n < ROWS; n++)
    for (int o = 0; o < m->n_out; o++) block->target[n][o] = n < rows ? target[n * m->n_out + o] : 0;
  for (int i = 0; i < m->n_in; i++) {
    bool active = false;
    for (int n = 0; n < ROWS; n++) {
      block->x[n][i] = n < rows ? x[n * m->n_in + i] : 0;
      active |= block->x[n][i] != 0;
    }
    if (active) block->active[block->count++] = i;
  }
}

/* a[r] += x_i x_r of all rows; b[o] in the order of the rows. */
static void add_input(moments *m, const row_block *block, int i)
{
  double *restrict a = m->a + (size_t)i * (size_t)m->n_in, *restrict b = m->b + (size_t)i * (size_t)m->n_out;
  const double x0 = block->x[0][i], x1 = block->x[1][i], x2 = block->x[2][i], x3 = block->x[3][i];
  const double *t0 = block->target[0], *t1 = block->target[1], *t2 = block->target[2], *t3 = block->target[3];
  for (int r = i; r < m->n_in; r++)
    a[r] += x0 * block->x[0][r] + x1 * block->x[1][r] + x2 * block->x[2][r] + x3 * block->x[3][r];
  for (int o = 0; o < m->n_out; o++) b[o] = b[o] + x0 * t0[o] + x1 * t1[o] + x2 * t2[o] + x3 * t3[o];
}

/* The sums of `a` are whole numbers below 2^53, so they are exact in any order. Only the half above the diagonal is
 * added up. An input's zeros are added, too, which is faster than to step over them. */
static void add_rows(moments *m, const int16_t *x, const float *target, int rows)
{
  row_block block;
  read_rows(&block, m, x, target, rows);
  for (int p = 0; p < block.count; p++) add_input(m, &block, block.active[p]);
  for (int o = 0; o < rows * m->n_out; o++) m->energy += (double)target[o] * target[o];
}

/* b is gathered input-major above (contiguous in o) and turned here; `a` gets its other half. */
static bool finish(moments *m, int rows)
{
  double *turned = malloc((size_t)m->n_in * (size_t)m->n_out * sizeof *turned);
  if (!turned) return false;
  for (int i = 0; i < m->n_in; i++)
    for (int o = 0; o < m->n_out; o++) turned[o * m->n_in + i] = m->b[i * m->n_out + o] / rows;
  for (int i = 0; i < m->n_in; i++)
    for (int r = i; r < m->n_in; r++) m->a[r * m->n_in + i] = m->a[i * m->n_in + r] /= rows;
  m->energy /= rows;
  free(m->b);
  m->b = turned;
  return true;
}

/* Rows begin..end-1: the last quarter of the samples is held out of the fit, for the report. */
static sf_status gather(moments *m, const sf_fit_data *data, int begin, int end)
{
  const size_t n_in = (size_t)data->n_in, n_out = (size_t)data->n_out;
  *m = (moments){.n_in = data->n_in,
                 .n_out = data->n_out,
                 .a = calloc(n_in * n_in, sizeof(double)),
                 .b = calloc(n_in * n_out, sizeof(double))};
  bool ok = m->a && m->b;
  if (ok)
    for (int row = begin; row < end; row += ROWS)
      add_rows(m, data->x + (size_t)row * n_in, data->target + (size_t)row * n_out,
               end - row < ROWS ? end - row : ROWS);
  ok = ok && finish(m, end - begin);
  if (ok) return sf_ok();
  moments_free(m);
  return sf_fail(SF_E_MEMORY, "quantiser: no memory for a layer of %d x %d weights", data->n_in, data->n_out);
}

static double ideal(const sf_fit_weights *weights, int i, int o, double unit)
{
  return weights->w[(size_t)o * (size_t)weights->stride + (size_t)i] * weights->lsb[i] / unit;
}

static double clip(double q, int limit)
{
  return q > limit ? limit : q < -limit ? -limit : q;
}

static void round_column(const sf_fit_weights *weights, int n_in, int o, double unit, double *q)
{
  for (int i = 0; i < n_in; i++) q[i] = clip(nearbyint(ideal(weights, i, o, unit)), weights->weight_max);
}

/* y += A q. A is symmetric, so its rows are added: every number of y has the order of its own sum, and none waits for
 * the one before. */
static void add_product(const moments *m, const double *restrict q, double *restrict y)
{
  for (int r = 0; r < m->n_in; r++) {
    const double *row = m->a + (size_t)r * (size_t)m->n_in, weight = q[r];
    if (weight == 0) continue;
    for (int i = 0; i < m->n_in; i++) y[i] += row[i] * weight;
  }
}

static double column_error(const moments *m, int o, double unit, const double *q)
{
  double linear = 0, square = 0, product[INPUTS_MAX] = {0};
  add_product(m, q, product);
  for (int i = 0; i < m->n_in; i++) {
    square += q[i] * product[i];
    linear += q[i] * m->b[o * m->n_in + i];
  }
  return unit * (unit * square - 2 * linear);
}

static double rounding_error(const moments *m, const sf_fit_weights *weights, double unit)
{
  double q[INPUTS_MAX], error = m->energy;
  for (int o = 0; o < m->n_out; o++) {
    round_column(weights, m->n_in, o, unit, q);
    error += column_error(m, o, unit, q);
  }
  return error;
}

static double largest_product(const sf_fit_weights *weights, int n_in, int n_out)
{
  double largest = 0;
  for (int o = 0; o < n_out; o++)
    for (int i = 0; i < n_in; i++) largest = fmax(largest, fabs(ideal(weights, i, o, 1)));
  return largest;
}

/* From the unit that clips nothing down: CANDIDATES of them, and on as long as one of the last few was the best (few
 * bits gain from clipping more). */
static double choose_unit(const moments *m, const sf_fit_weights *weights)
{
  const double widest = largest_product(weights, m->n_in, m->n_out) / weights->weight_max;
  if (widest <= weights->unit_min) return weights->unit_min;
  double best = widest, best_error = INFINITY;
  for (int c = 0, last = CANDIDATES - 1; c <= last && 1 - STEP * c >= SMALLEST_FACTOR; c++) {
    const double factor = 1 - STEP * c;
    const double unit = fmax(widest * factor, weights->unit_min), error = rounding_error(m, weights, unit);
    if (error >= best_error) continue;
    best = unit, best_error = error;
    if (last < c + PATIENCE) last = c + PATIENCE;
  }
  return best;
}

static void descend_column(const moments *m, const sf_fit_weights *weights, int o, double unit, double ridge, double *q)
{
  double gradient[INPUTS_MAX];
  for (int i = 0; i < m->n_in; i++)
    gradient[i] = ridge * (q[i] - ideal(weights, i, o, unit)) - m->b[o * m->n_in + i] / unit;
  add_product(m, q, gradient);
  for (int sweep = 0, changed = 1; sweep < SWEEPS && changed; sweep++) {
    changed = 0;
    for (int i = 0; i < m->n_in; i++) {
      const double curvature = m->a[i * m->n_in + i] + ridge;
      if (curvature <= 0) continue;
      const double step = clip(nearbyint(q[i] - gradient[i] / curvature), weights->weight_max) - q[i];
      if (step == 0) continue;
      for (int r = 0; r < m->n_in; r++) gradient[r] += m->a[i * m->n_in + r] * step;
      gradient[i] += ridge * step;
      q[i] += step;
      changed = 1;
    }
  }
}

static double mean_diagonal(const moments *m)
{
  double sum = 0;
  for (int i = 0; i < m->n_in; i++) sum += m->a[i * m->n_in + i];
  return sum / m->n_in;
}

static double quantise_columns(const moments *m, const moments *held_out, const sf_fit_weights *weights, bool refine,
                               int8_t *w, sf_quant_layer *result)
{
  const double ridge = RIDGE * mean_diagonal(m);
  double error = held_out->energy, q[INPUTS_MAX];
  for (int o = 0; o < m->n_out; o++) {
    round_column(weights, m->n_in, o, result->unit, q);
    if (refine) descend_column(m, weights, o, result->unit, ridge, q);
    error += column_error(held_out, o, result->unit, q);
    for (int i = 0; i < m->n_in; i++) {
      w[i * SF_LANES + o] = (int8_t)q[i];
      result->clipped += fabs(ideal(weights, i, o, result->unit)) > weights->weight_max + 0.5;
    }
  }
  return error;
}

sf_status sf_fit_layer(const sf_fit_data *data, const sf_fit_weights *weights, bool refine, int8_t *q,
                       sf_quant_layer *result)
{
  const int fit_rows = data->rows - data->rows / 4;
  moments fit, held_out;
  *result = (sf_quant_layer){0};
  SF_TRY(gather(&fit, data, 0, fit_rows));
  sf_status status = gather(&held_out, data, fit_rows, data->rows);
  if (status.code == SF_OK) {
    result->unit = weights->unit > 0 ? weights->unit : choose_unit(&fit, weights);
    const double error = quantise_columns(&fit, &held_out, weights, refine && !(weights->unit > 0), q, result);
    result->error = held_out.energy > 0 ? sqrt(fmax(error, 0) / held_out.energy) : 0;
    moments_free(&held_out);
  }
  moments_free(&fit);
  return status;
}
