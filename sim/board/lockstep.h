/* sf_cosim against a board: the rays of a lockstep run as pixels, with every counter. What happens inside the board is
 * not seen: no spikes, membranes or rows, and no waveform of a difference. */
#ifndef SF_SIM_BOARD_LOCKSTEP_H
#define SF_SIM_BOARD_LOCKSTEP_H
#include "sim/board/link.h"
#include "sim/lockstep.h"

/* As sf_lockstep_run; options.port is the board's. faults: what the link said at the end, "" where nothing. */
sf_status sf_board_lockstep_run(sf_lockstep *lockstep, double patience, char faults[400]);
#endif
