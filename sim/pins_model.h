/* What the two Verilated tops have in common. C++. */
#ifndef SF_SIM_PINS_MODEL_H
#define SF_SIM_PINS_MODEL_H
#include "sim/pins.h"
#include "verilated.h"
#include "verilated_fst_c.h"
#include <algorithm>
#include <memory>
#include <new>
#include <string>

struct sf_pins {
  VerilatedContext context;
  std::unique_ptr<VerilatedFstC> wave;
  std::string wave_path;
  bool dumping = false;
  virtual ~sf_pins() = default;
  virtual void drive(const sf_pins_in *in) = 0;
  virtual void sample(sf_pins_out *out) = 0;
  virtual void clock(bool level) = 0; /* and evaluate */
  virtual void close() = 0;
};

/* Ports that both tops have by the same names. */
template <class Top> struct sf_pins_common : sf_pins {
  std::unique_ptr<Top> top;

  void drive_common(const sf_pins_in *in)
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
  }

  void sample_common(sf_pins_out *out)
  {
    out->awready = top->s_axil_awready_o;
    out->wready = top->s_axil_wready_o;
    out->bvalid = top->s_axil_bvalid_o;
    out->bresp = top->s_axil_bresp_o;
    out->arready = top->s_axil_arready_o;
    out->rvalid = top->s_axil_rvalid_o;
    out->rresp = top->s_axil_rresp_o;
    out->rdata = top->s_axil_rdata_o;
    out->irq = top->irq_o;
    out->tap_valid = top->tap_valid_o;
    if (!out->tap_valid) return;
    out->tap_layer = top->tap_layer_o;
    out->tap_step = top->tap_step_o;
    for (int i = 0; i < SF_SPIKE_WORDS; i++) {
      out->tap_spikes[i] = static_cast<uint64_t>(top->tap_spikes_o[2 * i + 1]) << 32 | top->tap_spikes_o[2 * i];
      out->tap_rows[i] = static_cast<uint64_t>(top->tap_rows_o[2 * i + 1]) << 32 | top->tap_rows_o[2 * i];
    }
    std::copy_n(&top->tap_membrane_o[0], SF_LANES * SF_MEMBRANE_BITS / 32, out->tap_membrane);
  }

  void clock(bool level) override
  {
    top->clk_i = level;
    top->eval();
  }

  void close() override { top->final(); }
};

template <class Pins, class Top> sf_pins *sf_pins_make(uint64_t seed, const char *wave, const char *plusarg)
try {
  std::unique_ptr<Pins> pins(new Pins);
  const char *argv[] = {"dut", plusarg ? plusarg : "+none"};
  pins->context.commandArgs(2, argv);
  pins->context.randReset(2);
  pins->context.randSeed(static_cast<int>(seed % 0x7fffffff) + 1); // 0 would mean the time of day
  pins->context.traceEverOn(wave != nullptr);
  pins->top.reset(new Top(&pins->context));
  if (wave) {
    pins->wave_path = wave;
    pins->wave.reset(new VerilatedFstC);
    pins->top->trace(pins->wave.get(), 99);
    pins->wave->open(wave);
    if (!pins->wave->isOpen()) return nullptr;
  }
  return pins.release();
} catch (const std::bad_alloc &) {
  return nullptr;
}
#endif
