/* The harness's own end of the streams, on an accelerator made up here: tap beats of different layers in any order, and
 * every way of getting them wrong. The functions of sim/pins.h defined here take the place of the Verilated ones. */
#include "ck_run.h"
#include "sim/ray/ray.h"
#include "base/rng.h"

enum { SAMPLES = 9, STEPS = 3, BEATS_MAX = SAMPLES * SF_LAYERS * STEPS + 1, RESULTS = 2 * SAMPLES };

typedef struct beat {
  int layer, step, sample;
} beat;

/* What changes while a result or a pixel waits to be taken. */
typedef enum { NOTHING, VALID, DATA, LAST } change;

/* Takes all input, then shows the beats, some of them only after the results. */
struct sf_pins {
  beat tap[BEATS_MAX];
  int taps, shown, late; /* late: beats after the results */
  int input, result, results;
  bool bad_last;
  change unstable;
  bool waited;
  int rays, pixels; /* in, out */
  int surplus;      /* pixels after the last one */
  int irq_at;       /* pixels before the interrupt, 0: none */
  bool ends, deaf;  /* the simulation ends at the last ray; registers do not answer */
};

sf_pins *sf_pins_open(uint64_t seed, const char *wave, const char *plusarg)
{
  (void)seed, (void)wave, (void)plusarg;
  return NULL;
}
sf_pins *sf_pins_open_rays(uint64_t seed, const char *wave, const char *plusarg)
{
  return sf_pins_open(seed, wave, plusarg);
}
void sf_pins_dump(sf_pins *pins)
{
  (void)pins;
}
void sf_pins_close(sf_pins *pins)
{
  (void)pins;
}

static uint64_t mark(const beat *b, int what)
{
  return sf_random_u64((uint64_t)what, (uint64_t)(b->layer * 8 + b->step), (uint64_t)b->sample);
}

static void show_tap(sf_pins *p, sf_pins_out *out)
{
  const beat *b = &p->tap[p->shown++];
  out->tap_valid = true;
  out->tap_layer = (uint8_t)b->layer;
  out->tap_step = (uint8_t)b->step;
  for (int i = 0; i < 2; i++) out->tap_spikes[i] = mark(b, i), out->tap_rows[i] = mark(b, 2 + i);
  for (int i = 0; i < 96; i++) out->tap_membrane[i] = (uint32_t)mark(b, 4);
}

/* True in the cycle after one in which `ready` was missing, where that makes a difference. */
static bool changes(sf_pins *p, change what, bool ready)
{
  const bool now = p->unstable == what && p->waited;
  if (p->unstable == what) p->waited = !ready && !now;
  return now;
}

static void show_pixel(sf_pins *p, const sf_pins_in *in, sf_pins_out *out)
{
  out->pixel_valid = !changes(p, VALID, in->pixel_ready);
  out->pixel_data[5] = (uint64_t)p->pixels + changes(p, DATA, in->pixel_ready);
  p->pixels += out->pixel_valid && in->pixel_ready;
}

void sf_pins_cycle(sf_pins *p, const sf_pins_in *in, sf_pins_out *out)
{
  memset(out, 0, sizeof *out);
  out->ray_ready = true;
  p->rays += in->ray_valid;
  out->finished = p->ends && p->rays == SAMPLES;
  out->irq = p->irq_at && p->pixels >= p->irq_at;
  if (p->pixels < p->rays + (p->rays == SAMPLES ? p->surplus : 0)) show_pixel(p, in, out);
  out->s_ready = true;
  out->arready = out->rvalid = in->arvalid && !p->deaf;
  p->input += in->s_valid && in->s_last;
  if (p->input < SAMPLES) return;
  if (p->shown < p->taps - p->late || (p->shown < p->taps && p->result == p->results)) {
    show_tap(p, out);
  } else if (p->result < p->results) {
    out->m_valid = !changes(p, VALID, in->m_ready);
    out->m_last = (p->result & 1) != (p->bad_last || changes(p, LAST, in->m_ready));
    out->m_data = (uint64_t)p->result + changes(p, DATA, in->m_ready);
    p->result += out->m_valid && in->m_ready;
  }
}

static int steps_of(int layer)
{
  return layer == FX_D2 || layer == FX_C3 ? 1 : STEPS;
}

/* Every layer's beats by sample and step, the layers mixed at random: a layer may be samples ahead of another. */
static void mix(sf_pins *p, uint64_t seed)
{
  int next[SF_LAYERS] = {0};
  memset(p, 0, sizeof *p);
  p->results = RESULTS;
  for (int left = SF_LAYERS, i = 0; left > 0; i++) {
    const int l = (int)sf_random_below(seed, 0, (uint64_t)i, SF_LAYERS), steps = steps_of(l);
    if (next[l] == SAMPLES * steps) continue;
    p->tap[p->taps++] = (beat){l, next[l] % steps, next[l] / steps};
    left -= ++next[l] == SAMPLES * steps;
  }
}

typedef struct bench {
  sf_pins pins;
  sf_dut dut;
  fx_ray ray;
  int16_t f[SF_FEATURE_MAX];
  sf_dut_sample sample[SAMPLES];
  sf_dut_result result[SAMPLES];
  sf_dut_trace trace[SAMPLES];
} bench;
static bench b; /* each test runs in a process of its own */

static void begin(uint64_t seed)
{
  const int in[SF_LAYERS] = {32, 128, 31, 128, 128}, out[SF_LAYERS] = {128, 16, 128, 128, 3};
  memset(&b, 0, sizeof b);
  mix(&b.pins, seed);
  b.dut.pins = &b.pins;
  b.dut.bus = sf_dut_bus(&b.dut);
  b.dut.net.steps = STEPS;
  b.dut.seed = seed;
  b.dut.stall_percent = 30;
  for (int l = 0; l < SF_LAYERS; l++) b.dut.net.layer[l].n_in = in[l], b.dut.net.layer[l].n_out = out[l];
  for (int i = 0; i < SAMPLES; i++) b.sample[i] = (sf_dut_sample){&b.ray, i % 4 == 0, b.f};
}

static sf_status run(void)
{
  return sf_dut_run_traced(&b.dut, b.sample, SAMPLES, b.result, b.trace);
}

static void beat_is_in_place(const beat *at)
{
  const int l = at->layer, t = at->step, s = at->sample;
  for (int i = 0; i < 2; i++) {
    ck_assert_uint_eq(b.result[s].spikes[l][t][i], steps_of(l) > 1 ? mark(at, i) : 0);
    ck_assert_uint_eq(b.trace[s].rows[l][t][i], mark(at, 2 + i));
  }
  ck_assert_uint_gt(b.result[s].tap_cycle[l][t], 0);
  if (steps_of(l) > 1) ck_assert_int_eq(b.trace[s].membrane[l][t][0], (int32_t)((uint32_t)mark(at, 4) << 8) >> 8);
}

TEST(layers_in_any_order)
{
  for (uint64_t seed = 0; seed < 50; seed++) {
    begin(seed);
    b.pins.late = seed % 3 ? (int)seed : 0;
    const sf_status status = run();
    ck_assert_msg(status.code == SF_OK, "seed %d: %s", (int)seed, status.message);
    for (int i = 0; i < b.pins.taps; i++) beat_is_in_place(&b.pins.tap[i]);
    for (int i = 0; i < SAMPLES; i++) ck_assert_uint_eq(b.result[i].out.sigma, (uint32_t)(2 * i));
    ck_assert_int_eq(sf_dut_received(&b.dut), SAMPLES);
  }
}

static void expect(const char *text)
{
  ck_bad(run(), SF_E_DIFFERENCE, text, "");
}

static int find(int layer, int step, int sample)
{
  int i = 0;
  while (b.pins.tap[i].layer != layer || b.pins.tap[i].step != step || b.pins.tap[i].sample != sample) i++;
  return i;
}

static void drop(int index)
{
  memmove(&b.pins.tap[index], &b.pins.tap[index + 1], (size_t)(--b.pins.taps - index) * sizeof *b.pins.tap);
}

TEST(a_step_out_of_turn)
{
  begin(1);
  b.pins.tap[find(FX_C1, 1, 4)].step = 2;
  expect("tap beat of layer 2 has step 2, expected 1");
  begin(1);
  b.pins.tap[find(FX_D2, 0, 3)].step = 1;
  expect("tap beat of layer 1 has step 1, expected 0");
}

TEST(a_beat_is_missing)
{
  for (int l = 0; l < SF_LAYERS; l++) {
    begin(2);
    drop(find(l, steps_of(l) - 1, SAMPLES - 1));
    expect("9 results but");
  }
}

TEST(a_beat_too_many)
{
  begin(3);
  b.pins.tap[b.pins.taps++] = (beat){FX_C3, 0, 0};
  expect("tap beat without a sample");
  begin(3);
  b.pins.tap[5].layer = 6;
  expect("tap beat without a sample");
}

TEST(results_out_of_step)
{
  begin(4);
  b.pins.bad_last = true;
  expect("result stream out of step");
  begin(4);
  b.pins.results = RESULTS + 2, b.pins.late = 1; /* and one more while the tap is waited for */
  expect("result stream out of step");
}

/* What was shown and not taken must be there in the next cycle, as it was. */
TEST(a_result_that_does_not_wait)
{
  for (change what = VALID; what <= LAST; what++) {
    begin(6);
    b.pins.unstable = what;
    expect("result changed before it was taken at cycle");
  }
}

/* text: NULL for a run without a difference. */
static void expect_rays(const char *text)
{
  sf_ray_request request[SAMPLES];
  fx_pixel pixel[SAMPLES];
  for (int i = 0; i < SAMPLES; i++) request[i] = (sf_ray_request){.ray = &b.ray};
  sf_ray_dut rays = {.dut = &b.dut};
  const sf_status status = sf_ray_dut_run(&rays, request, SAMPLES, pixel);
  ck_assert_int_eq(status.code, text ? SF_E_DIFFERENCE : SF_OK);
  if (text) ck_assert_msg(strstr(status.message, text) != NULL, "'%s' is not in '%s'", text, status.message);
}

TEST(a_pixel_that_does_not_wait)
{
  for (change what = NOTHING; what <= DATA; what++) {
    begin(7);
    b.pins.unstable = what;
    expect_rays(what ? "pixel changed before it was taken at cycle" : NULL);
  }
}

TEST(nothing_comes_without_a_ray)
{
  begin(8);
  b.pins.surplus = 1;
  expect_rays("pixel without a ray at cycle");
  begin(8);
  b.pins.pixels = -1; /* one before the first ray */
  b.dut.stall_percent = 0;
  expect_rays("pixel without a ray at cycle");
  begin(8);
  b.pins.irq_at = SAMPLES;
  expect_rays("interrupt without a ray at cycle");
}

TEST(the_simulation_ends_at_the_last_ray)
{
  begin(9);
  b.pins.ends = true;
  expect_rays("the simulation ended by itself at cycle");
}

/* No cause is made up of what a dead bus reads as. */
TEST(registers_that_do_not_answer)
{
  begin(10);
  b.pins.irq_at = 3, b.pins.deaf = true;
  expect_rays("interrupt at cycle");
  begin(10);
  b.pins.irq_at = 3, b.pins.deaf = true;
  expect_rays("registers do not answer");
  begin(10);
  b.pins.results = 2 * 4 + 1, b.pins.deaf = true;
  expect("4 results out: registers do not answer");
}

TEST(a_result_is_missing)
{
  begin(5);
  b.pins.results = 2 * 4 + 1;
  expect("hang");
  ck_assert_int_eq(sf_dut_received(&b.dut), 4);
}
