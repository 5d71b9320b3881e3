/* The field's cache and the rows that samples share: portable core, every instruction set and recount against lists of
 * lines and naive loops, for hash grids and planes, lists of rays in tiles, and parts of such lists. */
#include "ck_run.h"
#include "energy/energy.h"
#include "tests/fx_fixture.h"
#include "tests/fx_tensorf_fixture.h"

static const char *const instruction_sets[] = {"portable", "avx2", "avx512vnni", "amx"};
enum { SETS = COUNT(instruction_sets) };

static int64_t pick(uint64_t seed, uint64_t what, int64_t low, int64_t high)
{
  return fixture_pick(seed, 300, what, low, high);
}

static fx_cache_shape random_shape(uint64_t seed)
{
  return (fx_cache_shape){1024 << pick(seed, 0, 0, 6), 1 << pick(seed, 1, 0, 3)};
}

/* ---- the oracle: a list of lines, the last one used in front ---- */

typedef struct oracle {
  int sets, ways;
  int64_t *list; /* [sets][ways], -1: empty */
  uint64_t misses;
} oracle;

static void oracle_empty(oracle *o)
{
  for (int i = 0; i < o->sets * o->ways; i++) o->list[i] = -1;
}

static oracle oracle_of(const fx_cache_shape *shape)
{
  oracle o = {.sets = shape->bytes / 16 / shape->ways, .ways = shape->ways};
  o.list = malloc((size_t)(o.sets * o.ways) * sizeof *o.list);
  oracle_empty(&o);
  return o;
}

static void oracle_ask(oracle *o, int64_t line)
{
  int64_t *set = o->list + line % o->sets * o->ways;
  int at = 0;
  while (at < o->ways && set[at] != line) at++;
  if (at == o->ways) o->misses++, at--;
  memmove(set + 1, set, (size_t)at * sizeof *set);
  set[0] = line;
}

/* Runs, repeats and lines of the same set, so that hits stand at every place of a set. */
static uint32_t next_line(uint64_t seed, uint64_t i, const oracle *o, uint32_t before)
{
  const uint32_t sets = (uint32_t)o->sets;
  switch (pick(seed, 3 * i + 10, 0, 4)) {
  case 0:
    return before + 1;
  case 1:
    return (uint32_t)pick(seed, 3 * i + 11, 0, 4000000);
  case 2:
    return before;
  default:
    return (uint32_t)pick(seed, 3 * i + 11, 0, 3) + sets * (uint32_t)pick(seed, 3 * i + 12, 0, 2 * o->ways);
  }
}

LOOP_TEST(look_ups_equal_a_list, SETS)
{
  enum { LINES = 4000 };
  const fx_kernels *kernels = fx_kernels_select(instruction_sets[_i]);
  static uint32_t line[LINES];
  for (uint64_t seed = 1; kernels && seed <= CK_AMOUNT(40, 8); seed++) {
    const fx_cache_shape shape = random_shape(seed);
    oracle o = oracle_of(&shape);
    fx_cache cache;
    ck_ok(fx_cache_open(&cache, &shape));
    for (int round = 0; round < 2; round++) {
      uint64_t misses = 0;
      o.misses = 0;
      for (uint64_t i = 0; i < LINES; i++) {
        line[i] = next_line(seed, i, &o, i ? line[i - 1] : 5);
        oracle_ask(&o, line[i]);
      }
      for (int i = 0, n; i < LINES; i += n) { /* in parts: what a set holds stays */
        n = (int)pick(seed, (uint64_t)i + 20000, 0, 100);
        n = n > LINES - i ? LINES - i : n;
        misses += kernels->look_up(&cache, line + i, n);
        if (n == 0) n = 0, misses += kernels->look_up(&cache, line + i, 1), n = 1;
      }
      ck_assert_msg(misses == o.misses, "%s, %d bytes, %d ways: %llu misses, not %llu", kernels->name, shape.bytes,
                    shape.ways, (unsigned long long)misses, (unsigned long long)o.misses);
      ck_assert_uint_gt(misses, 0);
      ck_assert_uint_lt(misses, LINES);
      fx_cache_empty(&cache), oracle_empty(&o);
    }
    free(o.list);
    fx_cache_close(&cache);
  }
}

TEST(other_shapes_are_refused)
{
  fx_cache cache;
  ck_bad(fx_cache_open(&cache, &(fx_cache_shape){512, 4}), SF_E_RANGE, "cache of 512 bytes", "1024 to 65536");
  ck_bad(fx_cache_open(&cache, &(fx_cache_shape){131072, 4}), SF_E_RANGE, "cache of 131072 bytes", "");
  ck_bad(fx_cache_open(&cache, &(fx_cache_shape){3000, 4}), SF_E_RANGE, "cache of 3000 bytes", "power of two");
  ck_bad(fx_cache_open(&cache, &(fx_cache_shape){32768, 3}), SF_E_RANGE, "cache of 3 ways", "1, 2, 4 or 8");
  ck_bad(fx_cache_open(&cache, &(fx_cache_shape){32768, 16}), SF_E_RANGE, "cache of 16 ways", "");
  ck_bad(fx_cache_open(&cache, &(fx_cache_shape){32768, 0}), SF_E_RANGE, "cache of 0 ways", "");
}

/* ---- lines of a position ---- */

/* Levels that begin anywhere: their entries are not where a line begins, and a hash row may lie across two. */
static void odd_offsets(fx_grid *grid, uint64_t seed)
{
  int64_t gap = 0;
  for (int l = 0; l < grid->levels; l++) {
    grid->offset[l] += gap;
    gap += pick(seed, 500 + (uint64_t)l, 0, 40);
  }
  grid->entries += gap;
}

static fx_scene cache_scene(uint64_t seed)
{
  fixture_sizes sizes = fixture_random_sizes(seed);
  if (seed % 3 == 0) sizes.levels = FX_LEVELS_MAX;
  fx_scene s = fixture_scene(&sizes, seed);
  s.step_q24 = 1 << 18, s.trans_stop = (int32_t)pick(seed, 2, 0, 1 << 17);
  s.max_samples = (int32_t)pick(seed, 3, 1, 60);
  return s;
}

static uint32_t random_place(uint64_t seed, uint64_t i)
{
  const int64_t rail = pick(seed, 2 * i + 600, 0, 9);
  return rail == 0 ? 0 : rail == 1 ? (1 << 24) - 1 : (uint32_t)pick(seed, 2 * i + 601, 0, (1 << 24) - 1);
}

static int naive_lines(const fx_grid *grid, const uint32_t pos[3], int64_t *line, int *crossing)
{
  int n = 0;
  for (int l = 0; l < grid->levels; l++) {
    int64_t c[3];
    for (int a = 0; a < 3; a++) c[a] = (naive_round((int64_t)pos[a] * grid->scale_q16[l], 32) + 128) / 256;
    for (int corner = 0; corner < 8; corner++) {
      const int64_t x = c[0] + corner % 2, y = c[1] + corner / 2 % 2, z = c[2] + corner / 4, s = grid->stride[l];
      const uint32_t hash = (uint32_t)x ^ (uint32_t)y * 2654435761u ^ (uint32_t)z * 805459861u;
      const int64_t index = s ? x + s * y + s * s * z : (int64_t)(hash % (1u << grid->log2_size[l]));
      const int64_t asked = (grid->offset[l] + index) / 8;
      if (corner % 2 && asked == line[n - 1]) continue;
      *crossing += corner % 2;
      line[n++] = asked;
    }
  }
  return n;
}

LOOP_TEST(lines_of_a_grid, SETS)
{
  const fx_kernels *kernels = fx_kernels_select(instruction_sets[_i]);
  int crossing = 0, asked = 0;
  for (uint64_t seed = 1; kernels && seed <= 60; seed++) {
    OWNED(fx_scene) scene = cache_scene(seed);
    if (seed % 2) odd_offsets(&scene.grid, seed);
    fx_places places;
    fx_places_fill(&places, &scene.grid);
    for (uint64_t i = 0; i < 50; i++) {
      const uint32_t pos[3] = {random_place(seed, 3 * i), random_place(seed, 3 * i + 1), random_place(seed, 3 * i + 2)};
      int64_t expected[FX_LOOKUPS_MAX];
      uint32_t line[FX_LOOKUPS_ROOM];
      const int n = naive_lines(&scene.grid, pos, expected, &crossing), got = kernels->lines(&places, pos, line);
      ck_assert_int_eq(got, n);
      for (int j = 0; j < n; j++) ck_assert_uint_eq(line[j], (uint32_t)expected[j]);
      asked += n;
    }
  }
  if (!kernels) return;
  ck_assert_int_gt(crossing, asked / 50);
  ck_assert_int_lt(crossing, asked / 2);
}

TEST(lines_of_planes)
{
  OWNED(fx_scene) scene = tensorf_scene();
  fx_tensorf field = scene.tensorf; /* sizes alone are looked at */
  field.res[0] = 5, field.res[1] = 3, field.res[2] = 2;
  for (int p = 0; p < FX_PAIRS; p++) field.density.components[p] = 8, field.appearance.components[p] = 20;
  uint32_t line[FX_LOOKUPS_ROOM];
  /* between points of x, on those of y and z: two points where x is an axis, one elsewhere */
  const uint32_t between[3] = {1 << 21, 1 << 23, 0};
  ck_assert_int_eq(fx_tensorf_lines(&field, false, between, line), 2 + 1 + 2 + 1 + 1 + 2);
  /* (x,y): row y = 1 of 5 points from x = 0; line z = 0 behind 15 points; (x,z) behind 15 + 2; and so on */
  const uint32_t expected[] = {5, 6, 15, 17, 18, 28, 31, 36, 37};
  for (int i = 0; i < COUNT(expected); i++) ck_assert_uint_eq(line[i], expected[i]);
  /* 41 lines of the density; two lines a point of 20 components: the first of both points, then the second */
  const uint32_t beside[] = {51, 53, 52, 54};
  ck_assert_int_eq(fx_tensorf_lines(&field, true, between, line), 18);
  for (int i = 0; i < 4; i++) ck_assert_uint_eq(line[i], beside[i]);
  const uint32_t inside[3] = {1234567, 7654321, 5555555};
  ck_assert_int_eq(fx_tensorf_lines(&field, true, inside, line), 36);
}

/* ---- lists of rays ---- */

enum { SIDE = 37, RAYS = SIDE * SIDE }; /* a picture with narrow tiles at its borders */

typedef struct list {
  fx_ray ray[RAYS];
  uint64_t tile[RAYS];
  size_t n;
} list;

/* Rays from near one point to the pixels of a square; every 9th misses. */
static fx_ray pixel_ray(uint64_t seed, int x, int y)
{
  fx_ray ray = {.count = (x + 3 * y) % 9 ? 60 : 0, .first_q16 = 12345};
  const int64_t to[3] = {(int64_t)x << 34, (int64_t)y << 34, (int64_t)1 << 39};
  for (int a = 0; a < 3; a++) {
    ray.origin[a] = pick(seed, 700 + (uint64_t)a, 1, 1 << 20) << 19;
    ray.step[a] = (to[a] - ray.origin[a] / 2) / 90;
    ray.unit[a] = (int16_t)(1000 * a + x);
  }
  fixture_inputs(seed, (uint64_t)(1000 + x), ray.dir, FX_SH, 1024);
  return ray;
}

/* The tiles one after the other; `most` drops rays at random: a part of the list. */
static list *make_list(uint64_t seed, int most)
{
  list *l = calloc(1, sizeof *l);
  for (int tile = 0; tile < 9; tile++)
    for (int y = tile / 3 * 16; y < SIDE && y < tile / 3 * 16 + 16; y++)
      for (int x = tile % 3 * 16; x < SIDE && x < tile % 3 * 16 + 16; x++) {
        if (pick(seed, (uint64_t)(2000 + y * SIDE + x), 0, 99) >= most) continue;
        l->tile[l->n] = (uint64_t)tile, l->ray[l->n++] = pixel_ray(seed, x, y);
      }
  return l;
}

/* All three of one list: portable core, recount, oracle. */
typedef struct observed {
  fx_memory core;
  sf_memory_recount recount;
  oracle lines;
  const fx_scene *scene;
  fx_trace trace;
  int32_t base[SF_LANES];
  bool first;
  uint64_t samples, shared, asked;
} observed;

static void ask_oracle(observed *o, fx_read what, const uint32_t pos[3])
{
  int64_t line[FX_LOOKUPS_MAX];
  int crossing = 0;
  if (what != FX_READ_GRID) return;
  const int n = naive_lines(&o->scene->grid, pos, line, &crossing);
  for (int i = 0; i < n; i++) oracle_ask(&o->lines, line[i]);
  o->asked += (uint64_t)n;
}

static void see_read(void *user, fx_read what, const uint32_t pos[3])
{
  observed *o = user;
  fx_memory_read(&o->core, what, pos);
  sf_memory_recount_read(&o->recount, what, pos);
  ask_oracle(o, what, pos);
}

static sf_status see_sample(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  observed *o = user;
  fx_fired fired = {0};
  fx_net_next(&o->scene->net, ray->dir, first, f, o->base, out, &o->trace, NULL);
  for (int s = 0; s < FX_SPIKING; s++)
    for (int t = 0; t < o->scene->net.steps; t++)
      for (int w = 0; w < SF_SPIKE_WORDS; w++) fired.neurons[s][w] |= o->trace.spikes[fx_spiking_layers[s]][t][w];
  fx_memory_sample(&o->core, o->core.run, &fired);
  sf_memory_recount_sample(&o->recount, (const uint64_t(*)[SF_T_MAX][SF_SPIKE_WORDS])o->trace.spikes);
  return sf_ok();
}

static void same(const fx_memory_counts *a, const char *a_name, const fx_memory_counts *b, const char *b_name)
{
  const sf_status status = sf_memory_compare(a, a_name, b, b_name);
  ck_assert_msg(status.code == SF_OK, "%s", status.message);
}

static fx_memory_counts observe(const fx_scene *scene, const fx_cache_shape *shape, const list *l)
{
  observed *o = calloc(1, sizeof *o);
  o->scene = scene, o->lines = oracle_of(shape);
  ck_ok(fx_memory_open(&o->core, scene, shape));
  ck_ok(sf_memory_recount_open(&o->recount, scene, shape));
  for (size_t i = 0; i < l->n; i++) {
    fx_pixel pixel;
    if (i == 0 || l->tile[i] != l->tile[i - 1]) oracle_empty(&o->lines);
    fx_memory_ray(&o->core, l->tile[i]);
    sf_memory_recount_ray(&o->recount, l->tile[i]);
    ck_ok(fx_render_watched(scene, &l->ray[i], see_sample, o, &(fx_watch){see_read, o}, &pixel, NULL));
  }
  const fx_memory_counts counts = o->core.counts;
  same(&counts, "core", &o->recount.counts, "recount");
  if (scene->backbone == FX_INGP) {
    ck_assert_uint_eq(counts.lookups, o->asked);
    ck_assert_uint_eq(counts.misses, o->lines.misses);
  }
  fx_memory_close(&o->core), sf_memory_recount_close(&o->recount);
  free(o->lines.list), free(o);
  return counts;
}

/* The list in parts of any size, as threads hand it over. */
static void vector_list(const fx_scene *scene, const fx_cache_shape *shape, const list *l, const char *name,
                        const fx_memory_counts *expected)
{
  fx_core *core;
  fx_memory memory;
  static fx_pixel pixel[RAYS];
  if (!fx_kernels_select(name)) return;
  ck_ok(fx_core_open(&core, scene, name));
  ck_ok(fx_memory_open(&memory, scene, shape));
  const size_t parts[] = {RAYS, 1, 100, 640};
  for (int p = 0; p < COUNT(parts); p++) {
    fx_counts with = {0}, without = {0};
    memory.counts = (fx_memory_counts){0};
    fx_memory_begin(&memory);
    for (size_t i = 0; i < l->n; i += parts[p]) {
      const size_t n = l->n - i < parts[p] ? l->n - i : parts[p];
      ck_ok(fx_render_list(core, &memory, l->tile + i, l->ray + i, n, pixel + i, NULL, &with));
    }
    ck_ok(fx_render_rays(core, l->ray, l->n, pixel, NULL, &without));
    assert_same_counts(&with, &without);
    same(&memory.counts, name, expected, "core");
  }
  fx_memory_close(&memory);
  fx_core_close(core);
}

LOOP_TEST(lists_of_rays, CK_AMOUNT(8, 1))
{
  const uint64_t seed = 1 + (uint64_t)_i;
  OWNED(fx_scene) scene = cache_scene(seed);
  const fx_cache_shape shape = random_shape(seed);
  list *l = make_list(seed, CK_AMOUNT(seed % 3 ? 100 : 30, 25));
  const fx_memory_counts expected = observe(&scene, &shape, l);
  ck_assert_uint_gt(expected.misses, 0);
  ck_assert_uint_gt(expected.lookups, expected.misses);
  ck_assert_uint_gt(expected.groups, 9);
  for (int i = 0; i < SETS; i++) vector_list(&scene, &shape, l, instruction_sets[i], &expected);
  free(l);
}

LOOP_TEST(lists_of_rays_through_planes, CK_AMOUNT(3, 1))
{
  OWNED(fx_scene) scene = tensorf_scene();
  const fx_cache_shape shape = random_shape((uint64_t)_i + 50);
  list *l = make_list(7, _i ? 100 : 25);
  for (size_t i = 0; i < l->n; i++) l->ray[i].count = l->ray[i].count ? 30 : 0;
  const fx_memory_counts expected = observe(&scene, &shape, l);
  ck_assert_uint_gt(expected.lookups, expected.misses);
  ck_assert_uint_gt(expected.rows[1], 0);
  for (int i = 0; i < SETS; i++) vector_list(&scene, &shape, l, instruction_sets[i], &expected);
  free(l);
}

/* A ray without samples belongs to the list as well: it parts two rays of one tile. */
TEST(empty_rays_change_the_tile)
{
  OWNED(fx_scene) scene = cache_scene(3);
  list *l = calloc(1, sizeof *l);
  l->n = 3, l->ray[0] = l->ray[2] = pixel_ray(3, 20, 12);
  const fx_cache_shape shape = {65536, 8};
  const fx_memory_counts whole = observe(&scene, &shape, l);
  l->tile[1] = 1;
  const fx_memory_counts parted = observe(&scene, &shape, l);
  ck_assert_uint_eq(parted.misses, 2 * whole.misses);
  ck_assert_uint_gt(whole.misses, 0);
  for (int i = 0; i < SETS; i++) vector_list(&scene, &shape, l, instruction_sets[i], &parted);
  free(l);
}
