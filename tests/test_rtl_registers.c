/* The registers against a model of csr.def: what reads back, what is refused and how, the interrupt. */
#include "tests/rtl_fixture.h"

enum {
  TRIALS = 4000,
  ACCESSES = 6000,
  LAYER_STRIDE = SF_CSR_D2_N_IN - SF_CSR_D1_N_IN,
  KINDS = 4,
  LEAK_ONE = 1 << SF_LEAK_FRAC
};
enum { N_IN, N_OUT, K, THETA }; /* registers of a layer */

/* As they read. A value that does not fit is kept as an illegal one, so that the check at start sees it. */
typedef struct registers {
  bool running;
  uint32_t error, irq_enable, irq_pending;
  uint32_t mode, steps, exp[3], sigmoid[3]; /* multiplier, shift, bias */
  uint32_t layer[SF_LAYERS][KINDS];
  uint32_t weight_address, bias;
} registers;

/* ---- the model ---- */

static uint32_t fitted(uint32_t value, int bits, uint32_t illegal)
{
  return value >> bits ? illegal : value;
}

static uint32_t *layer_register(registers *r, uint32_t offset)
{
  if (offset < SF_CSR_D1_N_IN || offset > SF_CSR_C3_THETA) return NULL;
  const uint32_t at = offset - SF_CSR_D1_N_IN;
  return &r->layer[at / LAYER_STRIDE][at % LAYER_STRIDE / 4];
}

static uint32_t layer_value(uint32_t offset, uint32_t value)
{
  switch (offset % LAYER_STRIDE / 4) {
  case K:
    return fitted(value, 13, 0x1fff);
  case THETA:
    return fitted(value, 23, 0);
  default:
    return fitted(value, 8, 0xff);
  }
}

static bool outside(uint32_t value, uint32_t low, uint32_t high)
{
  return value < low || value > high;
}

static bool bad_size(const registers *r)
{
  const uint32_t(*l)[KINDS] = r->layer;
  const bool decoder = !l[FX_D1][N_IN] && !l[FX_D1][N_OUT] && !l[FX_D2][N_IN] && !l[FX_D2][N_OUT];
  const uint32_t h = l[FX_D2][N_OUT] - 1;
  if (decoder && outside(l[FX_C1][N_IN], 1, SF_DIR_MAX)) return true;
  if (!decoder && (outside(l[FX_D1][N_IN], 1, SF_FEATURE_MAX) || outside(l[FX_D1][N_OUT], 1, SF_LANES) ||
                   l[FX_D2][N_IN] != l[FX_D1][N_OUT] || outside(l[FX_D2][N_OUT], 1, SF_OUT_MAX) ||
                   l[FX_C1][N_IN] == 0 || outside(l[FX_C1][N_IN], h, h + FX_SH)))
    return true;
  return outside(l[FX_C1][N_OUT], 1, SF_LANES) || l[FX_C2][N_IN] != l[FX_C1][N_OUT] ||
         outside(l[FX_C2][N_OUT], 1, SF_LANES) || l[FX_C3][N_IN] != l[FX_C2][N_OUT] || l[FX_C3][N_OUT] != 3 ||
         r->bias & ~(SF_CSR_BIAS_C1 | SF_CSR_BIAS_C2 | SF_CSR_BIAS_C3);
}

static uint32_t start_errors(const registers *r)
{
  uint32_t error = bad_size(r) ? SF_CSR_ERROR_SIZE : 0;
  if (outside(r->steps, 1, SF_T_MAX)) error |= SF_CSR_ERROR_STEPS;
  for (int l = 0; l < SF_LAYERS; l++) {
    const bool spikes = l == FX_C1 || l == FX_C2 || (l == FX_D1 && r->layer[FX_D1][N_OUT]);
    if (r->layer[l][K] > LEAK_ONE) error |= SF_CSR_ERROR_LEAK;
    if (spikes && !r->layer[l][THETA]) error |= SF_CSR_ERROR_THETA;
  }
  if (r->mode > FX_NODECAY) error |= SF_CSR_ERROR_MODE;
  if (r->exp[0] > 65535 || r->sigmoid[0] > 65535 || r->exp[1] > 31 || r->sigmoid[1] > 31) error |= SF_CSR_ERROR_SCALE;
  return error;
}

static bool weight_fits(uint32_t address, uint32_t weights)
{
  const uint32_t layer = address >> SF_CSR_WEIGHT_ADDRESS_LAYER_LSB, word = address & 31;
  const uint32_t row = address >> SF_CSR_WEIGHT_ADDRESS_ROW_LSB & 255;
  static const uint32_t rows[] = {SF_FEATURE_MAX, SF_LANES, SF_DIR_MAX, SF_LANES, SF_LANES};
  for (int byte = 0; byte < 4; byte++)
    if ((weights >> 8 * byte & 255) == 0x80) return false;
  if (layer >= SF_LAYERS) return false;
  if (word >= (layer == FX_D2 || layer == FX_C3 ? SF_OUT_MAX : SF_LANES) / 4) return false;
  return row < rows[layer] || (layer >= FX_C1 && row == SF_BIAS_ROW);
}

static uint32_t command(registers *r, uint32_t value)
{
  uint32_t error = 0;
  if (value & SF_CSR_CTRL_SOFT_RESET) r->running = false, r->error = 0;
  if (value & SF_CSR_CTRL_START) {
    error = r->running ? SF_CSR_ERROR_BUSY : start_errors(r);
    r->running = r->running || !error;
  }
  return error;
}

/* Programming while the block stands still; the bits of ERROR that it sets. */
static uint32_t programmed(registers *r, uint32_t offset, uint32_t value)
{
  const uint32_t known_bias = SF_CSR_BIAS_C1 | SF_CSR_BIAS_C2 | SF_CSR_BIAS_C3;
  uint32_t *const table = layer_register(r, offset);
  if (table) *table = layer_value(offset, value);
  if (offset == SF_CSR_MODE) r->mode = fitted(value, 2, 3);
  if (offset == SF_CSR_STEPS) r->steps = fitted(value, 4, 15);
  if (offset == SF_CSR_EXP_MUL) r->exp[0] = fitted(value, 16, 1u << 16);
  if (offset == SF_CSR_EXP_SHIFT) r->exp[1] = fitted(value, 5, 32);
  if (offset == SF_CSR_EXP_BIAS) r->exp[2] = value;
  if (offset == SF_CSR_SIGMOID_MUL) r->sigmoid[0] = fitted(value, 16, 1u << 16);
  if (offset == SF_CSR_SIGMOID_SHIFT) r->sigmoid[1] = fitted(value, 5, 32);
  if (offset == SF_CSR_SIGMOID_BIAS) r->sigmoid[2] = value;
  if (offset == SF_CSR_BIAS) r->bias = (value & known_bias) | (value & ~known_bias ? 1u << 18 : 0);
  if (offset == SF_CSR_WEIGHT_ADDRESS) r->weight_address = fitted(value, 16, 0xffff);
  if (offset != SF_CSR_WEIGHT_DATA) return 0;
  const bool fits = weight_fits(r->weight_address, value);
  r->weight_address = (r->weight_address + 1) & 0xffff;
  return fits ? 0 : SF_CSR_ERROR_WEIGHT;
}

/* The bits of ERROR that a write sets. */
static uint32_t model_write(registers *r, uint32_t offset, uint32_t value)
{
  uint32_t error = 0;
  if (offset == SF_CSR_CTRL)
    error = command(r, value);
  else if (offset == SF_CSR_ERROR)
    r->error &= ~value;
  else if (offset == SF_CSR_IRQ_ENABLE)
    r->irq_enable = value & 3;
  else if (offset == SF_CSR_IRQ_PENDING)
    r->irq_pending &= ~value;
  else if (outside(offset, SF_CSR_MODE, SF_CSR_BIAS))
    error = SF_CSR_ERROR_ADDRESS;
  else
    error = r->running ? SF_CSR_ERROR_BUSY : programmed(r, offset, value);
  r->error |= error;
  if (error) r->irq_pending |= SF_CSR_IRQ_ENABLE_ERROR;
  return error;
}

static uint32_t model_read(registers *r, uint32_t offset)
{
  const struct {
    uint32_t offset, value;
  } all[] = {{SF_CSR_ID, SF_CSR_ID_RESET},
             {SF_CSR_VERSION, SF_CSR_VERSION_RESET},
             {SF_CSR_CONFIG, SF_CSR_CONFIG_RESET},
             {SF_CSR_STATUS, (r->running ? SF_CSR_STATUS_RUNNING : 0) | (r->error ? SF_CSR_STATUS_ERROR : 0)},
             {SF_CSR_ERROR, r->error},
             {SF_CSR_IRQ_ENABLE, r->irq_enable},
             {SF_CSR_IRQ_PENDING, r->irq_pending},
             {SF_CSR_MODE, r->mode},
             {SF_CSR_STEPS, r->steps},
             {SF_CSR_EXP_MUL, r->exp[0]},
             {SF_CSR_EXP_SHIFT, r->exp[1]},
             {SF_CSR_EXP_BIAS, r->exp[2]},
             {SF_CSR_SIGMOID_MUL, r->sigmoid[0]},
             {SF_CSR_SIGMOID_SHIFT, r->sigmoid[1]},
             {SF_CSR_SIGMOID_BIAS, r->sigmoid[2]},
             {SF_CSR_WEIGHT_ADDRESS, r->weight_address},
             {SF_CSR_BIAS, r->bias}};
  for (size_t i = 0; i < sizeof all / sizeof *all; i++)
    if (all[i].offset == offset) return all[i].value;
  const uint32_t *table = layer_register(r, offset);
  return table ? *table : 0;
}

/* ---- both ---- */

static uint32_t get(sf_dut *dut, uint32_t offset)
{
  return dut->bus.read(dut->bus.context, offset);
}

static void write_both(sf_dut *dut, registers *r, uint32_t offset, uint32_t value)
{
  dut->bus.write(dut->bus.context, offset, value);
  const uint32_t error = model_write(r, offset, value);
  ck_assert_msg(!dut->bus_hung && dut->bus_response == (error ? 2 : 0), "%x to %x: response %d, expected errors %x",
                value, offset, dut->bus_response, error);
  sf_dut_tick(dut);
  ck_assert_msg(dut->out.irq == ((r->irq_pending & r->irq_enable) != 0), "%x to %x: interrupt %d", value, offset,
                dut->out.irq);
}

static void read_both(sf_dut *dut, registers *r, uint32_t offset)
{
  const uint32_t actual = get(dut, offset), expected = model_read(r, offset);
  ck_assert_msg(actual == expected, "%x reads %x, expected %x", offset, actual, expected);
  ck_assert_uint_eq(dut->out.rresp, 0);
}

static sf_dut *begin(registers *r, uint64_t seed)
{
  sf_dut *dut;
  ck_ok(sf_dut_open_bare(&dut, &(sf_dut_options){.seed = seed, .stall_percent = 20}));
  while (get(dut, SF_CSR_STATUS) & SF_CSR_STATUS_COUNTERS) continue; /* the walk after power-on */
  *r = (registers){.irq_pending = SF_CSR_IRQ_ENABLE_COUNTERS};
  read_both(dut, r, SF_CSR_IRQ_PENDING);
  return dut;
}

/* A value at or beside a limit of some register, or beside the value that is there. */
static uint32_t near_a_limit(random_source *s, uint32_t now)
{
  static const uint32_t limit[] = {0, 3, 8, 15, 16, 32, 128, 160, 256, 512, 4096, 8192, 1 << 16, 1 << 23, 1u << 31};
  const uint32_t beside = (uint32_t)draw(s, -1, 1);
  if (draw(s, 0, 3) == 0) return now + beside;
  if (draw(s, 0, 7) == 0) return now | 1u << draw(s, 0, 31);
  return limit[draw(s, 0, sizeof limit / sizeof *limit - 1)] + beside;
}

/* ---- the check at start ---- */

static uint32_t size_of(random_source *s, uint32_t most)
{
  const int64_t kind = draw(s, 0, 3);
  return kind == 0 ? 1 : kind == 1 ? most : (uint32_t)draw(s, 1, most);
}

static void put_layer(sf_dut *dut, registers *r, int layer, const uint32_t value[KINDS])
{
  for (int kind = 0; kind < KINDS; kind++)
    write_both(dut, r, SF_CSR_D1_N_IN + (uint32_t)(LAYER_STRIDE * layer + 4 * kind), value[kind]);
}

/* A legal net, often at its limits. */
static void program_legal(sf_dut *dut, registers *r, random_source *s)
{
  const bool decoder = draw(s, 0, 2) == 0;
  const uint32_t d1 = decoder ? 0 : size_of(s, SF_LANES), c1 = size_of(s, SF_LANES), c2 = size_of(s, SF_LANES);
  const uint32_t d2 = decoder ? 0 : size_of(s, SF_OUT_MAX);
  const uint32_t dir = draw(s, 0, 1) ? (uint32_t)draw(s, 0, 1) * FX_SH : (uint32_t)draw(s, 0, FX_SH);
  const uint32_t c1_in = decoder ? size_of(s, SF_DIR_MAX) : d2 - 1 + dir;
  const uint32_t n[SF_LAYERS][2] = {
      {decoder ? 0 : size_of(s, SF_FEATURE_MAX), d1}, {d1, d2}, {c1_in ? c1_in : 1, c1}, {c1, c2}, {c2, 3}};
  for (int l = 0; l < SF_LAYERS; l++) {
    const uint32_t leak = size_of(s, LEAK_ONE), theta = size_of(s, (1 << 23) - 1);
    put_layer(dut, r, l, (uint32_t[]){n[l][0], n[l][1], leak, l == FX_D2 || l == FX_C3 ? 0 : theta});
  }
  write_both(dut, r, SF_CSR_MODE, (uint32_t)draw(s, 0, 2));
  write_both(dut, r, SF_CSR_STEPS, size_of(s, SF_T_MAX));
  for (uint32_t offset = SF_CSR_EXP_MUL; offset <= SF_CSR_SIGMOID_BIAS; offset += 4)
    write_both(dut, r, offset, size_of(s, offset == SF_CSR_EXP_SHIFT || offset == SF_CSR_SIGMOID_SHIFT ? 31 : 65535));
  write_both(dut, r, SF_CSR_BIAS, draw(s, 0, 1) ? 0x307ff : 0);
}

/* Sizes that have to agree: they go over a limit together. 0: no partner. */
static uint32_t partner(uint32_t offset)
{
  switch (offset) {
  case SF_CSR_D1_N_OUT:
    return SF_CSR_D2_N_IN;
  case SF_CSR_C1_N_OUT:
    return SF_CSR_C2_N_IN;
  case SF_CSR_C2_N_OUT:
    return SF_CSR_C3_N_IN;
  default:
    return 0;
  }
}

static void start_both(sf_dut *dut, registers *r)
{
  write_both(dut, r, SF_CSR_CTRL, SF_CSR_CTRL_START);
  read_both(dut, r, SF_CSR_ERROR);
  read_both(dut, r, SF_CSR_STATUS);
  write_both(dut, r, SF_CSR_CTRL, SF_CSR_CTRL_SOFT_RESET);
}

START_TEST(the_check_at_start)
{
  random_source s = {80 + (uint64_t)_i, 0};
  registers r;
  sf_dut *dut = begin(&r, s.seed);
  int legal = 0;
  for (int i = 0; i < TRIALS; i++) {
    if (i % 25 == 0) {
      program_legal(dut, &r, &s);
      ck_assert_uint_eq(start_errors(&r), 0);
      start_both(dut, &r);
    }
    const registers before = r;
    uint32_t offset = SF_CSR_MODE + 4 * (uint32_t)draw(&s, 0, (SF_CSR_C3_THETA - SF_CSR_MODE) / 4);
    if (draw(&s, 0, 15) == 0) offset = SF_CSR_BIAS;
    const uint32_t value = near_a_limit(&s, model_read(&r, offset)), other = partner(offset);
    write_both(dut, &r, offset, value);
    if (other && draw(&s, 0, 2)) write_both(dut, &r, other, value);
    legal += start_errors(&r) == 0;
    start_both(dut, &r);
    registers was = before;
    write_both(dut, &r, offset, model_read(&was, offset));
    if (other) write_both(dut, &r, other, model_read(&was, other));
  }
  ck_assert_int_gt(legal, TRIALS / 20);
  ck_assert_int_lt(legal, TRIALS - TRIALS / 20);
  sf_dut_close(dut);
}
END_TEST

/* ---- any access in any state ---- */

static void random_command(sf_dut *dut, registers *r, random_source *s)
{
  static const uint32_t often[] = {SF_CSR_CTRL_START, SF_CSR_CTRL_SOFT_RESET,
                                   SF_CSR_CTRL_START | SF_CSR_CTRL_SOFT_RESET};
  const uint32_t walk = draw(s, 0, 19) ? 0 : draw(s, 0, 1) ? SF_CSR_CTRL_CLEAR : SF_CSR_CTRL_SNAPSHOT;
  write_both(dut, r, SF_CSR_CTRL, often[draw(s, 0, 2)] | walk | (uint32_t)draw(s, 0, 1) << 31);
  if (!walk) return;
  ck_assert_uint_ne(get(dut, SF_CSR_STATUS) & SF_CSR_STATUS_COUNTERS, 0);
  read_both(dut, r, SF_CSR_IRQ_PENDING); /* not before its end */
  while (get(dut, SF_CSR_STATUS) & SF_CSR_STATUS_COUNTERS) continue;
  r->irq_pending |= SF_CSR_IRQ_ENABLE_COUNTERS;
}

static void random_weight(sf_dut *dut, registers *r, random_source *s)
{
  static const uint32_t rows[] = {0, 31, 32, 127, 128, 159, 160, 161, 255}, words[] = {0, 3, 4, 31};
  const uint32_t row = draw(s, 0, 3) ? rows[draw(s, 0, 8)] : (uint32_t)draw(s, 0, 255);
  const uint32_t address = (uint32_t)draw(s, 0, 7) << SF_CSR_WEIGHT_ADDRESS_LAYER_LSB |
                           row << SF_CSR_WEIGHT_ADDRESS_ROW_LSB | words[draw(s, 0, 3)];
  uint32_t weights = 0;
  for (int byte = 0; byte < 4; byte++)
    weights |= (uint32_t)(draw(s, 0, 11) ? draw(s, 0, 127) : draw(s, 127, 129)) << 8 * byte;
  write_both(dut, r, SF_CSR_WEIGHT_ADDRESS, address);
  write_both(dut, r, SF_CSR_WEIGHT_DATA, weights);
  read_both(dut, r, SF_CSR_WEIGHT_ADDRESS);
}

START_TEST(any_access_in_any_state)
{
  random_source s = {90 + (uint64_t)_i, 0};
  registers r;
  sf_dut *dut = begin(&r, s.seed);
  program_legal(dut, &r, &s);
  int running = 0;
  for (int i = 0; i < ACCESSES; i++) {
    const int64_t kind = draw(&s, 0, 99);
    const uint32_t offset = 4 * (uint32_t)draw(&s, 0, draw(&s, 0, 9) ? SF_CSR_BIAS / 4 + 1 : 0x7ff);
    running += r.running;
    if (kind < 40) {
      read_both(dut, &r, offset < SF_CSR_COUNTERS ? offset : 0);
    } else if (kind < 55) {
      random_command(dut, &r, &s);
    } else if (kind < 60) {
      random_weight(dut, &r, &s);
    } else if (kind < 62) {
      if (!r.running) program_legal(dut, &r, &s);
    } else if (offset != SF_CSR_CTRL) {
      write_both(dut, &r, offset, near_a_limit(&s, model_read(&r, offset)));
      if (offset < SF_CSR_COUNTERS) read_both(dut, &r, offset);
    }
  }
  ck_assert_int_gt(running, ACCESSES / 10);
  sf_dut_close(dut);
}
END_TEST

int main(void)
{
  Suite *suite = suite_create("rtl_registers");
  TCase *c = tcase_create("registers");
  tcase_set_timeout(c, 60);
  tcase_add_loop_test(c, the_check_at_start, 0, 3);
  tcase_add_loop_test(c, any_access_in_any_state, 0, 2);
  suite_add_tcase(suite, c);
  SRunner *runner = srunner_create(suite);
  srunner_run_all(runner, CK_ENV);
  const int failed = srunner_ntests_failed(runner);
  srunner_free(runner);
  return failed != 0;
}
