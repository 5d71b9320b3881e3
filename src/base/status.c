#include "base/status.h"
#include <stdarg.h>
#include <stdio.h>

sf_status sf_ok(void)
{
  sf_status status;
  status.code = SF_OK;
  status.message[0] = 0;
  return status;
}

/* Messages quote file names and file contents: whatever those hold, the message stays one printable line. */
static void keep_one_line(char *text)
{
  for (; *text; text++) {
    unsigned char c = (unsigned char)*text;
    if (c < 0x20 || c == 0x7f) *text = ' ';
  }
}

sf_status sf_fail(sf_code code, const char *format, ...)
{
  sf_status status;
  status.code = code;
  va_list args;
  va_start(args, format);
  int n = vsnprintf(status.message, sizeof status.message, format, args);
  va_end(args);
  if (n < 0) snprintf(status.message, sizeof status.message, "error %d", (int)code);
  if (n >= (int)sizeof status.message) snprintf(status.message + sizeof status.message - 4, 4, "...");
  keep_one_line(status.message);
  return status;
}
