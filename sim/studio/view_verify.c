/* Views rendered again and compared with their manifest. */
#include "sim/studio/internal.h"
#include "base/sha256.h"
#include "base/text.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* The picture differs from the manifest. The EXR shows which pixel, if it is the one of the manifest. */
static void locate(const sf_view_set *set, const sf_shot *shot, int plane, sf_verdict *verdict)
{
  char path[4096 + 80], hash[65];
  sf_set_path(set, verdict->view->exr, path);
  if (plane < 0 || sf_sha256_file(path, hash).code != SF_OK || strcmp(hash, verdict->view->exr_sha256) != 0) return;
  sf_status pixel = sf_golden_compare_file(&shot->golden, path, plane);
  if (pixel.code == SF_E_DIFFERENCE) verdict->picture = pixel;
}

static void check_file(const sf_view_set *set, const sf_shot *shot, sf_verdict *verdict)
{
  char path[4096 + 80], hash[65];
  sf_set_path(set, verdict->view->exr, path);
  if (access(path, F_OK)) return;
  verdict->file = sf_sha256_file(path, hash);
  if (verdict->file.code != SF_OK || !strcmp(hash, verdict->view->exr_sha256)) return;
  verdict->file = sf_golden_compare_file(&shot->golden, path, -1);
  if (verdict->file.code == SF_OK)
    snprintf(verdict->note, sizeof verdict->note, "%s is not the file of the manifest, its integer planes are the same",
             verdict->view->exr);
}

/* Pictures of the data set only judge a rendering; they are not part of it. */
static void check_quality(const sf_manifest_view *here, sf_verdict *verdict)
{
  const sf_manifest_view *view = verdict->view;
  bool same = (fabs(view->psnr - here->psnr) <= 0.001 || (isnan(view->psnr) && !isfinite(here->psnr))) &&
              (fabs(view->ssim - here->ssim) <= 0.001 || (isnan(view->ssim) && isnan(here->ssim)));
  if (same || verdict->note[0]) return;
  snprintf(verdict->note, sizeof verdict->note,
           "PSNR %.4f dB, SSIM %.4f, in the manifest %.4f dB, %.4f: another picture to compare with", here->psnr,
           here->ssim, view->psnr, view->ssim);
}

static sf_status verify_view(sf_view_set *set, sf_shot *shot, sf_verdict *verdict)
{
  sf_manifest_view here;
  int plane = -1;
  if (!shot->view) {
    verdict->picture = sf_fail(SF_E_DIFFERENCE, "%s has %d view%s", set->studio->options.data, shot->data.total,
                               sf_plural((uint64_t)shot->data.total));
    return sf_ok();
  }
  if (strcmp(shot->view->name, verdict->view->name) != 0) {
    verdict->picture = sf_fail(SF_E_DIFFERENCE, "name is %s, here it is %s", verdict->view->name, shot->view->name);
    return sf_ok();
  }
  SF_TRY(sf_set_render(set, shot, &here));
  verdict->picture = sf_manifest_same_view(verdict->view, &here, &plane);
  if (verdict->picture.code != SF_OK) locate(set, shot, plane, verdict);
  check_file(set, shot, verdict);
  if (verdict->picture.code == SF_OK) check_quality(&here, verdict);
  return sf_ok();
}

static sf_status check_total(const sf_view_set *set)
{
  sf_shot shot;
  SF_TRY(sf_shot_load(set->studio, set->manifest.total, &shot));
  int total = shot.data.total;
  sf_shot_free(&shot);
  if (total == set->manifest.total) return sf_ok();
  return sf_fail(SF_E_DIFFERENCE, "%s: views is %d, %s has %d %s views", set->manifest_path, set->manifest.total,
                 set->studio->options.data, total, set->manifest.origin.split);
}

typedef struct verified {
  sf_status status; /* of the comparison itself */
  sf_verdict verdict;
  uint64_t pixels; /* rendered */
  bool seen;       /* the file beside the manifest */
} verified;

static bool sees(const sf_view_set *set, const sf_manifest_view *view)
{
  char path[4096 + 80];
  sf_set_path(set, view->exr, path);
  return !access(path, F_OK);
}

static void verify_unit(void *user, uint64_t unit, void *result)
{
  const sf_set_run *r = user;
  verified *to = result;
  sf_shot shot;
  to->verdict.view = &r->set->manifest.view[r->index[unit]];
  to->status = sf_shot_load(r->set->studio, to->verdict.view->index, &shot);
  if (to->status.code == SF_OK) to->status = verify_view(r->set, &shot, &to->verdict);
  to->pixels = (uint64_t)shot.golden.width * (uint64_t)shot.golden.height;
  to->seen = sees(r->set, to->verdict.view);
  to->verdict.view = NULL; /* a pointer of this rank */
  to->status = sf_ranks_named(r->set->ranks, to->status);
  sf_shot_free(&shot);
}

static bool take_verdict(void *user, uint64_t unit, const void *result)
{
  sf_set_run *r = user;
  const verified *from = result;
  sf_verdict verdict = from->verdict;
  verdict.view = &r->set->manifest.view[r->index[unit]];
  r->ended = from->status;
  if (r->ended.code == SF_OK && from->seen != sees(r->set, verdict.view))
    r->ended = sf_fail(SF_E_IO, "%s/%s: ranks do not see the same files: all have to see this folder", r->set->folder,
                       verdict.view->exr);
  if (r->ended.code != SF_OK) return r->ended.code == SF_E_STOPPED && sf_ranks_stop(r->set->ranks);
  r->set->rendered += from->pixels > 0, r->set->pixels += from->pixels;
  r->differences += verdict.picture.code != SF_OK || verdict.file.code != SF_OK;
  r->report(r->set->user, &verdict);
  return true;
}

static sf_status verify_all(sf_set_run *r)
{
  sf_view_set *set = r->set;
  const sf_deal deal = {.end = (uint64_t)set->todo,
                        .result_size = sizeof(verified),
                        .work = verify_unit,
                        .take = take_verdict,
                        .tick = sf_set_tick,
                        .user = r};
  const sf_status dealt = sf_ranks_deal(set->ranks, &deal);
  if (dealt.code != SF_E_STOPPED && r->ended.code != SF_E_STOPPED) return r->ended.code == SF_OK ? dealt : r->ended;
  return sf_fail(SF_E_STOPPED, "stopped after %d view%s%s", set->rendered, sf_plural((uint64_t)set->rendered),
                 sf_set_lost(&dealt));
}

static sf_status check_set(const sf_view_set *set)
{
  const sf_manifest *m = &set->manifest;
  if (strcmp(m->origin.scene_sha256, set->studio->scene_sha256) != 0)
    return sf_fail(SF_E_DIFFERENCE, "%s: made from the scene with SHA-256 %s, %s has %s", set->manifest_path,
                   m->origin.scene_sha256, set->studio->options.scene, set->studio->scene_sha256);
  return check_total(set);
}

static sf_status same_manifest(const sf_view_set *set)
{
  char hash[65] = "";
  SF_TRY(sf_ranks_agree(set->ranks, sf_sha256_file(set->manifest_path, hash)));
  return sf_ranks_same(set->ranks, "manifest", hash);
}

sf_status sf_view_set_verify(sf_view_set *set, int only, void (*report)(void *user, const sf_verdict *verdict),
                             int *differences)
{
  const sf_manifest *m = &set->manifest;
  *differences = 0;
  if (sf_ranks_size(set->ranks) > 1) {
    SF_TRY(sf_set_same(set));
    SF_TRY(same_manifest(set));
  }
  SF_TRY(sf_ranks_agree(set->ranks, check_set(set)));
  sf_set_run r = {
      .set = set, .index = calloc((size_t)m->count + 1, sizeof *r.index), .ended = sf_ok(), .report = report};
  if (!r.index) return sf_fail(SF_E_MEMORY, "no memory for %d views", m->count);
  for (int i = 0; i < m->count; i++)
    if (only < 0 || m->view[i].index == only) r.index[set->todo++] = i;
  const sf_status status = verify_all(&r);
  free(r.index);
  *differences = r.differences;
  return status;
}
