/* What the page shows beside the audit, as JSON: all of its numbers come from there. */
#include "page/internal.h"
#include "base/sha256.h"
#include "spikefield/spikefield.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static void add_real(cJSON *object, const char *key, double value)
{
  if (isfinite(value))
    cJSON_AddNumberToObject(object, key, value);
  else
    cJSON_AddNullToObject(object, key);
}

static cJSON *digits(uint64_t value)
{
  char text[24];
  snprintf(text, sizeof text, "%" PRIu64, value);
  return cJSON_CreateRaw(text);
}

/* Paper ledger of every layer and step. */
static void add_layers(cJSON *json, const sf_page *page)
{
  cJSON *list = cJSON_AddArrayToObject(json, "layer_fj");
  for (int l = 0; l < SF_LAYERS; l++) {
    const fx_layer_counts *c = &page->report->measure.core.layer[l];
    cJSON *steps = cJSON_CreateArray();
    for (int t = 0; t < page->report->net->steps; t++)
      cJSON_AddItemToArray(steps, digits(c->mac[t] * SF_MAC_FJ + c->sop[t] * SF_SOP_FJ));
    cJSON_AddItemToArray(list, steps);
  }
}

static void add_prefixes(cJSON *json, const sf_page *page)
{
  cJSON *list = cJSON_AddArrayToObject(json, "prefix");
  int drawn = 0; /* a picture that equals the photograph has no PSNR */
  for (int t = 0; t < SF_T_MAX; t++) {
    cJSON *prefix = cJSON_CreateObject();
    cJSON_AddNumberToObject(prefix, "t", t + 1);
    add_real(prefix, "psnr", page->prefix[t].psnr);
    add_real(prefix, "ssim", page->prefix[t].ssim);
    sf_json_add_u64(prefix, "energy_fj", page->prefix[t].fj);
    cJSON_AddItemToArray(list, prefix);
    drawn += isfinite(page->prefix[t].psnr);
  }
  cJSON_AddStringToObject(json, "quality",
                          page->prefix[0].fj == 0  ? "no samples"
                          : drawn > 0              ? "drawn"
                          : page->view->image.rgba ? "equal"
                                                   : "no photograph");
}

/* Neurons of a layer by firing rate at a step; returns how many never fire. */
static int rate_bins(const sf_page *page, int l, int t, int bin[SF_PAGE_BINS])
{
  int silent = 0;
  for (int b = 0; b < SF_PAGE_BINS; b++) bin[b] = 0;
  for (int o = 0; o < page->report->net->layer[l].n_out && page->sampled > 0; o++) {
    const uint64_t spikes = page->neuron[l][t][o];
    bin[spikes >= page->sampled ? SF_PAGE_BINS - 1 : (int)(spikes * SF_PAGE_BINS / page->sampled)]++;
    silent += spikes == 0;
  }
  return silent;
}

static void add_rates(cJSON *json, const sf_page *page)
{
  sf_json_add_u64(json, "rate_samples", page->sampled);
  cJSON_AddNumberToObject(json, "bin_percent", 100.0 / SF_PAGE_BINS);
  cJSON *rates = cJSON_AddObjectToObject(json, "rate_bins"), *silent = cJSON_AddObjectToObject(json, "never_fire");
  for (int l = 0; l < SF_LAYERS; l++) {
    if (!fx_layer_fires(l)) continue;
    cJSON *steps = cJSON_AddArrayToObject(rates, fx_layer_name(l));
    cJSON *never = cJSON_AddArrayToObject(silent, fx_layer_name(l));
    for (int t = 0; t < page->report->net->steps; t++) {
      int bin[SF_PAGE_BINS];
      cJSON_AddItemToArray(never, cJSON_CreateNumber(rate_bins(page, l, t, bin)));
      cJSON_AddItemToArray(steps, cJSON_CreateIntArray(bin, SF_PAGE_BINS));
    }
  }
}

static void add_maps(cJSON *json, const sf_golden *golden)
{
  const size_t n = (size_t)golden->width * (size_t)golden->height;
  double least = INFINITY, most = 0, fj = 0, samples = 0, most_samples = 0;
  size_t hits = 0;
  for (size_t i = 0; i < n; i++) {
    const double x = html_samples(golden, i), each = html_sample_fj(golden, i);
    if (!(x > 0)) continue;
    least = fmin(least, each), most = fmax(most, each), most_samples = fmax(most_samples, x);
    fj += x * each, samples += x, hits++;
  }
  cJSON *energy = cJSON_AddObjectToObject(json, "energy_per_sample");
  cJSON_AddNumberToObject(energy, "least_fj", hits ? least : 0);
  cJSON_AddNumberToObject(energy, "most_fj", most);
  cJSON_AddNumberToObject(energy, "mean_fj", hits ? fj / samples : 0);
  cJSON *pixel = cJSON_AddObjectToObject(json, "samples_per_pixel");
  cJSON_AddNumberToObject(pixel, "most", most_samples);
  cJSON_AddNumberToObject(pixel, "mean", hits ? samples / (double)hits : 0);
}

static void add_pictures(cJSON *json, const sf_page *page)
{
  int of[SF_T_MAX + 1] = {0};
  add_maps(json, &page->golden);
  for (int i = 0; page->steps && i < page->golden.width * page->golden.height; i++) of[page->steps[i]]++;
  cJSON_AddItemToObject(json, "steps_needed",
                        page->steps ? cJSON_CreateIntArray(of, SF_T_MAX + 1) : cJSON_CreateNull());
  cJSON *ray = cJSON_AddObjectToObject(json, "ray");
  cJSON_AddNumberToObject(ray, "x", page->ray.x);
  cJSON_AddNumberToObject(ray, "y", page->ray.y);
  cJSON_AddNumberToObject(ray, "samples", page->ray.samples);
  cJSON_AddNumberToObject(ray, "all", page->ray.all);
}

/* A ledger and its twin, by their places in the list of ledgers. */
static void add_pairs(cJSON *json, const sf_page *page)
{
  uint64_t top = 0;
  cJSON *list = cJSON_AddArrayToObject(json, "pairs");
  for (int g = 0; g < SF_LEDGERS; g++) {
    const sf_ledger_text *text = &sf_ledger_texts[g];
    const int of[2] = {g, text->baseline};
    top = page->report->ledgers.total[g] > top ? page->report->ledgers.total[g] : top;
    if (text->baseline < 0) continue;
    cJSON *pair = cJSON_CreateObject();
    cJSON_AddItemToObject(pair, "of", cJSON_CreateIntArray(of, 2));
    cJSON_AddBoolToObject(pair, "before", !strncmp(text->meaning, "and ", 4));
    cJSON_AddItemToArray(list, pair);
  }
  sf_json_add_u64(json, "largest_total_fj", top);
}

/* A file that went since the audit has no hash. */
static void add_hash(cJSON *json, const char *key, const char *path)
{
  char hex[65];
  if (sf_sha256_file(path, hex).code == SF_OK)
    cJSON_AddStringToObject(json, key, hex);
  else
    cJSON_AddNullToObject(json, key);
}

static void add_origin(cJSON *json, const sf_page *page)
{
  const char *command = page->command, *tech = page->report->ledgers.technology.path;
  const bool model = page->model_sha256[0];
  const bool named = !model || strstr(command, "--model ") || strstr(command, "--model=");
  const size_t size = strlen(command) + (named ? 0 : strlen(page->model)) + 16;
  char *whole = malloc(size);
  cJSON *origin = cJSON_AddObjectToObject(json, "origin");
  cJSON_AddStringToObject(origin, "version", SPIKEFIELD_VERSION);
  if (whole) {
    snprintf(whole, size, "%s%s%s", command, named ? "" : " --model ", named ? "" : page->model);
    sf_json_add_text(origin, "command", whole);
  }
  free(whole);
  sf_json_add_text(origin, "model", model ? page->model : "");
  cJSON_AddItemToObject(origin, "model_sha256", model ? cJSON_CreateString(page->model_sha256) : cJSON_CreateNull());
  add_hash(origin, "data_sha256", page->data->list);
  sf_json_add_text(origin, "technology", tech);
  add_hash(origin, "technology_sha256", tech);
}

cJSON *sf_page_json(const sf_page *page)
{
  cJSON *report = sf_report_json(page->report), *json = cJSON_AddObjectToObject(report, "page");
  sf_json_add_text(json, "view", page->view->name);
  cJSON_AddNumberToObject(json, "width", page->view->camera.width);
  cJSON_AddNumberToObject(json, "height", page->view->camera.height);
  cJSON_AddBoolToObject(json, "whole", page->whole);
  cJSON_AddNumberToObject(json, "most_steps", SF_T_MAX);
  cJSON_AddNumberToObject(json, "trained_steps", page->trained_steps ? page->trained_steps : SF_T_MAX);
  add_real(json, "psnr_fixed", page->prefix[page->report->net->steps - 1].psnr);
  add_real(json, "ssim_fixed", page->prefix[page->report->net->steps - 1].ssim);
  add_real(json, "psnr_float", page->psnr_float);
  add_layers(json, page);
  add_prefixes(json, page);
  add_rates(json, page);
  add_pictures(json, page);
  add_pairs(json, page);
  html_add_units(json, page);
  add_origin(json, page);
  return report;
}
