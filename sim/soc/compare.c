#include "sim/soc/job.h"
#include "firmware/sf_tile.h"
#include "energy/energy.h"
#include <inttypes.h>
#include <string.h>

enum { FIELDS = 7, TOTALS = SF_LAYERS, FIELD, ENERGY, CHECKSUM, AUDIT_LINES, LINE_MAX = 256 };
static const char audit_prefix[] = "audit ";

/* ---- pixels ---- */

static void fields_of(const fx_pixel *p, uint64_t field[FIELDS])
{
  const uint64_t all[FIELDS] = {p->colour[0],  p->colour[1],     p->colour[2], p->depth,
                                p->weight_sum, p->transmittance, p->samples};
  memcpy(field, all, sizeof all);
}

sf_status sf_soc_compare_pixels(const fx_pixel *core, const fx_pixel *firmware, size_t n, int width)
{
  static const char *const name[FIELDS] = {"red", "green", "blue", "depth", "weight_sum", "transmittance", "samples"};
  for (size_t i = 0; i < n; i++) {
    uint64_t expected[FIELDS], actual[FIELDS];
    fields_of(&core[i], expected);
    fields_of(&firmware[i], actual);
    for (int f = 0; f < FIELDS; f++)
      if (expected[f] != actual[f])
        return sf_fail(SF_E_DIFFERENCE, "pixel %zu,%zu of the tile: %s: core %" PRIu64 ", firmware %" PRIu64,
                       i % (size_t)width, i / (size_t)width, name[f], expected[f], actual[f]);
  }
  return sf_ok();
}

/* ---- audit ---- */

static void layer_line(const fx_counts *counts, int layer, char line[LINE_MAX])
{
  int at = snprintf(line, LINE_MAX, "%s%s", audit_prefix, fx_layer_name(layer));
  for (int e = 0; e < SF_EVENTS; e++) {
    uint64_t sum = 0;
    for (int t = 0; t < SF_T_MAX; t++) sum += counts->layer[layer].event[e][t];
    at += snprintf(line + at, (size_t)(LINE_MAX - at), " %s %" PRIu64, sf_events[e].name, sum);
  }
}

static void expected_line(const fx_counts *counts, const fx_memory_counts *field, uint32_t crc, int number,
                          char line[LINE_MAX])
{
  if (number < SF_LAYERS)
    layer_line(counts, number, line);
  else if (number == TOTALS)
    snprintf(line, LINE_MAX, "%ssamples %" PRIu64 " rays %" PRIu64, audit_prefix, counts->samples, counts->rays);
  else if (number == FIELD)
    snprintf(line, LINE_MAX, "%slookups %" PRIu64 " misses %" PRIu64, audit_prefix, field->lookups, field->misses);
  else if (number == ENERGY)
    snprintf(line, LINE_MAX, "%senergy_fj %" PRIu64, audit_prefix, sf_energy_fj(counts));
  else
    snprintf(line, LINE_MAX, "%srgba_crc %08" PRIx32, audit_prefix, crc);
}

/* The next audit line from *output on, moved behind it; "nothing" at the end. */
static void next_line(const char **output, char line[LINE_MAX])
{
  snprintf(line, LINE_MAX, "nothing");
  for (bool found = false; **output && !found;) {
    const size_t length = strcspn(*output, "\n");
    found = strncmp(*output, audit_prefix, strlen(audit_prefix)) == 0;
    if (found) snprintf(line, LINE_MAX, "%.*s", (int)(length < LINE_MAX ? length : LINE_MAX), *output);
    *output += length + ((*output)[length] == '\n');
  }
}

sf_status sf_soc_compare_audit(const fx_counts *core, const fx_memory_counts *field, const fx_pixel *pixels, size_t n,
                               const char *output)
{
  const uint32_t crc = sf_rgba_crc(pixels, (uint32_t)n);
  char expected[LINE_MAX] = "nothing", actual[LINE_MAX];
  for (int i = 0; i < AUDIT_LINES; i++) {
    if (i == FIELD && !field) continue;
    expected_line(core, field, crc, i, expected);
    next_line(&output, actual);
    if (strcmp(expected, actual) != 0)
      return sf_fail(SF_E_DIFFERENCE, "core \"%s\", firmware \"%s\"", expected, actual);
  }
  next_line(&output, actual);
  return strcmp(actual, "nothing") == 0 ? sf_ok() : sf_fail(SF_E_DIFFERENCE, "one line too many: \"%s\"", actual);
}
