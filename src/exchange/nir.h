/* A graph of NIR before it is a file. */
#ifndef SF_EXCHANGE_NIR_H
#define SF_EXCHANGE_NIR_H
#include "base/status.h"

enum { SF_NIR_NODES = 16, SF_NIR_EDGES = 16, SF_NIR_NOTES = 10 };
#define SF_NIR_VERSION "1.0.8"

/* One entry of "metadata": a text, or numbers (count 0: a single one). */
typedef struct sf_nir_note {
  const char *key, *text;
  double number;
  const double *values;
  int count;
} sf_nir_note;

typedef struct sf_nir_notes {
  sf_nir_note note[SF_NIR_NOTES];
  int count;
} sf_nir_notes;

typedef enum { SF_NIR_INPUT, SF_NIR_OUTPUT, SF_NIR_LINEAR, SF_NIR_LIF, SF_NIR_IF } sf_nir_type;
typedef struct sf_nir_node {
  const char *name;
  sf_nir_type type;
  int rows, columns; /* of `weight`; the others have `rows` values or neurons */
  float *weight;     /* [rows][columns], owned */
  double *bias;      /* [rows], owned; NULL: none. A linear node with a bias is NIR's Affine */
  double tau, r, v_threshold;
  sf_nir_notes notes;
} sf_nir_node;

/* A net as NIR writes it: an edge is the names of the nodes that it joins. */
typedef struct sf_nir_graph {
  sf_nir_node node[SF_NIR_NODES];
  const char *edge[SF_NIR_EDGES][2];
  sf_nir_notes notes;
  int nodes, edges;
} sf_nir_graph;

/* The whole file or none of it. */
sf_status sf_nir_save(const sf_nir_graph *graph, const char *path);
#endif
