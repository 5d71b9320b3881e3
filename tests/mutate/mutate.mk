# Mutation score of the RTL's checkers: tests/mutate/modules. Included by the Makefile. See docs/mutation.md.

MUTANTS ?= 60
MODULES ?=
mutate: $B/libspikefield.a $(UNIT_RUNTIME) ## mutate the RTL's modules and count what their checkers kill (MUTANTS=60 per module; MODULES="sf_plif ...")
	@tests/mutate/units.py $B --mutants $(MUTANTS) $(MODULES)
.PHONY: mutate

# Mutants of the source: written into a copy of rtl/ in $B/mutate/GROUP, all of a group in one build.
# MUTATED_GROUP: modules, with what $(MUTATE_GROUP) says to operators.py; MUTANT_CHECKERS_MODULE or else
# MUTANT_CHECKERS_GROUP: programs in that folder, in the order in which they run.
MUTATED_engine := sf_engine sf_core sf_turns sf_c1_inputs sf_fed_layers sf_narrow sf_fed sf_tap sf_values sf_sums sf_spikes sf_neurons sf_rows sf_counters sf_readout sf_csr sf_top
MUTATED_lanes := sf_values sf_sums sf_spikes sf_neurons
MUTATED_ray := sf_cache sf_cache_tags sf_fetch sf_grid sf_grid_cell sf_grid_weight sf_trilinear sf_fifo sf_sh sf_encoder \
  sf_exp_neg sf_composite sf_ray_track sf_ray_csr sf_ray_top sf_field sf_planes sf_planes_reads sf_planes_mix sf_basis sf_activation sf_dir_phase sf_waves \
  sf_light sf_rescale sf_mul_28x25
MUTATE_lanes := --lanes
MUTANT_CHECKERS_engine := test_rtl_registers test_rtl_counters test_rtl_ports test_rtl_disturbed test_rtl test_rtl_decoder test_rtl_hard
MUTANT_CHECKERS_lanes := test_rtl_disturbed test_rtl test_rtl_decoder test_rtl_hard
MUTANT_CHECKERS_ray := test_rtl_ray_registers test_rtl_ray_program test_rtl_ray_lone test_rtl_ray_field test_rtl_ray test_rtl_ray_planes
$(foreach m,sf_cache sf_cache_tags sf_fetch,$(eval MUTANT_CHECKERS_$m := test_rtl_cache test_rtl_encoder test_rtl_ray_field test_rtl_ray_planes))
$(foreach m,sf_grid sf_grid_cell sf_grid_weight sf_trilinear sf_fifo,$(eval MUTANT_CHECKERS_$m := test_rtl_grid test_rtl_encoder))
MUTANT_CHECKERS_sf_sh := test_rtl_sh test_rtl_encoder
MUTANT_CHECKERS_sf_encoder := test_rtl_encoder test_rtl_ray test_rtl_ray_planes
$(foreach m,sf_activation sf_dir_phase sf_waves sf_rescale,$(eval MUTANT_CHECKERS_$m := test_rtl_planes test_rtl_ray_planes))
$(foreach m,sf_planes sf_planes_reads sf_planes_mix sf_basis sf_light,$(eval MUTANT_CHECKERS_$m := test_rtl_ray_planes))
MUTANT_CHECKERS_sf_mul_28x25 := test_rtl_composite test_rtl_ray test_rtl_ray_planes
$(foreach m,sf_exp_neg sf_composite,$(eval MUTANT_CHECKERS_$m := test_rtl_composite test_rtl_ray test_rtl_ray_planes))
MUTANT_CHECKERS_sf_ray_track := test_rtl_ray_track test_rtl_ray

COMMA := ,
SPACE := $(subst ,, )
mutants_of = $(foreach m,$(MUTATED_$1),$m:$(subst $(SPACE),$(COMMA),$(strip $(or $(MUTANT_CHECKERS_$m),$(MUTANT_CHECKERS_$1)))))
mutant_programs = $(sort $(foreach m,$(MUTATED_$1),$(or $(MUTANT_CHECKERS_$m),$(MUTANT_CHECKERS_$1))))
MUTANT_OBJ := $B/obj/tests/ck_main.o $B/obj/tests/mutate/mutant.o $B/obj/tests/mutate/first_failure.o
# The first check that fails ends a checker.
MUTANT_LDFLAGS := -Wl,--wrap=_ck_assert_failed
define mutants_rule
$B/mutate/$1/.written: $(RTL_READY) tests/mutate/operators.py
	$$(call say,MUTATE $$(@D)/rtl)
	$$Qrm -rf $$(@D)/rtl && mkdir -p $$(@D) && cp -r $(RTL_ROOT)/rtl $$(@D)/rtl
	$$Qpython3 tests/mutate/operators.py $(MUTATE_$1) $(RTL_ROOT)/rtl $$(@D)/rtl $(MUTATED_$1)
	@touch $$@
mutate-$1: $(addprefix $B/mutate/$1/,$(call mutant_programs,$1))
	@tests/mutate/sources.py $B/mutate/$1 --mutants $(MUTANTS) --modules "$(MODULES)" $(call mutants_of,$1)
listed-$1: $B/mutate/$1/.written
	@tests/mutate/sources.py $B/mutate/$1 --listed $(call mutants_of,$1)
.PHONY: mutate-$1 listed-$1
endef
$(foreach g,engine lanes ray,$(eval $(call mutants_rule,$g)))
mutate-engine: ## mutants of the source of the samples-in accelerator, against the co-simulation (MUTANTS, MODULES as mutate)
mutate-lanes: ## mutants of its arithmetic in every lane (loops over lanes)
mutate-ray: ## mutants of what goes around it from rays to pixels, against unit benches and the co-simulation of rays

MUTANT_VERILATOR := -Wno-lint -Wno-style -Wno-fatal
define mutated_dut_rule
$B/mutate/$1/verilated/Vsf_top.mk: VERILATOR_FLAGS += $(MUTANT_VERILATOR)
$(call verilated_rule,$B/mutate/$1/verilated,$B/mutate/$1,$B/mutate/$1/.written)
$(MUTANT_CHECKERS_$1:%=$B/mutate/$1/%): $B/mutate/$1/%: $B/obj/tests/%.o $(MUTANT_OBJ) $B/mutate/$1/verilated/libsfdut.a $B/libspikefield.a
	$$(call say,LD    $$@)
	$$Q$$(CXX) -fopenmp $$(SAN) $(MUTANT_LDFLAGS) -o $$@ $$^ $$(DUT_LDLIBS) $$(CHECK_LIBS) $$(LIBS)
endef
$(foreach g,engine lanes,$(eval $(call mutated_dut_rule,$g)))

# Around an accelerator without mutants; and the unit benches.
MUTATED_RAY := $B/mutate/ray
$(eval $(call verilated_top_rule,$(MUTATED_RAY)/verilated,$(MUTATED_RAY),$(MUTATED_RAY)/.written,sf_ray_top,pins_ray))
$(MUTATED_RAY)/verilated/Vsf_ray_top.mk: VERILATOR_FLAGS += $(MUTANT_VERILATOR)
$(MUTANT_CHECKERS_ray:%=$(MUTATED_RAY)/%): $(MUTATED_RAY)/%: $B/obj/tests/%.o $(MUTANT_OBJ) $(MUTATED_RAY)/verilated/pins_ray.o \
  $(MUTATED_RAY)/verilated/Vsf_ray_top__ALL.a $(DUT_LIBS) $B/libspikefield.a
	$(call say,LD    $@)
	$Q$(CXX) -fopenmp $(SAN) $(MUTANT_LDFLAGS) -o $@ $^ $(DUT_LDLIBS) $(CHECK_LIBS) $(LIBS)
MUTATED_UNIT_TESTS := $(filter $(UNIT_TESTS),$(call mutant_programs,ray))
$(foreach u,$(sort $(foreach t,$(MUTATED_UNIT_TESTS),$(UNITS_$t))),$(eval \
  $(call unit_rule,$u,$(MUTATED_RAY)/units,$(MUTATED_RAY),$(MUTATED_RAY)/.written)))
$(MUTATED_RAY)/units/%: UNIT_FLAGS += $(MUTANT_VERILATOR)
$(foreach t,$(MUTATED_UNIT_TESTS),$(eval $(call unit_test_rule,$t,$(MUTATED_RAY),$(MUTATED_RAY)/units,$(MUTANT_OBJ) $(MUTANT_LDFLAGS))))

# Mutants of the C code, each in an object of its own, against the C tests. Left out: what takes long, and what drives the
# Verilated accelerator. MODULES: rooms or files; SAMPLE=N of each, drawn with SEED; MATCH=text; MINUTES; JOBS.
C_SLOW_TESTS := test_budget test_fx_vector test_view
C_MUTANT_TESTS := $(filter-out $(C_SLOW_TESTS) $(DUT_TESTS) $(UNIT_TESTS),$(TESTS))
C_MUTATE = $(if $(filter-out file,$(origin SAMPLE)),$(if $(SAMPLE),--sample $(SAMPLE))) $(if $(SEED),--seed $(SEED)) $(JOBS:%=--jobs %) \
  $(if $(MATCH),--match "$(MATCH)") $(if $(filter-out file,$(origin MINUTES)),--minutes $(MINUTES))
# What make would run to build the objects and the programs.
mutate-c-commands:
	@mkdir -p $B/mutate-c
	@$(MAKE) -s -n V=1 $(LIB_SRC:%=-W %) $(LIB_SRC:%.c=$B/obj/%.o) $(C_MUTANT_TESTS:%=$B/tests/%) >$B/mutate-c/commands
mutate-c: $(C_MUTANT_TESTS:%=$B/tests/%) $B/obj/tests/mutate/first_failure.o ## mutants of the C code, against the C tests (MODULES="src/train ..."; SAMPLE=40 of each, SEED=1, MINUTES=9, JOBS=16)
	@$(MAKE) mutate-c-commands
	@tests/mutate/c_mutants.py $B $(MODULES) $(C_MUTATE)
mutate-c-reach: $(C_MUTANT_TESTS:%=$B/tests/%) $B/obj/tests/mutate/first_failure.o
	@$(MAKE) mutate-c-commands
	@tests/mutate/c_mutants.py $B $(MODULES) $(JOBS:%=--jobs %) --reach-only
listed-c: mutate-c-commands
	@tests/mutate/c_mutants.py $B --listed
.PHONY: mutate-c mutate-c-commands mutate-c-reach listed-c
