/* --dut of sf_cosim and sim_render: the same program with another accelerator inside, built with Verilator on first
 * use.
 */
#ifndef SF_SIM_OTHER_DUT_H
#define SF_SIM_OTHER_DUT_H
#include "base/status.h"
#include <cjson/cJSON.h>

/* Builds this program with another accelerator inside, and becomes that program, with argv less --dut and --dut-top.
 * files: Verilog sources in compilation order, options of Verilator (+incdir+DIR, -IDIR, -DNAME) and lists of both (-f
 * LIST, -F LIST), separated by spaces. Paths are relative to the working folder, in a list of -F to the list's folder.
 * program: sf_cosim or sim_render, which is the caller. top: name of the module with the ports of rtl/sf_top.sv, or of
 * rtl/sf_ray_top.sv for sim_render. The source tree's sim/dut.mk builds, in a folder for each
 * contents of the sources. Returns only on failure; standard error has what Verilator said. */
sf_status sf_other_dut_run(const char *program, const char *files, const char *top, char **argv);
/* The same for sf_cosim and the block that a replay file names. Returns SF_OK if it names none, or if --dut built this
 * program already. */
sf_status sf_other_dut_replay(const char *path, char **argv);

/* The block of this program: an object of `files`, `top` and `sources` (hash of their contents), to be freed by the
 * caller; NULL for the built-in one. */
sf_status sf_other_dut_own(cJSON **dut);
/* Says how a program's block differs from the one that a file names; NULL if it does not. Either may be NULL. */
const char *sf_other_dut_departs(const cJSON *own, const cJSON *dut);
#endif
