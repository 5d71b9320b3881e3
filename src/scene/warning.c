#include "scene/capture.h"
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

sf_status sf_warn(sf_dataset *data, const char *format, ...)
{
  char(*larger)[400] = realloc(data->warning, (size_t)(data->warnings + 1) * sizeof *larger);
  if (!larger) return sf_fail(SF_E_MEMORY, "no memory for a warning");
  data->warning = larger;
  char text[400];
  va_list args;
  va_start(args, format);
  vsnprintf(text, sizeof text, format, args);
  va_end(args);
  const sf_status line = sf_fail(SF_E_RANGE, "%s", text); /* keeps it to one line */
  memcpy(data->warning[data->warnings++], line.message, sizeof line.message);
  return sf_ok();
}
