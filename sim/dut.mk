# sf_cosim with another accelerator in place of ours. Run by sf_cosim --dut; by hand, in the source tree:
#   make dut DUT="/abs/my_top.sv /abs/my_core.sv" DUT_TOP=my_top DUT_OUT=/abs/folder && /abs/folder/sf_cosim SCENE DATA
# DUT: Verilog sources in compilation order and options of Verilator (+incdir+, -I, -D), absolute paths.
DUT_TOP ?= sf_top
DUT_FILES := $(filter-out -% +%,$(DUT))
DUT_FLAGS := --cc --prefix Vsf_top --top-module $(DUT_TOP) -O3 -Wno-fatal -Wno-lint -Wno-style --x-assign unique \
  --x-initial unique $(VERILATOR_TRACE) $(VERILATOR_UNROLL)

# What Verilator read, included files too, is known after the first time.
$(DUT_OUT)/Vsf_top.mk: sim/dut.mk sim/sim.mk $(DUT_FILES) $(shell sed -n 's/^.*: //p' $(DUT_OUT)/Vsf_top__ver.d 2>/dev/null)
	@mkdir -p $(DUT_OUT)
	$(call say,VERI  $(DUT_OUT))
	$Q$(VERILATOR) $(DUT_FLAGS) --Mdir $(DUT_OUT) $(DUT)
	@touch $@

$(DUT_OUT)/Vsf_top__ALL.a: $(DUT_OUT)/Vsf_top.mk
	$(call say,CXX   $@)
	$Q$(MAKE) -s -C $(DUT_OUT) -f Vsf_top.mk $(VERILATED_OPT) CXX=$(VERILATED_CXX) Vsf_top__ALL.a >/dev/null
	@touch $@

-include $(DUT_OUT)/pins.d
$(DUT_OUT)/pins.o: sim/pins.cpp $(ARCH_DEF) tools/plusargs.sh $(DUT_OUT)/Vsf_top.mk
	$(call say,CXX   $< -> $@)
	$Q$(CXX) -std=c++17 -O2 $(ARCH_INCLUDE) -Iinclude -Isrc -I. -isystem $(VERILATOR_ROOT)/include -isystem $(DUT_OUT) \
	  -DSF_PLUSARGS="\"$$(tools/plusargs.sh $(DUT_OUT))\"" -MMD -MP -c $< -o $@

# The harness comes from our library; the block and its pins stand before it.
$(DUT_OUT)/sf_cosim: $B/obj/tools/sf_cosim.o $(DUT_OUT)/pins.o $(DUT_OUT)/Vsf_top__ALL.a $(DUT_LIBS) $B/libspikefield.a
	$(call say,LD    $@)
	$Q$(CXX) -fopenmp $(SAN) -o $@ $(filter %.o,$^) $(filter %.a,$^) $(DUT_LDLIBS) $(LIBS)

dut: $(DUT_OUT)/sf_cosim

.PHONY: dut
