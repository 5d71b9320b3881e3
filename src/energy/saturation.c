#include "energy/energy.h"
#include <inttypes.h>
#include <stdarg.h>

/* Appends; a text that is full stays as it is. */
static void append(char *text, size_t size, size_t *used, const char *format, ...)
{
  va_list args;
  va_start(args, format);
  int n = vsnprintf(text + *used, size - *used, format, args);
  va_end(args);
  if (n > 0 && *used + (size_t)n < size) *used += (size_t)n;
}

bool sf_saturation_unexpected(const fx_net *net, const uint64_t saturated[SF_LAYERS], char *list, size_t size)
{
  size_t used = 0;
  append(list, size, &used, "none");
  bool any = false;
  for (int l = 0; l < SF_LAYERS; l++) {
    if (saturated[l] == 0 || l == FX_D2 || net->mode == FX_NODECAY || net->mode == FX_RADIX) continue;
    if (!any) used = 0;
    append(list, size, &used, "%s%s", any ? "," : "", fx_layer_name(l));
    any = true;
  }
  return any;
}

void sf_saturation_census(const uint64_t samples[SF_LAYERS], uint64_t features, char *text, size_t size)
{
  size_t used = 0;
  append(text, size, &used, "none");
  bool any = false;
  for (int l = 0; l < SF_LAYERS; l++) {
    if (samples[l] == 0) continue;
    if (!any) used = 0;
    append(text, size, &used, "%s%s %" PRIu64 " samples", any ? ", " : "", fx_layer_name(l), samples[l]);
    any = true;
  }
  if (features == 0) return;
  if (!any) used = 0;
  append(text, size, &used, "%s%" PRIu64 " features", any ? ", " : "", features);
}
