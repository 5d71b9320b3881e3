# Generated RTL, the Verilated accelerator, planted faults, lint, firmware. Included by the Makefile, which defines B, Q,
# say, CC, CXX, CFLAGS_ALL and the rule for $B/obj/%.o.

VERILATOR ?= verilator
VERILATOR_ROOT := $(shell $(VERILATOR) --getenv VERILATOR_ROOT 2>/dev/null)
RTL_PKG := rtl/gen/sf_arch_pkg.sv rtl/gen/sf_csr_pkg.sv rtl/sf_op_pkg.sv
RTL_MODULES := $(filter-out $(RTL_PKG),$(wildcard rtl/gen/*.sv rtl/*.sv))
RTL := $(RTL_PKG) $(RTL_MODULES)
RTL_ALL := $(RTL) $(wildcard rtl/*.svh) rtl/lint.vlt
# A build with ARCH has a copy of rtl/ with packages of its own widths.
RTL_ROOT := $(if $(ARCH_INCLUDE),$B/variant,.)
RTL_READY := $(if $(ARCH_INCLUDE),$B/variant/.generated,$(RTL_ALL))
# Loops over lanes are written for unrolling; see docs/rtl.md.
VERILATOR_UNROLL := --unroll-count 256 --unroll-stmts 1000000
VERILATOR_FLAGS := --cc --prefix Vsf_top --top-module sf_top -Wall -O3 --x-assign unique --x-initial unique --trace-fst \
  $(VERILATOR_UNROLL)
VERILATED_OPT := OPT_FAST=-O2 OPT_SLOW=-O1 OPT_GLOBAL=-O2

DUT_OBJ := $(patsubst %.c,$B/obj/%.o,$(wildcard sim/*.c) firmware/sf_driver.c firmware/sf_blob.c)
VERILATED_OBJ := $(addprefix $B/verilated/runtime/,verilated.o verilated_fst_c.o verilated_threads.o)

# $1 folder of the library, $2 folder that holds rtl/, $3 prerequisites
define verilated_rule
$1/Vsf_top.mk: $3
	@mkdir -p $1
	$$(call say,VERI  $1)
	$$Qcd $2 && $$(VERILATOR) $$(VERILATOR_FLAGS) -Irtl --Mdir $$(abspath $1) rtl/lint.vlt $$(RTL)
$1/Vsf_top__ALL.a: $1/Vsf_top.mk
	$$(call say,CXX   $$@)
	$$Q$$(MAKE) -s -C $1 -f Vsf_top.mk $$(VERILATED_OPT) CXX=$$(CXX) Vsf_top__ALL.a >/dev/null
	@touch $$@
$1/pins.o: sim/pins.cpp sim/pins.h $1/Vsf_top.mk
	$$(call say,CXX   $$< -> $$@)
	$$Q$$(CXX) -std=c++17 -O2 -Wall -Wextra $(if $(CI),-Werror) -I. -isystem $$(VERILATOR_ROOT)/include -isystem $1 -c $$< -o $$@
$1/libsfdut.a: $1/Vsf_top__ALL.a $1/pins.o $(DUT_OBJ) $(VERILATED_OBJ)
	$$(call say,AR    $$@)
	$$Qrm -f $$@ && cp $1/Vsf_top__ALL.a $$@ && $$(AR) rs $$@ $1/pins.o $(DUT_OBJ) $(VERILATED_OBJ) 2>/dev/null
endef

DUT_TESTS += test_rtl_ports test_rtl_hard
DUT_LIBS := $B/verilated/libsfdut.a
DUT_LDLIBS := -lz -lpthread

$B/verilated/runtime/%.o: $(VERILATOR_ROOT)/include/%.cpp
	@mkdir -p $(@D)
	$(call say,CXX   $<)
	$Q$(CXX) -std=c++17 -O2 -I$(VERILATOR_ROOT)/include -I$(VERILATOR_ROOT)/include/vltstd -c $< -o $@

$B/variant/.generated: $(RTL_ALL) $(ARCH_DEF) $B/bin/sf_gen
	$(call say,GEN   $(@D)/rtl)
	$Qrm -rf $(@D)/rtl && mkdir -p $(@D) && cp -r rtl $(@D)/rtl && $B/bin/sf_gen --root $(@D) $(RTL_ALL)
	@touch $@

$(eval $(call verilated_rule,$B/verilated,$(RTL_ROOT),$(RTL_READY)))

# Planted faults: a patched copy of rtl/; +fault=N chooses one at run time, +fault=0 none.
FAULTS := $(sort $(wildcard tests/faults/*.patch))
$B/faults/.patched: $(RTL_READY) $(FAULTS)
	$(call say,PATCH $(@D)/rtl)
	$Qrm -rf $(@D)/rtl && mkdir -p $(@D) && cp -r $(RTL_ROOT)/rtl $(@D)/rtl
	$Qfor p in $(FAULTS); do patch -s -p1 -d $(@D) <$$p || exit 1; done
	@touch $@
$(eval $(call verilated_rule,$B/faults/verilated,$B/faults,$B/faults/.patched))
$B/faults/sf_cosim: $B/obj/tools/sf_cosim.o $B/faults/verilated/libsfdut.a $B/libspikefield.a
	$(call say,LD    $@)
	$Q$(CXX) -fopenmp $(SAN) -o $@ $^ $(DUT_LDLIBS) $(LIBS)
$B/faults/make_scene: $B/obj/tests/faults/make_scene.o $B/libspikefield.a
	@mkdir -p $(@D)
	$(call say,LD    $@)
	$Q$(CC) -fopenmp $(SAN) -o $@ $^ $(CHECK_LIBS) $(shell pkg-config --libs check 2>/dev/null) $(LIBS)
faults: $B/faults/sf_cosim $B/faults/make_scene ## the co-simulation with planted faults, for its own test

$B/bin/sf_gen: $(patsubst %.c,$B/obj/%.o,$(wildcard tools/gen/*.c))

gen: $B/bin/sf_gen ## rewrite rtl/gen, spikefield.core and docs/registers.md from arch.def, csr.def, the tables and the list of RTL files
	@$B/bin/sf_gen --root $(RTL_ROOT) $(RTL_ALL)

gen-check: $B/bin/sf_gen ## generated files are those that the sources give
	@rm -rf $B/gen-check && $B/bin/sf_gen --root $B/gen-check $(RTL_ALL)
	@diff -r $B/gen-check/rtl/gen rtl/gen && diff $B/gen-check/docs/registers.md docs/registers.md && \
	  diff $B/gen-check/spikefield.core spikefield.core && tools/check_mirror.sh

lint: $(RTL_READY) ## Verilator, Icarus and Yosys (where installed) accept the RTL, without warnings
	@cd $(RTL_ROOT) && $(VERILATOR) --lint-only --top-module sf_top -Wall $(VERILATOR_UNROLL) -Irtl rtl/lint.vlt $(RTL)
	@cd $(RTL_ROOT) && $(VERILATOR) --lint-only --top-module sf_plif -Wall -Irtl rtl/lint.vlt $(RTL_PKG) rtl/sf_plif.sv
	@if command -v iverilog >/dev/null; then cd $(RTL_ROOT) && iverilog -g2012 -Wall -Wno-timescale -Irtl -s sf_top -t null $(RTL); fi
	@if command -v yosys >/dev/null; then cd $(RTL_ROOT) && yosys -q -w "Replacing memory" -p "read_verilog -sv -Irtl $(RTL); hierarchy -check -top sf_top" >/dev/null; fi

synth: $(RTL_READY) ## what each module costs on the 7 series by Yosys (LANES="32 64", MODULES=, SYNTH=--top): build/synth
	@tools/synth.sh $B --rtl $(RTL_ROOT) $(if $(LANES),--lanes "$(LANES)") $(if $(MODULES),--modules "$(MODULES)") $(SYNTH)
.PHONY: synth

# Firmware: freestanding, RV32IM.
RISCV ?= riscv64-unknown-elf-
RISCV_FLAGS := -std=c11 -Os -Wall -Wextra -Wpedantic -Werror -march=rv32im_zicsr -mabi=ilp32 -mcmodel=medany -ffreestanding \
  -ffunction-sections -fdata-sections $(ARCH_INCLUDE) -Iinclude -I.
FIRMWARE_SRC := firmware/crt0.S firmware/images.S firmware/main.c firmware/sf_driver.c firmware/sf_blob.c
FIRMWARE_OBJ := $(patsubst %,$B/%.rv32.o,$(basename $(FIRMWARE_SRC)))
$B/firmware/%.rv32.o: firmware/%.c $(wildcard firmware/*.h) $(ARCH_DEF) include/spikefield/csr.def
	@mkdir -p $(@D)
	$(call say,RV32  $<)
	$Q$(RISCV)gcc $(RISCV_FLAGS) -c $< -o $@
$B/firmware/%.rv32.o: firmware/%.S
	@mkdir -p $(@D)
	$(call say,RV32  $<)
	$Q$(RISCV)gcc $(RISCV_FLAGS) -c $< -o $@
$B/firmware/sf_firmware.elf: $(FIRMWARE_OBJ) firmware/link.ld
	$(call say,RV32  $@)
	$Q$(RISCV)gcc -march=rv32im -mabi=ilp32 -nostdlib -static -Wl,--gc-sections -Wl,--no-warn-rwx-segments -T firmware/link.ld \
	  -o $@ $(FIRMWARE_OBJ) -lgcc
ifneq ($(shell command -v $(RISCV)gcc 2>/dev/null),)
firmware: $B/firmware/sf_firmware.elf ## the driver and its bare-metal program for RV32IM
else
firmware:
	@echo "  firmware: $(RISCV)gcc is not installed, skipped"
endif
