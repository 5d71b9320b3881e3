# Generated RTL, the Verilated accelerator, planted faults, lint, firmware. Included by the Makefile, which defines B, Q,
# say, CC, CXX, CFLAGS_ALL and the rule for $B/obj/%.o.

VERILATOR ?= verilator
VERILATOR_ROOT := $(shell $(VERILATOR) --getenv VERILATOR_ROOT 2>/dev/null)
RTL_PKG := rtl/gen/sf_arch_pkg.sv rtl/gen/sf_csr_pkg.sv rtl/sf_op_pkg.sv
RTL_MODULES := $(filter-out $(RTL_PKG),$(wildcard rtl/gen/*.sv rtl/*.sv))
RTL := $(RTL_PKG) $(RTL_MODULES)
# What a board has around the accelerator, but for its own top.
RTL_BOARD := $(wildcard rtl/board/*.sv)
BOARD_TOPS := $(patsubst rtl/board/%/,%,$(wildcard rtl/board/*/))
RTL_ALL := $(RTL) $(wildcard rtl/*.svh) rtl/lint.vlt
# A build with ARCH has a copy of rtl/ with packages of its own widths.
RTL_ROOT := $(if $(ARCH_INCLUDE),$B/variant,.)
RTL_READY := $(if $(ARCH_INCLUDE),$B/variant/.generated,$(RTL_ALL))
# Loops over lanes are written for unrolling; see rtl/README.md.
VERILATOR_UNROLL := --unroll-count 256 --unroll-stmts 1000000
# Arrays over lanes are in waveforms, too: Verilator leaves out those of more than 32 elements.
VERILATOR_TRACE := --trace-fst --trace-max-array $(if $(findstring LANES=256,$(ARCH_DEFINES)),256,128)
VERILATOR_FLAGS := --cc -Wall -O3 --x-assign unique --x-initial unique $(VERILATOR_TRACE) $(VERILATOR_UNROLL)
# COVERAGE: folder in which every accelerator that is closed leaves its coverage; see sim/coverage.mk.
ifneq ($(COVERAGE),)
VERILATOR_FLAGS += --coverage-line --coverage-toggle
COVERAGE_FLAGS := -DSF_COVERAGE='"$(abspath $(COVERAGE))"' -DVM_COVERAGE=1
COVERAGE_OBJ := verilated_cov.o
$B/obj/sim/cover.o: CFLAGS += $(COVERAGE_FLAGS)
endif
# Lanes are statements of the same shape, of which the compiler makes vectors. Clang's are 1.2 to 1.4 times as fast as those of
# GCC 12, which has to be told not to count the cost (11 to 17 thousand samples/s there; -O3 instead gains nothing).
VERILATED_CXX := $(firstword $(foreach c,clang++ $(CXX),$(shell echo '\#include <string>' | $c -E -x c++ - >/dev/null 2>&1 && echo $c)))
VERILATED_SIMD := -march=native $(if $(findstring clang,$(VERILATED_CXX)),,-ftree-slp-vectorize -fvect-cost-model=unlimited)
VERILATED_SIMD := $(shell $(VERILATED_CXX) -Werror $(VERILATED_SIMD) -E -x c++ /dev/null >/dev/null 2>&1 && echo "$(VERILATED_SIMD)")
VERILATED_OPT := OPT_FAST="-O2 $(VERILATED_SIMD)" OPT_SLOW=-O1 OPT_GLOBAL=-O2

SIM_SRC := $(filter-out $(if $(UNICORN_LIBS),,sim/soc/soc.c),$(wildcard sim/*.c sim/activity/*.c sim/ray/*.c sim/board/*.c sim/studio/*.c sim/view/*.c sim/soc/*.c))
DUT_OBJ := $(patsubst %.c,$B/obj/%.o,$(SIM_SRC) $(addprefix firmware/,sf_driver.c sf_ray_driver.c sf_blob.c sf_tile.c sf_stream.c))
VERILATED_OBJ := $(addprefix $B/verilated/runtime/,verilated.o verilated_fst_c.o verilated_threads.o $(COVERAGE_OBJ))

# Verilator brings the reader of its waveforms along.
$B/obj/sim/activity/wave.o: CFLAGS += -isystem $(VERILATOR_ROOT)/include

# $1 folder, $2 folder that holds rtl/, $3 prerequisites, $4 top, $5 its pins in sim/
define verilated_top_rule
$1/V$4.mk: $3
	@mkdir -p $1
	$$(call say,VERI  $1)
	$$Qcd $2 && $$(VERILATOR) $$(VERILATOR_FLAGS) --prefix V$4 --top-module $4 -Irtl --Mdir $$(abspath $1) rtl/lint.vlt $$(RTL)
$1/V$4__ALL.a: $1/V$4.mk
	$$(call say,CXX   $$@)
	$$Q$$(MAKE) -s -C $1 -f V$4.mk $$(VERILATED_OPT) CXX=$$(VERILATED_CXX) V$4__ALL.a >/dev/null
	@touch $$@
-include $1/$5.d
$1/$5.o: sim/$5.cpp $(ARCH_DEF) tools/plusargs.sh $1/V$4.mk
	$$(call say,CXX   $$< -> $$@)
	$$Q$$(CXX) -std=c++17 -O2 -Wall -Wextra $(if $(CI),-Werror) $(COVERAGE_FLAGS) $(ARCH_INCLUDE) -Iinclude -Isrc -I. -isystem $$(VERILATOR_ROOT)/include \
	  -isystem $$(VERILATOR_ROOT)/include/vltstd -isystem $1 -DSF_PLUSARGS="\"$$$$(tools/plusargs.sh $1)\"" -MMD -MP -c $$< -o $$@
endef
# $1 to $3 as above: the library of sf_top and of everything in sim/ but sf_ray_top itself
define verilated_rule
$(call verilated_top_rule,$1,$2,$3,sf_top,pins)
$1/libsfdut.a: $1/Vsf_top__ALL.a $1/pins.o $(DUT_OBJ) $(VERILATED_OBJ)
	$$(call say,AR    $$@)
	$$Qrm -f $$@ && cp $1/Vsf_top__ALL.a $$@ && $$(AR) rs $$@ $1/pins.o $(DUT_OBJ) $(VERILATED_OBJ) 2>/dev/null
endef

DUT_LIBS := $B/verilated/libsfdut.a
DUT_LDLIBS := -lz -lpthread
# Programs that drive sf_ray_top.
RAY_PROGRAMS := bin/sf_cosim bin/sim_render bin/sf_view bin/sf_soc bin/energy_audit $(patsubst %,tests/%,$(filter test_rtl_ray%,$(DUT_TESTS))) tests/test_three_counts tests/test_viewer tests/test_soc tests/test_soc_planes tests/bench tests/bench_field
RAY_LIBS := $B/verilated/ray/pins_ray.o $B/verilated/ray/Vsf_ray_top__ALL.a
$(RAY_PROGRAMS:%=$B/%): $(RAY_LIBS)

$B/verilated/runtime/%.o: $(VERILATOR_ROOT)/include/%.cpp
	@mkdir -p $(@D)
	$(call say,CXX   $<)
	$Q$(CXX) -std=c++17 -O2 $(COVERAGE_FLAGS) -I$(VERILATOR_ROOT)/include -I$(VERILATOR_ROOT)/include/vltstd -c $< -o $@

# FuseSoC takes the last core of a name that it finds: those below the build folder are not to be found.
$B/FUSESOC_IGNORE:
	@mkdir -p $(@D) && touch $@
all: $B/FUSESOC_IGNORE

$B/variant/.generated: $(RTL_ALL) $(ARCH_DEF) $B/bin/sf_gen | $B/FUSESOC_IGNORE
	$(call say,GEN   $(@D)/rtl)
	$Qrm -rf $(@D)/rtl && mkdir -p $(@D) && cp -r rtl $(@D)/rtl && $B/bin/sf_gen --root $(@D) $(RTL_ALL)
	@touch $@

$(eval $(call verilated_rule,$B/verilated,$(RTL_ROOT),$(RTL_READY)))
$(eval $(call verilated_top_rule,$B/verilated/ray,$(RTL_ROOT),$(RTL_READY),sf_ray_top,pins_ray))

include sim/unit.mk
include sim/board.mk

# Planted faults: a patched copy of rtl/; +fault=N chooses one at run time, +fault=0 none.
FAULTS := $(sort $(wildcard tests/faults/*.patch))
$B/faults/.patched: $(RTL_READY) $(FAULTS)
	$(call say,PATCH $(@D)/rtl)
	$Qrm -rf $(@D)/rtl && mkdir -p $(@D) && cp -r $(RTL_ROOT)/rtl $(@D)/rtl
	$Qfor p in $(FAULTS); do patch -s -p1 -d $(@D) <$$p || exit 1; done
	@touch $@
$(eval $(call verilated_rule,$B/faults/verilated,$B/faults,$B/faults/.patched))
# Those of the ray stream, in a copy of their own.
RAY_FAULTS := $(sort $(wildcard tests/faults/ray/*.patch))
$B/faults/ray/.patched: $(RTL_READY) $(RAY_FAULTS)
	$(call say,PATCH $(@D)/rtl)
	$Qrm -rf $(@D)/rtl && mkdir -p $(@D) && cp -r $(RTL_ROOT)/rtl $(@D)/rtl
	$Qfor p in $(RAY_FAULTS); do patch -s -p1 -d $(@D) <$$p || exit 1; done
	@touch $@
$(eval $(call verilated_top_rule,$B/faults/ray/verilated,$B/faults/ray,$B/faults/ray/.patched,sf_ray_top,pins_ray))
FAULTY_RAY_LIBS := $B/faults/ray/verilated/pins_ray.o $B/faults/ray/verilated/Vsf_ray_top__ALL.a
$B/faults/sf_cosim: $B/obj/tools/sf_cosim.o $(FAULTY_RAY_LIBS) $B/faults/verilated/libsfdut.a $B/libspikefield.a
	$(call say,LD    $@)
	$Q$(CXX) -fopenmp $(SAN) -o $@ $^ $(DUT_LDLIBS) $(LIBS)
# Planted miscounts in the C core, the vector core and the recount: SF_FAULT=N chooses one at run time.
C_FAULTS := $(sort $(wildcard tests/faults/c/*.patch))
C_FAULTY := src/fx/count.c src/fx/memory.c src/fx/rays.c src/energy/recount.c
$B/faults/c/.patched: $(C_FAULTY) $(C_FAULTS)
	$(call say,PATCH $(@D))
	$Qrm -rf $(@D) && mkdir -p $(@D) && cp --parents $(C_FAULTY) $(@D)
	$Qfor p in $(C_FAULTS); do patch -s -p1 -d $(@D) <$$p || exit 1; done
	@touch $@
$(C_FAULTY:%.c=$B/faults/c/%.o): $B/faults/c/%.o: $B/faults/c/.patched
	$(call say,CC    $@)
	$Q$(CC) $(CFLAGS_ALL) -MMD -MP -c $(@:.o=.c) -o $@
-include $(C_FAULTY:%.c=$B/faults/c/%.d)
$B/faults/energy_audit: $B/obj/tools/energy_audit.o $(C_FAULTY:%.c=$B/faults/c/%.o) $(FAULTY_RAY_LIBS) $B/faults/verilated/libsfdut.a $B/libspikefield.a
	$(call say,LD    $@)
	$Q$(CXX) -fopenmp $(SAN) -o $@ $^ $(DUT_LDLIBS) $(LIBS)
$B/faults/make_scene: $B/obj/tests/faults/make_scene.o $B/libspikefield.a
	@mkdir -p $(@D)
	$(call say,LD    $@)
	$Q$(CC) -fopenmp $(SAN) -o $@ $^ $(CHECK_LIBS) $(shell pkg-config --libs check 2>/dev/null) $(LIBS)
faults: $B/faults/sf_cosim $B/faults/energy_audit $B/faults/make_scene ## co-simulation and audit with planted faults, for their own tests

$B/bin/sf_gen: $(patsubst %.c,$B/obj/%.o,$(wildcard tools/gen/*.c))

gen: $B/bin/sf_gen ## rewrite rtl/gen, spikefield.core and docs/registers.md from arch.def, csr.def, the tables and the list of RTL files
	@$B/bin/sf_gen --root $(RTL_ROOT) $(RTL_ALL)

ifneq ($(SAME_ARCH),)
gen-check:
	@echo "  gen-check: other widths than the committed files', skipped"
else
gen-check: $B/bin/sf_gen | $B/FUSESOC_IGNORE ## generated files are those that the sources give
	@rm -rf $B/gen-check && $B/bin/sf_gen --root $B/gen-check $(RTL_ALL)
	@diff -r $B/gen-check/rtl/gen rtl/gen && diff $B/gen-check/docs/registers.md docs/registers.md && \
	  diff $B/gen-check/spikefield.core spikefield.core && tools/check_mirror.sh
endif

# Of sf_top's parameter, as far as the package goes.
LANES_BUILT := $(if $(findstring LANES=256,$(ARCH_DEFINES)),32 64 128 256,32 64 128)
lint: house $(RTL_READY) ## the order of the house; Verilator, Icarus and Yosys (where installed) accept the RTL, without warnings
	@cd $(RTL_ROOT) && for lanes in $(LANES_BUILT); do \
	  $(VERILATOR) --lint-only --top-module sf_top -GLANES=$$lanes -Wall $(VERILATOR_UNROLL) -Irtl rtl/lint.vlt $(RTL) || exit 1; done
	@cd $(RTL_ROOT) && for steps in 1 2 4; do \
	  $(VERILATOR) --lint-only --top-module sf_top -GSTEPS_AT_ONCE=$$steps -Wall $(VERILATOR_UNROLL) -Irtl rtl/lint.vlt $(RTL) || exit 1; done
	@cd $(RTL_ROOT) && $(VERILATOR) --lint-only --top-module sf_ray_top +define+SF_NO_TAP -Wall $(VERILATOR_UNROLL) -Irtl rtl/lint.vlt $(RTL)
	@cd $(RTL_ROOT) && for lacks in GRID PLANES; do \
	  $(VERILATOR) --lint-only --top-module sf_ray_top -G$$lacks=0 -Wall $(VERILATOR_UNROLL) -Irtl rtl/lint.vlt $(RTL) || exit 1; done
	@cd $(RTL_ROOT) && $(VERILATOR) --lint-only --top-module sf_plif -Wall -Irtl rtl/lint.vlt $(RTL_PKG) rtl/sf_plif.sv
	@if command -v iverilog >/dev/null; then cd $(RTL_ROOT) && iverilog -g2012 -Wall -Wno-timescale -Irtl -s sf_top -t null $(RTL); fi
	@if command -v yosys >/dev/null; then cd $(RTL_ROOT) && yosys -q -w "Replacing memory" -p "read_verilog -sv -Irtl $(RTL); hierarchy -check -top sf_top" >/dev/null; fi
	@cd $(RTL_ROOT) && for top in $(LINT_TOPS); do \
	  $(VERILATOR) --lint-only --top-module $$top -Wall $(VERILATOR_UNROLL) -Irtl rtl/lint.vlt $(RTL) || exit 1; \
	  ! command -v iverilog >/dev/null || iverilog -g2012 -Wall -Wno-timescale -Irtl -s $$top -t null $(RTL) || exit 1; \
	  ! command -v yosys >/dev/null || yosys -q -w "Replacing memory" -p "read_verilog -sv -defer -Irtl $(RTL); hierarchy -check -top $$top" >/dev/null || exit 1; \
	done
	@cd $(RTL_ROOT) && for top in $(BOARD_TOPS); do files="$(RTL) $(RTL_BOARD) rtl/board/$$top/$$top.sv $(CURDIR)/tests/board/vendor.sv"; \
	  $(VERILATOR) --lint-only --top-module $$top +define+SF_NO_TAP -Wall $(VERILATOR_UNROLL) -Irtl rtl/lint.vlt $$files || exit 1; \
	  ! command -v iverilog >/dev/null || iverilog -g2012 -Wall -Wno-timescale -DSF_NO_TAP -Irtl -s $$top -t null $$files || exit 1; \
	  ! command -v yosys >/dev/null || yosys -q -w "Replacing memory" -w "Replacing floating point" -p "read_verilog -sv -defer -DSF_NO_TAP -Irtl $$files; hierarchy -check -top $$top" >/dev/null || exit 1; \
	done

synth: $(RTL_READY) ## what each module costs on the 7 series by Yosys (LANES="32 64", MODULES=, SYNTH=--top): build/synth
	@tools/synth.sh $B --rtl $(RTL_ROOT) $(if $(LANES),--lanes "$(LANES)") $(if $(MODULES),--modules "$(MODULES)") $(SYNTH)
.PHONY: synth

# The scene that other targets take unless told otherwise is not meant here.
FPGA_SCENE = $(if $(filter file undefined,$(origin SCENE)),,--scene "$(SCENE)" --data "$(DATA)")
fpga: $(RTL_READY) $(if $(FPGA_SCENE),$B/bin/sf_cycles) ## place and route for an ECP5: cost, f_max, longest path (MODULES=, SCENE= DATA=; tools from PyPI): build/fpga
	@python3 tools/fpga.py $B --rtl $(RTL_ROOT) $(if $(MODULES),--modules "$(MODULES)") $(FPGA_SCENE) $(FPGA)
.PHONY: fpga

# The field's cache gets the look-ups of a scene.
$B/asic/lookups: $B/obj/tools/asic/lookups.o $B/libspikefield.a
	@mkdir -p $(@D)
	$(call say,LD    $@)
	$Q$(CC) -fopenmp $(SAN) -o $@ $^ $(LIBS)

asic-energy: $(RTL_READY) $B/bin/sf_cosim $B/asic/lookups ## what a MAC, a SOP and a neuron update cost in standard cells (LIBERTY=, NAME=, NODE=, SCENE= DATA=): build/asic, prices for --tech
	@python3 tools/asic_energy.py $B --rtl $(RTL_ROOT) $(if $(LIBERTY),--liberty "$(LIBERTY)") $(if $(NAME),--name "$(NAME)") \
	  $(if $(NODE),--node $(NODE)) --scene "$(SCENE)" --data "$(DATA)" $(ASIC_ENERGY)
asic: $(RTL_READY) ## netlist of standard cells: area, longest path of each module, hand-over (LIBERTY=, MODULES=, MHZ=): build/asic
	@python3 tools/asic_netlist.py $B --rtl $(RTL_ROOT) $(if $(LIBERTY),--liberty "$(LIBERTY)") $(if $(NAME),--name "$(NAME)") \
	  $(if $(MODULES),--modules "$(MODULES)") $(if $(MHZ),--clock $(MHZ)) $(ASIC)
netlist-check: $B/bin/sf_export $B/bin/sf_train $B/bin/sf_scene $B/bin/sf_cosim $(RTL_READY) ## the vector kit through a mapped netlist, and planted errors (CELLS="ecp5 liberty", MODULES=, LIBERTY=): build/netlist
	@python3 tools/netlist_check.py $B --rtl $(RTL_ROOT) --debian --modules "$(or $(MODULES),sf_plif)" $(if $(CELLS),--cells "$(CELLS)") \
	  $(if $(LIBERTY),--liberty "$(LIBERTY)") $(NETLIST)
deps-asic: ## install with apt what asic and asic-energy take by default (opensta, qflow-tech-osu018)
	@DEPS="python3 yosys iverilog opensta qflow-tech-osu018" tools/deps.sh
.PHONY: asic-energy asic netlist-check deps-asic

# Programs of rays around a block with fewer lanes and another cache than the package's: $B/lanes/N/sim_render and sf_soc.
CACHE_32 := -GCACHE_BYTES=1024 -GCACHE_WAYS=1
CACHE_64 := -GCACHE_BYTES=8192 -GCACHE_WAYS=2
define lanes_rule
$(call verilated_top_rule,$B/lanes/$1/ray,$(RTL_ROOT),$(RTL_READY),sf_ray_top,pins_ray)
$B/lanes/$1/ray/Vsf_ray_top.mk: VERILATOR_FLAGS += -GLANES=$1 $$(CACHE_$1)
$B/lanes/$1/%: $B/obj/tools/%.o $B/lanes/$1/ray/pins_ray.o $B/lanes/$1/ray/Vsf_ray_top__ALL.a $(DUT_LIBS) $B/libspikefield.a
	$$(call say,LD    $$@)
	$$Q$$(CXX) -fopenmp $(SAN) -o $$@ $$^ $(DUT_LDLIBS) $(UNICORN_LIBS) $$(LIBS)
endef
$(foreach n,32 64,$(eval $(call lanes_rule,$n)))

lanes: all firmware $B/faults/make_scene ## 32, 64, 256 lanes: samples, rays, firmware, vector kit in both simulators, synthesis of a module (128: make check)
	@tests/chain/lanes.sh $B --whole
.PHONY: lanes

# The vector kit: writer, and the files that go with every kit.
KIT_OBJ := $B/obj/sim/kit/kit.o $B/obj/sim/kit/draw.o $B/obj/sim/kit/images.o $B/obj/sim/kit/rays.o $B/obj/sim/kit/output.o $B/obj/sim/packet.o \
  $B/obj/sim/ray/request.o $B/obj/firmware/sf_driver.o $B/obj/firmware/sf_ray_driver.o $B/kit/files.o
KIT_FILES := sf_kit_tb.sv sf_ray_kit_tb.sv sf_kit_bus.svh sf_kit_pins.svh sf_kit_ports.svh Makefile README.md
$B/kit/files.c: $(KIT_FILES:%=sim/kit/%) $(RTL_READY) tools/embed.sh
	@mkdir -p $(@D)
	$(call say,EMBED $@)
	$Qtools/embed.sh sf_kit_files sim/kit/kit.h $(foreach f,$(KIT_FILES),$f=sim/kit/$f) \
	  $(foreach f,$(RTL) $(wildcard rtl/*.svh) rtl/lint.vlt,$f=$(RTL_ROOT)/$f) >$@
$B/kit/files.o: $B/kit/files.c sim/kit/kit.h
	$(call say,CC    $@)
	$Q$(CC) $(CFLAGS_ALL) -c $< -o $@
$B/bin/sf_export: $(KIT_OBJ) $B/obj/tools/export/extras.o $B/obj/tools/export/report.o

# sf_cosim --dut builds itself around another accelerator. Folders that lie in the source tree can move with it.
$B/obj/sim/other_dut.o: CFLAGS += -DSF_SOURCE_ROOT='"$(if $(filter /%,$B),$(CURDIR),$(shell realpath -m --relative-to=$B .))"'
ifneq ($(DUT_OUT),)
include sim/dut.mk
endif
