# spikefield: from photographs to silicon. `make help` lists the targets.
MAKEFLAGS += --no-print-directory
ifeq ($(filter -j%,$(MAKEFLAGS)),)
MAKEFLAGS += -j$(shell nproc)
endif
.DEFAULT_GOAL := all
SHELL := /bin/bash

B ?= build
CC ?= gcc
CXX ?= g++
OPT ?= -O3
SAN ?=
PKGS := OpenEXR libcjson libpng libjpeg
WARN := -Wall -Wextra -Wpedantic $(if $(CI),-Werror)
CFLAGS_ALL = -std=c11 -D_GNU_SOURCE $(OPT) -g $(WARN) -ffp-contract=off -fopenmp -Iinclude -Isrc -I. $(SAN) $(PKG_CFLAGS) $(CFLAGS)
PKG_CFLAGS = $(shell pkg-config --cflags $(PKGS) 2>/dev/null)
LIBS = $(shell pkg-config --libs $(PKGS) 2>/dev/null) -lm
Q := $(if $(V),,@)

LIB_SRC := $(wildcard src/*/*.c)
LIB_OBJ := $(LIB_SRC:%.c=$B/obj/%.o)
TOOLS := $(patsubst tools/%.c,%,$(wildcard tools/*.c))
# Programs that drive the Verilated accelerator; the others link the library alone.
DUT_TOOLS := sf_cosim sim_render energy_audit
TESTS := $(patsubst tests/%.c,%,$(wildcard tests/test_*.c))

all: $(TOOLS:%=$B/bin/%) ## build every program into build/bin

$B/obj/%.o: %.c
	@mkdir -p $(@D)
	$(if $Q,@echo "  CC    $<")
	$Q$(CC) $(CFLAGS_ALL) $(EXTRA_CFLAGS) -MMD -MP -c $< -o $@

# The kernels are compiled once per instruction set and chosen at run time; the portable one is the oracle.
ISA_SRC := $(wildcard src/*/*_isa.c)
LIB_OBJ := $(filter-out $(ISA_SRC:%.c=$B/obj/%.o),$(LIB_OBJ))
ISAS := portable $(if $(filter x86_64,$(shell uname -m)),avx2 avx512)
isa_portable :=
isa_avx2 := -mavx2 -mfma -ffp-contract=fast
isa_avx512 := -march=x86-64-v4 -mprefer-vector-width=512 -ffp-contract=fast
LIB_OBJ += $(foreach i,$(ISAS),$(ISA_SRC:%.c=$B/obj/%.$i.o))
define isa_rule
$B/obj/%_isa.$1.o: %_isa.c
	@mkdir -p $$(@D)
	$$(if $$Q,@echo "  CC    $$< ($1)")
	$$Q$$(CC) $$(CFLAGS_ALL) -fno-math-errno -fno-trapping-math $$(isa_$1) -DSF_ISA=$1 -MMD -MP -c $$< -o $$@
endef
$(foreach i,$(ISAS),$(eval $(call isa_rule,$i)))

$B/libspikefield.a: $(LIB_OBJ)
	$(if $Q,@echo "  AR    $@")
	$Qrm -f $@ && $(AR) rcs $@ $^

$B/bin/%: $B/obj/tools/%.o $B/libspikefield.a
	@mkdir -p $(@D)
	$(if $Q,@echo "  LD    $@")
	$Q$(CC) $(OPT) -fopenmp $(SAN) -o $@ $^ $(LIBS)

.SECONDARY:
-include $(shell find $B/obj -name '*.d' 2>/dev/null)
