/* NIR's file as its own library writes it (https://github.com/neuromorphs/NIR, nir/serialization.py, release 1.0.8):
 * groups for graph, nodes and metadata, a dataset per parameter, strings of variable length in UTF-8. */
#include "base/io.h"
#include "exchange/nir.h"
#include <stdbool.h>
#include <stdlib.h>
#ifdef SF_HDF5
#include <hdf5.h>

enum { IMAGE_STEP = 1 << 20 };

/* What the functions below share; `fine` turns false at the first refusal of the library. */
typedef struct file {
  hid_t text, untimed;
  bool fine;
} file;

static void note(file *f, bool fine)
{
  f->fine = f->fine && fine;
}

static void put(file *f, hid_t group, const char *name, hid_t type, hid_t memory, hid_t space, const void *data)
{
  const hid_t set = H5Dcreate2(group, name, type, space, H5P_DEFAULT, f->untimed, H5P_DEFAULT);
  note(f, set >= 0 && H5Dwrite(set, memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) >= 0);
  if (set >= 0) H5Dclose(set);
  H5Sclose(space);
}

static void put_text(file *f, hid_t group, const char *name, const char *text)
{
  put(f, group, name, f->text, f->text, H5Screate(H5S_SCALAR), &text);
}

static void put_doubles(file *f, hid_t group, const char *name, const double *values, int count)
{
  const hsize_t size = (hsize_t)count;
  put(f, group, name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE,
      count ? H5Screate_simple(1, &size, NULL) : H5Screate(H5S_SCALAR), values);
}

/* The same value for every neuron. */
static void put_parameter(file *f, hid_t group, const char *name, double value, int count)
{
  double *values = malloc((size_t)count * sizeof *values);
  note(f, values != NULL);
  for (int i = 0; values && i < count; i++) values[i] = value;
  if (values) put_doubles(f, group, name, values, count);
  free(values);
}

static hid_t open_group(file *f, hid_t parent, const char *name)
{
  const hid_t group = H5Gcreate2(parent, name, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  note(f, group >= 0);
  return group;
}

static void put_notes(file *f, hid_t group, const sf_nir_notes *notes)
{
  if (!notes->count) return;
  const hid_t metadata = open_group(f, group, "metadata");
  for (int i = 0; i < notes->count; i++) {
    const sf_nir_note *n = &notes->note[i];
    if (n->text)
      put_text(f, metadata, n->key, n->text);
    else
      put_doubles(f, metadata, n->key, n->count ? n->values : &n->number, n->count);
  }
  H5Gclose(metadata);
}

static void put_neurons(file *f, hid_t group, const sf_nir_node *n)
{
  put_parameter(f, group, "r", n->r, n->rows);
  put_parameter(f, group, "v_threshold", n->v_threshold, n->rows);
  put_parameter(f, group, "v_reset", 0, n->rows);
  if (n->type == SF_NIR_IF) return;
  put_parameter(f, group, "tau", n->tau, n->rows);
  put_parameter(f, group, "v_leak", 0, n->rows);
}

static void put_node(file *f, hid_t nodes, const sf_nir_node *n)
{
  static const char *const type[] = {"Input", "Output", "Linear", "LIF", "IF"};
  const hid_t group = open_group(f, nodes, n->name);
  const hsize_t one = 1, shape[2] = {(hsize_t)n->rows, (hsize_t)n->columns};
  const int64_t size = n->rows;
  put_text(f, group, "type", n->bias ? "Affine" : type[n->type]);
  if (n->type == SF_NIR_LINEAR)
    put(f, group, "weight", H5T_IEEE_F32LE, H5T_NATIVE_FLOAT, H5Screate_simple(2, shape, NULL), n->weight);
  else if (n->type == SF_NIR_LIF || n->type == SF_NIR_IF)
    put_neurons(f, group, n);
  else
    put(f, group, "shape", H5T_STD_I64LE, H5T_NATIVE_INT64, H5Screate_simple(1, &one, NULL), &size);
  if (n->bias) put_doubles(f, group, "bias", n->bias, n->rows);
  put_notes(f, group, &n->notes);
  H5Gclose(group);
}

static void put_graph(file *f, hid_t root, const sf_nir_graph *g)
{
  put_text(f, root, "version", SF_NIR_VERSION);
  const hid_t graph = open_group(f, root, "node"), nodes = open_group(f, graph, "nodes");
  const hsize_t shape[2] = {(hsize_t)g->edges, 2};
  put_text(f, graph, "type", "NIRGraph");
  for (int i = 0; i < g->nodes; i++) put_node(f, nodes, &g->node[i]);
  put(f, graph, "edges", f->text, f->text, H5Screate_simple(2, shape, NULL), g->edge);
  put_notes(f, graph, &g->notes);
  H5Gclose(nodes);
  H5Gclose(graph);
}

/* The file is made in memory, so that it reaches the disk whole or not at all. */
static sf_status save_image(file *f, hid_t root, const char *path)
{
  note(f, H5Fflush(root, H5F_SCOPE_GLOBAL) >= 0);
  const ssize_t size = f->fine ? H5Fget_file_image(root, NULL, 0) : -1;
  void *image = size > 0 ? malloc((size_t)size) : NULL;
  sf_status status = sf_fail(SF_E_IO, "%s: HDF5 could not make the file", path);
  if (image && H5Fget_file_image(root, image, (size_t)size) == size) status = sf_write_file(path, image, (size_t)size);
  free(image);
  return status;
}

sf_status sf_nir_save(const sf_nir_graph *g, const char *path)
{
  H5Eset_auto2(H5E_DEFAULT, NULL, NULL); /* it would print */
  const hid_t in_memory = H5Pcreate(H5P_FILE_ACCESS);
  H5Pset_fapl_core(in_memory, IMAGE_STEP, false);
  const hid_t root = H5Fcreate(path, H5F_ACC_TRUNC, H5P_DEFAULT, in_memory);
  file f = {.text = H5Tcopy(H5T_C_S1), .untimed = H5Pcreate(H5P_DATASET_CREATE), .fine = root >= 0};
  note(&f, H5Tset_size(f.text, H5T_VARIABLE) >= 0 && H5Tset_cset(f.text, H5T_CSET_UTF8) >= 0);
  note(&f, H5Pset_obj_track_times(f.untimed, false) >= 0); /* the same scene, the same bytes */
  if (f.fine) put_graph(&f, root, g);
  const sf_status status = root >= 0 ? save_image(&f, root, path) : sf_fail(SF_E_IO, "%s: HDF5 refused", path);
  H5Pclose(f.untimed);
  H5Tclose(f.text);
  if (root >= 0) H5Fclose(root);
  H5Pclose(in_memory);
  return status;
}
#else
sf_status sf_nir_save(const sf_nir_graph *graph, const char *path)
{
  (void)graph;
  return sf_fail(SF_E_UNSUPPORTED, "%s: this build has no HDF5; install libhdf5-dev (make deps) and build again", path);
}
#endif
