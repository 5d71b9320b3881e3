# The firmware, freestanding RV32IM, and what runs it: Unicorn with the Verilated accelerator. Included by the Makefile.

RISCV_FLAGS := -std=c11 -Os -Wall -Wextra -Wpedantic -Werror -march=rv32im_zicsr -mabi=ilp32 -mcmodel=medany -ffreestanding \
  -ffunction-sections -fdata-sections -fno-tree-loop-distribute-patterns $(ARCH_INCLUDE) -Iinclude -Isrc -I. -Ifirmware/libc
FIRMWARE_SRC := $(wildcard firmware/*.S firmware/*.c) \
  $(addprefix src/fx/,render.c march.c grid.c tensorf.c composite.c exp2.c net.c current.c plif.c integrate.c sigmoid.c \
  softplus.c sine.c count.c)
FIRMWARE_OBJ := $(patsubst %,$B/obj/rv32/%.o,$(basename $(FIRMWARE_SRC)))
FIRMWARE := $B/firmware/sf_firmware.elf

$B/obj/rv32/%.o: %.c
	@mkdir -p $(@D)
	$(call say,RV32  $<)
	$Q$(RISCV)gcc $(RISCV_FLAGS) -MMD -MP -c $< -o $@
$B/obj/rv32/%.o: %.S
	@mkdir -p $(@D)
	$(call say,RV32  $<)
	$Q$(RISCV)gcc $(RISCV_FLAGS) -MMD -MP -c $< -o $@
$(FIRMWARE): $(FIRMWARE_OBJ) firmware/link.ld
	@mkdir -p $(@D)
	$(call say,RV32  $@)
	$Q$(RISCV)gcc -march=rv32im -mabi=ilp32 -nostdlib -static -Wl,--gc-sections -Wl,--no-warn-rwx-segments -T firmware/link.ld \
	  -o $@ $(FIRMWARE_OBJ) -lgcc

ifneq ($(shell command -v $(RISCV)gcc 2>/dev/null),)
firmware: $(FIRMWARE) ## the driver and its bare-metal program for RV32IM
else
firmware:
	@echo "  firmware: $(RISCV)gcc is not installed, skipped"
endif

ifeq ($(SOC_MISSING),)
$B/bin/sf_soc: | $(FIRMWARE)
endif
$B/bin/sf_soc $B/tests/test_soc $B/tests/test_soc_planes: DUT_LDLIBS += $(UNICORN_LIBS)

FIRMWARE_RUN ?= $B/demo/scene.snn $B/demo/scene
ifeq ($(SOC_MISSING),)
firmware-run: $(FIRMWARE) $B/bin/sf_soc ## the firmware renders a tile on the emulated system, after make demo or FIRMWARE_RUN="SCENE DATA ..."
	@for f in $(wordlist 1,2,$(FIRMWARE_RUN)); do [ -e $$f ] || { echo "firmware-run: no $$f: make demo first"; exit 1; }; done
	@$B/bin/sf_soc $(FIRMWARE_RUN)
else
firmware-run:
	@echo "  firmware-run: $(SOC_MISSING) not installed, skipped"
endif
.PHONY: firmware-run
