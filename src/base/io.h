/* Checked file access, atomic writes, safetensors. */
#ifndef SF_BASE_IO_H
#define SF_BASE_IO_H
#include "base/json.h"
#include "base/status.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

/* Whole file or pipe; *data is malloc'ed with a NUL behind it. Refuses files over `limit` bytes, pipes also over
 * 256 MiB, and devices. */
sf_status sf_read_file(const char *path, size_t limit, char **data, size_t *size);

/* Write aside, in the same folder, then flush, fsync, check, rename: the target is whole or untouched. The file aside
 * is .NAME.sf-new; while another program writes the same target, it has a name of its own. */
typedef struct sf_writer {
  FILE *file;
  char path[4096], aside[4096 + 32];
  int lock; /* keeps others from the file aside */
} sf_writer;
sf_status sf_writer_open(sf_writer *writer, const char *path);
sf_status sf_writer_commit(sf_writer *writer);
void sf_writer_abort(sf_writer *writer); /* removes the file aside; safe after commit */
/* Whether a file could be read, a writer be opened: before the work, not after it. */
sf_status sf_readable(const char *path);
sf_status sf_writable(const char *path);
sf_status sf_write_file(const char *path, const void *data, size_t size);
sf_status sf_make_dir(const char *path); /* with parents; existing is fine */

/* safetensors (https://github.com/huggingface/safetensors): 8-byte LE header size, JSON header, data. */
typedef enum { SF_F32, SF_I8, SF_U8, SF_I16, SF_I32, SF_I64, SF_U64 } sf_dtype;
size_t sf_dtype_size(sf_dtype type);
const char *sf_dtype_name(sf_dtype type); /* "F32", as in the file */
typedef struct sf_tensor {
  char name[64];
  sf_dtype type;
  int dims;
  int64_t shape[4];
  void *data; /* load: points into the file's buffer, 8-byte aligned when the offset allows; save: the caller's */
} sf_tensor;
typedef struct sf_tensors {
  sf_tensor *tensor;
  int count;
  cJSON *metadata; /* object of strings, may be NULL */
  char *buffer;    /* owned file contents after load */
  char path[4096];
} sf_tensors;
/* Checks header length, types, shapes against offsets, overlap, holes and file length; F32 may hold NaN: see
 * sf_tensor_finite. */
sf_status sf_tensors_load(sf_tensors *set, const char *path);
/* The same of a file's contents; they are copied. `name` stands for the path in messages. */
sf_status sf_tensors_load_memory(sf_tensors *set, const void *data, size_t size, const char *name);
sf_status sf_tensors_save(const sf_tensor *tensor, int count, const cJSON *metadata, const char *path);
void sf_tensors_put_number(cJSON *metadata, const char *key, double value); /* as the text that reads back the same */
void sf_tensors_free(sf_tensors *set);
/* Finds `name` with exactly this type and shape (shape[i] < 0 matches any size); the message names file and tensor. */
sf_status sf_tensors_get(const sf_tensors *set, const char *name, sf_dtype type, int dims, const int64_t *shape,
                         const sf_tensor **tensor);
/* Metadata string; NULL when absent. */
const char *sf_tensors_meta(const sf_tensors *set, const char *key);
/* Fails naming file, tensor and first index of a NaN or Inf. */
sf_status sf_tensor_finite(const char *path, const sf_tensor *tensor);
#endif
