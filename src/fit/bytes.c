/* A field for a memory of so many bytes. Tables are halved and levels left out, one after another, until the rest fits;
 * of TensoRF lines of components go, points of an axis, and the box around what is empty. Of what can be cut, what
 * loses least for each byte that it saves. Each cut is measured alone, against the photographs; as many of the cheapest
 * are taken as make the field a third smaller, then all are measured again. */
#include "src/fit/internal.h"
#include "src/fx/tensorf.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

enum { CHECK_SHARE = 32, CHECK_MIN = 1024, CHUNK = 8192, CUTS_MAX = 2 * FX_LEVELS_MAX };
static const double AT_ONCE = 0.7; /* of the bytes stay, at least, between two measurements */

typedef struct cut {
  const sf_cut_kind *kind;
  int place;
  bool taken;
  double loss;    /* of squared error */
  uint64_t bytes; /* that it saves */
} cut;

typedef struct shrink {
  const sf_fit_job *job;
  const fx_scene *scene;
  uint64_t bound, bytes, check_end; /* rays 0..check_end-1 check */
  sf_trim_use use;
  sf_trim trim;
  cut cuts[CUTS_MAX];
  int count, rounds;
} shrink;

static sf_status tick(const shrink *s, const char *what, int done, int total)
{
  if (!s->job->tick || s->job->tick(s->job->user, what, done, total)) return sf_ok();
  return sf_fail(SF_E_STOPPED, "%s: stopped while fitting", s->job->name);
}

/* ---- bytes ---- */

static uint64_t grid_bytes(const fx_scene *scene, const sf_trim *trim)
{
  uint64_t sum = 0;
  for (int l = 0; l < scene->grid.levels; l++) {
    if (!trim->level[l]) continue;
    const int64_t entries =
        trim->log2_size[l] < 0 ? sf_grid_level_entries(&scene->grid, l) : (int64_t)1 << trim->log2_size[l];
    sum += (uint64_t)entries * FX_GRID_FEATURES;
  }
  return sum;
}

/* Components, of all pairs and both sums. */
static int components_of(const sf_trim_planes *p)
{
  int sum = 0;
  for (int i = 0; i < SF_FACTORS * FX_PAIRS; i++)
    sum += sf_count_kept(p->component[i / FX_PAIRS][i % FX_PAIRS], FX_COMPONENTS_MAX);
  return sum;
}

/* Planes, lines, and the basis matrix, which has a row for each component of the appearance. */
static uint64_t planes_bytes(const sf_trim_planes *p)
{
  uint64_t sum = 0;
  for (int i = 0; i < SF_FACTORS * FX_PAIRS; i++) {
    const int *axes = fx_pair_axes[i % FX_PAIRS];
    const uint64_t plane = (uint64_t)p->points[axes[0]] * (uint64_t)p->points[axes[1]],
                   line = (uint64_t)p->points[axes[2]],
                   row = i / FX_PAIRS == SF_OF_APPEARANCE ? (uint64_t)FX_APPEARANCE_MAX : 0;
    sum += (plane + line + row) * (uint64_t)sf_count_kept(p->component[i / FX_PAIRS][i % FX_PAIRS], FX_COMPONENTS_MAX);
  }
  return sum;
}

static uint64_t bytes_of(const shrink *s, const sf_trim *trim)
{
  return s->scene->backbone == FX_INGP ? grid_bytes(s->scene, trim) : planes_bytes(&trim->planes);
}

/* ---- loss ---- */

static sf_status error_of(shrink *s, const sf_trim *trim, uint64_t *error)
{
  fx_scene trial;
  *error = 0;
  SF_TRY(sf_trim_apply(s->scene, trim, &s->use, s->job->name, &trial));
  sf_status status = sf_ok();
  for (uint64_t at = 0; at < s->check_end && status.code == SF_OK; at += CHUNK) {
    sf_fit_sum part;
    status =
        sf_fit_measure(&trial, s->job->rays, at, at + CHUNK < s->check_end ? at + CHUNK : s->check_end, NULL, &part);
    *error += part.error;
  }
  fx_scene_free(&trial);
  return status;
}

static double db(uint64_t error, uint64_t reference)
{
  return 10 * log10((double)error / (double)reference);
}

static double psnr(const shrink *s, uint64_t error)
{
  return 10 * log10(3.0 * (double)s->check_end * 65535.0 * 65535.0 / (double)error);
}

/* ---- cuts ---- */

static sf_status measure_cut(shrink *s, const sf_cut_kind *kind, int place, uint64_t error)
{
  sf_trim trial = s->trim;
  uint64_t with;
  if (!kind->apply(s->scene, &s->use, &trial, place)) return sf_ok();
  const uint64_t bytes = bytes_of(s, &trial);
  if (bytes >= s->bytes) return sf_ok();
  SF_TRY(error_of(s, &trial, &with));
  s->cuts[s->count++] =
      (cut){.kind = kind, .place = place, .loss = (double)with - (double)error, .bytes = s->bytes - bytes};
  return sf_ok();
}

static sf_status measure_cuts(shrink *s, uint64_t error)
{
  int all = 0, done = 0;
  s->count = 0;
  s->rounds++;
  for (int k = 0; k < sf_cut_kind_count; k++)
    if (sf_cut_kinds[k].bytes) all += sf_cut_kinds[k].places(s->scene);
  for (int k = 0; k < sf_cut_kind_count; k++)
    for (int i = 0; sf_cut_kinds[k].bytes && i < sf_cut_kinds[k].places(s->scene); i++) {
      SF_TRY(tick(s, "the field's parts", done++, all));
      SF_TRY(measure_cut(s, &sf_cut_kinds[k], i, error));
    }
  return sf_ok();
}

/* Cuts of one level, or of one axis: each was measured with the part as it was. */
static bool of_one_part(const shrink *s, const cut *a, const cut *b)
{
  if (s->scene->backbone == FX_INGP) return a->place == b->place;
  return a->kind == b->kind && a->place % FX_PAIRS == b->place % FX_PAIRS;
}

/* The least loss for a byte, unless another one alone is enough at no more loss. */
static cut *choose(shrink *s, uint64_t wanted)
{
  cut *cheap = NULL, *enough = NULL;
  for (int i = 0; i < s->count; i++) {
    cut *c = &s->cuts[i];
    if (c->taken) continue;
    if (!cheap || c->loss / (double)c->bytes < cheap->loss / (double)cheap->bytes) cheap = c;
    if (c->bytes >= wanted && (!enough || c->loss < enough->loss)) enough = c;
  }
  return enough && enough->loss <= cheap->loss ? enough : cheap;
}

static void take_cuts(shrink *s)
{
  const double floor = AT_ONCE * (double)s->bytes;
  while (s->bytes > s->bound && (double)s->bytes > floor) {
    cut *c = choose(s, s->bytes - s->bound);
    if (!c) return;
    for (int i = 0; i < s->count; i++) s->cuts[i].taken |= of_one_part(s, &s->cuts[i], c);
    c->kind->apply(s->scene, &s->use, &s->trim, c->place);
    s->bytes = bytes_of(s, &s->trim);
  }
}

/* ---- all of it ---- */

/* Which entries are seen, and how much: those that meet in a smaller table are averaged by it. */
static sf_status observe(shrink *s)
{
  const uint64_t count = s->job->rays->count;
  SF_TRY(sf_trim_use_create(&s->use, s->scene));
  for (uint64_t at = s->check_end; at < count; at += CHUNK) {
    SF_TRY(tick(s, "observing ray", (int)at, (int)count));
    SF_TRY(sf_fit_observe(s->scene, s->job->rays, at, at + CHUNK < count ? at + CHUNK : count, true, &s->use));
  }
  return sf_ok();
}

static sf_status too_lossy(const shrink *s, double loss, double allowed, uint64_t best)
{
  return sf_fail(SF_E_RANGE,
                 "%s: a field of %" PRIu64
                 " bytes loses %.3f dB, more than --fit-loss %g; the smallest within it that was "
                 "found has %" PRIu64 " bytes",
                 s->job->name, s->bytes, loss, allowed, best);
}

static sf_status search(shrink *s, double allowed, sf_fit_tables *report)
{
  uint64_t before, error;
  uint64_t best = s->bytes;
  SF_TRY(error_of(s, &s->trim, &before));
  error = before;
  while (s->bytes > s->bound) {
    const uint64_t had = s->bytes;
    SF_TRY(measure_cuts(s, error));
    take_cuts(s);
    SF_TRY(error_of(s, &s->trim, &error));
    if (db(error, before) <= allowed && s->bytes < best) best = s->bytes;
    if (s->bytes == had)
      return sf_fail(SF_E_RANGE, "%s: the field cannot take fewer than %" PRIu64 " bytes", s->job->name, s->bytes);
  }
  const double loss = db(error, before);
  if (loss > allowed) return too_lossy(s, loss, allowed, best);
  report->psnr_before = psnr(s, before), report->psnr_after = psnr(s, error), report->loss_db = loss;
  return sf_ok();
}

static void describe_levels(const shrink *s, sf_fit_tables *report)
{
  for (int l = 0; l < s->scene->grid.levels; l++) {
    report->dropped += !s->trim.level[l];
    report->smaller += s->trim.level[l] && s->trim.log2_size[l] >= 0;
  }
}

static void describe_planes(const shrink *s, sf_fit_tables *report)
{
  const fx_tensorf *field = &s->scene->tensorf;
  report->dropped = fx_factors_components(&field->density) + fx_factors_components(&field->appearance) -
                    components_of(&s->trim.planes);
  for (int axis = 0; axis < 3; axis++) report->smaller += s->trim.planes.points[axis] < field->res[axis];
}

static sf_status run(shrink *s, double allowed, fx_scene *small, sf_fit_tables *report)
{
  SF_TRY(observe(s));
  sf_trim_all(s->scene, &s->trim);
  s->bytes = report->bytes_before = bytes_of(s, &s->trim);
  SF_TRY(search(s, allowed, report));
  report->bytes_after = s->bytes, report->rounds = s->rounds, report->checked = s->check_end;
  report->planes = s->scene->backbone == FX_TENSORF;
  if (report->planes)
    describe_planes(s, report);
  else
    describe_levels(s, report);
  return sf_trim_apply(s->scene, &s->trim, &s->use, s->job->name, small);
}

sf_status sf_fit_to_bytes(fx_scene *small, const sf_fit_job *job, uint64_t bytes, sf_fit_tables *report)
{
  memset(small, 0, sizeof *small);
  *report = (sf_fit_tables){.bound = bytes};
  shrink *s = calloc(1, sizeof *s);
  if (!s) return sf_fail(SF_E_MEMORY, "%s: no memory to fit", job->name);
  const uint64_t count = job->rays->count, share = count / CHECK_SHARE;
  s->job = job, s->scene = job->candidate[0], s->bound = bytes;
  s->check_end = share > CHECK_MIN ? share : count / 4 < CHECK_MIN ? count / 4 : CHECK_MIN;
  const sf_status status = run(s, job->loss_db, small, report);
  sf_trim_use_free(&s->use);
  free(s);
  return status;
}

/* ---- report ---- */

void sf_fit_tables_print(FILE *out, const sf_fit_tables *r)
{
  fprintf(out,
          "%s: %" PRIu64 " -> %" PRIu64 " bytes, at most %" PRIu64 " were asked for: %d %s left out, %d %s; "
          "PSNR %.3f -> %.3f dB on %" PRIu64 " rays, before the fit\n",
          r->planes ? "planes" : "grid", r->bytes_before, r->bytes_after, r->bound, r->dropped,
          r->planes ? "components" : "levels", r->smaller, r->planes ? "axes shorter" : "tables smaller",
          r->psnr_before, r->psnr_after, r->checked);
}

cJSON *sf_fit_tables_json(const sf_fit_tables *r)
{
  cJSON *json = cJSON_CreateObject();
  sf_json_add_u64(json, "bound", r->bound);
  sf_json_add_u64(json, "bytes_before", r->bytes_before);
  sf_json_add_u64(json, "bytes_after", r->bytes_after);
  cJSON_AddNumberToObject(json, r->planes ? "components_dropped" : "levels_dropped", r->dropped);
  cJSON_AddNumberToObject(json, r->planes ? "axes_shorter" : "tables_smaller", r->smaller);
  cJSON_AddNumberToObject(json, "psnr_before", r->psnr_before);
  cJSON_AddNumberToObject(json, "psnr_after", r->psnr_after);
  cJSON_AddNumberToObject(json, "loss_db", r->loss_db);
  sf_json_add_u64(json, "checked_rays", r->checked);
  cJSON_AddNumberToObject(json, "rounds", r->rounds);
  return json;
}
