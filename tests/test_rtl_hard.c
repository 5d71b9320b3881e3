/* The hard cases of the fixed-point contract through the Verilated accelerator: equal to the core (spikes, rows,
 * membranes, outputs, pixels, counters), and each case's own expectation holds of what the accelerator gave. */
#include "ck_run.h"
#include "tests/fx_hard_cases.h"
#include "tests/rtl_fixture.h"

/* The accelerator's own results; currents, which it does not show, and saturation counts are the core's. */
static void run_net(sf_dut *dut, hard *h, const hard_case *c, int variant)
{
  fx_net *net = &h->scene.net;
  for (int32_t mode = FX_HYBRID; mode <= FX_RADIX; mode++) {
    hard_mode(h, mode);
    hard_seen seen = {.trace = &shared.trace[0]};
    ck_ok(sf_dut_load(dut, net));
    ck_ok(sf_dut_clear_counts(dut));
    memcpy(shared.f[0], h->f, sizeof h->f);
    shared.ray[0] = h->ray;
    shared.sample[0] = (sf_dut_sample){&shared.ray[0], true, shared.f[0]};
    run_batch(dut, net, 1, &seen.counts, (uint64_t)variant);
    same_counts(dut, &seen.counts, (uint64_t)variant);
    memcpy(shared.trace[0].spikes, shared.result[0].spikes, sizeof shared.trace[0].spikes);
    seen.out = shared.result[0].out;
    c->expect(h, &seen, variant);
  }
}

/* fx_net_fn for fx_render_ray; dut: the sf_dut. */
static sf_status net_of_dut(void *dut, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  const sf_dut_sample sample = {.ray = ray, .first = first, .f = f};
  sf_dut_result result;
  SF_TRY(sf_dut_run(dut, &sample, 1, &result));
  *out = result.out;
  return sf_ok();
}

static void run_ray(sf_dut *dut, hard *h, const hard_case *c, int variant)
{
  hard_seen seen = {0};
  fx_pixel core;
  ck_ok(fx_render_ray(&h->scene, &h->ray, NULL, NULL, &core, &seen.counts));
  ck_ok(fx_render_ray(&h->scene, &h->ray, net_of_dut, dut, &seen.pixel, NULL));
  same_counts(dut, &seen.counts, (uint64_t)variant);
  ck_assert_mem_eq(&core, &seen.pixel, sizeof core);
  c->expect(h, &seen, variant);
}

HARD_TEST(accelerator)
{
  const hard_case *c = &hard_cases[_i];
  for (int variant = 0; variant < c->variants; variant++) {
    hard h;
    sf_dut *dut;
    hard_begin(&h, c, variant);
    if (c->kind != HARD_REFUSED) {
      ck_ok(
          sf_dut_open(&dut, &h.scene, &(sf_dut_options){.seed = (uint64_t)variant, .stall_percent = variant * 7 % 50}));
      (c->kind == HARD_NET ? run_net : run_ray)(dut, &h, c, variant);
      sf_dut_close(dut);
    }
    hard_end(&h);
  }
}
