/* The hard cases of the fixed-point contract through the core and the naive nets: everything is compared (currents,
 * membranes, spikes, outputs, pixels, counts), and each case's own expectation holds. */
#include "ck_run.h"
#include "tests/fx_hard_cases.h"

static void run_net(hard *h, const hard_case *c, int variant)
{
  fx_trace *trace = malloc(sizeof *trace);
  for (int32_t mode = FX_HYBRID; mode <= FX_RADIX; mode++) {
    hard_seen seen = {.trace = trace};
    int32_t base[SF_LANES];
    hard_mode(h, mode);
    seen.out = assert_sample(&h->scene.net, h->f, h->ray.dir, trace);
    fx_net_direction(&h->scene.net, h->ray.dir, base, &seen.counts);
    fx_net_sample(&h->scene.net, h->f, base, &seen.out, trace, &seen.counts);
    c->expect(h, &seen, variant);
  }
  free(trace);
}

static sf_status eval_naive(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  const hard *h = user;
  fx_trace *trace = malloc(sizeof *trace);
  fx_counts counts = {0};
  naive_sample(&h->scene.net, f, ray->dir, first, out, trace, &counts);
  free(trace);
  return sf_ok();
}

static void run_ray(hard *h, const hard_case *c, int variant)
{
  hard_seen seen = {0};
  fx_pixel naive;
  ck_ok(fx_render_ray(&h->scene, &h->ray, NULL, NULL, &seen.pixel, &seen.counts));
  ck_ok(fx_render_ray(&h->scene, &h->ray, eval_naive, h, &naive, NULL));
  ck_assert_mem_eq(&naive, &seen.pixel, sizeof naive);
  c->expect(h, &seen, variant);
}

HARD_TEST(core)
{
  const hard_case *c = &hard_cases[_i];
  for (int variant = 0; variant < c->variants; variant++) {
    hard h;
    hard_begin(&h, c, variant);
    if (c->kind == HARD_NET) run_net(&h, c, variant);
    if (c->kind == HARD_RAY) run_ray(&h, c, variant);
    hard_end(&h);
  }
}
