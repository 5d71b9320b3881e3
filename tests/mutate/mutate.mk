# Mutation score of the RTL's checkers: tests/mutate/modules. Included by the Makefile. See docs/mutation.md.

MUTANTS ?= 60
MODULES ?=
mutate: $B/libspikefield.a ## mutate the RTL's modules and count what their checkers kill (MUTANTS=60 per module; MODULES="sf_plif ...")
	@tests/mutate/mutate.sh $B --mutants $(MUTANTS) $(MODULES)
.PHONY: mutate
