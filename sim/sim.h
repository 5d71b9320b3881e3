/* Inside of the harness: for its own files, and for tests that need more than sim/dut.h. */
#ifndef SF_SIM_SIM_H
#define SF_SIM_SIM_H
#include "firmware/sf_driver.h"
#include "sim/cover.h"
#include "sim/dut.h"

struct sf_dut {
  sf_pins *pins;
  sf_pins_in in;
  sf_pins_out out;
  uint64_t cycle, seed;
  uint32_t stall_percent;
  sf_bus bus;           /* the driver's way in: AXI4-Lite */
  bool bus_hung;        /* a register access was never answered */
  uint8_t bus_response; /* of the last write: 0 OKAY, 2 SLVERR */
  struct {
    const char *what; /* NULL: none */
    bool early;       /* the block breaks AXI's rules, so what the driver read means nothing */
    uint32_t offset;
    uint64_t cycle;
  } bus_fault; /* the first one since the driver was called */
  fx_net net;  /* sizes of the loaded net */
  uint64_t layer_busy[SF_LAYERS];
  int wave_from, received;
  void (*each_cycle)(void *context); /* a system around the accelerator moves its streams here; or NULL */
  void *each_cycle_context;
  uint64_t stall_cycle; /* of the last bubble or back-pressure */
  sf_cover *cover;      /* NULL but in a build for coverage */
  sf_phase phase;
};

/* One clock cycle with the inputs in dut->in; dut->out holds what was sampled at its edge. */
void sf_dut_tick(sf_dut *dut);
/* True with the stall probability. `which` chooses one of several independent sequences of decisions. */
bool sf_dut_stalls(const sf_dut *dut, uint64_t which);
sf_bus sf_dut_bus(sf_dut *dut);
/* Powers the block on and probes it. Nothing is programmed. */
sf_status sf_dut_open_bare(sf_dut **dut, const sf_dut_options *options);
/* The same for either top: sf_pins_open or sf_pins_open_rays. */
typedef sf_pins *(*sf_pins_opener)(uint64_t seed, const char *wave, const char *plusarg);
sf_status sf_dut_open_pins(sf_dut **dut, const sf_dut_options *options, sf_pins_opener open);
sf_status sf_dut_load(sf_dut *dut, const fx_net *net);
sf_net_blob sf_dut_blob(const fx_net *net);

/* The bus for the driver. Forgets what was refused before. */
const sf_bus *sf_dut_driver_bus(sf_dut *dut);
/* An ERROR register, and what its bits say. */
typedef struct sf_error_source {
  uint32_t offset;
  const char *(*text)(uint32_t error);
} sf_error_source;
extern const sf_error_source sf_dut_error; /* of sf_top */
const char *sf_dut_error_text(sf_dut *dut, const sf_error_source *error);
/* A driver's result as a status, with the first fault that the bus saw during the call. */
sf_status sf_dut_driver_status(sf_dut *dut, sf_driver_code code, const char *what, const sf_error_source *error);

/* Packet of a sample: beats of 4 values. words[SF_PACKET_MAX]; returns the number of beats. */
enum { SF_PACKET_MAX = (SF_DIR_MAX + SF_FEATURE_MAX) / 4 };
int sf_dut_packet(const fx_net *net, const sf_dut_sample *sample, uint64_t *words);
/* Of what the driver reads. */
void sf_dut_counts_of(const sf_driver_counters *read, fx_counts *counts);
#endif
