/* Ceilings, measured on the spot: arithmetic of every instruction set, memory, random reads. */
#include "bench.h"
#include "base/amx.h"
#include "base/clock.h"
#include "base/memory.h"
#include "base/rng.h"
#include "src/fx/core.h"
#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#if defined(__x86_64__)
#include <immintrin.h>
typedef float lanes8 __attribute__((vector_size(32)));
typedef float lanes16 __attribute__((vector_size(64)));

/* Independent chains, as many as hide the latency of the instructions; code: %0 += %2 . %3, %1 is free. */
#define CHAINS(name, isa, lanes, chains, code)                                                                         \
  __attribute__((target(isa))) static double name(long rounds)                                                         \
  {                                                                                                                    \
    lanes acc[chains], product;                                                                                        \
    for (int i = 0; i < chains; i++) acc[i] = (lanes){0} + (float)i;                                                   \
    const lanes x = (lanes){0} + 0.999f, y = (lanes){0} + 0.001f;                                                      \
    for (long r = 0; r < rounds; r++) _Pragma("GCC unroll 24") for (int i = 0; i < chains; i++)                        \
      {                                                                                                                \
        lanes z = acc[i];                                                                                              \
        __asm__ volatile(code : "+v"(z), "=&v"(product) : "v"(x), "v"(y));                                             \
        acc[i] = z;                                                                                                    \
      }                                                                                                                \
    double sum = 0;                                                                                                    \
    for (int i = 0; i < chains; i++) sum += acc[i][0];                                                                 \
    return sum;                                                                                                        \
  }
CHAINS(fma_chain_avx2, "avx2,fma", lanes8, 12, "vfmadd213ps %3, %2, %0")
CHAINS(dot_chain_avx2, "avx2", lanes8, 12, "vpmaddubsw %3, %2, %1; vpaddw %1, %0, %0") /* four 8-bit ones a lane */
CHAINS(fma_chain_avx512, "avx512f,fma", lanes16, 24, "vfmadd213ps %3, %2, %0")
CHAINS(dot_chain_avx512vnni, "avx512f,avx512vnni", lanes16, 24, "vpdpbusd %3, %2, %0")  /* the same in one */
CHAINS(dot_chain_avx512bf16, "avx512f,avx512bf16", lanes16, 24, "vdpbf16ps %3, %2, %0") /* two multiply-adds a lane */

/* Four independent 16 x 16 sums of products of 32 or 64 numbers. */
#define TILES(name, isa, multiply)                                                                                     \
  __attribute__((target(isa))) static double name(long rounds)                                                         \
  {                                                                                                                    \
    static const sf_tile_shapes shape = {                                                                              \
        .palette = 1, .bytes = {64, 64, 64, 64, 64, 64}, .rows = {16, 16, 16, 16, 16, 16}};                            \
    _tile_loadconfig(&shape);                                                                                          \
    for (long r = 0; r < rounds; r++) {                                                                                \
      multiply(0, 4, 5);                                                                                               \
      multiply(1, 4, 5);                                                                                               \
      multiply(2, 4, 5);                                                                                               \
      multiply(3, 4, 5);                                                                                               \
    }                                                                                                                  \
    _tile_release();                                                                                                   \
    return 1;                                                                                                          \
  }
TILES(tile_chain, "amx-tile,amx-bf16", _tile_dpbf16ps)
TILES(tile_chain8, "amx-tile,amx-int8", _tile_dpbusd)

/* Multiply-adds per second of all threads in the arithmetic of the named kernels. */
static double peak(const char *kernels)
{
  static const struct {
    const char *name;
    double (*chain)(long rounds);
    int per_round;
  } known[] = {{"avx2", fma_chain_avx2, 12 * 8},
               {"avx2-int8", dot_chain_avx2, 12 * 8 * 4},
               {"avx512", fma_chain_avx512, 24 * 16},
               {"avx512bf16", dot_chain_avx512bf16, 24 * 16 * 2},
               {"avx512vnni", dot_chain_avx512vnni, 24 * 16 * 4},
               {"amx", tile_chain, 4 * 16 * 16 * 32},
               {"amx-int8", tile_chain8, 4 * 16 * 16 * 64}};
  const long rounds = 10000000;
  for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
    if (strcmp(kernels, known[i].name)) continue;
    double start = sf_seconds(), sink = 0;
#pragma omp parallel reduction(+ : sink)
    sink += known[i].chain(rounds);
    const double seconds = sf_seconds() - start;
    return sink == 0.123 ? 0 : (double)rounds * known[i].per_round * omp_get_max_threads() / seconds;
  }
  return NAN;
}
#else
static double peak(const char *kernels)
{
  return kernels ? NAN : 0;
}
#endif

static double bandwidth(void)
{
  const size_t n = 1u << 26;
  float *a = malloc(n * sizeof *a);
  double sum = 0, best = 0;
  for (size_t i = 0; i < n; i++) a[i] = 1;
  for (int trial = 0; trial < 3; trial++) {
    double start = sf_seconds();
#pragma omp parallel for simd reduction(+ : sum)
    for (size_t i = 0; i < n; i++) sum += (double)a[i];
    best = fmax(best, (double)n * sizeof *a / (sf_seconds() - start));
  }
  free(a);
  return sum > 0 ? best : 0;
}

/* Reads of 8 bytes at random places of a hash-grid level (2^19 entries) per second, all threads. */
static double random_reads(void)
{
  enum { ENTRIES = 1 << 19, READS = 1 << 25 };
  const size_t bytes = ENTRIES * sizeof(uint64_t);
  uint64_t *table = sf_aligned_alloc(bytes), sum = 0;
  double start = sf_seconds();
#pragma omp parallel reduction(+ : sum)
  {
    uint32_t at[8];
    for (int i = 0; i < 8; i++) at[i] = (uint32_t)(i + 8 * omp_get_thread_num()) * 2654435761u;
    for (int r = 0; r < READS / 8; r++)
      for (int i = 0; i < 8; i++) {
        at[i] = at[i] * 1664525u + 1013904223u;
        sum += table[at[i] >> 13];
      }
  }
  const double seconds = sf_seconds() - start;
  free(table);
  return sum ? 0 : (double)READS * omp_get_max_threads() / seconds;
}

ceilings ceilings_measure(const char *kernels)
{
  const double dot8 = fx_kernels_select("avx512vnni") ? peak("avx512vnni")
                      : fx_kernels_select("avx2")     ? peak("avx2-int8")
                                                      : NAN;
  return (ceilings){peak(kernels), dot8, fx_kernels_select("amx") ? peak("amx-int8") : dot8, bandwidth(),
                    random_reads()};
}
