/* What an audit's events cost: the prices of a technology and every ledger side by side. Energies are integer
 * femtojoules; UINT64_MAX never stands in a ledger (sf_ledgers_make refuses what does not fit in 64 bits). */
#ifndef SF_ENERGY_LEDGER_H
#define SF_ENERGY_LEDGER_H
#include "fx/memory.h"
#include <cjson/cJSON.h>
#include <stdio.h>

/* ---- prices ---- */

/* One price of a technology file. `at` is what the price holds for: the width in bits of int_add, the square root of
 * the product of the operands' widths of int_multiply, the bytes of the memory of sram; 0 of the others. */
typedef struct sf_price {
  char key[40]; /* as in the file: "int_add.8" */
  uint32_t at;
  uint64_t fj;      /* per operation; of memories per access of 64 bits */
  char text[40];    /* as in the file: "0.03 pJ" */
  char source[200]; /* where the number is from */
} sf_price;

/* The families that every technology has; those with `at` hold at least two points, which are interpolated. */
typedef enum {
  SF_PRICE_FP32_MAC,     /* fp32_mac: multiply and add, per MAC */
  SF_PRICE_FP32_ADD,     /* fp32_add */
  SF_PRICE_INT_ADD,      /* int_add.BITS: linear in the width */
  SF_PRICE_INT_MULTIPLY, /* int_multiply.BITS: BITS x BITS; linear in the product of the two widths */
  SF_PRICE_SRAM,         /* sram.BYTES: power law of the size; a smaller memory costs what the smallest costs */
  SF_PRICE_DRAM,         /* dram: of whatever is larger than the largest sram */
  SF_PRICE_REGISTER,     /* register: a register file, per access of 32 bits; may be left out */
  SF_PRICE_FAMILIES,
  /* Measured operations of this hardware, registers and clock included. A technology may have them; where it does, they
   * stand in place of what the widths would say. */
  SF_PRICE_MAC = SF_PRICE_FAMILIES, /* mac: of the spiking net */
  SF_PRICE_TWIN_MAC,                /* twin_mac: of the integer twin */
  SF_PRICE_SOP,                     /* sop */
  SF_PRICE_NEURON,                  /* neuron_update: leak or doubling, compare, reset */
  SF_PRICE_INTEGRATOR,              /* integrator_update: of D2 and C3 */
  SF_PRICE_SPECIAL,                 /* special: one special function */
  SF_PRICE_TAG_LOOKUP,              /* tag_lookup: tags of a line of the field's cache */
  SF_PRICE_KEYS
} sf_price_family;

enum { SF_PRICES_MAX = 48 };
typedef struct sf_technology {
  char name[40], title[160]; /* "45nm", "45 nm CMOS, 0.9 V" */
  char path[512];
  int count;
  sf_price price[SF_PRICES_MAX]; /* by family, then by `at` */
} sf_technology;

/* Reads a technology file: docs/energy.md says how to write one. Errors name file, line and key. */
sf_status sf_technology_load(sf_technology *technology, const char *path);
/* Reads a file, or the one of that name beside the program: ../share/spikefield/tech/NAME.tech. */
sf_status sf_technology_find(sf_technology *technology, const char *name);
/* In fJ, rounded to the nearest. *interpolated (may be NULL) becomes true where no
 * price of the file is for exactly this; it never becomes false. */
uint64_t sf_price_add(const sf_technology *technology, int bits, bool *interpolated);
uint64_t sf_price_multiply(const sf_technology *technology, int a_bits, int b_bits, bool *interpolated);
/* Bits of the sum of a layer's inputs: of products of an input and a weight, or of weights alone. */
int sf_sum_bits(const fx_layer *layer, bool of_products);
/* 64 bits of a memory of so many bytes; UINT64_MAX: DRAM. */
uint64_t sf_price_access(const sf_technology *technology, uint64_t memory_bytes, bool *interpolated);
/* So many bits of a register file; a file without its price: of the smallest sram, *interpolated. */
uint64_t sf_price_register(const sf_technology *technology, int bits, bool *interpolated);
/* The price of a family of one price that a technology may leave out; false where it does. */
bool sf_price_measured(const sf_technology *technology, sf_price_family family, uint64_t *fj);

/* ---- events of the ledgers ---- */

/* Rows: the layers, then what happens once per sample or pixel outside of them. */
enum { SF_ROW_FIELD = SF_LAYERS, SF_ROW_RAY, SF_ROWS };
const char *sf_row_name(int row); /* a layer's, "field" (grid or planes), "ray" (exp(-x), frame) */

/* What is outside the nets: all of it at step 0 of its row. */
typedef enum {
  SF_TRAFFIC_TABLE,
  SF_TRAFFIC_EXP_NEG,
  SF_TRAFFIC_FRAME,
  SF_TRAFFIC_LOOKUP,
  SF_TRAFFIC_MISS,
  SF_TRAFFIC_AT_PORTS, /* the ones before are seen at the accelerator, too */
  SF_TRAFFIC_PRODUCT = SF_TRAFFIC_AT_PORTS,
  SF_TRAFFIC_PLACE,
  SF_TRAFFIC_SPECIAL,
  SF_TRAFFIC_HARMONICS,
  SF_TRAFFIC_EVENTS
} sf_traffic_id;
typedef union sf_traffic {
  uint64_t event[SF_TRAFFIC_EVENTS]; /* by sf_traffic_id */
  struct {
    uint64_t table_bytes; /* row field: hash-grid or plane bytes that a sample uses */
    uint64_t exp_neg;     /* row ray: exp(-x), one per composited sample */
    uint64_t frame_bytes; /* row ray: bytes of pixels written, SF_PIXEL_BYTES each */
    uint64_t lookups;     /* row field: of its cache, and those that missed */
    uint64_t misses;
    uint64_t products;  /* row field: of entries and weights; of TensoRF field_mac */
    uint64_t places;    /* row field: cells of grid levels found, or places in planes and lines */
    uint64_t special;   /* row field: TensoRF's activations, sines and cosines */
    uint64_t harmonics; /* row ray: directions whose harmonics were computed */
  };
} sf_traffic;
enum { SF_PIXEL_BYTES = 48 }; /* an fx_pixel, as the accelerator writes it */

/* ---- ledgers ---- */

typedef enum {
  SF_LEDGER_PAPER,      /* MAC and SOP at fp32 prices, nothing else */
  SF_LEDGER_WIDTH,      /* MAC and SOP at integer prices for the widths of arch.def */
  SF_LEDGER_MEMORY,     /* + accesses of weight rows, membranes, field and frame */
  SF_LEDGER_NEURON,     /* + neurons, special functions, arithmetic of field and ray: everything that is counted */
  SF_LEDGER_SHARED,     /* the same where FX_SHARED samples share a read of weights */
  SF_LEDGER_ANN,        /* ReLU twin of the same sizes on the same samples: fp32 MACs (baseline of the paper) */
  SF_LEDGER_INT,        /* the bit-matched integer twin: int8 x int8 + int32 add (baseline of WIDTH) */
  SF_LEDGER_INT_MEMORY, /* + accesses of weight rows, activations, field and frame (baseline of MEMORY) */
  SF_LEDGER_INT_ALL,    /* + ReLU, special functions, arithmetic of field and ray (baseline of NEURON) */
  SF_LEDGER_INT_SHARED, /* the same where FX_SHARED samples share a read of weights (baseline of SHARED) */
  SF_LEDGERS
} sf_ledger_id;
enum { SF_SPIKING_LEDGERS = SF_LEDGER_ANN };

typedef struct sf_ledger_text {
  const char *key, *title, *meaning; /* "width", "width-correct", one sentence */
  int baseline;                      /* sf_ledger_id of the twin under the same assumptions; -1 of a twin */
} sf_ledger_text;
extern const sf_ledger_text sf_ledger_texts[SF_LEDGERS];

/* What an energy is spent on. */
typedef enum {
  SF_PART_MAC,
  SF_PART_SOP,
  SF_PART_WEIGHT,  /* rows of weights read */
  SF_PART_STATE,   /* membranes in register files; activations of the twin */
  SF_PART_LOOKUP,  /* look-ups in the field's cache */
  SF_PART_FILL,    /* lines that it reads from DRAM */
  SF_PART_FRAME,   /* pixels, words of 64 bits to DRAM */
  SF_PART_NEURON,  /* leak or doubling, compare, reset; ReLU of the twin */
  SF_PART_SPECIAL, /* exp, sigmoid, exp(-x); TensoRF's activation, sines */
  SF_PART_PRODUCT, /* products of the field; of a ray compositing, per sample */
  SF_PART_PLACE,   /* places in the field; of a ray its harmonics */
  SF_PARTS
} sf_part_id;
extern const char *const sf_part_names[SF_PARTS];  /* "mac", "sop", "weight", ... */
extern const char *const sf_part_titles[SF_PARTS]; /* "MAC", "SOP", "weight rows", ... */

/* What the technology measured of an event of a row, if anything: the twin has a MAC of its own, and its ReLU is priced
 * by widths. False: the price is the one of the widths. */
bool sf_operation_measured(const sf_technology *technology, bool twin, int row, int part, uint64_t *fj);

/* fJ of one event of a row, the same at all steps, and how it comes about. */
typedef struct sf_unit_price {
  uint64_t fj;
  bool interpolated;
} sf_unit_price;

/* One firing rate at which a spiking ledger costs what a twin does, all layers and steps scaled alike. */
typedef struct sf_break_even {
  int ledger, twin; /* sf_ledger_id */
  double rate;      /* 0..1 and above; NAN: dearer than the twin even without a spike, or nothing depends on spikes */
} sf_break_even;
enum {
  SF_OWN_BREAK_EVENS = SF_LEDGER_NEURON + 1
};                                                /* up to NEURON: rows that samples share do not scale with the rate */
enum { SF_BREAK_EVENS = SF_OWN_BREAK_EVENS + 1 }; /* each against its own baseline, NEURON against the fp32 twin too */

/* One price halved and raised by half: the savings that come out, percent. */
typedef struct sf_sensitivity {
  int price;                                                 /* index in technology->price */
  double less[SF_SPIKING_LEDGERS], more[SF_SPIKING_LEDGERS]; /* saving at 0.5 and 1.5 times the price */
  double swing; /* largest |change| of the saving of any ledger, percentage points; the list is sorted by it */
  int ledger;   /* where the largest is */
} sf_sensitivity;

typedef struct sf_ledgers {
  sf_technology technology;
  int steps;
  uint64_t cell[SF_LEDGERS][SF_ROWS][SF_T_MAX]; /* fJ; of the twins and of rows field and ray all at step 0 */
  uint64_t part[SF_LEDGERS][SF_PARTS];          /* the same energy by what it is spent on */
  uint64_t total[SF_LEDGERS];                   /* sum of the cells = sum of the parts */
  double saving[SF_LEDGERS];                    /* percent against the baseline; NAN of twins and where that is 0 */
  sf_unit_price unit[SF_LEDGERS][SF_ROWS][SF_PARTS]; /* 0 where the ledger does not price the part */
  bool interpolated[SF_LEDGERS];
  double rate; /* measured firing rate of the spiking layers, all steps; 0 without any */
  sf_break_even break_even[SF_BREAK_EVENS];
  int sensitivities;
  sf_sensitivity sensitivity[SF_PRICES_MAX]; /* largest swing first */
} sf_ledgers;

/* What is priced. */
typedef struct sf_counted {
  const fx_scene *scene; /* its sizes */
  const fx_counts *counts;
  const fx_memory_counts *memory;
  const sf_traffic *traffic;
  fx_cache_shape cache;
} sf_counted;
/* fJ of one event of a row in a ledger. */
sf_unit_price sf_unit_price_of(const sf_technology *technology, const sf_counted *counted, int ledger, int row,
                               int part);
/* Accesses of 64 bits that a row of a layer's weights takes; bytes of the memory that holds them all. */
uint64_t sf_row_accesses(const fx_layer *layer);
uint64_t sf_weights_size(const fx_layer *layer);
static inline bool sf_ledger_is_twin(int ledger)
{
  return ledger >= SF_SPIKING_LEDGERS;
}

/* The total of one spiking ledger; UINT64_MAX: it does not fit in 64 bits. */
uint64_t sf_ledger_fj(const sf_technology *technology, const sf_counted *counted, int ledger);
/* All of it. SF_E_RANGE when an energy does not fit in 64 bits. */
sf_status sf_ledgers_make(const sf_technology *technology, const sf_counted *counted, sf_ledgers *ledgers);

/* Terminal: the ledgers as a table, savings, break-even rates, sensitivity. views: whole views that the counts cover.
 */
void sf_ledgers_print(FILE *out, const sf_ledgers *ledgers, double views);
cJSON *sf_ledgers_json(const sf_ledgers *ledgers, double views);

#endif
