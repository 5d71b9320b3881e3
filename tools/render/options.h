/* The command line of sim_render. */
#ifndef SF_TOOLS_RENDER_OPTIONS_H
#define SF_TOOLS_RENDER_OPTIONS_H
#include "cli/cli.h"
#include <stdbool.h>
#include <stdint.h>

typedef struct render_options {
  int view, backend, downscale, steps, threads;
  uint64_t seed;
  double scale;
  double patience;
  const char *scene, *data, *output, *png, *truth, *model, *split, *crop, *verify, *kernels, *port, *camera, *dut,
      *dut_top;
  bool all, json, quiet;
} render_options;

/* The program and its help, without options. */
sf_cli render_cli(void);
/* o: filled, and checked against the backend and the mode. Views and crops are checked against the data later. */
sf_status render_parse(int argc, char **argv, render_options *o, sf_cli *cli);
#endif
