/* Single samples: positions to features, features through the nets, the taps of a ray. */
#include "quant/quant.h"
#include "src/lib/internal.h"
#include <stdlib.h>
#include <string.h>

static sf_status position(const spikefield_scene *scene, const float *model, uint32_t *to)
{
  LIB_REQUIRE(scene);
  LIB_REQUIRE(model);
  LIB_REQUIRE(to);
  return sf_fx_position_make(&scene->fx, model, to);
}

spikefield_status spikefield_position(const spikefield_scene *scene, const float model[3], uint32_t to[3])
{
  return lib_status(position(scene, model, to));
}

/* What a position needs of its ray's direction: a hash grid harmonics, TensoRF the direction itself. */
static sf_status direction_of(const spikefield_scene *scene, const float *direction, int16_t *harmonics)
{
  LIB_REQUIRE(scene);
  LIB_REQUIRE(direction);
  LIB_REQUIRE(harmonics);
  double unit[3];
  fx_ray ray;
  SF_TRY(sf_fx_direction_make(&scene->fx, direction, &ray, unit));
  if (fx_net_constants_per_sample(&scene->fx.net))
    memset(ray.dir, 0, sizeof ray.dir), memcpy(ray.dir, ray.unit, sizeof ray.unit);
  memcpy(harmonics, ray.dir, sizeof ray.dir);
  return sf_ok();
}

spikefield_status spikefield_direction(const spikefield_scene *scene, const float direction[3],
                                       int16_t harmonics[SPIKEFIELD_DIRECTIONS])
{
  return lib_status(direction_of(scene, direction, harmonics));
}

/* ---- features ---- */

static sf_status check_positions(const uint32_t *positions, size_t n)
{
  for (size_t i = 0; i < 3 * n; i++)
    if (positions[i] >> SF_POS_FRAC)
      return sf_fail(SF_E_RANGE, "position %zu, axis %zu is %u, expected 0..%u", i / 3, i % 3, positions[i],
                     (1u << SF_POS_FRAC) - 1);
  return sf_ok();
}

/* What a position brings to the nets. direction: TensoRF's, or NULL: the inputs that it alone decides are 0. */
static void inputs_at(const fx_scene *scene, const int16_t *direction, const uint32_t *position, int16_t *to,
                      fx_counts *events)
{
  static const int16_t none[3] = {0};
  const fx_tensorf *field = &scene->tensorf;
  if (scene->backbone == FX_INGP) {
    fx_grid_features(&scene->grid, position, to, events);
    return;
  }
  fx_tensorf_encode(field, position, direction ? direction : none, to, events);
  if (direction) return;
  const int waves = 6 * field->view_freqs;
  memset(to + field->features, 0, 3 * sizeof *to);
  memset(to + fx_tensorf_inputs(field) - waves, 0, (size_t)waves * sizeof *to);
}

static sf_status features_of(const spikefield_scene *scene, const uint32_t *positions, size_t n, int16_t *features,
                             spikefield_counts *counts)
{
  fx_counts events = {0};
  LIB_REQUIRE(scene);
  if (!n) return sf_ok();
  LIB_REQUIRE(positions);
  LIB_REQUIRE(features);
  SF_TRY(check_positions(positions, n));
  const size_t width = (size_t)fx_net_inputs(&scene->fx.net);
  for (size_t i = 0; i < n; i++) inputs_at(&scene->fx, NULL, positions + 3 * i, features + width * i, &events);
  lib_add_counts(counts, &events);
  return sf_ok();
}

spikefield_status spikefield_features(const spikefield_scene *scene, const uint32_t *positions, size_t n,
                                      int16_t *features, spikefield_counts *counts)
{
  return lib_status(features_of(scene, positions, n, features, counts));
}

/* ---- samples ---- */

/* n samples of one ray. Either features or positions is NULL. */
typedef struct batch {
  fx_scene view;
  const int16_t *harmonics, *features;
  const uint32_t *positions;
  size_t n;
  spikefield_sample *samples;
  spikefield_trace *traces;
} batch;

static sf_status check_inputs(const char *what, const int16_t *value, size_t n, size_t width, int limit)
{
  for (size_t i = 0; i < n * width; i++)
    if (value[i] > limit || value[i] < -limit)
      return sf_fail(SF_E_RANGE, "%s %zu of sample %zu is %d, expected -%d..%d", what, i % width, i / width, value[i],
                     limit, limit);
  return sf_ok();
}

/* Batches are large and traces rare: the core's trace is copied out. */
static void run_batch(const batch *b, fx_trace *trace, fx_counts *events)
{
  const fx_net *net = &b->view.net;
  const size_t width = (size_t)fx_net_inputs(net);
  const bool planes = b->positions && b->view.backbone == FX_TENSORF; /* the density is no output of the net */
  int16_t own[SF_DIR_MAX > SF_FEATURE_MAX ? SF_DIR_MAX : SF_FEATURE_MAX];
  int32_t base[SF_LANES];
  fx_out out;
  for (size_t i = 0; i < b->n; i++) {
    const int16_t *f = b->features ? b->features + width * i : own;
    if (b->positions) inputs_at(&b->view, b->harmonics, b->positions + 3 * i, own, events);
    fx_net_next(net, b->harmonics, i == 0, f, base, &out, trace, events);
    if (planes) out.sigma = fx_tensorf_density(&b->view.tensorf, b->positions + 3 * i, events);
    lib_sample(&b->samples[i], &out);
    if (trace) memcpy(&b->traces[i], trace, sizeof *trace);
  }
  if (fx_net_constants_per_sample(net)) events->rays++; /* counted where the field is, which a batch leaves out */
}

static sf_status checked_batch(batch *b, const spikefield_scene *scene, const spikefield_options *options,
                               spikefield_counts *counts)
{
  fx_counts events = {0};
  SF_TRY(lib_view(scene, options, &b->view));
  if (!b->n) return sf_ok();
  LIB_REQUIRE(b->harmonics);
  LIB_REQUIRE(b->samples);
  const int input = SPIKEFIELD_INPUT_MAX, direction = fx_net_constants_per_sample(&b->view.net) ? FX_UNIT_ONE : input;
  SF_TRY(check_inputs("harmonic", b->harmonics, 1, SPIKEFIELD_DIRECTIONS, direction));
  if (b->features) SF_TRY(check_inputs("feature", b->features, b->n, (size_t)fx_net_inputs(&b->view.net), input));
  if (b->positions) SF_TRY(check_positions(b->positions, b->n));
  fx_trace *trace = b->traces ? malloc(sizeof *trace) : NULL;
  if (b->traces && !trace) return sf_fail(SF_E_MEMORY, "no memory for a trace");
  run_batch(b, trace, &events);
  free(trace);
  lib_add_counts(counts, &events);
  return sf_ok();
}

spikefield_status spikefield_samples(const spikefield_scene *scene, const spikefield_options *options,
                                     const int16_t harmonics[SPIKEFIELD_DIRECTIONS], const int16_t *features, size_t n,
                                     spikefield_sample *samples, spikefield_trace *traces, spikefield_counts *counts)
{
  batch b = {.harmonics = harmonics, .features = features, .n = n, .samples = samples, .traces = traces};
  if (n && !features) return lib_status(sf_fail(SF_E_USAGE, "features is NULL"));
  return lib_status(checked_batch(&b, scene, options, counts));
}

spikefield_status spikefield_samples_at(const spikefield_scene *scene, const spikefield_options *options,
                                        const int16_t harmonics[SPIKEFIELD_DIRECTIONS], const uint32_t *positions,
                                        size_t n, spikefield_sample *samples, spikefield_trace *traces,
                                        spikefield_counts *counts)
{
  batch b = {.harmonics = harmonics, .positions = positions, .n = n, .samples = samples, .traces = traces};
  if (n && !positions) return lib_status(sf_fail(SF_E_USAGE, "positions is NULL"));
  return lib_status(checked_batch(&b, scene, options, counts));
}

/* ---- taps of a ray ---- */

typedef struct tapped {
  const fx_net *net;
  bool (*tap)(void *user, const spikefield_tap *tap);
  void *user;
  uint32_t index;
  int32_t base[SF_LANES];
  fx_trace trace;
  spikefield_trace shown;
  fx_counts events;
} tapped;

static sf_status tapped_net(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  tapped *t = user;
  spikefield_sample sample;
  fx_net_next(t->net, ray->dir, first, f, t->base, out, &t->trace, &t->events);
  memcpy(&t->shown, &t->trace, sizeof t->shown);
  lib_sample(&sample, out);
  const spikefield_tap tap = {t->index++, f, &sample, &t->shown};
  return t->tap(t->user, &tap) ? sf_ok() : sf_fail(SF_E_STOPPED, "stopped at sample %u", tap.index);
}

static sf_status tap_ray(const fx_scene *view, const fx_ray *ray, tapped *t, spikefield_pixel *to,
                         spikefield_counts *counts)
{
  fx_pixel pixel;
  SF_TRY(fx_render_ray(view, ray, tapped_net, t, &pixel, &t->events));
  lib_pixel(to, &pixel);
  lib_add_counts(counts, &t->events);
  return sf_ok();
}

spikefield_status spikefield_ray_taps(const spikefield_scene *scene, const spikefield_options *options,
                                      const float origin[3], const float direction[3],
                                      bool (*tap)(void *user, const spikefield_tap *tap), void *user,
                                      spikefield_pixel *pixel, spikefield_counts *counts)
{
  fx_scene view;
  fx_ray ray;
  if (!origin || !direction || !tap || !pixel)
    return lib_status(sf_fail(SF_E_USAGE, "%s is NULL",
                              !origin      ? "origin"
                              : !direction ? "direction"
                              : !tap       ? "tap"
                                           : "pixel"));
  sf_status status = lib_view(scene, options, &view);
  if (status.code == SF_OK) status = sf_fx_ray_make(&view, origin, direction, &ray);
  if (status.code != SF_OK) return lib_status(status);
  tapped *t = calloc(1, sizeof *t);
  if (!t) return lib_status(sf_fail(SF_E_MEMORY, "no memory for a trace"));
  t->net = &view.net, t->tap = tap, t->user = user;
  status = tap_ray(&view, &ray, t, pixel, counts);
  free(t);
  return lib_status(status);
}
