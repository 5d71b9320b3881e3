#include "cli/finish_ranks.h"
#include <stdio.h>

int sf_cli_finish_ranks(const sf_cli *cli, sf_ranks *ranks, sf_status status)
{
  const int code = sf_ranks_talks(ranks) ? sf_cli_finish(cli, status) : 0;
  fflush(NULL); /* what is told comes before the launcher's own words */
  sf_ranks_close(ranks);
  return code;
}
