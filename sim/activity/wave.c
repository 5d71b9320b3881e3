#include "sim/activity/wave.h"
#include <gtkwave/fstapi.h>
#include <stdlib.h>
#include <string.h>

enum { DEPTH_MAX = 64, WORD = 8, TOP = -1, NOWHERE = -2 };

/* ---- hierarchy ---- */

typedef struct builder {
  sf_wave *wave;
  int at[DEPTH_MAX], depth; /* instances of the scopes that are open; TOP around the design, NOWHERE outside of it */
} builder;

static bool grow(void *array, int count, size_t size)
{
  void **p = array;
  if (count & (count - 1)) return true;
  void *larger = realloc(*p, (count ? 2 * (size_t)count : 1) * size);
  if (larger) *p = larger;
  return larger != NULL;
}

/* Verilator wraps the design in a scope TOP; blocks without a name hold loop variables. */
static bool open_scope(builder *b, const char *name)
{
  sf_wave *w = b->wave;
  const int parent = b->depth ? b->at[b->depth - 1] : TOP;
  if (b->depth == DEPTH_MAX) return false;
  if (b->depth == 0 && !strcmp(name, "TOP")) {
    b->at[b->depth++] = TOP;
    return true;
  }
  if (parent == NOWHERE || !strncmp(name, "unnamedblk", 10)) {
    b->at[b->depth++] = NOWHERE;
    return true;
  }
  if (!grow(&w->instance, w->instances, sizeof *w->instance)) return false;
  sf_wave_instance *i = &w->instance[w->instances];
  *i = (sf_wave_instance){strdup(name), parent, parent == TOP ? 1 : w->instance[parent].level + 1, false};
  b->at[b->depth++] = w->instances++;
  return i->name != NULL;
}

static void use(sf_wave *w, int instance)
{
  for (; instance != TOP && !w->instance[instance].used; instance = w->instance[instance].parent)
    w->instance[instance].used = true;
}

/* "acc_q[3] [15:0]": name, then the range of a vector. */
static bool add_net(builder *b, const struct fstHierVar *var)
{
  sf_wave *w = b->wave;
  const int at = b->depth ? b->at[b->depth - 1] : TOP;
  if (at < 0 || var->typ == FST_VT_VCD_PARAMETER || var->typ == FST_VT_SV_INT) return true;
  if (!grow(&w->net, w->nets, sizeof *w->net)) return false;
  sf_wave_net *n = &w->net[w->nets++];
  *n = (sf_wave_net){.name = strdup(var->name), .instance = at, .signal = var->handle};
  if (!n->name) return false;
  char *range = strchr(n->name, ' ');
  if (range) *range++ = 0;
  n->vector = range && sscanf(range, "[%d:%d]", &n->msb, &n->lsb) == 2;
  w->signal[var->handle].width = var->length;
  use(w, at);
  return true;
}

static bool read_hierarchy(builder *b, void *reader)
{
  const struct fstHier *h;
  bool fine = true;
  while (fine && (h = fstReaderIterateHier(reader))) {
    if (h->htyp == FST_HT_SCOPE) fine = open_scope(b, h->u.scope.name);
    if (h->htyp == FST_HT_UPSCOPE) b->depth--;
    if (h->htyp == FST_HT_VAR) fine = add_net(b, &h->u.var);
  }
  return fine;
}

static bool allocate_bits(sf_wave *w)
{
  for (uint32_t s = 1; s <= w->signals; s++) {
    w->signal[s].first = w->bits;
    w->bits += w->signal[s].width;
  }
  w->bit = calloc(w->bits + 1, sizeof *w->bit);
  w->value = malloc(w->bits + 1);
  if (!w->bit || !w->value) return false;
  memset(w->value, 'x', w->bits);
  for (size_t i = 0; i < w->bits; i++) w->bit[i].since = w->begin;
  return true;
}

static void *open_reader(const char *path, sf_status *status)
{
  void *reader = fstReaderOpen(path);
  *status = reader ? sf_ok() : sf_fail(SF_E_IO, "%s: the waveform cannot be read back", path);
  return reader;
}

sf_status sf_wave_open(sf_wave *w, const char *path, uint64_t begin)
{
  sf_status status;
  memset(w, 0, sizeof *w);
  void *reader = open_reader(path, &status);
  if (!reader) return status;
  builder b = {.wave = w};
  w->begin = w->end = begin;
  w->signals = fstReaderGetMaxHandle(reader);
  w->signal = calloc((size_t)w->signals + 1, sizeof *w->signal);
  const bool fine = w->signal && read_hierarchy(&b, reader) && allocate_bits(w);
  fstReaderClose(reader);
  return fine ? sf_ok() : sf_fail(SF_E_MEMORY, "%s: no memory for the nets of the waveform", path);
}

/* ---- changes ---- */

static int state(char value)
{
  return value == '0' ? 0 : value == '1' ? 1 : 2;
}

static void change_bits(sf_wave *w, size_t from, size_t to, const char *value, uint64_t time)
{
  for (size_t i = from; i < to; i++) {
    sf_wave_bit *bit = &w->bit[i];
    const char old = w->value[i], next = value[i - from];
    if (old == next) continue;
    bit->time[state(old)] += time - bit->since;
    bit->toggles += state(old) + state(next) == 1;
    bit->since = time;
    w->value[i] = next;
  }
}

/* fstReaderIterBlocks: wide signals change in a few places, so equal stretches are passed over a word at a time. */
static void take(void *user, uint64_t time, fstHandle handle, const unsigned char *bytes)
{
  sf_wave *w = user;
  const sf_wave_signal *s = &w->signal[handle];
  const char *value = (const char *)bytes;
  if (time >= w->end || !s->width || !memcmp(w->value + s->first, value, s->width)) return;
  for (size_t at = 0; at < s->width; at += WORD) {
    const size_t n = s->width - at < WORD ? s->width - at : WORD;
    if (memcmp(w->value + s->first + at, value + at, n))
      change_bits(w, s->first + at, s->first + at + n, value + at, time);
  }
  if (w->change) w->change(w->user, time, handle, value);
}

sf_status sf_wave_add(sf_wave *w, const char *path, uint64_t end)
{
  sf_status status;
  void *reader = open_reader(path, &status);
  if (!reader) return status;
  w->end = end;
  fstReaderSetFacProcessMaskAll(reader);
  if (fstReaderGetMaxHandle(reader) != w->signals || !fstReaderIterBlocks(reader, take, w, NULL))
    status = sf_fail(SF_E_FORMAT, "%s: the waveform is not that of the first piece", path);
  fstReaderClose(reader);
  for (size_t i = 0; i < w->bits; i++) {
    sf_wave_bit *bit = &w->bit[i];
    bit->time[state(w->value[i])] += end - bit->since;
    bit->since = end;
  }
  return status;
}

void sf_wave_free(sf_wave *w)
{
  for (int i = 0; i < w->instances; i++) free(w->instance[i].name);
  for (int i = 0; i < w->nets; i++) free(w->net[i].name);
  free(w->instance), free(w->net), free(w->signal), free(w->bit), free(w->value);
  memset(w, 0, sizeof *w);
}

/* ---- nets ---- */

const sf_wave_bit *sf_wave_net_bit(const sf_wave *w, const sf_wave_net *net, uint32_t at)
{
  return &w->bit[w->signal[net->signal].first + at];
}

int sf_wave_net_index(const sf_wave_net *net, uint32_t at)
{
  return net->msb >= net->lsb ? net->msb - (int)at : net->msb + (int)at;
}
