/* What sf_view tells of a scene: a ray's story is the core's ray, a map's pixels add up to the picture's counts, tiles
 * are the picture. */
#include "folder_fixture.h"
#include "sim/view/internal.h"
#include "tests/fx_tensorf_fixture.h"
#include <math.h>

enum { SIDE = 37 }; /* no multiple of a tile */

/* Parameters of a picture of SIDE x SIDE pixels that looks at the box. */
static sf_view_ask look(const sf_viewer *v, int steps)
{
  sf_view_ask ask;
  sf_view_ask_begin(&ask);
  ask.has_camera = true, ask.steps = steps;
  ask.camera = v->home;
  const float share = (float)SIDE / (float)ask.camera.width;
  ask.camera.width = ask.camera.height = SIDE;
  ask.camera.fx *= share, ask.camera.fy *= share, ask.camera.cx = ask.camera.cy = SIDE / 2.0f;
  return ask;
}

static sf_viewer *open_scene(int kind)
{
  static char path[4096];
  fx_scene scene = {0};
  sf_viewer *v;
  snprintf(path, sizeof path, "%s", in("scene.snn"));
  if (kind == 0) {
    const fixture_sizes sizes = {6, 40, 9, 16, 70, 33, 3, FX_HYBRID, {0}};
    fixture_set_sizes(&scene, &sizes);
    ck_ok(fx_scene_allocate(&scene, path));
    fixture_fill(&scene, &sizes, 11);
    scene.units.to_box_scale = scene.units.dir_scale = 1;
  } else
    scene = tensorf_scene();
  ck_ok(fx_scene_save(&scene, path));
  fx_scene_free(&scene);
  ck_ok(sf_viewer_open(&v, &(sf_viewer_options){.scene = path}));
  return v;
}

static void golden_of(sf_viewer *v, const sf_view_ask *ask, sf_golden *golden)
{
  sf_sight sight;
  ck_ok(sf_sight_of(v, ask, &sight));
  const sf_golden_job job = {
      .scene = &v->at[sight.steps - 1], .data = &sight.data, .view = &sight.view, .window = sight.window};
  ck_ok(sf_golden_create(golden, SIDE, SIDE, SF_PLANES));
  ck_ok(sf_golden_fixed(&job, golden));
}

static void draw(sf_viewer *v, const sf_view_ask *ask, int map, sf_tile *tile)
{
  static float rgb[3 * SIDE * SIDE], value[SIDE * SIDE];
  sf_sight sight;
  ck_ok(sf_sight_of(v, ask, &sight));
  fx_counts sum = {0};
  *tile = (sf_tile){.across = SIDE, .stride = 1};
  for (int y = 0; y < SIDE; y += FX_TILE) {
    tile->y = y, tile->down = SIDE - y < FX_TILE ? SIDE - y : FX_TILE;
    tile->rgb = rgb + 3 * SIDE * y, tile->value = value + SIDE * y, tile->counts = (fx_counts){0};
    ck_ok(sf_tile_fixed(v, &sight, map, tile));
    fx_counts_add(&sum, &tile->counts);
  }
  tile->rgb = rgb, tile->value = value, tile->counts = sum;
}

static uint64_t spikes_of(const fx_counts *counts, int layer)
{
  uint64_t sum = 0;
  for (int t = 0; t < SF_T_MAX; t++) sum += counts->layer[layer].spikes[t];
  return sum;
}

static double expected(int map, const sf_golden *g)
{
  const fx_counts *c = &g->counts;
  switch (map) {
  case SF_MAP_SPIKES:
    return (double)sf_event_total(c, SF_EVENT_SPIKES);
  case SF_MAP_SPIKES_D1:
    return (double)spikes_of(c, FX_D1);
  case SF_MAP_SPIKES_C1:
    return (double)spikes_of(c, FX_C1);
  case SF_MAP_SPIKES_C2:
    return (double)spikes_of(c, FX_C2);
  case SF_MAP_SOPS:
    return (double)sf_event_total(c, SF_EVENT_SOP);
  case SF_MAP_LEDGER:
    return (double)sf_energy_fj(c) / 1e6;
  default:
    return (double)NAN;
  }
}

/* Kinds: a hash grid, planes. */
LOOP_TEST(tiles_are_the_picture, 2)
{
  sf_viewer *v = open_scene(_i);
  sf_golden golden;
  const sf_view_ask ask = look(v, 2);
  golden_of(v, &ask, &golden);
  ck_assert_uint_gt(golden.counts.samples, 500);
  for (int map = SF_MAP_SAMPLES; map < SF_MAP_PHOTO; map++) {
    sf_tile tile;
    double sum = 0;
    draw(v, &ask, map, &tile);
    for (int i = 0; i < SIDE * SIDE; i++) {
      ck_assert_msg(!isnan(tile.value[i]), "map %d, pixel %d has no value", map, i);
      sum += (double)tile.value[i];
      for (int c = 0; c < 3; c++)
        ck_assert_msg(tile.rgb[3 * i + c] == sf_golden_real(&golden, SF_PLANE_R + c)[i], "map %d, pixel %d", map, i);
    }
    if (!isnan(expected(map, &golden))) ck_assert_double_eq_tol(sum, expected(map, &golden), 1e-5 * sum + 1e-9);
    ck_ok(sf_counts_compare(&tile.counts, "tiles", &golden.counts, "picture"));
  }
  sf_golden_free(&golden);
  sf_viewer_close(v);
}

/* Misses, tile by tile, are those of the list of the picture's rays in the order of the accelerator. */
TEST(misses_are_the_cache_s)
{
  sf_viewer *v = open_scene(0);
  const sf_view_ask ask = look(v, 3);
  sf_tile tile;
  sf_sight sight;
  fx_memory memory;
  double sum = 0;
  ck_ok(sf_sight_of(v, &ask, &sight));
  draw(v, &ask, SF_MAP_MISSES, &tile);
  for (int i = 0; i < SIDE * SIDE; i++) sum += (double)tile.value[i];
  ck_ok(fx_memory_open(&memory, &v->at[2], &sf_cache_built));
  fx_memory_begin(&memory);
  for (int top = 0; top < SIDE; top += FX_TILE)
    for (int left = 0; left < SIDE; left += FX_TILE)
      for (int i = 0; i < FX_TILE * FX_TILE; i++) {
        const int x = left + i % FX_TILE, y = top + i / FX_TILE;
        const uint64_t number = sf_tile_number(x, y);
        fx_ray ray;
        fx_pixel pixel;
        if (x >= SIDE || y >= SIDE) continue;
        ck_ok(sf_pixel_ray(&v->at[2], &sight.data, &sight.view, x, y, &ray));
        ck_ok(fx_render_list(v->core[2], &memory, &number, &ray, 1, &pixel, NULL, NULL));
      }
  ck_assert_double_gt(sum, 0);
  ck_assert_double_eq(sum, (double)memory.counts.misses);
  fx_memory_close(&memory);
  sf_viewer_close(v);
}

LOOP_TEST(a_story_is_the_ray, 2)
{
  sf_viewer *v = open_scene(_i);
  const sf_view_ask ask = look(v, 3);
  sf_sight sight;
  int told = 0;
  ck_ok(sf_sight_of(v, &ask, &sight));
  for (int i = 0; i < SIDE; i++) {
    const fx_scene *scene = &v->at[2];
    sf_story s = {.layer = FX_C2, .neuron = 3};
    fx_ray ray;
    fx_pixel pixel;
    fx_counts counts = {0};
    uint64_t weights = 0, spikes = 0, decoded = 0;
    ck_ok(sf_pixel_ray(scene, &sight.data, &sight.view, i, i, &ray));
    ck_ok(fx_render_ray(scene, &ray, NULL, NULL, &pixel, &counts));
    ck_ok(sf_story_tell(&s, scene, &ray));
    ck_assert_mem_eq(&s.pixel, &pixel, sizeof pixel);
    for (int k = 0; k < s.count; k++) {
      const sf_story_sample *p = &s.sample[k];
      weights += p->weight, spikes += p->cost.spikes, decoded += p->decoded;
      ck_assert(k == 0 || (p->at > p[-1].at && p->left <= p[-1].left));
      for (int t = 0; t < scene->net.steps && p->decoded; t++) /* a neuron fires where its membrane is above */
        ck_assert_int_eq(p->membrane[t] >= fx_net_theta(&scene->net, FX_C2), p->spikes[FX_C2][t][0] >> 3 & 1);
    }
    ck_assert_uint_eq(weights, pixel.weight_sum);
    ck_assert_uint_eq(decoded, counts.samples);
    ck_assert_uint_eq(spikes, sf_event_total(&counts, SF_EVENT_SPIKES));
    if (s.count) ck_assert_uint_eq(s.sample[s.count - 1].left, pixel.transmittance);
    told += s.count;
    sf_story_free(&s);
  }
  ck_assert_int_gt(told, 20);
  sf_viewer_close(v);
}

TEST(what_a_scene_lacks_is_said)
{
  sf_viewer *v = open_scene(0);
  sf_view_ask ask = look(v, 2);
  sf_view_reply reply = {0};
  sf_sight sight;
  ask.source = SF_VIEW_FLOAT;
  ck_bad(sf_viewer_picture(v, &ask, &reply), SF_E_RANGE, "--model", "float");
  free(reply.stream);
  ask.source = SF_VIEW_RTL, reply = (sf_view_reply){0};
  ck_bad(sf_viewer_picture(v, &ask, &reply), SF_E_USAGE, "window", "1 to 4096");
  free(reply.stream);
  ask.window[0] = 30, ask.window[2] = 8, ask.window[3] = 1;
  ck_bad(sf_sight_of(v, &ask, &sight), SF_E_USAGE, "window", "37 x 37");
  ask = look(v, 2), ask.has_camera = false, ask.view = 0;
  ck_bad(sf_sight_of(v, &ask, &sight), SF_E_RANGE, "no data set", "");
  sf_viewer_close(v);
  ck_bad(sf_viewer_open(&v, &(sf_viewer_options){.scene = in("none.snn")}), SF_E_IO, "none.snn", "");
  sf_viewer_close(v);
}

ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder, .one_process = true};
