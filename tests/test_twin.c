/* The audit's ReLU twin: samples of its own float rendering, its products, its price; and files of prices by name. */
#include "ck_run.h"
#include "energy/energy.h"
#include "tests/float_fixture.h"
#include "tests/folder_fixture.h"
#include <unistd.h>

enum { RAYS = 700 };

/* Through the box, from one side; a ray in five looks away. */
static void twin_ray(void *user, uint64_t index, float origin[3], float direction[3])
{
  uint64_t *asked = user;
  if (asked) *asked += index;
  for (int a = 0; a < 3; a++) origin[a] = 0.8f * test_random(1000 + 3 * index + (uint64_t)a);
  origin[2] = -4;
  direction[0] = direction[1] = 0, direction[2] = index % 5 ? 1 : -1;
}

static const char *saved(sf_net_kind net, const char *name)
{
  OWNED(sf_model) model = test_model(net, SF_HYBRID, 32, 2, 0.4f);
  memset(model.occupancy, 0x5a, 8 * 8 * 8 / 8);
  ck_ok(sf_model_save(&model, in(name)));
  return in(name);
}

static bool stop_after(void *user, uint64_t done)
{
  (void)user;
  return done < RAYS;
}

/* Ray by ray, one at a time. */
TEST(samples_and_products)
{
  const char *path = saved(SF_NET_ANN, "twin.safetensors");
  static const float white[3] = {1, 1, 1};
  uint64_t asked = 0, wanted = 0;
  sf_twin twin;
  const sf_twin_job job = {.path = path, .rays = RAYS, .ray = twin_ray, .user = &asked};
  ck_ok(sf_twin_count(&job, &twin));
  ck_assert_uint_eq(asked, RAYS * (RAYS - 1) / 2); /* each ray once */
  ck_assert_str_eq(twin.path, path);
  OWNED(sf_model) model = {0};
  ck_ok(sf_model_load(&model, path));
  for (uint64_t i = 0; i < RAYS; i++) {
    float o[3], d[3], rgb[3], samples = 0;
    twin_ray(NULL, i, o, d);
    ck_ok(sf_render_rays(&model, o, d, 1, 1, white, rgb, NULL, NULL, &samples));
    wanted += (uint64_t)samples;
  }
  ck_assert_uint_gt(wanted, RAYS);
  ck_assert_uint_eq(twin.samples, wanted);
  /* 8 features, 32 neurons; density and 15 of h; 16 of the direction and h; 32 neurons; three colours */
  ck_assert_uint_eq(twin.macs, 8 * 32 + 32 * 16 + 31 * 32 + 32 * 32 + 32 * 3);
}

TEST(what_is_no_twin)
{
  sf_twin twin;
  sf_twin_job job = {.path = saved(SF_NET_SNN, "spiking.safetensors"), .rays = 10, .ray = twin_ray};
  ck_bad(sf_twin_count(&job, &twin), SF_E_UNSUPPORTED, "spiking.safetensors", "expected a ReLU twin");
  job.path = in("none.safetensors");
  ck_bad(sf_twin_count(&job, &twin), SF_E_IO, "none.safetensors", "");
  ck_assert_uint_eq(twin.samples + twin.macs, 0);
}

TEST(a_twin_that_is_stopped)
{
  sf_twin twin;
  sf_twin_job job = {.path = saved(SF_NET_ANN, "twin.safetensors"), .rays = RAYS, .ray = twin_ray, .tick = stop_after};
  ck_bad(sf_twin_count(&job, &twin), SF_E_STOPPED, "stopped after 700 of 700 rays", "twin");
  ck_assert_uint_eq(twin.macs, 0);
  job.rays = RAYS - 1;
  ck_ok(sf_twin_count(&job, &twin));
}

TEST(its_price)
{
  sf_technology t = {.count = 1};
  sf_twin twin = {.samples = 1000, .macs = 50};
  t.price[SF_PRICE_FP32_MAC].fj = 4600;
  ck_ok(sf_twin_price(&t, 57500000, &twin));
  ck_assert_uint_eq(twin.fj, 230000000);
  ck_assert_double_eq(twin.saving_percent, 75);
  twin.samples = UINT64_MAX / 4600 / 50 + 1;
  ck_bad(sf_twin_price(&t, 1, &twin), SF_E_RANGE, "does not fit in 64 bits", "fewer views");
}

/* ---- technologies by name ---- */

/* Of a path, and of a name beside the program: this one's folder is BUILD/tests, the prices are in BUILD/share. */
TEST(technologies_by_name)
{
  sf_technology by_name, by_path;
  ck_ok(sf_technology_find(&by_name, "sky130"));
  ck_ok(sf_technology_find(&by_path, "share/tech/sky130.tech"));
  ck_assert_str_eq(by_name.name, "sky130");
  ck_assert_int_eq(by_name.count, by_path.count);
  ck_assert_mem_eq(by_name.price, by_path.price, sizeof by_name.price);
  const sf_status unknown = sf_technology_find(&by_name, "7nm");
  ck_bad(unknown, SF_E_IO, "--tech 7nm: no such file, and no ", "/share/spikefield/tech/7nm.tech;");
  ck_bad(unknown, SF_E_IO, "names there: 45nm, osu018, sky130 (or give a file)", "");
  ck_bad(sf_technology_find(&by_name, "nowhere/45nm"), SF_E_IO, "nowhere/45nm", "");
}

/* A file of that name in the folder where one works comes first. */
TEST(a_file_comes_first)
{
  char here[4096];
  sf_technology t;
  ck_assert_ptr_nonnull(getcwd(here, sizeof here));
  ck_assert_int_eq(chdir(in(".")), 0);
  ck_ok(sf_write_file("45nm", "name x\n", 7));
  const sf_status status = sf_technology_find(&t, "45nm");
  ck_assert_int_eq(chdir(here), 0);
  ck_bad(status, SF_E_FORMAT, "45nm", "is missing");
}

ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};
