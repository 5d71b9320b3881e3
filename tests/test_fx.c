/* The units of the fixed-point core, each against an independent form; errors against real numbers: test_budget. */
#include "ck_run.h"
#include "src/fx/round.h"
#include "tests/fx_fixture.h"
#include <math.h>

TEST(rounding_is_half_up)
{
  ck_assert_int_eq(fx_rshift_round(5, 0), 5);
  ck_assert_int_eq(fx_rshift_round(5, 1), 3);
  ck_assert_int_eq(fx_rshift_round(-5, 1), -2);
  ck_assert_int_eq(fx_rshift_round(-6, 2), -1);
  ck_assert_int_eq(fx_rshift_round(-7, 2), -2);
  for (int64_t x = -5000; x <= 5000; x++)
    for (int n = 0; n < 8; n++) ck_assert_int_eq(fx_rshift_round(x, n), naive_round(x, n));
  ck_assert_int_eq(fx_sat(8388608, 24), 8388607);
  ck_assert_int_eq(fx_sat(-8388609, 24), -8388608);
  ck_assert_int_eq(fx_usat(-1, 28), 0);
  ck_assert_int_eq(fx_usat((int64_t)1 << 28, 28), ((int64_t)1 << 28) - 1);
}

/* The error over every input is a row of the error budget (test_budget); here are the shape and the ends. */
TEST(exp2_every_input)
{
  uint32_t before = 0;
  for (int32_t y = -131072; y <= 131071; y++) {
    const uint32_t e = fx_exp2(y);
    ck_assert_msg(e >= before, "2^(%d / 4096) falls", y);
    if (y >= 16 * 4096) ck_assert_uint_eq(e, (1u << 28) - 1);
    before = e;
  }
  ck_assert_uint_eq(fx_exp2(0), 4096);
  ck_assert_uint_eq(fx_exp2(-131072), 0);
}

/* The definition, bit for bit, with the tables computed afresh. */
TEST(exp2_is_as_defined)
{
  for (int32_t y = -131072; y < 16 * 4096; y++) {
    const int32_t n = (int32_t)floor(y / 4096.0), fraction = y - n * 4096, i = fraction / 16, low = fraction % 16;
    const int64_t here = llroundl(exp2l(i / 256.0L) * 0x1p24L), next = llroundl(exp2l((i + 1) / 256.0L) * 0x1p24L);
    const int64_t t = here + naive_round((next - here) * low, 4);
    ck_assert_int_eq(fx_exp2(y), n <= 12 ? naive_round(t, 12 - n) : t << (n - 12));
  }
}

TEST(sigmoid_is_as_defined)
{
  for (int32_t x = -32767; x <= 32767; x++) {
    const int32_t m = abs(x), i = m / 128, low = m % 128;
    const int64_t here = llroundl(65536 / (1 + expl(-i / 32.0L))),
                  next = llroundl(65536 / (1 + expl(-(i + 1) / 32.0L)));
    const int64_t p = here + naive_round((next - here) * low, 7);
    ck_assert_int_eq(fx_sigmoid(x), x < 0 ? 65536 - p : p);
  }
  ck_assert_uint_eq(fx_sigmoid(-32768), fx_sigmoid(-32767));
}

TEST(arguments_saturate)
{
  static const int32_t current[] = {-16256, -16255, -1, 0, 1, 2, 16255, 16256};
  for (uint64_t i = 0; i < 40000; i++) {
    const fx_scale s = {(int32_t)fixture_pick(1, 0, i, 0, 65535), (int32_t)fixture_pick(1, 1, i, 0, 31),
                        (int32_t)fixture_pick(1, 2, i, -131072, 131071)};
    const fx_scale without = {s.mul, s.shift, 0};
    const int32_t c = i % 2 ? current[i / 2 % 8] : (int32_t)fixture_pick(1, 3, i, -16256, 16256);
    ck_assert_int_eq(fx_exp2_argument(c, &s), naive_scale(c, &s, 131072));
    ck_assert_int_eq(fx_sigmoid_argument(c, &without), naive_scale(c, &without, 32768));
  }
}

TEST(exp_neg_every_input)
{
  uint32_t before = 1 << 20;
  for (uint32_t tau = 0; tau <= 32u << 20; tau++) {
    const uint32_t e = fx_exp_neg(tau);
    ck_assert_msg(e <= before, "exp(-%u / 2^20) rises", tau);
    before = e;
  }
  ck_assert_uint_eq(fx_exp_neg(0), 1 << 20);
  ck_assert_uint_eq(fx_exp_neg((32u << 20) + 1), 0);
  ck_assert_uint_eq(fx_exp_neg(UINT64_MAX), 0);
}

TEST(sigmoid_every_input)
{
  for (int32_t x = -32767; x <= 32767; x++) {
    const uint32_t s = fx_sigmoid(x);
    ck_assert_uint_eq(s + fx_sigmoid(-x), 65536);
    ck_assert_uint_ge(s, fx_sigmoid(x - 1));
  }
}

/* Corners of every argument and a random part: the step equals the equation in 64 bits, the vector form equals
 * the step, and in hybrid and decay mode the membrane stays between v and I. */
static void check_neuron(int32_t v, int32_t current, const fx_layer *layer, int32_t mode, bool first)
{
  fx_net net = {.mode = mode};
  const naive_net naive = {.net = &net};
  const int64_t exact = naive_charge(&naive, v, current, layer->k, first ? 0 : 1);
  const int64_t u = naive_clamp(exact, -8388608, 8388607);
  const fx_plif step = fx_plif_step(v, current, layer->k, layer->theta, mode, first);
  ck_assert_msg(step.membrane == u, "v %d I %d k %d mode %d first %d: %d, exact %lld", v, current, layer->k, mode,
                first, step.membrane, (long long)u);
  ck_assert_int_eq(step.saturated, u != exact);
  ck_assert_int_eq(step.spike, u >= layer->theta);
  ck_assert_int_eq(step.v, u - (step.spike ? layer->theta : 0));
  if (step.spike) ck_assert_int_ge(step.v, 0);
  if (mode == FX_HYBRID || mode == FX_DECAY) {
    const int32_t old = first ? 0 : v, low = old < current ? old : current, high = old < current ? current : old;
    ck_assert_msg(step.membrane >= low && step.membrane <= high, "v %d I %d k %d leaves its range", v, current,
                  layer->k);
    ck_assert(!step.saturated);
  }
  int32_t lane[SF_LANES], in[SF_LANES], membrane[SF_LANES];
  uint64_t spikes[SF_SPIKE_WORDS];
  for (int o = 0; o < SF_LANES; o++) lane[o] = v, in[o] = current;
  const int saturated = fx_plif_layer(lane, in, SF_LANES, layer, mode, first, spikes, membrane);
  ck_assert_int_eq(saturated, step.saturated * SF_LANES);
  ck_assert_uint_eq(spikes[0], step.spike ? UINT64_MAX : 0);
  ck_assert_uint_eq(spikes[1], spikes[0]);
  for (int o = 0; o < SF_LANES; o += 37) ck_assert(lane[o] == step.v && membrane[o] == step.membrane);
}

/* The scale of radix is that of a current over 2^T - 1: to half an LSB of its factor, which has 16 bits unless the
 * shift is at its end. */
TEST(scale_of_radix)
{
  for (uint64_t i = 0; i < 4000; i++) {
    const int64_t largest = i % 3 ? 65535 : i % 100;
    const fx_scale in = {(int32_t)fixture_pick(9, 0, i, 0, largest), (int32_t)fixture_pick(9, 1, i, 0, 31), (int32_t)i};
    const fx_net net = {.mode = FX_RADIX, .steps = 1 + (int)(i % SF_T_MAX)};
    const fx_scale out = fx_net_scale(&net, &in);
    const double exact = ldexp(in.mul, -in.shift) / ((1 << net.steps) - 1);
    ck_assert_int_eq(out.bias, in.bias);
    ck_assert(out.mul >= 0 && out.mul <= 65535 && out.shift >= in.shift && out.shift <= 31);
    ck_assert(fabs(ldexp(out.mul, -out.shift) - exact) <= ldexp(0.5, -out.shift));
    ck_assert_msg(out.mul >= 32767 || out.shift == 31, "%d / 2^%d for %g", out.mul, out.shift, exact);
    for (int mode = FX_HYBRID; mode < FX_RADIX; mode++) {
      const fx_net other = {.mode = mode, .steps = net.steps};
      const fx_scale same = fx_net_scale(&other, &in);
      ck_assert_mem_eq(&same, &in, sizeof in);
    }
  }
}

/* C2's threshold in radix mode is the share 1 - 2^-T of theta, rounded; every other layer's and mode's is theta. */
TEST(thresholds_that_a_driver_programs)
{
  for (int mode = FX_HYBRID; mode <= FX_RADIX; mode++)
    for (int steps = 1; steps <= SF_T_MAX; steps++)
      for (int32_t theta = 1; theta < 1 << 22; theta = theta * 5 / 4 + 1) {
        fx_net net = {.mode = mode, .steps = steps};
        for (int l = 0; l < SF_LAYERS; l++) net.layer[l].theta = theta;
        for (int l = 0; l < SF_LAYERS; l++) {
          const double share = mode == FX_RADIX && l == FX_C2 ? 1 - ldexp(1, -steps) : 1;
          ck_assert_int_eq(fx_net_theta(&net, l), (int32_t)floor(share * theta + 0.5));
        }
      }
}

/* h is the mean of a sum of all steps, down by H_SHIFT, within 1/32 of its LSB; exactly where the mean is a whole
 * number of them, and so small that the factor's own rounding, at most 2^-16 of it, is below half of 2^-T of a
 * current's LSB. */
TEST(h_of_a_sum)
{
  for (int steps = 1; steps <= SF_T_MAX; steps++)
    for (uint64_t i = 0; i < 20000; i++) {
      const int parts = (1 << steps) - 1;
      const int32_t sum = (int32_t)fixture_pick(10, steps, i, -16256 * parts, 16256 * parts),
                    got = fx_weighed_h(sum, steps);
      const double exact = ldexp((double)sum / parts, -SF_H_SHIFT);
      ck_assert_msg(got <= exact + 1.0 / 32 + ldexp(1, -SF_H_SHIFT) && got > exact - 1 - 1.0 / 32,
                    "%d steps, %d: %d for %g", steps, sum, got, exact);
      const int32_t small = 1 << (15 - SF_H_SHIFT - steps), most = small < 100 ? small : 100;
      const int32_t whole = (int32_t)(i % (uint64_t)(2 * most + 1)) - most;
      ck_assert_int_eq(fx_weighed_h(whole * parts * (1 << SF_H_SHIFT), steps), whole);
    }
}

/* The factor is the nearest one: sums far beyond those of a net show its last bit. */
TEST(h_has_the_nearest_factor)
{
  for (int steps = 1; steps <= SF_T_MAX; steps++) {
    const int64_t factor = llround(ldexp(1, 15 + steps) / ((1 << steps) - 1)), sum = 1 << 29;
    ck_assert_int_eq(fx_weighed_h((int32_t)sum, steps), (sum * factor + (1 << 14)) >> 15 >> (SF_H_SHIFT + steps));
  }
}

/* The spikes of a current are the first T binary digits of I / (2 theta), cut; rails do not change them. */
TEST(radix_fires_the_digits_of_its_current)
{
  for (uint64_t i = 0; i < 100000; i++) {
    const int bits = (int)fixture_pick(8, 0, i, 1, 22);
    const int64_t limit = ((int64_t)1 << bits) - 1, theta = i % 9 ? fixture_pick(8, 1, i, 1, limit) : limit;
    const int64_t current = i % 7 ? fixture_pick(8, 2, i, -2 * limit - 2, 2 * limit + 1) : 2 * limit + 1;
    const int64_t most = (1 << SF_T_MAX) - 1, whole = current < 0 ? 0 : (current << (SF_T_MAX - 1)) / theta;
    int64_t number = 0;
    int32_t v = 12345;
    for (int t = 0; t < SF_T_MAX; t++) {
      const fx_plif step = fx_plif_step(v, t ? 0 : (int32_t)current, 0, (int32_t)theta, FX_RADIX, t == 0);
      number = 2 * number + step.spike, v = step.v;
    }
    ck_assert_int_eq(number, whole < most ? whole : most);
  }
}

TEST(plif_corners)
{
  static const int32_t value[] = {-8388608, -8388607, -4097, -4096, -2049, -2048, -2047, -1,      0,
                                  1,        2047,     2048,  2049,  4095,  4096,  4097,  8388606, 8388607};
  static const int32_t leak[] = {0, 1, 2, 2047, 2048, 2049, 4094, 4095, 4096}, theta[] = {1, 2, 4096, 8388607};
  enum { VALUES = sizeof value / sizeof *value, LEAKS = sizeof leak / sizeof *leak };
  for (int i = 0; i < VALUES * VALUES * LEAKS * 4 * 8; i++) {
    fx_layer layer = {.k = leak[i / VALUES / VALUES % LEAKS], .theta = theta[i / VALUES / VALUES / LEAKS % 4]};
    const int rest = i / VALUES / VALUES / LEAKS / 4;
    if (rest % 4 == FX_RADIX && layer.theta > FX_MEMBRANE_MAX / 2) layer.theta = FX_MEMBRANE_MAX / 2;
    check_neuron(value[i % VALUES], value[i / VALUES % VALUES], &layer, rest % 4, rest / 4);
  }
}

TEST(plif_random)
{
  for (uint64_t i = 0; i < 100000; i++) {
    const int bits = (int)fixture_pick(7, 5, i, 1, 23);
    const int64_t limit = ((int64_t)1 << bits) - 1;
    const int32_t mode = (int32_t)fixture_pick(7, 4, i, 0, FX_RADIX);
    const int64_t highest = mode == FX_RADIX && bits == 23 ? limit / 2 : limit;
    const fx_layer layer = {.k = (int32_t)fixture_pick(7, 0, i, 0, 4096),
                            .theta = (int32_t)fixture_pick(7, 1, i, 1, highest)};
    check_neuron((int32_t)fixture_pick(7, 2, i, -limit - 1, limit), (int32_t)fixture_pick(7, 3, i, -limit - 1, limit),
                 &layer, mode, i % 3 == 0);
  }
}

TEST(plif_lanes_are_independent)
{
  int32_t v[SF_LANES], in[SF_LANES], v_all[SF_LANES];
  const fx_layer layer = {.k = 1234, .theta = 5000};
  for (uint64_t round = 0; round < 200; round++) {
    uint64_t spikes[SF_SPIKE_WORDS];
    const int mode = (int)round % 3;
    for (uint64_t o = 0; o < SF_LANES; o++) {
      v_all[o] = v[o] = (int32_t)fixture_pick(3, round, o, -20000, 20000);
      in[o] = (int32_t)fixture_pick(4, round, o, -20000, 20000);
    }
    fx_plif_layer(v_all, in, SF_LANES, &layer, mode, false, spikes, NULL);
    for (int o = 0; o < SF_LANES; o++) {
      const fx_plif step = fx_plif_step(v[o], in[o], layer.k, layer.theta, mode, false);
      ck_assert_int_eq(v_all[o], step.v);
      ck_assert_int_eq(spikes[o / 64] >> o % 64 & 1, step.spike);
    }
  }
}

TEST(integrators)
{
  for (uint64_t i = 0; i < 200000; i++) {
    fx_net net = {.mode = (int32_t)(i % 3)};
    const naive_net naive = {.net = &net};
    const int32_t k = (int32_t)(i % 7 == 0 ? 4096 * (int64_t)(i % 2) : fixture_pick(1, 0, i, 0, 4096));
    const int64_t limit[2] = {(1 << 28) - 1, (1 << 20) - 1}, in_limit[2] = {(1 << 28) - 1, 65535};
    for (int colour = 0; colour < 2; colour++) {
      const uint32_t acc = (uint32_t)fixture_pick(1, 1, i, 0, limit[colour]);
      const uint32_t in = (uint32_t)fixture_pick(1, 2, i, 0, in_limit[colour]);
      const bool first = i % 5 == 0;
      uint64_t saturated = 0;
      const int64_t exact = naive_charge(&naive, acc, in, k, first ? 0 : 1);
      const uint32_t got =
          (colour ? fx_integrate_colour : fx_integrate_density)(acc, in, k, net.mode, first, &saturated);
      ck_assert_int_eq(got, naive_clamp(exact, 0, limit[colour]));
      ck_assert_int_eq((int64_t)saturated, exact > limit[colour]);
    }
  }
}

TEST(compositing_conserves)
{
  for (uint64_t ray = 0; ray < 2000; ray++) {
    fx_pixel pixel;
    const int samples = (int)fixture_pick(2, 0, ray, 1, 200), bits = (int)fixture_pick(2, 1, ray, 1, 28);
    fx_composite_begin(&pixel);
    for (int i = 0; i < samples; i++) {
      const uint64_t at = ray * 256 + (uint64_t)i;
      const fx_out out = {(uint32_t)fixture_pick(2, 2, at, 0, (1 << bits) - 1),
                          {65536, (uint32_t)fixture_pick(2, 3, at, 0, (1 << 20) - 1), 0}};
      const int32_t delta = (int32_t)fixture_pick(2, 4, ray, 1, 1 << 20);
      fx_composite_add(&pixel, &out, delta, (uint64_t)i << 16);
      ck_assert_uint_eq(pixel.weight_sum + pixel.transmittance, 1 << 20);
    }
    ck_assert_uint_eq(pixel.colour[0], (uint64_t)pixel.weight_sum << 16);
    ck_assert_uint_eq(pixel.colour[2], 0);
    const int32_t white[3] = {65536, 65536, 65536};
    fx_composite_end(&pixel, white);
    ck_assert_uint_eq(pixel.colour[0], (uint64_t)1 << 36); /* a white surface before white stays white, exactly */
    uint32_t rgba[4];
    fx_pixel_rgba(&pixel, rgba);
    ck_assert_uint_eq(rgba[0], 65535);
  }
}

/* Shift 17 puts the rounding of odd values on a tie, where a sum of weights one LSB short of 65536 shows; shift 5 puts
 * even +-1 just beyond the rails, on 2048. */
TEST(grid_reproduces_constants)
{
  static const int shift[] = {5, 12, 17};
  OWNED(fx_scene) scene = fixture_scene(&fixture_ingp, 5);
  for (int value = -127; value <= 127; value += 2) {
    int16_t f[32];
    fx_counts counts = {0};
    memset(scene.grid.table, value, (size_t)scene.grid.entries * 2);
    for (int l = 0; l < 16; l++) scene.grid.shift[l] = shift[l % 3];
    for (uint64_t i = 0; i < 40; i++) {
      uint32_t pos[3];
      for (uint64_t a = 0; a < 3; a++) pos[a] = (uint32_t)fixture_pick(9, a, i, 0, (1 << 24) - 1);
      fx_grid_features(&scene.grid, pos, f, &counts);
      for (int n = 0; n < 32; n++)
        ck_assert_int_eq(f[n], naive_clamp(naive_round(value * 65536, shift[n / 2 % 3]), -2047, 2047));
    }
    ck_assert_uint_eq(counts.saturated_features, 40 * 12);
  }
}

TEST(march_tests_every_point)
{
  OWNED(fx_scene) scene = fixture_scene(&fixture_ingp, 6);
  for (uint64_t i = 0; i < 300; i++) {
    fx_ray ray = {.count = (int32_t)fixture_pick(1, 9, i, 0, 300)};
    fx_counts counts = {0};
    uint64_t tested = 0;
    for (int a = 0; a < 3; a++) {
      const int64_t from = fixture_pick(1, (uint64_t)a, i, 0, ((int64_t)1 << 31) - 1) << 9;
      const int64_t to = fixture_pick(2, (uint64_t)a, i, 0, ((int64_t)1 << 31) - 1) << 9;
      ray.origin[a] = from, ray.step[a] = (to - from) / 300;
    }
    int32_t found = fx_march_next(&scene, &ray, 0, (uint32_t[3]){0}, &counts);
    for (int32_t n = 0; n < ray.count; n++) {
      uint32_t p[3], at[3];
      for (int a = 0; a < 3; a++) p[a] = (uint32_t)((ray.origin[a] + n * ray.step[a]) >> 16);
      const uint32_t cell = ((p[2] >> 21) * 8 + (p[1] >> 21)) * 8 + (p[0] >> 21);
      tested++;
      if (!(scene.occupancy[cell / 8] >> cell % 8 & 1)) continue;
      ck_assert_int_eq(found, n);
      ck_assert_int_eq(fx_march_next(&scene, &ray, n, at, NULL), n);
      ck_assert_mem_eq(p, at, sizeof p);
      found = fx_march_next(&scene, &ray, n + 1, at, &counts);
    }
    ck_assert_int_eq(found, -1);
    ck_assert_uint_eq(counts.march_steps, tested);
  }
}

int ck_timeout = 300;
