/* What no run of minutes reaches: counters of 64 bits that begin just below 2^32, and biases of 32 bits in the scale of
 * a table's argument. Counters are set through Verilator's view of the module. */
#include "Vsf_counters.h"
#include "Vsf_counters___024root.h"
#include "Vsf_ray_csr.h"
#include "Vsf_ray_csr___024root.h"
#include "Vsf_scale.h"
#include "rtl/gen/sf_csr.h"
#include "tests/rtl_unit.h"
#include <algorithm>
#include <vector>

enum { PLACES = 512, EVENTS = 3000, PATIENCE = 2000 };
enum { D1, D2, C1, C2, C3 };

/* ---- sf_counters ---- */

struct counters_bench {
  unit<Vsf_counters> u;
  explicit counters_bench(uint64_t seed) : u(seed)
  {
    none();
    u.top.snapshot_i = 0, u.top.quiet_i = 1, u.top.index_i = 0;
    u.reset();
    walk();
  }
  void none()
  {
    Vsf_counters &t = u.top;
    t.d1_row_i = t.c1_row_i = t.c1_bias_row_i = t.c1_products_i = t.d2_row_i = t.c2_row_i = t.c2_bias_row_i = 0;
    t.c3_row_i = t.c3_bias_row_i = t.ray_i = t.neurons_valid_i = t.update_i = t.special_i = t.sample_i = 0;
    t.busy_i = 0, t.active_i = t.stall_in_i = t.stall_out_i = 0;
  }
  void walk()
  {
    int cycles = 0;
    for (u.settle(); u.top.busy_o; u.settle()) {
      u.edge();
      ck_assert_int_lt(cycles++, PATIENCE);
    }
  }
  void begin_at(uint64_t value)
  {
    Vsf_counters___024root *r = u.top.rootp;
#define ALL(of, n) std::fill_n(&r->sf_counters__DOT__##of[0], n, value)
    ALL(c1_mac_q, 8), ALL(sop_q, 32), ALL(weight_q, 32), ALL(integrate_q, 16), ALL(special_q, 16);
    ALL(spikes_q, 32), ALL(neuron_q, 32), ALL(layer_busy_q, 5);
#undef ALL
    r->sf_counters__DOT__d1_mac_q = r->sf_counters__DOT__c1_weight_q = r->sf_counters__DOT__sample_q = value;
    r->sf_counters__DOT__c2_read_q = value;
    r->sf_counters__DOT__ray_q = r->sf_counters__DOT__cycle_q = r->sf_counters__DOT__busy_q = value;
    r->sf_counters__DOT__stall_in_q = r->sf_counters__DOT__stall_out_q = value;
  }
  void events(uint64_t seed)
  {
    Vsf_counters &t = u.top;
    random_draw draw(seed);
    t.quiet_i = 0;
    t.d1_out_i = t.c1_out_i = 128, t.d2_out_i = 16, t.c2_out_i = 100, t.c3_out_i = 3;
    for (int i = 0; i < EVENTS; i++) {
      t.d1_row_i = draw.percent(50), t.c1_row_i = draw.percent(30), t.c1_bias_row_i = draw.percent(10);
      t.c1_products_i = draw.percent(50), t.c1_step_i = (uint8_t)draw(0, 7);
      t.d2_row_i = draw.percent(50), t.c2_row_i = draw.percent(50), t.c3_row_i = draw.percent(50);
      t.d2_fired_i = (uint8_t)draw(0, 255), t.c2_fired_i = (uint8_t)draw(0, 255), t.c3_fired_i = (uint8_t)draw(0, 255);
      for (CData *fired : {&t.d2_fired_i, &t.c2_fired_i, &t.c3_fired_i}) /* often a late step is the first */
        *fired &= (uint8_t)(0xff << draw(0, 7));
      t.c2_bias_row_i = draw.percent(10), t.c3_bias_row_i = draw.percent(10);
      t.busy_i = (uint8_t)draw(0, 31), t.ray_i = draw.percent(20);
      t.neurons_valid_i = draw.percent(70), t.neurons_layer_i = (uint8_t)draw(0, 2);
      t.neurons_step_i = (uint8_t)draw(0, 7), t.neurons_last_i = draw.percent(50);
      t.neurons_fired_i = (uint16_t)draw(1, 128), t.neurons_first_i = draw.percent(50);
      t.radix_i = draw.percent(50);
      t.update_i = draw.percent(50), t.special_i = draw.percent(50), t.update_colour_i = draw.percent(50);
      t.update_step_i = (uint8_t)draw(0, 7), t.sample_i = draw.percent(50);
      t.active_i = t.stall_in_i = t.stall_out_i = 1;
      u.edge();
    }
    none();
    t.quiet_i = 1;
  }
  std::vector<uint64_t> window()
  {
    std::vector<uint64_t> value;
    u.top.snapshot_i = 1, u.edge(), u.top.snapshot_i = 0;
    walk();
    for (int i = 0; i < PLACES; i++) {
      u.top.index_i = (uint16_t)i, u.edge();
      value.push_back(u.top.counter_o);
    }
    return value;
  }
};

/* How often a counter's beginning is in its place of the window: state bytes are 3 a membrane, 4 an integrator. */
static uint64_t times(int place)
{
  const int event = place >> 6, layer = place >> 3 & 7;
  if (event != SF_REG_EVENT_STATE_R && event != SF_REG_EVENT_STATE_W) return 1;
  return layer == D2 || layer == C3 ? 4 : 3;
}

TEST(counters_carry_into_their_upper_half)
{
  static const uint64_t begin[] = {0xffffffff, 0x1ffffffff, 0x7fffffffffff, 0x123456789abcdef0};
  counters_bench still(1);
  still.begin_at(0);
  still.events(2);
  const std::vector<uint64_t> zero = still.window();
  int used = 0;
  for (uint64_t from : begin) {
    counters_bench b(3);
    b.begin_at(from);
    b.events(2);
    const std::vector<uint64_t> value = b.window();
    for (int i = 0; i < PLACES; i++) {
      const uint64_t expected = zero[i] ? zero[i] + times(i) * from : 0; /* every counter that is there has counted */
      ck_assert_msg(value[i] == expected, "place %d from %llx: %llx, expected %llx", i, (unsigned long long)from,
                    (unsigned long long)value[i], (unsigned long long)expected);
      used += zero[i] != 0;
    }
  }
  ck_assert_int_eq(used, 4 * (8 + 1 + 24 + 24 + 40 + 24 + 2 + 36 + 40 + 16 + 6 + 5));
}

/* ---- sf_ray_csr ---- */

static uint32_t read_word(unit<Vsf_ray_csr> &u, uint32_t offset)
{
  u.top.arvalid_i = 1, u.top.araddr_i = (uint16_t)offset, u.top.rready_i = 0;
  u.edge();
  u.top.arvalid_i = 0;
  ck_assert(u.top.rvalid_o);
  const uint32_t value = u.top.rdata_o;
  u.top.rready_i = 1;
  u.edge();
  return value;
}

TEST(counts_of_the_field_carry)
{
  static const uint32_t offset[] = {SF_REG_FIELD_LOOKUPS, SF_REG_FIELD_MISSES, SF_REG_FIELD_FILLS, SF_REG_FIELD_STALLS};
  unit<Vsf_ray_csr> u(4);
  random_draw draw(5);
  Vsf_ray_csr &t = u.top;
  t.wvalid_i = t.bready_i = t.arvalid_i = t.rready_i = t.soft_reset_i = t.active_i = t.error_order_i = 0;
  t.bad_field_i = t.error_memory_i = t.lookups_i = t.misses_i = t.filled_i = t.waits_i = 0;
  t.clk_i = 0, t.rst_ni = 0, u.settle(), u.edge(), t.rst_ni = 1;
  for (uint64_t from : {UINT64_C(0xfffffffd), UINT64_C(0xfffffffffd), UINT64_C(0x0123456789abcdef)}) {
    uint64_t expected[4] = {from, from, from, from};
    Vsf_ray_csr___024root *r = t.rootp;
    r->sf_ray_csr__DOT__lookups_q = r->sf_ray_csr__DOT__misses_q = from;
    r->sf_ray_csr__DOT__fills_q = r->sf_ray_csr__DOT__stalls_q = from;
    for (int i = 0; i < 200; i++) {
      expected[0] += t.lookups_i = (uint8_t)draw(0, 2), expected[1] += t.misses_i = (uint8_t)draw(0, 2);
      expected[2] += t.filled_i = (uint8_t)draw(0, 1), expected[3] += t.waits_i = (uint8_t)draw(0, 1);
      u.edge();
    }
    t.lookups_i = t.misses_i = t.filled_i = t.waits_i = 0;
    for (int i = 0; i < 4; i++) {
      ck_assert_uint_eq(read_word(u, offset[i]), (uint32_t)expected[i]);
      ck_assert_uint_eq(read_word(u, offset[i] + 4), (uint32_t)(expected[i] >> 32));
    }
  }
}

/* ---- sf_scale ---- */

static int32_t argument(int32_t current, uint32_t mul, int shift, int32_t bias, bool colour)
{
  const fx_scale scale = {(int32_t)mul, shift, bias};
  return colour ? fx_sigmoid_argument(current, &scale) : fx_exp2_argument(current, &scale);
}

/* Biases near what the product is worth, so that their upper bits decide. */
TEST(biases_of_all_widths)
{
  unit<Vsf_scale> u(6);
  random_draw draw(7);
  u.top.clk_i = 0, u.settle();
  int inside = 0;
  for (int i = 0; i < 20000; i++) {
    Vsf_scale &t = u.top;
    const int colour = (int)draw(0, 1), shift = (int)draw(0, 31);
    const int32_t current = (int32_t)draw(-(1 << 23), (1 << 23) - 1) >> draw(0, 20);
    const uint32_t mul = (uint32_t)draw(0, 65535);
    const int64_t product = ((int64_t)current * mul) >> shift;
    const int64_t near = -product + draw(-(1 << 19), 1 << 19);
    const int32_t bias = (int32_t)std::min<int64_t>(std::max<int64_t>(near, INT32_MIN), INT32_MAX);
    t.current_i = (uint32_t)current & 0xffffff, t.colour_i = (uint8_t)colour;
    t.exp_mul_i = colour ? (uint16_t)draw(0, 65535) : (uint16_t)mul;
    t.sigmoid_mul_i = colour ? (uint16_t)mul : (uint16_t)draw(0, 65535);
    t.exp_shift_i = colour ? 3 : (uint8_t)shift, t.sigmoid_shift_i = colour ? (uint8_t)shift : 3;
    t.exp_bias_i = colour ? 5 : (uint32_t)bias, t.sigmoid_bias_i = colour ? (uint32_t)bias : 5;
    for (int cycle = 0; cycle < 5; cycle++) u.edge();
    const int32_t y = (int32_t)((uint32_t)t.y_o << 14) >> 14, expected = argument(current, mul, shift, bias, colour);
    ck_assert_msg(y == expected, "(%d * %u >> %d) + %d: %d, expected %d", current, mul, shift, bias, y, expected);
    const int32_t beyond = bias > 0 ? INT32_MAX : INT32_MIN;
    inside += abs(bias) > 1 << 23 && y != argument(current, mul, shift, beyond, colour);
  }
  ck_assert_int_gt(inside, 100);
}

int ck_timeout = 120;
