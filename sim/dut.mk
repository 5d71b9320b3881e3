# sf_cosim or sim_render with another accelerator in place of ours. Run by their --dut; by hand, in the source tree:
#   make dut DUT="/abs/my_top.sv /abs/my_core.sv" DUT_TOP=my_top DUT_OUT=/abs/folder && /abs/folder/sf_cosim SCENE DATA
# DUT: Verilog sources in compilation order and options of Verilator (+incdir+, -I, -D), absolute paths.
# DUT_PROGRAM: sf_cosim, around a block with the ports of sf_top, or sim_render, of sf_ray_top.
DUT_PROGRAM ?= sf_cosim
DUT_MODEL := $(if $(filter sim_render,$(DUT_PROGRAM)),sf_ray_top,sf_top)
DUT_PINS := $(if $(filter sim_render,$(DUT_PROGRAM)),pins_ray,pins)
DUT_TOP ?= $(DUT_MODEL)
DUT_FILES := $(filter-out -% +%,$(DUT))
DUT_FLAGS := --cc --output-split 100000000 --prefix V$(DUT_MODEL) --top-module $(DUT_TOP) -O3 -Wno-fatal -Wno-lint -Wno-style --x-assign unique \
  --x-initial unique $(VERILATOR_TRACE) $(VERILATOR_UNROLL)

# What Verilator read, included files too, is known after the first time.
$(DUT_OUT)/V$(DUT_MODEL).mk: sim/dut.mk sim/sim.mk $(DUT_FILES) $(shell sed -n 's/^.*: //p' $(DUT_OUT)/V$(DUT_MODEL)__ver.d 2>/dev/null)
	@mkdir -p $(DUT_OUT)
	$(call say,VERI  $(DUT_OUT))
	$Q$(VERILATOR) $(DUT_FLAGS) --Mdir $(DUT_OUT) $(DUT)
	@touch $@

$(DUT_OUT)/V$(DUT_MODEL)__ALL.a: $(DUT_OUT)/V$(DUT_MODEL).mk
	$(call say,CXX   $@)
	$Q$(MAKE) -s -C $(DUT_OUT) -f V$(DUT_MODEL).mk $(VERILATED_OPT) CXX=$(VERILATED_CXX) V$(DUT_MODEL)__ALL.a >/dev/null
	@touch $@

-include $(DUT_OUT)/$(DUT_PINS).d
$(DUT_OUT)/$(DUT_PINS).o: sim/$(DUT_PINS).cpp $(ARCH_DEF) tools/plusargs.sh $(DUT_OUT)/V$(DUT_MODEL).mk
	$(call say,CXX   $< -> $@)
	$Q$(CXX) -std=c++17 -O2 $(ARCH_INCLUDE) -Iinclude -Isrc -I. -isystem $(VERILATOR_ROOT)/include -isystem $(DUT_OUT) \
	  -DSF_PLUSARGS="\"$$(tools/plusargs.sh $(DUT_OUT))\"" -MMD -MP -c $< -o $@

DUT_OBJ_sim_render := $B/obj/tools/render/options.o
DUT_OBJ_sf_cosim := $(RAY_LIBS) # of --top sf_ray_top, which is refused beside --dut

# The harness comes from our library; the block and its pins stand before it.
$(DUT_OUT)/$(DUT_PROGRAM): $B/obj/tools/$(DUT_PROGRAM).o $(DUT_OBJ_$(DUT_PROGRAM)) $(DUT_OUT)/$(DUT_PINS).o $(DUT_OUT)/V$(DUT_MODEL)__ALL.a $(DUT_LIBS) $B/libspikefield.a
	$(call say,LD    $@)
	$Q$(CXX) -fopenmp $(SAN) -o $@ $(filter %.o,$^) $(filter %.a,$^) $(DUT_LDLIBS) $(LIBS)

dut: $(DUT_OUT)/$(DUT_PROGRAM)

.PHONY: dut
