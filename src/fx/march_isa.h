/* Marching, one lattice point to a 64-bit lane. The first point is tested alone: within matter it is the next sample.
 */
#ifndef SF_FX_MARCH_ISA_H
#define SF_FX_MARCH_ISA_H
#include "src/fx/kernels.h"
#include "src/fx/march.h"
#include "src/fx/vec_isa.h"

enum { POINTS = WIDTH / 2 };

/* Bits of the cells of POINTS positions; lanes that are off read nothing and give 0. */
static INLINE uint32_t occupied_points(const uint8_t *occupancy, const vec p[3], int bits, uint32_t on)
{
  const __m128i drop = _mm_cvtsi32_si128(FX_RAY_FRAC - bits), axis = _mm_cvtsi32_si128(bits);
  const vec z = V(srl_epi64)(p[2], drop), y = V(srl_epi64)(p[1], drop), x = V(srl_epi64)(p[0], drop);
  const vec cell = V(add_epi64)(V(sll_epi64)(V(add_epi64)(V(sll_epi64)(z, axis), y), axis), x);
#if defined(__AVX512VNNI__)
  const __m256i word =
      _mm512_mask_i64gather_epi32(_mm256_setzero_si256(), (__mmask8)on, _mm512_srli_epi64(cell, 5), occupancy, 4);
  const __m256i bit = _mm256_and_si256(_mm512_cvtepi64_epi32(cell), _mm256_set1_epi32(31));
  return _mm256_movepi32_mask(_mm256_sllv_epi32(word, _mm256_sub_epi32(_mm256_set1_epi32(31), bit)));
#else
  const vec lanes =
      _mm256_cmpgt_epi64(_mm256_and_si256(_mm256_set1_epi64x(on), _mm256_set_epi64x(8, 4, 2, 1)), v_set(0));
  const vec word =
      _mm256_mask_i64gather_epi64(v_set(0), (const long long *)occupancy, _mm256_srli_epi64(cell, 6), lanes, 8);
  const vec bit = _mm256_and_si256(cell, v_set64(63));
  return (uint32_t)_mm256_movemask_pd(_mm256_castsi256_pd(_mm256_sllv_epi64(word, _mm256_sub_epi64(v_set64(63), bit))));
#endif
}

/* Point by point: cascades or growing steps. */
static int32_t march_cascades(const fx_scene *scene, const fx_ray *ray, int32_t n)
{
  for (; n < ray->count; n++) {
    int64_t p[3];
    for (int axis = 0; axis < 3; axis++) p[axis] = fx_ray_at(scene, ray, n, axis);
    if (fx_occupied(scene, p, n)) return n;
  }
  return ray->count;
}

static int32_t march(const fx_scene *scene, const fx_ray *ray, int32_t n)
{
  const int bits = __builtin_ctz((unsigned)scene->occ_res);
  int64_t from[3];
  vec p[3], stride[3];
  if (n >= ray->count) return ray->count;
  if (scene->log2_bound || scene->steps) return march_cascades(scene, ray, n);
  for (int axis = 0; axis < 3; axis++) from[axis] = ray->origin[axis] + n * ray->step[axis];
  if (fx_occupied(scene, from, n)) return n;
  n++;
  for (int axis = 0; axis < 3; axis++) {
    int64_t lane[POINTS];
    for (int i = 0; i < POINTS; i++) lane[i] = from[axis] + (1 + i) * ray->step[axis];
    p[axis] = v_load(lane);
    stride[axis] = v_set64(POINTS * ray->step[axis]);
  }
  for (; n < ray->count; n += POINTS) {
    const int rest = ray->count - n;
    const uint32_t on = rest >= POINTS ? (1u << POINTS) - 1 : (1u << rest) - 1;
    const uint32_t hit = occupied_points(scene->occupancy, p, bits, on) & on;
    if (hit) return n + __builtin_ctz(hit);
    for (int axis = 0; axis < 3; axis++) p[axis] = V(add_epi64)(p[axis], stride[axis]);
  }
  return ray->count;
}
#endif
