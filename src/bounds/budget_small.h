/* Inside src/bounds: a small field of planes and lines. */
#ifndef SF_BOUNDS_BUDGET_SMALL_H
#define SF_BOUNDS_BUDGET_SMALL_H
#include "bounds/budget_blocks.h"
#include "src/fx/tensorf.h"

enum { SMALL_FREQS = 3, SMALL_ENCODING_FRAC = FX_DIR_FRAC_MAX - 1 /* 1.0 fits int12 */ };
enum { SMALL_COMPONENTS = 4, SMALL_POINTS = 800, SMALL_FEATURES = 5 };

typedef struct small_planes {
  fx_tensorf field; /* density and appearance have the same planes and lines */
  int8_t plane[FX_PAIRS][SMALL_POINTS * SMALL_COMPONENTS], line[FX_PAIRS][SMALL_POINTS * SMALL_COMPONENTS];
  int8_t basis[FX_PAIRS * SMALL_COMPONENTS][FX_APPEARANCE_MAX];
} small_planes;

/* Component c of `components`: (c + kind) % 3 = 0: entries that alternate between the rails, the steepest field there
 * is; 1: random ones; 2: random ones at the rails. Axes of many, few and a single point. Three frequencies of
 * encodings at the finest LSB. */
void budget_make_planes(small_planes *s, int components, int kind);
/* A position: anywhere, at the ends of the box, or just before or behind the rounding of a place near a grid point. */
void budget_position(const fx_tensorf *field, uint64_t i, uint32_t pos[3]);
#endif
