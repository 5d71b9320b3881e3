/* sf_data: what the programs understand of a folder of posed pictures, and what looks wrong with it. */
#include "cli/cli.h"
#include "base/json.h"
#include "scene/scene.h"
#include "tools/solve/solve.h"
#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

enum { TRAIN, TEST, SPLITS, PLAN_SIZE = 600, SHOWN = 8 };
static const char *const split_name[SPLITS] = {"train", "test"};

typedef struct job {
  const char *path, *png;
  int downscale, threads;
  double scale;
  bool json, solve;
  solve_options photographs;
  solve_result solved;
  sf_dataset split[SPLITS];
  sf_dataset all; /* views of both; borrows all else from the training split, but for its own warnings */
} job;

/* Views with the same camera. */
typedef struct kind {
  const sf_view *view;
  int count;
} kind;

static bool same_camera(const sf_view *a, const sf_view *b)
{
  const sf_camera *x = &a->camera, *y = &b->camera;
  return x->width == y->width && x->height == y->height && x->fx == y->fx && x->fy == y->fy && x->cx == y->cx &&
         x->cy == y->cy && x->k1 == y->k1 && x->k2 == y->k2 && x->p1 == y->p1 && x->p2 == y->p2;
}

/* kind: [views] at most. */
static int sort_kinds(const sf_dataset *data, kind *kinds)
{
  int n = 0;
  for (int v = 0; v < data->count; v++) {
    int k = 0;
    while (k < n && !same_camera(kinds[k].view, &data->view[v])) k++;
    if (k == n) kinds[n++] = (kind){&data->view[v], 0};
    kinds[k].count++;
  }
  return n;
}

/* ---- loading ---- */

static sf_status join_splits(job *j)
{
  const sf_dataset *train = &j->split[TRAIN], *test = &j->split[TEST];
  const int count = train->count + test->count;
  j->all = *train;
  j->all.warning = NULL, j->all.warnings = 0;
  j->all.view = calloc((size_t)count + 1, sizeof *j->all.view);
  if (!j->all.view) return sf_fail(SF_E_MEMORY, "%s: no memory for %d views", j->path, count);
  j->all.count = count;
  if (train->count) memcpy(j->all.view, train->view, (size_t)train->count * sizeof *train->view);
  if (test->count) memcpy(j->all.view + train->count, test->view, (size_t)test->count * sizeof *test->view);
  return sf_dataset_survey(&j->all);
}

static sf_status load(job *j)
{
  const sf_dataset_options how = {.downscale = j->downscale, .scale = (float)j->scale, .cameras_only = true};
  for (int s = 0; s < SPLITS; s++) SF_TRY(sf_dataset_load(&j->split[s], j->path, split_name[s], &how));
  SF_TRY(sf_dataset_agree(&j->split[TRAIN], &j->split[TEST]));
  return join_splits(j);
}

static void unload(job *j)
{
  free(j->all.view), free(j->all.warning);
  for (int s = 0; s < SPLITS; s++) sf_dataset_free(&j->split[s]);
}

/* The same of both splits once. */
static bool told_before(const job *j, int s, const char *text)
{
  return s == TEST && sf_dataset_has_warning(&j->split[TRAIN], text);
}

/* ---- text ---- */

static void print_kinds(const sf_dataset *data, const kind *kinds, int n)
{
  for (int k = 0; k < n && k < SHOWN; k++) {
    const sf_camera *c = &kinds[k].view->camera;
    printf("%s%s, %d x %d px, focal length %.2f x %.2f, centre %.2f, %.2f", k ? "             " : "cameras      ",
           kinds[k].view->lens, c->width, c->height, (double)c->fx, (double)c->fy, (double)c->cx, (double)c->cy);
    if (c->k1 != 0 || c->k2 != 0 || c->p1 != 0 || c->p2 != 0)
      printf(", k1 %.5g k2 %.5g p1 %.5g p2 %.5g", (double)c->k1, (double)c->k2, (double)c->p1, (double)c->p2);
    if (n > 1) printf(" (%d views)", kinds[k].count);
    printf("\n");
  }
  if (n > SHOWN) printf("             and %d more kinds among %d views\n", n - SHOWN, data->count);
}

static void print_space(const sf_dataset *d)
{
  if (d->ndc) {
    printf("space        forward-facing by its poses: NDC, near plane at %g, focal length over half the picture %.4f x "
           "%.4f, NDC * %.6g = model\n",
           (double)d->ndc_near, (double)d->ndc_focal[0], (double)d->ndc_focal[1], (double)d->scale);
  } else {
    printf("space        model = world * %.6g", (double)d->scale);
    if (d->offset[0] != 0 || d->offset[1] != 0 || d->offset[2] != 0)
      printf(" + (%g, %g, %g)", (double)d->offset[0], (double)d->offset[1], (double)d->offset[2]);
    printf(", no NDC\n");
  }
  printf("bound        %d: the scene box is [-%d, %d]^3 model units\n", d->bound, d->bound, d->bound);
}

static void print_distances(const sf_dataset *d)
{
  double least = INFINITY, most = 0;
  for (int v = 0; v < d->count; v++) {
    const float *m = d->view[v].camera.to_world;
    const double away = sqrt((double)(m[3] * m[3] + m[7] * m[7] + m[11] * m[11]));
    least = fmin(least, away), most = fmax(most, away);
  }
  printf("positions    %.3g to %.3g %s units from the origin\n", least, most, d->ndc ? "near-plane" : "model");
  if (d->points) printf("points       %d sparse points\n", d->points);
}

static void print_solved(const solve_result *r)
{
  printf("solved       %d of %d pictures found their place, by %d points; mean reprojection error %.2f px\n",
         r->registered, r->pictures, r->points, r->error);
}

static void print_text(const job *j, const kind *kinds, int n)
{
  const sf_dataset *d = &j->all;
  if (j->solve) print_solved(&j->solved);
  printf("%s: %s layout\n", j->path, sf_layout_names[d->layout]);
  printf("views        %d to learn from, %d held out; the first are %s and %s\n", j->split[TRAIN].count,
         j->split[TEST].count, j->split[TRAIN].count ? j->split[TRAIN].view[0].name : "none",
         j->split[TEST].count ? j->split[TEST].view[0].name : "none");
  print_kinds(d, kinds, n);
  print_space(d);
  print_distances(d);
  int told = 0;
  for (int s = 0; s < SPLITS; s++)
    for (int i = 0; i < j->split[s].warnings; i++)
      if (!told_before(j, s, j->split[s].warning[i])) printf("looks wrong  %s\n", j->split[s].warning[i]), told++;
  for (int i = 0; i < d->warnings; i++) printf("looks wrong  %s\n", d->warning[i]), told++;
  if (!told) printf("looks wrong  nothing\n");
}

/* ---- JSON ---- */

static void add_numbers(cJSON *json, const char *key, const double *value, int n)
{
  cJSON_AddItemToObject(json, key, cJSON_CreateDoubleArray(value, n));
}

static cJSON *kind_json(const kind *k)
{
  const sf_camera *c = &k->view->camera;
  cJSON *json = cJSON_CreateObject();
  cJSON_AddStringToObject(json, "model", k->view->lens);
  cJSON_AddNumberToObject(json, "views", k->count);
  cJSON_AddNumberToObject(json, "width", c->width);
  cJSON_AddNumberToObject(json, "height", c->height);
  add_numbers(json, "focal", (double[]){(double)c->fx, (double)c->fy}, 2);
  add_numbers(json, "centre", (double[]){(double)c->cx, (double)c->cy}, 2);
  add_numbers(json, "lens", (double[]){(double)c->k1, (double)c->k2, (double)c->p1, (double)c->p2}, 4);
  return json;
}

static cJSON *view_json(const sf_view *view)
{
  double pose[12];
  cJSON *json = cJSON_CreateObject();
  for (int i = 0; i < 12; i++) pose[i] = (double)view->camera.to_world[i];
  cJSON_AddStringToObject(json, "name", view->name);
  add_numbers(json, "to_model", pose, 12);
  cJSON_AddNumberToObject(json, "brightness", (double)view->brightness);
  return json;
}

static void add_space(cJSON *json, const sf_dataset *d)
{
  double offset[3];
  for (int i = 0; i < 3; i++) offset[i] = (double)d->offset[i];
  cJSON_AddNumberToObject(json, "scale", (double)d->scale);
  add_numbers(json, "offset", offset, 3);
  add_numbers(json, "world", d->world, 12);
  cJSON_AddNumberToObject(json, "bound", d->bound);
  cJSON_AddBoolToObject(json, "ndc", d->ndc);
  if (d->ndc) {
    cJSON_AddNumberToObject(json, "ndc_near", (double)d->ndc_near);
    add_numbers(json, "ndc_focal", (double[]){(double)d->ndc_focal[0], (double)d->ndc_focal[1]}, 2);
  }
  cJSON_AddNumberToObject(json, "points", d->points);
}

static void add_warnings(cJSON *json, const job *j)
{
  cJSON *list = cJSON_AddArrayToObject(json, "warnings");
  for (int s = 0; s < SPLITS; s++)
    for (int i = 0; i < j->split[s].warnings; i++)
      if (!told_before(j, s, j->split[s].warning[i]))
        cJSON_AddItemToArray(list, cJSON_CreateString(j->split[s].warning[i]));
  for (int i = 0; i < j->all.warnings; i++) cJSON_AddItemToArray(list, cJSON_CreateString(j->all.warning[i]));
}

static sf_status print_json(const job *j, const kind *kinds, int n)
{
  cJSON *json = cJSON_CreateObject();
  cJSON_AddStringToObject(json, "data", j->path);
  cJSON_AddStringToObject(json, "layout", sf_layout_names[j->all.layout]);
  cJSON *cameras = cJSON_AddArrayToObject(json, "cameras");
  for (int k = 0; k < n; k++) cJSON_AddItemToArray(cameras, kind_json(&kinds[k]));
  add_space(json, &j->all);
  for (int s = 0; s < SPLITS; s++) {
    cJSON *views = cJSON_AddArrayToObject(json, split_name[s]);
    for (int v = 0; v < j->split[s].count; v++) cJSON_AddItemToArray(views, view_json(&j->split[s].view[v]));
  }
  add_warnings(json, j);
  if (j->solve) {
    cJSON *solved = cJSON_AddObjectToObject(json, "solved");
    cJSON_AddNumberToObject(solved, "pictures", j->solved.pictures);
    cJSON_AddNumberToObject(solved, "registered", j->solved.registered);
    cJSON_AddNumberToObject(solved, "points", j->solved.points);
    cJSON_AddNumberToObject(solved, "reprojection_error", j->solved.error);
  }
  return sf_json_print(json, true);
}

/* ---- program ---- */

static sf_status draw_plan(const job *j)
{
  sf_image image;
  if (!j->png) return sf_ok();
  SF_TRY(sf_plan_draw(&j->split[TRAIN], &j->split[TEST], PLAN_SIZE, &image));
  const sf_status status = sf_image_save_png(&image, j->png);
  sf_image_free(&image);
  return status;
}

static sf_status report(const job *j)
{
  kind *kinds = calloc((size_t)j->all.count + 1, sizeof *kinds);
  if (!kinds) return sf_fail(SF_E_MEMORY, "%s: no memory for %d views", j->path, j->all.count);
  const int n = sort_kinds(&j->all, kinds);
  sf_status status = sf_ok();
  if (j->json)
    status = print_json(j, kinds, n);
  else
    print_text(j, kinds, n);
  free(kinds);
  if (status.code == SF_OK) status = draw_plan(j);
  if (status.code == SF_OK && j->png && !j->json) printf("wrote %s\n", j->png);
  return status;
}

/* Photographs become a data set first, which is then read as any other. */
static sf_status solve_first(job *j)
{
  if (!j->solve) return sf_ok();
  if (!j->photographs.output) return sf_fail(SF_E_USAGE, "missing option -o DIR, the data set that --solve makes");
  sf_cli_catch_signals();
  j->photographs.input = j->path;
  SF_TRY(solve(&j->photographs, &j->solved));
  j->path = j->photographs.output;
  return sf_ok();
}

static sf_status run(const sf_cli *cli, int argc, char **argv, job *j)
{
  static const char *const solving[] = {"--output", "--frames", "--features", "--matching", "--lens", NULL};
  SF_TRY(sf_cli_parse(cli, argc, argv, &j->path));
  if (!j->solve) SF_TRY(sf_cli_refuse(cli, argc, argv, solving, "has no effect without --solve"));
  if (j->threads) omp_set_num_threads(j->threads);
  j->photographs.quiet |= j->json;
  SF_TRY(solve_first(j));
  SF_TRY(load(j));
  return report(j);
}

int main(int argc, char **argv)
{
  job j = {.photographs = {.frames = 80, .features = 3000}};
  solve_options *p = &j.photographs;
  const sf_option options[] = {
      {"--png", 0, SF_ARG_OUTPUT, &j.png, 0, 0, NULL, "FILE",
       "picture of the cameras from above and from the side: blue to learn from, red held out"},
      {"--downscale", 0, SF_ARG_INT, &j.downscale, 0, 64, NULL, "N",
       "read pictures of 1/N of the full size, 0 = by the layout (default 0)"},
      {"--scale", 0, SF_ARG_DOUBLE, &j.scale, 0, 1e6, NULL, "S",
       "model units per world unit, 0 = the layout's (default 0)"},
      {"--threads", 0, SF_ARG_INT, &j.threads, 1, 1024, NULL, "N", "threads (default: all processors)"},
      {"--json", 0, SF_ARG_FLAG, &j.json, 0, 0, NULL, NULL, "all of it as JSON, every pose included"},
      SF_GROUP("Photographs without poses"),
      {"--solve", 0, SF_ARG_FLAG, &j.solve, 0, 0, NULL, NULL,
       "find the poses with COLMAP first; goes on where it was interrupted"},
      {"--output", 'o', SF_ARG_PLACE, &p->output, 0, 0, NULL, "DIR", "the data set to make, in the COLMAP layout"},
      {"--frames", 0, SF_ARG_INT, &p->frames, SF_SOLVE_LEAST, 10000, NULL, "N",
       "of a video: the sharpest frame of each of N intervals (default 80)"},
      {"--features", 0, SF_ARG_INT, &p->features, 50, 100000, NULL, "N",
       "features of a picture, at most; matching takes their square (default 3000)"},
      {"--matching", 0, SF_ARG_CHOICE, &p->matching, 0, 0, SF_SOLVE_MATCHINGS, "WHAT",
       "exhaustive: every pair; sequential: neighbours by name; auto: every pair of up to 100 pictures (default auto)"},
      {"--lens", 0, SF_ARG_CHOICE, &p->lens, 0, 0, SF_SOLVE_LENSES, "MODEL",
       "COLMAP's camera model: one radial term, or all four of OpenCV (default SIMPLE_RADIAL)"},
      {"--quiet", 'q', SF_ARG_FLAG, &p->quiet, 0, 0, NULL, NULL, "no progress, and nothing but the report"},
      {0}};
  const sf_cli cli = {
      .program = "sf_data",
      .usage = "sf_data DIR [options]\n       sf_data PHOTOS --solve -o DIR [options]",
      .summary = "Says what the programs understand of a folder of posed pictures: its layout (Blender, LLFF,\n"
                 "COLMAP, instant-ngp), cameras, splits, where its scene lies - and what looks wrong.\n"
                 "With --solve it first makes such a folder of photographs, or of a video.",
      .examples = "  sf_data fern --png cameras.png\n"
                  "  sf_data bonsai --json\n"
                  "  sf_data photos --solve -o garden --png cameras.png\n"
                  "  sf_data walk.mp4 --solve -o walk --frames 60\n",
      .options = options,
      .min_positional = 1,
      .max_positional = 1};
  const sf_status status = run(&cli, argc, argv, &j);
  unload(&j);
  return sf_cli_finish(&cli, status);
}
