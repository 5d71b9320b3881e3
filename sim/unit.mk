# Unit benches: one Verilated module each, against its C mirror. Included by sim/sim.mk.
# UNITS_<test> are the modules that tests/<test>.cpp drives; UNIT_TOP_<unit> and UNIT_PARAMETERS_<unit> name variants.
UNITS_test_rtl_sh := sf_sh
UNITS_test_rtl_grid := sf_grid sf_grid_weight sf_trilinear
UNITS_test_rtl_cache := sf_cache sf_cache_1 sf_cache_2 sf_cache_8
UNIT_TOP_sf_cache_1 := sf_cache
UNIT_PARAMETERS_sf_cache_1 := -GCACHE_BYTES=1024 -GCACHE_WAYS=1
UNIT_TOP_sf_cache_2 := sf_cache
UNIT_PARAMETERS_sf_cache_2 := -GCACHE_BYTES=4096 -GCACHE_WAYS=2 -GLOG2_LOOKUPS=4 -GLOG2_LINES=2
UNIT_TOP_sf_cache_8 := sf_cache
UNIT_PARAMETERS_sf_cache_8 := -GCACHE_BYTES=2048 -GCACHE_WAYS=8
UNITS_test_rtl_encoder := sf_encoder sf_encoder_1
UNIT_TOP_sf_encoder_1 := sf_encoder
UNIT_PARAMETERS_sf_encoder_1 := -GCACHE_BYTES=1024 -GCACHE_WAYS=1
UNITS_test_rtl_composite := sf_exp_neg sf_composite
UNITS_test_rtl_ray_track := sf_ray_track
UNITS_test_rtl_carry := sf_counters sf_ray_csr sf_scale
UNIT_PARAMETERS_sf_counters := --public-flat-rw
UNIT_PARAMETERS_sf_ray_csr := --public-flat-rw
UNITS_test_rtl_planes := sf_activation sf_dir_phase sf_waves
UNITS_test_rtl_link := sf_link sf_link_slow
UNIT_TOP_sf_link_slow := sf_link
UNIT_PARAMETERS_sf_link := -GCLOCK_HZ=40000000 -GBAUD=10000000 -GMEMORY_BYTES=1024 +define+SF_NO_TAP
UNIT_PARAMETERS_sf_link_slow := -GMEMORY_BYTES=1024 +define+SF_NO_TAP
UNIT_RTL_sf_link := $(RTL_BOARD)
UNIT_RTL_sf_link_slow := $(RTL_BOARD)
UNIT_OBJ_test_rtl_link := $B/obj/sim/board/frame.o $B/obj/sim/board/link.o $B/verilated/libsfdut.a
UNIT_TESTS := test_rtl_sh test_rtl_grid test_rtl_cache test_rtl_encoder test_rtl_composite test_rtl_ray_track test_rtl_planes \
  test_rtl_link test_rtl_carry
TESTS += $(UNIT_TESTS)

LINT_TOPS := sf_ray_top
UNIT_TOPS := $(sort $(foreach t,$(UNIT_TESTS),$(UNITS_$t)))
UNIT_FLAGS := --cc -Wall -O3 --x-assign unique --x-initial unique $(VERILATOR_UNROLL)
UNIT_RUNTIME := $(addprefix $B/verilated/runtime/,verilated.o verilated_threads.o)

# $1 unit, $2 folder of the units, $3 folder that holds rtl/, $4 prerequisites
define unit_rule
$2/$1/V$1.mk: $4 $(UNIT_RTL_$1)
	@mkdir -p $2/$1
	$$(call say,VERI  $2/$1)
	$$Qcd $3 && $$(VERILATOR) $$(UNIT_FLAGS) --prefix V$1 --top-module $(or $(UNIT_TOP_$1),$1) \
	  $(UNIT_PARAMETERS_$1) -Irtl --Mdir $$(abspath $2/$1) rtl/lint.vlt $$(RTL) $(UNIT_RTL_$1)
$2/$1/V$1__ALL.a: $2/$1/V$1.mk
	$$Q$$(MAKE) -s -C $2/$1 -f V$1.mk $$(VERILATED_OPT) CXX=$$(VERILATED_CXX) V$1__ALL.a >/dev/null
	@touch $$@
endef
$(foreach u,$(UNIT_TOPS),$(eval $(call unit_rule,$u,$B/units,$(RTL_ROOT),$(RTL_READY))))

# $1 test, $2 folder of the program, $3 of its units, $4 objects and flags for linking it
define unit_test_rule
$3/$1.o: tests/$1.cpp $(foreach u,$(UNITS_$1),$3/$u/V$u.mk)
	@mkdir -p $$(@D)
	$$(call say,CXX   $$< -> $$@)
	$$Q$$(CXX) -std=c++17 -O2 -g -Wall -Wextra $(if $(CI),-Werror) $$(ARCH_INCLUDE) -Iinclude -Isrc -I. -isystem $$(VERILATOR_ROOT)/include \
	  -isystem $$(VERILATOR_ROOT)/include/vltstd $(foreach u,$(UNITS_$1),-isystem $3/$u) -MMD -MP -c $$< -o $$@
-include $3/$1.d
$2/$1: $3/$1.o $(foreach u,$(UNITS_$1),$3/$u/V$u__ALL.a) $(filter %.o,$4) $(UNIT_RUNTIME) $(UNIT_OBJ_$1) $B/libspikefield.a
	@mkdir -p $$(@D)
	$$(call say,LD    $$@)
	$$Q$$(CXX) -fopenmp $$(SAN) $(filter-out %.o,$4) -o $$@ $$^ $$(DUT_LDLIBS) $$(CHECK_LIBS) $$(LIBS)
endef
$(foreach t,$(UNIT_TESTS),$(eval $(call unit_test_rule,$t,$B/tests,$B/units)))
