/* One sample through the stream FIFOs of the reference system (sf_soc.h). A system that moves beats in another way, by
 * DMA for one, replaces this file alone. */
#ifndef SF_FIRMWARE_SF_STREAM_H
#define SF_FIRMWARE_SF_STREAM_H
#include "firmware/sf_driver.h"

enum { SF_STREAM_POLLS = 100000 };
/* Waits until a bit of `state` is set in the FIFOs' status register at this offset. *status is what was read. */
sf_driver_code sf_stream_await(const sf_bus *bus, uint32_t offset, uint32_t state, uint32_t *status);

typedef struct sf_stream {
  sf_bus bus;           /* the FIFOs' registers */
  int n_dir, n_feature; /* of the loaded net: sf_stream_for */
} sf_stream;
sf_stream sf_stream_for(const sf_bus *bus, const sf_net_blob *net);

/* f[n_feature]; dir[n_dir] for the first sample of a ray, NULL for the others; of a decoder dir alone, for every one.
 * result: density, then three colours. SF_DRIVER_TIMEOUT when the accelerator takes or gives nothing: its ERROR
 * register may say why. */
sf_driver_code sf_stream_sample(const sf_stream *stream, const int16_t *dir, const int16_t *f, uint32_t result[4]);
#endif
