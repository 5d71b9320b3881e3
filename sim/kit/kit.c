/* The folder: every file hashed as it is written, the manifest last. */
#include "sim/kit/kit.h"
#include "base/sha256.h"
#include "energy/energy.h"
#include "spikefield/spikefield.h"
#include <dirent.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define MANIFEST "manifest.json"

/* ---- files of the source tree ---- */

static sf_status copy_files(sf_kit_output *output)
{
  for (const sf_kit_file *from = sf_kit_files; from->name; from++) {
    sf_kit_writer file;
    SF_TRY(sf_kit_begin(output, &file, from->name));
    fwrite(from->data, 1, from->size, file.writer.file);
    SF_TRY(sf_kit_end(output, &file));
  }
  return sf_ok();
}

/* As simulators take it (-f in the folder, -F from elsewhere): the include folder, and the files in the order in which
 * they compile. */
static sf_status list_rtl(sf_kit_output *output)
{
  sf_kit_writer file;
  SF_TRY(sf_kit_begin(output, &file, "rtl.f"));
  fprintf(file.writer.file, "+incdir+rtl\n");
  for (const sf_kit_file *from = sf_kit_files; from->name; from++) {
    const size_t length = strlen(from->name);
    if (strncmp(from->name, "rtl/", 4) == 0 && strcmp(from->name + length - 3, ".sv") == 0)
      fprintf(file.writer.file, "%s\n", from->name);
  }
  return sf_kit_end(output, &file);
}

/* ---- manifest ---- */

static sf_status scene_json(const char *path, const fx_net *net, cJSON *json)
{
  static const char *const mode[] = {"hybrid", "decay", "no-decay", "radix"};
  char hash[65];
  const char *slash = strrchr(path, '/');
  SF_TRY(sf_sha256_file(path, hash));
  cJSON *scene = cJSON_AddObjectToObject(json, "scene");
  sf_json_add_text(scene, "name", slash ? slash + 1 : path);
  cJSON_AddStringToObject(scene, "sha256", hash);
  cJSON_AddNumberToObject(scene, "steps", net->steps);
  cJSON_AddStringToObject(scene, "mode", mode[net->mode]);
  cJSON *layers = cJSON_AddArrayToObject(scene, "layers");
  for (int l = 0; l < SF_LAYERS; l++) {
    cJSON *layer = cJSON_CreateObject();
    cJSON_AddStringToObject(layer, "layer", fx_layer_name(l));
    cJSON_AddNumberToObject(layer, "n_in", net->layer[l].n_in);
    cJSON_AddNumberToObject(layer, "n_out", net->layer[l].n_out);
    cJSON_AddNumberToObject(layer, "k", net->layer[l].k);
    cJSON_AddNumberToObject(layer, "theta", fx_net_theta(net, l));
    cJSON_AddItemToArray(layers, layer);
  }
  return sf_ok();
}

static void rays_json(const sf_kit_draw *draw, const sf_dataset *data, cJSON *json)
{
  cJSON *rays = cJSON_AddArrayToObject(json, "rays");
  for (int i = 0; i < draw->rays; i++) {
    const sf_kit_ray *r = &draw->ray[i];
    cJSON *ray = cJSON_CreateObject();
    sf_json_add_u64(ray, "ray", r->number);
    sf_json_add_text(ray, "view", data->view[r->view].name);
    cJSON_AddNumberToObject(ray, "x", r->x);
    cJSON_AddNumberToObject(ray, "y", r->y);
    cJSON_AddNumberToObject(ray, "samples", r->samples);
    cJSON_AddItemToArray(rays, ray);
  }
}

static void arch_json(cJSON *json)
{
  cJSON *arch = cJSON_AddObjectToObject(json, "arch");
#define SF_ARCH(name, value, meaning) cJSON_AddNumberToObject(arch, #name, value);
#include "spikefield/arch.def"
#undef SF_ARCH
}

static sf_status write_manifest(const sf_kit_output *output, const sf_kit_draw *draw, const sf_dataset *data,
                                const sf_kit_options *o, const sf_kit_report *report)
{
  char path[4096];
  SF_TRY(sf_kit_path(output, MANIFEST, path));
  cJSON *json = cJSON_CreateObject();
  cJSON_AddStringToObject(json, "format", "spikefield-vectors");
  cJSON_AddNumberToObject(json, "version", SF_KIT_VERSION);
  cJSON_AddStringToObject(json, "spikefield", SPIKEFIELD_VERSION);
  sf_json_add_u64(json, "seed", o->seed);
  cJSON_AddNumberToObject(json, "samples", report->samples);
  cJSON_AddNumberToObject(json, "input_beats", report->beats);
  cJSON_AddNumberToObject(json, "register_writes", report->writes);
  sf_status status = scene_json(o->scene_path, &draw->scene->net, json);
  arch_json(json);
  rays_json(draw, data, json);
  cJSON_AddItemReferenceToObject(json, "files", output->list);
  if (status.code == SF_OK) status = sf_json_save(json, path);
  cJSON_Delete(json);
  return status;
}

/* ---- the folder ---- */

static sf_status is_kit(const char *folder, bool *kit)
{
  const sf_kit_output output = {.folder = folder};
  char path[4096];
  SF_TRY(sf_kit_path(&output, SF_KIT_FIRST, path));
  *kit = access(path, F_OK) == 0;
  return sf_ok();
}

static bool is_empty(DIR *dir)
{
  const struct dirent *entry;
  while ((entry = readdir(dir)))
    if (strcmp(entry->d_name, ".") != 0 && strcmp(entry->d_name, "..") != 0 && strncmp(entry->d_name, ".sf-", 4) != 0)
      return false;
  return true;
}

sf_status sf_kit_check_folder(const char *folder)
{
  bool kit, empty = true;
  SF_TRY(is_kit(folder, &kit));
  DIR *dir = opendir(folder);
  if (!dir) return errno == ENOENT ? sf_ok() : sf_fail(SF_E_IO, "%s: %s", folder, strerror(errno));
  empty = is_empty(dir);
  closedir(dir);
  if (kit || empty) return sf_ok();
  return sf_fail(SF_E_USAGE, "%s: holds other things than a vector kit; name a new or empty folder", folder);
}

/* ---- all of it ---- */

static sf_status write_folder(sf_kit_output *output, const sf_kit_draw *draw, const sf_dataset *data,
                              const sf_kit_options *options, sf_kit_report *report)
{
  char path[4096];
  SF_TRY(sf_make_dir(output->folder));
  SF_TRY(sf_kit_path(output, MANIFEST, path));
  unlink(path); /* a folder without one is not whole */
  SF_TRY(sf_kit_images(output, draw, options, report));
  SF_TRY(sf_kit_rays(output, draw));
  SF_TRY(sf_kit_path(output, "rtl/gen", path));
  SF_TRY(sf_make_dir(path));
  SF_TRY(copy_files(output));
  SF_TRY(list_rtl(output));
  return write_manifest(output, draw, data, options, report);
}

sf_status sf_kit_write(const char *folder, const fx_scene *scene, const sf_dataset *data, const sf_kit_options *options,
                       sf_kit_report *report)
{
  sf_kit_output output = {.folder = folder, .list = cJSON_CreateArray()};
  sf_kit_draw draw;
  sf_status status = sf_kit_check_folder(folder);
  if (status.code != SF_OK) {
    cJSON_Delete(output.list);
    return status;
  }
  status = sf_kit_draw_samples(&draw, scene, data, options);
  *report = (sf_kit_report){.rays = draw.rays, .samples = draw.samples};
  if (status.code == SF_OK) status = write_folder(&output, &draw, data, options, report);
  report->files = output.files, report->bytes = output.bytes;
  sf_kit_draw_free(&draw);
  cJSON_Delete(output.list);
  return status;
}
