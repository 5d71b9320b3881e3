/* Driver of the accelerator: freestanding C, no allocation, no libc. The same source programs the hardware on a RISC-V
 * processor and the Verilated model on a host; only the bus differs. */
#ifndef SF_FIRMWARE_SF_DRIVER_H
#define SF_FIRMWARE_SF_DRIVER_H
#include "base/arch.h"
#include "base/event.h"
#include <stdint.h>

/* Byte offsets SF_CSR_<name>, expected contents SF_CSR_<name>_RESET, masks SF_CSR_<register>_<field>. */
enum {
#define SF_CSR(name, offset, access, reset, meaning) SF_CSR_##name = (offset), SF_CSR_##name##_RESET = (reset),
#define SF_CSR_FIELD(owner, name, lsb, width, meaning)                                                                 \
  SF_CSR_##owner##_##name##_LSB = (lsb), SF_CSR_##owner##_##name = ((1 << (width)) - 1) << (lsb),
#include "spikefield/csr.def"
#undef SF_CSR
#undef SF_CSR_FIELD
};

/* How the driver reaches the registers of the block: 32-bit words, byte offsets from its base. */
typedef struct sf_bus {
  uint32_t (*read)(void *context, uint32_t offset);
  void (*write)(void *context, uint32_t offset, uint32_t value);
  void *context;
} sf_bus;

/* A net as the hardware wants it. Weights: w[presynaptic * SF_LANES + neuron]; lanes beyond n_out are 0. A layer with a
 * bias has one row more. If D1 and D2 have no inputs and outputs, the net is a decoder. */
typedef struct sf_layer_blob {
  int32_t n_in, n_out, k, theta, bias;
  const int8_t *w;
} sf_layer_blob;
typedef struct sf_scale_blob {
  int32_t mul, shift, bias;
} sf_scale_blob;
typedef struct sf_net_blob {
  sf_layer_blob layer[SF_LAYERS]; /* D1 D2 C1 C2 C3 */
  int32_t mode, steps;
  sf_scale_blob exp_in, sigmoid_in;
} sf_net_blob;

/* Inputs of a layer, at most: those of a decoder, or the neurons before it. */
enum { SF_DRIVER_INPUTS = SF_LANES > SF_DIR_MAX ? SF_LANES : SF_DIR_MAX };

typedef struct sf_driver_counters {
  uint64_t event[SF_EVENTS][SF_LAYERS][SF_T_MAX];
  uint64_t samples, rays, cycles, busy, stall_in, stall_out;
  uint64_t layer_busy[SF_LAYERS]; /* cycles in which the layer added up rows */
} sf_driver_counters;

typedef enum {
  SF_DRIVER_OK,
  SF_DRIVER_NO_DEVICE, /* ID is not the accelerator's */
  SF_DRIVER_VERSION,   /* another major version than this driver's */
  SF_DRIVER_CONFIG,    /* built with other sizes than this driver */
  SF_DRIVER_REFUSED,   /* the ERROR register says why */
  SF_DRIVER_TIMEOUT,   /* the block did not answer; a soft reset recovers it */
  SF_DRIVER_MISFIT,    /* the encoder's sizes are not the net's; nothing was written */
  SF_DRIVER_CACHE,     /* the field's cache is not the one that the program asks for; nothing was written */
  SF_DRIVER_FIELD      /* this build has not the scene's kind of field; nothing was written */
} sf_driver_code;
const char *sf_driver_text(sf_driver_code code);
/* First bit of an ERROR register as text, "no error" for 0. */
const char *sf_driver_error_text(uint32_t error);

sf_driver_code sf_driver_probe(const sf_bus *bus);
/* Soft reset, programming, weights, start. */
sf_driver_code sf_driver_load(const sf_bus *bus, const sf_net_blob *net);
sf_driver_code sf_driver_program(const sf_bus *bus, const sf_net_blob *net); /* without the start */
sf_driver_code sf_driver_start(const sf_bus *bus);
void sf_driver_reset(const sf_bus *bus);
/* Both wait until no sample is at work: the caller has taken every result before. */
sf_driver_code sf_driver_clear(const sf_bus *bus);
sf_driver_code sf_driver_read_counters(const sf_bus *bus, sf_driver_counters *counters);
#endif
