/* What sf_gen writes about the registers: tables read from csr.def, and one writer per language. */
#ifndef SF_TOOLS_GEN_GEN_H
#define SF_TOOLS_GEN_GEN_H
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

typedef enum { GEN_RO, GEN_RW, GEN_WO, GEN_W1C } gen_access;
typedef struct gen_register {
  const char *name;
  uint32_t offset;
  gen_access access;
  uint32_t reset;
  const char *meaning;
} gen_register;
typedef struct gen_field {
  const char *owner, *name; /* owner: the register's name */
  int lsb, width;
  const char *meaning;
} gen_field;
/* A memory: a window of the address space (address == NULL), which the register of the same name opens, or one behind
 * an address and a data register. */
typedef struct gen_memory {
  const char *name, *address, *data;
  uint32_t words;
  int bits;
  const char *meaning;
} gen_memory;

extern const gen_register gen_registers[];
extern const gen_field gen_fields[];
extern const gen_memory gen_memories[];
extern const int gen_register_count, gen_field_count, gen_memory_count;

const char *gen_access_name(gen_access access); /* as in csr.def */
/* The window that this register opens; NULL for a register of its own. */
const gen_memory *gen_window(const gen_register *r);
/* Next field of the register after *at (start with -1); NULL behind the last. A register without fields in csr.def has
 * one in the languages that demand it: gen_whole(). */
const gen_field *gen_next_field(const gen_register *r, int *at);
gen_field gen_whole(const gen_register *r);
/* Fields of the register as those languages see them, at least one. Returns the count; room for 32. */
int gen_all_fields(const gen_register *r, gen_field *out);
/* True when the block itself changes what is read: state, flags, and an address that counts up. */
bool gen_volatile(const gen_register *r);
/* True when it reads as its reset value and nothing else. Tests that a register model makes by itself, of resets and of
 * every bit, fail on the others: a value that does not fit is stored as an illegal one, and the block counts when it
 * comes out of reset. */
bool gen_testable(const gen_register *r);

/* The RTL files as the build knows them, relative to the root of the tree. */
typedef struct gen_sources {
  const char *const *path;
  int count;
} gen_sources;

void gen_write_sv_package(FILE *out, const gen_sources *sources);
void gen_write_markdown(FILE *out, const gen_sources *sources);
void gen_write_c_header(FILE *out, const gen_sources *sources);
void gen_write_systemrdl(FILE *out, const gen_sources *sources);
void gen_write_ipxact(FILE *out, const gen_sources *sources);
void gen_write_fusesoc(FILE *out, const gen_sources *sources);
#endif
