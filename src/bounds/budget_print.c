#include "bounds/bounds.h"
#include <inttypes.h>
#include <math.h>

static double share(double measured, double bound)
{
  return measured > 0 ? measured / bound : 0;
}

/* A note for every table with both columns. */
static void print_note(FILE *out)
{
  fprintf(out, "\nshare: the largest error over its bound. nearest: the most that any input has of its own bound.\n");
}

void sf_budget_print(FILE *out, const sf_budget_row *row, int rows)
{
  fprintf(out, "%-31s %-17s %8s %9s %6s %8s  %-15s %s\n", "block", "unit", "error", "bound", "share", "nearest",
          "inputs", "where it bites");
  for (int i = 0; i < rows; i++) {
    char inputs[40];
    snprintf(inputs, sizeof inputs, "%s %" PRIu64, row[i].exhaustive ? "all" : "random", row[i].inputs);
    fprintf(out, "%-31s %-17s %8.4g %9.4g %4.0f %% %6.0f %%  %-15s %s\n", row[i].block, row[i].unit, row[i].measured,
            row[i].bound, 100 * share(row[i].measured, row[i].bound), 100 * row[i].ratio, inputs, row[i].bites);
  }
  print_note(out);
}

cJSON *sf_budget_json(const sf_budget_row *row, int rows)
{
  cJSON *array = cJSON_CreateArray();
  for (int i = 0; i < rows; i++) {
    cJSON *item = cJSON_CreateObject();
    cJSON_AddStringToObject(item, "block", row[i].block);
    cJSON_AddStringToObject(item, "unit", row[i].unit);
    cJSON_AddNumberToObject(item, "bound", row[i].bound);
    cJSON_AddNumberToObject(item, "measured", row[i].measured);
    cJSON_AddNumberToObject(item, "of_its_bound", share(row[i].measured, row[i].bound));
    cJSON_AddNumberToObject(item, "nearest", row[i].ratio);
    cJSON_AddBoolToObject(item, "exhaustive", row[i].exhaustive);
    sf_json_add_u64(item, "inputs", row[i].inputs);
    cJSON_AddStringToObject(item, "bites", row[i].bites);
    cJSON_AddItemToArray(array, item);
  }
  return array;
}

static double percent(uint64_t part, uint64_t whole)
{
  return whole ? 100 * (double)part / (double)whole : 0;
}

static void print_currents(FILE *out, const sf_current_row *row)
{
  fprintf(out, "Currents, with weights and inputs rounded: errors in LSB\n\n%-6s %8s %9s %6s %8s %8s %12s\n", "layer",
          "error", "bound", "share", "nearest", "RMS", "currents");
  for (int l = 0; l < SF_LAYERS; l++) {
    if (!row[l].currents) continue;
    fprintf(out, "%-6s %8.4g %9.4g %4.0f %% %6.0f %% %8.3g %12" PRIu64 "\n", fx_layer_name(l), row[l].measured,
            row[l].bound, 100 * share(row[l].measured, row[l].bound), 100 * row[l].ratio, row[l].rms, row[l].currents);
  }
  print_note(out);
}

/* A layer of the net, or one that it does not have. */
static bool decides(const sf_picture_budget *b, int spiking)
{
  return b->row[0].decisions[fx_spiking_layers[spiking]] > 0;
}

static void print_row(FILE *out, const sf_picture_budget *b, const sf_exact_row *r)
{
  char fixed[24] = "equal";
  if (!isinf(r->psnr)) snprintf(fixed, sizeof fixed, "%.2f", r->psnr);
  fprintf(out, "%-36s %8s %8.3f %+7.3f", r->block, fixed, r->psnr_truth, r->psnr_truth - b->row[0].psnr_truth);
  for (int s = 0; s < FX_SPIKING; s++) {
    const int l = fx_spiking_layers[s];
    if (decides(b, s)) fprintf(out, " %7.3f %%", percent(r->flips[l], r->decisions[l]));
  }
  fprintf(out, " %7.3f %%\n", percent(r->sample_flips, r->points));
}

void sf_picture_budget_print(FILE *out, const sf_picture_budget *b)
{
  print_currents(out, b->current);
  fprintf(out,
          "\nOne block at a time in double precision: dB to the fixed core's picture, dB to the photograph, gain in\n"
          "dB, spikes that differ in each layer, samples that the net sees here or in the core alone\n\n"
          "%-36s %8s %8s %7s",
          "block", "fixed", "photo", "gain");
  for (int s = 0; s < FX_SPIKING; s++)
    if (decides(b, s)) fprintf(out, " %9s", fx_layer_name(fx_spiking_layers[s]));
  fprintf(out, " %9s\n", "samples");
  for (int i = 0; i < SF_EXACT_ROWS; i++)
    if (b->row[i].block) print_row(out, b, &b->row[i]);
}

static void add_currents(cJSON *currents, const sf_current_row *row)
{
  for (int l = 0; l < SF_LAYERS; l++) {
    if (!row[l].currents) continue;
    cJSON *item = cJSON_CreateObject();
    cJSON_AddStringToObject(item, "layer", fx_layer_name(l));
    cJSON_AddNumberToObject(item, "bound", row[l].bound);
    cJSON_AddNumberToObject(item, "measured", row[l].measured);
    cJSON_AddNumberToObject(item, "of_its_bound", share(row[l].measured, row[l].bound));
    cJSON_AddNumberToObject(item, "nearest", row[l].ratio);
    cJSON_AddNumberToObject(item, "rms", row[l].rms);
    cJSON_AddItemToArray(currents, item);
  }
}

cJSON *sf_picture_budget_json(const sf_picture_budget *b)
{
  cJSON *json = cJSON_CreateObject();
  sf_json_add_u64(json, "rays", b->rays);
  sf_json_add_u64(json, "samples", b->samples);
  add_currents(cJSON_AddArrayToObject(json, "currents"), b->current);
  cJSON *rows = cJSON_AddArrayToObject(json, "blocks");
  for (int i = 0; i < SF_EXACT_ROWS; i++) {
    const sf_exact_row *r = &b->row[i];
    if (!r->block) continue;
    cJSON *item = cJSON_CreateObject();
    cJSON_AddStringToObject(item, "block", r->block);
    sf_json_add_real(item, "psnr", r->psnr);
    sf_json_add_real(item, "psnr_photograph", r->psnr_truth);
    for (int s = 0; s < FX_SPIKING; s++) {
      const char *const key[] = {"flips_D1", "flips_C1", "flips_C2"};
      const int l = fx_spiking_layers[s];
      if (decides(b, s)) cJSON_AddNumberToObject(item, key[s], percent(r->flips[l], r->decisions[l]) / 100);
    }
    cJSON_AddNumberToObject(item, "flips_samples", percent(r->sample_flips, r->points) / 100);
    cJSON_AddItemToArray(rows, item);
  }
  return json;
}
