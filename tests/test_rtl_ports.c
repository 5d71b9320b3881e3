/* The accelerator's ports: bad packets, the driver. */
#include "ck_run.h"
#include "firmware/sf_blob.h"
#include "tests/rtl_fixture.h"
#include <sys/stat.h>
#include <unistd.h>

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

/* ---- packets ---- */

typedef enum { SHORT, LONG, NO_DIRECTION, WIDE_VALUE, NO_SECOND_DIRECTION, BAD_PACKETS } bad_packet;

static void send(sf_dut *dut, const uint64_t *words, int beats, bool first)
{
  for (int beat = 0; beat < beats;) {
    dut->in.s_valid = true;
    dut->in.s_data = words[beat];
    dut->in.s_user = beat == 0 && first;
    dut->in.s_last = beat == beats - 1;
    sf_dut_tick(dut);
    ck_assert_uint_lt(dut->cycle, 10000000);
    beat += dut->out.s_ready;
  }
  dut->in.s_valid = false;
}

static void send_bad(sf_dut *dut, bad_packet kind, bool decoder)
{
  uint64_t words[SF_PACKET_MAX + 1] = {0};
  sf_dut_sample sample = shared.sample[0];
  if (kind == NO_SECOND_DIRECTION) send(dut, words, sf_dut_packet(&net_of_test.net, &sample, words), true);
  sample.first = kind != NO_DIRECTION && kind != NO_SECOND_DIRECTION;
  const int beats = sf_dut_packet(&net_of_test.net, &sample, words) + (kind == LONG) - (kind == SHORT);
  if (kind == WIDE_VALUE) words[decoder ? 39 : 2] = decoder ? (uint64_t)0x0800 << 48 : 0x0800;
  send(dut, words, beats, sample.first);
}

/* Those of a net with densities, then those of a decoder, which needs a direction with every sample. */
LOOP_TEST(bad_packets_are_refused, 2 * BAD_PACKETS - 1)
{
  const bool decoder = _i >= NO_SECOND_DIRECTION;
  const bad_packet kind = (bad_packet)(decoder ? _i - NO_SECOND_DIRECTION : _i);
  random_source r = {50, 0};
  typical(50);
  if (decoder) random_decoder_make(&net_of_test, &r, SF_DIR_MAX, false);
  OWNED(sf_dut) *dut = open_dut(&net_of_test.net, 16, 0);
  send_bad(dut, kind, decoder);
  int beats = 0; /* of results: no bad sample has one, and more input is swallowed */
  for (int cycle = 0; cycle < 2000; cycle++) {
    dut->in.m_ready = true;
    sf_dut_tick(dut);
    beats += dut->out.m_valid;
  }
  ck_assert_int_eq(beats, kind == NO_SECOND_DIRECTION ? 2 : 0);
  expect_error(dut, kind == WIDE_VALUE ? SF_CSR_ERROR_VALUE : SF_CSR_ERROR_PACKET);
  ck_bad(sf_dut_run(dut, shared.sample, 1, shared.result), SF_E_DIFFERENCE, kind == WIDE_VALUE ? "VALUE" : "PACKET",
         "");
  recovers(dut);
}

/* A bad packet in every cycle around a soft reset: one that comes beside it is dropped like any other. */
TEST(bad_packet_beside_a_soft_reset)
{
  typical(52);
  OWNED(sf_dut) *dut = open_dut(&net_of_test.net, 18, 0);
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
    const int32_t field[SF_BLOB_LAYER_WORDS] = {layer->n_in, layer->n_out, layer->k, fx_net_theta(net, l), layer->bias};
    for (int i = 0; i < SF_BLOB_LAYER_WORDS; i++)
      put_word(block, SF_BLOB_HEADER_WORDS + SF_BLOB_LAYER_WORDS * l + i, field[i]);
    memcpy(block + at, layer->w, (size_t)fx_layer_rows(layer) * SF_LANES);
    at += (uint32_t)fx_layer_rows(layer) * SF_LANES;
  }
  const fx_scale density = fx_net_scale(net, &net->exp_in), colour = fx_net_scale(net, &net->sigmoid_in);
  const int32_t head[] = {SF_BLOB_MAGIC, SF_BLOB_VERSION, (int32_t)at, net->mode,    net->steps, density.mul,
                          density.shift, density.bias,    colour.mul,  colour.shift, colour.bias};
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
  OWNED(sf_dut) *dut = open_dut(&net_of_test.net, 18, 10);
  ck_assert_int_eq(sf_driver_load(&dut->bus, &net), SF_DRIVER_OK);
  run_batch(dut, &net_of_test.net, 6, &counts, 52);
  same_counts(dut, &counts, 52);
  put_word(block, SF_BLOB_HEADER_WORDS, 1000);
  ck_assert_int_eq(sf_blob_open(block, size, &net), -1);
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
