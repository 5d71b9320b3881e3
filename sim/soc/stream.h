/* The stream FIFOs of the reference system (firmware/sf_soc.h) between the processor's registers and the accelerator's
 * AXI4-Stream ports: of sf_top samples and results, of sf_ray_top rays and pixels. */
#ifndef SF_SIM_SOC_STREAM_H
#define SF_SIM_SOC_STREAM_H
#include "sim/ray/ray.h"

enum { SF_SOC_FIFO_BEATS = 16, SF_SOC_BEAT_WORDS = 12 /* of a pixel, the widest */ };
typedef struct sf_soc_beat {
  uint32_t word[SF_SOC_BEAT_WORDS];
  uint32_t control; /* SF_STREAM_CONTROL_*; of the way in alone */
} sf_soc_beat;
typedef struct sf_soc_fifo {
  sf_soc_beat beat[SF_SOC_FIFO_BEATS];
  uint32_t head, count;
} sf_soc_fifo;

typedef struct sf_soc_stream {
  sf_dut *dut;
  const struct sf_soc_port *port; /* which of the two */
  sf_soc_fifo in, out;
  sf_soc_beat next;  /* that CONTROL will send */
  const char *fault; /* what the program did that the FIFOs forbid, or NULL */
  sf_memory memory;  /* the system's, as sf_ray_top sees it */
} sf_soc_stream;

/* From here on the streams move with every clock cycle of dut, which is sf_ray_top if `rays`. Both stay where they are
 * until detached. */
void sf_soc_stream_attach(sf_soc_stream *stream, sf_dut *dut, bool rays);
void sf_soc_stream_detach(sf_soc_stream *stream);
/* One access by the processor, offset inside the page. The clock runs on by what an access takes. */
uint32_t sf_soc_stream_read(sf_soc_stream *stream, uint32_t offset);
void sf_soc_stream_write(sf_soc_stream *stream, uint32_t offset, uint32_t value);
#endif
