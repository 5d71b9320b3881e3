# make install, uninstall and deb. Included by the Makefile, which defines B, Q, say and TOOLS; the library's names are
# of src/lib/lib.mk, FIRMWARE of firmware/firmware.mk.

PREFIX ?= /usr/local
override PREFIX := $(abspath $(PREFIX))
BINDIR ?= $(PREFIX)/bin
LIBDIR ?= $(PREFIX)/lib
INCLUDEDIR ?= $(PREFIX)/include
DATADIR ?= $(PREFIX)/share
MANDIR ?= $(DATADIR)/man
DOCDIR ?= $(DATADIR)/doc/spikefield
# sf_gen writes files of the source tree and is of no use elsewhere.
PROGRAMS := $(filter-out sf_gen,$(TOOLS))

# Both are what the program itself says. help2man is optional: without it there are no manual pages.
HELP2MAN := $(shell command -v help2man 2>/dev/null)
$B/man/%.1: $B/bin/% tools/packaging/man.sh
	@mkdir -p $(@D)
	$(call say,MAN   $@)
	$Qtools/packaging/man.sh $< $@ $(PROGRAMS)
$B/completions/%: $B/bin/%
	@mkdir -p $(@D)
	$Q$< --completion >$@
man: $(if $(HELP2MAN),$(PROGRAMS:%=$B/man/%.1)) ## manual pages of the programs, from their --help: build/man
	$(if $(HELP2MAN),,@echo "  man: help2man is not installed (make deps): no manual pages")

# What is installed: MODE:FILE:PLACE. Whatever install puts there, uninstall removes.
INSTALL_LIB := 644:$(PUBLIC_HEADER):$(INCLUDEDIR)/spikefield/spikefield.h \
  644:include/spikefield/sf_golden_dpi.h:$(INCLUDEDIR)/spikefield/sf_golden_dpi.h \
  644:src/lib/sf_golden_dpi.sv:$(DATADIR)/spikefield/sf_golden_dpi.sv \
  644:$B/lib/libspikefield.a:$(LIBDIR)/libspikefield.a \
  755:$B/lib/$(SHARED):$(LIBDIR)/$(SHARED) 755:$B/lib/$(DPI):$(LIBDIR)/$(DPI) \
  644:docs/example.c:$(DOCDIR)/example.c \
  $(foreach f,$(patsubst share/%,%,$(wildcard share/python/spikefield/*.py)),644:share/$f:$(DATADIR)/spikefield/$f)
INSTALL_LINKS := $(LIBDIR)/$(SONAME) $(LIBDIR)/libspikefield.so $(LIBDIR)/pkgconfig/spikefield.pc
INSTALL_PROGRAMS := $(foreach p,$(PROGRAMS),755:$B/bin/$p:$(BINDIR)/$p) \
  $(foreach p,$(PROGRAMS),644:$B/completions/$p:$(DATADIR)/bash-completion/completions/$p) \
  $(foreach f,$(patsubst share/%,%,$(wildcard share/tech/*.tech share/schema/*.json)),644:share/$f:$(DATADIR)/spikefield/$f) \
  $(foreach f,$(patsubst share/%,%,$(wildcard share/slurm/*.sbatch)),755:share/$f:$(DATADIR)/spikefield/$f) \
  $(foreach f,$(filter-out cocotb/sf_cocotb.py,$(patsubst share/%,%,$(wildcard share/cocotb/*.*))),644:share/$f:$(DATADIR)/spikefield/$f) \
  755:share/cocotb/sf_cocotb.py:$(DATADIR)/spikefield/cocotb/sf_cocotb.py \
  644:$B/share/spikefield/VERSION:$(DATADIR)/spikefield/VERSION
INSTALL_MAN := $(foreach p,$(PROGRAMS),644:$B/man/$p.1:$(MANDIR)/man1/$p.1)
# sf_soc looks for it from where it stands.
INSTALL_FIRMWARE := 644:$(FIRMWARE):$(abspath $(BINDIR)/../lib/spikefield)/sf_firmware.elf
INSTALLED := $(foreach f,$(INSTALL_LIB) $(INSTALL_PROGRAMS) $(INSTALL_MAN) $(INSTALL_FIRMWARE),$(lastword $(subst :, ,$f))) $(INSTALL_LINKS)
put = for file in $1; do IFS=: read -r mode from to <<<"$$file" && install -D -m $$mode $$from $(DESTDIR)$$to || exit 1; done

$B/share/spikefield/VERSION: $(PUBLIC_HEADER)
	@mkdir -p $(@D)
	$Qecho $(LIB_VERSION) >$@

install-lib: lib ## the C library alone, its header, its pkg-config file and an example below PREFIX
	$(call say,INST  $(DESTDIR)$(LIBDIR))
	$Q$(call put,$(INSTALL_LIB))
	$Qln -sf $(SHARED) $(DESTDIR)$(LIBDIR)/$(SONAME) && ln -sf $(SONAME) $(DESTDIR)$(LIBDIR)/libspikefield.so
	$Qmkdir -p $(DESTDIR)$(LIBDIR)/pkgconfig && sed -e 's|@PREFIX@|$(PREFIX)|; s|@LIBDIR@|$(LIBDIR)|' \
	  -e 's|@INCLUDEDIR@|$(INCLUDEDIR)|; s|@VERSION@|$(LIB_VERSION)|; s|@DEFINES@|$(ARCH_DEFINES:%= %)|' src/lib/spikefield.pc.in \
	  >$(DESTDIR)$(LIBDIR)/pkgconfig/spikefield.pc

# Programs find their data from where they stand: BINDIR/../share.
installable: all lib man firmware $B/share/spikefield/VERSION $(PROGRAMS:%=$B/completions/%)
install: installable ## programs, manual pages, completions, data and the C library below PREFIX (/usr/local), staged in DESTDIR
	@[ "$(abspath $(BINDIR)/../share)" = "$(abspath $(DATADIR))" ] || { \
	  echo "install: DATADIR has to be BINDIR/../share, where the programs look: $(abspath $(BINDIR)/../share)" >&2; exit 2; }
	@$(MAKE) install-lib
	$(call say,INST  $(DESTDIR)$(BINDIR))
	$Q$(call put,$(INSTALL_PROGRAMS) $(if $(HELP2MAN),$(INSTALL_MAN)) $(if $(SOC_MISSING),,$(INSTALL_FIRMWARE)))

uninstall: ## remove what install put below PREFIX
	$Qrm -f $(addprefix $(DESTDIR),$(INSTALLED))
	$Qrm -rf $(addprefix $(DESTDIR)$(DATADIR)/spikefield,/cocotb/__pycache__ /python/spikefield/__pycache__)
	$Qrmdir $(addprefix $(DESTDIR),$(INCLUDEDIR)/spikefield $(addprefix $(DATADIR)/spikefield,/tech /schema /slurm /cocotb /python/spikefield /python /) $(DOCDIR) \
	  $(abspath $(BINDIR)/../lib/spikefield)) 2>/dev/null || true

.PHONY: man installable install install-lib uninstall

wheel: lib ## a wheel of the Python package with the library inside: build/wheel (docs/python.md)
	$Qpython3 tools/packaging/wheel.py share/python/spikefield $B/lib/$(SHARED) $(LIB_VERSION) $B/wheel
.PHONY: wheel

DEB_PACKAGES := build-essential debhelper help2man lintian
deb: ## Debian packages of programs and library that lintian accepts: build/deb
	@[ -z '$(strip $(ARCH))' ] || { echo "deb: a package has the widths of include/spikefield/arch.def, not $(strip $(ARCH))" >&2; exit 2; }
	$Qtools/packaging/deb.sh $B $(LIB_VERSION)
deps-deb: ## install with apt what `make deb` needs besides (debhelper, lintian)
	@DEPS="$(DEB_PACKAGES)" tools/deps.sh
.PHONY: deb deps-deb
