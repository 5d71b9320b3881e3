/* sf_ray_top, Verilated: rays in, pixels out. The field lies in a memory that answers late. sim/sim.h has registers,
 * counters and bus. */
#ifndef SF_SIM_RAY_RAY_H
#define SF_SIM_RAY_RAY_H
#include "sim/ray/request.h"
#include "sim/sim.h"

/* The field's memory behind AXI4: lines in the order of the requests, each after a random number of cycles. */
enum { SF_MEMORY_QUEUE = 64, SF_LINE_BYTES = 16 };
typedef struct sf_memory {
  sf_dut *dut;
  const uint8_t *contents; /* of the field: a hash grid's table, or lines of planes */
  uint64_t bytes;
  uint8_t *planes;               /* contents of a TensoRF scene; else NULL */
  uint32_t base;                 /* address of the contents */
  int latency;                   /* from a request to its first beat, in cycles; 0: at random */
  uint64_t asked, answered;      /* requests taken, lines given */
  uint64_t outside;              /* requests beyond the contents */
  const char *fault;             /* the first rule of AXI that the block broke; NULL: none */
  uint64_t due[SF_MEMORY_QUEUE]; /* ring: earliest cycle of the answer */
  uint32_t address[SF_MEMORY_QUEUE];
  bool second, waits; /* a line's second beat is next; a request was shown and not taken */
  uint32_t waiting;
} sf_memory;

/* An address that the seed chooses, so that a confusion of offset and address is found. */
uint32_t sf_memory_base(uint64_t seed);
/* Contents of the scene's field; those of a hash grid stay where they are. sf_ray_dut_close frees the planes. */
sf_status sf_memory_fill(sf_memory *memory, const fx_scene *scene);
/* The dut's each_cycle, with the memory as its context: checks the rules of AXI, takes a request, gives a beat. */
void sf_memory_cycle(void *memory);

typedef struct sf_ray_dut {
  sf_dut *dut;
  const fx_scene *scene; /* kept: its grid is the memory's contents */
  sf_memory memory;
  bool in_tile; /* a ray of `tile` was the last */
  uint64_t tile;
} sf_ray_dut;
/* Programmed and started. The scene must outlive it. */
sf_status sf_ray_dut_open(sf_ray_dut **rays, const fx_scene *scene, const sf_dut_options *options);
/* Programs net, encoder and compositor again, after a soft reset or a change of the scene. */
sf_status sf_ray_dut_load(sf_ray_dut *rays);
/* Streams n rays in and n pixels out. A hang is an error that names the cycle. */
sf_status sf_ray_dut_run(sf_ray_dut *rays, const sf_ray_request *request, int n, fx_pixel *pixel);
/* The same without the cycles around the run in which nothing may come out, and without a waveform. dut->received
 * counts the pixels. */
sf_status sf_ray_dut_stream(sf_ray_dut *rays, const sf_ray_request *request, int n, fx_pixel *pixel);
void sf_ray_dut_close(sf_ray_dut *rays);
/* The field's cache as the block reports it: a build may have another one than the package's. */
fx_cache_shape sf_ray_dut_cache(sf_ray_dut *rays);
/* The field's counters since the block was opened, against those of the core for the same rays. */
sf_status sf_ray_dut_field(sf_ray_dut *rays, sf_field_counters *field);
/* True if this ray is in another tile than the last one. */
bool sf_ray_dut_new_tile(sf_ray_dut *rays, uint64_t tile);
#endif
