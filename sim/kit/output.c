/* One file of the kit, hashed as it is written. */
#include "sim/kit/kit.h"
#include "base/sha256.h"
#include <sys/stat.h>

sf_status sf_kit_path(const sf_kit_output *output, const char *name, char path[4096])
{
  if (snprintf(path, 4096, "%s/%s", output->folder, name) < 4096) return sf_ok();
  return sf_fail(SF_E_RANGE, "%s: the path is too long", output->folder);
}

sf_status sf_kit_begin(const sf_kit_output *output, sf_kit_writer *file, const char *name)
{
  char path[4096];
  file->name = name;
  SF_TRY(sf_kit_path(output, name, path));
  return sf_writer_open(&file->writer, path);
}

sf_status sf_kit_end(sf_kit_output *output, sf_kit_writer *file)
{
  struct stat info;
  char path[4096], hash[65];
  SF_TRY(sf_kit_path(output, file->name, path));
  SF_TRY(sf_writer_commit(&file->writer));
  SF_TRY(sf_sha256_file(path, hash));
  if (stat(path, &info)) return sf_fail(SF_E_IO, "%s: cannot be read back", path);
  cJSON *entry = cJSON_CreateObject();
  cJSON_AddStringToObject(entry, "name", file->name);
  cJSON_AddNumberToObject(entry, "bytes", (double)info.st_size);
  cJSON_AddStringToObject(entry, "sha256", hash);
  cJSON_AddItemToArray(output->list, entry);
  output->files++;
  output->bytes += (uint64_t)info.st_size;
  return sf_ok();
}
