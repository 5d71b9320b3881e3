/* A net as one block of memory, for programs without a file system. Little-endian 32-bit words, then the weights:
 *   magic 'SFNB', version, bytes in all, mode, steps, exp mul shift bias, sigmoid mul shift bias,
 *   5 x (n_in, n_out, k, theta, bias), 5 x (n_in, and one more with a bias) * SF_LANES weights. */
#ifndef SF_FIRMWARE_SF_BLOB_H
#define SF_FIRMWARE_SF_BLOB_H
#include "firmware/sf_driver.h"

enum {
  SF_BLOB_MAGIC = 0x424e4653,
  SF_BLOB_VERSION = 2,
  SF_BLOB_HEADER_WORDS = 11,
  SF_BLOB_LAYER_WORDS = 5,
  SF_BLOB_WORDS = SF_BLOB_HEADER_WORDS + SF_LAYERS * SF_BLOB_LAYER_WORDS
};

/* Points net into the block; 0 when the block is whole, -1 when it is not a net or is cut short. */
int sf_blob_open(const uint8_t *block, uint32_t size, sf_net_blob *net);
#endif
