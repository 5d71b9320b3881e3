/* One iteration on several ranks. Every rank has the whole model and draws the same rays; its parts of the bundles go
 * through the nets on it alone. What they leave goes to all, by sample or by part: so each rank adds the same numbers
 * in the same order as one that is alone. */
#include "train/internal.h"
#include "base/sha256.h"
#include <stdio.h>
#include <string.h>

enum { COMPARE_EVERY = 64 }; /* iterations between two looks at whether the models are equal */

void sf_share_parts(const sf_trainer *t, int *first, int *end)
{
  const int rank = sf_ranks_rank(t->options.ranks);
  *first = sf_share_start(t, rank, GROUPS);
  *end = sf_share_start(t, rank + 1, GROUPS);
}

sf_status sf_share(sf_trainer *t, void *data, size_t size)
{
  return sf_ranks_share(t->options.ranks, data, size, t->edge);
}

void sf_share_rays(sf_trainer *t)
{
  const sf_batch *b = &t->batch;
  for (int i = 0; i <= sf_ranks_size(t->options.ranks); i++) {
    const int bundle = sf_share_start(t, i, b->bundles);
    t->edge[i] = (size_t)(bundle < b->bundles ? b->bundle[bundle].ray : b->rays);
  }
}

void sf_share_blocks(sf_trainer *t)
{
  const sf_batch *b = &t->batch;
  for (int i = 0; i <= sf_ranks_size(t->options.ranks); i++) {
    const int bundle = sf_share_start(t, i, b->bundles);
    t->edge[i] = (size_t)(bundle < b->bundles ? b->bundle[bundle].block : b->blocks);
  }
}

/* The slice of a gradient that rank i adds up. */
static size_t slice_of(const sf_trainer *t, int i)
{
  return sf_group_floats(t->backbone) * (size_t)i / (size_t)sf_ranks_size(t->options.ranks);
}

/* The gradients of this rank's groups, slice after slice, and the bytes where each begins. */
static void pack_slices(sf_trainer *t, float *out, size_t *edge)
{
  const int ranks = sf_ranks_size(t->options.ranks);
  float *to = out;
  int first, end;
  sf_share_parts(t, &first, &end);
  for (int i = 0; i < ranks; i++) {
    const size_t from = slice_of(t, i), n = slice_of(t, i + 1) - from;
    edge[i] = (size_t)(to - out) * sizeof *out;
    for (int g = first; g < end; g++, to += n) memcpy(to, (const float *)t->group[g].grad + from, n * sizeof *to);
  }
  edge[ranks] = (size_t)(to - out) * sizeof *out;
}

/* The groups' sum to the first group of every rank: each adds a slice, over the groups in order, and all slices go to
 * all. That is the order in which one rank adds. */
static sf_status fold(sf_trainer *t)
{
  const int ranks = sf_ranks_size(t->options.ranks), rank = sf_ranks_rank(t->options.ranks);
  const size_t from = slice_of(t, rank), n = slice_of(t, rank + 1) - from, floats = sf_group_floats(t->backbone);
  float *out = t->grads + GROUPS * floats, *in = out + GROUPS * floats, *sum = t->group[0].grad;
  pack_slices(t, out, t->edge);
  for (int i = 0; i <= ranks; i++) t->in_edge[i] = (size_t)sf_share_start(t, i, GROUPS) * n * sizeof *in;
  SF_TRY(sf_ranks_exchange(t->options.ranks, out, t->edge, in, t->in_edge));
  memcpy(sum + from, in, n * sizeof *sum);
  for (int g = 1; g < GROUPS; g++)
    for (size_t i = 0; i < n; i++) sum[from + i] += in[(size_t)g * n + i];
  for (int i = 0; i <= ranks; i++) t->edge[i] = slice_of(t, i);
  return sf_share(t, sum, sizeof *sum);
}

sf_status sf_share_groups(sf_trainer *t)
{
  const int ranks = sf_ranks_size(t->options.ranks);
  for (int i = 0; i <= ranks; i++) t->edge[i] = (size_t)sf_share_start(t, i, GROUPS);
  SF_TRY(sf_share(t, t->group, sizeof *t->group));
  for (int g = 0; g < GROUPS; g++) t->group[g].grad = t->grads + (size_t)g * sf_group_floats(t->backbone);
  return ranks > 1 ? fold(t) : sf_ok();
}

/* ---- the ranks are alike ---- */

/* Eight bytes at a time: it reads every picture of a data set. */
static uint64_t mix(uint64_t hash, const void *data, size_t bytes)
{
  const char *from = data;
  for (uint64_t word; bytes >= sizeof word; bytes -= sizeof word, from += sizeof word) {
    memcpy(&word, from, sizeof word);
    hash = (hash ^ word) * 0x9e3779b97f4a7c15;
    hash ^= hash >> 29;
  }
  for (; bytes; bytes--) hash = (hash ^ (unsigned char)*from++) * 0x100000001b3;
  return hash;
}

static sf_status same(const sf_trainer *t, const char *what, uint64_t hash)
{
  char text[17];
  snprintf(text, sizeof text, "%016llx", (unsigned long long)hash);
  return sf_ranks_same(t->options.ranks, what, text);
}

static uint64_t hash_data(const sf_dataset *data)
{
  uint64_t hash = mix(1, &data->scale, sizeof data->scale);
  hash = mix(hash, data->offset, sizeof data->offset);
  for (int v = 0; v < data->count; v++) {
    const sf_image *im = &data->view[v].image;
    hash = mix(hash, &data->view[v].camera, sizeof data->view[v].camera);
    hash = mix(hash, im->rgba, (size_t)im->width * (size_t)im->height * 4 * sizeof *im->rgba);
  }
  return hash;
}

sf_status sf_share_begin(sf_trainer *t, const char *resume)
{
  sf_ranks *ranks = t->options.ranks;
  char hex[65] = "";
  if (sf_ranks_size(ranks) == 1) return sf_ok();
  sf_status kernels = sf_ranks_same(ranks, "instruction set", t->kernels->name);
  if (kernels.code == SF_E_UNSUPPORTED)
    return sf_fail(SF_E_UNSUPPORTED, "%.200s; SPIKEFIELD_CPU=avx2, avx512 or portable on every rank makes them alike",
                   kernels.message);
  SF_TRY(kernels);
  SF_TRY(same(t, "data set", hash_data(t->data)));
  if (!resume) return sf_ok();
  const sf_status hashed = sf_sha256_file(resume, hex);
  SF_TRY(sf_ranks_agree(ranks, hashed));
  return sf_ranks_same(ranks, "checkpoint", hex);
}

sf_status sf_share_end(sf_trainer *t)
{
  sf_ranks *ranks = t->options.ranks;
  if (sf_ranks_size(ranks) == 1) return sf_ok();
  if (t->iteration % COMPARE_EVERY == 0)
    SF_TRY(same(t, "model after the same iterations", mix(1, t->model.value, t->model.size * sizeof *t->model.value)));
  return sf_ranks_broadcast(ranks, &t->last_step, sizeof t->last_step);
}
