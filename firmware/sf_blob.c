#include "firmware/sf_blob.h"

static int32_t word(const uint8_t *block, uint32_t index)
{
  const uint8_t *b = block + index * 4;
  return (int32_t)((uint32_t)b[0] | (uint32_t)b[1] << 8 | (uint32_t)b[2] << 16 | (uint32_t)b[3] << 24);
}

static int in_memory(const sf_layer_blob *layer)
{
  return layer->n_in >= 0 && layer->n_in <= SF_DRIVER_INPUTS && layer->n_out >= 0 && layer->n_out <= SF_LANES;
}

int sf_blob_open(const uint8_t *block, uint32_t size, sf_net_blob *net)
{
  uint32_t at = SF_BLOB_WORDS * 4;
  if (size < at || word(block, 0) != SF_BLOB_MAGIC || word(block, 1) != SF_BLOB_VERSION) return -1;
  if ((uint32_t)word(block, 2) > size) return -1;
  net->mode = word(block, 3);
  net->steps = word(block, 4);
  net->exp_in = (sf_scale_blob){word(block, 5), word(block, 6), word(block, 7)};
  net->sigmoid_in = (sf_scale_blob){word(block, 8), word(block, 9), word(block, 10)};
  for (uint32_t l = 0; l < SF_LAYERS; l++) {
    const uint32_t w = SF_BLOB_HEADER_WORDS + l * SF_BLOB_LAYER_WORDS;
    sf_layer_blob *layer = &net->layer[l];
    *layer = (sf_layer_blob){word(block, w),     word(block, w + 1), word(block, w + 2),
                             word(block, w + 3), word(block, w + 4), (const int8_t *)block + at};
    if (!in_memory(layer)) return -1;
    at += ((uint32_t)layer->n_in + (layer->bias != 0)) * SF_LANES;
  }
  return at == (uint32_t)word(block, 2) ? 0 : -1;
}
