/* A view through the cycle models of builds. */
#ifndef SF_CYCLES_FRAME_H
#define SF_CYCLES_FRAME_H
#include "cycles/planes.h"
#include "scene/scene.h"

/* A build of the accelerator at a scene: of a hash grid the engine, which begins where features come in; of TensoRF
 * from positions on. Zero it first. */
typedef struct sf_machine {
  sf_cycle_model *nets;
  sf_planes_model *planes; /* NULL: a hash grid */
} sf_machine;
/* latency: of TensoRF's memory, as sf_planes_model_open. */
sf_status sf_machine_open(sf_machine *machine, const fx_scene *scene, const sf_engine *engine, int latency);
void sf_machine_close(sf_machine *machine);
/* Of the engine; cycles of the whole, and those in which the engine had nothing to do among its waits. */
sf_cycle_totals sf_machine_totals(const sf_machine *machine);

typedef struct sf_frame_job {
  const fx_scene *scene;
  const sf_dataset *data;
  const sf_view *view;
  sf_machine *machine; /* of which the first gives latency */
  int machines;
  void (*tick)(void *user, int rows); /* of pixels that are done; or NULL */
  void *user;
} sf_frame_job;

/* *latency: cycles of the frame's first sample of the nets, alone in an empty engine; 0: there is none. */
sf_status sf_frame_run(const sf_frame_job *job, const sf_engine *engine, uint64_t *latency);
#endif
