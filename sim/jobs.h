/* Numbered units of work over forked processes. What comes of them depends neither on how many processes there are nor
 * on which of them did what: results are handed over by unit, in order. */
#ifndef SF_SIM_JOBS_H
#define SF_SIM_JOBS_H
#include "base/status.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { SF_JOBS_MAX = 256 };

typedef struct sf_jobs {
  int processes;       /* 1..SF_JOBS_MAX */
  uint64_t first, end; /* units first .. end - 1 */
  size_t result_size;  /* bytes; without pointers, but for those to constants */
  /* In a process of its own: fills *result, which is zeroed. May poll sf_cli_interrupted() and end early. */
  void (*work)(void *user, uint64_t unit, void *result);
  /* In the caller's process, by unit in order. False: enough; units behind it are dropped, whatever their state. */
  bool (*take)(void *user, uint64_t unit, const void *result);
  /* In the caller's process, several times a second. May be NULL. */
  void (*tick)(void *user);
  void *user;
} sf_jobs;

/* Ends every process before it returns; they end with the caller's, too, whatever ends that. When interrupted
 * (sf_cli_interrupted), the units begun are told to end early and taken as they are; then SF_E_STOPPED. */
sf_status sf_jobs_run(const sf_jobs *jobs);
#endif
