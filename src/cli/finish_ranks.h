/* The end of a program that may be one of many. */
#ifndef SF_CLI_FINISH_RANKS_H
#define SF_CLI_FINISH_RANKS_H
#include "cli/cli.h"
#include "ranks/ranks.h"

/* On rank 0 as sf_cli_finish. The other ranks print nothing and end with 0. Closes the ranks, which may be NULL. */
int sf_cli_finish_ranks(const sf_cli *cli, sf_ranks *ranks, sf_status status);
#endif
