/* A whole co-simulation: random rays of a data set, cut into blocks that are dealt out to processes or ranks. Each
 * block has a fresh accelerator with a seed of its own. So totals and the first difference do not depend on the number
 * of processes. */
#ifndef SF_SIM_LOCKSTEP_H
#define SF_SIM_LOCKSTEP_H
#include "sim/cosim.h"
#include "ranks/ranks.h"
#include "scene/scene.h"
#include <stdio.h>

typedef struct sf_lockstep_options {
  const char *scene, *data;
  const char *split;                    /* "test", "train" */
  uint64_t seed, limit;                 /* limit: no block begins after this many samples; 0 = none */
  int rays, block, stall_percent, jobs; /* block: rays per block; jobs: processes or ranks, for reports */
  const char *plusarg;                  /* NULL or text */
  const char *port;                     /* of a board in place of the Verilated accelerator; or NULL */
  const char *checkpoint; /* file of the finished blocks: begun anew where it is missing, continued where it is there;
                             or NULL */
  const char *evidence;   /* of a difference: EVIDENCE.json to replay, EVIDENCE.fst; EVIDENCE-2 where these are there */
} sf_lockstep_options;

/* Blocks that are finished, and what they add up to. */
typedef struct sf_lockstep_state {
  uint64_t blocks, rays;
  sf_cosim_totals sum;
} sf_lockstep_state;

typedef struct sf_lockstep {
  sf_lockstep_options options;
  fx_scene fx;
  sf_dataset data;
  uint64_t blocks; /* finished */
  uint64_t rays;
  sf_cosim_totals sum;
  uint64_t energy_core_fj, energy_rtl_fj;
  sf_cosim_place place;    /* found: the first difference */
  char wire[64];           /* of the difference; place points here */
  sf_replay replay;        /* the samples that show it */
  char evidence[4096 - 8]; /* prefix of the files that keep it, "" if none were written */
  bool replays;            /* the samples of the replay file show it */
  bool partial;            /* the last blocks were interrupted; no checkpoint is written of them */
  bool stopping;           /* interrupted; the checkpoint has what was finished at that time */
  bool complete;           /* every ray, or the limit */
  uint64_t resumed;        /* samples that the checkpoint brought along */
  sf_ranks *ranks;         /* who does the work; set by the caller, NULL: this process */
  void (*tick)(void *user, const struct sf_lockstep *lockstep); /* several times a second; or NULL */
  void *user;
  double saved;            /* time of the last checkpoint */
  uint64_t kept;           /* rays in it */
  sf_lockstep_state whole; /* without a last block of fewer rays: a run of more rays continues from here */
  sf_status unwritten;     /* of a difference: why its evidence could not be written, or SF_OK */
  char identity[65]; /* of program, scene, data and options but the number of rays: a checkpoint is continued by nothing
                        else */
  sf_status trouble; /* what ended it */
} sf_lockstep;

sf_status sf_lockstep_load(sf_lockstep *lockstep, const sf_lockstep_options *options);
/* Call it on every rank. Rank 0 alone has totals, checkpoint and evidence. SF_E_DIFFERENCE: `place` says where, and the
 * evidence is written unless `unwritten` says why not. SF_E_STOPPED: the run was interrupted, and the totals are those
 * of what was compared until then. */
sf_status sf_lockstep_run(sf_lockstep *lockstep);
/* View and pixel of a ray. */
typedef struct sf_lockstep_pixel {
  int view, x, y;
} sf_lockstep_pixel;
enum { SF_LOCKSTEP_STREAM = 4 }; /* of random numbers: the first one that the choice of rays does not use */
sf_lockstep_pixel sf_lockstep_pick(const sf_lockstep *lockstep, uint64_t ray);
/* Sets both energies from the sums: equal counts have equal energy. */
sf_status sf_lockstep_energy(sf_lockstep *lockstep);
void sf_lockstep_free(sf_lockstep *lockstep);

/* ---- reports ---- */

/* "ray 3 (view r_1, pixel 2,7) sample 5: layer C2 ...: expected 1, actual 0, cycle 21676" */
sf_status sf_lockstep_difference(const sf_lockstep *lockstep, const sf_status *status);
cJSON *sf_lockstep_json(const sf_lockstep *lockstep, const sf_status *status, double seconds);
void sf_lockstep_print(FILE *out, const sf_lockstep *lockstep, double seconds);
/* One test suite: outputs, spikes, membranes, rows, counters, energy of this run. */
sf_status sf_lockstep_junit(const sf_lockstep *lockstep, const sf_status *status, double seconds, const char *path);
/* ", layer C2 step 1 neuron 64 row: expected 1, actual 0, cycle 20517" without the comma; text[200]. */
void sf_difference_text(const sf_difference *difference, char text[200]);
#endif
