/* The accelerator's registers as csr.def describes them: what a write does and refuses, what reads back. */
#ifndef SF_TESTS_REGISTER_MODEL_H
#define SF_TESTS_REGISTER_MODEL_H
#include "firmware/sf_driver.h"
#include "fx/fx.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { LAYER_STRIDE = SF_CSR_D2_N_IN - SF_CSR_D1_N_IN, KINDS = 4, LEAK_ONE = 1 << SF_LEAK_FRAC };
enum { N_IN, N_OUT, K, THETA }; /* registers of a layer */

/* As they read. A value that does not fit is kept as an illegal one, so that the check at start sees it. */
typedef struct registers {
  bool running;
  uint32_t error, irq_enable, irq_pending;
  uint32_t mode, steps, exp[3], sigmoid[3]; /* multiplier, shift, bias */
  uint32_t layer[SF_LAYERS][KINDS];
  uint32_t weight_address, bias;
} registers;

static inline uint32_t fitted(uint32_t value, int bits, uint32_t illegal)
{
  return value >> bits ? illegal : value;
}

static inline uint32_t *layer_register(registers *r, uint32_t offset)
{
  if (offset < SF_CSR_D1_N_IN || offset > SF_CSR_C3_THETA) return NULL;
  const uint32_t at = offset - SF_CSR_D1_N_IN;
  return &r->layer[at / LAYER_STRIDE][at % LAYER_STRIDE / 4];
}

static inline uint32_t layer_value(uint32_t offset, uint32_t value)
{
  switch (offset % LAYER_STRIDE / 4) {
  case K:
    return fitted(value, 13, 0x1fff);
  case THETA:
    return fitted(value, 23, 0);
  default:
    return fitted(value, 9, 0x1ff);
  }
}

static inline bool outside(uint32_t value, uint32_t low, uint32_t high)
{
  return value < low || value > high;
}

static inline bool bad_size(const registers *r)
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

static inline uint32_t start_errors(const registers *r)
{
  uint32_t error = bad_size(r) ? SF_CSR_ERROR_SIZE : 0;
  if (outside(r->steps, 1, SF_T_MAX)) error |= SF_CSR_ERROR_STEPS;
  for (int l = 0; l < SF_LAYERS; l++) {
    const bool spikes = l == FX_C1 || l == FX_C2 || (l == FX_D1 && r->layer[FX_D1][N_OUT]);
    if (r->layer[l][K] > LEAK_ONE) error |= SF_CSR_ERROR_LEAK;
    if (spikes && (!r->layer[l][THETA] || (r->mode == FX_RADIX && r->layer[l][THETA] >> 22)))
      error |= SF_CSR_ERROR_THETA;
  }
  if (r->mode > FX_RADIX) error |= SF_CSR_ERROR_MODE;
  if (r->exp[0] > 65535 || r->sigmoid[0] > 65535 || r->exp[1] > 31 || r->sigmoid[1] > 31) error |= SF_CSR_ERROR_SCALE;
  return error;
}

static inline bool weight_fits(uint32_t address, uint32_t weights)
{
  const uint32_t layer = address >> SF_CSR_WEIGHT_ADDRESS_LAYER_LSB, word = address & 63;
  const uint32_t row = address >> SF_CSR_WEIGHT_ADDRESS_ROW_LSB & 511;
  static const uint32_t rows[] = {SF_FEATURE_MAX, SF_LANES, SF_DIR_MAX, SF_LANES, SF_LANES};
  for (int byte = 0; byte < 4; byte++)
    if ((weights >> 8 * byte & 255) == 0x80) return false;
  if (layer >= SF_LAYERS) return false;
  if (word >= (layer == FX_D2 || layer == FX_C3 ? SF_OUT_MAX : SF_LANES) / 4) return false;
  return row < rows[layer] || (layer >= FX_C1 && row == SF_BIAS_ROW);
}

static inline uint32_t command(registers *r, uint32_t value)
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
static inline uint32_t programmed(registers *r, uint32_t offset, uint32_t value)
{
  const uint32_t known_bias = SF_CSR_BIAS_C1 | SF_CSR_BIAS_C2 | SF_CSR_BIAS_C3;
  uint32_t *const table = layer_register(r, offset);
  if (table) *table = layer_value(offset, value);
  if (offset == SF_CSR_MODE) r->mode = fitted(value, 2, 4);
  if (offset == SF_CSR_STEPS) r->steps = fitted(value, 4, 15);
  if (offset == SF_CSR_EXP_MUL) r->exp[0] = fitted(value, 16, 1u << 16);
  if (offset == SF_CSR_EXP_SHIFT) r->exp[1] = fitted(value, 5, 32);
  if (offset == SF_CSR_EXP_BIAS) r->exp[2] = value;
  if (offset == SF_CSR_SIGMOID_MUL) r->sigmoid[0] = fitted(value, 16, 1u << 16);
  if (offset == SF_CSR_SIGMOID_SHIFT) r->sigmoid[1] = fitted(value, 5, 32);
  if (offset == SF_CSR_SIGMOID_BIAS) r->sigmoid[2] = value;
  if (offset == SF_CSR_BIAS) r->bias = (value & known_bias) | (value & ~known_bias ? 1u << 18 : 0);
  if (offset == SF_CSR_WEIGHT_ADDRESS) r->weight_address = fitted(value, 18, 0x3ffff);
  if (offset != SF_CSR_WEIGHT_DATA) return 0;
  if (!weight_fits(r->weight_address, value)) return SF_CSR_ERROR_WEIGHT;
  r->weight_address = (r->weight_address + 1) & 0x3ffff;
  return 0;
}

static inline uint32_t model_refuse(registers *r, uint32_t error)
{
  r->error |= error;
  if (error) r->irq_pending |= SF_CSR_IRQ_ENABLE_ERROR;
  return error;
}

/* The bits of ERROR that a write sets. */
static inline uint32_t model_write(registers *r, uint32_t offset, uint32_t value)
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
  return model_refuse(r, error);
}

static inline uint32_t model_read(registers *r, uint32_t offset)
{
  const struct {
    uint32_t offset, value;
  } all[] = {{SF_CSR_ID, SF_CSR_ID_RESET},
             {SF_CSR_VERSION, SF_CSR_VERSION_RESET},
             {SF_CSR_CONFIG, SF_CSR_CONFIG_RESET},
             {SF_CSR_ENGINE, SF_CSR_ENGINE_RESET},
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

#endif
