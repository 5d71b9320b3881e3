# Line, toggle and functional coverage of the RTL, in a build of its own. Included by the Makefile.
COVER := $B/coverage
COVER_TESTS := test_rtl test_rtl_registers test_rtl_counters test_rtl_decoder test_rtl_ports test_rtl_hard test_rtl_disturbed
# From rays to pixels: both fields, their cache, the compositor.
COVER_TESTS += test_rtl_ray test_rtl_ray_field test_rtl_ray_planes test_rtl_ray_lone test_rtl_ray_program test_rtl_ray_registers
coverage: ## line, toggle and functional coverage of the RTL: table, holes, build/coverage/lcov.info (about an hour)
	@mkdir -p $(COVER)/points
	@$(MAKE) B=$(COVER) $(SAME_ARCH) COVERAGE=$(COVER)/points coverage-run

coverage-run: $(COVER_TESTS:%=$B/tests/%) $B/bin/sf_cosim $B/bin/sf_scene $B/coverage_report $B/faults/make_scene
	@tests/coverage.sh $B $(COVER_TESTS)

$B/coverage_report: $B/obj/tests/coverage/report.o $(DUT_LIBS) $B/libspikefield.a
	$(call say,LD    $@)
	$Q$(CXX) -fopenmp $(SAN) -o $@ $^ $(DUT_LDLIBS) $(LIBS)
.PHONY: coverage coverage-run
