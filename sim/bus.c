/* AXI4-Lite master: one access at a time, each channel with its own random delay. */
#include "sim/sim.h"
#include "base/rng.h"

enum { BUS_PATIENCE = 4096, STREAM_AW = 1, STREAM_W, STREAM_B, STREAM_AR, STREAM_R };

void sf_dut_tick(sf_dut *dut)
{
  if (!dut->out.finished) sf_pins_cycle(dut->pins, &dut->in, &dut->out);
  sf_phase_follow(&dut->phase, &dut->in, &dut->out);
  dut->cycle++;
  if (dut->each_cycle) dut->each_cycle(dut->each_cycle_context);
}

bool sf_dut_stalls(const sf_dut *dut, uint64_t which)
{
  return dut->stall_percent && sf_random_below(dut->seed, which, dut->cycle, 100) < dut->stall_percent;
}

static void check_answer(sf_dut *dut, uint32_t offset, bool asked, uint8_t response)
{
  const char *what = !asked ? "answered before it was asked" : response ? "refused (SLVERR or DECERR)" : NULL;
  if (!what || dut->bus_fault.what) return;
  dut->bus_fault.what = what;
  dut->bus_fault.early = !asked;
  dut->bus_fault.offset = offset;
  dut->bus_fault.cycle = dut->cycle;
}

/* Address and data change as soon as they are no longer on offer. An answer that comes too early ends the access, too,
 * because there may be no other. */
static uint32_t bus_read(void *context, uint32_t offset)
{
  sf_dut *dut = context;
  bool asked = false;
  for (int i = 0; i < BUS_PATIENCE; i++) {
    dut->in.arvalid = !asked && (dut->in.arvalid || !sf_dut_stalls(dut, STREAM_AR));
    dut->in.araddr = dut->in.arvalid ? offset : ~offset;
    dut->in.rready = !sf_dut_stalls(dut, STREAM_R);
    sf_dut_tick(dut);
    if (dut->in.arvalid && dut->out.arready) {
      asked = true;
      dut->in.arvalid = false;
    }
    if (dut->out.rvalid) check_answer(dut, offset, asked, dut->out.rresp);
    if (dut->in.rready && dut->out.rvalid) {
      dut->in.arvalid = dut->in.rready = false;
      sf_cover_read(dut->cover, offset, dut->out.rdata);
      return dut->out.rdata;
    }
  }
  dut->in.arvalid = dut->in.rready = false;
  dut->bus_hung = true;
  return 0xffffffff;
}

static void bus_write(void *context, uint32_t offset, uint32_t value)
{
  sf_dut *dut = context;
  bool addressed = false, given = false;
  sf_cover_write(dut->cover, offset, value, dut->phase);
  dut->in.wstrb = 0xf;
  for (int i = 0; i < BUS_PATIENCE; i++) {
    dut->in.awvalid = !addressed && (dut->in.awvalid || !sf_dut_stalls(dut, STREAM_AW));
    dut->in.wvalid = !given && (dut->in.wvalid || !sf_dut_stalls(dut, STREAM_W));
    dut->in.awaddr = dut->in.awvalid ? offset : ~offset;
    dut->in.wdata = dut->in.wvalid ? value : ~value;
    dut->in.bready = !sf_dut_stalls(dut, STREAM_B);
    sf_dut_tick(dut);
    if (dut->in.awvalid && dut->out.awready) addressed = true, dut->in.awvalid = false;
    if (dut->in.wvalid && dut->out.wready) given = true, dut->in.wvalid = false;
    if (dut->out.bvalid) check_answer(dut, offset, addressed && given, dut->out.bresp);
    if (dut->in.bready && dut->out.bvalid) {
      dut->in.awvalid = dut->in.wvalid = dut->in.bready = false;
      if (offset == SF_CSR_CTRL && value & SF_CSR_CTRL_SOFT_RESET) dut->phase = SF_PHASE_IDLE;
      dut->bus_response = dut->out.bresp;
      return;
    }
  }
  dut->in.awvalid = dut->in.wvalid = dut->in.bready = false;
  dut->bus_hung = true;
}

sf_bus sf_dut_bus(sf_dut *dut)
{
  return (sf_bus){.read = bus_read, .write = bus_write, .context = dut};
}
