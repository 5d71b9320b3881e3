#include "sim/soc/soc.h"
#include "firmware/sf_soc.h"
#include "sim/soc/stream.h"
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unicorn/unicorn.h>

enum { TICK_INSTRUCTIONS = 1 << 20, INSTRUCTION_BYTES = 4, ACCESS_BYTES = 4 };
static const uint64_t nowhere = 1; /* an address that execution cannot reach */

struct sf_soc {
  sf_soc_options options;
  sf_dut *dut;
  uc_engine *uc;
  uint8_t *ram;
  sf_soc_stream stream;
  sf_soc_totals total;
  uint64_t next_tick, block; /* where the block that runs begins */
  uint32_t entry, exit_status;
  bool off;
  sf_status trouble; /* the first */
};

/* Only the first reason is kept. */
static void stop(sf_soc *soc, sf_status why)
{
  if (soc->trouble.code == SF_OK) soc->trouble = why;
  uc_emu_stop(soc->uc);
}

/* The program's fault, and the block of code: Unicorn knows the place only to the block. */
static void __attribute__((format(printf, 2, 3))) blame(sf_soc *soc, const char *format, ...)
{
  char what[200];
  va_list args;
  va_start(args, format);
  vsnprintf(what, sizeof what, format, args);
  va_end(args);
  stop(soc, sf_fail(SF_E_UNSUPPORTED, "firmware: %s, in the block of code at 0x%08" PRIx64, what, soc->block));
}

/* ---- devices ---- */

static bool whole_word(sf_soc *soc, const char *device, uint64_t offset, unsigned size)
{
  if (size == ACCESS_BYTES && offset % ACCESS_BYTES == 0) return true;
  blame(soc, "%s: access of %u bytes at offset 0x%" PRIx64 ", only whole words", device, size, offset);
  return false;
}

/* What sf_ray_top does to the memory while its clock runs. */
static void check_memory(sf_soc *soc)
{
  const sf_memory *m = &soc->stream.memory;
  const char *what = m->fault ? m->fault : m->outside ? "a line beyond the memory" : NULL;
  if (what) stop(soc, sf_fail(SF_E_UNSUPPORTED, "accelerator: %s at cycle %" PRIu64, what, soc->dut->cycle));
}

static void check_answered(sf_soc *soc, const char *what, uint64_t offset)
{
  check_memory(soc);
  if (!soc->dut->bus_hung) return;
  stop(soc, sf_fail(SF_E_UNSUPPORTED, "accelerator: %s of register 0x%03" PRIx64 " not answered at cycle %" PRIu64,
                    what, offset, soc->dut->cycle));
}

static uint64_t accelerator_read(uc_engine *uc, uint64_t offset, unsigned size, void *user)
{
  (void)uc;
  sf_soc *soc = user;
  if (!whole_word(soc, "accelerator", offset, size)) return 0;
  soc->total.reads++;
  const uint32_t value = soc->dut->bus.read(soc->dut->bus.context, (uint32_t)offset);
  check_answered(soc, "read", offset);
  return value;
}

static void accelerator_write(uc_engine *uc, uint64_t offset, unsigned size, uint64_t value, void *user)
{
  (void)uc;
  sf_soc *soc = user;
  if (!whole_word(soc, "accelerator", offset, size)) return;
  soc->total.writes++;
  soc->dut->bus.write(soc->dut->bus.context, (uint32_t)offset, (uint32_t)value);
  check_answered(soc, "write", offset);
}

static void check_stream(sf_soc *soc, uint64_t offset)
{
  check_memory(soc);
  if (soc->stream.fault) blame(soc, "stream FIFOs, offset 0x%02" PRIx64 ": %s", offset, soc->stream.fault);
}

static uint64_t stream_read(uc_engine *uc, uint64_t offset, unsigned size, void *user)
{
  (void)uc;
  sf_soc *soc = user;
  if (!whole_word(soc, "stream FIFOs", offset, size)) return 0;
  soc->total.reads++;
  const uint32_t value = sf_soc_stream_read(&soc->stream, (uint32_t)offset);
  check_stream(soc, offset);
  return value;
}

static void stream_write(uc_engine *uc, uint64_t offset, unsigned size, uint64_t value, void *user)
{
  (void)uc;
  sf_soc *soc = user;
  if (!whole_word(soc, "stream FIFOs", offset, size)) return;
  soc->total.writes++;
  sf_soc_stream_write(&soc->stream, (uint32_t)offset, (uint32_t)value);
  check_stream(soc, offset);
}

static uint64_t nothing_to_read(uc_engine *uc, uint64_t offset, unsigned size, void *user)
{
  (void)uc, (void)offset, (void)size, (void)user;
  return 0;
}

static void uart_write(uc_engine *uc, uint64_t offset, unsigned size, uint64_t value, void *user)
{
  (void)uc;
  sf_soc *soc = user;
  if (!whole_word(soc, "UART", offset, size) || !soc->options.uart) return;
  if (!soc->options.uart(soc->options.user, (char)value)) blame(soc, "endless output");
}

static void power_write(uc_engine *uc, uint64_t offset, unsigned size, uint64_t value, void *user)
{
  sf_soc *soc = user;
  if (!whole_word(soc, "power", offset, size)) return;
  soc->off = true;
  soc->exit_status = (uint32_t)value;
  uc_emu_stop(uc);
}

/* ---- what the processor does ---- */

/* Counts instructions block by block, so that every endless program reaches its limit. A block that an access ends
 * early is counted whole. A block of one compressed instruction counts as one. */
static void on_block(uc_engine *uc, uint64_t address, uint32_t size, void *user)
{
  (void)uc;
  sf_soc *soc = user;
  const sf_soc_options *o = &soc->options;
  soc->block = address;
  soc->total.instructions += (size + INSTRUCTION_BYTES - 1) / INSTRUCTION_BYTES;
  if (o->instructions && soc->total.instructions > o->instructions)
    blame(soc, "no end after %" PRIu64 " instructions", soc->total.instructions);
  if (soc->total.instructions < soc->next_tick) return;
  soc->next_tick = soc->total.instructions + TICK_INSTRUCTIONS;
  if (o->tick && !o->tick(o->user, soc->total.instructions))
    stop(soc, sf_fail(SF_E_STOPPED, "stopped after %" PRIu64 " instructions", soc->total.instructions));
}

static void on_trap(uc_engine *uc, uint32_t cause, void *user)
{
  (void)uc;
  sf_soc *soc = user;
  static const char *const name[] = {"misaligned fetch", "fetch fault", "illegal instruction", "breakpoint",
                                     "misaligned load",  "load fault",  "misaligned store",    "store fault"};
  const char *text = cause < sizeof name / sizeof *name ? name[cause] : cause <= 11 ? "environment call" : "interrupt";
  blame(soc, "trap: %s (cause %" PRIu32 ")", text, cause);
}

static bool on_bad_access(uc_engine *uc, uc_mem_type type, uint64_t address, int size, int64_t value, void *user)
{
  (void)uc, (void)value;
  sf_soc *soc = user;
  const char *what = type == UC_MEM_FETCH_UNMAPPED || type == UC_MEM_FETCH_PROT   ? "fetch"
                     : type == UC_MEM_WRITE_UNMAPPED || type == UC_MEM_WRITE_PROT ? "store"
                                                                                  : "load";
  blame(soc, "%s of %d bytes at 0x%08" PRIx64 ", where there is nothing", what, size, address);
  return false;
}

/* ---- the system ---- */

static uc_err map_memory(sf_soc *soc)
{
  const uc_err err = uc_mem_map_ptr(soc->uc, SF_SOC_RAM, SF_SOC_PROGRAM_SIZE, UC_PROT_ALL, soc->ram);
  if (err != UC_ERR_OK) return err;
  return uc_mem_map_ptr(soc->uc, SF_SOC_IMAGE, SF_SOC_IMAGE_SPACE, UC_PROT_READ | UC_PROT_WRITE,
                        soc->ram + SF_SOC_PROGRAM_SIZE);
}

static uc_err map_devices(sf_soc *soc)
{
  const struct {
    uint64_t at, size;
    uc_cb_mmio_read_t read;
    uc_cb_mmio_write_t write;
  } device[] = {{SF_SOC_ACCELERATOR, SF_SOC_ACCELERATOR_SIZE, accelerator_read, accelerator_write},
                {soc->options.rays ? SF_SOC_RAYS : SF_SOC_STREAM, SF_SOC_PAGE, stream_read, stream_write},
                {SF_SOC_UART, SF_SOC_PAGE, nothing_to_read, uart_write},
                {SF_SOC_POWER, SF_SOC_PAGE, nothing_to_read, power_write}};
  uc_err err = UC_ERR_OK;
  for (size_t i = 0; err == UC_ERR_OK && i < sizeof device / sizeof *device; i++)
    err = uc_mmio_map(soc->uc, device[i].at, device[i].size, device[i].read, soc, device[i].write, soc);
  return err;
}

/* Unicorn takes every callback as void *, which C converts from a function only by way of an integer. */
static uc_err add_hooks(sf_soc *soc)
{
  const struct {
    int type;
    uintptr_t callback;
  } hook[] = {{UC_HOOK_BLOCK, (uintptr_t)on_block},
              {UC_HOOK_INTR, (uintptr_t)on_trap},
              {UC_HOOK_MEM_INVALID, (uintptr_t)on_bad_access}};
  uc_err err = UC_ERR_OK;
  for (size_t i = 0; err == UC_ERR_OK && i < sizeof hook / sizeof *hook; i++) {
    uc_hook handle;
    err = uc_hook_add(soc->uc, &handle, hook[i].type, (void *)hook[i].callback, soc, 1, 0);
  }
  return err;
}

static sf_status build(sf_soc *soc)
{
  void *ram = mmap(NULL, SF_SOC_RAM_SIZE, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (ram == MAP_FAILED) return sf_fail(SF_E_MEMORY, "no memory for the processor's %d MiB", SF_SOC_RAM_SIZE >> 20);
  soc->ram = ram;
  soc->stream.memory = (sf_memory){.dut = soc->dut, .contents = soc->ram, .bytes = SF_SOC_RAM_SIZE, .base = SF_SOC_RAM};
  uc_err err = uc_open(UC_ARCH_RISCV, UC_MODE_RISCV32, &soc->uc);
  if (err == UC_ERR_OK) err = map_memory(soc);
  if (err == UC_ERR_OK) err = map_devices(soc);
  if (err == UC_ERR_OK) err = add_hooks(soc);
  return err == UC_ERR_OK ? sf_ok() : sf_fail(SF_E_UNSUPPORTED, "Unicorn: %s", uc_strerror(err));
}

sf_status sf_soc_open_dut(sf_dut **dut, bool rays, const sf_dut_options *options)
{
  return sf_dut_open_pins(dut, options, rays ? sf_pins_open_rays : sf_pins_open);
}

sf_status sf_soc_open(sf_soc **soc_out, sf_dut *dut, const sf_soc_options *options)
{
  *soc_out = NULL;
  sf_soc *soc = calloc(1, sizeof *soc);
  if (!soc) return sf_fail(SF_E_MEMORY, "no memory for the system");
  soc->options = *options;
  soc->dut = dut;
  dut->bus_fault.what = NULL;
  sf_soc_stream_attach(&soc->stream, dut, options->rays);
  const sf_status status = build(soc);
  if (status.code == SF_OK)
    *soc_out = soc;
  else
    sf_soc_close(soc);
  return status;
}

void sf_soc_close(sf_soc *soc)
{
  if (!soc) return;
  sf_soc_stream_detach(&soc->stream);
  if (soc->uc) uc_close(soc->uc);
  if (soc->ram) munmap(soc->ram, SF_SOC_RAM_SIZE);
  free(soc);
}

void sf_soc_begin_at(sf_soc *soc, uint32_t address)
{
  soc->entry = address;
}

uint8_t *sf_soc_memory(sf_soc *soc, uint32_t address, uint64_t size)
{
  if (address < SF_SOC_RAM || size > SF_SOC_RAM_SIZE || address - SF_SOC_RAM > SF_SOC_RAM_SIZE - size) return NULL;
  return soc->ram + (address - SF_SOC_RAM);
}

sf_status sf_soc_run(sf_soc *soc, uint32_t *exit_status)
{
  const uc_err err = uc_emu_start(soc->uc, soc->entry, nowhere, 0, 0);
  if (err != UC_ERR_OK)
    blame(soc, "%s", uc_strerror(err));
  else if (!soc->off)
    blame(soc, "sleeps for ever");
  *exit_status = soc->exit_status;
  return soc->trouble;
}

sf_soc_totals sf_soc_total(const sf_soc *soc)
{
  return soc->total;
}

sf_status sf_soc_explain(const sf_soc *soc, sf_status failure)
{
  const sf_dut *dut = soc->dut;
  if (failure.code == SF_OK || failure.code == SF_E_STOPPED || !dut->bus_fault.what) return failure;
  return sf_fail(failure.code, "%s; first bad access: register %03" PRIx32 " %s at cycle %" PRIu64, failure.message,
                 dut->bus_fault.offset, dut->bus_fault.what, dut->bus_fault.cycle);
}
