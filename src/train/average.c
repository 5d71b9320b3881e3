/* The model that a run leaves is the mean of its parameters over the last iterations: the rate that still learns at the
 * end also shakes, and the mean takes the shaking out (Polyak & Juditsky 1992). Snapshots at fixed shares of the run,
 * so that the large hash grid costs the same in a long run as in a short one. */
#include "train/internal.h"
#include <string.h>

enum { SNAPSHOTS = 32 };

static const double tail = 0.025; /* of the run */

static int snapshots_due(double progress)
{
  const double share = (progress - (1 - tail)) / tail;
  return share > 0 ? (int)(share * SNAPSHOTS + 1e-6) : 0;
}

sf_status sf_average_reserve(sf_trainer *t)
{
  if (!t->average) t->average = sf_aligned_alloc(t->model.size * sizeof(float));
  return t->average ? sf_ok() : sf_fail(SF_E_MEMORY, "train: no memory to average %zu parameters", t->model.size);
}

sf_status sf_average_update(sf_trainer *t, double progress_before)
{
  if (snapshots_due(t->progress) > snapshots_due(progress_before)) {
    SF_TRY(sf_average_reserve(t));
    const float share = 1.0f / (float)++t->averaged, *value = t->model.value;
    float *average = t->average;
    if (t->averaged == 1) memset(average, 0, t->model.size * sizeof(float));
#pragma omp parallel for simd schedule(static)
    for (size_t i = 0; i < t->model.size; i++) average[i] += share * (value[i] - average[i]);
  }
  if (t->stage == 3 && t->averaged) memcpy(t->model.value, t->average, t->model.size * sizeof(float));
  return sf_ok();
}
