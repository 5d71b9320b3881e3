#include "sim/plusarg.h"
#include "sim/pins.h"
#include <stdio.h>
#include <string.h>

/* known: "fault=%d " and more of its kind, each ends with a blank. */
static bool reads(const char *known, const char *word)
{
  for (const char *end; (end = strchr(known, ' ')); known = end + 1) {
    const size_t length = strcspn(known, "% ");
    if (length && !strncmp(known, word, length)) return true;
  }
  return false;
}

sf_status sf_plusarg_check(const char *plusarg)
{
  char known[200];
  if (!plusarg || !strncmp(plusarg, "+verilator+", 11)) return sf_ok();
  if (plusarg[0] != '+' || !plusarg[1])
    return sf_fail(SF_E_USAGE, "--plusarg %.70s: expected +NAME or +NAME=VALUE", plusarg);
  if (reads(sf_pins_plusargs(), plusarg + 1)) return sf_ok();
  snprintf(known, sizeof known, "%s", sf_pins_plusargs());
  return sf_fail(SF_E_USAGE, "--plusarg %.70s would change nothing: the block in this program reads %s%s", plusarg,
                 known[0] ? "only " : "no such word",
                 known[0] ? known : "; planted faults are in those of make faults");
}
