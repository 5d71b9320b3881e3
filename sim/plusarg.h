/* --plusarg: words for the simulation. One that the Verilated block does not read would change nothing, without a word.
 */
#ifndef SF_SIM_PLUSARG_H
#define SF_SIM_PLUSARG_H
#include "base/status.h"

/* plusarg: "+name", "+name=value", or NULL for none. SF_E_USAGE where this program's block reads no such word. */
sf_status sf_plusarg_check(const char *plusarg);
#endif
