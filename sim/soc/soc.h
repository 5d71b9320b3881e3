/* The reference system-on-chip of firmware/sf_soc.h: an RV32IM processor emulated by Unicorn, its memory, a UART, a
 * power register, and the Verilated accelerator, sf_top or sf_ray_top, behind its AXI4-Lite port and stream FIFOs. The
 * accelerator's clock runs only while the processor accesses it. So results and event counts are those of hardware,
 * times are not. */
#ifndef SF_SIM_SOC_SOC_H
#define SF_SIM_SOC_SOC_H
#include "sim/sim.h"

typedef struct sf_soc_options {
  bool rays;                               /* the accelerator is sf_ray_top, which reads the system's memory */
  uint64_t instructions;                   /* that the program may take, about; 0 = no limit */
  bool (*uart)(void *user, char c);        /* false: the program says too much, which ends it. Or NULL */
  bool (*tick)(void *user, uint64_t done); /* after every 2^20 instructions or so; false stops. Or NULL */
  void *user;
} sf_soc_options;

typedef struct sf_soc_totals {
  uint64_t instructions, reads, writes; /* accesses: to the accelerator and its FIFOs */
} sf_soc_totals;

typedef struct sf_soc sf_soc;
/* The accelerator that a scene's field needs: sf_top for a hash grid, sf_ray_top for TensoRF; nothing programmed. */
sf_status sf_soc_open_dut(sf_dut **dut, bool rays, const sf_dut_options *options);
/* dut: from sf_soc_open_dut, borrowed, not to be used by others until the system is closed. */
sf_status sf_soc_open(sf_soc **soc, sf_dut *dut, const sf_soc_options *options);
void sf_soc_close(sf_soc *soc); /* NULL is fine */

/* Loads a 32-bit RISC-V ELF, which begins at its entry point. */
sf_status sf_soc_load_elf(sf_soc *soc, const char *path);
void sf_soc_begin_at(sf_soc *soc, uint32_t address); /* for a program that is no ELF */
/* size bytes of memory at an address of the processor, NULL where there are none. */
uint8_t *sf_soc_memory(sf_soc *soc, uint32_t address, uint64_t size);

/* Runs until the program writes the power register. Any other end is an error that names the place: a trap, an
 * access to nowhere, sleep without an end, the limit, an accelerator that does not answer. SF_E_STOPPED if tick
 * returned false. */
sf_status sf_soc_run(sf_soc *soc, uint32_t *exit_status);
sf_soc_totals sf_soc_total(const sf_soc *soc);
/* A failure, with the first register access that the accelerator refused, if there was one. */
sf_status sf_soc_explain(const sf_soc *soc, sf_status failure);
#endif
