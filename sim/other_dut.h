/* sf_cosim --dut: the same program with another accelerator inside, built with Verilator on first use. */
#ifndef SF_SIM_OTHER_DUT_H
#define SF_SIM_OTHER_DUT_H
#include "base/status.h"

/* files: Verilog sources in compilation order and options of Verilator (+incdir+DIR, -IDIR, -DNAME), parted by spaces;
 * paths below the working folder. top: name of the module with the ports of rtl/sf_top.sv. Builds in a folder of its
 * own per contents of the sources, as the source tree's sim/dut.mk says, then becomes that program with argv less --dut
 * and
 * --dut-top. Returns only on failure; what Verilator said is on standard error. */
sf_status sf_other_dut_run(const char *files, const char *top, char **argv);
#endif
