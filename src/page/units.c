/* What one event costs in each ledger: the effective prices, the widths and memories that they come from. */
#include "page/internal.h"
#include <stdlib.h>
#include <string.h>

/* How the price of an event came about; widths as in docs/energy.md. */
static void width_basis(FILE *out, const fx_net *net, int row, int part)
{
  switch (part) {
  case SF_PART_MAC:
    if (row < SF_LAYERS && !fx_layer_reads_spikes(row))
      fprintf(out, "%d \xc3\x97 %d bits, sum of %d; ", SF_INPUT_BITS, SF_WEIGHT_BITS,
              sf_sum_bits(&net->layer[row], true));
    fprintf(out, "twin 8 \xc3\x97 %d, sum of 32", SF_WEIGHT_BITS);
    break;
  case SF_PART_SOP:
    fprintf(out, "sum of %d bits", sf_sum_bits(&net->layer[row], false));
    break;
  case SF_PART_NEURON:
    fprintf(out, "%s%s of %d bits; twin: 32 \xc3\x97 16 bits and an addition of 32",
            net->mode == FX_RADIX ? (fx_layer_fires(row) ? "compare, reset" : "addition") : "leak",
            net->mode == FX_RADIX ? ""
            : fx_layer_fires(row) ? ", compare, reset"
                                  : " of an integrator",
            fx_layer_state_bits(row, net->mode));
    break;
  default:
    fprintf(out, "two products, two additions and two reads of a table of 1028 bytes");
  }
}

static void memory(FILE *out, const sf_technology *t, uint64_t bytes)
{
  uint64_t largest = 0;
  char text[HTML_NUMBER];
  for (int i = 0; i < t->count; i++)
    if (!strncmp(t->price[i].key, "sram.", 5) && t->price[i].at > largest) largest = t->price[i].at;
  fprintf(out, "%s of %s bytes", bytes > largest ? "DRAM, for a table" : "SRAM", html_count(text, bytes));
}

static void basis(FILE *out, const sf_page *page, int row, int part)
{
  const fx_net *net = page->report->net;
  const sf_technology *t = &page->report->ledgers.technology;
  char text[HTML_NUMBER];
  uint64_t measured;
  if (sf_operation_measured(t, false, row, part, &measured) && (row < SF_LAYERS || part == SF_PART_SPECIAL)) {
    fprintf(out, "measured from a netlist%s",
            part == SF_PART_NEURON ? "; twin: 32 \xc3\x97 16 bits and an addition of 32" : "");
  } else if (part == SF_PART_FRAME) {
    fprintf(out, "64 bits to DRAM");
  } else if (part == SF_PART_LOOKUP) {
    memory(out, t, (uint64_t)page->report->cache.bytes);
    if (sf_price_measured(t, SF_PRICE_TAG_LOOKUP, &measured)) fprintf(out, "; tags measured from a netlist");
  } else if (part == SF_PART_FILL) {
    fprintf(out, "%d words of 64 bits from DRAM into the cache; tables of %s bytes", FX_LINE / 8,
            html_count(text, sf_table_size(page->scene)));
  } else if (part == SF_PART_WEIGHT) {
    fprintf(out, "%s words of 64 bits; ", html_count(text, sf_row_accesses(&net->layer[row])));
    memory(out, t, sf_weights_size(&net->layer[row]));
  } else if (part == SF_PART_STATE) {
    fprintf(out, "register file, %d bits; twin 8", fx_layer_state_bits(row, net->mode));
  } else if (part == SF_PART_PRODUCT) {
    fprintf(out,
            row == SF_ROW_RAY ? "compositing of a sample: six products, six sums" : "17 \xc3\x97 8 bits, sum of 24");
  } else if (part == SF_PART_PLACE) {
    fprintf(out, row == SF_ROW_RAY ? "16 harmonics: 38 products, 9 sums" : "cell, weights and addresses");
  } else {
    width_basis(out, net, row, part);
  }
}

/* Whether any event of this kind was counted, in the net or in its twin. */
static bool counted(const sf_page *page, int row, int part)
{
  const sf_ledgers *l = &page->report->ledgers;
  const fx_counts *c = &page->report->measure.core;
  if (l->unit[SF_LEDGER_NEURON][row][part].fj == 0 && l->unit[SF_LEDGER_INT_ALL][row][part].fj == 0) return false;
  if (row >= SF_LAYERS) return true;
  if (part == SF_PART_SOP) return fx_layer_reads_spikes(row);
  if (part == SF_PART_SPECIAL) return row == FX_C3 || (row == FX_D2 && c->layer[row].updates[0] > 0);
  return true;
}

/* The layers of spikes have no MAC, the twin has no SOP and keeps nothing of its output. */
static bool happens(int ledger, int row, int part)
{
  const bool of_spikes = row < SF_LAYERS && fx_layer_reads_spikes(row);
  if (ledger < SF_SPIKING_LEDGERS) return part != SF_PART_MAC || !of_spikes;
  return part != SF_PART_SOP && (row != FX_C3 || (part != SF_PART_STATE && part != SF_PART_NEURON));
}

/* The ledgers of the columns: paper, its twin, the others, their twin. */
static cJSON *ledgers_json(const sf_page *page, int row, int part)
{
  static const int column[] = {SF_LEDGER_PAPER, SF_LEDGER_ANN, SF_LEDGER_NEURON, SF_LEDGER_INT_ALL};
  cJSON *list = cJSON_CreateArray();
  for (int i = 0; i < 4; i++) {
    const sf_unit_price *u = &page->report->ledgers.unit[column[i]][row][part];
    const bool shown = u->fj > 0 && happens(column[i], row, part);
    cJSON *unit = cJSON_CreateObject();
    cJSON_AddItemToObject(unit, "list", shown ? cJSON_CreateNumber(column[i]) : cJSON_CreateNull());
    cJSON_AddBoolToObject(unit, "interpolated", u->interpolated);
    cJSON_AddItemToArray(list, unit);
  }
  return list;
}

static cJSON *unit_json(const sf_page *page, int row, int part)
{
  cJSON *unit = cJSON_CreateObject();
  char *text = NULL;
  size_t size;
  FILE *out = open_memstream(&text, &size);
  cJSON_AddStringToObject(unit, "part", sf_part_names[part]);
  cJSON_AddNumberToObject(unit, "row", row);
  cJSON_AddItemToObject(unit, "ledgers", ledgers_json(page, row, part));
  if (out) basis(out, page, row, part);
  if (out && fclose(out) == 0) cJSON_AddStringToObject(unit, "basis", text);
  free(text);
  return unit;
}

void html_add_units(cJSON *json, const sf_page *page)
{
  cJSON *list = cJSON_AddArrayToObject(json, "units");
  for (int p = 0; p < SF_PARTS; p++)
    for (int r = 0; r < SF_ROWS; r++)
      if (counted(page, r, p)) cJSON_AddItemToArray(list, unit_json(page, r, p));
}
