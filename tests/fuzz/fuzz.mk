# Fuzzing: targets tests/fuzz/fuzz_NAME.c, built with clang for `make fuzz` and with any compiler for their replay in
# `make check`. Included by the Makefile. See docs/fuzzing.md.

FUZZ_TIME ?= 60
FUZZ_JOBS ?= 1
CLANG ?= clang
FUZZ_TARGETS := $(patsubst tests/fuzz/fuzz_%.c,%,$(wildcard tests/fuzz/fuzz_*.c))
FUZZ ?= $(FUZZ_TARGETS)
FUZZ_SAN := -fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=all -fno-omit-frame-pointer
# Beside the target: the firmware is in no library.
FUZZ_WITH := $(patsubst %,$B/obj/%.o,firmware/sf_blob firmware/sf_driver firmware/sf_tile)
FUZZ_REPLAYS := $(FUZZ_TARGETS:%=$B/tests/fuzz/%) $B/tests/fuzz/seeds

$B/tests/fuzz/seeds: $B/obj/tests/fuzz/seeds.o $B/obj/sim/soc/image.o $B/obj/sim/ray/request.o $(FUZZ_WITH) $B/libspikefield.a
	@mkdir -p $(@D)
	$(call say,LD    $@)
	$Q$(CC) -fopenmp $(SAN) -o $@ $(filter %.o,$^) $B/libspikefield.a $(CHECK_LIBS) $(LIBS)
$(FUZZ_TARGETS:%=$B/tests/fuzz/%): $B/tests/fuzz/%: $B/obj/tests/fuzz/fuzz_%.o $B/obj/tests/fuzz/replay.o $(FUZZ_WITH) $B/libspikefield.a
	@mkdir -p $(@D)
	$(call say,LD    $@)
	$Q$(CC) -fopenmp $(SAN) -o $@ $(filter %.o,$^) $B/libspikefield.a $(LIBS)

# Readers that are not in the library: the harness has them. seeds writes frames.
$B/tests/fuzz/elf $B/bin/fuzz_elf: $B/obj/sim/soc/elf.o
$B/tests/fuzz/frame $B/bin/fuzz_frame $B/tests/fuzz/seeds: $B/obj/sim/board/frame.o

# In build/fuzz, by clang, on one thread.
$(FUZZ_TARGETS:%=$B/bin/fuzz_%): $B/bin/fuzz_%: $B/obj/tests/fuzz/fuzz_%.o $(FUZZ_WITH) $B/libspikefield.a
	@mkdir -p $(@D)
	$(call say,LD    $@)
	$Q$(CC) $(SAN) -fsanitize=fuzzer -o $@ $(filter %.o,$^) $B/libspikefield.a $(LIBS)

fuzz: ## fuzz every file reader with clang, FUZZ_TIME=60 seconds each, FUZZ_JOBS=1 at a time; FUZZ=NAME chooses targets
	@tests/fuzz/run.sh --installed $(CLANG)
	@$(MAKE) $B/tests/fuzz/seeds
	@$(MAKE) B=$B/fuzz $(SAME_ARCH) CC=$(CLANG) OPT=-O1 SAN="$(FUZZ_SAN)" \
	  CFLAGS="-fsanitize=fuzzer-no-link -fno-openmp -Itests/fuzz/single -Wno-unknown-pragmas -Wno-unused-function" $(FUZZ:%=$B/fuzz/bin/fuzz_%)
	@tests/fuzz/run.sh $B $(FUZZ_TIME) $(FUZZ_JOBS) $(FUZZ)

# tests/fuzz/single/omp.h has everything of OpenMP that the library calls. `make check` has no clang, so it asks CC.
fuzz-single:
	@for file in $$(grep -l '<omp.h>' src/*/*.c); do \
	  $(CC) $(CFLAGS_ALL) -fno-openmp -Itests/fuzz/single -Wno-unknown-pragmas -fsyntax-only $$file || exit 1; done

deps-fuzz: ## install what `make fuzz` needs besides (clang)
	@DEPS="clang libclang-rt-dev" tools/deps.sh
.PHONY: fuzz fuzz-single deps-fuzz
