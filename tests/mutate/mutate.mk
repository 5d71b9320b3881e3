# Mutation score of the RTL's checkers: tests/mutate/modules. Included by the Makefile. See docs/mutation.md.

MUTANTS ?= 60
MODULES ?=
mutate: $B/libspikefield.a $(UNIT_RUNTIME) ## mutate the RTL's modules and count what their checkers kill (MUTANTS=60 per module; MODULES="sf_plif ...")
	@tests/mutate/units.py $B --mutants $(MUTANTS) $(MODULES)
.PHONY: mutate

# The engine's control modules and sf_csr: mutants written into a copy of rtl/, the tests of the co-simulation as checkers.
ENGINE_MODULES := sf_core sf_pick sf_store sf_split sf_c2 sf_c1 sf_d1 sf_counters sf_readout sf_csr
ENGINE_CHECKERS := test_rtl_registers test_rtl_ports test_rtl_disturbed test_rtl test_rtl_decoder test_rtl_hard
ENGINE := $B/mutate/engine
$(ENGINE)/.written: $(RTL_READY) tests/mutate/operators.py
	$(call say,MUTATE $(@D)/rtl)
	$Qrm -rf $(@D)/rtl && mkdir -p $(@D) && cp -r $(RTL_ROOT)/rtl $(@D)/rtl
	$Qpython3 tests/mutate/operators.py $(RTL_ROOT)/rtl $(@D)/rtl $(ENGINE_MODULES)
	@touch $@
$(ENGINE)/verilated/Vsf_top.mk: VERILATOR_FLAGS += -Wno-lint -Wno-style -Wno-fatal
$(eval $(call verilated_rule,$(ENGINE)/verilated,$(ENGINE),$(ENGINE)/.written))
# The first check that fails ends a checker.
$(ENGINE)/%: $B/obj/tests/%.o $B/obj/tests/mutate/mutant.o $B/obj/tests/mutate/first_failure.o \
  $(ENGINE)/verilated/libsfdut.a $B/libspikefield.a
	$(call say,LD    $@)
	$Q$(CXX) -fopenmp $(SAN) -Wl,--wrap=_ck_assert_failed -o $@ $^ $(DUT_LDLIBS) $(CHECK_LIBS) $(LIBS)
mutate-engine: $(ENGINE_CHECKERS:%=$(ENGINE)/%) ## the same of the engine's control modules and sf_csr, by the co-simulation
	@tests/mutate/engine.py $(ENGINE) --mutants $(MUTANTS) --checkers "$(ENGINE_CHECKERS)" --modules "$(MODULES)" $(ENGINE_MODULES)
.PHONY: mutate-engine
