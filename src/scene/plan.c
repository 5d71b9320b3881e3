/* Where the cameras stand: the view from above beside the view from the side. */
#include "scene/scene.h"
#include <math.h>
#include <stdlib.h>

typedef struct colour {
  uint8_t r, g, b;
} colour;
static const colour paper = {255, 255, 255}, edge = {150, 150, 150}, inner = {215, 215, 215}, dot = {150, 180, 150},
                    train = {40, 90, 200}, test = {220, 70, 40}, ink = {60, 60, 60};
enum { WORD = 2 /* pixels of a dot */, MARGIN = 12 };

/* One panel: model axis `right` to the right, `up` upwards. */
typedef struct panel {
  sf_image *image;
  int x, size, right, up;
  double middle[3], reach; /* of the panel's half edge, model units */
  bool foot;               /* all of the picture, its foot included */
} panel;

static void put(const panel *p, int x, int y, colour c)
{
  if (x < 0 || y < 0 || x >= p->size || y >= (p->foot ? p->image->height : p->size)) return;
  uint16_t *pixel = p->image->rgba + 4 * ((size_t)y * (size_t)p->image->width + (size_t)(p->x + x));
  pixel[0] = (uint16_t)(c.r * 257), pixel[1] = (uint16_t)(c.g * 257), pixel[2] = (uint16_t)(c.b * 257);
}

static void place(const panel *p, const double at[3], double out[2])
{
  const double half = 0.5 * p->size;
  out[0] = half + half * (at[p->right] - p->middle[p->right]) / p->reach;
  out[1] = half - half * (at[p->up] - p->middle[p->up]) / p->reach;
}

static void line(const panel *p, const double from[3], const double to[3], colour c)
{
  double a[2], b[2];
  place(p, from, a), place(p, to, b);
  const double steps = fmin(fmax(fabs(a[0] - b[0]), fabs(a[1] - b[1])) + 1, 8.0 * p->size);
  for (int i = 0; i <= steps; i++) {
    const double x = a[0] + (b[0] - a[0]) * i / steps, y = a[1] + (b[1] - a[1]) * i / steps;
    if (fabs(x) < 1e6 && fabs(y) < 1e6) put(p, (int)floor(x), (int)floor(y), c);
  }
}

static void square(const panel *p, double half, colour c)
{
  for (int k = 0; k < 4; k++) {
    double from[3] = {0}, to[3] = {0};
    from[p->right] = (k & 1) ^ (k >> 1) ? half : -half, from[p->up] = k >> 1 ? half : -half;
    const int next = (k + 1) % 4;
    to[p->right] = (next & 1) ^ (next >> 1) ? half : -half, to[p->up] = next >> 1 ? half : -half;
    line(p, from, to, c);
  }
}

/* The pyramid of what the picture shows, as long as `depth`. */
static void frustum(const panel *p, const sf_camera *camera, double depth, colour c)
{
  const float *m = camera->to_world;
  double eye[3], corner[4][3];
  for (int i = 0; i < 3; i++) eye[i] = (double)m[4 * i + 3];
  for (int k = 0; k < 4; k++) {
    const double px = (k == 1 || k == 2 ? camera->width : 0), py = (k >= 2 ? camera->height : 0);
    const double x = (px - (double)camera->cx) / (double)camera->fx, y = ((double)camera->cy - py) / (double)camera->fy;
    for (int i = 0; i < 3; i++)
      corner[k][i] = eye[i] + depth * ((double)m[4 * i] * x + (double)m[4 * i + 1] * y - (double)m[4 * i + 2]);
  }
  for (int k = 0; k < 4; k++) line(p, eye, corner[k], c), line(p, corner[k], corner[(k + 1) % 4], c);
}

static void draw(const panel *p, const sf_dataset *data, colour c)
{
  for (int v = 0; v < data->count; v++) frustum(p, &data->view[v].camera, 0.08 * p->reach, c);
}

static void fill(const panel *p, const sf_dataset *of_train, const sf_dataset *of_test)
{
  for (int n = 0; n < of_train->points && !of_train->ndc; n++) {
    double at[3], spot[2];
    for (int i = 0; i < 3; i++) at[i] = (double)of_train->point[3 * n + i];
    place(p, at, spot);
    if (fabs(spot[0]) < 1e6 && fabs(spot[1]) < 1e6) put(p, (int)floor(spot[0]), (int)floor(spot[1]), dot);
  }
  if (of_train->ndc && p->up == 2) { /* the near plane is the edge of what can be modelled */
    const double z = -(double)of_train->ndc_near;
    line(p, (double[3]){-p->reach, 0, z}, (double[3]){p->reach, 0, z}, edge);
  }
  if (!of_train->ndc) {
    square(p, 1, inner);
    square(p, of_train->bound, edge);
  }
  draw(p, of_train, train);
  draw(p, of_test, test);
}

/* Half the edge of a panel about `middle`: all cameras, but not a stray one, and of the box what leaves them large. */
static double find_reach(const sf_dataset *data, const double middle[3])
{
  double sum = 0, most = 0;
  for (int v = 0; v < data->count; v++) {
    double away = 0;
    for (int i = 0; i < 3; i++) away = fmax(away, fabs((double)data->view[v].camera.to_world[4 * i + 3] - middle[i]));
    sum += away / data->count, most = fmax(most, away);
  }
  most = fmin(most, 4 * sum);
  return 1.15 * fmax(most, data->ndc ? (double)data->ndc_near : fmin(data->bound, 1.5 * most));
}

/* ---- words ---- */

static void word(sf_image *image, int x, int y, colour c, const char *text)
{
  sf_image_text(image, x, y, WORD, (uint8_t[]){c.r, c.g, c.b}, text);
}

/* 1, 2 or 5 times a power of ten, at most `most`. */
static double round_length(double most)
{
  const double ten = pow(10, floor(log10(most)));
  return most >= 5 * ten ? 5 * ten : most >= 2 * ten ? 2 * ten : ten;
}

/* A bar with its length, at the right of the foot. */
static void draw_scale(const panel *p, bool ndc)
{
  char text[60];
  const double length = round_length(0.5 * p->reach);
  const int pixels = (int)lround(0.5 * p->size * length / p->reach), y = p->size + SF_PLAN_FOOT / 2;
  snprintf(text, sizeof text, "%g %s unit%s", length, ndc ? "near-plane" : "model", length == 1 ? "" : "s");
  const int end = p->image->width - MARGIN, begin = end - pixels;
  const panel whole = {.image = p->image, .size = p->image->width, .foot = true};
  for (int x = begin; x <= end; x++) put(&whole, x, y, ink);
  for (int v = -4; v <= 4; v++) put(&whole, begin, y + v, ink), put(&whole, end, y + v, ink);
  word(p->image, begin - MARGIN - sf_image_text_width(text, WORD), y - WORD * SF_TEXT_HEIGHT / 2, ink, text);
}

static void draw_legend(const panel *p, const sf_dataset *of_train, const sf_dataset *of_test)
{
  char text[4][60] = {"", "", "", ""};
  const colour c[4] = {train, test, edge, dot};
  snprintf(text[0], sizeof text[0], "%d to learn from", of_train->count);
  snprintf(text[1], sizeof text[1], "%d held out", of_test->count);
  if (of_train->ndc)
    snprintf(text[2], sizeof text[2], "near plane");
  else
    snprintf(text[2], sizeof text[2], "box [-%d, %d]", of_train->bound, of_train->bound);
  if (of_train->points && !of_train->ndc) snprintf(text[3], sizeof text[3], "points");
  int x = MARGIN;
  for (int k = 0; k < 4; k++) {
    word(p->image, x, p->size + (SF_PLAN_FOOT - WORD * SF_TEXT_HEIGHT) / 2, c[k], text[k]);
    x += sf_image_text_width(text[k], WORD) + 2 * MARGIN;
  }
}

sf_status sf_plan_draw(const sf_dataset *of_train, const sf_dataset *of_test, int size, sf_image *image)
{
  const size_t numbers = 8 * (size_t)size * (size_t)(size + SF_PLAN_FOOT);
  *image = (sf_image){2 * size, size + SF_PLAN_FOOT, malloc(numbers * sizeof *image->rgba)};
  if (!image->rgba) return sf_fail(SF_E_MEMORY, "no memory for a picture of %d x %d", 2 * size, size + SF_PLAN_FOOT);
  for (size_t i = 0; i < numbers; i++) image->rgba[i] = (uint16_t)((i % 4 == 3 ? 255 : paper.r) * 257);
  panel top = {.image = image, .size = size, .right = 0, .up = 1, .reach = 1};
  top.reach = fmax(find_reach(of_train, top.middle), find_reach(of_test, top.middle));
  panel side = top;
  side.x = size, side.up = 2;
  word(image, MARGIN, MARGIN, ink, "from above: x right, y up");
  word(image, size + MARGIN, MARGIN, ink, "from the side: x right, z up");
  draw_legend(&top, of_train, of_test);
  draw_scale(&top, of_train->ndc);
  fill(&top, of_train, of_test), fill(&side, of_train, of_test);
  const panel whole = {.image = image, .x = size, .size = size};
  for (int y = 0; y < size; y++) put(&whole, 0, y, edge);
  return sf_ok();
}
