/* What the cycle model shares among its files: the registers of the RTL's modules, and what they become at a clock
 * edge. */
#ifndef SF_CYCLES_STATE_H
#define SF_CYCLES_STATE_H
#include "cycles/cycles.h"

enum {
  RING = 32,     /* samples inside the block, and the next ones to send; a power of two */
  DEPTH = 6,     /* stages of the neurons (rtl/sf_neurons.sv) */
  DENSITIES = 8, /* rtl/sf_readout.sv */
  STAGES = 16,
  STEP_CYCLES = 5, /* of a step's accumulators */
  COLOURS = 3,
  NARROW_BANKS = 4 /* of D2 and C3 (rtl/sf_narrow.sv) */
};

/* rtl/sf_stream_in.sv */
typedef struct input {
  uint32_t begun, beat, full; /* full: 0..2 buffers */
  uint32_t sent;              /* sample whose packet is at work */
} input;

/* rtl/sf_values.sv */
typedef struct values {
  enum { NONE, FEATURES, CONSTANTS, STATES } job;
  uint32_t row, part, step, d1_sample, c1_sample;
  bool full[FX_SPIKING]; /* sums of D1, of C1 */
  bool op[3], busy[2], ray;
} values;

/* Whose neurons step (rtl/sf_turns.sv), and what is on its way to them and through them (rtl/sf_neurons.sv). */
typedef struct turn {
  bool valid, last; /* last: the layer's last group */
  uint8_t layer, number, group;
} turn;

typedef struct neurons {
  bool active, released;
  uint32_t layer, turn, group, wait;
  turn way[4 + DEPTH - 1];
  bool load_c2, counted; /* the last turn loaded sums of C2; spikes are counted */
  uint32_t load_part;
} neurons;

/* rtl/sf_spikes.sv */
typedef struct spikes {
  uint32_t taken, full, group, sample; /* of the group that comes next */
  bool have, last_group, bias;
  uint64_t left; /* neurons of the group at hand */
  uint32_t at_group, at_sample;
  bool valid, item_bias, item_last; /* what is offered */
  uint8_t item_fired;
} spikes;

/* rtl/sf_sums.sv */
typedef struct sums {
  bool fresh, busy;
  uint8_t left;
  uint32_t part, full;
} sums;

/* Sums of D2 or C3 on their way out, a step per cycle (rtl/sf_narrow.sv). */
typedef struct reader {
  bool reading, way[3], way_last[3];
  uint32_t step;
} reader;

/* rtl/sf_readout.sv */
typedef struct readout {
  bool density_taken, colour_taken, density_full, colour_full;
  bool run, colour, busy, done;
  uint32_t step, slot, room, count;
  struct {
    bool valid, colour, last;
  } stage[STAGES];
} readout;

/* rtl/sf_stream_out.sv */
typedef struct output {
  bool full, second;
} output;

enum { D2, C2, C3, FED = FX_SPIKING }; /* layers fed by the spikes of D1, C1, C2 */

typedef struct state {
  uint32_t added; /* samples given so far */
  input in;
  values mac;
  neurons neuron;
  spikes spike[FED];
  sums sum[FED];
  reader read_d2, read_c3;
  uint32_t h_taken, h_full;
  uint32_t h_waiting, h_at; /* radix: sums of samples whose means are not begun or not all begun, and how many are */
  bool h_way[3];            /* a sample's last mean is on its way */
  readout read;
  output out;
} state;

/* What stands around the engine, where it has a clock of its own (planes.h): whether the second beat of a result is
 * taken at this cycle. NULL: at once. */
typedef bool (*taker)(void *user, uint64_t clock);

struct sf_cycle_model {
  uint64_t clock;
  taker takes;
  void *user;
  uint32_t n_feature, n_dir, n_h, steps, neurons;
  uint32_t last_group[FX_SPIKING], last_part[FX_SPIKING], part_groups;
  uint32_t banks[FED], parts[FED]; /* parts: the last one */
  bool bias[FED];
  uint32_t turns[FX_SPIKING];
  bool decodes, biased; /* C1 takes its inputs from the buffer; its biases take a row */
  bool radix;
  state now;
  sf_cycle_totals totals;
  sf_cycle_sample ring[RING];
};

static inline const sf_cycle_sample *sample(const sf_cycle_model *m, uint32_t number)
{
  return &m->ring[number % RING];
}

/* Each advances its part of *s by a clock edge; `was` is the state before it (src/cycles/engine.c). */

/* True where D1, or a decoder's C1, reads its inputs for the last time. load: sums of D1 or C1 are loaded. */
bool sf_tick_values(const sf_cycle_model *m, state *s, const state *was, bool load);
void sf_tick_h(const sf_cycle_model *m, state *s, const state *was, bool complete); /* complete: the sums of a sample */
/* Whose neurons step: the layer nearest to the output goes first. True where sums of D1 or C1 are loaded. */
bool sf_tick_neurons(const sf_cycle_model *m, state *s, const state *was);
/* Layer l (D2, C2, C3) and the spikes before it. load, release: of its sums. */
void sf_tick_fed(const sf_cycle_model *m, state *s, const state *was, int l, bool load, bool release);
/* True where a step is loaded; *last: the sample's last. */
bool sf_tick_reader(const sf_cycle_model *m, reader *to, const reader *r, bool begins, bool *last);
/* A clock edge of all. */
void sf_tick(sf_cycle_model *m);
/* Nothing is at work in engine, input and output. */
bool sf_idle(const sf_cycle_model *m);
/* Nothing is at work in the engine. */
bool sf_engine_idle(const state *s);
#endif
