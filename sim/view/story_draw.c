/* A ray's story as drawings. */
#include "sim/view/internal.h"
#include "page/draw.h"
#include "quant/quant.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Values of a drawing: [columns] of each row. */
typedef struct table {
  double *x, *y[6];
} table;

static bool open_table(table *t, int columns)
{
  double *space = malloc((size_t)(columns > 0 ? columns : 1) * 7 * sizeof *space);
  t->x = space;
  for (int i = 0; i < 6; i++) t->y[i] = space ? space + (size_t)columns * (size_t)(i + 1) : NULL;
  return space != NULL;
}

static sf_status add_drawing(cJSON *to, const char *key, FILE *out, char **text)
{
  const bool whole = out && !ferror(out) && !fclose(out);
  if (whole) cJSON_AddStringToObject(to, key, *text);
  free(*text);
  return whole ? sf_ok() : sf_fail(SF_E_MEMORY, "no memory for a drawing");
}

/* ---- along the ray ---- */

static void fill_along(const sf_story *s, table *t)
{
  for (int i = 0; i < s->count; i++) {
    const sf_story_sample *p = &s->sample[i];
    t->x[i] = i;
    t->y[0][i] = sf_fx_sigma_value(s->scene, p->sigma);
    t->y[1][i] = p->weight / 1048576.0;
    t->y[2][i] = p->left / 1048576.0;
    t->y[3][i] = p->decoded ? (double)sf_cost_fj(&p->cost) / 1e6 : NAN;
    t->y[4][i] = p->decoded ? (double)p->cost.spikes : NAN;
  }
}

/* The samples' colours, as far as each is seen, and below them unshaded. */
static void colour_strip(FILE *out, const sf_story *s)
{
  uint8_t *rgb = malloc((size_t)s->count * 6);
  if (!rgb) return;
  for (int i = 0; i < s->count; i++)
    for (int c = 0; c < 3; c++) {
      const double value = 255 * fmin(1, sf_fx_colour_value(s->sample[i].colour[c]));
      const double most = 1048576.0, seen = fmin(1, 8 * s->sample[i].weight / most);
      rgb[3 * i + c] = (uint8_t)(seen * value + 0.5);
      rgb[3 * (s->count + i) + c] = (uint8_t)(value + 0.5);
    }
  (void)html_put_png(out, rgb, s->count, 2, NULL, 0,
                     "Colours of the samples, front to back: by their weight, and plain");
  free(rgb);
}

static sf_status draw_along(const sf_story *s, int sample, cJSON *to)
{
  char *text = NULL;
  size_t size;
  table t;
  if (!open_table(&t, s->count)) return sf_fail(SF_E_MEMORY, "no memory for a drawing");
  fill_along(s, &t);
  const html_axis axis = {t.x, s->count, "sample, front to back", sample};
  const html_row row[] = {{"Density", "per unit", "l0", t.y[0], false, 0, 0},
                          {"Weight in the pixel", "", "l2", t.y[1], true, 0, 0},
                          {"Transmittance left", "", "l3", t.y[2], false, 0, 1},
                          {"Energy of the sample (paper ledger)", "nJ", "l1", t.y[3], true, 0, 0},
                          {"Spikes of the sample", "", "l4", t.y[4], true, 0, 0}};
  FILE *out = open_memstream(&text, &size);
  if (out) {
    html_rows(out, "svg-along", "Along the ray", &axis, row, sizeof row / sizeof *row);
    if (s->count > 0) colour_strip(out, s);
  }
  free(t.x);
  return add_drawing(to, "along", out, &text);
}

/* ---- spikes ---- */

/* Columns: samples that went through the nets, each with its steps; rows: neurons. */
static sf_status draw_raster(const sf_story *s, int layer, int decoded, cJSON *to)
{
  static const uint8_t palette[] = {0, 0, 0, 0, 128, 128, 128, 40, 43, 133, 194, 255};
  const int steps = s->scene->net.steps, rows = s->scene->net.layer[layer].n_out, columns = decoded * steps;
  char *text = NULL, name[24], alt[80];
  size_t size;
  if (rows == 0 || columns == 0) return sf_ok();
  uint8_t *pixel = calloc((size_t)columns * (size_t)rows, 1);
  FILE *out = pixel ? open_memstream(&text, &size) : NULL;
  for (int i = 0, column = 0; out && i < s->count; i++)
    for (int t = 0; t < steps && s->sample[i].decoded; t++, column++)
      for (int o = 0; o < rows; o++)
        pixel[(size_t)o * (size_t)columns + (size_t)column] =
            s->sample[i].spikes[layer][t][o / 64] >> o % 64 & 1 ? 2 : t == 0;
  snprintf(alt, sizeof alt, "Spikes of %s: neurons from top to bottom, samples and steps from left to right",
           fx_layer_name(layer));
  if (out) (void)html_put_png(out, pixel, columns, rows, palette, 3, alt);
  free(pixel);
  snprintf(name, sizeof name, "raster-%s", fx_layer_name(layer));
  return add_drawing(to, name, out, &text);
}

/* ---- one neuron ---- */

static int fill_neuron(const sf_story *s, int sample, table *t, int *mark)
{
  int n = 0;
  *mark = -1;
  for (int i = 0; i < s->count; i++)
    for (int step = 0; step < s->scene->net.steps && s->sample[i].decoded; step++, n++) {
      const sf_story_sample *p = &s->sample[i];
      if (i == sample && step == 0) *mark = n;
      t->x[n] = i + (double)step / s->scene->net.steps;
      t->y[0][n] = p->current[step], t->y[1][n] = p->membrane[step];
      t->y[2][n] = (double)(p->spikes[s->layer][step][s->neuron / 64] >> s->neuron % 64 & 1);
    }
  return n;
}

static sf_status draw_neuron(const sf_story *s, int sample, cJSON *to)
{
  char *text = NULL, title[96], membrane[96];
  size_t size;
  table t;
  int mark;
  const bool fires = fx_layer_fires(s->layer);
  if (!open_table(&t, s->count * s->scene->net.steps)) return sf_fail(SF_E_MEMORY, "no memory for a drawing");
  const int n = fill_neuron(s, sample, &t, &mark);
  snprintf(title, sizeof title, "Neuron %d of %s", s->neuron, fx_layer_name(s->layer));
  if (fires)
    snprintf(membrane, sizeof membrane, "Membrane, threshold %" PRId32, fx_net_theta(&s->scene->net, s->layer));
  else
    snprintf(membrane, sizeof membrane, "Accumulator");
  const html_axis axis = {t.x, n, "sample, with its steps", mark};
  const html_row row[] = {{"Current", "", "l0", t.y[0], false, 0, 0},
                          {membrane, "", "l2", t.y[1], false, 0, 0},
                          {"Spikes", "", "l3", t.y[2], true, 0, 1}};
  FILE *out = open_memstream(&text, &size);
  if (out) html_rows(out, "svg-neuron", title, &axis, row, fires ? 3 : 2);
  free(t.x);
  return add_drawing(to, "neuron", out, &text);
}

sf_status sf_story_draw(const sf_story *s, int sample, cJSON *to)
{
  int decoded = 0;
  for (int i = 0; i < s->count; i++) decoded += s->sample[i].decoded;
  SF_TRY(draw_along(s, sample, to));
  for (int l = 0; l < SF_LAYERS; l++)
    if (fx_layer_fires(l)) SF_TRY(draw_raster(s, l, decoded, to));
  return draw_neuron(s, sample, to);
}
