/* A comparison of two audits as text. */
#include "energy/energy.h"
#include <math.h>

static void print_value(FILE *out, const cJSON *value)
{
  if (cJSON_IsString(value))
    fprintf(out, "%s", value->valuestring);
  else if (cJSON_IsNumber(value))
    fprintf(out, "%.10g", value->valuedouble);
  else
    fprintf(out, "-");
}

static void print_percent(FILE *out, const cJSON *item, const char *key)
{
  const double percent = sf_json_number(item, key);
  if (isnan(percent))
    fprintf(out, " %10s", "-");
  else
    fprintf(out, " %+9.2f%%", percent);
}

enum { MOST = 16 }; /* changes that are shown */

static void print_changes(FILE *out, const cJSON *list, const char *title, int most)
{
  const int count = cJSON_GetArraySize(list);
  fprintf(out, "%s%s\n", title, count ? "" : ": none");
  for (int i = 0; i < count && i < most; i++) {
    const cJSON *item = cJSON_GetArrayItem(list, i);
    fprintf(out, "  %-28s %14.6g %14.6g %+14.6g", sf_json_get(item, "name")->valuestring, sf_json_number(item, "a"),
            sf_json_number(item, "b"), sf_json_number(item, "change"));
    print_percent(out, item, "change_percent");
    fprintf(out, "\n");
  }
  if (count > most) fprintf(out, "  and %d smaller ones\n", count - most);
}

/* Of the fullest ledger that both have. */
static void print_energies(FILE *out, const cJSON *comparison)
{
  static const int order[] = {SF_LEDGER_NEURON, SF_LEDGER_MEMORY, SF_LEDGER_WIDTH, SF_LEDGER_PAPER};
  const cJSON *energies = sf_json_get(comparison, "energies_mj_per_view"), *full = NULL;
  char title[100];
  for (size_t i = 0; i < sizeof order / sizeof *order && !full; i++) {
    full = sf_json_get(energies, sf_ledger_texts[order[i]].key);
    if (full)
      snprintf(title, sizeof title, "energy of the ledger '%s' by kind, mJ per view", sf_ledger_texts[order[i]].title);
  }
  if (!full) return;
  print_changes(out, sf_json_get(full, "parts"), title, MOST);
  print_changes(out, sf_json_get(full, "cells"), "the same by layer and step", MOST);
}

void sf_comparison_print(FILE *out, const cJSON *comparison)
{
  const cJSON *item;
  fprintf(out, "A: %s\nB: %s\n", sf_json_get(comparison, "a")->valuestring, sf_json_get(comparison, "b")->valuestring);
  cJSON_ArrayForEach(item, sf_json_get(comparison, "settings"))
  {
    fprintf(out, "  %-24s ", sf_json_get(item, "name")->valuestring);
    print_value(out, sf_json_get(item, "a"));
    fprintf(out, " -> ");
    print_value(out, sf_json_get(item, "b"));
    fprintf(out, "\n");
  }
  fprintf(out, "\n%-21s %14s %14s %10s   %s\n", "mJ per view", "A", "B", "change", "saving of A and of B");
  cJSON_ArrayForEach(item, sf_json_get(comparison, "ledgers"))
  {
    fprintf(out, "%-21s %14.6g %14.6g", sf_json_text(item, "title"), sf_json_number(item, "a_mj_per_view"),
            sf_json_number(item, "b_mj_per_view"));
    print_percent(out, item, "change_percent");
    print_percent(out, item, "a_saving_percent");
    print_percent(out, item, "b_saving_percent");
    fprintf(out, "\n");
  }
  cJSON_ArrayForEach(item, sf_json_get(comparison, "not_comparable"))
  {
    fprintf(out, "not compared: %s (%s)\n", sf_json_text(item, "title"), sf_json_text(item, "why"));
  }
  fprintf(out, "\nWhat changed, largest first: A, B, change\n");
  print_energies(out, comparison);
  print_changes(out, sf_json_get(comparison, "events_per_view"), "events per view, by relative change", MOST);
}
