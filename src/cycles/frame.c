#include "cycles/frame.h"
#include "energy/energy.h"
#include <stdlib.h>

enum { BAND = FX_TILE /* rows of pixels between two looks at the models */ };

/* ---- a build ---- */

sf_status sf_machine_open(sf_machine *machine, const fx_scene *scene, const sf_engine *engine, int latency)
{
  static const fx_cache_shape built = {SF_CACHE_BYTES, SF_CACHE_WAYS};
  if (scene->backbone == FX_TENSORF) return sf_planes_model_open(&machine->planes, scene, engine, &built, latency);
  machine->nets = sf_cycle_model_create(&scene->net, engine);
  return machine->nets ? sf_ok() : sf_fail(SF_E_MEMORY, "no memory for the cycle model");
}

void sf_machine_close(sf_machine *machine)
{
  sf_planes_model_close(machine->planes);
  sf_cycle_model_free(machine->nets);
  *machine = (sf_machine){.nets = NULL};
}

sf_cycle_totals sf_machine_totals(const sf_machine *machine)
{
  if (!machine->planes) return *sf_cycle_model_totals(machine->nets);
  sf_cycle_totals totals = *sf_planes_model_engine(machine->planes);
  const uint64_t cycles = sf_planes_model_totals(machine->planes)->cycles;
  if (cycles) totals.waits += cycles - totals.cycles;
  totals.cycles = cycles;
  return totals;
}

static void drain(const sf_machine *machine)
{
  if (machine->planes)
    sf_planes_model_drain(machine->planes);
  else
    sf_cycle_model_drain(machine->nets);
}

/* ---- a band of rows: of a hash grid its rows, of TensoRF its tiles ---- */

typedef struct part {
  sf_cycle_record nets;
  sf_planes_record planes;
} part;

static sf_status record(const sf_frame_job *job, int left, int top, int width, int height, part *to)
{
  to->nets.count = to->planes.count = to->planes.nets.count = 0;
  for (int y = top; y < top + height; y++)
    for (int x = left; x < left + width; x++) {
      fx_ray ray;
      SF_TRY(sf_pixel_ray(job->scene, job->data, job->view, x, y, &ray));
      if (job->scene->backbone == FX_TENSORF)
        SF_TRY(sf_planes_record_ray(&to->planes, job->scene, &ray));
      else
        SF_TRY(sf_cycle_record_ray(&to->nets, job->scene, &ray));
    }
  return sf_ok();
}

static int smaller(int a, int b)
{
  return a < b ? a : b;
}

static sf_status record_part(const sf_frame_job *job, int i, int top, int rows, part *to)
{
  const int width = job->view->camera.width, left = i * FX_TILE;
  if (job->scene->backbone == FX_INGP) return record(job, 0, top + i, width, 1, to);
  return record(job, left, top, smaller(FX_TILE, width - left), rows, to);
}

static void add(const sf_machine *machine, const part *from)
{
  if (machine->planes) sf_planes_model_add(machine->planes, &from->planes, true);
  for (size_t s = 0; s < from->nets.count; s++) sf_cycle_model_add(machine->nets, &from->nets.at[s]);
}

static sf_status sample_alone(const fx_scene *scene, const sf_engine *engine, const part *from, uint64_t *latency)
{
  const sf_cycle_record *nets = from->nets.count ? &from->nets : &from->planes.nets;
  if (*latency || nets->count == 0) return sf_ok();
  sf_cycle_model *alone = sf_cycle_model_create(&scene->net, engine);
  if (!alone) return sf_fail(SF_E_MEMORY, "no memory for the cycle model");
  sf_cycle_model_add(alone, &nets->at[0]);
  sf_cycle_model_drain(alone);
  *latency = sf_cycle_model_totals(alone)->cycles;
  sf_cycle_model_free(alone);
  return sf_ok();
}

static sf_status run_band(const sf_frame_job *job, const sf_engine *engine, int top, int rows, part *parts,
                          sf_status *each, uint64_t *latency)
{
  const int across = (job->view->camera.width + FX_TILE - 1) / FX_TILE;
  const int n = job->scene->backbone == FX_TENSORF ? across : rows;
#pragma omp parallel for schedule(dynamic)
  for (int i = 0; i < n; i++) each[i] = record_part(job, i, top, rows, &parts[i]);
  for (int i = 0; i < n; i++) {
    SF_TRY(each[i]);
    SF_TRY(sample_alone(job->scene, engine, &parts[i], latency));
  }
#pragma omp parallel for schedule(dynamic)
  for (int m = 0; m < job->machines; m++)
    for (int i = 0; i < n; i++) add(&job->machine[m], &parts[i]);
  return sf_ok();
}

sf_status sf_frame_run(const sf_frame_job *job, const sf_engine *engine, uint64_t *latency)
{
  const int height = job->view->camera.height, across = (job->view->camera.width + FX_TILE - 1) / FX_TILE;
  const size_t n = (size_t)(across > BAND ? across : BAND);
  part *parts = calloc(n, sizeof *parts);
  sf_status *each = calloc(n, sizeof *each);
  sf_status status = parts && each ? sf_ok() : sf_fail(SF_E_MEMORY, "no memory for a band of rows");
  *latency = 0;
  for (int y = 0; y < height && status.code == SF_OK; y += BAND) {
    const int rows = smaller(BAND, height - y);
    status = run_band(job, engine, y, rows, parts, each, latency);
    if (job->tick) job->tick(job->user, y + rows);
  }
  for (int m = 0; m < job->machines; m++) drain(&job->machine[m]);
  for (size_t i = 0; parts && i < n; i++) sf_cycle_record_free(&parts[i].nets), sf_planes_record_free(&parts[i].planes);
  free(parts), free(each);
  return status;
}
