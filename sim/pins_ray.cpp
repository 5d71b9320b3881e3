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
    top->m_axi_arready_i = in->ar_ready;
    top->m_axi_rvalid_i = in->r_valid;
    top->m_axi_rdata_i = in->r_data;
    top->m_axi_rresp_i = in->r_resp;
    top->m_axi_rlast_i = in->r_last;
  }

  void sample(sf_pins_out *out) override
  {
    out->ray_ready = top->s_axis_tready_o;
    out->ar_valid = top->m_axi_arvalid_o;
    out->ar_address = top->m_axi_araddr_o;
    out->ar_len = top->m_axi_arlen_o;
    out->ar_size = top->m_axi_arsize_o;
    out->ar_burst = top->m_axi_arburst_o;
    out->ar_prot = top->m_axi_arprot_o;
    out->r_ready = top->m_axi_rready_o;
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
