/* sf_cosim against a board: compares the pixels of a lockstep run's rays, and every counter. Spikes, membranes and rows
 * inside the board cannot be seen, and there is no waveform of a difference. */
#ifndef SF_SIM_BOARD_LOCKSTEP_H
#define SF_SIM_BOARD_LOCKSTEP_H
#include "sim/board/link.h"
#include "sim/lockstep.h"

/* As sf_lockstep_run; options.port is the board's. faults: what the link said at the end, "" where nothing. */
sf_status sf_board_lockstep_run(sf_lockstep *lockstep, double patience, char faults[400]);
#endif
