/* Many samples at once: the scene's weights as the vector kernels read them, and the kernels' interface.
 * kernels_isa.c is compiled once per instruction set; the portable build calls the oracle (net.c, grid.c, march.c)
 * sample by sample, and every other build gives the same bits. */
#ifndef SF_FX_KERNELS_H
#define SF_FX_KERNELS_H
#include "src/fx/cache.h"
#include "src/fx/count.h"
#include "src/fx/scene.h"
#include "src/fx/tensorf.h"

enum { FX_BLOCK = 48 }; /* samples */
_Static_assert(SF_LANES == 128 || SF_LANES == 256, "arch.def: LANES is 128 or 256");

/* Rows are by presynaptic neuron; a row of zeros follows the last, so that lists of spikes can be padded to whole
 * groups, and after it the row of the biases. Pairs and quads: neighbouring rows interleaved, as one 32-bit lane
 * multiplies them. Tiles: of 16 neurons, one behind the other; twice: each weight for both parts of an input
 * (tiles_isa.h). Aligned: a row that crosses a cache line costs two loads. */
typedef struct fx_words {
  _Alignas(64) int16_t d1[SF_FEATURE_MAX / 2][SF_LANES][2];
  _Alignas(64) int16_t c1_h[SF_OUT_MAX / 2][SF_LANES][2];        /* by D2 current: row 0, the density's, is zero */
  _Alignas(64) int16_t c1_constant[SF_DIR_MAX / 2][SF_LANES][2]; /* of a decoder */
  _Alignas(64) int32_t c1_bias[SF_LANES], c2_bias[SF_LANES];     /* currents; c1_bias of a decoder */
  _Alignas(64) int16_t d2[SF_LANES + 2][SF_OUT_MAX];
  _Alignas(64) int8_t c2[SF_LANES + 2][SF_LANES]; /* outputs permuted, see fx_kernels.unpack_bytes */
  _Alignas(64) int8_t c3_inputs[SF_OUT_MAX][SF_LANES];
  _Alignas(64) int32_t c3_bias[SF_OUT_MAX];
  _Alignas(64) int8_t c2_quads[SF_LANES / 4][SF_LANES][4];
  _Alignas(64) int8_t d2_quads[SF_LANES / 4][SF_OUT_MAX][4], c3_quads[SF_LANES / 4][SF_OUT_MAX][4];
  _Alignas(64) uint16_t d1_twice[SF_LANES / 16][SF_FEATURE_MAX][16][2], c1_h_twice[SF_LANES / 16][SF_OUT_MAX][16][2];
  _Alignas(64) int8_t c2_tiles[SF_LANES / 16][SF_LANES / 4][16][4];
} fx_words;
enum { FX_ZERO_ROW = SF_LANES, FX_BIAS_ROW };

/* Samples side by side. Inputs: pos, or f (zero beyond the layer's inputs), and base; of a decoder constant alone (zero
 * beyond the inputs of C1). The rest is output. Slots from n on may hold anything. */
typedef struct fx_block {
  int n;
  uint32_t pos[3][FX_BLOCK]; /* Q0.24 */
  int16_t f[FX_BLOCK][SF_FEATURE_MAX];
  int16_t constant[FX_BLOCK][SF_DIR_MAX];
  const int32_t *base[FX_BLOCK]; /* [SF_LANES] each, from fx_net_direction */
  fx_out out[FX_BLOCK];
  uint64_t spikes[FX_SPIKING][SF_T_MAX][FX_BLOCK][SF_SPIKE_WORDS]; /* bitmaps of D1, C1, C2 */
  uint32_t saturated[SF_LAYERS][FX_BLOCK];                         /* events */
  uint32_t fired[FX_SPIKING][FX_BLOCK];                            /* spikes of all steps */
  fx_firing firing;                                                /* of the block */
} fx_block;

/* Fills fired and firing from spikes, word by word; here, so that every instruction set counts bits with its own
 * instruction. */
static inline void fx_block_count(fx_block *b, int steps)
{
  const int words = b->n * SF_SPIKE_WORDS;
  b->firing = (fx_firing){.samples = (uint64_t)b->n};
  for (int l = 0; l < FX_SPIKING; l++) {
    uint64_t seen[FX_BLOCK * SF_SPIKE_WORDS] = {0}, sum[FX_BLOCK * SF_SPIKE_WORDS] = {0};
    for (int t = 0; t < steps; t++) {
      const uint64_t *now = b->spikes[l][t][0];
      uint64_t spikes = 0, fresh = 0;
      for (int w = 0; w < words; w++) {
        const uint64_t fired = (uint64_t)__builtin_popcountll(now[w]);
        fresh += (uint64_t)__builtin_popcountll(now[w] & ~seen[w]);
        seen[w] |= now[w];
        sum[w] += fired;
        spikes += fired;
      }
      b->firing.spikes[l][t] = spikes;
      b->firing.fresh[l][t] = fresh;
    }
    for (int i = 0; i < b->n; i++) {
      b->fired[l][i] = 0;
      for (int w = 0; w < SF_SPIKE_WORDS; w++) b->fired[l][i] += (uint32_t)sum[i * SF_SPIKE_WORDS + w];
    }
  }
}

/* The neurons of D1, C1, C2 that fired at any step of a sample. */
typedef struct fx_fired {
  uint64_t neurons[FX_SPIKING][SF_SPIKE_WORDS];
} fx_fired;

static inline fx_fired fx_block_fired(const fx_block *b, int i, int steps)
{
  fx_fired fired = {0};
  for (int s = 0; s < FX_SPIKING; s++)
    for (int t = 0; t < steps; t++)
      for (int w = 0; w < SF_SPIKE_WORDS; w++) fired.neurons[s][w] |= b->spikes[s][t][i][w];
  return fired;
}

/* Working memory of one thread: what all steps of a block's layer need at once. Membranes stay in registers. */
typedef struct fx_scratch {
  _Alignas(64) int16_t d2_current[SF_T_MAX][FX_BLOCK][SF_OUT_MAX];
  _Alignas(64) int16_t c2_current[SF_T_MAX][FX_BLOCK][SF_LANES];
  _Alignas(64) int32_t
      argument[SF_T_MAX][4][FX_BLOCK]; /* of the density and the colours; of radix at step 0 that of all steps */
  uint32_t acc[4][FX_BLOCK];           /* density, red, green, blue */
  /* of tiles: inputs as rows of bytes, sums of 16 neurons */
  _Alignas(64) uint8_t x[SF_T_MAX * FX_BLOCK][SF_LANES];
  _Alignas(64) int32_t sum[SF_T_MAX * FX_BLOCK][16];
} fx_scratch;

typedef struct fx_kernels {
  const char *name;
  /* Bytes of a vector. c2 is read in vectors of 8-bit lanes, and the low, then the high eight of each 16 are widened:
   * the outputs of one vector are stored so that the widened halves are in order. */
  int unpack_bytes;
  /* Both nets through all steps: all outputs of samples 0..n-1. */
  void (*nets)(const fx_core *core, fx_block *block, fx_scratch *scratch);
  /* f of pos, samples 0..n-1; returns the number of saturations. */
  uint64_t (*features)(const fx_grid *grid, fx_block *block);
  /* The first lattice point >= n whose cell is occupied, or ray->count. */
  int32_t (*march)(const fx_scene *scene, const fx_ray *ray, int32_t n);
  const fx_vm *vm; /* of a TensoRF scene */
  /* fx_grid_lines and fx_cache_look_up. */
  int (*lines)(const fx_places *places, const uint32_t pos[3], uint32_t list[FX_LOOKUPS_ROOM]);
  uint64_t (*look_up)(fx_cache *cache, const uint32_t *line, int n);
} fx_kernels;

struct fx_core {
  fx_words words; /* first: aligned to a cache line */
  const fx_scene *scene;
  const fx_kernels *kernels;
};

/* "portable", "avx2", "avx512vnni", "amx", or NULL for the best of this CPU; NULL when CPU or build lacks it. */
const fx_kernels *fx_kernels_select(const char *name);
#endif
