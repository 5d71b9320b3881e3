/* sf_cosim --dut: the same program with another accelerator inside, built with Verilator on first use. */
#ifndef SF_SIM_OTHER_DUT_H
#define SF_SIM_OTHER_DUT_H
#include "base/status.h"
#include <cjson/cJSON.h>

/* files: Verilog sources in compilation order, options of Verilator (+incdir+DIR, -IDIR, -DNAME) and lists of both (-f
 * LIST, -F LIST), parted by spaces; paths below the working folder, those in a list of -F below the list's. top: name
 * of the module with the ports of rtl/sf_top.sv. Builds in a folder of its own per contents of the sources, as the
 * source tree's sim/dut.mk says, then becomes that program with argv less --dut and --dut-top. Returns only on failure;
 * what Verilator said is on standard error. */
sf_status sf_other_dut_run(const char *files, const char *top, char **argv);
/* The same for the block that a replay file names; returns SF_OK where it names none, and in a program that --dut
 * built: that one was chosen. */
sf_status sf_other_dut_replay(const char *path, char **argv);

/* The block of this program: an object of `files`, `top` and `sources` (hash of their contents), to be freed by the
 * caller; NULL for the built-in one. */
sf_status sf_other_dut_own(cJSON **dut);
/* How a program's block is not the one that a file names, either may be NULL; NULL where it is that one. */
const char *sf_other_dut_departs(const cJSON *own, const cJSON *dut);
#endif
