/* The stream FIFOs of the reference system (firmware/sf_soc.h) between the processor's registers and the accelerator's
 * AXI4-Stream ports. */
#ifndef SF_SIM_SOC_STREAM_H
#define SF_SIM_SOC_STREAM_H
#include "sim/sim.h"

enum { SF_SOC_FIFO_BEATS = 16 };
typedef struct sf_soc_fifo {
  uint64_t data[SF_SOC_FIFO_BEATS];
  uint8_t control[SF_SOC_FIFO_BEATS]; /* SF_STREAM_CONTROL_*; of the way in alone */
  uint32_t head, count;
} sf_soc_fifo;

typedef struct sf_soc_stream {
  sf_dut *dut;
  sf_soc_fifo in, out;
  uint32_t low, high; /* of the beat that CONTROL will send */
  const char *fault;  /* what the program did that the FIFOs forbid, or NULL */
} sf_soc_stream;

/* From here on the streams move with every clock cycle of dut. Both stay where they are until detached. */
void sf_soc_stream_attach(sf_soc_stream *stream, sf_dut *dut);
void sf_soc_stream_detach(sf_soc_stream *stream);
/* One access by the processor, offset inside the page. The clock runs on by what an access takes. */
uint32_t sf_soc_stream_read(sf_soc_stream *stream, uint32_t offset);
void sf_soc_stream_write(sf_soc_stream *stream, uint32_t offset, uint32_t value);
#endif
