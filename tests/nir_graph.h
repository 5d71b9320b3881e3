/* For the tests of NIR: a reader of such files, which shares nothing with the writer, and their simulation as nodes,
 * edges and metadata say. */
#ifndef SF_TESTS_NIR_GRAPH_H
#define SF_TESTS_NIR_GRAPH_H
#include "ck_run.h"
#include <hdf5.h>
#include <math.h>

enum { NODES = 16, EDGES = 16, TEXT = 128 };

typedef struct node {
  char name[32], type[32];
  int rows, columns, done; /* done: steps evaluated */
  float *weight;
  double bias[SF_LANES], current_bits;
  double tau, r, theta, reset, v_leak, k, lsb, bits, input_step;
  bool first_is_input, soft, has_k;
  double v[SF_LANES], before[SF_LANES], out[SF_DIR_MAX]; /* before: reset */
} node;

typedef struct graph {
  node node[NODES];
  int from[EDGES], to[EDGES];
  int nodes, edges;
  double steps;
} graph;

static inline void read_text(hid_t group, const char *name, char text[TEXT])
{
  const hid_t set = H5Dopen2(group, name, H5P_DEFAULT), type = H5Dget_type(set);
  char *value;
  ck_assert_int_eq(H5Tget_class(type), H5T_STRING);
  ck_assert(H5Tis_variable_str(type) > 0);
  ck_assert_int_ge(H5Dread(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, &value), 0);
  snprintf(text, TEXT, "%s", value);
  H5free_memory(value);
  H5Tclose(type);
  H5Dclose(set);
}

static inline bool has(hid_t group, const char *name)
{
  return H5Lexists(group, name, H5P_DEFAULT) > 0;
}

/* The value that all elements have; their number in *count. */
static inline double read_number(hid_t group, const char *name, int *count)
{
  const hid_t set = H5Dopen2(group, name, H5P_DEFAULT), space = H5Dget_space(set);
  double value[256];
  const int n = (int)H5Sget_simple_extent_npoints(space);
  ck_assert_int_le(n, 256);
  ck_assert_int_ge(H5Dread(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, value), 0);
  for (int i = 1; i < n; i++) ck_assert(value[i] == value[0]);
  if (count) *count = n;
  H5Sclose(space);
  H5Dclose(set);
  return value[0];
}

static inline void read_weight(hid_t group, node *n)
{
  hsize_t size[2];
  const hid_t set = H5Dopen2(group, "weight", H5P_DEFAULT), space = H5Dget_space(set);
  ck_assert_int_eq(H5Sget_simple_extent_ndims(space), 2);
  H5Sget_simple_extent_dims(space, size, NULL);
  n->rows = (int)size[0], n->columns = (int)size[1];
  n->weight = malloc(size[0] * size[1] * sizeof *n->weight);
  ck_assert_int_ge(H5Dread(set, H5T_NATIVE_FLOAT, H5S_ALL, H5S_ALL, H5P_DEFAULT, n->weight), 0);
  H5Sclose(space);
  H5Dclose(set);
}

static inline void read_bias(hid_t group, node *n)
{
  const hid_t set = H5Dopen2(group, "bias", H5P_DEFAULT), space = H5Dget_space(set);
  ck_assert_int_eq(H5Sget_simple_extent_npoints(space), n->rows);
  ck_assert_int_ge(H5Dread(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, n->bias), 0);
  H5Sclose(space);
  H5Dclose(set);
}

static inline void read_neurons(hid_t group, node *n)
{
  const bool leaky = !strcmp(n->type, "LIF");
  n->theta = read_number(group, "v_threshold", &n->rows);
  n->r = read_number(group, "r", NULL);
  n->tau = leaky ? read_number(group, "tau", NULL) : INFINITY;
  n->v_leak = leaky ? read_number(group, "v_leak", NULL) : 0;
  n->reset = read_number(group, "v_reset", NULL);
  ck_assert(n->v_leak == 0 && n->reset == 0);
}

static inline void read_notes(hid_t group, node *n)
{
  char text[TEXT];
  if (!has(group, "metadata")) return;
  const hid_t notes = H5Gopen2(group, "metadata", H5P_DEFAULT);
  if (has(notes, "k")) n->has_k = true, n->k = read_number(notes, "k", NULL);
  if (has(notes, "membrane_lsb")) n->lsb = read_number(notes, "membrane_lsb", NULL);
  if (has(notes, "membrane_bits")) n->bits = read_number(notes, "membrane_bits", NULL);
  if (has(notes, "current_bits")) n->current_bits = read_number(notes, "current_bits", NULL);
  if (has(notes, "input_step")) n->input_step = read_number(notes, "input_step", NULL);
  if (has(notes, "first_step")) {
    read_text(notes, "first_step", text);
    ck_assert_str_eq(text, "v = I");
    n->first_is_input = true;
  }
  if (has(notes, "reset")) {
    read_text(notes, "reset", text);
    ck_assert_str_eq(text, "v -= v_threshold");
    n->soft = true;
  }
  H5Gclose(notes);
}

static inline herr_t read_node(hid_t nodes, const char *name, const H5L_info_t *info, void *user)
{
  graph *g = user;
  node *n = &g->node[g->nodes++];
  (void)info;
  ck_assert_int_le(g->nodes, NODES);
  const hid_t group = H5Gopen2(nodes, name, H5P_DEFAULT);
  char type[TEXT];
  snprintf(n->name, sizeof n->name, "%s", name);
  read_text(group, "type", type);
  snprintf(n->type, sizeof n->type, "%.30s", type);
  if (!strcmp(type, "Linear") || !strcmp(type, "Affine"))
    read_weight(group, n);
  else if (!strcmp(type, "LIF") || !strcmp(type, "IF"))
    read_neurons(group, n);
  else
    n->rows = (int)read_number(group, "shape", NULL);
  ck_assert(has(group, "bias") == !strcmp(type, "Affine"));
  if (has(group, "bias")) read_bias(group, n);
  read_notes(group, n);
  H5Gclose(group);
  return 0;
}

static inline int find(const graph *g, const char *name)
{
  for (int i = 0; i < g->nodes; i++)
    if (!strcmp(g->node[i].name, name)) return i;
  return -1;
}

static inline void read_edges(hid_t group, graph *g)
{
  const hid_t set = H5Dopen2(group, "edges", H5P_DEFAULT), type = H5Dget_type(set), space = H5Dget_space(set);
  hsize_t size[2];
  char *name[EDGES][2];
  H5Sget_simple_extent_dims(space, size, NULL);
  ck_assert(size[0] <= EDGES && size[1] == 2);
  g->edges = (int)size[0];
  ck_assert_int_ge(H5Dread(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, name), 0);
  for (int e = 0; e < g->edges; e++) {
    g->from[e] = find(g, name[e][0]), g->to[e] = find(g, name[e][1]);
    ck_assert(g->from[e] >= 0 && g->to[e] >= 0);
  }
  H5Dvlen_reclaim(type, space, H5P_DEFAULT, name);
  H5Tclose(type);
  H5Sclose(space);
  H5Dclose(set);
}

static inline void read_graph(graph *g, const char *path)
{
  char text[TEXT];
  memset(g, 0, sizeof *g);
  const hid_t file = H5Fopen(path, H5F_ACC_RDONLY, H5P_DEFAULT);
  ck_assert_int_ge(file, 0);
  read_text(file, "version", text);
  ck_assert_str_eq(text, "1.0.8");
  const hid_t top = H5Gopen2(file, "node", H5P_DEFAULT), nodes = H5Gopen2(top, "nodes", H5P_DEFAULT);
  read_text(top, "type", text);
  ck_assert_str_eq(text, "NIRGraph");
  H5Literate(nodes, H5_INDEX_NAME, H5_ITER_INC, NULL, read_node, g);
  read_edges(top, g);
  const hid_t notes = H5Gopen2(top, "metadata", H5P_DEFAULT);
  g->steps = read_number(notes, "steps", NULL);
  H5Gclose(notes);
  H5Gclose(nodes);
  H5Gclose(top);
  H5Fclose(file);
}

static inline void free_graph(graph *g)
{
  for (int i = 0; i < g->nodes; i++) free(g->node[i].weight);
}

/* ---- simulation ---- */

static inline void linear(node *n, double *in)
{
  for (int i = 0; i < n->columns && n->input_step > 0; i++)
    in[i] = n->input_step * floor(in[i] / n->input_step + 1.0 / 16);
  for (int o = 0; o < n->rows; o++) {
    double sum = n->bias[o];
    for (int i = 0; i < n->columns; i++) sum += (double)n->weight[o * n->columns + i] * in[i];
    n->out[o] = sum;
  }
}

/* One Euler step of tau dv/dt = -v + r I with dt = 1; with a membrane LSB, what leaks is rounded to it. */
static inline double charge(const node *n, double v, double in, int t)
{
  if (t == 0 && n->first_is_input) return in;
  if (n->lsb == 0) return v + (n->r * in - v) / n->tau;
  if (n->r == 1 && !strcmp(n->type, "LIF")) return v + n->lsb * floor((in - v) / n->lsb * n->k + 0.5);
  const double u = (v + in) / n->lsb - floor(v / n->lsb * n->k + 0.5), most = ldexp(1, (int)n->bits - 1);
  return n->lsb * fmax(-most, fmin(most - 1, u));
}

static inline double clamped(double x, double bits)
{
  const double most = ldexp(1, (int)bits - 1);
  return bits > 0 ? fmax(-most, fmin(most - 1, x)) : x;
}

static inline void neurons(node *n, const double *in, int t)
{
  for (int o = 0; o < n->rows; o++) {
    const double v = charge(n, t ? n->v[o] : 0, clamped(in[o], n->current_bits), t);
    n->before[o] = v;
    n->out[o] = v >= n->theta;
    n->v[o] = n->out[o] == 0 ? v : n->soft ? v - n->theta : n->reset;
  }
}

static inline bool ready(const graph *g, int i, int t)
{
  for (int e = 0; e < g->edges; e++)
    if (g->to[e] == i && g->node[g->from[e]].done <= t) return false;
  return g->node[i].done <= t;
}

static inline void evaluate(graph *g, int i, int t)
{
  node *n = &g->node[i];
  double in[SF_DIR_MAX] = {0};
  n->done = t + 1;
  if (!strcmp(n->type, "Input")) return;
  for (int e = 0; e < g->edges; e++)
    for (int a = 0; a < SF_DIR_MAX && g->to[e] == i; a++) in[a] += g->node[g->from[e]].out[a];
  if (n->weight)
    linear(n, in);
  else if (!strcmp(n->type, "Output"))
    memcpy(n->out, in, sizeof n->out);
  else
    neurons(n, in, t);
}

static inline void step(graph *g, int t)
{
  for (int count = 0; count < g->nodes;) {
    const int before = count;
    for (int i = 0; i < g->nodes; i++)
      if (ready(g, i, t)) evaluate(g, i, t), count++;
    ck_assert_int_gt(count, before);
  }
}

static inline void begin(graph *g)
{
  for (int i = 0; i < g->nodes; i++) g->node[i].done = 0;
}

static inline node *need(graph *g, const char *name)
{
  const int i = find(g, name);
  ck_assert_msg(i >= 0, "no node %s", name);
  return &g->node[i];
}

#endif
