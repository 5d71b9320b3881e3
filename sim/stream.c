/* Samples in, results and tap beats out, with random bubbles and back-pressure. The tap beats of one layer come by
 * sample, then by step; between layers, which may work on different samples, there is no order. */
#include "sim/sim.h"
#include <inttypes.h>
#include <string.h>

/* The longest sample takes about 10^3 cycles; stalls of up to 90 % slow the streams only. */
enum { PATIENCE = 100000, TAP_PATIENCE = 1000, QUIET = 16, RESULT_BEATS = 2 };
enum { STREAM_INPUT = 16, STREAM_OUTPUT, STREAM_SHY = 20 };

typedef struct run {
  sf_dut *dut;
  const sf_dut_sample *sample;
  sf_dut_result *result;
  sf_dut_trace *trace;
  int n, sent;
  int beat, beats, out_beat;
  int taps[SF_LAYERS];           /* beats seen */
  uint64_t tap_cycle[SF_LAYERS]; /* of the last one */
  uint64_t packet[SF_PACKET_MAX];
  uint64_t progress; /* cycle of the last beat */
  bool shy;          /* ready for the next beat only after it was seen */
  bool waits;        /* a result was shown and not taken: */
  uint64_t waiting_data;
  bool waiting_last;
} run;

/* A beat that was offered stays until it is taken, as AXI4-Stream demands. */
static void offer(run *r)
{
  sf_pins_in *in = &r->dut->in;
  if (in->s_valid || r->sent == r->n || sf_dut_stalls(r->dut, STREAM_INPUT)) return;
  if (r->beat == 0) r->beats = sf_dut_packet(&r->dut->net, &r->sample[r->sent], r->packet);
  in->s_valid = true;
  in->s_data = r->packet[r->beat];
  in->s_user = r->beat == 0 && (r->sample[r->sent].first || fx_net_constants_per_sample(&r->dut->net));
  in->s_last = r->beat == r->beats - 1;
}

static void accept_input(run *r)
{
  if (!r->dut->in.s_valid || !r->dut->out.s_ready) return;
  r->dut->in.s_valid = false;
  r->progress = r->dut->cycle;
  if (++r->beat < r->beats) return;
  r->beat = 0;
  r->sent++;
}

/* A result of the accelerator must stay, too. */
static sf_status check_stable(run *r)
{
  const sf_pins_out *out = &r->dut->out;
  if (r->waits && (!out->m_valid || out->m_data != r->waiting_data || out->m_last != r->waiting_last))
    return sf_fail(SF_E_DIFFERENCE, "accelerator: result changed before it was taken at cycle %" PRIu64, r->dut->cycle);
  r->waits = out->m_valid && !r->dut->in.m_ready;
  r->waiting_data = out->m_data, r->waiting_last = out->m_last;
  return sf_ok();
}

static sf_status accept_output(run *r)
{
  const sf_pins_out *out = &r->dut->out;
  SF_TRY(check_stable(r));
  if (!r->dut->in.m_ready || !out->m_valid) return sf_ok();
  if (out->m_last != (r->out_beat == RESULT_BEATS - 1) || r->dut->received == r->sent + (r->beat > 0))
    return sf_fail(SF_E_DIFFERENCE, "accelerator: result stream out of step at cycle %" PRIu64, r->dut->cycle);
  fx_out *value = &r->result[r->dut->received].out;
  const uint32_t low = (uint32_t)out->m_data, high = (uint32_t)(out->m_data >> 32);
  if (r->out_beat == 0)
    value->sigma = low, value->colour[0] = high;
  else
    value->colour[1] = low, value->colour[2] = high;
  r->progress = r->dut->cycle;
  r->shy = sf_dut_stalls(r->dut, STREAM_SHY);
  if (++r->out_beat < RESULT_BEATS) return sf_ok();
  r->out_beat = 0;
  r->result[r->dut->received++].cycle = r->dut->cycle;
  return sf_ok();
}

static int32_t membrane_lane(const uint32_t *packed, int lane)
{
  const int bit = lane * SF_MEMBRANE_BITS, word = bit / 32, shift = bit % 32;
  const uint64_t pair = packed[word] | (shift + SF_MEMBRANE_BITS > 32 ? (uint64_t)packed[word + 1] << 32 : 0);
  return (int32_t)((uint32_t)(pair >> shift) << (32 - SF_MEMBRANE_BITS)) >> (32 - SF_MEMBRANE_BITS);
}

static int taps_per_sample(const run *r, int layer)
{
  const fx_net *net = &r->dut->net;
  return net->layer[layer].n_out == 0 ? 0 : fx_layer_outputs(layer, net->steps);
}

static sf_status observe(run *r)
{
  const sf_pins_out *out = &r->dut->out;
  if (!out->tap_valid) return sf_ok();
  const int l = out->tap_layer, t = out->tap_step;
  if (l >= SF_LAYERS || r->taps[l] == r->n * taps_per_sample(r, l))
    return sf_fail(SF_E_DIFFERENCE, "accelerator: tap beat without a sample at cycle %" PRIu64, r->dut->cycle);
  const int at = r->taps[l] / taps_per_sample(r, l), step = r->taps[l] % taps_per_sample(r, l);
  if (t != step)
    return sf_fail(SF_E_DIFFERENCE, "accelerator: tap beat of layer %d has step %d, expected %d, at cycle %" PRIu64, l,
                   t, step, r->dut->cycle);
  r->taps[l]++;
  r->result[at].tap_cycle[l][t] = r->dut->cycle;
  r->result[at].stalled[l][t] = r->dut->stall_cycle > r->tap_cycle[l];
  r->tap_cycle[l] = r->dut->cycle;
  if (fx_layer_fires(l)) memcpy(r->result[at].spikes[l][t], out->tap_spikes, sizeof out->tap_spikes);
  if (!r->trace) return sf_ok();
  memcpy(r->trace[at].rows[l][t], out->tap_rows, sizeof out->tap_rows);
  for (int lane = 0; fx_layer_fires(l) && lane < SF_LANES; lane++)
    r->trace[at].membrane[l][t][lane] = membrane_lane(out->tap_membrane, lane);
  return sf_ok();
}

static sf_status trouble(run *r, const char *what)
{
  sf_dut *dut = r->dut;
  const uint64_t cycle = dut->cycle;
  dut->in.s_valid = dut->in.m_ready = false;
  return sf_fail(SF_E_DIFFERENCE, "accelerator: %s at cycle %" PRIu64 ", %d of %d samples in, %d results out: %s", what,
                 cycle, r->sent, r->n, r->dut->received, sf_dut_error_text(dut, &sf_dut_error));
}

static sf_status step(run *r)
{
  sf_dut *dut = r->dut;
  if (r->sent == dut->wave_from) sf_pins_dump(dut->pins);
  offer(r);
  dut->in.m_ready = !sf_dut_stalls(dut, STREAM_OUTPUT) && (r->waits || !r->shy);
  sf_dut_tick(dut);
  if (dut->out.finished)
    return sf_fail(SF_E_DIFFERENCE, "accelerator: the simulation ended by itself at cycle %" PRIu64, dut->cycle);
  if ((dut->out.s_ready && !dut->in.s_valid && r->sent < r->n) || (dut->out.m_valid && !dut->in.m_ready))
    dut->stall_cycle = dut->cycle;
  accept_input(r);
  SF_TRY(accept_output(r));
  SF_TRY(observe(r));
  if (dut->out.irq) return trouble(r, "interrupt");
  return dut->cycle - r->progress > PATIENCE ? trouble(r, "hang") : sf_ok();
}

static bool taps_complete(const run *r)
{
  for (int l = 0; l < SF_LAYERS; l++)
    if (r->taps[l] != r->n * taps_per_sample(r, l)) return false;
  return true;
}

/* The tap may be some cycles behind the results. */
static sf_status wait_for_taps(run *r)
{
  for (int i = 0; i < TAP_PATIENCE && !taps_complete(r); i++) SF_TRY(step(r));
  for (int l = 0; l < SF_LAYERS; l++)
    if (r->taps[l] != r->n * taps_per_sample(r, l))
      return sf_fail(SF_E_DIFFERENCE,
                     "accelerator: %d results but %d tap beats of layer %d, expected %d, at cycle %" PRIu64, r->n,
                     r->taps[l], l, r->n * taps_per_sample(r, l), r->dut->cycle);
  return sf_ok();
}

sf_status sf_dut_run_traced(sf_dut *dut, const sf_dut_sample *sample, int n, sf_dut_result *result, sf_dut_trace *trace)
{
  run r = {.dut = dut, .sample = sample, .result = result, .trace = trace, .n = n, .progress = dut->cycle};
  for (int l = 0; l < SF_LAYERS; l++) r.tap_cycle[l] = dut->cycle;
  memset(result, 0, (size_t)n * sizeof *result);
  if (trace) memset(trace, 0, (size_t)n * sizeof *trace);
  dut->received = 0;
  sf_status status = sf_ok();
  while (dut->received < n && status.code == SF_OK) status = step(&r);
  if (status.code == SF_OK) status = wait_for_taps(&r);
  dut->in.s_valid = dut->in.m_ready = false;
  return status;
}

sf_status sf_dut_quiet(sf_dut *dut)
{
  const sf_pins_out *out = &dut->out;
  const char *what = NULL;
  dut->in.m_ready = true;
  for (int i = 0; i < QUIET && !what; i++) {
    sf_dut_tick(dut);
    what = out->finished    ? "end of the simulation"
           : out->m_valid   ? "result"
           : out->tap_valid ? "tap beat"
           : out->irq       ? "interrupt"
                            : NULL;
  }
  dut->in.m_ready = false;
  if (!what) return sf_ok();
  return sf_fail(SF_E_DIFFERENCE, "accelerator: %s after the last sample at cycle %" PRIu64, what, dut->cycle);
}

sf_status sf_dut_run(sf_dut *dut, const sf_dut_sample *sample, int n, sf_dut_result *result)
{
  return sf_dut_run_traced(dut, sample, n, result, NULL);
}

int sf_dut_received(const sf_dut *dut)
{
  return dut->received;
}
