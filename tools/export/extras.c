#include "tools/export/extras.h"
#include "cli/cli.h"
#include <stdio.h>

enum { VECTOR_RAYS = 1000, TRACE_RAYS = 20 };

/* ---- --vectors ---- */

static sf_status write_vectors(const fx_scene *scene, const char *path, const sf_dataset *data, const export_options *o,
                               sf_kit_report *kit)
{
  const sf_kit_options how = {
      .scene_path = path, .seed = o->seed, .rays = o->rays ? o->rays : VECTOR_RAYS, .samples = o->samples};
  return sf_kit_write(o->vectors, scene, data, &how, kit);
}

static void print_vectors(const sf_kit_report *kit, const char *folder)
{
  printf("%s: %d samples of %d rays, %d input beats, %d register writes; %d files, %.1f MB\n", folder, kit->samples,
         kit->rays, kit->beats, kit->writes, kit->files, 1e-6 * (double)kit->bytes);
  printf("make -C ");
  sf_cli_put_word(stdout, folder);
  printf(" icarus verilator\n");
}

static cJSON *vectors_json(const sf_kit_report *kit, const char *folder)
{
  cJSON *json = cJSON_CreateObject();
  cJSON_AddStringToObject(json, "folder", folder);
  cJSON_AddNumberToObject(json, "samples", kit->samples);
  cJSON_AddNumberToObject(json, "rays", kit->rays);
  cJSON_AddNumberToObject(json, "input_beats", kit->beats);
  cJSON_AddNumberToObject(json, "register_writes", kit->writes);
  cJSON_AddNumberToObject(json, "files", kit->files);
  cJSON_AddNumberToObject(json, "bytes", (double)kit->bytes);
  return json;
}

/* ---- --traces ---- */

static sf_status write_traces(const fx_scene *scene, const sf_dataset *data, const export_options *o,
                              sf_traces_report *traces)
{
  const sf_traces_options how = {.view = o->view, .rays = o->rays ? o->rays : TRACE_RAYS, .seed = o->seed};
  return sf_traces_write(o->traces, scene, data, &how, traces);
}

static cJSON *traces_json(const sf_traces_report *traces, const char *folder)
{
  cJSON *json = cJSON_CreateObject();
  cJSON_AddStringToObject(json, "folder", folder);
  cJSON_AddNumberToObject(json, "rays", traces->rays);
  cJSON_AddNumberToObject(json, "samples", (double)traces->samples);
  cJSON_AddNumberToObject(json, "timesteps", (double)traces->timesteps);
  cJSON_AddNumberToObject(json, "spikes", (double)traces->spikes);
  return json;
}

/* ---- all of them ---- */

sf_status export_extras_open(export_extras *e, const fx_scene *scene, const char *path, const export_options *o)
{
  const sf_dataset_options how = {.cameras_only = true};
  *e = (export_extras){0};
  if (!o->vectors && !o->traces) return sf_ok();
  SF_TRY(sf_fx_dataset_load(&e->data, scene, path, o->data, "test", &how));
  if (!e->data.count) return sf_fail(SF_E_FORMAT, "%s: no views", o->data);
  if (o->traces && o->view >= e->data.count)
    return sf_fail(SF_E_USAGE, "--view %d is out of range: %s has %d test views", o->view, o->data, e->data.count);
  return sf_ok();
}

void export_extras_close(export_extras *e)
{
  sf_dataset_free(&e->data);
}

sf_status export_extras_write(export_extras *e, const fx_scene *scene, const char *path, const export_options *o)
{
  if (o->vectors) SF_TRY(write_vectors(scene, path, &e->data, o, &e->kit));
  if (o->traces) SF_TRY(write_traces(scene, &e->data, o, &e->traces));
  return o->nir ? sf_nir_write_scene(o->nir, scene) : sf_ok();
}

void export_extras_print(const export_extras *e, const export_options *o)
{
  if (o->vectors) print_vectors(&e->kit, o->vectors);
  if (o->traces)
    printf("%s: spikes.csv, potentials.csv, samples.csv: %llu spikes in %llu time steps of %llu samples, %d rays\n",
           o->traces, (unsigned long long)e->traces.spikes, (unsigned long long)e->traces.timesteps,
           (unsigned long long)e->traces.samples, e->traces.rays);
  if (o->nir) printf("wrote %s: NIR graph\n", o->nir);
}

void export_extras_json(cJSON *json, const export_extras *e, const export_options *o)
{
  if (o->vectors) cJSON_AddItemToObject(json, "vectors", vectors_json(&e->kit, o->vectors));
  if (o->traces) cJSON_AddItemToObject(json, "traces", traces_json(&e->traces, o->traces));
  if (o->nir) cJSON_AddStringToObject(json, "nir", o->nir);
}
