#include "exchange/nir.h"
#include "snn/plif.h"
#include "energy/energy.h"
#include "exchange/exchange.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char *const mode_name[] = {"hybrid", "decay", "no-decay"};

/* What model and scene have in common. */
typedef struct nets {
  int n_in[SF_LAYERS], n_out[SF_LAYERS]; /* C1: direction alone */
  int n_h, mode, steps, current_bits;    /* current_bits: at which C1's saturates; 0: it cannot */
  double k[SF_LAYERS], theta[SF_LAYERS];
  double membrane_lsb[SF_LAYERS];         /* 0: not rounded */
  double input_step;                      /* h is rounded down to multiples of it; 0: not rounded */
  double sigma_argument, colour_argument; /* value of one unit of the outputs */
  const double *feature_lsb;
  int levels;
  double direction_lsb;
  /* weight of layer `l` from input i to output o; C1: i < n_in the constant inputs, then h. bias may be NULL */
  float (*weight)(const void *from, int l, int i, int o);
  bool has_bias[SF_LAYERS];
  double (*bias)(const void *from, int l, int o);
  const void *from;
} nets;

/* ---- notes ---- */

static void note_text(sf_nir_notes *n, const char *key, const char *text)
{
  n->note[n->count++] = (sf_nir_note){.key = key, .text = text};
}

static void note_number(sf_nir_notes *n, const char *key, double number)
{
  n->note[n->count++] = (sf_nir_note){.key = key, .number = number};
}

static void note_values(sf_nir_notes *n, const char *key, const double *values, int count)
{
  n->note[n->count++] = (sf_nir_note){.key = key, .values = values, .count = count};
}

/* ---- nodes ---- */

static sf_nir_node *add_node(sf_nir_graph *g, const char *name, sf_nir_type type, int rows)
{
  sf_nir_node *n = &g->node[g->nodes++];
  *n = (sf_nir_node){.name = name, .type = type, .rows = rows};
  return n;
}

static void add_edge(sf_nir_graph *g, const char *from, const char *to)
{
  g->edge[g->edges][0] = from;
  g->edge[g->edges++][1] = to;
}

/* Columns first..first + columns - 1 of the node are the layer's inputs from `input` on; columns before are 0. */
static sf_nir_node *add_linear(sf_nir_graph *g, const nets *nets, const char *name, int l, int input, int count,
                               int first)
{
  sf_nir_node *n = add_node(g, name, SF_NIR_LINEAR, nets->n_out[l]);
  n->columns = first + count;
  n->weight = calloc((size_t)n->rows * (size_t)n->columns, sizeof *n->weight);
  for (int o = 0; o < n->rows && n->weight; o++)
    for (int i = 0; i < count; i++) n->weight[o * n->columns + first + i] = nets->weight(nets->from, l, input + i, o);
  return n;
}

static void add_bias(sf_nir_node *n, const nets *nets, int l)
{
  if (!nets->has_bias[l]) return;
  n->bias = calloc((size_t)n->rows, sizeof *n->bias);
  for (int o = 0; o < n->rows && n->bias; o++) n->bias[o] = nets->bias(nets->from, l, o);
  if (!n->bias) free(n->weight), n->weight = NULL;
}

/* NIR: tau dv/dt = (v_leak - v) + r I. In steps of 1, v += ((v_leak - v) + r I) / tau. */
static void add_neurons(sf_nir_graph *g, const nets *nets, int l)
{
  const double k = nets->k[l];
  const bool no_decay = nets->mode == FX_NODECAY, lossless = no_decay && k == 0;
  sf_nir_node *n = add_node(g, fx_layer_name(l), lossless ? SF_NIR_IF : SF_NIR_LIF, nets->n_out[l]);
  n->tau = 1 / k;
  n->r = no_decay && !lossless ? n->tau : 1;
  n->v_threshold = nets->theta[l];
  note_number(&n->notes, "k", k);
  note_text(&n->notes, "fires", "v >= v_threshold");
  note_text(&n->notes, "reset", "v -= v_threshold");
  if (nets->mode == FX_HYBRID) note_text(&n->notes, "first_step", "v = I");
  if (l == FX_C1 && nets->current_bits) note_number(&n->notes, "current_bits", nets->current_bits);
  if (nets->membrane_lsb[l] == 0) return;
  note_number(&n->notes, "membrane_lsb", nets->membrane_lsb[l]);
  note_number(&n->notes, "membrane_bits", SF_MEMBRANE_BITS);
  note_text(&n->notes, "rounding",
            no_decay ? "v += I - membrane_lsb * floor(v / membrane_lsb * k + 1/2), saturating at membrane_bits"
                     : "v += membrane_lsb * floor((I - v) / membrane_lsb * k + 1/2)");
}

/* ---- graph ---- */

static void density_part(sf_nir_graph *g, const nets *nets)
{
  sf_nir_node *features = add_node(g, "features", SF_NIR_INPUT, nets->n_in[FX_D1]);
  if (nets->feature_lsb) note_values(&features->notes, "level_lsb", nets->feature_lsb, nets->levels);
  add_linear(g, nets, "D1_weight", FX_D1, 0, nets->n_in[FX_D1], 0);
  add_neurons(g, nets, FX_D1);
  add_linear(g, nets, "D2_weight", FX_D2, 0, nets->n_in[FX_D2], 0);
  sf_nir_node *density = add_node(g, "density", SF_NIR_OUTPUT, nets->n_out[FX_D2]);
  note_text(&density->notes, "means", "element 0: exponent of the density; the others: h, inputs of C1");
  note_number(&density->notes, "lsb", nets->sigma_argument);
  note_number(&density->notes, "integrator_k", nets->k[FX_D2]);
  add_edge(g, "features", "D1_weight");
  add_edge(g, "D1_weight", "D1");
  add_edge(g, "D1", "D2_weight");
  add_edge(g, "D2_weight", "density");
}

/* Inputs that stay the same through the steps: the direction, or all that a decoder has. */
static void constant_inputs(sf_nir_graph *g, const nets *nets)
{
  const bool decodes = nets->n_in[FX_D1] == 0;
  const char *name = decodes ? "inputs" : "direction";
  sf_nir_node *inputs = add_node(g, name, SF_NIR_INPUT, nets->n_in[FX_C1]);
  if (!decodes) note_number(&inputs->notes, "lsb", nets->direction_lsb);
  add_bias(add_linear(g, nets, "C1_direction", FX_C1, 0, nets->n_in[FX_C1], 0), nets, FX_C1);
  add_edge(g, name, "C1_direction");
  add_edge(g, "C1_direction", "C1");
}

static void hidden_inputs(sf_nir_graph *g, const nets *nets)
{
  sf_nir_node *h = add_linear(g, nets, "C1_h", FX_C1, nets->n_in[FX_C1], nets->n_h, 1);
  if (!nets->n_in[FX_C1]) add_bias(h, nets, FX_C1);
  if (nets->input_step > 0) {
    note_number(&h->notes, "input_step", nets->input_step);
    note_text(&h->notes, "rounding", "x = input_step * floor(x / input_step + 1/16)");
  }
  add_edge(g, "D2_weight", "C1_h");
  add_edge(g, "C1_h", "C1");
}

static void colour_part(sf_nir_graph *g, const nets *nets)
{
  add_neurons(g, nets, FX_C1);
  add_bias(add_linear(g, nets, "C2_weight", FX_C2, 0, nets->n_in[FX_C2], 0), nets, FX_C2);
  add_neurons(g, nets, FX_C2);
  add_bias(add_linear(g, nets, "C3_weight", FX_C3, 0, nets->n_in[FX_C3], 0), nets, FX_C3);
  sf_nir_node *colour = add_node(g, "colour", SF_NIR_OUTPUT, nets->n_out[FX_C3]);
  note_text(&colour->notes, "means", "arguments of the sigmoid of red, green, blue");
  note_number(&colour->notes, "lsb", nets->colour_argument);
  note_number(&colour->notes, "integrator_k", nets->k[FX_C3]);
  add_edge(g, "C1", "C2_weight");
  add_edge(g, "C2_weight", "C2");
  add_edge(g, "C2", "C3_weight");
  add_edge(g, "C3_weight", "colour");
}

static sf_status write_nets(const char *path, const nets *nets)
{
  if (nets->mode == FX_RADIX)
    return sf_fail(SF_E_UNSUPPORTED,
                   "%s: in mode radix a layer waits for all spikes of the one before; a NIR graph has no such neuron "
                   "(see sf_train --input-mode hybrid)",
                   path);
  sf_nir_graph *g = calloc(1, sizeof *g);
  if (!g) return sf_fail(SF_E_MEMORY, "%s: out of memory", path);
  sf_status status = sf_ok();
  if (nets->n_in[FX_D1]) density_part(g, nets);
  if (nets->n_in[FX_C1]) constant_inputs(g, nets);
  if (nets->n_h) hidden_inputs(g, nets);
  colour_part(g, nets);
  note_text(&g->notes, "program", "spikefield");
  note_number(&g->notes, "steps", nets->steps);
  note_number(&g->notes, "dt", 1);
  note_text(&g->notes, "input_mode", mode_name[nets->mode]);
  note_text(&g->notes, "inputs", "constant over the steps");
  for (int n = 0; n < g->nodes; n++)
    if (g->node[n].type == SF_NIR_LINEAR && !g->node[n].weight)
      status = sf_fail(SF_E_MEMORY, "%s: no memory for the weights", path);
  if (status.code == SF_OK) status = sf_nir_save(g, path);
  for (int n = 0; n < g->nodes; n++) free(g->node[n].weight), free(g->node[n].bias);
  free(g);
  return status;
}

/* ---- a scene: its integers ---- */

static float scene_weight(const void *from, int l, int i, int o)
{
  const fx_net *net = from;
  const fx_layer *layer = &net->layer[l];
  const float w = layer->w[(size_t)i * SF_LANES + (size_t)o];
  return l == FX_C1 && i >= fx_net_constants(net) ? w / (1 << SF_H_SHIFT) : w; /* a power of two: exact */
}

/* A row of weights whose input is always active. */
static double scene_bias(const void *from, int l, int o)
{
  const fx_layer *layer = &((const fx_net *)from)->layer[l];
  return (double)layer->bias * layer->w[(size_t)layer->n_in * SF_LANES + (size_t)o];
}

sf_status sf_nir_write_scene(const char *path, const fx_scene *scene)
{
  const fx_net *net = &scene->net;
  nets n = {.n_h = fx_net_h(net),
            .mode = net->mode,
            .steps = net->steps,
            .input_step = 1 << SF_H_SHIFT,
            .sigma_argument = scene->units.current_scale[FX_D2],
            .colour_argument = scene->units.current_scale[FX_C3],
            .feature_lsb = scene->units.feature_scale,
            .levels = scene->grid.levels,
            .direction_lsb = scene->units.dir_scale,
            .current_bits = fx_net_constants_per_sample(net) ? SF_MEMBRANE_BITS : 0,
            .weight = scene_weight,
            .bias = scene_bias,
            .from = net};
  for (int l = 0; l < SF_LAYERS; l++) {
    n.n_in[l] = net->layer[l].n_in;
    n.n_out[l] = net->layer[l].n_out;
    n.has_bias[l] = net->layer[l].bias != 0;
    n.k[l] = ldexp(net->layer[l].k, -SF_LEAK_FRAC);
  }
  n.n_in[FX_C1] -= n.n_h;
  for (int s = 0; s < FX_SPIKING; s++) {
    const int l = fx_spiking_layers[s];
    n.membrane_lsb[l] = l == FX_C2 ? ldexp(1, -SF_AC_FRAC) : 1;
    n.theta[l] = net->layer[l].theta * n.membrane_lsb[l];
  }
  return write_nets(path, &n);
}

/* ---- a model: real numbers ---- */

static float model_weight(const void *from, int l, int i, int o)
{
  const sf_model *m = from;
  const int id = sf_layer_weights[l];
  return sf_model_param(m, id)[(int64_t)o * m->param[id].shape[1] + i];
}

static double model_bias(const void *from, int l, int o)
{
  return (double)sf_model_param(from, sf_layer_bias[l])[o];
}

static void model_sizes(nets *n, const sf_model *m)
{
  for (int l = 0; l < SF_LAYERS; l++) {
    const int id = sf_layer_weights[l];
    if (!sf_model_has(m, id)) continue;
    n->n_out[l] = (int)m->param[id].shape[0];
    n->n_in[l] = (int)m->param[id].shape[1];
    n->has_bias[l] = sf_layer_bias[l] >= 0 && sf_model_has(m, sf_layer_bias[l]);
  }
  n->n_h = sf_model_decodes(m) ? 0 : SF_GEO_FEATURES;
  n->n_in[FX_C1] -= n->n_h;
}

sf_status sf_nir_write_model(const char *path, const sf_model *m)
{
  const sf_config *c = &m->config;
  if (c->net != SF_NET_SNN)
    return sf_fail(SF_E_UNSUPPORTED, "%s: the model is the ReLU twin; a NIR graph is of spiking nets", path);
  if (c->along)
    return sf_fail(SF_E_UNSUPPORTED, "%s: the model's steps are the samples of a ray; a NIR graph is of one sample",
                   path);
  const float *leak = sf_model_param(m, SF_P_LEAK);
  nets n = {.mode = c->mode,
            .steps = m->t_r,
            .input_step = (double)sf_scales_h_step(&m->scales),
            .sigma_argument = 1,
            .colour_argument = 1,
            .direction_lsb = 1,
            .weight = model_weight,
            .bias = model_bias,
            .from = m};
  model_sizes(&n, m);
  for (int l = 0; l < SF_LAYERS; l++) n.k[l] = (double)sf_sigmoid(leak[l]);
  for (int s = 0; s < FX_SPIKING; s++) n.theta[fx_spiking_layers[s]] = (double)c->theta[s];
  return write_nets(path, &n);
}
