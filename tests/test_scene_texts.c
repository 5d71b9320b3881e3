/* What the scenes are made of, plans of cameras, surveys: whole, as texts. Cameras as text and back. */
#include "ck_run.h"
#include "scene/scene.h"
#include "src/scene/stage.h"
#include "tests/expected.h"
#include <math.h>

/* ---- procedural scenes ---- */

/* Digits that every mathematical library agrees on; no -0. */
static void print_numbers(FILE *out, const double *list, int n)
{
  for (int i = 0; i < n; i++) fprintf(out, " %.6g", rint(list[i] * 1e6) / 1e6 + 0.0);
}

static void print_shape(FILE *out, const sf_shape *s)
{
  fprintf(out, "%d at", s->kind);
  print_numbers(out, s->centre, 3);
  fprintf(out, " of");
  print_numbers(out, s->size, 3);
  fprintf(out, " bound");
  print_numbers(out, &s->bound, 1);
  fprintf(out, " axes");
  print_numbers(out, s->axes, 9);
  if (s->material) {
    const sf_material *m = s->material;
    fprintf(out, " pattern %d period %g shine %g %d colours", m->pattern, m->period, m->shine, m->sharpness);
    print_numbers(out, m->colour[0], 9);
  }
  fprintf(out, "\n");
}

static void print_stages(FILE *out)
{
  for (int n = 0; sf_procedural_names[n]; n++) {
    static sf_stage stage;
    sf_stage_build(&stage, n);
    fprintf(out, "%s: %d shapes, %d fogs\n", sf_procedural_names[n], stage.shapes, stage.fogs);
    for (int i = 0; i < stage.shapes; i++) print_shape(out, &stage.shape[i]);
    for (int i = 0; i < stage.fogs; i++) {
      const sf_fog *fog = &stage.fog[i];
      fprintf(out, "fog %g of", fog->density);
      print_numbers(out, fog->colour, 3);
      fprintf(out, " in ");
      print_shape(out, &fog->region);
    }
  }
}

TEST(what_stands_in_each_scene)
{
  ck_expected_text("stages.txt", out, print_stages(out));
}

/* Every shape, pattern and light from many sides. */
TEST(colours_along_rays)
{
  static char *text;
  static size_t size;
  FILE *out = open_memstream(&text, &size);
  for (int n = 0; sf_procedural_names[n]; n++)
    for (uint64_t i = 0; i < 60; i++) {
      float origin[3], direction[3], c[4];
      for (unsigned k = 0; k < 3; k++) {
        origin[k] = 3 * (2 * sf_random_float(3, k, i) - 1);
        direction[k] = 1.4f * sf_random_float(4, k, i) - 0.7f - origin[k];
      }
      ck_ok(sf_procedural_trace(sf_procedural_names[n], origin, direction, c));
      fprintf(out, "%s %d: %.3f %.3f %.3f %.3f\n", sf_procedural_names[n], (int)i, (double)c[0], (double)c[1],
              (double)c[2], (double)c[3]);
    }
  fclose(out);
  ck_expected("colours.txt", text);
  free(text);
}

/* ---- cameras ---- */

/* At `angle` on a circle, looking at its middle. */
static sf_camera camera_at(double angle, double away, double height)
{
  const double s = sin(angle), c = cos(angle);
  const float m[12] = {(float)-s, 0, (float)c, (float)(away * c), (float)c, 0, (float)s, (float)(away * s),
                       0,         1, 0,        (float)height};
  sf_camera camera = {.width = 40, .height = 30, .fx = 50, .fy = 50, .cx = 20, .cy = 15};
  memcpy(camera.to_world, m, sizeof m);
  return camera;
}

TEST(cameras_as_text_and_back)
{
  char text[SF_CAMERA_TEXT];
  sf_camera back, camera = camera_at(0.4, 3, 0.5);
  camera.fy = 51, camera.cx = 20.5f, camera.height = 8192;
  for (int k = 0; k < 5; k++) {
    float *lens[4] = {&camera.k1, &camera.k2, &camera.p1, &camera.p2};
    for (int i = 0; i < 4; i++) *lens[i] = i + 1 == k ? 0.1f * (float)k : 0;
    sf_camera_print(&camera, text);
    ck_ok(sf_camera_parse(text, &back));
    ck_assert_mem_eq(&back, &camera, sizeof back);
    int commas = 0;
    for (const char *c = text; *c; c++) commas += *c == ',';
    ck_assert_int_eq(commas, k ? 21 : 17);
  }
  /* The longest there is. */
  for (int i = 0; i < 12; i++) camera.to_world[i] = -1.17549435e-38f;
  camera.fx = camera.fy = 1.17549435e-38f, camera.cx = camera.cy = -1.17549435e-38f;
  camera.width = 8192;
  camera.k1 = camera.k2 = camera.p1 = camera.p2 = -1.17549435e-38f;
  sf_camera_print(&camera, text);
  ck_ok(sf_camera_parse(text, &back));
  ck_assert_mem_eq(&back, &camera, sizeof back);
}

TEST(what_is_no_camera)
{
  static const struct {
    const char *begin, *end; /* of the 18 numbers; the middle is of zeros */
    const char *word;        /* NULL: it is one */
  } rows[] = {{"8,6,1,1,4,3", "", NULL},
              {"8,6,1,1,4,3", ",0,0,0,0", NULL},
              {"+8,6e0,1,.5,-4,-3", ",1,-1,1e6,-1E6", NULL},
              {"8192,1,1,1,4,3", "", NULL},
              {"1,8192,1,1,4,3", "", NULL},
              {"", "", "commas"},
              {"8,6,1,1,4", "", "commas"},
              {"8,6,1,1,4,3", ",0", "commas"},
              {"8,6,1,1,4,3", ",0,0,0", "commas"},
              {"8,6,1,1,4,3", ",0,0,0,0,0", "commas"},
              {"8,6,1,1,4,3", ",", "commas"},
              {"8,6,1,1,4,3", ",0,0,0,0,", "commas"},
              {"8,6,1,1,4,3", ",0,0,0,1.1e6", "commas"},
              {"8,6,1,1,4,3", ",0,0,0,-1.1e6", "commas"},
              {"8,6,1,1,4,3", ",0,0,0,1e999", "commas"},
              {"8,6,1,1,4,nan", "", "commas"},
              {"8,6,1,1,4,inf", "", "commas"},
              {"8,6,1,1,4, 3", "", "commas"},
              {"8,6,1,1,4,3 ", "", "commas"},
              {"8,6,1,1,4,0x3", "", "commas"},
              {"8,6,1,1,4,3;0", "", "commas"},
              {"8,6,1,1,4,+", "", "commas"},
              {"8,6,1,1,,3", "", "commas"},
              {"0,6,1,1,4,3", "", "pixels"},
              {"8,0.5,1,1,4,3", "", "pixels"},
              {"8.5,6,1,1,4,3", "", "pixels"},
              {"8,8193,1,1,4,3", "", "pixels"},
              {"8193,8,1,1,4,3", "", "pixels"},
              {"8,6,0,1,4,3", "", "above 0"},
              {"8,6,1,0,4,3", "", "above 0"},
              {"8,6,-1,1,4,3", "", "above 0"}};
  for (int i = 0; i < COUNT(rows); i++) {
    char text[200];
    sf_camera camera;
    snprintf(text, sizeof text, "%s%s%s", rows[i].begin, ",1,0,0,0,0,1,0,0,0,0,1,0", rows[i].end);
    if (rows[i].word)
      ck_bad(sf_camera_parse(text, &camera), SF_E_USAGE, rows[i].word, "camera");
    else
      ck_ok(sf_camera_parse(text, &camera));
  }
}

/* ---- survey ---- */

enum { VIEWS = 9 };

/* Looks alike everywhere; not at equal distances. */
static void make_data(sf_dataset *data, sf_view *view)
{
  *data = (sf_dataset){.path = "d", .view = view, .count = VIEWS, .bound = 1, .scale = 0.8f};
  for (int v = 0; v < VIEWS; v++) {
    view[v] = (sf_view){.camera = camera_at(0.7 * v, 3, 0.1 * v), .brightness = 0.5f};
    snprintf(view[v].name, sizeof view[v].name, "v%d", v);
  }
}

static void print_survey(FILE *out, const char *title, sf_dataset *data)
{
  ck_ok(sf_dataset_survey(data));
  fprintf(out, "%s:%s\n", title, data->warnings ? "" : " nothing");
  for (int i = 0; i < data->warnings; i++) fprintf(out, "  %s\n", data->warning[i]);
  free(data->warning);
}

/* What is off by a little less, and a little more, than what is told. */
typedef struct oddity {
  const char *title;
  double less, more;
  void (*make)(sf_view *view, double by);
} oddity;

static void brighter(sf_view *v, double by)
{
  v[4].brightness *= (float)by, v[6].brightness *= (float)by;
}

static void darker_among_many(sf_view *v, double by)
{
  for (int i = 0; i < VIEWS; i++) v[i].brightness = 0.5f * exp2f(0.25f * (float)(i - 4));
  v[8].brightness = 0.5f * exp2f((float)-by);
}

static void black(sf_view *v, double by)
{
  for (int i = 0; i < VIEWS; i++) v[i].brightness = 0.0012f;
  v[3].brightness = (float)by;
}

static void longer(sf_view *v, double by)
{
  v[2].camera.fx *= (float)by, v[2].camera.fy *= (float)by;
}

static void all_of_degrees(sf_view *v, double by)
{
  for (int i = 0; i < VIEWS; i++) v[i].camera.fx = v[i].camera.fy = 20 / tanf((float)(by * M_PI / 360));
}

static void stretched(sf_view *v, double by)
{
  v[5].camera.fy = v[5].camera.fx / (float)by;
}

static void off_middle_x(sf_view *v, double by)
{
  v[1].camera.cx = (float)(40 * by);
}

static void off_middle_y(sf_view *v, double by)
{
  v[1].camera.cy = (float)(30 * by);
}

static void outside(sf_view *v, double by)
{
  v[7].camera.to_world[3] = 0, v[7].camera.to_world[7] = (float)(3 * by), v[7].camera.to_world[11] = 0.4f;
}

static void high(sf_view *v, double by)
{
  v[7].camera.to_world[3] = v[7].camera.to_world[7] = 0, v[7].camera.to_world[11] = (float)(3 * by);
}

static void as_another(sf_view *v, double by)
{
  v[6].camera = v[8].camera = v[3].camera;
  v[6].camera.to_world[7] += (float)(1 + by), v[8].camera.to_world[3] += (float)by;
}

static void looks_as_another(sf_view *v, double by)
{
  v[6].camera = v[8].camera = v[3].camera;
  v[6].camera.to_world[2] += (float)by, v[8].camera.to_world[0] += (float)by;
}

/* A quarter of the views, and a view more: alone it does not decide. */
static void shows(sf_view *v, double by)
{
  for (int i = 0; i < VIEWS; i++) v[i].shown = i < 6 ? 0.9f : (float)by;
}

static void one_shows(sf_view *v, double by)
{
  for (int i = 0; i < VIEWS; i++) v[i].shown = i < VIEWS - (by > 2 ? 3 : 2) ? 0.5f : (float)by;
}

static void shows_nothing_but(sf_view *v, double by)
{
  for (int i = 0; i < VIEWS; i++) v[i].shown = i % 2 ? 0 : (float)by;
}

TEST(surveys_at_their_limits)
{
  static const oddity rows[] = {{"brighter", 1.49, 1.51, brighter},
                                {"darker", 1 / 1.49, 1 / 1.51, brighter},
                                {"darker among many", 3.2, 3.23, darker_among_many},
                                {"black", 0, 0.0019, black},
                                {"longer", 1.98, 2.02, longer},
                                {"shorter", 1 / 1.98, 1 / 2.02, longer},
                                {"wide", 129.5, 130.5, all_of_degrees},
                                {"narrow", 5.1, 4.9, all_of_degrees},
                                {"stretched", 1.045, 1.055, stretched},
                                {"pressed", 0.955, 0.945, stretched},
                                {"right", 0.69, 0.71, off_middle_x},
                                {"left", 0.31, 0.29, off_middle_x},
                                {"low", 0.69, 0.71, off_middle_y},
                                {"up", 0.31, 0.29, off_middle_y},
                                {"outside", 5.5, 7, outside},
                                {"high", 5.5, 7, high},
                                {"another's place", 1e-4, 1e-5, as_another},
                                {"another's direction", 1.1e-4, 0.9e-4, looks_as_another},
                                {"past the box", 0.999, 1.001, shows},
                                {"a few past the box", 2, 2.1, one_shows},
                                {"little of the box", 0.151, 0.149, shows_nothing_but}};
  static char *text;
  static size_t size;
  FILE *out = open_memstream(&text, &size);
  for (int i = 0; i < COUNT(rows); i++)
    for (int more = 0; more < 2; more++) {
      sf_dataset data;
      sf_view view[VIEWS];
      char title[60];
      make_data(&data, view);
      rows[i].make(view, more ? rows[i].more : rows[i].less);
      snprintf(title, sizeof title, "%s, %s", rows[i].title, more ? "more" : "less");
      print_survey(out, title, &data);
    }
  for (int n = 0; n < 3; n++) { /* one view stands alone, two alike do not */
    sf_dataset data;
    sf_view view[VIEWS];
    char title[60];
    make_data(&data, view);
    view[1].camera = view[0].camera, data.count = n;
    snprintf(title, sizeof title, "%d views", n);
    print_survey(out, title, &data);
  }
  fclose(out);
  ck_expected("survey.txt", text);
  free(text);
}

/* ---- plans ---- */

/* A letter for each colour of a plan. */
static char letter(const uint16_t *p)
{
  static const struct {
    int r, g, b;
    char letter;
  } colours[] = {{255, 255, 255, ' '}, {150, 150, 150, '+'}, {215, 215, 215, '.'}, {150, 180, 150, 'o'},
                 {40, 90, 200, 'T'},   {220, 70, 40, 'H'},   {60, 60, 60, '#'}};
  for (int i = 0; i < COUNT(colours); i++)
    if (p[0] == 257 * colours[i].r && p[1] == 257 * colours[i].g && p[2] == 257 * colours[i].b && p[3] == 65535)
      return colours[i].letter;
  return '?';
}

static void ck_plan(const char *name, const sf_dataset *data, const sf_dataset *held, int size)
{
  sf_image image;
  ck_ok(sf_plan_draw(data, held, size, &image));
  char *text = malloc((size_t)image.height * (size_t)(image.width + 1) + 1), *at = text;
  for (int y = 0; y < image.height; y++) {
    for (int x = 0; x < image.width; x++) *at++ = letter(image.rgba + 4 * (y * image.width + x));
    while (at > text && at[-1] == ' ') at--; /* no blanks at the ends of lines */
    *at++ = '\n';
  }
  *at = 0;
  ck_expected(name, text);
  free(text);
  sf_image_free(&image);
}

TEST(plans_whole)
{
  enum { POINTS = 5 };
  float point[POINTS][3] = {{0.3f, 0.2f, 0.1f}, {-0.9f, 0.5f, -1.3f}, {4, 4, 4}, {-2, 1, 0.5f}, {1e30f, 0, 0}};
  sf_dataset data, held;
  sf_view view[2][VIEWS];
  make_data(&data, view[0]), make_data(&held, view[1]);
  data.count = 5, held.count = 2, held.view += 6;
  data.point = point[0], data.points = POINTS, data.bound = 2;
  ck_plan("plan.txt", &data, &held, 120);
  view[0][2].camera = camera_at(1, 40, -2); /* a stray one is cut off */
  data.points = 0, data.bound = 64;
  ck_plan("plan-stray.txt", &data, &held, 60);
  /* Forward-facing: no box and no points, but a near plane. */
  make_data(&data, view[0]);
  for (int v = 0; v < VIEWS; v++)
    view[v % 2][v].camera = (sf_camera){.width = 40,
                                        .height = 30,
                                        .fx = 50,
                                        .fy = 50,
                                        .cx = 20,
                                        .cy = 15,
                                        .to_world = {1, 0, 0, 0.1f * (float)(v - 4), 0, 1, 0, 0, 0, 0, 1, 0}};
  data.ndc = held.ndc = true, data.ndc_near = held.ndc_near = 0.8f, data.points = POINTS;
  ck_plan("plan-ndc.txt", &data, &held, 110);
}
