/* What the accelerator pays for: samples in and behind surfaces (--opaque), and once t_r is settled, reads of weights
 * (--charge; docs/model.md). A row is read once for a neuron that fires at any step of a sample, 8 bytes at a time. */
#include "field/field.h"
#include "train/internal.h"
#include <math.h>

enum { READ_BYTES = 8 };
/* Share of the averages that an iteration renews. */
static const double renewed = 0.02;

static double reads_of(double weights)
{
  return weights / READ_BYTES;
}

/* Reads for one neuron of D1, C1, C2 that fires: its row of D2, C2, C3. */
static void row(const sf_trainer *t, double reads[3])
{
  const double hidden = t->model.config.hidden;
  reads[0] = sf_model_decodes(&t->model) ? 0 : reads_of(SF_DENSITY_OUT);
  reads[1] = reads_of(hidden);
  reads[2] = 1; /* three weights */
}

/* Of rows that every sample reads: those of the inputs that are not spikes. */
static double constant(const sf_trainer *t)
{
  const sf_config *c = &t->model.config;
  const double geometry = sf_model_decodes(&t->model) ? 0 : SF_GEO_FEATURES;
  return (sf_field_of(c)->inputs(c) + geometry) * reads_of(c->hidden);
}

void sf_charge_measured(sf_trainer *t, const double any[3])
{
  double reads[3];
  row(t, reads);
  t->row_reads = constant(t);
  for (int l = 0; l < 3; l++) t->row_reads += any[l] * t->model.config.hidden * reads[l];
}

void sf_charge_begin(sf_trainer *t, const sf_loss_plan *p)
{
  const sf_charge *c = &t->charge;
  double reads[3];
  row(t, reads);
  const bool measured = p->charge > 0 && c->reads > 0 && t->batch.samples > 0;
  const double price = measured ? p->charge * c->error / (c->reads * t->batch.samples) : 0;
  for (int l = 0; l < 3; l++) t->net->view.charge[l] = (float)(price * reads[l]);
}

void sf_charge_update(sf_trainer *t, double error)
{
  sf_charge *c = &t->charge;
  const double share = c->reads > 0 ? renewed : 1;
  c->error += share * (error - c->error);
  c->reads += share * (t->row_reads - c->reads);
}

/* Share of the run from which on rays learn to end soon: earlier there is fog, which would become solid where it is. */
static const double tail_from = 0.25;

/* --opaque: C M ln N has the slope C M / N by N, the samples of a ray. L_opaque charges that for those of the tail. C
 * grows evenly from nothing to the option at the end of the run. */
float sf_tail_price(const sf_trainer *t)
{
  const double grown = fmax(t->progress - tail_from, 0) / (1 - tail_from);
  return t->tail.samples > 0 ? (float)(t->options.opaque * grown * t->tail.error / t->tail.samples) : 0;
}

void sf_tail_update(sf_trainer *t, double error)
{
  sf_tail *a = &t->tail;
  const double share = a->samples > 0 ? renewed : 1, samples = (double)t->batch.samples / t->batch.rays;
  a->error += share * (error - a->error);
  a->samples += share * (samples - a->samples);
}
