# spikefield: from photographs to silicon. `make help` lists the targets.
MAKEFLAGS += --no-print-directory
ifeq ($(MAKELEVEL)$(filter -j%,$(MAKEFLAGS)),0)
MAKEFLAGS += -j$(shell nproc)
endif
.DEFAULT_GOAL := all
.DELETE_ON_ERROR:
SHELL := /bin/bash

FIRST := $(filter deps clean,$(MAKECMDGOALS))
REST := $(filter-out deps clean,$(MAKECMDGOALS))
ifneq ($(filter deps,$(FIRST))$(and $(FIRST),$(REST)),)
# Nothing else may start, or even be looked up, before the packages are there and build/ is gone: the other goals run
# afterwards.
.NOTPARALLEL:
.PHONY: $(FIRST) $(REST)
deps: ## install what is missing with apt (Debian, Ubuntu); prints what it does
	@tools/deps.sh
$(REST): $(FIRST)
clean $(REST):
	@$(MAKE) $@
else

STARTED := $(shell date +%s)
B ?= build
# One name, however it was given: dependency files hold it. Goals may go on naming it by its whole path.
override B := $(patsubst $(CURDIR)/%,%,$(abspath $B))
ifeq ($(origin CC),default)
CC := gcc
endif
CXX ?= g++
OPT ?= -O3
SAN ?=
SCENES ?= ../shared/data
PKGS := OpenEXR libcjson libpng libjpeg
PKG_CFLAGS := $(shell pkg-config --cflags $(PKGS) 2>/dev/null)
LIBS := $(LDFLAGS) $(shell pkg-config --libs $(PKGS) 2>/dev/null) -lm
# Other widths, in a build folder of their own that remembers them: make B=build/ac4 ARCH="AC_FRAC=4 LEAK_FRAC=8"
ifneq ($(origin ARCH),command line)
ARCH := $(shell cat $B/arch 2>/dev/null)
else ifeq ($(filter clean,$(MAKECMDGOALS)),)
# What is built there depends on the other arch.def: dependency files say so.
ifneq ($(if $(strip $(ARCH)),$(if $(wildcard $B/arch),,$(wildcard $B/obj)),$(wildcard $B/arch)),)
$(error $B is built with $(if $(strip $(ARCH)),the widths of include/spikefield/arch.def,ARCH="$(shell cat $B/arch)"): \
  other widths, ARCH="$(ARCH)", need a folder of their own (B=folder))
endif
endif
ARCH_DEF := include/spikefield/arch.def
ifneq ($(strip $(ARCH)),)
ifneq ($(shell tools/arch.sh $B $(ARCH) && echo ok),ok)
$(error no build with ARCH="$(ARCH)")
endif
ARCH_DEF := $B/$(ARCH_DEF)
SAME_ARCH := ARCH="$(ARCH)"
ARCH_INCLUDE := -I$B/include
# What the public header cannot read from arch.def.
ARCH_DEFINES := -DSPIKEFIELD_LANES=$(shell sed -n 's/^SF_ARCH.LANES, \([0-9]*\),.*/\1/p' $(ARCH_DEF))
endif
WARN := -Wall -Wextra -Wpedantic $(if $(CI),-Werror)
CFLAGS_ALL = -std=c11 -D_GNU_SOURCE $(OPT) -g $(WARN) -ffp-contract=off -fopenmp -fPIC -fvisibility=hidden $(ARCH_INCLUDE) $(ARCH_DEFINES) -Iinclude -Isrc -I. $(SAN) $(PKG_CFLAGS) $(CPPFLAGS) $(CFLAGS)
Q := $(if $(V),,@)
say = $(if $V,,@echo "  $1")

# NIR graphs are HDF5 files (libhdf5-dev); without it sf_export --nir says so.
HDF5_LIBS := $(shell pkg-config --libs hdf5 2>/dev/null)
HDF5_CFLAGS := $(if $(HDF5_LIBS),-DSF_HDF5 $(patsubst -I%,-isystem %,$(shell pkg-config --cflags hdf5)))

# Programs that mpirun or srun start are ranks of one job where Open MPI (libopenmpi-dev) is found here. It is loaded by
# name when a launcher is there, so that no program is linked with it. MPI=no: a build without.
ifneq ($(MPI),no)
MPI_CFLAGS := $(patsubst -I%,-isystem %,$(shell pkg-config --cflags-only-I ompi-c 2>/dev/null))
MPI_SONAME := $(if $(MPI_CFLAGS),$(shell readelf -d "$$(pkg-config --variable=libdir ompi-c)/libmpi.so" 2>/dev/null | \
  sed -n 's/.*SONAME.*\[\(.*\)\].*/\1/p'))
endif
ifneq ($(MPI_SONAME),)
$B/obj/src/ranks/mpi.o: CFLAGS += $(MPI_CFLAGS) -DSF_MPI='"$(MPI_SONAME)"'
LIBS += -ldl
endif

# Without Unicorn (libunicorn-dev) there is no emulated system to run the firmware on, without the cross compiler no
# firmware; the rest is whole. SOC_MISSING says what is not there.
RISCV ?= riscv64-unknown-elf-
UNICORN_LIBS := $(shell pkg-config --libs unicorn 2>/dev/null)
SOC_MISSING := $(strip $(if $(UNICORN_LIBS),,libunicorn-dev) $(if $(shell command -v $(RISCV)gcc),,$(RISCV)gcc))
NO_SOC := $(if $(UNICORN_LIBS),,sf_soc) $(if $(SOC_MISSING),test_soc test_soc_planes)
TOOLS := $(filter-out $(NO_SOC),$(patsubst tools/%.c,%,$(wildcard tools/*.c)))
TESTS := $(filter-out $(NO_SOC),$(patsubst tests/%.c,%,$(wildcard tests/test_*.c)))
# Scripts that try whole programs; they take longest, so they begin.
CHAIN_TESTS := $(basename $(notdir $(wildcard tests/chain/*.sh tests/chain/*.py)))
# What only pattern rules name is kept: objects, and goals given by their whole path. A bare .SECONDARY: would leave a
# library without what it newly needs.
.SECONDARY: $(patsubst %.c,$B/obj/%.o,$(wildcard tests/*.c tests/*/*.c tools/*.c))
.SECONDARY: $(patsubst $(CURDIR)/%,%,$(filter $(CURDIR)/%,$(MAKECMDGOALS)))
DUT_TOOLS := sf_cosim sim_render energy_audit sf_soc sf_view
# Those that drive the Verilated accelerator.
DUT_TESTS := bench bench_field test_three_counts test_viewer $(filter test_rtl% test_soc%,$(TESTS))

all: $(TOOLS:%=$B/bin/%) ## build every program into build/bin (the default)

# Library. Files named *_isa.c are compiled once per instruction set and chosen at run time; the portable
# build is the oracle of the others.
LIB_SRC := $(filter-out %_isa.c,$(wildcard src/*/*.c))
X86 := $(filter x86_64,$(shell uname -m))
ISAS_snn := portable $(if $(X86),avx2 avx512 avx512bf16 amx)
ISAS_fx := $(if $(X86),avx2 avx512vnni amx)
isa_portable :=
isa_avx2 := -mavx2 -mfma -ffp-contract=fast
isa_avx512 := -march=x86-64-v4 -mprefer-vector-width=512 -ffp-contract=fast
isa_avx512bf16 := $(isa_avx512) -mavx512bf16 -mavx512vbmi2
isa_avx512vnni := $(isa_avx512) -mavx512vnni -mavx512vbmi2 -mavx512vpopcntdq
isa_amx := $(isa_avx512bf16) -mavx512vnni -mavx512vpopcntdq -mamx-tile -mamx-bf16 -mamx-int8
# Those that take longest to compile begin.
LIB_OBJ := $(foreach i,$(ISAS_snn),$B/obj/src/snn/kernels_isa.$i.o) $(foreach i,$(ISAS_fx),$B/obj/src/fx/kernels_isa.$i.o) \
  $(foreach i,$(ISAS_snn),$B/obj/src/snn/march_isa.$i.o) $(LIB_SRC:%.c=$B/obj/%.o)

$B/obj/%.o: %.c
	@mkdir -p $(@D)
	$(call say,CC    $<)
	$Q$(CC) $(CFLAGS_ALL) -MMD -MP -c $< -o $@

define isa_rule
$B/obj/%_isa.$1.o: %_isa.c
	@mkdir -p $$(@D)
	$$(call say,CC    $$< ($1))
	$$Q$$(CC) $$(CFLAGS_ALL) -fno-math-errno -fno-trapping-math $$(isa_$1) $$(EXACT) -DSF_ISA=$1 -MMD -MP -c $$< -o $$@
endef
$(foreach i,$(sort $(ISAS_snn) $(ISAS_fx)),$(eval $(call isa_rule,$i)))
# The same bits with every instruction set.
$(foreach i,$(ISAS_snn),$B/obj/src/snn/march_isa.$i.o): EXACT := -ffp-contract=off
# For the sanitizers a file of kernels takes up to a minute. What this processor cannot run is compiled without them.
ifneq ($(SAN),)
needs_avx2 := avx2
needs_avx512 := avx512f
needs_avx512bf16 := avx512_bf16
needs_avx512vnni := avx512_vnni
needs_amx := amx_tile
CPU_FLAGS := $(shell grep -m 1 '^flags' /proc/cpuinfo)
$(foreach i,$(foreach n,$(sort $(ISAS_snn) $(ISAS_fx)),$(if $(filter-out $(CPU_FLAGS),$(needs_$n)),$n)),$(eval $B/obj/%_isa.$i.o: override SAN :=))
endif
# GCC 12.2's ivopts gives an address no base where two lists are walked at different rates; local-pure-const2 and modref2
# take that for an access to NULL, do not see the stores behind it, and calls are dropped (GCC's fix: 13dfb01e5c30).
$B/obj/src/fx/%.o: override CFLAGS += -fno-delete-null-pointer-checks

$B/obj/src/exchange/nir_file.o $B/obj/tests/test_nir.o: CFLAGS += $(HDF5_CFLAGS)
$B/bin/sf_export $B/tests/test_nir: LIBS += $(HDF5_LIBS)
# Tests spend more time in the compiler than in their own code, but for the oracle of gradients.
$(patsubst %,$B/obj/tests/%.o,$(filter-out test_gradient,$(TESTS))): CFLAGS += -O1

# The report's texts lie in the program, and the browser's.
$B/obj/src/page/texts.o: $(wildcard src/page/*.html src/page/*.css src/page/*.js)
$B/obj/src/view/texts.o: $(wildcard src/view/*.html src/view/*.js src/view/*.css)
$B/obj/src/report/texts.o: src/report/reproduction.html

$(CURDIR)/$B/%: $B/% ;

$B/libspikefield.a: $(LIB_OBJ)
	$(call say,AR    $@)
	$Qrm -f $@ && $(AR) rcs $@ $^

# Generated RTL, the Verilated accelerator ($(DUT_LIBS)), lint and firmware.
include sim/sim.mk

# The installable library.
include src/lib/lib.mk

# File readers under fuzzing.
include tests/fuzz/fuzz.mk

# What continuous integration installs besides.
include tests/ci.mk

# The driver's program for RV32IM, and the emulated system that runs it.
include firmware/firmware.mk

# Everything installed, and the Debian package.
include tools/packaging/install.mk

# Programs. Those of DUT_TOOLS drive the Verilated accelerator; the others link the library alone.
$(DUT_TOOLS:%=$B/bin/%): $B/bin/%: $B/obj/tools/%.o $(DUT_LIBS) $B/libspikefield.a
	@mkdir -p $(@D)
	$(call say,LD    $@)
	$Q$(CXX) -fopenmp $(SAN) -o $@ $^ $(DUT_LDLIBS) $(LIBS)

$B/bin/%: $B/obj/tools/%.o $B/libspikefield.a
	@mkdir -p $(@D)
	$(call say,LD    $@)
	$Q$(CC) -fopenmp $(SAN) -o $@ $(filter %.o,$^) $(filter %.a,$^) $(LIBS)

$B/bin/sim_render: $B/obj/tools/render/options.o
$B/bin/sf_data: $(patsubst %.c,$B/obj/%.o,$(wildcard tools/solve/*.c))
$B/bin/sf_train: $B/obj/tools/train/options.o $B/obj/tools/train/defaults.o $B/obj/tools/train/table.o $B/obj/tools/train/report.o $B/obj/tools/train/watch.o $B/obj/tools/train/keeper.o

# They serve a page (libmicrohttpd-dev).
$B/bin/sf_view $B/bin/sf_train $B/tests/test_view $B/tests/test_viewer: LIBS += $(shell pkg-config --libs libmicrohttpd)

# Prices of technologies, found beside the program.
TECHS := $(wildcard share/tech/*.tech)
$B/share/spikefield/tech/%.tech: share/tech/%.tech
	@mkdir -p $(@D)
	$Qcp $< $@
$B/bin/energy_audit $B/bin/sf_view $B/tests/test_viewer $B/tests/test_twin: | $(TECHS:share/tech/%=$B/share/spikefield/tech/%)
all: $(TECHS:share/tech/%=$B/share/spikefield/tech/%)

# Tests
CHECK_LIBS := $(shell pkg-config --libs check 2>/dev/null)
$(TESTS:%=$B/tests/%): $B/obj/tests/ck_main.o $B/obj/tests/ck_mark.o
$(TESTS:%=$B/tests/%): CHECK_LIBS += -Wl,--wrap=_mark_point
$(DUT_TESTS:%=$B/tests/%): $B/tests/%: $B/obj/tests/%.o $(DUT_LIBS) $B/libspikefield.a
	@mkdir -p $(@D)
	$(call say,LD    $@)
	$Q$(CXX) -fopenmp $(SAN) -o $@ $(filter %.o,$^) $(filter %.a,$^) $(DUT_LDLIBS) $(CHECK_LIBS) $(LIBS)

$B/tests/test_driver: $B/obj/firmware/sf_driver.o $B/obj/firmware/sf_ray_driver.o
$B/tests/%: $B/obj/tests/%.o $B/libspikefield.a
	@mkdir -p $(@D)
	$(call say,LD    $@)
	$Q$(CC) -fopenmp $(SAN) -o $@ $(filter %.o,$^) $(filter %.a,$^) $(CHECK_LIBS) $(LIBS)

test: $(TESTS:%=$B/tests/%) all ## the C tests alone
	@tests/run.sh $B $(TESTS)

LONG_PROGRAMS := asic/lookups coverage_report tests/bench tests/bench_field # of long targets alone: they have to build
check: all lint gen-check $(TESTS:%=$B/tests/%) $(FUZZ_REPLAYS) fuzz-single firmware faults board-sim installable $B/tests/exr_to_ppm $(LONG_PROGRAMS:%=$B/%) ## every test, lint, co-simulation, planted faults, generated files
	@tests/run.sh $B $(CHAIN_TESTS) $(TESTS)

SAMPLES ?= 10000000
vector-campaign: $B/tests/test_fx_vector ## vector core = portable core over SAMPLES (10 M) random samples, and as many for the grid and in rays
	SF_FX_SAMPLES=$(SAMPLES) $B/tests/test_fx_vector

gradient-check: $B/tests/test_gradient ## every gradient of the trainer against slopes in double precision, over SEEDS ("1 2 3"), eight directions a tensor
	@for seed in $(SEEDS); do SF_GRADIENT_SEED=$$seed SF_GRADIENT_DIRECTIONS=8 $< || exit 1; done

solve-campaign: all ## what COLMAP's poses cost in PSNR, against the true ones of a made scene, over SEEDS ("1 2 3"): build/solve-campaign
	@tests/solve_campaign.sh $B $(SEEDS)

asan: ## the C tests under address and undefined-behaviour sanitizers
	@$(MAKE) B=$B/asan $(SAME_ARCH) OPT=-O2 SAN="-fsanitize=address,undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer" asan-run

ASAN_TESTS := $(filter-out $(DUT_TESTS) $(UNIT_TESTS),$(TESTS))
asan-run: $(ASAN_TESTS:%=$B/tests/%) $(FUZZ_REPLAYS)
	@ASAN_OPTIONS=detect_leaks=0 SANITIZED=1 SF_FX_SAMPLES=10000 tests/run.sh $B $(ASAN_TESTS) fuzz

include sim/coverage.mk
include tests/formal/formal.mk
include tests/mutate/mutate.mk

PAGES := README.md CONTRIBUTING.md CHANGELOG.md $(wildcard docs/*.md docs/notes/*.md) rtl/README.md
house: all ## the order of rooms (README's map), format, sentences and links of the documents
	@if [ -e .git ] && command -v git >/dev/null && command -v python3 >/dev/null; then tools/check_rooms.py $B && \
	  tools/check_prose.py $(PAGES) && tools/check_links.py $(PAGES); \
	else echo "  house: rooms, sentences and links are not checked: that needs a git checkout, git and python3"; fi
	@if [ -e .git ] && command -v git >/dev/null && command -v clang-format >/dev/null; then \
	  clang-format --dry-run -Werror $$(git ls-files '*.c' '*.h' ':!rtl/gen'); \
	else echo "  house: the format is not checked: that needs a git checkout, git and clang-format"; fi

cppcheck: ## static analysis of the C code
	cppcheck -j $(shell nproc) --quiet --std=c11 --language=c --enable=warning,performance,portability --inline-suppr --error-exitcode=1 \
	  --suppress=missingInclude -Iinclude -Isrc src tools firmware

# Runs of the whole chain
demo: all ## make a scene, train, export, render, co-simulate, audit: build/demo (under 4 minutes)
	@STARTED=$(STARTED) tools/demo.sh $B

# The default of SAMPLES above is vector-campaign's.
SCENE ?= $B/demo/scene.snn
DATA ?= $B/demo/scene
SEEDS ?= 1 2 3
cosim-campaign: $B/bin/sf_cosim ## co-simulate SAMPLES (1 M) samples over SEEDS ("1 2 3") after make demo, or SCENE= DATA=, on ranks with LAUNCH="mpirun -n 8": build/cosim
	@tools/cosim_campaign.sh $B "$(SCENE)" "$(DATA)" $(if $(filter file,$(origin SAMPLES)),1000000,$(SAMPLES)) "$(SEEDS)"

scale: all ## what training and co-simulation cost on ranks, and a model of clusters: DATA=folder; speed on an idle machine: RANKS="1 2 4" MINUTES=4
	@$(if $(RANKS),tools/scale_wall.py $B "$(DATA)" "$(RANKS)" $(if $(filter file,$(origin MINUTES)),4,$(MINUTES)),tools/scale.py $B "$(DATA)")

lego: all ## the same chain on SCENES/lego with a training budget of 15 minutes: build/lego
	@STARTED=$(STARTED) tools/chain.sh $B "$(SCENES)/lego" $B/lego --minutes 15 --rays 400

# A scene of one's own.
MINUTES ?= 15
scene: all ## the same chain on DATA=folder (any layout), or on PHOTOS=folder-or-video, whose poses COLMAP finds (SOLVE="--frames 60"): build/scenes/NAME; MINUTES=15, TRAIN="--backbone tensorf ..."
	@[ -n "$(PHOTOS)" ] || [ -z "$(filter file,$(origin DATA))" ] || { echo "make scene DATA=folder: which folder of pictures and poses? Without poses: PHOTOS=folder-or-video" >&2; exit 2; }
	@data="$(DATA)" photos="$(PHOTOS)"; name=$$(basename "$${photos:-$$data}"); [ -d "$${photos:-.}" ] || name=$${name%.*}; out="$B/scenes/$$name"; \
	  [ -z "$$photos" ] || { data=$$out/data && mkdir -p "$$out" && $B/bin/sf_data "$$photos" --solve -o "$$data" --png "$$out/cameras.png" $(SOLVE); } && \
	  STARTED=$(STARTED) tools/chain.sh $B "$$data" "$$out" --minutes $(MINUTES) --train "$(TRAIN)"

report: ## open build/demo/report.html (make demo writes it; REPORT=build/lego/report.html), or print where it is
	@[ -f "$(REPORT)" ] || { echo "$(REPORT): not there; make demo writes build/demo/report.html" >&2; exit 1; }
	@echo "$(abspath $(REPORT))"
	@[ -z "$$DISPLAY$$WAYLAND_DISPLAY" ] || ! command -v xdg-open >/dev/null || xdg-open "$(abspath $(REPORT))"
REPORT ?= $B/demo/report.html

PROFILE ?= quick
reproduce: all ## the runs of the paper's tables on SCENES: build/reproduce/PROFILE (quick, smoke; paper: full length, any layout, SEEDS="1 2 3"; scenes: MINUTES=15)
	@$(LAUNCH) tools/reproduce.sh $B --profile $(PROFILE) --scenes "$(SCENES)" $(if $(filter scenes,$(PROFILE)),--minutes $(MINUTES)) \
	  $(if $(filter-out file,$(origin SEEDS)),--seeds "$(SEEDS)") $(REPRODUCE)

reproduce-report: all ## table and plots of the runs that are there
	@tools/reproduce.sh $B --profile $(PROFILE) --report

pareto: all ## what each bit of width costs (MODEL=, DATA=, PROFILE=): table, CSV, plots in build/pareto/PROFILE
	@$(LAUNCH) tools/pareto.sh $B --profile $(PROFILE) $(if $(MODEL),--model "$(MODEL)") $(if $(filter-out file,$(origin DATA)),--data "$(DATA)") $(PARETO)

outputs: all ## puts today's numbers into the outputs that docs/ shows, after make demo on an idle machine (OUTPUTS="docs/kit.md ...")
	@tests/tutorials.py --print $B $(OUTPUTS)

speed-error: all ## speed against error after make demo: steps, widths, fits, arithmetic, training time (PROFILE=quick, full, smoke; DATA=): build/speed-error
	@tools/speed_error.py $B --profile $(PROFILE) $(if $(filter-out file,$(origin DATA)),--data "$(DATA)")

quality: all ## what short runs of eight scenes learn, spiking and twin, beside the last table kept (SCENES=, QUALITY="--keep"): build/quality
	@tools/quality.sh $B --scenes "$(SCENES)" $(QUALITY)

bench: all $B/tests/bench ## speed of trainer and fixed-point core beside ceilings and naive versions, text and build/bench.json (ONLY=nets, grid, adam, iteration, fixed or rtl: one part)
	@models=$(if $(filter-out fixed,$(ONLY)),,$$(tests/bench_models.sh $B "$(SCENES)")) && mapfile -t model <<<"$$models" && \
	  $B/tests/bench $(ONLY:%=--only %) $B/bench.json $${models:+"$${model[@]}"}

$B/tests/bench: $(patsubst %,$B/obj/tests/%.o,bench_ceilings bench_fixed bench_rtl bench_rig bench_tensorf)

vectors: $B/bin/sf_export ## vector kit of the demo's scene after make demo (or SCENE=, DATA=), run in Icarus and Verilator: build/vectors
	@$B/bin/sf_export $(or $(SCENE),$B/demo/scene.snn) --data $(or $(DATA),$B/demo/scene) --vectors $B/vectors --seed 1
	@if command -v iverilog >/dev/null; then $(MAKE) -s -C $B/vectors icarus; else echo "  vectors: iverilog is not installed, skipped"; fi
	@$(MAKE) -s -C $B/vectors verilator

BUDGET ?= $(if $(wildcard $B/demo/scene.snn),$B/demo/model.safetensors $B/demo/scene.snn $B/demo/scene)
error-budget: $B/bin/error_budget ## error of each fixed-point block and its bound; its cost in dB after make demo or BUDGET="MODEL SCENE DATA"
	@$B/bin/error_budget $(BUDGET)

format: ## clang-format every C file but the generated ones
	@command -v clang-format >/dev/null || { echo "format: clang-format is not installed" >&2; exit 1; }
	clang-format -i $$(git ls-files '*.c' '*.h' ':!rtl/gen')

clean: ## remove build/
	rm -rf $B

help: ## this list
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sort | sed -E 's/:.*## /\t/' | awk -F'\t' '{ printf "  make %-12s %s\n", $$1, $$2 }'

.PHONY: all test check vector-campaign gradient-check solve-campaign cosim-campaign scale asan asan-run cppcheck demo lego scene report reproduce reproduce-report outputs speed-error quality pareto bench vectors error-budget format clean help house lint gen gen-check firmware faults
-include $(shell find $B/obj -name '*.d' 2>/dev/null)
endif
