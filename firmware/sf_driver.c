#include "firmware/sf_driver.h"

enum { POLLS_MAX = 1000000, LAYER_STRIDE = SF_CSR_D2_N_IN - SF_CSR_D1_N_IN, GLOBAL_LAYER = 7 };
enum { WEIGHTS_PER_WORD = 4 };

static uint32_t get(const sf_bus *bus, uint32_t offset)
{
  return bus->read(bus->context, offset);
}
static void put(const sf_bus *bus, uint32_t offset, uint32_t value)
{
  bus->write(bus->context, offset, value);
}

const char *sf_driver_text(sf_driver_code code)
{
  switch (code) {
  case SF_DRIVER_OK:
    return "ok";
  case SF_DRIVER_NO_DEVICE:
    return "no accelerator at this address";
  case SF_DRIVER_VERSION:
    return "interface version differs from the driver's";
  case SF_DRIVER_CONFIG:
    return "built with other sizes than the driver";
  case SF_DRIVER_REFUSED:
    return "programming refused";
  case SF_DRIVER_TIMEOUT:
    return "no answer";
  case SF_DRIVER_MISFIT:
    return "the field's levels, directions or features are not the net's inputs";
  case SF_DRIVER_CACHE:
    return "the field's cache has another size or other ways than the program asks for";
  case SF_DRIVER_FIELD:
    return "this build of the accelerator has not the scene's kind of field (hash grid, or planes and lines)";
  }
  return "unknown code";
}

const char *sf_driver_error_text(uint32_t error)
{
#define SF_CSR(name, offset, access, reset, meaning)
#define SF_CSR_FIELD(owner, name, lsb, width, meaning)                                                                 \
  if (SF_CSR_##owner == SF_CSR_ERROR && (error & SF_CSR_##owner##_##name)) return #name ": " meaning;
#include "spikefield/csr.def"
#undef SF_CSR
#undef SF_CSR_FIELD
  return "no error";
}

sf_driver_code sf_driver_probe(const sf_bus *bus)
{
  if (get(bus, SF_CSR_ID) != SF_CSR_ID_RESET) return SF_DRIVER_NO_DEVICE;
  if (get(bus, SF_CSR_VERSION) >> 16 != SF_CSR_VERSION_RESET >> 16) return SF_DRIVER_VERSION;
  /* Fewer lanes are fine: a net that is too wide for them is refused at start. */
  const uint32_t config = get(bus, SF_CSR_CONFIG), lanes = (config & SF_CSR_CONFIG_LANES) + 1;
  if ((config ^ SF_CSR_CONFIG_RESET) & ~(uint32_t)SF_CSR_CONFIG_LANES || lanes > SF_LANES) return SF_DRIVER_CONFIG;
  return SF_DRIVER_OK;
}

static sf_driver_code error_state(const sf_bus *bus)
{
  return get(bus, SF_CSR_ERROR) ? SF_DRIVER_REFUSED : SF_DRIVER_OK;
}

void sf_driver_reset(const sf_bus *bus)
{
  put(bus, SF_CSR_CTRL, SF_CSR_CTRL_SOFT_RESET);
  put(bus, SF_CSR_IRQ_PENDING, SF_CSR_IRQ_ENABLE_ERROR | SF_CSR_IRQ_ENABLE_COUNTERS);
}

static uint32_t pack(const int8_t *w)
{
  return (uint32_t)(uint8_t)w[0] | (uint32_t)(uint8_t)w[1] << 8 | (uint32_t)(uint8_t)w[2] << 16 |
         (uint32_t)(uint8_t)w[3] << 24;
}

static void program_row(const sf_bus *bus, uint32_t id, const sf_layer_blob *layer, int32_t from, uint32_t to)
{
  const int32_t words = (layer->n_out + WEIGHTS_PER_WORD - 1) / WEIGHTS_PER_WORD;
  put(bus, SF_CSR_WEIGHT_ADDRESS, id << SF_CSR_WEIGHT_ADDRESS_LAYER_LSB | to << SF_CSR_WEIGHT_ADDRESS_ROW_LSB);
  for (int32_t word = 0; word < words; word++)
    put(bus, SF_CSR_WEIGHT_DATA, pack(layer->w + from * SF_LANES + word * WEIGHTS_PER_WORD));
}

static void program_weights(const sf_bus *bus, uint32_t id, const sf_layer_blob *layer)
{
  for (int32_t row = 0; row < layer->n_in; row++) program_row(bus, id, layer, row, (uint32_t)row);
  if (layer->bias) program_row(bus, id, layer, layer->n_in, SF_BIAS_ROW);
}

static void program_layer(const sf_bus *bus, uint32_t id, const sf_layer_blob *layer)
{
  const uint32_t base = id * LAYER_STRIDE;
  put(bus, base + SF_CSR_D1_N_IN, (uint32_t)layer->n_in);
  put(bus, base + SF_CSR_D1_N_OUT, (uint32_t)layer->n_out);
  put(bus, base + SF_CSR_D1_K, (uint32_t)layer->k);
  put(bus, base + SF_CSR_D1_THETA, (uint32_t)layer->theta);
  if (layer->n_in < 0 || layer->n_in > SF_DRIVER_INPUTS || layer->n_out < 0 || layer->n_out > SF_LANES) return;
  program_weights(bus, id, layer);
}

/* Values that do not fit, or biases of D1 and D2, set a bit that is refused at start. */
static uint32_t biases(const sf_net_blob *net)
{
  enum { D1, D2, C1, C2, C3 };
  const uint32_t c1 = (uint32_t)net->layer[C1].bias, c2 = (uint32_t)net->layer[C2].bias;
  const uint32_t c3 = (uint32_t)net->layer[C3].bias;
  if (net->layer[D1].bias || net->layer[D2].bias || c1 > SF_CSR_BIAS_C1 || c2 > 1 || c3 > 1) return UINT32_MAX;
  return c1 << SF_CSR_BIAS_C1_LSB | c2 << SF_CSR_BIAS_C2_LSB | c3 << SF_CSR_BIAS_C3_LSB;
}

sf_driver_code sf_driver_program(const sf_bus *bus, const sf_net_blob *net)
{
  put(bus, SF_CSR_MODE, (uint32_t)net->mode);
  put(bus, SF_CSR_STEPS, (uint32_t)net->steps);
  put(bus, SF_CSR_EXP_MUL, (uint32_t)net->exp_in.mul);
  put(bus, SF_CSR_EXP_SHIFT, (uint32_t)net->exp_in.shift);
  put(bus, SF_CSR_EXP_BIAS, (uint32_t)net->exp_in.bias);
  put(bus, SF_CSR_SIGMOID_MUL, (uint32_t)net->sigmoid_in.mul);
  put(bus, SF_CSR_SIGMOID_SHIFT, (uint32_t)net->sigmoid_in.shift);
  put(bus, SF_CSR_SIGMOID_BIAS, (uint32_t)net->sigmoid_in.bias);
  put(bus, SF_CSR_BIAS, biases(net));
  for (uint32_t id = 0; id < SF_LAYERS; id++) program_layer(bus, id, &net->layer[id]);
  return error_state(bus);
}

sf_driver_code sf_driver_start(const sf_bus *bus)
{
  put(bus, SF_CSR_CTRL, SF_CSR_CTRL_START);
  return error_state(bus);
}

sf_driver_code sf_driver_load(const sf_bus *bus, const sf_net_blob *net)
{
  sf_driver_reset(bus);
  const sf_driver_code code = sf_driver_program(bus, net);
  return code == SF_DRIVER_OK ? sf_driver_start(bus) : code;
}

static sf_driver_code wait_counters(const sf_bus *bus)
{
  for (int32_t i = 0; i < POLLS_MAX; i++)
    if (!(get(bus, SF_CSR_STATUS) & SF_CSR_STATUS_COUNTERS)) return SF_DRIVER_OK;
  return SF_DRIVER_TIMEOUT;
}

sf_driver_code sf_driver_clear(const sf_bus *bus)
{
  put(bus, SF_CSR_CTRL, SF_CSR_CTRL_CLEAR);
  return wait_counters(bus);
}

static uint64_t counter(const sf_bus *bus, uint32_t event, uint32_t layer, uint32_t step)
{
  const uint32_t offset = SF_CSR_COUNTERS + ((event * 8 + layer) * 8 + step) * 8;
  const uint32_t low = get(bus, offset);
  return (uint64_t)get(bus, offset + 4) << 32 | low;
}

sf_driver_code sf_driver_read_counters(const sf_bus *bus, sf_driver_counters *counters)
{
  put(bus, SF_CSR_CTRL, SF_CSR_CTRL_SNAPSHOT);
  const sf_driver_code code = wait_counters(bus);
  if (code != SF_DRIVER_OK) return code;
  for (uint32_t event = 0; event < SF_EVENTS; event++)
    for (uint32_t layer = 0; layer < SF_LAYERS; layer++)
      for (uint32_t step = 0; step < SF_T_MAX; step++)
        counters->event[event][layer][step] = counter(bus, event, layer, step);
  uint64_t *const global[] = {&counters->samples, &counters->rays,     &counters->cycles,
                              &counters->busy,    &counters->stall_in, &counters->stall_out};
  for (uint32_t i = 0; i < sizeof global / sizeof *global; i++) *global[i] = counter(bus, 0, GLOBAL_LAYER, i);
  for (uint32_t l = 0; l < SF_LAYERS; l++) counters->layer_busy[l] = counter(bus, 1, GLOBAL_LAYER, l);
  return SF_DRIVER_OK;
}
