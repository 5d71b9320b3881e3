#include "sim/lockstep.h"
#include "energy/energy.h"
#include "base/io.h"
#include "base/text.h"
#include <inttypes.h>
#include <stdio.h>

void sf_difference_text(const sf_difference *d, char text[200])
{
  char layer[48] = "", neuron[32] = "";
  if (d->layer >= 0) snprintf(layer, sizeof layer, "layer %s step %d ", fx_layer_name(d->layer), d->step);
  if (d->neuron >= 0) snprintf(neuron, sizeof neuron, "neuron %d ", d->neuron);
  snprintf(text, 200, "%s%s%s: expected %" PRId64 ", actual %" PRId64 ", cycle %" PRIu64, layer, neuron, d->wire,
           d->expected, d->actual, d->cycle);
}

sf_status sf_lockstep_difference(const sf_lockstep *l, const sf_status *status)
{
  char text[200];
  const sf_cosim_place *where = &l->place;
  const sf_lockstep_pixel p = sf_lockstep_pick(l, where->ray);
  if (where->what.wire) sf_difference_text(&where->what, text);
  return sf_fail(SF_E_DIFFERENCE, "ray %" PRIu64 " (view %s, pixel %d,%d) sample %s%" PRIu64 ": %s", where->ray,
                 l->data.view[p.view].name, p.x, p.y, where->exact ? "" : ">= ", where->sample,
                 where->what.wire ? text : status->message);
}

static void add_place(const sf_lockstep *l, cJSON *json)
{
  const sf_cosim_place *where = &l->place;
  const sf_difference *d = &where->what;
  const sf_lockstep_pixel p = sf_lockstep_pick(l, where->ray);
  sf_json_add_u64(json, "ray", where->ray);
  sf_json_add_text(json, "view", l->data.view[p.view].name);
  cJSON_AddNumberToObject(json, "x", p.x);
  cJSON_AddNumberToObject(json, "y", p.y);
  sf_json_add_u64(json, "sample", where->sample);
  cJSON_AddBoolToObject(json, "sample_exact", where->exact);
  if (d->layer >= 0) cJSON_AddStringToObject(json, "layer", fx_layer_name(d->layer));
  if (d->layer >= 0) cJSON_AddNumberToObject(json, "step", d->step);
  if (d->neuron >= 0) cJSON_AddNumberToObject(json, "neuron", d->neuron);
  cJSON_AddStringToObject(json, "wire", d->wire ? d->wire : "result");
  cJSON_AddNumberToObject(json, "expected", (double)d->expected);
  cJSON_AddNumberToObject(json, "actual", (double)d->actual);
  sf_json_add_u64(json, "cycle", d->cycle);
}

static cJSON *difference_json(const sf_lockstep *l, const sf_status *status)
{
  char path[4096];
  if (status->code != SF_E_DIFFERENCE) return cJSON_CreateNull();
  cJSON *json = cJSON_CreateObject();
  sf_json_add_text(json, "message", status->message);
  if (!l->place.found) return json;
  add_place(l, json);
  cJSON_AddNumberToObject(json, "replay_samples", l->replay.count);
  cJSON_AddBoolToObject(json, "replay_shows_it", l->replays);
  if (l->unwritten.code != SF_OK) {
    sf_json_add_text(json, "no_evidence", l->unwritten.message);
    return json;
  }
  snprintf(path, sizeof path, "%s.json", l->evidence);
  sf_json_add_text(json, "replay", path);
  snprintf(path, sizeof path, "%s.fst", l->evidence);
  sf_json_add_text(json, "wave", path);
  return json;
}

static double ratio(uint64_t part, uint64_t whole)
{
  return whole ? (double)part / (double)whole : 0;
}

/* Cycles in which the layer that limits the engine added up rows. */
static uint64_t busiest(const sf_cosim_totals *sum)
{
  uint64_t most = 0;
  for (int l = 0; l < SF_LAYERS; l++)
    if (sum->layer_busy[l] > most) most = sum->layer_busy[l];
  return most;
}

cJSON *sf_lockstep_json(const sf_lockstep *l, const sf_status *status, double seconds)
{
  const sf_cosim_totals *sum = &l->sum;
  cJSON *json = cJSON_CreateObject();
  sf_json_add_u64(json, "seed", l->options.seed);
  cJSON_AddNumberToObject(json, "stall_percent", l->options.stall_percent);
  cJSON_AddNumberToObject(json, "block_rays", l->options.block);
  cJSON_AddBoolToObject(json, "complete", l->complete);
  sf_json_add_u64(json, "rays", l->rays);
  sf_json_add_u64(json, "rays_with_samples", sum->core.rays);
  sf_json_add_u64(json, "samples", sum->samples);
  sf_json_add_u64(json, "spikes", sum->spikes);
  cJSON_AddNumberToObject(json, "differences", status->code == SF_E_DIFFERENCE);
  cJSON_AddItemToObject(json, "first_difference", difference_json(l, status));
  sf_json_add_u64(json, "cycles", sum->cycles);
  sf_json_add_u64(json, "stall_cycles", sum->stalls);
  cJSON_AddNumberToObject(json, "cycles_per_sample", ratio(sum->cycles, sum->samples));
  cJSON_AddNumberToObject(json, "utilisation", ratio(busiest(sum), sum->cycles));
  cJSON_AddItemToObject(json, "counts", sf_counts_json(&l->fx.net, &sum->rtl));
  sf_json_add_u64(json, "energy_fj", l->energy_rtl_fj);
  sf_json_add_u64(json, "energy_core_fj", l->energy_core_fj);
  cJSON_AddNumberToObject(json, "jobs", l->options.jobs);
  if (l->options.port) sf_json_add_text(json, "port", l->options.port);
  cJSON_AddNumberToObject(json, "seconds", seconds);
  return json;
}

void sf_lockstep_print(FILE *out, const sf_lockstep *l, double seconds)
{
  const sf_cosim_totals *sum = &l->sum;
  const double speed = seconds > 0 ? (double)(sum->samples - l->resumed) / seconds : 0;
  fprintf(out,
          "%" PRIu64 " ray%s (%" PRIu64 " with samples), %" PRIu64 " sample%s, %" PRIu64 " spike%s: 0 differences\n",
          l->rays, sf_plural(l->rays), sum->core.rays, sum->samples, sf_plural(sum->samples), sum->spikes,
          sf_plural(sum->spikes));
  fprintf(out, "compared: %s, every counter, energy\n",
          l->options.port ? "pixels" : "outputs, spikes, membranes and rows per layer and step");
  fprintf(out, "%" PRIu64 " cycles, %.1f per sample, utilisation of the busiest layer %.1f %%, stalled %.1f %%\n",
          sum->cycles, ratio(sum->cycles, sum->samples), 100 * ratio(busiest(sum), sum->cycles),
          100 * ratio(sum->stalls, sum->cycles));
  fprintf(out, "energy %" PRIu64 " fJ by the core, %" PRIu64 " fJ by the accelerator\n", l->energy_core_fj,
          l->energy_rtl_fj);
  if (l->options.port) {
    fprintf(out, "%.1f s, %.0f samples/s by the board at %s, seed %" PRIu64 "\n", seconds, speed, l->options.port,
            l->options.seed);
    return;
  }
  fprintf(out, "%.1f s, %.0f samples/s by %d process%s, seed %" PRIu64 ", stalls %d %%\n", seconds, speed,
          l->options.jobs, l->options.jobs == 1 ? "" : "es", l->options.seed, l->options.stall_percent);
}

sf_status sf_lockstep_junit(const sf_lockstep *l, const sf_status *status, double seconds, const char *path)
{
  sf_writer writer;
  SF_TRY(sf_writer_open(&writer, path));
  const bool failed = status->code != SF_OK;
  fprintf(writer.file,
          "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
          "<testsuite name=\"sf_cosim\" tests=\"1\" failures=\"%d\" time=\"%.1f\">\n"
          "  <testcase classname=\"lockstep\" name=\"seed %" PRIu64 ", %" PRIu64
          " samples, stalls %d %%\" time=\"%.1f\">",
          failed, seconds, l->options.seed, l->sum.samples, l->options.stall_percent, seconds);
  if (failed) {
    fputs("<failure message=\"", writer.file);
    sf_xml_escape(writer.file, status->message);
    fputs("\"/>", writer.file);
  }
  fputs("</testcase>\n</testsuite>\n", writer.file);
  return sf_writer_commit(&writer);
}
