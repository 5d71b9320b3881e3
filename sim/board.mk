# A board: Verilated behind a pseudo-terminal for tests, and its bitstream. Included by sim/sim.mk.

# $1 folder, $2 rate of the line. The board's own parameters but for that rate: four cycles a bit instead of 16 2/3 make tests faster.
BOARD_FLAGS := --cc -Wall -O3 --x-assign unique --x-initial unique $(VERILATOR_UNROLL) +define+SF_NO_TAP
define board_rule
$1/sim/Vsf_board.mk: $(RTL_READY) $(RTL_BOARD)
	@mkdir -p $$(@D)
	$$(call say,VERI  $$(@D))
	$$Qcd $(RTL_ROOT) && $$(VERILATOR) $$(BOARD_FLAGS) -GBAUD=$2 --prefix Vsf_board --top-module sf_board -Irtl --Mdir $$(abspath $$(@D)) \
	  rtl/lint.vlt $$(RTL) $$(RTL_BOARD)
$1/sim/Vsf_board__ALL.a: $1/sim/Vsf_board.mk
	$$(call say,CXX   $$@)
	$$Q$$(MAKE) -s -C $$(@D) -f Vsf_board.mk $$(VERILATED_OPT) CXX=$$(VERILATED_CXX) Vsf_board__ALL.a >/dev/null
	@touch $$@
-include $1/sf_board.d
$1/sf_board.o: tests/board/sf_board.cpp $1/sim/Vsf_board.mk
	$$(call say,CXX   $$< -> $$@)
	$$Q$$(CXX) -std=c++17 -O2 -g -Wall -Wextra $(if $(CI),-Werror) $$(ARCH_INCLUDE) -DSF_BOARD_BAUD=$2 -Iinclude -Isrc -I. -isystem $$(VERILATOR_ROOT)/include \
	  -isystem $$(VERILATOR_ROOT)/include/vltstd -isystem $1/sim -MMD -MP -c $$< -o $$@
$1/sf_board: $1/sf_board.o $1/sim/Vsf_board__ALL.a $(UNIT_RUNTIME) $B/obj/sim/board/frame.o $(DUT_LIBS) $B/libspikefield.a
	$$(call say,LD    $$@)
	$$Q$$(CXX) -fopenmp $$(SAN) -o $$@ $$^ $$(DUT_LDLIBS) $$(CHECK_LIBS) $$(LIBS)
endef
$(eval $(call board_rule,$B/board,12500000))
$(eval $(call board_rule,$B/board/line,3000000))
board-sim: $B/board/sf_board ## a Verilated board behind a pseudo-terminal: build/board/sf_board LINK
board-picture: $B/board/line/sf_board $B/bin/sf_export $B/bin/sim_render ## 64 x 64 pixels of the demo's fitted scene over the simulated line at 3 Mbaud, against fixed (MODEL= DATA=): build/board/picture
	@tools/board_picture.sh $B $(or $(MODEL),$B/demo/model.safetensors) $(or $(DATA),$B/demo/scene)
.PHONY: board-sim board-picture

BOARD ?= ulx3s
board: $(RTL_READY) ## the bitstream of a board (BOARD=ulx3s, BOARD_FLOW="--seed 2"; tools from PyPI), about 45 minutes: build/board
	@python3 tools/board.py $B --rtl $(RTL_ROOT) --board $(BOARD) $(BOARD_FLOW)
.PHONY: board
