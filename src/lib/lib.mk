# The installable C library. Included by the Makefile, which defines B, Q, say, CC, SAN and LIB_OBJ.
# What spikefield.h's functions need is linked into one object in which only their names stay visible; both the static
# and the shared library are that object.

OBJCOPY ?= objcopy
PUBLIC_HEADER := include/spikefield/spikefield.h
# MAJOR.MINOR.PATCH of the library, the programs and the package.
LIB_VERSION := $(shell sed -n 's/^.define SPIKEFIELD_VERSION_[A-Z]* \([0-9]*\).*/\1/p' $(PUBLIC_HEADER) | paste -sd.)
# Types and formats of other widths are others.
space := $(subst ,, )
LIB_WIDTHS := $(if $(SAME_ARCH),-$(subst $(space),-,$(subst =,-,$(strip $(ARCH)))))
SONAME := libspikefield.so.$(firstword $(subst ., ,$(LIB_VERSION)))$(LIB_WIDTHS)
SHARED := libspikefield.so.$(LIB_VERSION)$(LIB_WIDTHS)

$B/lib/spikefield.o: $(filter $B/obj/src/lib/%,$(LIB_OBJ)) $B/libspikefield.a
	@mkdir -p $(@D)
	$(call say,LD    $@)
	$Q$(CC) -r -nostdlib -o $@ $^
	$Q$(OBJCOPY) --wildcard --keep-global-symbol='spikefield_*' $@

$B/lib/libspikefield.a: $B/lib/spikefield.o
	$(call say,AR    $@)
	$Qrm -f $@ && $(AR) rcs $@ $^

$B/lib/$(SHARED): $B/lib/spikefield.o
	$(call say,LD    $@)
	$Q$(CC) -shared -fopenmp $(SAN) -Wl,-soname,$(SONAME) -Wl,-z,defs $(LDFLAGS) -o $@ $^ $(shell pkg-config --libs libcjson) -lm

# The golden model for SystemVerilog benches: one shared object, which needs no other of these.
DPI := libsf_golden_dpi.so
$B/lib/sf_golden_dpi.o: $(filter $B/obj/src/lib/%,$(LIB_OBJ)) $B/libspikefield.a
	@mkdir -p $(@D)
	$(call say,LD    $@)
	$Q$(CC) -r -nostdlib -o $@ $^
	$Q$(OBJCOPY) --wildcard --keep-global-symbol='sf_golden_*' $@

$B/lib/$(DPI): $B/lib/sf_golden_dpi.o
	$(call say,LD    $@)
	$Q$(CC) -shared -fopenmp $(SAN) -Wl,-soname,$(DPI) -Wl,-z,defs $(LDFLAGS) -o $@ $^ $(shell pkg-config --libs libcjson) -lm

lib: $B/lib/libspikefield.a $B/lib/$(SHARED) $B/lib/$(DPI) ## the C library, static and shared: build/lib

.PHONY: lib
