#include "sim/activity/saif.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

enum { IDENTIFIERS = 94, FIRST_IDENTIFIER = '!' };

static bool within(const sf_wave *w, int instance, int depth)
{
  return w->instance[instance].used && (!depth || w->instance[instance].level <= depth);
}

static void indent(FILE *out, int level)
{
  fprintf(out, "%*s", 2 * level, "");
}

/* ---- SAIF ---- */

/* "acc_q\[3\]": brackets are escaped. */
static void put_name(FILE *out, const char *name)
{
  for (; *name; name++) {
    if (*name == '[' || *name == ']') putc('\\', out);
    putc(*name, out);
  }
}

static void put_bit(FILE *out, const sf_wave *w, const sf_wave_net *net, uint32_t at, uint64_t unit)
{
  const sf_wave_bit *b = sf_wave_net_bit(w, net, at);
  indent(out, w->instance[net->instance].level + 1);
  putc('(', out);
  put_name(out, net->name);
  if (net->vector) fprintf(out, "\\[%d\\]", sf_wave_net_index(net, at));
  fprintf(out, " (T0 %" PRIu64 ") (T1 %" PRIu64 ") (TX %" PRIu64 ") (TC %" PRIu64 ") (IG 0))\n", b->time[0] * unit,
          b->time[1] * unit, b->time[2] * unit, b->toggles);
}

static void put_nets(FILE *out, const sf_wave *w, int instance, uint64_t unit)
{
  bool any = false;
  const int level = w->instance[instance].level;
  for (int n = 0; n < w->nets; n++) {
    const sf_wave_net *net = &w->net[n];
    if (net->instance != instance) continue;
    if (!any) indent(out, level), fprintf(out, "(NET\n");
    any = true;
    for (uint32_t at = 0; at < w->signal[net->signal].width; at++) put_bit(out, w, net, at, unit);
  }
  if (any) indent(out, level), fprintf(out, ")\n");
}

static void put_instance(FILE *out, const sf_wave *w, int instance, int depth, uint64_t unit)
{
  const int level = w->instance[instance].level;
  if (!within(w, instance, depth)) return;
  indent(out, level - 1);
  fprintf(out, "(INSTANCE ");
  put_name(out, w->instance[instance].name);
  fprintf(out, "\n");
  put_nets(out, w, instance, unit);
  for (int i = instance + 1; i < w->instances; i++)
    if (w->instance[i].parent == instance) put_instance(out, w, i, depth, unit);
  indent(out, level - 1);
  fprintf(out, ")\n");
}

void sf_saif_write(FILE *out, const sf_wave *w, int depth, uint64_t unit)
{
  fprintf(out, "(SAIFILE\n(SAIFVERSION \"2.0\")\n(DIRECTION \"backward\")\n(DESIGN )\n(PROGRAM_NAME \"sf_cosim\")\n"
               "(DIVIDER / )\n(TIMESCALE 1 ps)\n");
  fprintf(out, "(DURATION %" PRIu64 ")\n", (w->end - w->begin) * unit);
  for (int i = 0; i < w->instances; i++)
    if (w->instance[i].parent < 0) put_instance(out, w, i, depth, unit);
  fprintf(out, ")\n");
}

/* ---- VCD ---- */

static void put_identifier(FILE *out, uint32_t signal)
{
  for (; signal; signal /= IDENTIFIERS) putc(FIRST_IDENTIFIER + (int)(signal % IDENTIFIERS), out);
}

static void put_scope(sf_vcd *v, int instance, int depth)
{
  const sf_wave *w = v->wave;
  if (!within(w, instance, depth)) return;
  fprintf(v->out, "$scope module %s $end\n", w->instance[instance].name);
  for (int n = 0; n < w->nets; n++) {
    const sf_wave_net *net = &w->net[n];
    if (net->instance != instance) continue;
    v->shown[net->signal] = true;
    fprintf(v->out, "$var wire %" PRIu32 " ", w->signal[net->signal].width);
    put_identifier(v->out, net->signal);
    fprintf(v->out, " %s", net->name);
    if (net->vector) fprintf(v->out, " [%d:%d]", net->msb, net->lsb);
    fprintf(v->out, " $end\n");
  }
  for (int i = instance + 1; i < w->instances; i++)
    if (w->instance[i].parent == instance) put_scope(v, i, depth);
  fprintf(v->out, "$upscope $end\n");
}

static void put_change(void *user, uint64_t time, uint32_t signal, const char *value)
{
  sf_vcd *v = user;
  const uint32_t width = v->wave->signal[signal].width;
  if (!v->shown[signal]) return;
  if (time != v->time) fprintf(v->out, "#%" PRIu64 "\n", (time - v->wave->begin) * v->unit_ps);
  v->time = time;
  if (width > 1)
    fprintf(v->out, "b%.*s ", (int)width, value);
  else
    putc(value[0], v->out);
  put_identifier(v->out, signal);
  putc('\n', v->out);
}

sf_status sf_vcd_open(sf_vcd *v, FILE *out, sf_wave *w, int depth, uint64_t unit)
{
  *v = (sf_vcd){.out = out, .wave = w, .unit_ps = unit, .time = UINT64_MAX};
  v->shown = calloc((size_t)w->signals + 1, sizeof *v->shown);
  if (!v->shown) return sf_fail(SF_E_MEMORY, "VCD: out of memory");
  fprintf(out, "$version sf_cosim $end\n$timescale 1ps $end\n");
  for (int i = 0; i < w->instances; i++)
    if (w->instance[i].parent < 0) put_scope(v, i, depth);
  fprintf(out, "$enddefinitions $end\n");
  w->change = put_change;
  w->user = v;
  return sf_ok();
}

void sf_vcd_close(sf_vcd *v)
{
  if (v->out) fprintf(v->out, "#%" PRIu64 "\n", (v->wave->end - v->wave->begin) * v->unit_ps);
  free(v->shown);
  v->shown = NULL;
}
