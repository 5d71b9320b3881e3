/* One unit against its C mirror: small inputs exhausted, large ones at their corners and at random.
 * Exit status 0 equal, 1 different. -DUNIT=NAME -DUNIT_NAME chooses the unit. */
#include "tests/mutate/unit.h"
extern "C" {
#include "src/fx/round.h"
#include "src/fx/unit.h"
}

enum { TRIALS = 400000 };

/* Mostly anything, often near an end, near 0 or of few bits. */
static int64_t corner(int64_t low, int64_t high)
{
  const int64_t kind = draw(0, 5), near = draw(0, 2);
  if (kind == 0) return low + near;
  if (kind == 1) return high - near;
  int64_t value = draw(low, high);
  if (kind == 2) value = value % ((int64_t)1 << draw(1, 24));
  if (kind == 3) value = near - 1;
  return value < low ? low : value > high ? high : value;
}

static bool differs(int64_t actual, int64_t expected)
{
  return actual != expected;
}

#if defined UNIT_sf_plif
/* A neuron's step a cycle: its leak a cycle later, what it fires at four, its outputs five. */
struct neuron {
  int32_t v, current, k, theta, mode;
  bool first;
  fx_plif want;
};
static struct neuron on_its_way[8];

/* In radix mode k is the share of the current that counts. */
static fx_plif step_of(const neuron &n)
{
  const int32_t share = (int32_t)fx_rshift_round((int64_t)n.current * n.k, SF_LEAK_FRAC);
  return fx_plif_step(n.v, n.mode == FX_RADIX ? share : n.current, n.k, n.theta, n.mode, n.first);
}

static neuron drawn_neuron(void)
{
  const int64_t max = FX_MEMBRANE_MAX;
  neuron n = {(int32_t)corner(-max - 1, max),
              (int32_t)corner(-max - 1, max),
              (int32_t)corner(0, FX_LEAK_ONE),
              (int32_t)corner(1, max),
              (int32_t)draw(FX_HYBRID, FX_RADIX),
              draw(0, 3) == 0,
              {}};
  if (draw(0, 3) == 0) n.current = n.v; /* nothing leaks: the threshold alone decides */
  n.want = step_of(n);
  if (draw(0, 1) && n.want.membrane > 1) { /* at the threshold, and one beside it */
    const int32_t beside = n.want.membrane + draw(-1, 1);
    n.theta = beside > max ? max : beside;
    n.want = step_of(n);
  }
  return n;
}

static bool trial(int i)
{
  const neuron n = on_its_way[i & 7] = drawn_neuron();
  const neuron &leaks = on_its_way[(i + 7) & 7], &compares = on_its_way[(i + 4) & 7];
  top.v_i = n.v & 0xffffff, top.current_i = n.current & 0xffffff;
  top.nodecay_i = n.mode == FX_NODECAY, top.first_i = n.first;
  top.radix_i = n.mode == FX_RADIX;
  top.k_i = leaks.mode == FX_HYBRID && leaks.first ? FX_LEAK_ONE : leaks.k;
  top.theta_i = compares.theta;
  top.clk_i = 0, top.eval();
  top.clk_i = 1, top.eval();
  const fx_plif &want = compares.want; /* five clocks after its inputs, this one included */
  return i >= 4 && (differs(top.v_o, want.v & 0xffffff) || differs(top.spike_o, want.spike));
}
enum { ALL = TRIALS };
#elif defined UNIT_sf_integrate
/* A step a cycle, its output four clocks later; the mode stays for a while, as at work. */
static bool trial(int i)
{
  enum { RUN = 1000, LATER = 3 };
  static uint32_t want[8];
  const bool colour = draw(0, 1), first = draw(0, 3) == 0;
  const int64_t max = ((int64_t)1 << (colour ? SF_COLOUR_BITS : SF_SIGMA_BITS)) - 1;
  const uint32_t acc = corner(0, max), in = corner(0, max);
  const int32_t k = corner(0, FX_LEAK_ONE), other = draw(0, FX_LEAK_ONE), mode = i / RUN % (FX_RADIX + 1);
  uint64_t saturated = 0;
  top.acc_i = acc, top.in_i = in, top.mode_i = mode, top.first_i = first, top.colour_i = colour;
  top.k_density_i = colour ? other : k, top.k_colour_i = colour ? k : other;
  want[i & 7] = (colour ? fx_integrate_colour : fx_integrate_density)(acc, in, k, mode, first, &saturated);
  top.clk_i = 0, top.eval();
  top.clk_i = 1, top.eval();
  return i % RUN >= LATER && differs(top.acc_o, want[(i - LATER) & 7]);
}
enum { ALL = TRIALS };
#elif defined UNIT_sf_scale
/* A scale and a current of which the argument, before it saturates, is one power of two away from a small number. */
static fx_scale aim(int32_t *current)
{
  const int64_t high = (int64_t)1 << draw(15, 39), sum = (high + draw(0, 65535)) ^ -draw(0, 1);
  const int32_t least = (int32_t)(high >> 23), mul = (int32_t)draw(least > 65535 ? 65535 : least + 1, 65535);
  *current = (int32_t)fx_sat(sum / mul, 24);
  return {mul, 0, (int32_t)(sum - (int64_t)*current * mul)};
}

/* A current a cycle, of either table; its argument five clocks later. The scales stay for a while, as at work. */
static bool trial(int i)
{
  enum { RUN = 50, LATER = 4 };
  static int32_t want[8];
  static fx_scale scale[2];
  static int32_t aimed[2];
  if (i % RUN == 0)
    for (int s = 0; s < 2; s++) {
      const int32_t reach = draw(0, 1) ? 140000 : 35000;
      scale[s] = aim(&aimed[s]);
      if (draw(0, 1))
        scale[s] = {(int32_t)corner(0, 65535), (int32_t)draw(0, 31),
                    (int32_t)(draw(0, 3) ? draw(-reach, reach) : corner(INT32_MIN, INT32_MAX))};
    }
  const bool colour = draw(0, 1);
  int32_t current = draw(0, 1) ? corner(-32768, 32767) : corner(-(1 << 23), (1 << 23) - 1);
  if (draw(0, 3) == 0) current = aimed[colour];
  top.current_i = current & 0xffffff, top.colour_i = colour;
  top.exp_mul_i = scale[0].mul, top.exp_shift_i = scale[0].shift, top.exp_bias_i = scale[0].bias;
  top.sigmoid_mul_i = scale[1].mul, top.sigmoid_shift_i = scale[1].shift, top.sigmoid_bias_i = scale[1].bias;
  want[i & 7] = colour ? fx_sigmoid_argument(current, &scale[1]) : fx_exp2_argument(current, &scale[0]);
  top.clk_i = 0, top.eval();
  top.clk_i = 1, top.eval();
  return i % RUN >= LATER && differs(top.y_o, want[(i - LATER) & 7] & 0x3ffff);
}
enum { ALL = TRIALS };
#elif defined UNIT_sf_exp2
enum { LATER = 5, INPUTS = 1 << 18, ALL = INPUTS + LATER };
static bool trial(int i)
{
  top.y_i = (i - (1 << 17)) & 0x3ffff;
  top.clk_i = 0, top.eval();
  top.clk_i = 1, top.eval();
  return i >= LATER && differs(top.e_o, fx_exp2(i - LATER - (1 << 17)));
}
#elif defined UNIT_sf_sigmoid
enum { LATER = 5, INPUTS = 1 << 16, ALL = INPUTS + LATER };
static bool trial(int i)
{
  top.x_i = (i - (1 << 15)) & 0xffff;
  top.clk_i = 0, top.eval();
  top.clk_i = 1, top.eval();
  return i >= LATER && differs(top.s_o, fx_sigmoid(i - LATER - (1 << 15)));
}
#endif

int main(void)
{
  for (int i = 0; i < ALL; i++)
    if (trial(i)) {
      printf("differs at trial %d\n", i);
      return 1;
    }
  return 0;
}
