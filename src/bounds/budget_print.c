#include "bounds/bounds.h"
#include <inttypes.h>
#include <math.h>

void sf_budget_print(FILE *out, const sf_budget_row *row, int rows)
{
  fprintf(out, "| block | unit | bound | measured | of its bound | inputs | where it bites |\n");
  fprintf(out, "|---|---|---|---|---|---|---|\n");
  for (int i = 0; i < rows; i++)
    fprintf(out, "| %s | %s | %.4g | %.4g | %.0f %% | %s %" PRIu64 " | %s |\n", row[i].block, row[i].unit, row[i].bound,
            row[i].measured, 100 * row[i].ratio, row[i].exhaustive ? "all" : "random", row[i].inputs, row[i].bites);
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
    cJSON_AddNumberToObject(item, "of_its_bound", row[i].ratio);
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

static const int spiking[] = {0, 2, 3}; /* D1, C1, C2 */

void sf_picture_budget_print(FILE *out, const sf_picture_budget *b)
{
  fprintf(out, "| currents: weights and inputs rounded | bound, LSB | measured | of its bound | RMS | currents |\n");
  fprintf(out, "|---|---|---|---|---|---|\n");
  for (int l = 0; l < SF_LAYERS; l++)
    fprintf(out, "| %s | %.4g | %.4g | %.0f %% | %.3g | %" PRIu64 " |\n", fx_layer_name(l), b->current[l].bound,
            b->current[l].measured, 100 * b->current[l].ratio, b->current[l].rms, b->current[l].currents);
  fprintf(out, "\n| in double precision | dB to fixed | dB to photograph | gain, dB | flips D1 | C1 | C2 |\n");
  fprintf(out, "|---|---|---|---|---|---|---|\n");
  for (int i = 0; i < SF_EXACT_ROWS; i++) {
    const sf_exact_row *r = &b->row[i];
    fprintf(out, "| %s | ", r->block);
    fprintf(out, isinf(r->psnr) ? "equal" : "%.2f", r->psnr);
    fprintf(out, " | %.3f | %+.3f |", r->psnr_truth, r->psnr_truth - b->row[0].psnr_truth);
    for (int s = 0; s < 3; s++) fprintf(out, " %.3f %% |", percent(r->flips[spiking[s]], r->decisions[spiking[s]]));
    fprintf(out, "\n");
  }
}

static void add_finite(cJSON *object, const char *key, double value)
{
  if (isfinite(value))
    cJSON_AddNumberToObject(object, key, value);
  else
    cJSON_AddNullToObject(object, key);
}

cJSON *sf_picture_budget_json(const sf_picture_budget *b)
{
  cJSON *json = cJSON_CreateObject();
  sf_json_add_u64(json, "rays", b->rays);
  sf_json_add_u64(json, "samples", b->samples);
  cJSON *currents = cJSON_AddArrayToObject(json, "currents"), *rows = cJSON_AddArrayToObject(json, "blocks");
  for (int l = 0; l < SF_LAYERS; l++) {
    cJSON *item = cJSON_CreateObject();
    cJSON_AddStringToObject(item, "layer", fx_layer_name(l));
    cJSON_AddNumberToObject(item, "bound", b->current[l].bound);
    cJSON_AddNumberToObject(item, "measured", b->current[l].measured);
    cJSON_AddNumberToObject(item, "of_its_bound", b->current[l].ratio);
    cJSON_AddNumberToObject(item, "rms", b->current[l].rms);
    cJSON_AddItemToArray(currents, item);
  }
  for (int i = 0; i < SF_EXACT_ROWS; i++) {
    const sf_exact_row *r = &b->row[i];
    cJSON *item = cJSON_CreateObject();
    cJSON_AddStringToObject(item, "block", r->block);
    add_finite(item, "psnr", r->psnr);
    add_finite(item, "psnr_photograph", r->psnr_truth);
    for (int s = 0; s < 3; s++) {
      const char *const key[] = {"flips_D1", "flips_C1", "flips_C2"};
      cJSON_AddNumberToObject(item, key[s], percent(r->flips[spiking[s]], r->decisions[spiking[s]]) / 100);
    }
    cJSON_AddItemToArray(rows, item);
  }
  return json;
}
