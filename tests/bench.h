/* Shared by the files of the benchmark. */
#ifndef SF_TESTS_BENCH_H
#define SF_TESTS_BENCH_H
#include "scene/scene.h"
#include "base/status.h"
#include <cjson/cJSON.h>

/* Measured on the spot, all threads, per second. */
typedef struct ceilings {
  double fma;   /* multiply-adds of the training kernels */
  double dot8;  /* 8-bit multiply-adds */
  double spike; /* 8-bit multiply-adds of the fixed-point core's products with spikes: on tiles where there are some */
  double bytes; /* of memory, read */
  double reads; /* of a random place of a table of 4 MiB */
} ceilings;

/* kernels: the name of the training kernels. */
ceilings ceilings_measure(const char *kernels);

/* One line and one entry of the JSON. ceiling, naive: NAN = none. Where the unit is seconds, less is better. */
void put(cJSON *json, const char *name, double value, const char *unit, double ceiling, double naive);

/* scene, twin, data: a fixed-point scene, the float ReLU twin and their data set; scene NULL: no frame. */
sf_status bench_fixed(cJSON *json, const ceilings *c, const char *scene, const char *twin, const char *data);
sf_status bench_rtl(cJSON *json);
sf_status bench_tensorf(cJSON *json, const ceilings *c, const sf_dataset *data);
#endif
