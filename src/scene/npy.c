#include "src/scene/npy.h"
#include "base/io.h"
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#define FILE_LIMIT ((size_t)1 << 30)

typedef struct npy {
  const char *path;
  const char *bytes;
  size_t size, data; /* data: offset of the numbers */
  char header[1024];
  size_t width; /* of a number, bytes */
} npy;

static sf_status read_header(npy *f)
{
  const unsigned char *b = (const unsigned char *)f->bytes;
  if (f->size < 12 || memcmp(b, "\x93NUMPY", 6) != 0)
    return sf_fail(SF_E_FORMAT, "%s: not a .npy file: it does not start with \\x93NUMPY", f->path);
  if (b[6] < 1 || b[6] > 3) return sf_fail(SF_E_UNSUPPORTED, "%s: .npy version %d: expected 1 to 3", f->path, b[6]);
  const size_t start = b[6] == 1 ? 10 : 12;
  size_t length = b[8] | (size_t)b[9] << 8;
  if (b[6] > 1) length |= (size_t)b[10] << 16 | (size_t)b[11] << 24;
  if (length >= sizeof f->header || length > f->size - start)
    return sf_fail(SF_E_FORMAT, "%s: cut short: a header of %zu bytes from byte %zu on, the file has %zu", f->path,
                   length, start, f->size);
  memcpy(f->header, f->bytes + start, length);
  f->header[length] = 0, f->data = start + length;
  return sf_ok();
}

/* What stands behind 'key': in the header's Python dictionary. */
static const char *entry(const npy *f, const char *key)
{
  const char *at = strstr(f->header, key);
  if (!at) return "";
  at += strlen(key);
  return at + strspn(at, "'\": ");
}

static sf_status check_type(npy *f)
{
  const char *type = entry(f, "descr"), *order = entry(f, "fortran_order");
  const int length = (int)strcspn(type, "'\",}");
  if (length == 3 && !strncmp(type, "<f8", 3)) f->width = 8;
  if (length == 3 && !strncmp(type, "<f4", 3)) f->width = 4;
  if (!f->width)
    return sf_fail(SF_E_UNSUPPORTED, "%s: dtype %.*s%s: expected <f8 or <f4", f->path, length > 20 ? 20 : length, type,
                   *type == '>' ? " (most significant byte first)" : "");
  if (strncmp(order, "False", 5) != 0)
    return sf_fail(SF_E_UNSUPPORTED, "%s: fortran_order is not False: expected an array in C order", f->path);
  return sf_ok();
}

static sf_status check_shape(const npy *f, int columns, int *rows)
{
  const char *shape = entry(f, "shape");
  char *end;
  const bool opened = *shape == '(';
  const long n = opened ? strtol(shape + 1, &end, 10) : 0;
  if (!opened || *end != ',' || strtol(end + 1, &end, 10) != columns || *(end + strspn(end, ", ")) != ')')
    return sf_fail(SF_E_FORMAT, "%s: shape %.*s: expected (number of views, %d)", f->path,
                   (int)strcspn(shape, ")}") + 1, shape, columns);
  if (n < 1 || n > 1000000) return sf_fail(SF_E_RANGE, "%s: %ld rows: expected 1 to 1000000", f->path, n);
  const size_t wanted = (size_t)n * (size_t)columns * f->width, there = f->size - f->data;
  if (wanted != there)
    return sf_fail(SF_E_FORMAT, "%s: %s: %zu bytes behind the header, %ld x %d numbers need %zu", f->path,
                   there < wanted ? "cut short" : "too long", there, n, columns, wanted);
  *rows = (int)n;
  return sf_ok();
}

/* Least significant byte first, whatever the machine. */
static double number(const npy *f, size_t i)
{
  const unsigned char *b = (const unsigned char *)f->bytes + f->data + i * f->width;
  uint64_t bits = 0;
  for (size_t k = 0; k < f->width; k++) bits |= (uint64_t)b[k] << (8 * k);
  double wide;
  float narrow;
  const uint32_t low = (uint32_t)bits;
  memcpy(&wide, &bits, sizeof wide);
  memcpy(&narrow, &low, sizeof narrow);
  return f->width == 8 ? wide : (double)narrow;
}

static sf_status parse(npy *f, int columns, double **value, int *rows)
{
  SF_TRY(read_header(f));
  SF_TRY(check_type(f));
  SF_TRY(check_shape(f, columns, rows));
  const size_t n = (size_t)*rows * (size_t)columns;
  *value = malloc(n * sizeof **value);
  if (!*value) return sf_fail(SF_E_MEMORY, "%s: no memory for %zu numbers", f->path, n);
  for (size_t i = 0; i < n; i++) {
    (*value)[i] = number(f, i);
    if (!isfinite((*value)[i]))
      return sf_fail(SF_E_RANGE, "%s: row %zu, column %zu is not finite", f->path, i / (size_t)columns,
                     i % (size_t)columns);
  }
  return sf_ok();
}

sf_status sf_npy_load(const char *path, int columns, double **value, int *rows)
{
  char *bytes;
  npy f = {.path = path};
  *value = NULL;
  SF_TRY(sf_read_file(path, FILE_LIMIT, &bytes, &f.size));
  f.bytes = bytes;
  const sf_status status = parse(&f, columns, value, rows);
  free(bytes);
  if (status.code == SF_OK) return status;
  free(*value);
  *value = NULL;
  return status;
}
