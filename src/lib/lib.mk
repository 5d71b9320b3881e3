# The installable C library. Included by the Makefile, which defines B, Q, say, CC, SAN and LIB_OBJ.
# What spikefield.h's functions need is linked into one object in which only their names stay visible; both the static
# and the shared library are that object.

PREFIX ?= /usr/local
override PREFIX := $(abspath $(PREFIX))
LIBDIR ?= $(PREFIX)/lib
INCLUDEDIR ?= $(PREFIX)/include
DATADIR ?= $(PREFIX)/share
OBJCOPY ?= objcopy
PUBLIC_HEADER := include/spikefield/spikefield.h
LIB_VERSION := $(shell sed -n 's/^.define SPIKEFIELD_VERSION "\(.*\)"/\1/p' $(PUBLIC_HEADER))
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
	$Q$(CC) -shared -fopenmp $(SAN) -Wl,-soname,$(SONAME) -Wl,-z,defs -o $@ $^ $(shell pkg-config --libs libcjson) -lm

# The golden model for SystemVerilog benches: one shared object, which needs no other of these.
DPI := libsf_golden_dpi.so
$B/lib/sf_golden_dpi.o: $(filter $B/obj/src/lib/%,$(LIB_OBJ)) $B/libspikefield.a
	@mkdir -p $(@D)
	$(call say,LD    $@)
	$Q$(CC) -r -nostdlib -o $@ $^
	$Q$(OBJCOPY) --wildcard --keep-global-symbol='sf_golden_*' $@

$B/lib/$(DPI): $B/lib/sf_golden_dpi.o
	$(call say,LD    $@)
	$Q$(CC) -shared -fopenmp $(SAN) -Wl,-soname,$(DPI) -Wl,-z,defs -o $@ $^ $(shell pkg-config --libs libcjson) -lm

lib: $B/lib/libspikefield.a $B/lib/$(SHARED) $B/lib/$(DPI) ## the C library, static and shared: build/lib

INSTALLED := $(INCLUDEDIR)/spikefield/spikefield.h $(LIBDIR)/libspikefield.a $(LIBDIR)/$(SHARED) $(LIBDIR)/$(SONAME) \
  $(LIBDIR)/libspikefield.so $(LIBDIR)/pkgconfig/spikefield.pc \
  $(INCLUDEDIR)/spikefield/sf_golden_dpi.h $(LIBDIR)/$(DPI) $(DATADIR)/spikefield/sf_golden_dpi.sv
# Prices of technologies and schemas of the reports.
SHARED_DATA := $(wildcard share/tech/*.tech share/schema/*.json)
INSTALLED += $(SHARED_DATA:share/%=$(DATADIR)/spikefield/%)

install: lib ## the C library, its header and its pkg-config file below PREFIX (/usr/local), staged in DESTDIR
	$(call say,INST  $(DESTDIR)$(PREFIX))
	$Qinstall -D -m 644 $(PUBLIC_HEADER) $(DESTDIR)$(INCLUDEDIR)/spikefield/spikefield.h
	$Qinstall -D -m 644 $B/lib/libspikefield.a $(DESTDIR)$(LIBDIR)/libspikefield.a
	$Qinstall -D -m 755 $B/lib/$(SHARED) $(DESTDIR)$(LIBDIR)/$(SHARED)
	$Qinstall -D -m 644 include/spikefield/sf_golden_dpi.h $(DESTDIR)$(INCLUDEDIR)/spikefield/sf_golden_dpi.h
	$Qinstall -D -m 755 $B/lib/$(DPI) $(DESTDIR)$(LIBDIR)/$(DPI)
	$Qinstall -D -m 644 src/lib/sf_golden_dpi.sv $(DESTDIR)$(DATADIR)/spikefield/sf_golden_dpi.sv
	$Qfor f in $(SHARED_DATA:share/%=%); do install -D -m 644 share/$$f $(DESTDIR)$(DATADIR)/spikefield/$$f || exit 1; done
	$Qln -sf $(SHARED) $(DESTDIR)$(LIBDIR)/$(SONAME) && ln -sf $(SONAME) $(DESTDIR)$(LIBDIR)/libspikefield.so
	$Qmkdir -p $(DESTDIR)$(LIBDIR)/pkgconfig && sed -e 's|@PREFIX@|$(PREFIX)|; s|@LIBDIR@|$(LIBDIR)|' \
	  -e 's|@INCLUDEDIR@|$(INCLUDEDIR)|; s|@VERSION@|$(LIB_VERSION)|; s|@DEFINES@|$(ARCH_DEFINES:%= %)|' src/lib/spikefield.pc.in \
	  >$(DESTDIR)$(LIBDIR)/pkgconfig/spikefield.pc

uninstall: ## remove what install put below PREFIX
	$Qrm -f $(addprefix $(DESTDIR),$(INSTALLED))
	$Qrmdir $(DESTDIR)$(INCLUDEDIR)/spikefield $(addprefix $(DESTDIR)$(DATADIR)/spikefield,/tech /schema /) 2>/dev/null || true

.PHONY: lib install uninstall
