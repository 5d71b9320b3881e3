#include "sim/pins.h"
#include "Vsf_top.h"
#include "verilated.h"
#include "verilated_fst_c.h"
#include <algorithm>
#include <memory>
#include <new>
#ifdef SF_COVERAGE
#include "verilated_cov.h"
#include <cstdlib>
#include <unistd.h>
#endif

struct sf_pins {
  VerilatedContext context;
  std::unique_ptr<Vsf_top> top;
  std::unique_ptr<VerilatedFstC> wave;
  bool dumping = false;
};

extern "C" sf_pins *sf_pins_open(uint64_t seed, const char *wave, const char *plusarg)
try {
  std::unique_ptr<sf_pins> pins(new sf_pins);
  const char *argv[] = {"dut", plusarg ? plusarg : "+none"};
  pins->context.commandArgs(2, argv);
  pins->context.randReset(2);
  pins->context.randSeed(static_cast<int>(seed % 0x7fffffff) + 1); // 0 would mean the time of day
  pins->context.traceEverOn(wave != nullptr);
  pins->top.reset(new Vsf_top(&pins->context));
  if (wave) {
    pins->wave.reset(new VerilatedFstC);
    pins->top->trace(pins->wave.get(), 99);
    pins->wave->open(wave);
    if (!pins->wave->isOpen()) return nullptr;
  }
  return pins.release();
} catch (const std::bad_alloc &) {
  return nullptr;
}

static void drive(Vsf_top *top, const sf_pins_in *in)
{
  top->rst_ni = in->rst_n;
  top->s_axil_awvalid_i = in->awvalid;
  top->s_axil_awaddr_i = in->awaddr & 0x1fff;
  top->s_axil_wvalid_i = in->wvalid;
  top->s_axil_wdata_i = in->wdata;
  top->s_axil_wstrb_i = in->wstrb;
  top->s_axil_bready_i = in->bready;
  top->s_axil_arvalid_i = in->arvalid;
  top->s_axil_araddr_i = in->araddr & 0x1fff;
  top->s_axil_rready_i = in->rready;
  top->s_axis_tvalid_i = in->s_valid;
  top->s_axis_tdata_i = in->s_data;
  top->s_axis_tuser_i = in->s_user;
  top->s_axis_tlast_i = in->s_last;
  top->m_axis_tready_i = in->m_ready;
}

static void sample(Vsf_top *top, sf_pins_out *out)
{
  out->awready = top->s_axil_awready_o;
  out->wready = top->s_axil_wready_o;
  out->bvalid = top->s_axil_bvalid_o;
  out->bresp = top->s_axil_bresp_o;
  out->arready = top->s_axil_arready_o;
  out->rvalid = top->s_axil_rvalid_o;
  out->rresp = top->s_axil_rresp_o;
  out->rdata = top->s_axil_rdata_o;
  out->s_ready = top->s_axis_tready_o;
  out->m_valid = top->m_axis_tvalid_o;
  out->m_last = top->m_axis_tlast_o;
  out->m_data = top->m_axis_tdata_o;
  out->irq = top->irq_o;
  out->tap_valid = top->tap_valid_o;
  if (!out->tap_valid) return;
  out->tap_layer = top->tap_layer_o;
  out->tap_step = top->tap_step_o;
  for (int i = 0; i < 2; i++) {
    out->tap_spikes[i] = static_cast<uint64_t>(top->tap_spikes_o[2 * i + 1]) << 32 | top->tap_spikes_o[2 * i];
    out->tap_rows[i] = static_cast<uint64_t>(top->tap_rows_o[2 * i + 1]) << 32 | top->tap_rows_o[2 * i];
  }
  std::copy_n(&top->tap_membrane_o[0], 96, out->tap_membrane);
}

static void edge(sf_pins *pins, bool clk)
{
  pins->top->clk_i = clk;
  pins->top->eval();
  if (pins->dumping) pins->wave->dump(pins->context.time());
  pins->context.timeInc(1);
}

extern "C" void sf_pins_dump(sf_pins *pins)
{
  pins->dumping = pins->wave != nullptr;
}

extern "C" void sf_pins_cycle(sf_pins *pins, const sf_pins_in *in, sf_pins_out *out)
{
  drive(pins->top.get(), in);
  edge(pins, false);
  sample(pins->top.get(), out);
  edge(pins, true);
}

#ifdef SF_COVERAGE
/* A file per accelerator: tests fork, so nothing in memory could add them up. */
static void leave_coverage(sf_pins *pins)
{
  char path[] = SF_COVERAGE "/XXXXXX.dat";
  const int file = mkstemps(path, 4);
  if (file < 0) return;
  close(file);
  pins->context.coveragep()->write(path);
}
#else
static void leave_coverage(sf_pins *)
{
}
#endif

extern "C" void sf_pins_close(sf_pins *pins)
{
  if (!pins) return;
  if (pins->wave) pins->wave->close();
  pins->top->final();
  leave_coverage(pins);
  delete pins;
}
