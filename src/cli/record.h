/* Options of a command line kept in a safetensors file's metadata, so that a later command goes on with them. The key
 * of --beta is "option.beta". */
#ifndef SF_CLI_RECORD_H
#define SF_CLI_RECORD_H
#include "cli/cli.h"
#include "base/io.h"

/* The present values of the options, without outputs and those named in `apart` (ends with NULL). An option that was
 * not given has "": a flag, a string, or a number outside its limits. NULL: no memory. */
cJSON *sf_record_make(const sf_option *options, const char *const *apart);
/* Appends the options that the file has as words of a command line, from word[*words] on; room for `room` words. Free
 * each. */
sf_status sf_record_words(const sf_tensors *set, const sf_option *options, const char *const *apart, char **word,
                          int *words, int room);
/* SF_E_RANGE names the first option whose value in `record` is not the one in the file. An option that is
 * not in the file may have any value. */
sf_status sf_record_compare(const sf_tensors *set, const cJSON *record);
#endif
