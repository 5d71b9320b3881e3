#include "cycles/lines.h"
#include <string.h>

/* Depths and rooms of the RTL: READS, rtl/sf_planes_reads.sv; PAIRS, TAGS, QUEUE, rtl/sf_cache.sv; FETCHES,
 * rtl/sf_fetch.sv. */
enum { READS = 5, READS_ROOM = 62, PAIRS = 4, TAGS = 3, QUEUE = 125, FETCHES = 32, BANKS = 2 };

static uint64_t later(uint64_t a, uint64_t b)
{
  return a > b ? a : b;
}

/* ---- stages that move together ---- */

/* Not while they stand. */
static uint64_t pipe_enter(const pipe *p, uint64_t at)
{
  for (unsigned k = p->count > p->stages ? p->count - p->stages : 0; k < p->count; k++)
    if (at >= p->came[k % PIPE_MAX] && at < p->left[k % PIPE_MAX]) at = p->left[k % PIPE_MAX];
  return at;
}

static uint64_t pipe_reach(const pipe *p, uint64_t entered)
{
  uint64_t at = entered + p->stages;
  for (unsigned k = p->count > p->stages ? p->count - p->stages : 0; k < p->count; k++)
    if (p->came[k % PIPE_MAX] >= entered) at += p->left[k % PIPE_MAX] - p->came[k % PIPE_MAX];
  return at;
}

static void pipe_leave(pipe *p, uint64_t came, uint64_t left)
{
  p->came[p->count % PIPE_MAX] = came;
  p->left[p->count++ % PIPE_MAX] = left;
}

/* ---- the cache ---- */

sf_status lines_open(lines *l, const fx_cache_shape *shape, int latency)
{
  *l = (lines){.latency = (uint64_t)latency, .reads.stages = READS, .tags.stages = TAGS, .blank = true};
  return fx_cache_open(&l->cache, shape);
}

void lines_close(lines *l)
{
  fx_cache_close(&l->cache);
}

/* By number of lines before this one; early[]: of one that long ago. */
static uint64_t ago(const lines *l, const uint64_t early[LINES_RING], uint64_t n)
{
  return l->count >= n ? early[(l->count - n) % LINES_RING] : 0;
}

/* A pair leaves for the tags. */
static uint64_t leave_pairs(lines *l, uint64_t taken, bool empty)
{
  uint64_t at = later(taken + 1, l->tag_entered);
  if (empty) {
    const uint64_t idle = l->count ? l->tags.left[(l->tags.count - 1) % PIPE_MAX] + 1 : 0;
    at = l->blank ? taken + 2 : later(at, idle) + l->cache.sets / BANKS + 1;
  }
  l->blank = false;
  return at;
}

static bool share_a_set(const lines *l, const uint32_t a[2], const uint32_t b[2])
{
  const uint32_t sets = l->cache.sets;
  return a[0] % sets == b[0] % sets || a[0] % sets == b[1] % sets || a[1] % sets == b[0] % sets ||
         a[1] % sets == b[1] % sets;
}

/* A look-up whose set is still at work in the stages waits. */
static uint64_t enter_tags(const lines *l, const uint32_t line[2], uint64_t at)
{
  at = pipe_enter(&l->tags, at);
  for (uint64_t k = l->count > TAGS ? l->count - TAGS : 0; k < l->count; k++)
    if (share_a_set(l, l->line[k % LINES_RING], line))
      at = pipe_enter(&l->tags, later(at, l->tags.left[k % PIPE_MAX] + 1));
  return at;
}

/* A line that is missing is asked for as its look-up is about to leave the tags, once the memory's side can be asked.
 * Returns when. */
static uint64_t ask(lines *l, uint64_t at)
{
  const uint64_t room = l->misses >= FETCHES ? l->pop[(l->misses - FETCHES) % LINES_RING] + 3 : 0;
  if (l->misses) at = later(at, later(l->asked + 2, room));
  l->second_beat[l->misses % 2] = later(at + 3 + l->latency, l->misses ? l->second_beat[(l->misses - 1) % 2] + 2 : 0);
  l->misses++;
  return l->asked = at;
}

/* When the last of the `misses` lines that were asked for last stands before the head of the queue, which waits from
 * `head` on. */
static uint64_t fetch(lines *l, int misses, uint64_t head)
{
  for (uint64_t i = l->misses - (uint64_t)misses; i < l->misses; i++) {
    head = later(head, later(l->second_beat[i % 2] + 2, i ? l->pop[(i - 1) % LINES_RING] + 1 : 0));
    l->pop[i % LINES_RING] = head;
  }
  return head;
}

/* Room that is counted a cycle late: a line that goes right behind another one is let in where that one was. left: the
 * one before; freed: when places became free, `room` of which there are. */
static uint64_t enter_room(const lines *l, uint64_t at, uint64_t left, const uint64_t freed[LINES_RING], uint64_t room)
{
  if (l->count && left + 1 == at && (l->count <= room || ago(l, freed, room + 1) + 2 <= at)) return at;
  return l->count < room ? at : later(at, ago(l, freed, room) + 2);
}

/* From the place of its point to the pairs. */
static uint64_t leave_reads(lines *l, uint64_t ready)
{
  l->issued = pipe_enter(&l->reads, ready);
  const uint64_t reached = pipe_reach(&l->reads, l->issued);
  const uint64_t at = l->count < PAIRS ? reached : later(reached, ago(l, l->taken, PAIRS) + 1);
  const uint64_t left = enter_room(l, at, l->reads.left[(l->reads.count - 1) % PIPE_MAX], l->came, READS_ROOM);
  pipe_leave(&l->reads, reached, left);
  return left;
}

static uint64_t leave_tags(lines *l, int misses)
{
  const uint64_t reached = pipe_reach(&l->tags, l->tag_entered), before = l->tags.left[(l->tags.count - 1) % PIPE_MAX];
  uint64_t left = enter_room(l, reached, before, l->queued, QUEUE);
  for (int i = 0; i < misses; i++) left = ask(l, left);
  pipe_leave(&l->tags, reached, left);
  return left;
}

uint64_t lines_next(lines *l, const uint32_t line[2], uint64_t ready, bool empty)
{
  const uint64_t i = l->count % LINES_RING;
  l->taken[i] = later(leave_reads(l, ready) + 1, l->pair_left);
  l->pair_left = leave_pairs(l, l->taken[i], empty);
  if (empty) fx_cache_empty(&l->cache);
  l->tag_entered = enter_tags(l, line, l->pair_left + 1);
  const int misses = (int)fx_cache_look_up(&l->cache, line, line[0] == line[1] ? 1 : 2);
  const uint64_t tagged = leave_tags(l, misses);
  l->queued[i] = l->count ? later(tagged + 1, l->head - 1) : tagged + 1;
  l->head = later(tagged + 3, l->head_left + 1);
  l->head_left = fetch(l, misses, l->head);
  l->came[i] = l->head_left + 3;
  memcpy(l->line[i], line, sizeof l->line[i]);
  l->count++;
  return l->came[i];
}
