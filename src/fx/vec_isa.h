/* Vectors of 32-bit lanes for AVX-512 VNNI and AVX2. Signed unless the name says u. */
#ifndef SF_FX_VEC_ISA_H
#define SF_FX_VEC_ISA_H
#include "base/arch.h"
#include <immintrin.h>
#include <stdint.h>
#include <string.h>

#define INLINE inline __attribute__((always_inline))
#if defined(__AMX_INT8__) || defined(__AMXINT8__) /* clang 14's name */
#define FX_TILES
#endif

#if defined(__AVX512VNNI__)
typedef __m512i vec;
enum { WIDTH = 16, TILE = 8 }; /* lanes of a vector; vectors of one sample that a tile keeps in registers */
#define V(op) _mm512_##op
#define V_BITS(op) _mm512_##op##_si512
/* Written as instructions: of the intrinsics GCC 12 makes two copies of the accumulator and a load per product. */
static INLINE vec v_dot(vec acc, vec a, vec b) /* += of both 16-bit products */
{
  __asm__("vpdpwssd %2, %1, %0" : "+v"(acc) : "v"(a), "v"(b));
  return acc;
}
enum { DOT4_BITS = 8 };                           /* of u8 that v_dot4 multiplies exactly */
static INLINE vec v_dot4(vec acc, vec u8, vec s8) /* += of four products */
{
  __asm__("vpdpbusd %2, %1, %0" : "+v"(acc) : "v"(u8), "v"(s8));
  return acc;
}
static INLINE vec v_mulhrs_low(vec x, vec d, vec k) /* low halves: (d * k + 2^14) >> 15; high halves: x */
{
  return _mm512_mask_mulhrs_epi16(x, 0x55555555, d, k);
}
static INLINE uint32_t v_fire(vec *v, vec theta) /* lanes >= theta lose it */
{
  const __mmask16 fired = _mm512_cmpge_epi32_mask(*v, theta);
  *v = _mm512_mask_sub_epi32(*v, fired, *v, theta);
  return fired;
}
static INLINE uint32_t v_differ(vec a, vec b)
{
  return _mm512_cmpneq_epi32_mask(a, b);
}
static INLINE vec v_select_negative(vec x, vec negative, vec otherwise) /* by the sign of x */
{
  return _mm512_mask_blend_epi32(_mm512_movepi32_mask(x), otherwise, negative);
}
static INLINE vec v_gather(const int32_t *table, vec index)
{
  return _mm512_i32gather_epi32(index, table, 4);
}
static INLINE vec v_set64(int64_t x)
{
  return _mm512_set1_epi64(x);
}
static INLINE vec v_widen(const int16_t *p)
{
  return _mm512_cvtepi16_epi32(_mm256_loadu_si256((const __m256i *)p));
}
static INLINE vec v_whole(vec binary32) /* numbers that are whole */
{
  return _mm512_cvtps_epi32(_mm512_castsi512_ps(binary32));
}
static INLINE void v_store_narrow(int16_t *p, vec x) /* lanes of 16 bits */
{
  _mm256_storeu_si256((__m256i *)p, _mm512_cvtepi32_epi16(x));
}
#else
typedef __m256i vec;
enum { WIDTH = 8, TILE = 4 };
#define V(op) _mm256_##op
#define V_BITS(op) _mm256_##op##_si256
static INLINE vec v_dot(vec acc, vec a, vec b)
{
  return _mm256_add_epi32(acc, _mm256_madd_epi16(a, b));
}
enum { DOT4_BITS = 7 };
static INLINE vec v_dot4(vec acc, vec u8, vec s8)
{
  return _mm256_add_epi32(acc, _mm256_madd_epi16(_mm256_maddubs_epi16(u8, s8), _mm256_set1_epi16(1)));
}
static INLINE vec v_mulhrs_low(vec x, vec d, vec k)
{
  return _mm256_blend_epi16(x, _mm256_mulhrs_epi16(d, k), 0x55);
}
static INLINE uint32_t v_bits(vec lanes)
{
  return (uint32_t)_mm256_movemask_ps(_mm256_castsi256_ps(lanes));
}
static INLINE uint32_t v_fire(vec *v, vec theta)
{
  const vec silent = _mm256_cmpgt_epi32(theta, *v);
  *v = _mm256_sub_epi32(*v, _mm256_andnot_si256(silent, theta));
  return ~v_bits(silent) & 0xff;
}
static INLINE uint32_t v_differ(vec a, vec b)
{
  return ~v_bits(_mm256_cmpeq_epi32(a, b)) & 0xff;
}
static INLINE vec v_select_negative(vec x, vec negative, vec otherwise)
{
  return _mm256_blendv_epi8(otherwise, negative, _mm256_srai_epi32(x, 31));
}
static INLINE vec v_gather(const int32_t *table, vec index)
{
  return _mm256_i32gather_epi32(table, index, 4);
}
static INLINE vec v_set64(int64_t x)
{
  return _mm256_set1_epi64x(x);
}
static INLINE vec v_widen(const int16_t *p)
{
  return _mm256_cvtepi16_epi32(_mm_loadu_si128((const __m128i *)p));
}
static INLINE vec v_whole(vec binary32)
{
  return _mm256_cvtps_epi32(_mm256_castsi256_ps(binary32));
}
static INLINE void v_store_narrow(int16_t *p, vec x)
{
  const vec halves = _mm256_permute4x64_epi64(_mm256_packs_epi32(x, x), 0x08);
  _mm_storeu_si128((__m128i *)p, _mm256_castsi256_si128(halves));
}
#endif

enum { VECTORS = SF_LANES / WIDTH }; /* of a layer */

static INLINE vec v_load(const void *p)
{
  return V_BITS(loadu)((const vec *)p);
}
static INLINE void v_store(void *p, vec x)
{
  V_BITS(storeu)((vec *)p, x);
}
static INLINE vec v_set(int32_t x)
{
  return V(set1_epi32)(x);
}
static INLINE vec v_word(const void *p) /* the 32 bits at p in every lane */
{
  int32_t word;
  memcpy(&word, p, sizeof word);
  return v_set(word);
}
static INLINE vec v_clamp(vec x, int32_t low, int32_t high)
{
  return V(max_epi32)(V(min_epi32)(x, v_set(high)), v_set(low));
}
/* v_dot4 of all 8 bits of u8: in 16 bits two products may saturate, so each stands alone. */
static INLINE vec v_dot4_whole(vec acc, vec u8, vec s8)
{
  if (DOT4_BITS == 8) return v_dot4(acc, u8, s8);
  const vec even = v_set(0x00ff00ff);
  return v_dot4(v_dot4(acc, V_BITS(and)(even, u8), s8), V_BITS(andnot)(even, u8), s8);
}
/* fx_rshift_round, arithmetic; x + 2^(n-1) must fit 32 bits. */
static INLINE vec v_shift_round(vec x, int n)
{
  return V(sra_epi32)(V(add_epi32)(x, v_set((int32_t)((1u << n) >> 1))), _mm_cvtsi32_si128(n));
}
#endif
