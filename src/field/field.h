/* What a field is. It turns a position into what a net reads. There are two, and nothing outside of this folder and of
 * the ray loops asks which one a model has. */
#ifndef SF_FIELD_FIELD_H
#define SF_FIELD_FIELD_H
#include "field/model.h"

/* A number of the configuration by its key in a file's metadata, one table for both directions. */
typedef struct sf_number {
  const char *key;
  int32_t *integer; /* or */
  float *number;
} sf_number;
enum { SF_NUMBERS_MAX = 25 };

typedef struct sf_field {
  const char *name; /* as --backbone spells it */
  bool lattice;     /* rays have the configuration's lattice; without: steps of the field's own */
  /* Names of the net's tensors in files, layers D1 D2 C1 C2 C3; NULL: the net behind this field has none. */
  const char *weights[SF_LAYERS], *bias[SF_LAYERS];
  int scales; /* of the numbers in sf_lsb those that its models settle: so many, from the first on */
  sf_status (*check)(const sf_config *config);
  int (*inputs)(const sf_config *config); /* what a sample brings to the first layer of its net */
  /* Names, shapes and dims of the field's own parameters; levels. */
  void (*lay_out)(sf_model *model, sf_param param[SF_P_COUNT]);
  sf_status (*steps)(sf_steps *steps, const sf_config *config, int stride); /* sf_steps_make */
  /* Numbers of the field alone, in the order of the file; how many. */
  int (*numbers)(sf_config *config, sf_number number[SF_NUMBERS_MAX]);
} sf_field;
/* The net behind it is a decoder. */
static inline bool sf_field_decoded(const sf_field *field)
{
  return !field->weights[0];
}
extern const sf_field sf_field_grid, sf_field_planes;
enum { SF_FIELDS = SF_TENSORF + 1 };
const sf_field *sf_field_of(const sf_config *config);

/* steps.c: intervals that grow from the shortest (bound 1: equal ones) through the box; equal ones through the planes'.
 */
sf_status sf_steps_growing(sf_steps *steps, const sf_config *config, int stride);
void sf_steps_equal(sf_steps *steps, const sf_tensorf *field, int stride);
#endif
