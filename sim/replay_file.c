/* Replay files. */
#include "sim/replay.h"
#include "sim/other_dut.h"
#include "base/sha256.h"
#include "energy/energy.h"
#include "base/json.h"
#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#define FORMAT "spikefield replay 1"
#define PROGRAM "/proc/self/exe"
enum { INPUT_MAX = (1 << (SF_INPUT_BITS - 1)) - 1 };

static cJSON *values_json(const int16_t *value, int n)
{
  cJSON *array = cJSON_CreateArray();
  for (int i = 0; i < n; i++) cJSON_AddItemToArray(array, cJSON_CreateNumber(value[i]));
  return array;
}

static cJSON *sample_json(const sf_replay_sample *s)
{
  cJSON *json = cJSON_CreateObject();
  sf_json_add_u64(json, "ray", s->ray);
  sf_json_add_u64(json, "sample", s->sample);
  cJSON_AddBoolToObject(json, "first", s->first);
  cJSON_AddItemToObject(json, "direction", values_json(s->dir, FX_SH));
  cJSON_AddItemToObject(json, "features", values_json(s->f, SF_DIR_MAX));
  return json;
}

/* The seed is text: a JSON number would lose its last bits. */
static cJSON *make_json(const sf_replay *replay, const char *scene, const char *hash, const char *program)
{
  char seed[32];
  cJSON *json = cJSON_CreateObject();
  snprintf(seed, sizeof seed, "%" PRIu64, replay->seed);
  cJSON_AddStringToObject(json, "format", FORMAT);
  cJSON_AddStringToObject(json, "program_sha256", program);
  cJSON_AddStringToObject(json, "scene", scene);
  cJSON_AddStringToObject(json, "scene_sha256", hash);
  cJSON_AddStringToObject(json, "seed", seed);
  cJSON_AddNumberToObject(json, "stall_percent", replay->stall_percent);
  cJSON_AddStringToObject(json, "plusarg", replay->plusarg);
  cJSON *samples = cJSON_AddArrayToObject(json, "samples");
  for (int i = 0; i < replay->count; i++) cJSON_AddItemToArray(samples, sample_json(&replay->sample[i]));
  return json;
}

sf_status sf_replay_json(const sf_replay *replay, const char *scene, cJSON *difference, cJSON **json)
{
  char hash[65], program[65], *whole = realpath(scene, NULL);
  cJSON *dut = NULL;
  sf_status status = sf_sha256_file(scene, hash);
  if (status.code == SF_OK) status = sf_sha256_file(PROGRAM, program);
  if (status.code == SF_OK) status = sf_other_dut_own(&dut);
  if (!whole && status.code == SF_OK) status = sf_fail(SF_E_IO, "%s: %s", scene, strerror(errno));
  if (status.code != SF_OK) {
    cJSON_Delete(difference);
    cJSON_Delete(dut);
    free(whole);
    return status;
  }
  *json = make_json(replay, whole, hash, program);
  if (dut) cJSON_AddItemToObject(*json, "dut", dut);
  if (difference) cJSON_AddItemToObject(*json, "difference", difference);
  free(whole);
  return sf_ok();
}

sf_status sf_replay_save(const sf_replay *replay, const char *scene, cJSON *difference, const char *path)
{
  cJSON *json;
  SF_TRY(sf_replay_json(replay, scene, difference, &json));
  const sf_status status = sf_json_save(json, path);
  cJSON_Delete(json);
  return status;
}

/* ---- loading ---- */

static sf_status load_values(const cJSON *json, const char *path, const char *key, int n, int16_t *value)
{
  const cJSON *array = sf_json_get(json, key), *item;
  int i = 0;
  if (!cJSON_IsArray(array) || cJSON_GetArraySize(array) > n)
    return sf_fail(SF_E_FORMAT, "%s: %s of a sample is no array of at most %d values", path, key, n);
  cJSON_ArrayForEach(item, array)
  {
    if (!cJSON_IsNumber(item) || item->valuedouble != item->valueint || abs(item->valueint) > INPUT_MAX)
      return sf_fail(SF_E_FORMAT, "%s: %s of a sample: value %d is no integer of -%d..%d", path, key, i, INPUT_MAX,
                     INPUT_MAX);
    value[i++] = (int16_t)item->valueint;
  }
  return sf_ok();
}

static sf_status load_sample(const cJSON *json, const char *path, sf_replay_sample *s)
{
  double ray, sample;
  SF_TRY(sf_json_need_whole(json, path, "ray", 0, 0x1p53, &ray));
  SF_TRY(sf_json_need_whole(json, path, "sample", 0, 0x1p53, &sample));
  s->ray = (uint64_t)ray;
  s->sample = (uint64_t)sample;
  s->first = cJSON_IsTrue(sf_json_get(json, "first"));
  SF_TRY(load_values(json, path, "direction", FX_SH, s->dir));
  return load_values(json, path, "features", SF_DIR_MAX, s->f);
}

static sf_status load_samples(const cJSON *json, const char *path, sf_replay *replay)
{
  const cJSON *samples = sf_json_get(json, "samples"), *item;
  const int n = cJSON_IsArray(samples) ? cJSON_GetArraySize(samples) : 0;
  if (n < 1 || n > SF_REPLAY_MAX) return sf_fail(SF_E_FORMAT, "%s: samples is no array of 1..%d", path, SF_REPLAY_MAX);
  cJSON_ArrayForEach(item, samples) SF_TRY(load_sample(item, path, &replay->sample[replay->count++]));
  return sf_ok();
}

static sf_status load_run(const cJSON *json, const char *path, sf_replay *replay)
{
  char format[64], seed[64];
  double stalls;
  char *end;
  SF_TRY(sf_json_need_text(json, path, "format", format, sizeof format));
  if (strcmp(format, FORMAT) != 0)
    return sf_fail(SF_E_FORMAT, "%s: format is '%.40s', expected '" FORMAT "'", path, format);
  SF_TRY(sf_json_need_text(json, path, "seed", seed, sizeof seed));
  errno = 0;
  replay->seed = strtoull(seed, &end, 10);
  if (*seed < '0' || *seed > '9' || *end || errno)
    return sf_fail(SF_E_FORMAT, "%s: seed is '%.40s', no integer", path, seed);
  SF_TRY(sf_json_need_whole(json, path, "stall_percent", 0, 90, &stalls));
  replay->stall_percent = (int)stalls;
  SF_TRY(sf_json_need_text(json, path, "plusarg", replay->plusarg, sizeof replay->plusarg));
  return load_samples(json, path, replay);
}

static sf_status same_scene(const cJSON *json, const char *path, char **scene)
{
  char name[4096], expected[65], hash[65];
  SF_TRY(sf_json_need_text(json, path, "scene", name, sizeof name));
  SF_TRY(sf_json_need_text(json, path, "scene_sha256", expected, sizeof expected));
  SF_TRY(sf_sha256_file(name, hash));
  if (strcmp(hash, expected) != 0)
    return sf_fail(SF_E_FORMAT, "%s: the scene has changed: %s has SHA-256 %.12s..., the replay is of %.12s...", path,
                   name, hash, expected);
  *scene = strdup(name);
  return *scene ? sf_ok() : sf_fail(SF_E_MEMORY, "%s: out of memory", path);
}

/* A file without this field is older, so another program wrote it. */
static sf_status same_program(const cJSON *json, bool *other)
{
  const char *writer = sf_json_text(json, "program_sha256");
  char hash[65];
  SF_TRY(sf_sha256_file(PROGRAM, hash));
  *other = !writer || strcmp(writer, hash) != 0;
  return sf_ok();
}

static sf_status same_block(const cJSON *json, const char **other)
{
  cJSON *own;
  SF_TRY(sf_other_dut_own(&own));
  *other = sf_other_dut_departs(own, sf_json_get(json, "dut"));
  cJSON_Delete(own);
  return sf_ok();
}

sf_status sf_replay_load(sf_replay *replay, char **scene, const char *path)
{
  cJSON *json;
  memset(replay, 0, sizeof *replay);
  *scene = NULL;
  SF_TRY(sf_json_load(path, &json));
  sf_status status = load_run(json, path, replay);
  if (status.code == SF_OK) status = same_program(json, &replay->other_program);
  if (status.code == SF_OK) status = same_block(json, &replay->other_block);
  if (status.code == SF_OK) status = same_scene(json, path, scene);
  cJSON_Delete(json);
  return status;
}
