/* Three ranks train, and count rays, as one program alone does: the same bits. */
#include "train_fixture.h"
#include "energy/energy.h"
#include "tests/audit_fixture.h"
#include "tests/ranks_fixture.h"
#include <omp.h>

static bool same(bool holds, const char *what)
{
  if (!holds) fprintf(stderr, "rank %d: %s\n", job_link.rank, what);
  return holds;
}

/* ---- training ---- */

static sf_train_options grid_run(void)
{
  sf_train_options o = small_run();
  o.config.hidden = 16, o.config.levels = 2, o.config.steps = 3, o.samples = 256, o.stage1 = 8, o.stage2 = 12;
  o.beta = 3e-6;
  return o;
}

static sf_train_options charged_run(void)
{
  sf_train_options o = grid_run();
  o.fixed_steps = 2, o.charge = 1, o.stage1 = 4, o.stage2 = 8;
  sf_config_bound(&o.config, 2);
  o.config.finest_res = 64;
  return o;
}

static sf_train_options planes_run(void)
{
  sf_train_options o = sf_train_defaults_tensorf(&data);
  o.config.hidden = 16, o.config.steps = 2, o.config.occ_res = 16, o.voxels = 16, o.rays = 96, o.samples = 1024;
  o.stage1 = 6, o.stage2 = 10;
  for (int a = 0; a < 3; a++) o.config.tensorf.resolution[a] = 8 + a;
  return o;
}

static sf_trainer *trained(sf_train_options o, sf_ranks *ranks, const char *resume, int iterations)
{
  sf_trainer *t = NULL;
  sf_train_stats stats;
  o.ranks = ranks;
  sf_status status = sf_trainer_create(&t, &data, &o, resume);
  for (int i = 0; i < iterations && !status.code; i++) status = sf_trainer_step(t, &stats);
  if (!status.code) return t;
  fprintf(stderr, "rank %d: %s\n", job_link.rank, status.message);
  sf_trainer_free(t);
  return NULL;
}

static bool trains_alike(sf_ranks *ranks, sf_train_options (*options)(void))
{
  const sf_train_options o = options();
  bool good = false;
  sf_trainer *together = trained(o, ranks, NULL, o.stage1 + o.stage2),
             *alone = trained(o, NULL, NULL, o.stage1 + o.stage2);
  if (together && alone) {
    const size_t bytes = alone->model.size * sizeof(float);
    good = same(!memcmp(together->model.value, alone->model.value, bytes), "other weights");
    good &= same(!memcmp(together->moment1, alone->moment1, bytes), "other first moments");
    good &= same(!memcmp(together->moment2, alone->moment2, bytes), "other second moments");
    good &= same(together->model.t_star == alone->model.t_star && together->samples == alone->samples &&
                     together->rays == alone->rays,
                 "other numbers");
    good &= same(!memcmp(&together->search, &alone->search, sizeof alone->search), "another search");
    good &= same(!memcmp(&together->health, &alone->health, sizeof alone->health), "another health");
    good &= same(!memcmp(together->firing, alone->firing, sizeof alone->firing), "other firing");
    good &=
        same(together->row_reads == alone->row_reads && together->charge.reads == alone->charge.reads, "other reads");
  }
  sf_trainer_free(together), sf_trainer_free(alone);
  return sf_ranks_agree(ranks, sf_ok()).code == SF_OK && good;
}

/* With this on rank 2, which differs from the others. */
static bool refused(sf_ranks *ranks, const sf_train_options *o, const char *word)
{
  sf_trainer *t = NULL;
  const sf_status status = sf_trainer_create(&t, &data, o, NULL);
  if (!status.code) sf_trainer_free(t);
  bool good = same(status.code == SF_E_UNSUPPORTED && strstr(status.message, "rank 2"), status.message);
  good &= same(strstr(status.message, word) != NULL, status.message);
  return sf_ranks_agree(ranks, sf_ok()).code == SF_OK && good;
}

/* Ranks with other pictures, cameras, or places in the world do not train together. */
static bool refuses_other_data(sf_ranks *ranks)
{
  sf_train_options o = grid_run();
  const sf_image *last = &data.view[data.count - 1].image;
  float *const number[] = {&data.view[1].camera.fx, &data.scale, &data.offset[2]};
  bool good = true;
  o.ranks = ranks;
  for (int i = 0; i < COUNT(number); i++) {
    const float before = *number[i];
    *number[i] += job_link.rank == 2 ? 0.25f : 0;
    good &= refused(ranks, &o, "data set");
    *number[i] = before;
  }
  uint16_t *const value = &last->rgba[4 * (size_t)last->width * (size_t)last->height - 1];
  *value ^= job_link.rank == 2;
  good &= refused(ranks, &o, "data set");
  *value ^= job_link.rank == 2;
  return good;
}

/* ---- counting ---- */

static sf_status make_ray(void *user, uint64_t index, fx_ray *ray)
{
  const uint64_t *failing = user;
  if (index == *failing) return sf_fail(SF_E_RANGE, "no ray %d", (int)index);
  audit_ray(index, ray);
  ray->count = 3;
  return sf_ok();
}

static uint64_t small_tile(void *user, uint64_t index)
{
  (void)user;
  return index / 37;
}

static uint64_t large_tile(void *user, uint64_t index)
{
  (void)user;
  return index / 9000; /* goes on behind a slice for longer than its bits reach */
}

static bool count_alike(sf_ranks *ranks, const fx_scene *scene, uint64_t (*tile)(void *, uint64_t), uint64_t failing)
{
  sf_measure m[2];
  sf_status status[2];
  sf_measure_job job = {.scene = scene,
                        .rays = 14000,
                        .ray = make_ray,
                        .user = &failing,
                        .seed = 7,
                        .check = 200,
                        .cache = {1024, 2},
                        .tile = tile};
  for (int alone = 0; alone < 2; alone++) {
    job.ranks = alone ? NULL : ranks;
    status[alone] = sf_measure_rays(&job, &m[alone]);
  }
  bool good = same(status[0].code == status[1].code, status[0].message);
  if (failing < job.rays)
    good &= same(status[0].code == SF_E_RANGE && strstr(status[0].message, "no ray"), "no failure");
  else if (!job_link.rank) {
    good &= same(!memcmp(&m[0].core, &m[1].core, sizeof m[0].core), "other counts");
    good &= same(!memcmp(&m[0].memory, &m[1].memory, sizeof m[0].memory), "other memory");
    good &= same(!memcmp(&m[0].checked_core, &m[1].checked_core, sizeof m[0].core), "other checked counts");
    good &= same(!memcmp(&m[0].checked_memory, &m[1].checked_memory, sizeof m[0].memory), "other checked memory");
    good &= same(!memcmp(&m[0].recount, &m[1].recount, sizeof m[0].core), "another recount");
    good &= same(m[0].checked == 200 && m[0].rays == m[1].rays, "other rays");
    good &= same(!memcmp(m[0].hit, m[1].hit, job.rays / 8), "other hits");
  }
  if (!status[0].code) sf_measure_free(&m[0]);
  if (!status[1].code) sf_measure_free(&m[1]);
  return sf_ranks_agree(ranks, sf_ok()).code == SF_OK && good;
}

static bool counts_alike(sf_ranks *ranks)
{
  static const fixture_sizes sizes = {2, 8, 4, 4, 8, 8, 2, FX_HYBRID, {0}};
  fx_scene scene = fixture_scene(&sizes, 3);
  bool good = count_alike(ranks, &scene, small_tile, UINT64_MAX) & count_alike(ranks, &scene, large_tile, UINT64_MAX) &
              count_alike(ranks, &scene, small_tile, 13000);
  fx_scene_free(&scene);
  return good;
}

static bool all_of_it(sf_ranks *ranks)
{
  omp_set_num_threads(1);
  if (!job_link.rank) {
    const sf_procedural_options o = {.width = 16, .height = 16, .train_views = 4, .test_views = 1, .seed = 1};
    ck_ok(sf_procedural_write("simple", in("scene"), &o, NULL, NULL));
  }
  if (sf_ranks_agree(ranks, sf_ok()).code) return false;
  data = load("train");
  bool good = trains_alike(ranks, grid_run);
  good &= trains_alike(ranks, charged_run);
  good &= trains_alike(ranks, planes_run);
  good &= refuses_other_data(ranks);
  good &= counts_alike(ranks);
  sf_dataset_free(&data);
  return good;
}

TEST(ranks_work_as_one)
{
  job_run(all_of_it);
}

int ck_timeout = 120;
ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};
