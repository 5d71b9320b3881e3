/* Fills a text with values of a JSON tree.
 *
 *   {{PATH}}                     the text or number at PATH, escaped
 *   {{NAME PATH ...}}            what the caller's function NAME writes, of no value or several
 *   {{#each PATH as NAME}} .. {{/each}}   once for every member; NAME stands for it
 *   {{#if PATH}} .. {{else}} .. {{/if}}   neither missing, null, false, 0 nor empty
 *   {{#has PATH}} .. {{/has}}             neither missing nor null
 *   {{#equal A B ..}} .. {{/equal}}       all the same; values by PATH, or literals: 1, "text", @NAME
 *   {{index NAME}} {{number NAME}}        of a member in its loop, from 0, from 1
 *
 * PATH is "counts.layers[0].mac[1]". In it @NAME is a member's key or place, (PATH) the text that stands there:
 * "saturated_samples.(l.name)", "l.mac[@t]". A line with nothing but one tag of a section leaves no line. */
#ifndef SF_BASE_TEMPLATE_H
#define SF_BASE_TEMPLATE_H
#include "base/json.h"
#include <stdio.h>

enum { SF_TEMPLATE_PATH = 160, SF_TEMPLATE_VALUES = 4 };
typedef struct sf_template_value {
  const cJSON *node;
  char path[SF_TEMPLATE_PATH]; /* from the root */
} sf_template_value;

typedef struct sf_template_call {
  const char *name;
  int values; /* how many it takes */
  sf_status (*write)(FILE *out, const sf_template_value *value, void *user);
} sf_template_call;

typedef struct sf_template {
  const char *name, *text; /* of the file, for messages; it ends with 0 */
  const cJSON *json;
  const sf_template_call *call; /* ends with a NULL name */
  void *user;
} sf_template;

/* SF_E_FORMAT names file, line and what is wrong: a value that is not there, an unknown function, a section that does
 * not close. */
sf_status sf_template_fill(FILE *out, const sf_template *t);
#endif
