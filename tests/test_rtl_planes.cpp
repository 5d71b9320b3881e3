/* sf_activation, and sf_waves behind sf_dir_phase, against fx_tensorf_activate and fx_vm_encode. */
#include "Vsf_activation.h"
#include "Vsf_dir_phase.h"
#include "Vsf_waves.h"
#include "tests/rtl_unit.h"
extern "C" {
#include "src/fx/tensorf.h"
}
#include <deque>
#include <vector>

/* ---- density ---- */

enum { ACTIVATION_LATENCY = 16 };

struct activation_bench {
  unit<Vsf_activation> u{1};
  fx_tensorf field = {};
  uint32_t expected[ACTIVATION_LATENCY] = {};
  int inside = 0;

  void program(bool relu, fx_scale in, fx_scale out)
  {
    drain();
    field.activation = relu ? FX_RELU : FX_SOFTPLUS, field.density_in = in, field.sigma_out = out;
    u.top.relu_i = relu;
    u.top.in_mul_i = (uint16_t)in.mul, u.top.in_shift_i = (uint8_t)in.shift,
    u.top.in_bias_i = (uint32_t)in.bias & 0xffffff;
    u.top.out_mul_i = (uint16_t)out.mul, u.top.out_shift_i = (uint8_t)out.shift;
  }
  void next(int64_t sum, bool counts = true)
  {
    uint32_t &slot = expected[u.cycle % ACTIVATION_LATENCY];
    u.top.sum_i = (uint64_t)sum & (((uint64_t)1 << 39) - 1);
    u.settle();
    if (inside == ACTIVATION_LATENCY && u.top.sigma_o != slot)
      ck_abort_msg("sigma is %u, expected %u", u.top.sigma_o, slot);
    slot = fx_tensorf_activate(&field, sum);
    inside = counts ? inside + (inside < ACTIVATION_LATENCY) : inside;
    u.edge();
  }
  /* What is inside is of the old programming: nothing is expected until the new one has gone through. */
  void drain()
  {
    for (int i = 0; i < ACTIVATION_LATENCY && inside; i++) next(0);
    inside = 0;
  }
};

static const fx_scale one_in = {32768, 15, 0}; /* the sum is the argument */

/* Every argument of softplus and ReLU up to where the table ends, at the finest density. */
LOOP_TEST(activation_of_every_argument, 2)
{
  activation_bench b;
  b.program(_i, one_in, {32768, 15, 0});
  for (int64_t y = -70000; y <= 70000; y++) b.next(y);
  for (int bit = 17; bit < 25; bit++)
    for (int64_t i = -2; i <= 2; i++) b.next(((int64_t)1 << bit) + i), b.next(-((int64_t)1 << bit) + i);
  b.drain();
}

TEST(activation_at_every_scale)
{
  activation_bench b;
  random_draw draw(2);
  const int64_t most = (int64_t)192 * 32512 * 32512;
  for (int round = 0; round < 400 * unit_length(); round++) {
    const int bias = draw.percent(30) ? (int)draw(-(1 << 23), (1 << 23) - 1) : (int)draw(-9000, 9000);
    b.program(draw.percent(30), {draw.percent(20) ? 65535 : (int32_t)draw(0, 65535), (int32_t)draw(0, 40), bias},
              {draw.percent(20) ? 65535 : (int32_t)draw(0, 65535), (int32_t)draw(0, 40), 0});
    for (int i = 0; i < 60; i++) {
      const int bits = (int)draw(1, 37);
      const int64_t size = ((int64_t)draw(0, 1 << 20) << 18 | draw(0, (1 << 18) - 1)) & (((int64_t)1 << bits) - 1);
      b.next(draw.percent(5) ? most : draw.percent(5) ? -most : draw.percent(50) ? -size : size);
    }
    b.drain();
  }
}

/* ---- features and sines ---- */

struct wave_sample {
  int32_t sum[FX_APPEARANCE_MAX];
  int16_t unit[3];
};
static const wave_sample *features_of; /* for the core, in place of planes and lines */

static void given_features(const fx_tensorf *, const uint32_t *, int32_t sum[FX_APPEARANCE_MAX])
{
  memcpy(sum, features_of->sum, sizeof features_of->sum);
}

struct waves_bench {
  unit<Vsf_waves> u;
  unit<Vsf_dir_phase> phases;
  random_draw draw;
  sink_stalls stalls;
  fx_tensorf field = {};
  std::deque<int> expected; /* values of packets that have not come yet; LAST behind each */
  enum { LAST = 1 << 20 };
  int at = 0; /* in the packet */
  uint64_t beats = 0;

  waves_bench(uint64_t seed, int percent) : u(seed), phases(seed), draw(seed)
  {
    stalls.percent = percent;
    phases.top.clk_i = 0, phases.settle();
    u.top.valid_i = 0, u.top.m_axis_tready_i = 0;
    u.reset();
  }
  void program(int features, int feature_freqs, int view_freqs, int frac, fx_scale feature, fx_scale phase)
  {
    field.features = features, field.feature_freqs = feature_freqs, field.view_freqs = view_freqs;
    field.encoding_frac = frac, field.feature_in = feature, field.phase_in = phase;
    u.top.features_i = (uint8_t)features, u.top.feature_freqs_i = (uint8_t)feature_freqs;
    u.top.view_freqs_i = (uint8_t)view_freqs, u.top.frac_i = (uint8_t)frac;
    u.top.feature_mul_i = (uint16_t)feature.mul, u.top.feature_shift_i = (uint8_t)feature.shift;
    u.top.phase_mul_i = (uint16_t)phase.mul, u.top.phase_shift_i = (uint8_t)phase.shift;
    for (int i = 0; i < 3; i++) idle(); /* sizes less 1 are kept in registers */
  }
  void expect(const wave_sample &s)
  {
    int16_t x[SF_DIR_MAX];
    const uint32_t nowhere[3] = {};
    const fx_vm vm = {NULL, given_features};
    features_of = &s;
    fx_vm_encode(&field, &vm, nowhere, s.unit, x, NULL);
    for (int i = 0; i < fx_tensorf_inputs(&field); i++) expected.push_back(x[i]);
    expected.push_back(LAST);
  }
  void take_beat()
  {
    const uint64_t data = u.top.m_axis_tdata_o;
    bool last = false;
    ck_assert(!expected.empty());
    ck_assert_int_eq(u.top.m_axis_tuser_o, at == 0);
    for (int i = 0; i < 4; i++) {
      const int got = (int16_t)(data >> 16 * i), want = last ? 0 : expected.front();
      ck_assert_msg(got == want, "value %d is %d, expected %d", at, got, want);
      if (last) continue;
      expected.pop_front(), at++;
      last = expected.front() == LAST;
    }
    ck_assert_int_eq(u.top.m_axis_tlast_o, last);
    if (last) expected.pop_front(), at = 0;
    beats++;
  }
  /* One cycle; returns whether the sample at the input was taken. */
  bool idle()
  {
    u.top.m_axis_tready_i = !stalls(draw, u.cycle);
    u.settle();
    const bool taken = u.top.valid_i && u.top.ready_o;
    if (u.top.m_axis_tvalid_o && u.top.m_axis_tready_i) take_beat();
    u.edge();
    return taken;
  }
  void put(const wave_sample &s)
  {
    uint64_t dir = 0;
    for (int i = 0; i < FX_APPEARANCE_MAX; i++)
      for (int b = 0; b < 31; b++) {
        const int bit = 31 * i + b;
        const uint32_t mask = (uint32_t)1 << bit % 32;
        u.top.sums_i[bit / 32] = (u.top.sums_i[bit / 32] & ~mask) | ((uint32_t)s.sum[i] >> b & 1 ? mask : 0);
      }
    for (int a = 0; a < 3; a++) dir |= (uint64_t)(uint16_t)s.unit[a] << 16 * a;
    phases.top.dir_i = dir, phases.edge();
    u.top.dir_i = dir, u.top.turn_i = phases.top.phase_o, u.top.valid_i = 1;
    expect(s);
    for (int patience = 5000; !idle(); patience--) ck_assert_int_gt(patience, 0);
    u.top.valid_i = 0;
  }
  void finish()
  {
    for (int patience = 5000; !expected.empty(); patience--) {
      ck_assert_int_gt(patience, 0);
      idle();
    }
    for (int i = 0; i < 20; i++) idle(); /* and no beat more */
  }
};

/* Every phase of a turn, at the finest LSB: 32 features at a time. */
TEST(sines_of_every_phase)
{
  waves_bench b(1, 0);
  b.program(32, 1, 0, 11, {1, 0, 0}, {1, 0, 0});
  for (int phase = 0; phase < 1 << 16; phase += 32) {
    wave_sample s = {};
    for (int f = 0; f < 32; f++) s.sum[f] = phase + f - (phase & 32 ? 1 << 16 : 0);
    for (int a = 0; a < 3; a++) s.unit[a] = (int16_t)(b.draw(-16384, 16384));
    b.put(s);
  }
  b.finish();
}

/* Every axis of a direction at the highest octave: a phase that is off by one moves its sine or its cosine. */
TEST(sines_of_every_direction)
{
  waves_bench b(7, 0);
  b.program(1, 0, 4, 11, {0, 0, 0}, {0, 0, 0});
  for (int unit = -16384; unit <= 16384; unit++)
    b.put({{}, {(int16_t)unit, (int16_t)-unit, (int16_t)((unit + 30000) % 32769 - 16384)}});
  b.finish();
}

/* All sizes that a decoder has room for; sums, scales and directions over their ranges. */
LOOP_TEST(random_packets, 3)
{
  waves_bench b(2 + (uint64_t)_i, _i * 30);
  for (int round = 0; round < 300 * unit_length(); round++) {
    do
      b.field.features = (int32_t)b.draw(1, 32), b.field.feature_freqs = (int32_t)b.draw(0, 4),
      b.field.view_freqs = (int32_t)b.draw(0, 4);
    while (fx_tensorf_inputs(&b.field) > SF_DIR_MAX);
    const fx_scale feature = {(int32_t)b.draw(0, 65535), (int32_t)b.draw(0, 40), 0};
    b.program(b.field.features, b.field.feature_freqs, b.field.view_freqs, (int)b.draw(0, 11), feature,
              {(int32_t)b.draw(0, 65535), (int32_t)b.draw(0, 40), 0});
    for (int i = 0; i < 4; i++) {
      const int bits = (int)b.draw(2, 30);
      wave_sample s;
      for (int f = 0; f < FX_APPEARANCE_MAX; f++)
        s.sum[f] = (int32_t)b.draw(-((int64_t)1 << bits) + 1, ((int64_t)1 << bits) - 1);
      for (int a = 0; a < 3; a++)
        s.unit[a] =
            (int16_t)(b.draw.percent(20) ? (b.draw.percent(50) ? 16384 : -16384) : b.draw(INT16_MIN, INT16_MAX));
      b.put(s);
    }
    b.finish();
  }
}

/* The second half keeps up with a decoder of 150 inputs: a packet in at most 160 cycles. */
TEST(cycles_of_a_packet)
{
  waves_bench b(9, 0);
  wave_sample s = {};
  b.program(27, 2, 2, 9, {30000, 20, 0}, {30000, 20, 0});
  ck_assert_int_eq(fx_tensorf_inputs(&b.field), 150);
  for (int i = 0; i < 4; i++) b.put(s);
  const uint64_t begin = b.u.cycle;
  for (int i = 0; i < 20; i++) b.put(s);
  ck_assert_uint_le(b.u.cycle - begin, 20 * 160);
  b.finish();
}

/* Clear and reset at every cycle of a packet leave nothing of it behind. */
TEST(reset_on_the_way)
{
  waves_bench b(11, 20);
  wave_sample s = {};
  b.program(5, 2, 1, 10, {20000, 18, 0}, {30000, 17, 0});
  for (int delay = 0; delay < 120; delay++) {
    for (int f = 0; f < 5; f++) s.sum[f] = (int32_t)b.draw(-90000, 90000);
    for (int a = 0; a < 3; a++) s.unit[a] = (int16_t)b.draw(-16384, 16384);
    b.put(s), b.put(s);
    for (int i = 0; i < delay; i++) b.idle();
    b.u.top.rst_ni = delay & 1, b.u.top.clear_i = 1;
    b.u.edge();
    b.u.top.rst_ni = 1, b.u.top.clear_i = 0;
    b.expected.clear(), b.at = 0;
    b.put(s);
    b.finish();
  }
}

int ck_timeout = 600;
