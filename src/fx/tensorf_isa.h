/* TensoRF's planes and lines at one position. Included once per instruction set: the compiler makes vectors of the
 * loops over components, and sums of integers do not depend on their order. Widths and equations: tensorf.c. */
#ifndef SF_FX_TENSORF_ISA_H
#define SF_FX_TENSORF_ISA_H
#include "src/fx/tensorf_place.h"

enum { VM_PRODUCT_SHIFT = 15 };

/* product[components] of one pair, Q.16. */
static void vm_pair(const fx_factors *factors, int pair, const int32_t res[3], const vm_place *p,
                    int32_t *restrict product)
{
  const int u = fx_pair_axes[pair][0], v = fx_pair_axes[pair][1], w = fx_pair_axes[pair][2];
  const int n = factors->components[pair];
  const size_t near = (size_t)p->at[v] * (size_t)res[u], far = (size_t)p->next[v] * (size_t)res[u];
  const int8_t *plane = factors->plane[pair];
  const int8_t *restrict e00 = plane + (near + (size_t)p->at[u]) * (size_t)n;
  const int8_t *restrict e10 = plane + (near + (size_t)p->next[u]) * (size_t)n;
  const int8_t *restrict e01 = plane + (far + (size_t)p->at[u]) * (size_t)n;
  const int8_t *restrict e11 = plane + (far + (size_t)p->next[u]) * (size_t)n;
  const int8_t *restrict l0 = factors->line[pair] + (size_t)p->at[w] * (size_t)n;
  const int8_t *restrict l1 = factors->line[pair] + (size_t)p->next[w] * (size_t)n;
  const int32_t g = p->g[u], h = p->g[v], k = p->g[w];
  const int32_t w00 = (VM_ONE - g) * (VM_ONE - h), w10 = g * (VM_ONE - h), w01 = (VM_ONE - g) * h, w11 = g * h;
  for (int c = 0; c < n; c++) {
    const int32_t sum = e00[c] * w00 + e10[c] * w10 + e01[c] * w01 + e11[c] * w11;
    product[c] = ((sum + VM_ONE / 2) >> VM_FRAC) * (l0[c] * (VM_ONE - k) + l1[c] * k);
  }
}

static int64_t vm_density(const fx_tensorf *field, const uint32_t pos[3])
{
  const vm_place p = vm_find(field->res, pos);
  int64_t sum = 0;
  for (int pair = 0; pair < FX_PAIRS; pair++) {
    int32_t product[FX_COMPONENTS_MAX];
    vm_pair(&field->density, pair, field->res, &p, product);
    for (int c = 0; c < field->density.components[pair]; c++) sum += product[c];
  }
  return sum;
}

static int vm_products(const fx_tensorf *field, const uint32_t pos[3], int16_t *x)
{
  const vm_place p = vm_find(field->res, pos);
  int n = 0;
  for (int pair = 0; pair < FX_PAIRS; pair++) {
    int32_t product[FX_COMPONENTS_MAX];
    vm_pair(&field->appearance, pair, field->res, &p, product);
    for (int c = 0; c < field->appearance.components[pair]; c++)
      x[n++] = (int16_t)((product[c] + (1 << (VM_PRODUCT_SHIFT - 1))) >> VM_PRODUCT_SHIFT);
  }
  return n;
}

static void vm_features(const fx_tensorf *field, const uint32_t pos[3], int32_t sum[FX_APPEARANCE_MAX])
{
  int16_t x[FX_PAIRS * FX_COMPONENTS_MAX];
  int32_t acc[FX_APPEARANCE_MAX] = {0}; /* of its own: in registers */
  const int n = vm_products(field, pos, x);
  for (int c = 0; c < n; c++) {
    const int8_t *restrict row = field->basis + (size_t)c * FX_APPEARANCE_MAX;
    for (int f = 0; f < FX_APPEARANCE_MAX; f++) acc[f] += x[c] * row[f];
  }
  for (int f = 0; f < FX_APPEARANCE_MAX; f++) sum[f] = acc[f];
}
#endif
