/* The accelerator's ports: illegal programming, bad packets, soft reset, counters, the driver. */
#include "ck_run.h"
#include "firmware/sf_blob.h"
#include "tests/rtl_fixture.h"
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

/* ---- registers ---- */

static uint32_t get(sf_dut *dut, uint32_t offset)
{
  return dut->bus.read(dut->bus.context, offset);
}
static void put(sf_dut *dut, uint32_t offset, uint32_t value)
{
  dut->bus.write(dut->bus.context, offset, value);
}

/* After trouble: soft reset and a new load make it work again, with the right results and counts. */
static void recovers(sf_dut *dut)
{
  typical(44);
  fx_counts counts = {0};
  dut->in.s_valid = dut->in.m_ready = false;
  ck_ok(sf_dut_load(dut, &net_of_test.net));
  ck_assert_uint_eq(get(dut, SF_CSR_ERROR), 0);
  sf_dut_tick(dut);
  ck_assert(!dut->out.irq);
  run_batch(dut, &net_of_test.net, 4, &counts, 44);
  same_counts(dut, &counts, 44);
}

static void expect_error(sf_dut *dut, uint32_t bit)
{
  ck_assert_uint_eq(get(dut, SF_CSR_ERROR), bit);
  ck_assert_uint_eq(get(dut, SF_CSR_IRQ_PENDING) & SF_CSR_IRQ_ENABLE_ERROR, SF_CSR_IRQ_ENABLE_ERROR);
  ck_assert(dut->out.irq);
  ck_assert(!dut->bus_hung);
}

TEST(illegal_programming_is_refused)
{
  enum { MORE = SF_LANES + 1, LESS = SF_LANES - 1 };
  static const struct {
    uint32_t offset, value, error;
  } bad[] = {{SF_CSR_STEPS, 0, SF_CSR_ERROR_STEPS},         {SF_CSR_STEPS, 9, SF_CSR_ERROR_STEPS},
             {SF_CSR_STEPS, 17, SF_CSR_ERROR_STEPS},        {SF_CSR_MODE, 3, SF_CSR_ERROR_MODE},
             {SF_CSR_MODE, 4, SF_CSR_ERROR_MODE},           {SF_CSR_D1_K, 4097, SF_CSR_ERROR_LEAK},
             {SF_CSR_D2_K, 1u << 16, SF_CSR_ERROR_LEAK},    {SF_CSR_C1_K, 8191, SF_CSR_ERROR_LEAK},
             {SF_CSR_C2_K, ~0u, SF_CSR_ERROR_LEAK},         {SF_CSR_C3_K, 4097, SF_CSR_ERROR_LEAK},
             {SF_CSR_D1_THETA, 0, SF_CSR_ERROR_THETA},      {SF_CSR_C1_THETA, 1u << 23, SF_CSR_ERROR_THETA},
             {SF_CSR_C2_THETA, ~0u, SF_CSR_ERROR_THETA},    {SF_CSR_D1_N_IN, 0, SF_CSR_ERROR_SIZE},
             {SF_CSR_D1_N_IN, 33, SF_CSR_ERROR_SIZE},       {SF_CSR_D1_N_IN, 512 + 32, SF_CSR_ERROR_SIZE},
             {SF_CSR_D1_N_OUT, MORE, SF_CSR_ERROR_SIZE},    {SF_CSR_D1_N_OUT, LESS, SF_CSR_ERROR_SIZE},
             {SF_CSR_D2_N_OUT, 17, SF_CSR_ERROR_SIZE},      {SF_CSR_D2_N_OUT, 0, SF_CSR_ERROR_SIZE},
             {SF_CSR_C1_N_IN, 32, SF_CSR_ERROR_SIZE},       {SF_CSR_C1_N_IN, 14, SF_CSR_ERROR_SIZE},
             {SF_CSR_C1_N_OUT, 1, SF_CSR_ERROR_SIZE},       {SF_CSR_C2_N_IN, LESS, SF_CSR_ERROR_SIZE},
             {SF_CSR_C2_N_OUT, 200, SF_CSR_ERROR_SIZE},     {SF_CSR_C3_N_IN, 0, SF_CSR_ERROR_SIZE},
             {SF_CSR_C3_N_OUT, 4, SF_CSR_ERROR_SIZE},       {SF_CSR_EXP_MUL, 65536, SF_CSR_ERROR_SCALE},
             {SF_CSR_EXP_SHIFT, 32, SF_CSR_ERROR_SCALE},    {SF_CSR_SIGMOID_MUL, ~0u, SF_CSR_ERROR_SCALE},
             {SF_CSR_SIGMOID_SHIFT, 64, SF_CSR_ERROR_SCALE}};
  typical(45);
  const sf_net_blob blob = sf_dut_blob(&net_of_test.net);
  sf_dut *dut = open_dut(&net_of_test.net, 11, 20);
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    sf_driver_reset(&dut->bus);
    ck_assert_int_eq(sf_driver_program(&dut->bus, &blob), SF_DRIVER_OK);
    put(dut, bad[i].offset, bad[i].value);
    ck_assert_int_eq(sf_driver_start(&dut->bus), SF_DRIVER_REFUSED);
    ck_assert_uint_eq(dut->bus_response, 2); /* SLVERR */
    expect_error(dut, bad[i].error);
    ck_assert_uint_eq(get(dut, SF_CSR_STATUS) & SF_CSR_STATUS_RUNNING, 0);
    dut->in.s_valid = true; /* nothing is accepted */
    for (int cycle = 0; cycle < 20; cycle++) {
      sf_dut_tick(dut);
      ck_assert(!dut->out.s_ready);
    }
    dut->in.s_valid = false;
  }
  recovers(dut);
  sf_dut_close(dut);
}

TEST(programming_while_running_is_refused)
{
  typical(46);
  fx_counts counts = {0};
  sf_dut *dut = open_dut(&net_of_test.net, 12, 0);
  put(dut, SF_CSR_STEPS, 1);
  expect_error(dut, SF_CSR_ERROR_BUSY);
  ck_assert_uint_eq(get(dut, SF_CSR_STEPS), (uint32_t)net_of_test.net.steps);
  put(dut, SF_CSR_ERROR, SF_CSR_ERROR_BUSY);
  put(dut, SF_CSR_WEIGHT_DATA, 0x01020304);
  expect_error(dut, SF_CSR_ERROR_BUSY);
  put(dut, SF_CSR_ERROR, SF_CSR_ERROR_BUSY);
  put(dut, SF_CSR_CTRL, SF_CSR_CTRL_START);
  expect_error(dut, SF_CSR_ERROR_BUSY);
  put(dut, SF_CSR_ERROR, SF_CSR_ERROR_BUSY);
  put(dut, SF_CSR_IRQ_PENDING, SF_CSR_IRQ_ENABLE_ERROR);
  run_batch(dut, &net_of_test.net, 8, &counts, 46); /* and it did no harm */
  same_counts(dut, &counts, 46);
  sf_dut_close(dut);
}

TEST(weights_and_addresses_are_checked)
{
  typical(47);
  sf_dut *dut = open_dut(&net_of_test.net, 13, 0);
  enum { ROW = SF_CSR_WEIGHT_ADDRESS_ROW_LSB, BIAS = SF_BIAS_ROW << ROW, LAYER = SF_CSR_WEIGHT_ADDRESS_LAYER_LSB };
  enum { LAST = (SF_LANES - 1) << ROW, BEHIND = BIAS + (1 << ROW), TOP = 511 << ROW };
  enum { NO_ROW = SF_LANES < SF_BIAS_ROW ? SF_LANES << ROW : BEHIND, NO_WORD = SF_LANES < 256 ? SF_LANES / 4 : BIAS };
  static const uint32_t address[] = {5u << LAYER,
                                     7u << LAYER | LAST,
                                     1u << LAYER | 4,
                                     4u << LAYER | 31,
                                     32 << ROW,
                                     BIAS,
                                     1u << LAYER | BIAS,
                                     2u << LAYER | 160 << ROW,
                                     2u << LAYER | BEHIND,
                                     3u << LAYER | NO_ROW,
                                     4u << LAYER | TOP,
                                     NO_WORD,
                                     1u << 18};
  static const uint32_t fits[] = {31 << ROW,          1u << LAYER | LAST, 2u << LAYER | 159 << ROW,
                                  2u << LAYER | BIAS, 3u << LAYER | BIAS, 4u << LAYER | BIAS};
  for (size_t i = 0; i < sizeof fits / sizeof *fits; i++) {
    sf_driver_reset(&dut->bus);
    put(dut, SF_CSR_WEIGHT_ADDRESS, fits[i]);
    put(dut, SF_CSR_WEIGHT_DATA, 1);
    ck_assert_uint_eq(get(dut, SF_CSR_ERROR), 0);
  }
  for (size_t i = 0; i < sizeof address / sizeof *address; i++) {
    sf_driver_reset(&dut->bus);
    put(dut, SF_CSR_WEIGHT_ADDRESS, address[i]);
    for (int again = 0; again < 2; again++) { /* it does not move on to a word that fits */
      put(dut, SF_CSR_WEIGHT_DATA, 1);
      expect_error(dut, SF_CSR_ERROR_WEIGHT);
    }
  }
  for (int byte = 0; byte < 4; byte++) {
    sf_driver_reset(&dut->bus);
    put(dut, SF_CSR_WEIGHT_ADDRESS, 0);
    put(dut, SF_CSR_WEIGHT_DATA, 0x80u << 8 * byte);
    expect_error(dut, SF_CSR_ERROR_WEIGHT);
  }
  static const uint32_t nowhere[] = {SF_CSR_ID, SF_CSR_STATUS, 0x09c, 0x0fc, 0x800, SF_CSR_COUNTERS, 0x1ffc};
  for (size_t i = 0; i < sizeof nowhere / sizeof *nowhere; i++) {
    sf_driver_reset(&dut->bus);
    put(dut, nowhere[i], 1);
    ck_assert_uint_eq(dut->bus_response, 2);
    expect_error(dut, SF_CSR_ERROR_ADDRESS);
  }
  recovers(dut);
  sf_dut_close(dut);
}

/* Registers read back what was written, from the table that both sides are made of. */
TEST(registers_read_back)
{
  typical(48);
  sf_dut *dut = open_dut(&net_of_test.net, 14, 50);
  sf_driver_reset(&dut->bus);
#define SF_CSR(name, offset, access, reset, meaning)                                                                   \
  if (SF_CSR_##name >= SF_CSR_RAY_CTRL && SF_CSR_##name < SF_CSR_COUNTERS) { /* of sf_ray_top */                       \
    put(dut, SF_CSR_##name, 1);                                                                                        \
    ck_assert_uint_eq(get(dut, SF_CSR_ERROR), SF_CSR_ERROR_ADDRESS);                                                   \
    put(dut, SF_CSR_ERROR, SF_CSR_ERROR_ADDRESS);                                                                      \
  } else if (#access[0] == 'R' && #access[1] == 'W') {                                                                 \
    const uint32_t value = SF_CSR_##name == SF_CSR_MODE || SF_CSR_##name == SF_CSR_IRQ_ENABLE ? 1 : 7;                 \
    put(dut, SF_CSR_##name, value);                                                                                    \
    ck_assert_msg(get(dut, SF_CSR_##name) == value, "%s reads %u", #name, get(dut, SF_CSR_##name));                    \
  } else if (reset)                                                                                                    \
    ck_assert_uint_eq(get(dut, SF_CSR_##name), (uint32_t)(reset));
#include "spikefield/csr.def"
#undef SF_CSR
#undef SF_CSR_FIELD
  ck_assert_uint_eq(get(dut, SF_CSR_ERROR), 0);
  sf_dut_close(dut);
}

/* Registers start with random values; a hard reset gives them those of the table. */
TEST(registers_after_reset)
{
  sf_dut *dut;
  ck_ok(sf_dut_open_bare(&dut, &(sf_dut_options){.seed = 15}));
#define SF_CSR(name, offset, access, reset, meaning)                                                                   \
  if (SF_CSR_##name < SF_CSR_RAY_CTRL && #access[0] == 'R' && SF_CSR_##name != SF_CSR_STATUS)                          \
    ck_assert_msg(get(dut, SF_CSR_##name) == (uint32_t)(reset), "%s reads %u", #name, get(dut, SF_CSR_##name));
#include "spikefield/csr.def"
#undef SF_CSR
#undef SF_CSR_FIELD
  sf_dut_close(dut);
}

TEST(counters_clear_and_add_up)
{
  typical(49);
  fx_counts counts = {0}, zero = {0};
  sf_dut *dut = open_dut(&net_of_test.net, 15, 30);
  for (int i = 0; i < 3; i++) {
    run_batch(dut, &net_of_test.net, 5, &counts, 49);
    same_counts(dut, &counts, 49);
  }
  ck_ok(sf_dut_clear_counts(dut));
  same_counts(dut, &zero, 49);
  /* Snapshot and clear in one command, snapshot first. */
  fx_counts more = {0};
  run_batch(dut, &net_of_test.net, 2, &more, 49);
  put(dut, SF_CSR_CTRL, SF_CSR_CTRL_CLEAR | SF_CSR_CTRL_SNAPSHOT);
  while (get(dut, SF_CSR_STATUS) & SF_CSR_STATUS_COUNTERS) continue;
  ck_assert_uint_eq(get(dut, SF_CSR_COUNTERS), more.layer[FX_D1].mac[0]);
  ck_assert_uint_ne(get(dut, SF_CSR_IRQ_PENDING) & SF_CSR_IRQ_ENABLE_COUNTERS, 0);
  same_counts(dut, &zero, 49);
  sf_dut_close(dut);
}

/* ---- packets ---- */

typedef enum { SHORT, LONG, NO_DIRECTION, WIDE_VALUE, BAD_PACKETS } bad_packet;

static void send_bad(sf_dut *dut, bad_packet kind)
{
  uint64_t words[SF_PACKET_MAX + 1] = {0};
  sf_dut_sample sample = shared.sample[0];
  sample.first = kind != NO_DIRECTION;
  const int beats = sf_dut_packet(&net_of_test.net, &sample, words) + (kind == LONG) - (kind == SHORT);
  if (kind == WIDE_VALUE) words[2] = 0x0800;
  for (int beat = 0; beat < beats;) {
    dut->in.s_valid = true;
    dut->in.s_data = words[beat];
    dut->in.s_user = beat == 0 && sample.first;
    dut->in.s_last = beat == beats - 1;
    const uint64_t before = dut->cycle;
    sf_dut_tick(dut);
    ck_assert_uint_lt(before, 10000000);
    beat += dut->out.s_ready;
  }
  dut->in.s_valid = false;
}

LOOP_TEST(bad_packets_are_refused, BAD_PACKETS)
{
  typical(50);
  sf_dut *dut = open_dut(&net_of_test.net, 16, 0);
  send_bad(dut, (bad_packet)_i);
  for (int i = 0; i < 2000; i++) { /* no result comes of it, and more input is swallowed */
    dut->in.m_ready = true;
    sf_dut_tick(dut);
    ck_assert(!dut->out.m_valid);
  }
  expect_error(dut, _i == WIDE_VALUE ? SF_CSR_ERROR_VALUE : SF_CSR_ERROR_PACKET);
  typical(50);
  const sf_status status = sf_dut_run(dut, shared.sample, 1, shared.result);
  ck_assert_int_eq(status.code, SF_E_DIFFERENCE);
  ck_assert(strstr(status.message, _i == WIDE_VALUE ? "VALUE" : "PACKET") != NULL);
  recovers(dut);
  sf_dut_close(dut);
}

/* Soft reset at many moments of a sample, then everything again from the start. */
TEST(soft_reset_at_any_time)
{
  typical(51);
  sf_dut *dut = open_dut(&net_of_test.net, 17, 0);
  for (int delay = 1; delay < 300; delay += 37) {
    uint64_t words[SF_PACKET_MAX];
    typical(51);
    const int beats = sf_dut_packet(&net_of_test.net, &shared.sample[0], words);
    for (int cycle = 0, beat = 0; cycle < delay; cycle++) {
      dut->in.s_valid = beat < beats;
      dut->in.s_data = words[beat < beats ? beat : 0];
      dut->in.s_user = beat == 0;
      dut->in.s_last = beat == beats - 1;
      sf_dut_tick(dut);
      if (dut->in.s_valid && dut->out.s_ready) beat++;
    }
    recovers(dut);
  }
  sf_dut_close(dut);
}

/* A bad packet in every cycle around a soft reset: one that comes beside it is dropped like any other. */
TEST(bad_packet_beside_a_soft_reset)
{
  typical(52);
  sf_dut *dut = open_dut(&net_of_test.net, 18, 0);
  sf_pins_in *in = &dut->in;
  int together = 0;
  for (int beat = 0; beat < 6; beat++)
    for (int write = 0; write < 6; write++) {
      bool written = false;
      sf_driver_reset(&dut->bus);
      ck_assert_int_eq(sf_driver_start(&dut->bus), SF_DRIVER_OK);
      in->s_data = 0x0800, in->s_user = false, in->s_last = true;
      in->awaddr = SF_CSR_CTRL, in->wdata = SF_CSR_CTRL_SOFT_RESET, in->wstrb = 0xf, in->bready = true;
      for (int cycle = 0; cycle < 12; cycle++) {
        in->s_valid = cycle == beat;
        in->awvalid = in->wvalid = !written && cycle >= write;
        sf_dut_tick(dut);
        together += in->s_valid && dut->out.s_ready && in->awvalid && dut->out.awready;
        written |= in->awvalid && dut->out.awready;
      }
      in->bready = false;
      ck_assert(written);
      ck_assert_uint_eq(get(dut, SF_CSR_ERROR), 0);
    }
  ck_assert_int_gt(together, 3);
  sf_dut_close(dut);
}

/* ---- driver ---- */

static uint32_t fake_read(void *context, uint32_t offset)
{
  const uint32_t *value = context; /* id, version, config */
  return offset == SF_CSR_ID ? value[0] : offset == SF_CSR_VERSION ? value[1] : value[2];
}

TEST(driver_refuses_another_device)
{
  uint32_t value[3] = {SF_CSR_ID_RESET, SF_CSR_VERSION_RESET, SF_CSR_CONFIG_RESET};
  const sf_bus bus = {.read = fake_read, .context = value};
  ck_assert_int_eq(sf_driver_probe(&bus), SF_DRIVER_OK);
  value[1]++; /* another minor version is fine */
  ck_assert_int_eq(sf_driver_probe(&bus), SF_DRIVER_OK);
  value[1] += 1 << 16;
  ck_assert_int_eq(sf_driver_probe(&bus), SF_DRIVER_VERSION);
  value[1] = SF_CSR_VERSION_RESET, value[2] += 1;
  ck_assert_int_eq(sf_driver_probe(&bus), SF_DRIVER_CONFIG);
  value[0] = 0;
  ck_assert_int_eq(sf_driver_probe(&bus), SF_DRIVER_NO_DEVICE);
}

static void put_word(uint8_t *block, int index, int32_t value)
{
  for (int i = 0; i < 4; i++) block[4 * index + i] = (uint8_t)((uint32_t)value >> 8 * i);
}

static uint32_t write_blob(uint8_t *block, const fx_net *net)
{
  uint32_t at = SF_BLOB_WORDS * 4;
  for (int l = 0; l < SF_LAYERS; l++) {
    const fx_layer *layer = &net->layer[l];
    const int32_t field[SF_BLOB_LAYER_WORDS] = {layer->n_in, layer->n_out, layer->k, layer->theta, layer->bias};
    for (int i = 0; i < SF_BLOB_LAYER_WORDS; i++)
      put_word(block, SF_BLOB_HEADER_WORDS + SF_BLOB_LAYER_WORDS * l + i, field[i]);
    memcpy(block + at, layer->w, (size_t)fx_layer_rows(layer) * SF_LANES);
    at += (uint32_t)fx_layer_rows(layer) * SF_LANES;
  }
  const int32_t head[] = {SF_BLOB_MAGIC,       SF_BLOB_VERSION,       (int32_t)at,         net->mode,
                          net->steps,          net->exp_in.mul,       net->exp_in.shift,   net->exp_in.bias,
                          net->sigmoid_in.mul, net->sigmoid_in.shift, net->sigmoid_in.bias};
  for (int i = 0; i < SF_BLOB_HEADER_WORDS; i++) put_word(block, i, head[i]);
  return at;
}

/* The firmware's way: from a block of memory through the driver; any cut of the block is refused. */
LOOP_TEST(net_from_memory, 2)
{
  static uint8_t block[SF_BLOB_WORDS * 4 + SF_LAYERS * SF_LANES * SF_LANES];
  random_source r = {52, 0};
  typical(52);
  if (_i) random_decoder_make(&net_of_test, &r, 150, false);
  fx_counts counts = {0};
  const uint32_t size = write_blob(block, &net_of_test.net);
  sf_net_blob net;
  for (uint32_t cut = 0; cut < size; cut += 97) ck_assert_int_eq(sf_blob_open(block, cut, &net), -1);
  ck_assert_int_eq(sf_blob_open(block, size, &net), 0);
  sf_dut *dut = open_dut(&net_of_test.net, 18, 10);
  ck_assert_int_eq(sf_driver_load(&dut->bus, &net), SF_DRIVER_OK);
  run_batch(dut, &net_of_test.net, 6, &counts, 52);
  same_counts(dut, &counts, 52);
  put_word(block, SF_BLOB_HEADER_WORDS, 1000);
  ck_assert_int_eq(sf_blob_open(block, size, &net), -1);
  sf_dut_close(dut);
}

TEST(waveform)
{
  char folder[] = "/tmp/sf_test_rtl.XXXXXX", path[64];
  ck_assert_ptr_nonnull(mkdtemp(folder));
  snprintf(path, sizeof path, "%s/a.fst", folder);
  typical(53);
  fx_counts counts = {0};
  sf_dut *dut = open_with(&(sf_dut_options){.seed = 1, .wave = path}, &net_of_test.net);
  run_batch(dut, &net_of_test.net, 2, &counts, 53);
  sf_dut_close(dut);
  struct stat info;
  ck_assert_int_eq(stat(path, &info), 0);
  ck_assert_int_gt(info.st_size, 1000);
  unlink(path);
  rmdir(folder);
  snprintf(path, sizeof path, "/nowhere/a.fst");
  const fx_scene scene = {.net = net_of_test.net};
  ck_assert_int_eq(sf_dut_open(&dut, &scene, &(sf_dut_options){.wave = path}).code, SF_E_IO);
}
