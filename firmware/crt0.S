# Stack, zeroed .bss, main; its result to the power register, then sleep for good.
#include "firmware/sf_soc.h"
  .section .text.start
  .globl _start
_start:
  la sp, __stack_top
  la t0, __bss_start
  la t1, __bss_end
1:
  bgeu t0, t1, 2f
  sw zero, 0(t0)
  addi t0, t0, 4
  j 1b
2:
  call main
  li t0, SF_SOC_POWER
  sw a0, 0(t0)
3:
  wfi
  j 3b
