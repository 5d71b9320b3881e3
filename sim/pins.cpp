#include "Vsf_top.h"
#include "sim/pins_model.h"
#ifdef SF_COVERAGE
#include "verilated_cov.h"
#include <cstdlib>
#include <unistd.h>
#endif

struct top_pins : sf_pins_common<Vsf_top> {
  void drive(const sf_pins_in *in) override
  {
    drive_common(in);
    top->s_axis_tvalid_i = in->s_valid;
    top->s_axis_tdata_i = in->s_data;
    top->s_axis_tuser_i = in->s_user;
    top->s_axis_tlast_i = in->s_last;
    top->m_axis_tready_i = in->m_ready;
  }

  void sample(sf_pins_out *out) override
  {
    out->s_ready = top->s_axis_tready_o;
    out->m_valid = top->m_axis_tvalid_o;
    out->m_last = top->m_axis_tlast_o;
    out->m_data = top->m_axis_tdata_o;
    sample_common(out);
  }
};

extern "C" sf_pins *sf_pins_open(uint64_t seed, const char *wave, const char *plusarg)
{
  return sf_pins_make<top_pins, Vsf_top>(seed, wave, plusarg);
}

extern "C" const char *sf_pins_plusargs(void)
{
  return SF_PLUSARGS; // tools/plusargs.sh
}

static void edge(sf_pins *pins, bool clk)
{
  pins->clock(clk);
  if (pins->dumping) pins->wave->dump(pins->context.time());
  pins->context.timeInc(1);
}

extern "C" void sf_pins_dump(sf_pins *pins)
{
  if (pins->wave && !pins->wave->isOpen()) pins->wave->open(pins->wave_path.c_str());
  pins->dumping = pins->wave != nullptr;
}

extern "C" void sf_pins_dump_end(sf_pins *pins)
{
  pins->dumping = false;
  if (pins->wave) pins->wave->close();
}

extern "C" void sf_pins_cycle(sf_pins *pins, const sf_pins_in *in, sf_pins_out *out)
{
  pins->drive(in);
  edge(pins, false);
  pins->sample(out);
  edge(pins, true);
  out->finished = pins->context.gotFinish();
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
static void leave_coverage(sf_pins *) {}
#endif

extern "C" void sf_pins_close(sf_pins *pins)
{
  if (!pins) return;
  if (pins->wave) pins->wave->close();
  pins->close();
  leave_coverage(pins);
  delete pins;
}
