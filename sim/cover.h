/* Functional coverage: which cases the samples, errors and soft resets of all tests have reached. Only a build with
 * COVERAGE collects it, in one file that every process adds to. In other builds sf_cover_open returns NULL. */
#ifndef SF_SIM_COVER_H
#define SF_SIM_COVER_H
#include "sim/pins.h"
#include "sim/dut.h"

/* What the block was doing at a soft reset, by the last thing that happened at the pins. */
typedef enum {
  SF_PHASE_IDLE,                                /* nothing is inside */
  SF_PHASE_PACKET,                              /* a packet is half in */
  SF_PHASE_SAMPLE,                              /* a whole one, no layer is through with it */
  SF_PHASE_LAYER,                               /* + layer: its tap beat was the last */
  SF_PHASE_RESULT = SF_PHASE_LAYER + SF_LAYERS, /* a result waits */
  SF_PHASE_HALF_RESULT,
  SF_PHASES
} sf_phase;
enum { SF_COVER_MODES = 4, SF_COVER_ERRORS = 11 };

/* Events in each bin. */
typedef struct sf_cover {
  /* Tap beats by saturation of any of the layer's neurons, and by a bubble or back-pressure since the layer's last
   * beat. */
  uint64_t beat[SF_LAYERS][SF_COVER_MODES][SF_T_MAX][2][2];
  uint64_t steps[SF_COVER_MODES][SF_T_MAX];    /* samples by mode and number of steps - 1 */
  uint64_t inputs[2][2];                       /* with densities, decoder; without and with biases of C2 */
  uint64_t silent[SF_LAYERS], full[SF_LAYERS]; /* bitmaps with no neuron, with every neuron */
  uint64_t error[SF_COVER_ERRORS];             /* reads that found the bit of ERROR set */
  uint64_t reset[SF_PHASES];                   /* soft resets */
  uint64_t walk[2][2];                         /* clear, snapshot; asked for while the block was idle, at work */
} sf_cover;

sf_cover *sf_cover_open(void);
void sf_cover_close(sf_cover *cover); /* NULL is fine */
void sf_cover_sample(const fx_net *net, const fx_trace *core, const sf_dut_result *result);
/* One clock cycle; in every build. */
void sf_phase_follow(sf_phase *phase, const sf_pins_in *in, const sf_pins_out *out);
void sf_cover_read(sf_cover *cover, uint32_t offset, uint32_t value);
void sf_cover_write(sf_cover *cover, uint32_t offset, uint32_t value, sf_phase phase);
#endif
