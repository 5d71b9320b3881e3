/* The ledgers as text and JSON. */
#include "energy/energy.h"
#include <inttypes.h>
#include <math.h>

static double mj(uint64_t fj, double views)
{
  return views > 0 ? (double)fj * 1e-12 / views : 0;
}

static void print_percent(FILE *out, double percent)
{
  if (isnan(percent))
    fprintf(out, " %9s", "-");
  else
    fprintf(out, " %8.2f%%", percent);
}

static void print_table(FILE *out, const sf_ledgers *l, double views)
{
  fprintf(out, "What it costs under five sets of assumptions, each beside a ReLU twin priced in the same way (%s):\n",
          l->technology.title);
  fprintf(out, "  %-17s %13s   %-21s %13s %9s\n", "ledger", "mJ per view", "twin", "mJ per view", "saving");
  for (int g = 0; g < SF_SPIKING_LEDGERS; g++) {
    const int twin = sf_ledger_texts[g].baseline;
    fprintf(out, "  %-17s %13.6g%s  %-21s %13.6g%s", sf_ledger_texts[g].title, mj(l->total[g], views),
            l->interpolated[g] ? "*" : " ", sf_ledger_texts[twin].title, mj(l->total[twin], views),
            l->interpolated[twin] ? "*" : " ");
    print_percent(out, l->saving[g]);
    fprintf(out, "\n");
  }
  for (int g = 0; g < SF_LEDGERS; g++)
    fprintf(out, "  %-21s %s\n", sf_ledger_texts[g].title, sf_ledger_texts[g].meaning);
  fprintf(out, "  * with prices for widths or sizes between those of the technology file, interpolated\n");
}

static void print_parts(FILE *out, const sf_ledgers *l, double views)
{
  fprintf(out, "\nWhat the energy of the ledger with everything goes into, mJ per view:\n  %-23s %13s %9s %19s\n", "",
          "spiking net", "share", "ReLU twin, all");
  for (int p = 0; p < SF_PARTS; p++) {
    const uint64_t a = l->part[SF_LEDGER_NEURON][p], b = l->part[SF_LEDGER_INT_ALL][p];
    const uint64_t all = l->total[SF_LEDGER_NEURON];
    fprintf(out, "  %-23s %13.6g %8.2f%% %19.6g\n", sf_part_titles[p], mj(a, views),
            all ? 100 * (double)a / (double)all : 0, mj(b, views));
  }
}

static void print_break_even(FILE *out, const sf_ledgers *l)
{
  fprintf(out, "\nFiring rate at which the spiking net costs what its twin does (measured: %.2f%%):\n", 100 * l->rate);
  for (int i = 0; i < SF_OWN_BREAK_EVENS; i++) {
    const sf_break_even *b = &l->break_even[i];
    fprintf(out, "  %-17s against %-21s ", sf_ledger_texts[b->ledger].title, sf_ledger_texts[b->twin].title);
    if (isnan(b->rate))
      fprintf(out, "%s\n", l->rate > 0 ? "none: dearer even if no neuron fired" : "none: no neuron fired");
    else if (b->rate > 1)
      fprintf(out, "none: cheaper even if every neuron fired at every step\n");
    else
      fprintf(out, "%.2f%%\n", 100 * b->rate);
  }
}

static void print_sensitivity(FILE *out, const sf_ledgers *l)
{
  fprintf(out,
          "\nWhat a price that is wrong by half does to a saving, largest first (%% saved at -50%% and +50%%):\n"
          "  %-17s %13s",
          "price", "");
  for (int g = 0; g < SF_SPIKING_LEDGERS; g++) fprintf(out, " %17s", sf_ledger_texts[g].title);
  fprintf(out, "\n");
  for (int i = 0; i < l->sensitivities; i++) {
    const sf_sensitivity *s = &l->sensitivity[i];
    const sf_price *price = &l->technology.price[s->price];
    fprintf(out, "  %-17s %13s", price->key, price->text);
    for (int g = 0; g < SF_SPIKING_LEDGERS; g++) {
      if (s->less[g] == s->more[g] || isnan(s->less[g]))
        fprintf(out, " %17s", "-");
      else
        fprintf(out, " %8.2f %8.2f", s->less[g], s->more[g]);
    }
    fprintf(out, "\n");
  }
}

static void print_prices(FILE *out, const sf_technology *t)
{
  fprintf(out, "\nPrices (%s; memories per access of 64 bits):\n", t->path);
  for (int i = 0; i < t->count; i++)
    fprintf(out, "  %-17s %13s   %s\n", t->price[i].key, t->price[i].text, t->price[i].source);
}

void sf_ledgers_print(FILE *out, const sf_ledgers *ledgers, double views)
{
  print_table(out, ledgers, views);
  print_parts(out, ledgers, views);
  print_break_even(out, ledgers);
  print_sensitivity(out, ledgers);
  print_prices(out, &ledgers->technology);
}

/* ---- JSON ---- */

static cJSON *technology_json(const sf_technology *t)
{
  cJSON *json = cJSON_CreateObject();
  sf_json_add_text(json, "name", t->name);
  sf_json_add_text(json, "title", t->title);
  cJSON *list = cJSON_AddArrayToObject(json, "prices");
  for (int i = 0; i < t->count; i++) {
    cJSON *price = cJSON_CreateObject();
    cJSON_AddStringToObject(price, "key", t->price[i].key);
    sf_json_add_u64(price, "fj", t->price[i].fj);
    sf_json_add_text(price, "text", t->price[i].text);
    sf_json_add_text(price, "source", t->price[i].source);
    cJSON_AddItemToArray(list, price);
  }
  return json;
}

static cJSON *cells_json(const sf_ledgers *l, int ledger, int row)
{
  cJSON *list = cJSON_CreateArray();
  const int steps = row < SF_LAYERS ? l->steps : 1;
  for (int t = 0; t < steps; t++) {
    char digits[24];
    snprintf(digits, sizeof digits, "%" PRIu64, l->cell[ledger][row][t]);
    cJSON_AddItemToArray(list, cJSON_CreateRaw(digits));
  }
  return list;
}

static void add_units(cJSON *json, const sf_ledgers *l, int ledger, int row)
{
  cJSON *units = cJSON_AddObjectToObject(json, "unit_fj");
  for (int p = 0; p < SF_PARTS; p++)
    if (l->unit[ledger][row][p].fj > 0) sf_json_add_u64(units, sf_part_names[p], l->unit[ledger][row][p].fj);
}

static cJSON *ledger_json(const sf_ledgers *l, int ledger, double views)
{
  const sf_ledger_text *text = &sf_ledger_texts[ledger];
  cJSON *json = cJSON_CreateObject();
  cJSON_AddStringToObject(json, "key", text->key);
  cJSON_AddStringToObject(json, "title", text->title);
  cJSON_AddStringToObject(json, "meaning", text->meaning);
  sf_json_add_u64(json, "total_fj", l->total[ledger]);
  cJSON_AddNumberToObject(json, "mj_per_view", mj(l->total[ledger], views));
  if (text->baseline >= 0)
    cJSON_AddStringToObject(json, "baseline", sf_ledger_texts[text->baseline].key);
  else
    cJSON_AddNullToObject(json, "baseline");
  sf_json_add_real(json, "saving_percent", l->saving[ledger]);
  cJSON_AddBoolToObject(json, "interpolated", l->interpolated[ledger]);
  cJSON *parts = cJSON_AddObjectToObject(json, "parts_fj");
  for (int p = 0; p < SF_PARTS; p++) sf_json_add_u64(parts, sf_part_names[p], l->part[ledger][p]);
  cJSON *rows = cJSON_AddArrayToObject(json, "rows");
  for (int r = 0; r < SF_ROWS; r++) {
    cJSON *row = cJSON_CreateObject();
    cJSON_AddStringToObject(row, "name", sf_row_name(r));
    cJSON_AddItemToObject(row, "fj", cells_json(l, ledger, r));
    add_units(row, l, ledger, r);
    cJSON_AddItemToArray(rows, row);
  }
  return json;
}

static cJSON *break_even_json(const sf_ledgers *l)
{
  cJSON *list = cJSON_CreateArray();
  for (int i = 0; i < SF_BREAK_EVENS; i++) {
    cJSON *item = cJSON_CreateObject();
    cJSON_AddStringToObject(item, "ledger", sf_ledger_texts[l->break_even[i].ledger].key);
    cJSON_AddStringToObject(item, "twin", sf_ledger_texts[l->break_even[i].twin].key);
    sf_json_add_real(item, "firing_rate", l->break_even[i].rate);
    cJSON_AddItemToArray(list, item);
  }
  return list;
}

static cJSON *sensitivity_json(const sf_ledgers *l)
{
  cJSON *list = cJSON_CreateArray();
  for (int i = 0; i < l->sensitivities; i++) {
    const sf_sensitivity *s = &l->sensitivity[i];
    cJSON *item = cJSON_CreateObject();
    cJSON_AddStringToObject(item, "price", l->technology.price[s->price].key);
    cJSON_AddNumberToObject(item, "swing_points", s->swing);
    cJSON_AddStringToObject(item, "of_ledger", sf_ledger_texts[s->ledger].key);
    cJSON *savings = cJSON_AddObjectToObject(item, "saving_percent");
    for (int g = 0; g < SF_SPIKING_LEDGERS; g++) {
      cJSON *pair = cJSON_AddObjectToObject(savings, sf_ledger_texts[g].key);
      sf_json_add_real(pair, "less", s->less[g]);
      sf_json_add_real(pair, "more", s->more[g]);
    }
    cJSON_AddItemToArray(list, item);
  }
  return list;
}

cJSON *sf_ledgers_json(const sf_ledgers *ledgers, double views)
{
  cJSON *json = cJSON_CreateObject();
  cJSON_AddItemToObject(json, "technology", technology_json(&ledgers->technology));
  cJSON *list = cJSON_AddArrayToObject(json, "list");
  for (int g = 0; g < SF_LEDGERS; g++) cJSON_AddItemToArray(list, ledger_json(ledgers, g, views));
  cJSON_AddNumberToObject(json, "firing_rate", ledgers->rate);
  cJSON_AddItemToObject(json, "break_even", break_even_json(ledgers));
  cJSON_AddItemToObject(json, "sensitivity", sensitivity_json(ledgers));
  return json;
}
