#include "Vsf_ray_top.h"
#include "sim/pins_model.h"

struct ray_pins : sf_pins_common<Vsf_ray_top> {
  void drive(const sf_pins_in *in) override
  {
    drive_common(in);
    top->s_axis_tvalid_i = in->ray_valid;
    top->s_axis_tuser_i = in->ray_user;
    top->s_axis_tlast_i = in->ray_last;
    for (int i = 0; i < 8; i++) top->s_axis_tdata_i[i] = static_cast<uint32_t>(in->ray_data[i / 2] >> (32 * (i % 2)));
    top->m_axis_tready_i = in->pixel_ready;
    top->mem_req_ready_i = in->mem_ready;
    top->mem_rsp_valid_i = in->mem_answer;
    top->mem_rsp_data_i = in->mem_data;
  }

  void sample(sf_pins_out *out) override
  {
    out->ray_ready = top->s_axis_tready_o;
    out->mem_request = top->mem_req_valid_o;
    out->mem_address = top->mem_req_addr_o;
    out->pixel_valid = top->m_axis_tvalid_o;
    for (int i = 0; i < 6; i++)
      out->pixel_data[i] = static_cast<uint64_t>(top->m_axis_tdata_o[2 * i + 1]) << 32 | top->m_axis_tdata_o[2 * i];
    sample_common(out);
  }
};

extern "C" sf_pins *sf_pins_open_rays(uint64_t seed, const char *wave, const char *plusarg)
{
  return sf_pins_make<ray_pins, Vsf_ray_top>(seed, wave, plusarg);
}
