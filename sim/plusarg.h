/* --plusarg: words for the simulation. A word that the Verilated block does not read would have no effect, so it is
 * refused. */
#ifndef SF_SIM_PLUSARG_H
#define SF_SIM_PLUSARG_H
#include "base/status.h"

/* plusarg: "+name", "+name=value", or NULL for none. SF_E_USAGE where this program's block reads no such word. */
sf_status sf_plusarg_check(const char *plusarg);
#endif
