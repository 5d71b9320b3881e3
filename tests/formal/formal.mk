# Formal proofs of RTL units and protocols: tests/formal/properties. Included by the Makefile. See docs/formal.md.

PROPERTIES ?=
formal: ## prove the RTL's properties and see planted faults fail (4 minutes; PROPERTIES="NAME ..." chooses some)
	@tests/formal/run.sh $B $(PROPERTIES)
.PHONY: formal
