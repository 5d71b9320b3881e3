/* What a fit dropped and what that saves, as a table and as JSON. */
#include "fit/fit.h"
#include <inttypes.h>
#include <math.h>

static double saved(double before, double after)
{
  return before > 0 ? 100 * (1 - after / before) : 0;
}

static void line(FILE *out, const char *name, double before, double after)
{
  fprintf(out, "  %-28s %15.10g %15.10g %8.2f %%\n", name, before, after, saved(before, after));
}

static void print_dropped(FILE *out, const sf_fit_report *r)
{
  fprintf(out,
          "dropped: neurons without effect on %" PRIu64
          " rays (D1 %d, C1 %d, C2 %d, h %d), further ones (D1 %d, C1 %d, C2 %d, h %d),\n",
          r->observed, r->silent[FX_D1], r->silent[FX_C1], r->silent[FX_C2], r->silent[FX_D2], r->dropped[FX_D1],
          r->dropped[FX_C1], r->dropped[FX_C2], r->dropped[FX_D2]);
  if (r->before.planes)
    fprintf(out,
            "  components without effect (density %d, appearance %d), further ones (density %d, appearance %d); "
            "unread points are zero\n",
            r->idle_components[SF_OF_DENSITY], r->idle_components[SF_OF_APPEARANCE],
            r->dropped_components[SF_OF_DENSITY], r->dropped_components[SF_OF_APPEARANCE]);
  else
    fprintf(out, "  levels without effect %d, further levels %d, smaller tables %d; unread grid entries are zero\n",
            r->idle_levels, r->dropped_levels, r->smaller_tables);
}

static void print_grid(FILE *out, const sf_fit_state *b, const sf_fit_state *a)
{
  line(out, "D1 neurons", b->n_out[FX_D1], a->n_out[FX_D1]);
  line(out, "D2 outputs", b->n_out[FX_D2], a->n_out[FX_D2]);
  line(out, "spherical harmonics", b->directions, a->directions);
  line(out, "grid levels", b->levels, a->levels);
  line(out, "grid entries", (double)b->entries, (double)a->entries);
  line(out, "grid entries not zero", (double)(b->entries - b->zero_entries), (double)(a->entries - a->zero_entries));
}

static double volume(const double box[3])
{
  return box[0] * box[1] * box[2];
}

static void print_planes(FILE *out, const sf_fit_state *b, const sf_fit_state *a)
{
  static const char *const axis[] = {"points along x", "points along y", "points along z"};
  line(out, "density components", b->components[SF_OF_DENSITY], a->components[SF_OF_DENSITY]);
  line(out, "appearance components", b->components[SF_OF_APPEARANCE], a->components[SF_OF_APPEARANCE]);
  for (int i = 0; i < 3; i++) line(out, axis[i], b->points[i], a->points[i]);
  line(out, "volume of the box", volume(b->box), volume(a->box));
  line(out, "samples per unit of a ray", 1 / b->distance, 1 / a->distance);
  line(out, "entries of planes and lines", (double)b->entries, (double)a->entries);
  line(out, "entries not zero", (double)(b->entries - b->zero_entries), (double)(a->entries - a->zero_entries));
  line(out, "features", b->features, a->features);
  line(out, "sines of a feature", b->feature_freqs, a->feature_freqs);
  line(out, "sines of the direction", b->view_freqs, a->view_freqs);
  line(out, "inputs of the decoder", b->n_in[FX_C1], a->n_in[FX_C1]);
}

static void print_sizes(FILE *out, const sf_fit_state *b, const sf_fit_state *a)
{
  if (b->planes)
    print_planes(out, b, a);
  else
    print_grid(out, b, a);
  line(out, "C1 neurons", b->n_out[FX_C1], a->n_out[FX_C1]);
  line(out, "C2 neurons", b->n_out[FX_C2], a->n_out[FX_C2]);
  line(out, "time steps", b->steps, a->steps);
  line(out, "bits of a weight", b->widths.weight_bits, a->widths.weight_bits);
  line(out, "bits of an input", b->widths.feature_bits, a->widths.feature_bits);
  line(out, "bits of a leak", b->widths.leak_bits, a->widths.leak_bits);
  line(out, "bits of an entry", b->widths.grid_bits, a->widths.grid_bits);
  line(out, "occupied cells", (double)b->cells, (double)a->cells);
  line(out, "bytes to hold", (double)b->bytes, (double)a->bytes);
}

static void print_caches(FILE *out, const sf_fit_report *r, double frames)
{
  const sf_fit_cache *best = &r->cache[r->cache_chosen];
  fprintf(out, "cache of the field, %d ways:", best->shape.ways);
  for (int i = 0; i < SF_FIT_CACHES; i++)
    fprintf(out, "%s %d KB %.4g mJ", i ? "," : "", r->cache[i].shape.bytes / 1024,
            (double)r->cache[i].energy_fj * 1e-12 / frames);
  fprintf(out, "\n  this scene needs %d KB (%.4f of its look-ups miss): CACHE_BYTES = %d\n", best->shape.bytes / 1024,
          best->misses, best->shape.bytes);
}

void sf_fit_print(FILE *out, const sf_fit_report *r)
{
  const sf_fit_state *b = &r->before, *a = &r->after;
  const double frames = (double)r->checked / r->pixels;
  if (r->tables.bound) sf_fit_tables_print(out, &r->tables);
  fprintf(out, "fit: PSNR %.3f -> %.3f dB on %" PRIu64 " rays of the training views: loses %.4f dB, allowed %g dB\n",
          b->psnr, a->psnr, r->checked, r->loss_db, r->bound_db);
  print_dropped(out, r);
  fprintf(out, "  %-28s %15s %15s %10s\n", "", "before", "after", "saved");
  print_sizes(out, b, a);
  if (b->planes)
    line(out, "densities per frame", (double)b->sum.counts.field_samples / frames,
         (double)a->sum.counts.field_samples / frames);
  line(out, "samples per frame", (double)b->sum.counts.samples / frames, (double)a->sum.counts.samples / frames);
  line(out, "MACs per frame", (double)sf_event_total(&b->sum.counts, SF_EVENT_MAC) / frames,
       (double)sf_event_total(&a->sum.counts, SF_EVENT_MAC) / frames);
  line(out, "SOPs per frame", (double)sf_event_total(&b->sum.counts, SF_EVENT_SOP) / frames,
       (double)sf_event_total(&a->sum.counts, SF_EVENT_SOP) / frames);
  line(out, "cycles per frame, at least", (double)b->cycles / frames, (double)a->cycles / frames);
  line(out, "lines missed per sample", b->misses, a->misses);
  line(out, "energy per frame, mJ", (double)b->energy_fj * 1e-12 / frames, (double)a->energy_fj * 1e-12 / frames);
  fprintf(out, "  transmittance to stop at     %15.3g %15.3g\n", ldexp(b->trans_stop, -SF_TRANS_FRAC),
          ldexp(a->trans_stop, -SF_TRANS_FRAC));
  if (b->planes)
    fprintf(out, "  weight of a sample to decode %15.3g %15.3g\n", ldexp(b->weight_stop, -SF_TRANS_FRAC),
            ldexp(a->weight_stop, -SF_TRANS_FRAC));
  print_caches(out, r, frames);
}

static cJSON *caches_json(const sf_fit_report *r)
{
  cJSON *list = cJSON_CreateArray();
  for (int i = 0; i < SF_FIT_CACHES; i++) {
    cJSON *json = cJSON_CreateObject();
    cJSON_AddNumberToObject(json, "bytes", r->cache[i].shape.bytes);
    cJSON_AddNumberToObject(json, "ways", r->cache[i].shape.ways);
    cJSON_AddNumberToObject(json, "misses_per_lookup", r->cache[i].misses);
    sf_json_add_u64(json, "energy_fj", r->cache[i].energy_fj);
    cJSON_AddBoolToObject(json, "chosen", i == r->cache_chosen);
    cJSON_AddItemToArray(list, json);
  }
  return list;
}

static cJSON *layers_json(const int *value)
{
  cJSON *json = cJSON_CreateObject();
  for (int l = FX_D1; l <= FX_C2; l++) cJSON_AddNumberToObject(json, fx_layer_name(l), value[l]);
  return json;
}

static void add_planes(cJSON *json, const sf_fit_state *s)
{
  cJSON_AddNumberToObject(json, "density_components", s->components[SF_OF_DENSITY]);
  cJSON_AddNumberToObject(json, "appearance_components", s->components[SF_OF_APPEARANCE]);
  cJSON_AddItemToObject(json, "points", cJSON_CreateIntArray(s->points, 3));
  cJSON_AddItemToObject(json, "box", cJSON_CreateDoubleArray(s->box, 3));
  cJSON_AddNumberToObject(json, "distance", s->distance);
  cJSON_AddNumberToObject(json, "entries", (double)s->entries);
  cJSON_AddNumberToObject(json, "features", s->features);
  cJSON_AddNumberToObject(json, "feature_freqs", s->feature_freqs);
  cJSON_AddNumberToObject(json, "view_freqs", s->view_freqs);
  cJSON_AddNumberToObject(json, "weight_stop", s->weight_stop);
  sf_json_add_u64(json, "densities", s->sum.counts.field_samples);
}

static void add_grid(cJSON *json, const sf_fit_state *s)
{
  cJSON_AddNumberToObject(json, "directions", s->directions);
  cJSON_AddNumberToObject(json, "levels", s->levels);
  cJSON_AddNumberToObject(json, "grid_entries", (double)s->entries);
}

/* Counts are those of the checking rays. */
static cJSON *state_json(const sf_fit_state *s)
{
  cJSON *json = cJSON_CreateObject();
  sf_json_add_real(json, "psnr", s->psnr);
  cJSON_AddItemToObject(json, "n_in", cJSON_CreateIntArray(s->n_in, SF_LAYERS));
  cJSON_AddItemToObject(json, "n_out", cJSON_CreateIntArray(s->n_out, SF_LAYERS));
  if (s->planes)
    add_planes(json, s);
  else
    add_grid(json, s);
  cJSON_AddNumberToObject(json, "steps", s->steps);
  cJSON_AddNumberToObject(json, "zero_entries", (double)s->zero_entries);
  cJSON_AddNumberToObject(json, "occupied_cells", (double)s->cells);
  cJSON_AddNumberToObject(json, "trans_stop", s->trans_stop);
  sf_json_add_u64(json, "bytes", s->bytes);
  sf_json_add_u64(json, "samples", s->sum.counts.samples);
  sf_json_add_u64(json, "mac", sf_event_total(&s->sum.counts, SF_EVENT_MAC));
  sf_json_add_u64(json, "sop", sf_event_total(&s->sum.counts, SF_EVENT_SOP));
  sf_json_add_u64(json, "cycles", s->cycles);
  sf_json_add_u64(json, "energy_fj", s->energy_fj);
  cJSON_AddNumberToObject(json, "lookups_per_sample", s->lookups);
  cJSON_AddNumberToObject(json, "misses_per_sample", s->misses);
  return json;
}

cJSON *sf_fit_json(const sf_fit_report *r)
{
  cJSON *json = cJSON_CreateObject();
  sf_json_add_u64(json, "observed_rays", r->observed);
  sf_json_add_u64(json, "checked_rays", r->checked);
  cJSON_AddNumberToObject(json, "frames", (double)r->checked / r->pixels);
  cJSON_AddNumberToObject(json, "bound_db", r->bound_db);
  sf_json_add_real(json, "loss_db", r->loss_db);
  cJSON_AddNumberToObject(json, "candidate", r->chosen);
  if (r->tables.bound) cJSON_AddItemToObject(json, "grid_for_bytes", sf_fit_tables_json(&r->tables));
  cJSON_AddItemToObject(json, "neurons_without_effect", layers_json(r->silent));
  cJSON_AddItemToObject(json, "neurons_dropped", layers_json(r->dropped));
  if (r->before.planes) {
    cJSON_AddItemToObject(json, "components_without_effect", cJSON_CreateIntArray(r->idle_components, SF_FACTORS));
    cJSON_AddItemToObject(json, "components_dropped", cJSON_CreateIntArray(r->dropped_components, SF_FACTORS));
  } else {
    cJSON_AddNumberToObject(json, "levels_without_effect", r->idle_levels);
    cJSON_AddNumberToObject(json, "levels_dropped", r->dropped_levels);
    cJSON_AddNumberToObject(json, "tables_smaller", r->smaller_tables);
  }
  cJSON_AddItemToObject(json, "caches", caches_json(r));
  cJSON_AddItemToObject(json, "before", state_json(&r->before));
  cJSON_AddItemToObject(json, "after", state_json(&r->after));
  return json;
}
