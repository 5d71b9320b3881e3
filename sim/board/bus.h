/* Inside of sim/board: the registers. */
#ifndef SF_SIM_BOARD_BUS_H
#define SF_SIM_BOARD_BUS_H
#include "sim/board/board.h"

/* The bus for the driver. Forgets what failed before. */
const sf_bus *sf_board_bus(sf_board *board);
void sf_board_flush(sf_board *board);
/* A driver's result as a status, with the first fault that the link saw during the call. */
sf_status sf_board_status(sf_board *board, sf_driver_code code, const char *what);
/* An ERROR register as text. */
const char *sf_board_error(sf_board *board, uint32_t offset, const char *(*text)(uint32_t error));
#endif
