/* Reports of the small net's one sample, and their text. */
#ifndef SF_TESTS_AUDIT_REPORT_FIXTURE_H
#define SF_TESTS_AUDIT_REPORT_FIXTURE_H
#include "energy/energy.h"
#include "fx/memory.h"
#include "tests/audit_fixture.h"

/* What the sample costs besides: of the field, the frame and the light. */
static const sf_traffic small_traffic = {.table_bytes = 100,
                                         .exp_neg = 1,
                                         .frame_bytes = 48,
                                         .lookups = 10,
                                         .misses = 4,
                                         .products = 50,
                                         .places = 5,
                                         .special = 0,
                                         .harmonics = 1};
static const fx_memory_counts small_memory = {.lookups = 10, .misses = 4, .groups = 1, .rows = {1, 2, 4}};

/* A report as it is printed; the caller frees it. */
static inline char *printed_report(const sf_audit_report *r)
{
  static char *text; /* the stream keeps its address */
  static size_t size;
  FILE *out = open_memstream(&text, &size);
  sf_report_print(out, r);
  fclose(out);
  return text;
}
#endif
