/* The few samples that show a difference, as a file that needs nothing but the scene. */
#ifndef SF_SIM_REPLAY_H
#define SF_SIM_REPLAY_H
#include "sim/compare.h"
#include <cjson/cJSON.h>

enum { SF_REPLAY_MAX = 128, SF_PLUSARG_MAX = 63 };

typedef struct sf_replay_sample {
  uint64_t ray, sample;              /* for the reader: `sample` counts from 0 along the ray */
  bool first;                        /* the direction is sent with it */
  int16_t dir[FX_SH], f[SF_DIR_MAX]; /* [fx_net_inputs] */
} sf_replay_sample;

typedef struct sf_replay {
  uint64_t seed; /* of stalls and register contents at power-on */
  int stall_percent;
  char plusarg[SF_PLUSARG_MAX + 1]; /* "" for none */
  bool other_program;               /* of a loaded file: another program wrote it */
  const char *other_block;          /* of a loaded file: how this program's block differs from the file's; or NULL */
  int count;
  sf_replay_sample sample[SF_REPLAY_MAX];
} sf_replay;

/* The result of a replay. */
typedef struct sf_replayed {
  bool differs;
  int at;             /* index of the sample that differs; the last one for a counter */
  sf_difference what; /* wire NULL: the accelerator gave no result, and `message` says how */
  char message[400];
} sf_replayed;

/* Compares the samples, then the counters, on a fresh accelerator. wave: FST file of the last two samples, or NULL. */
sf_status sf_replay_run(const sf_replay *replay, const fx_net *net, const char *wave, sf_replayed *replayed);
/* Keeps the fewest samples, ending with the last one, that still show a difference: 2, 4, 8... of them. Returns false
 * if not even all of them show one. */
sf_status sf_replay_shrink(sf_replay *replay, const fx_net *net, bool *differs);

/* JSON: SHA-256 of this program, its block (--dut), scene path and SHA-256, seed, stalls, samples. `difference`, which
 * may be NULL, is for the reader and is freed.
 */
sf_status sf_replay_json(const sf_replay *replay, const char *scene, cJSON *difference, cJSON **json);
sf_status sf_replay_save(const sf_replay *replay, const char *scene, cJSON *difference, const char *path);
/* Checks every field. The scene's contents must be what they were. *scene: malloc'ed path. */
sf_status sf_replay_load(sf_replay *replay, char **scene, const char *path);
#endif
