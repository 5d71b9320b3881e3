/* One audit as text, JSON and CSV. */
#include "energy/energy.h"
#include <inttypes.h>
#include <math.h>

static void print_row(FILE *out, const char *title, uint64_t x, uint64_t y, uint64_t z, bool no_rtl)
{
  fprintf(out, "  %-30s %16" PRIu64, title, x);
  if (no_rtl)
    fprintf(out, " %16s", "-");
  else
    fprintf(out, " %16" PRIu64, y);
  fprintf(out, " %16" PRIu64 "%s\n", z, x == z && (no_rtl || x == y) ? "" : "  DIFFERENT");
}

static void print_three(FILE *out, const sf_three_counts *s, uint64_t seed)
{
  if (s->rays == 0 && s->agreement.code == SF_OK) {
    fprintf(out, "accelerator: %s\n", s->wanted ? "no ray has samples, nothing to run" : "left out");
    return;
  }
  fprintf(out, "three counts of %" PRIu64 " samples of %d rays (seed %" PRIu64 "), layers and steps added up here:\n",
          s->core.samples, s->rays, seed);
  fprintf(out, "  %-30s %16s %16s %16s\n", "event", "core", "accelerator", "recount");
  for (int e = 0; e < SF_EVENTS; e++)
    print_row(out, sf_events[e].title, sf_event_total(&s->core, e), sf_event_total(&s->rtl, e),
              sf_event_total(&s->recount, e), false);
  const sf_traffic *x = &s->core_traffic, *y = &s->rtl_traffic, *z = &s->recount_traffic;
  for (int e = 0; e < SF_TRAFFIC_EVENTS; e++)
    print_row(out, sf_traffic_events[e].title, x->event[e], y->event[e], z->event[e], e >= s->rtl_events);
  print_row(out, "paper ledger, fJ", sf_energy_fj(&s->core), sf_energy_fj(&s->rtl), sf_energy_fj(&s->recount), false);
  fprintf(out, "  accelerator: %" PRIu64 " cycles, %" PRIu64 " busy, %" PRIu64 " stalled\n", s->cycles, s->busy,
          s->stalls);
  if (s->agreement.code == SF_OK)
    fprintf(out, "  core = accelerator = recount, for every event, layer and step\n");
  else
    fprintf(out, "  DIFFERENCE: %s\n", s->agreement.message);
}

static void print_twin(FILE *out, const sf_audit_report *r)
{
  if (!r->twin.path) return;
  fprintf(out,
          "paper ledger against a twin that was trained by itself, %s:\n  %" PRIu64 " samples (spiking net: %" PRIu64
          "), %.6g mJ per view, saving %.2f%%\n\n",
          r->twin.path, r->twin.samples, r->measure.core.samples, (double)r->twin.fj * 1e-12 / r->views,
          r->twin.saving_percent);
}

static void print_words(FILE *out, const fx_net *net)
{
  fprintf(
      out,
      "A picture is made of rays, a ray of samples; each sample goes through a small spiking net for t_r time steps:\n"
      "%scolour (C1 C2 C3). A MAC multiplies a real-valued input by a weight and adds; a SOP adds a weight because a\n"
      "neuron fired; a neuron update is one %s, comparison and reset. The ReLU twin is a\n"
      "count: a dense ReLU net of the same layer sizes on the same samples, every synapse a MAC, no zeros skipped; it\n"
      "was not trained for this figure.\n\n",
      fx_net_first_layer(net) == FX_D1 ? "density (D1 D2), " : "", net->mode == FX_RADIX ? "doubling" : "leak");
}

static const char *less(double saving)
{
  return saving < 0 ? "more" : "less";
}

/* What becomes of the saving where samples share weights, said plainly. */
static void print_shared(FILE *out, const sf_ledgers *l)
{
  const double alone = l->saving[SF_LEDGER_NEURON], shared = l->saving[SF_LEDGER_SHARED];
  fprintf(out, "Where %d samples share each read of weights, in both nets, it is %.2f%% %s", FX_SHARED, fabs(shared),
          less(shared));
  fprintf(out, "%s.\n", alone > 0 && shared <= 0 ? ": THE SAVING VANISHES" : "");
}

static void print_result(FILE *out, const sf_audit_report *r)
{
  const sf_ledgers *l = &r->ledgers;
  const double paper = l->saving[SF_LEDGER_PAPER], all = l->saving[SF_LEDGER_NEURON];
  if (isnan(paper) || isnan(all)) return;
  fprintf(out,
          "In the paper's metric it is estimated at %.6g mJ per view, %.2f%% %s than the twin; with everything priced "
          "that is\ncounted %.6g mJ, %.2f%% %s than an integer twin with the same memory system.\n",
          (double)l->total[SF_LEDGER_PAPER] * 1e-12 / r->views, fabs(paper), less(paper),
          (double)l->total[SF_LEDGER_NEURON] * 1e-12 / r->views, fabs(all), less(all));
  print_shared(out, l);
  fprintf(out, "\n");
}

static void print_cache(FILE *out, const sf_audit_report *r)
{
  const sf_traffic *t = &r->traffic;
  const fx_memory_counts *m = &r->measure.memory;
  fprintf(out,
          "field's cache, %d bytes, %d ways, emptied for each tile of %d x %d pixels: %" PRIu64 " look-ups, %" PRIu64
          " lines missed (%.4f per look-up)\n",
          r->cache.bytes, r->cache.ways, FX_TILE, FX_TILE, t->lookups, t->misses,
          t->lookups ? (double)t->misses / (double)t->lookups : 0);
  if (r->entries)
    fprintf(out, "  per entry read: %.4f look-ups, %.4f misses\n", (double)t->lookups / (double)r->entries,
            (double)t->misses / (double)r->entries);
  fprintf(out,
          "groups of %d samples that share weights: %" PRIu64 "; rows of D2, C2, C3 that they read: %" PRIu64
          ", %" PRIu64 ", %" PRIu64 "\n\n",
          FX_SHARED, m->groups, m->rows[0], m->rows[1], m->rows[2]);
}

void sf_report_print(FILE *out, const sf_audit_report *r)
{
  print_words(out, r->net);
  print_result(out, r);
  const fx_counts *c = &r->measure.core;
  char census[256], unexpected[64];
  fprintf(out, "%s, %s views of %s: %" PRIu64 " %s rays (%.4g views), %" PRIu64 " with samples\n", r->scene, r->split,
          r->data, r->rays, r->random_rays ? "random" : "pixel", r->views, c->rays);
  fprintf(out, "%" PRIu64 " samples, %.2f per ray, t_r = %d, %.1f s\n\n", c->samples,
          (double)c->samples / (double)r->rays, r->net->steps, r->seconds);
  sf_counts_print(out, r->net, c);
  print_cache(out, r);
  sf_saturation_census(r->measure.core.saturated_samples, c->saturated_features, census, sizeof census);
  fprintf(out, "saturation: %s\n", census);
  if (sf_saturation_unexpected(r->net, r->measure.core.saturated_samples, unexpected, sizeof unexpected))
    fprintf(out, "UNEXPECTED saturation in %s\n", unexpected);
  if (r->measure.recount.samples)
    fprintf(out,
            "vector core = portable core = recount from the spike bitmaps, for every event, layer and step, on %" PRIu64
            " samples of %" PRIu64 " rays\n\n",
            r->measure.recount.samples, r->measure.checked);
  else
    fprintf(out, "recount: %s\n\n", r->measure.checked ? "no ray has samples, nothing to count again" : "left out");
  print_three(out, &r->three, r->seed);
  fprintf(out, "\n");
  sf_ledgers_print(out, &r->ledgers, r->views);
  fprintf(out, "\n");
  print_twin(out, r);
  sf_ledger_print(out, &r->ledger, r->views);
  fprintf(out, "\n");
  sf_limits_print(out);
}

/* The first `events` of them. */
static cJSON *traffic_json(const sf_traffic *traffic, int events)
{
  cJSON *json = cJSON_CreateObject();
  for (int e = 0; e < events; e++) sf_json_add_u64(json, sf_traffic_events[e].name, traffic->event[e]);
  return json;
}

static cJSON *count_json(const fx_net *net, const fx_counts *counts, const sf_traffic *traffic, int events)
{
  cJSON *json = sf_counts_json(net, counts);
  if (traffic)
    cJSON_AddItemToObject(json, "traffic", traffic_json(traffic, events));
  else
    cJSON_AddNullToObject(json, "traffic");
  return json;
}

/* What samples share, of all rays. */
static cJSON *shared_json(const fx_memory_counts *memory)
{
  cJSON *json = cJSON_CreateObject(), *rows = cJSON_CreateObject();
  cJSON_AddNumberToObject(json, "samples", FX_SHARED);
  sf_json_add_u64(json, "groups", memory->groups);
  for (int s = 0; s < FX_SPIKING; s++) sf_json_add_u64(rows, fx_layer_name(fx_spiking_layers[s] + 1), memory->rows[s]);
  cJSON_AddItemToObject(json, "rows", rows);
  return json;
}

static cJSON *three_json(const sf_three_counts *s, const fx_net *net)
{
  cJSON *json = cJSON_CreateObject();
  cJSON_AddNumberToObject(json, "rays", s->rays);
  sf_json_add_u64(json, "samples", s->core.samples);
  sf_json_add_u64(json, "cycles", s->cycles);
  sf_json_add_u64(json, "busy", s->busy);
  sf_json_add_u64(json, "stalls", s->stalls);
  sf_json_add_u64(json, "core_fj", sf_energy_fj(&s->core));
  sf_json_add_u64(json, "rtl_fj", sf_energy_fj(&s->rtl));
  sf_json_add_u64(json, "recount_fj", sf_energy_fj(&s->recount));
  cJSON_AddItemToObject(json, "core", count_json(net, &s->core, &s->core_traffic, SF_TRAFFIC_EVENTS));
  cJSON_AddItemToObject(json, "rtl", count_json(net, &s->rtl, &s->rtl_traffic, s->rtl_events));
  cJSON_AddItemToObject(json, "recount", count_json(net, &s->recount, &s->recount_traffic, SF_TRAFFIC_EVENTS));
  return json;
}

static void add_origin(cJSON *json, const sf_audit_report *r)
{
  cJSON_AddStringToObject(json, "format", SF_AUDIT_FORMAT);
  sf_json_add_text(json, "scene", r->scene);
  cJSON_AddStringToObject(json, "scene_sha256", r->sha256);
  sf_json_add_text(json, "data", r->data);
  cJSON_AddStringToObject(json, "split", r->split);
  cJSON_AddNumberToObject(json, "t_r", r->net->steps);
  sf_json_add_u64(json, "seed", r->seed);
  sf_json_add_u64(json, "rays", r->rays);
  cJSON_AddBoolToObject(json, "random_rays", r->random_rays);
  cJSON_AddNumberToObject(json, "views", r->views);
  sf_json_add_u64(json, "samples", r->measure.core.samples);
  cJSON *cache = cJSON_AddObjectToObject(json, "cache");
  cJSON_AddNumberToObject(cache, "bytes", r->cache.bytes);
  cJSON_AddNumberToObject(cache, "ways", r->cache.ways);
  cJSON_AddNumberToObject(cache, "line_bytes", FX_LINE);
  cJSON_AddNumberToObject(cache, "tile", FX_TILE);
  cJSON_AddNumberToObject(json, "samples_per_ray", (double)r->measure.core.samples / (double)r->rays);
}

static void add_energy(cJSON *json, const sf_audit_report *r)
{
  sf_json_add_u64(json, "energy_spiking_fj", r->ledger.spiking_fj);
  sf_json_add_u64(json, "energy_ann_fj", r->ledger.ann_fj);
  sf_json_add_real(json, "energy_saving_percent", sf_saving_percent(r->ledger.spiking_fj, r->ledger.ann_fj));
  cJSON_AddNumberToObject(json, "energy_spiking_mj_per_view", (double)r->ledger.spiking_fj * 1e-12 / r->views);
  cJSON_AddNumberToObject(json, "energy_ann_mj_per_view", (double)r->ledger.ann_fj * 1e-12 / r->views);
  cJSON_AddItemToObject(json, "ledger", sf_ledger_json(&r->ledger));
}

static void add_twin(cJSON *json, const sf_audit_report *r)
{
  if (!r->twin.path) return;
  cJSON *twin = cJSON_AddObjectToObject(json, "twin");
  sf_json_add_text(twin, "model", r->twin.path);
  sf_json_add_u64(twin, "samples", r->twin.samples);
  sf_json_add_u64(twin, "macs_per_sample", r->twin.macs);
  sf_json_add_u64(twin, "fj", r->twin.fj);
  sf_json_add_real(twin, "saving_percent", r->twin.saving_percent);
}

static void add_saturation(cJSON *json, const sf_audit_report *r)
{
  char unexpected[64], census[256];
  cJSON *saturated = cJSON_AddObjectToObject(json, "saturated_samples");
  for (int l = 0; l < SF_LAYERS; l++)
    sf_json_add_u64(saturated, fx_layer_name(l), r->measure.core.saturated_samples[l]);
  sf_saturation_unexpected(r->net, r->measure.core.saturated_samples, unexpected, sizeof unexpected);
  cJSON_AddStringToObject(json, "unexpected_saturation", unexpected);
  sf_saturation_census(r->measure.core.saturated_samples, r->measure.core.saturated_features, census, sizeof census);
  cJSON_AddStringToObject(json, "saturation", census);
}

static void add_titles(cJSON *titles, const char *key, const sf_event *event, int events)
{
  cJSON *json = cJSON_AddObjectToObject(titles, key);
  for (int e = 0; e < events; e++) cJSON_AddStringToObject(json, event[e].name, event[e].title);
}

/* The names of events and of parts of the energy, for people. */
static cJSON *titles_json(void)
{
  cJSON *json = cJSON_CreateObject();
  add_titles(json, "events", sf_events, SF_EVENTS);
  add_titles(json, "traffic", sf_traffic_events, SF_TRAFFIC_EVENTS);
  cJSON *parts = cJSON_AddObjectToObject(json, "parts");
  for (int p = 0; p < SF_PARTS; p++) cJSON_AddStringToObject(parts, sf_part_names[p], sf_part_titles[p]);
  return json;
}

static void add_agreement(cJSON *json, const sf_audit_report *r)
{
  bool all = sf_counts_compare(&r->measure.checked_core, "core", &r->measure.recount, "recount").code == SF_OK;
  bool three = r->three.agreement.code == SF_OK;
  sf_json_add_u64(json, "recount_rays", r->measure.checked);
  sf_json_add_u64(json, "recount_samples", r->measure.recount.samples);
  if (r->measure.recount.samples || !all)
    cJSON_AddBoolToObject(json, "core_equals_recount", all);
  else
    cJSON_AddNullToObject(json, "core_equals_recount");
  if (r->three.rays > 0 || !three)
    cJSON_AddBoolToObject(json, "core_equals_rtl_equals_recount", three);
  else
    cJSON_AddNullToObject(json, "core_equals_rtl_equals_recount");
  if (!three) sf_json_add_text(json, "difference", r->three.agreement.message);
}

cJSON *sf_report_json(const sf_audit_report *r)
{
  cJSON *json = cJSON_CreateObject();
  add_origin(json, r);
  add_energy(json, r);
  cJSON_AddItemToObject(json, "ledgers", sf_ledgers_json(&r->ledgers, r->views));
  add_twin(json, r);
  cJSON_AddItemToObject(json, "counts", count_json(r->net, &r->measure.core, &r->traffic, SF_TRAFFIC_EVENTS));
  cJSON_AddItemToObject(json, "shared", shared_json(&r->measure.memory));
  add_saturation(json, r);
  add_agreement(json, r);
  cJSON_AddItemToObject(json, "rtl_subset", three_json(&r->three, r->net));
  sf_limits_json(json);
  cJSON_AddItemToObject(json, "titles", titles_json());
  cJSON_AddNumberToObject(json, "seconds", r->seconds);
  return json;
}

/* Columns for what is outside the nets; the special functions stand in the column of the layers'. */
static const int csv_traffic[] = {SF_TRAFFIC_TABLE, SF_TRAFFIC_LOOKUP,    SF_TRAFFIC_MISS, SF_TRAFFIC_PRODUCT,
                                  SF_TRAFFIC_PLACE, SF_TRAFFIC_HARMONICS, SF_TRAFFIC_FRAME};

static void csv_events(FILE *out, const sf_traffic *traffic, int row)
{
  for (size_t i = 0; i < sizeof csv_traffic / sizeof *csv_traffic; i++) {
    const int e = csv_traffic[i], of = e == SF_TRAFFIC_HARMONICS || e == SF_TRAFFIC_FRAME ? SF_ROW_RAY : SF_ROW_FIELD;
    fprintf(out, ",%" PRIu64, traffic && row == of ? traffic->event[e] : 0);
  }
}

static void csv_energies(FILE *out, const sf_ledgers *l, int row, int t)
{
  for (int g = 0; g < SF_SPIKING_LEDGERS; g++) fprintf(out, ",%" PRIu64, l->cell[g][row][t]);
  fprintf(out, "\n");
}

void sf_report_csv(FILE *out, const sf_audit_report *r)
{
  fprintf(out, "layer,step,n_in,n_out");
  for (int e = 0; e < SF_EVENTS; e++) fprintf(out, ",%s", sf_events[e].name);
  for (size_t i = 0; i < sizeof csv_traffic / sizeof *csv_traffic; i++)
    fprintf(out, ",%s", sf_traffic_events[csv_traffic[i]].name);
  for (int g = 0; g < SF_SPIKING_LEDGERS; g++) fprintf(out, ",%s_fj", sf_ledger_texts[g].key);
  fprintf(out, "\n");
  for (int l = 0; l < SF_LAYERS; l++)
    for (int t = 0; t < r->net->steps; t++) {
      fprintf(out, "%s,%d,%d,%d", fx_layer_name(l), t, r->net->layer[l].n_in, r->net->layer[l].n_out);
      for (int e = 0; e < SF_EVENTS; e++) fprintf(out, ",%" PRIu64, r->measure.core.layer[l].event[e][t]);
      csv_events(out, NULL, SF_LAYERS);
      csv_energies(out, &r->ledgers, l, t);
    }
  fprintf(out, "field,0,0,0,0,0,0,0,0,0,0,%" PRIu64, r->traffic.special);
  csv_events(out, &r->traffic, SF_ROW_FIELD);
  csv_energies(out, &r->ledgers, SF_ROW_FIELD, 0);
  fprintf(out, "ray,0,0,0,0,0,0,0,0,0,0,%" PRIu64, r->traffic.exp_neg);
  csv_events(out, &r->traffic, SF_ROW_RAY);
  csv_energies(out, &r->ledgers, SF_ROW_RAY, 0);
}
