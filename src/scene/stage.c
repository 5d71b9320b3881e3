/* What stands in each procedural scene. Everything lies within 1.1 world units of the origin on each axis, but for
 * "plaza", which reaches to 9: cameras are inside of it. */
#include "src/scene/stage.h"
#include "scene/scene.h"
#include <assert.h>
#include <math.h>
#include <string.h>

const char *const sf_procedural_names[] = {"textured", "simple", "fog", "empty", "plaza", "wires", "terrazzo", NULL};

/* Display colours; the shading squares them to linear light. */
static const sf_material plinth = {
    SF_CHECKER, 0.28, {{0.93, 0.90, 0.82}, {0.36, 0.47, 0.56}, {0.52, 0.36, 0.25}}, 0, 0};
static const sf_material brass = {SF_PLAIN, 0, {{0.80, 0.62, 0.28}}, 0.35, 5};
static const sf_material gold = {SF_PLAIN, 0, {{0.95, 0.72, 0.25}}, 0.60, 5};
static const sf_material ball = {SF_SECTORS, 0, {{0.88, 0.24, 0.20}, {0.18, 0.45, 0.80}, {0.97, 0.78, 0.20}}, 0.40, 5};
static const sf_material red = {SF_PLAIN, 0, {{0.85, 0.20, 0.17}}, 0.25, 5};
static const sf_material blue = {SF_PLAIN, 0, {{0.16, 0.42, 0.76}}, 0.25, 5};
static const sf_material yellow = {SF_PLAIN, 0, {{0.96, 0.77, 0.18}}, 0.25, 5};
static const sf_material mast = {SF_PLAIN, 0, {{0.92, 0.92, 0.92}}, 0.20, 5};
static const sf_material flag = {SF_STRIPES, 0.095, {{0.93, 0.93, 0.92}, {0.20, 0.58, 0.36}}, 0, 0};
static const sf_material matt_red = {SF_PLAIN, 0, {{0.84, 0.30, 0.25}}, 0, 0};
static const sf_material matt_green = {SF_PLAIN, 0, {{0.36, 0.66, 0.40}}, 0, 0};
static const sf_material matt_blue = {SF_PLAIN, 0, {{0.30, 0.48, 0.78}}, 0, 0};
static const sf_material matt_cream = {SF_PLAIN, 0, {{0.92, 0.86, 0.72}}, 0, 0};

static const sf_material paving = {SF_CHECKER, 0.9, {{0.78, 0.74, 0.66}, {0.52, 0.55, 0.50}, {0.40, 0.38, 0.34}}, 0, 0};
static const sf_material tower = {SF_STRIPES, 0.23, {{0.72, 0.36, 0.26}, {0.86, 0.80, 0.66}}, 0, 0};
static const sf_material sky = {SF_SKY, 0, {{0.36, 0.56, 0.84}, {0.62, 0.76, 0.92}}, 0, 0};

static const sf_material slab = {SF_TERRAZZO, 0.16, {{0.93, 0.88, 0.76}, {0.42, 0.52, 0.60}, {0.70, 0.40, 0.30}}, 0, 0};
static const sf_material stone = {
    SF_TERRAZZO, 0.13, {{0.90, 0.90, 0.90}, {0.30, 0.48, 0.42}, {0.84, 0.66, 0.30}}, 0, 0};

typedef struct vec {
  double x, y, z;
} vec;

static void add(sf_stage *stage, sf_shape_kind kind, vec centre, vec size, double yaw, double tilt,
                const sf_material *material)
{
  assert(stage->shapes < SF_STAGE_SHAPES);
  sf_shape *shape = &stage->shape[stage->shapes++];
  const double c[3] = {centre.x, centre.y, centre.z}, s[3] = {size.x, size.y, size.z};
  sf_shape_place(shape, kind, c, s, yaw, tilt);
  shape->material = material;
}

static void add_fog(sf_stage *stage, sf_shape_kind kind, vec centre, vec size, double density, vec colour)
{
  assert(stage->fogs < SF_STAGE_FOGS);
  sf_fog *fog = &stage->fog[stage->fogs++];
  const double c[3] = {centre.x, centre.y, centre.z}, s[3] = {size.x, size.y, size.z};
  sf_shape_place(&fog->region, kind, c, s, 0, 0);
  fog->density = density;
  fog->colour[0] = colour.x, fog->colour[1] = colour.y, fog->colour[2] = colour.z;
}

/* A toy brick with four studs at (+-stud.x, +-stud.y) on its top. */
static void add_brick(sf_stage *stage, vec centre, vec half, double yaw, vec stud, const sf_material *material)
{
  add(stage, SF_BOX, centre, half, yaw, 0, material);
  for (int i = 0; i < 4; i++) {
    double x = i & 1 ? stud.x : -stud.x, y = i & 2 ? stud.y : -stud.y;
    vec at = {centre.x + x * cos(yaw) - y * sin(yaw), centre.y + x * sin(yaw) + y * cos(yaw),
              centre.z + half.z + 0.025};
    add(stage, SF_CYLINDER, at, (vec){0.06, 0.025, 0}, 0, 0, material);
  }
}

static void build_textured(sf_stage *stage)
{
  enum { POSTS = 14 };
  add(stage, SF_CYLINDER, (vec){0, 0, -0.57}, (vec){1.0, 0.07, 0}, 0.3, 0, &plinth);
  for (int i = 0; i < POSTS; i++) {
    double a = 2 * M_PI * (i + 0.5) / POSTS;
    add(stage, SF_CYLINDER, (vec){0.93 * cos(a), 0.93 * sin(a), -0.4}, (vec){0.017, 0.1, 0}, 0, 0, &brass);
  }
  add(stage, SF_TORUS, (vec){0, 0, -0.3}, (vec){0.93, 0.02, 0}, 0, 0, &brass);
  add(stage, SF_SPHERE, (vec){-0.36, -0.28, -0.12}, (vec){0.38, 0, 0}, 0.5, 0.45, &ball);
  add_brick(stage, (vec){0.36, 0.24, -0.38}, (vec){0.34, 0.22, 0.12}, 0.35, (vec){0.25, 0.12, 0}, &red);
  add_brick(stage, (vec){0.36, 0.24, -0.14}, (vec){0.24, 0.18, 0.12}, -0.3, (vec){0.16, 0.10, 0}, &blue);
  add_brick(stage, (vec){0.36, 0.24, 0.10}, (vec){0.17, 0.17, 0.12}, 0.65, (vec){0.09, 0.09, 0}, &yellow);
  add(stage, SF_TORUS, (vec){0.33, -0.50, -0.217}, (vec){0.21, 0.073, 0}, 0.45, M_PI / 2, &gold);
  add(stage, SF_CYLINDER, (vec){-0.42, 0.46, 0.17}, (vec){0.026, 0.67, 0}, 0, 0, &mast);
  add(stage, SF_SPHERE, (vec){-0.42, 0.46, 0.88}, (vec){0.06, 0, 0}, 0, 0, &gold);
  add(stage, SF_BOX, (vec){-0.42 + 0.23, 0.46, 0.66}, (vec){0.2375, 0.012, 0.14}, 0, 0, &flag);
}

static void build_simple(sf_stage *stage)
{
  add(stage, SF_BOX, (vec){0, 0, -0.62}, (vec){0.85, 0.85, 0.06}, 0, 0, &matt_cream);
  add(stage, SF_SPHERE, (vec){-0.35, -0.3, -0.16}, (vec){0.4, 0, 0}, 0, 0, &matt_red);
  add(stage, SF_BOX, (vec){0.38, 0.32, -0.26}, (vec){0.28, 0.28, 0.3}, 0.5, 0, &matt_blue);
  add(stage, SF_SPHERE, (vec){0.38, 0.32, 0.26}, (vec){0.22, 0, 0}, 0, 0, &matt_green);
}

static void build_fog(sf_stage *stage)
{
  add(stage, SF_SPHERE, (vec){0, 0, 0.02}, (vec){0.3, 0, 0}, 0.3, 0.4, &ball);
  add(stage, SF_TORUS, (vec){0, 0, 0.02}, (vec){0.55, 0.06, 0}, 0.6, 0.5, &gold);
  add_fog(stage, SF_SPHERE, (vec){0, 0, 0}, (vec){0.95, 0, 0}, 0.9, (vec){0.80, 0.86, 0.93});
  add_fog(stage, SF_BOX, (vec){0, 0, -0.55}, (vec){0.6, 0.6, 0.2}, 1.6, (vec){0.95, 0.78, 0.62});
}

/* Bricks in the middle, towers around the cameras, sky behind everything: no ray ends in nothing. */
static void build_plaza(sf_stage *stage)
{
  enum { TOWERS = 9 };
  add(stage, SF_SPHERE, (vec){0, 0, 0}, (vec){9, 0, 0}, 0.3, 0, &sky);
  add(stage, SF_CYLINDER, (vec){0, 0, -0.66}, (vec){8.5, 0.02, 0}, 0.2, 0, &paving);
  for (int i = 0; i < TOWERS; i++) {
    const double a = 2 * M_PI * (i + 0.2) / TOWERS, away = 5.2 + 0.4 * (i % 3), half = 0.8 + 0.35 * (i % 4);
    add(stage, SF_BOX, (vec){away * cos(a), away * sin(a), half - 0.64}, (vec){0.45, 0.45, half}, a, 0, &tower);
  }
  add_brick(stage, (vec){0.25, 0.2, -0.44}, (vec){0.5, 0.36, 0.2}, 0.35, (vec){0.3, 0.2, 0}, &red);
  add_brick(stage, (vec){0.25, 0.2, -0.04}, (vec){0.3, 0.26, 0.2}, -0.3, (vec){0.18, 0.14, 0}, &blue);
  add(stage, SF_SPHERE, (vec){-0.55, -0.4, -0.24}, (vec){0.4, 0, 0}, 0.5, 0.45, &ball);
}

/* Thin parts, 1.4 to 2 pixels wide in pictures of 200: a fence of posts and rails, stays from a mast to the ground, a
 * cable in coils, and a ball that is no thin part. */
static void build_wires(sf_stage *stage)
{
  enum { POSTS = 9, STAYS = 6, COILS = 4 };
  const double floor = -0.5, side = 0.85;
  add(stage, SF_BOX, (vec){0, 0, floor - 0.05}, (vec){1.0, 1.0, 0.05}, 0, 0, &matt_cream);
  for (int i = 0; i < POSTS; i++) {
    const double along = side * (2.0 * i / (POSTS - 1) - 1);
    add(stage, SF_CYLINDER, (vec){along, -side, floor + 0.2}, (vec){0.014, 0.2, 0}, 0, 0, &matt_green);
    add(stage, SF_CYLINDER, (vec){-side, along, floor + 0.2}, (vec){0.014, 0.2, 0}, 0, 0, &matt_blue);
  }
  for (int i = 0; i < 2; i++) {
    const double height = floor + 0.15 + 0.2 * i;
    add(stage, SF_CYLINDER, (vec){0, -side, height}, (vec){0.01, side, 0}, M_PI / 2, M_PI / 2, &matt_green);
    add(stage, SF_CYLINDER, (vec){-side, 0, height}, (vec){0.01, side, 0}, 0, M_PI / 2, &matt_blue);
  }
  add(stage, SF_CYLINDER, (vec){0.2, 0.2, floor + 0.6}, (vec){0.02, 0.6, 0}, 0, 0, &mast);
  for (int i = 0; i < STAYS; i++) { /* from the top of the mast, 1.2 high, to 0.6 away from its foot */
    const double a = 2 * M_PI * (i + 0.25) / STAYS, lean = atan2(0.6, 1.2);
    add(stage, SF_CYLINDER, (vec){0.2 + 0.3 * cos(a), 0.2 + 0.3 * sin(a), floor + 0.6},
        (vec){0.01, 0.5 * hypot(0.6, 1.2), 0}, a + M_PI / 2, -lean, &brass);
  }
  for (int i = 0; i < COILS; i++)
    add(stage, SF_TORUS, (vec){0.62, -0.4, floor + 0.03 + 0.06 * i}, (vec){0.2 - 0.02 * i, 0.012, 0}, 0.4 * i, 0.12,
        &red);
  add(stage, SF_SPHERE, (vec){-0.35, -0.3, floor + 0.25}, (vec){0.25, 0, 0}, 0.5, 0.45, &ball);
}

/* Stones that COLMAP finds again in other pictures. */
static void build_terrazzo(sf_stage *stage)
{
  add(stage, SF_CYLINDER, (vec){0, 0, -0.6}, (vec){1.05, 0.08, 0}, 0.3, 0, &slab);
  add(stage, SF_BOX, (vec){-0.30, 0.34, -0.07}, (vec){0.24, 0.30, 0.45}, 0.5, 0, &stone);
  add(stage, SF_BOX, (vec){0.40, 0.22, -0.26}, (vec){0.30, 0.22, 0.26}, -0.4, 0, &slab);
  add(stage, SF_BOX, (vec){0.36, 0.24, 0.15}, (vec){0.16, 0.16, 0.15}, 0.2, 0, &stone);
  add(stage, SF_CYLINDER, (vec){0.22, -0.52, -0.17}, (vec){0.22, 0.35, 0}, 0.9, 0, &stone);
  add(stage, SF_SPHERE, (vec){-0.46, -0.38, -0.20}, (vec){0.32, 0, 0}, 0.5, 0.45, &slab);
}

void sf_stage_build(sf_stage *stage, int index)
{
  memset(stage, 0, sizeof *stage);
  if (index == 0) build_textured(stage);
  if (index == 1) build_simple(stage);
  if (index == 2) build_fog(stage);
  if (index == 4) build_plaza(stage);
  if (index == 5) build_wires(stage);
  if (index == 6) build_terrazzo(stage);
}
