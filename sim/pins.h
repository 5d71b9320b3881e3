/* The Verilated model, sf_top or sf_ray_top, one clock cycle per call, behind a C interface. */
#ifndef SF_SIM_PINS_H
#define SF_SIM_PINS_H
#include "base/arch.h"
#include <stdbool.h>
#include <stdint.h>
#ifdef __cplusplus
extern "C" {
#endif

typedef struct sf_pins_in {
  bool rst_n;
  bool awvalid, wvalid, bready, arvalid, rready;
  uint32_t awaddr, wdata, araddr;
  uint8_t wstrb;
  bool s_valid, s_user, s_last;
  uint64_t s_data;
  bool m_ready;
  /* sf_ray_top alone, in place of s and m: rays, pixels, the grid's memory */
  bool ray_valid, ray_user, ray_last;
  uint64_t ray_data[4];
  bool pixel_ready;
  bool ar_ready, r_valid, r_last;
  uint8_t r_resp;
  uint64_t r_data;
} sf_pins_in;

/* The outputs just before the rising edge, with the inputs of the same cycle applied. */
typedef struct sf_pins_out {
  bool awready, wready, bvalid, arready, rvalid;
  uint8_t bresp, rresp;
  uint32_t rdata;
  bool s_ready;
  bool m_valid, m_last;
  uint64_t m_data;
  bool irq, tap_valid;
  uint8_t tap_layer, tap_step;
  uint64_t tap_spikes[SF_SPIKE_WORDS], tap_rows[SF_SPIKE_WORDS];
  uint32_t tap_membrane[SF_LANES * SF_MEMBRANE_BITS / 32]; /* packed */
  bool ray_ready, pixel_valid, ar_valid, r_ready;
  uint64_t pixel_data[6];
  uint32_t ar_address;
  uint8_t ar_len, ar_size, ar_burst, ar_prot;
  bool finished; /* the block has called $finish: another cycle may end this process */
} sf_pins_out;

typedef struct sf_pins sf_pins;
/* Every register starts with a value drawn from `seed`. wave, plusarg: NULL or text. NULL when out of memory. */
sf_pins *sf_pins_open(uint64_t seed, const char *wave, const char *plusarg);
sf_pins *sf_pins_open_rays(uint64_t seed, const char *wave, const char *plusarg); /* sf_ray_top */
/* The plusargs that sf_top reads, as its source writes them, each followed by a blank: "fault=%d ". */
const char *sf_pins_plusargs(void);
/* Begins the waveform. sf_pins_dump_end completes its file; another sf_pins_dump begins another file of that name. */
void sf_pins_dump(sf_pins *pins);
void sf_pins_dump_end(sf_pins *pins);
void sf_pins_cycle(sf_pins *pins, const sf_pins_in *in, sf_pins_out *out);
void sf_pins_close(sf_pins *pins);

#ifdef __cplusplus
}
#endif
#endif
