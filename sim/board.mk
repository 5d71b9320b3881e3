# A board: Verilated behind a pseudo-terminal for tests, and its bitstream. Included by sim/sim.mk.

# The board's own parameters but for the rate of its line: four cycles a bit instead of 16 2/3 make a test four times as fast.
BOARD_FLAGS := --cc -Wall -O3 --x-assign unique --x-initial unique $(VERILATOR_UNROLL) +define+SF_NO_TAP -GBAUD=12500000
$B/board/sim/Vsf_board.mk: $(RTL_READY) $(RTL_BOARD)
	@mkdir -p $(@D)
	$(call say,VERI  $(@D))
	$Qcd $(RTL_ROOT) && $(VERILATOR) $(BOARD_FLAGS) --prefix Vsf_board --top-module sf_board -Irtl --Mdir $(abspath $(@D)) rtl/lint.vlt $(RTL) $(RTL_BOARD)
$B/board/sim/Vsf_board__ALL.a: $B/board/sim/Vsf_board.mk
	$(call say,CXX   $@)
	$Q$(MAKE) -s -C $(@D) -f Vsf_board.mk $(VERILATED_OPT) CXX=$(VERILATED_CXX) Vsf_board__ALL.a >/dev/null
	@touch $@
-include $B/board/sf_board.d
$B/board/sf_board.o: tests/board/sf_board.cpp $B/board/sim/Vsf_board.mk
	$(call say,CXX   $< -> $@)
	$Q$(CXX) -std=c++17 -O2 -g -Wall -Wextra $(if $(CI),-Werror) $(ARCH_INCLUDE) -Iinclude -Isrc -I. -isystem $(VERILATOR_ROOT)/include \
	  -isystem $(VERILATOR_ROOT)/include/vltstd -isystem $B/board/sim -MMD -MP -c $< -o $@
$B/board/sf_board: $B/board/sf_board.o $B/board/sim/Vsf_board__ALL.a $(UNIT_RUNTIME) $B/obj/sim/board/frame.o $(DUT_LIBS) $B/libspikefield.a
	$(call say,LD    $@)
	$Q$(CXX) -fopenmp $(SAN) -o $@ $^ $(DUT_LDLIBS) $(CHECK_LIBS) $(LIBS)
board-sim: $B/board/sf_board ## a Verilated board behind a pseudo-terminal: build/board/sf_board LINK
.PHONY: board-sim

BOARD ?= ulx3s
board: $(RTL_READY) ## the bitstream of a board (BOARD=ulx3s, BOARD_FLOW="--seed 2"; tools from PyPI), about 45 minutes: build/board
	@python3 tools/board.py $B --rtl $(RTL_ROOT) --board $(BOARD) $(BOARD_FLOW)
.PHONY: board
