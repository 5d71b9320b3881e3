/* The reference system-on-chip: where the firmware finds what. The emulated system (sim/soc/soc.h) is built from the
 * same numbers; a port to another system changes them here and in link.ld. Macros, for C and assembler. */
#ifndef SF_FIRMWARE_SF_SOC_H
#define SF_FIRMWARE_SF_SOC_H

#define SF_SOC_ACCELERATOR 0x40000000 /* AXI4-Lite port of sf_top or sf_ray_top: csr.def */
#define SF_SOC_ACCELERATOR_SIZE 0x2000
#define SF_SOC_STREAM 0x40010000 /* AXI4-Stream ports of sf_top behind two FIFOs: below */
#define SF_SOC_UART 0x40020000   /* WO: character to send; never busy */
#define SF_SOC_POWER 0x40030000  /* WO: exit status of the program; ends it */
#define SF_SOC_RAYS 0x40040000   /* AXI4-Stream ports of sf_ray_top behind two FIFOs, in place of SF_SOC_STREAM */
#define SF_SOC_PAGE 0x1000       /* size of each of the last four */

/* Memory: program, data and stack first; the image (sf_tile.h) behind them, put there by a loader. sf_ray_top reads its
 * field from it, by the processor's addresses. */
#define SF_SOC_RAM 0x80000000
#define SF_SOC_RAM_SIZE 0x08000000
#define SF_SOC_PROGRAM_SIZE 0x00100000
#define SF_SOC_IMAGE (SF_SOC_RAM + SF_SOC_PROGRAM_SIZE)
#define SF_SOC_IMAGE_SPACE (SF_SOC_RAM_SIZE - SF_SOC_PROGRAM_SIZE)

/* Registers of the stream FIFOs, 32 bits. A beat in: LOW, HIGH, then CONTROL, which sends it. A result beat out:
 * RESULT_LOW, then RESULT_HIGH, which takes it. Sending without CAN_SEND or taking without HAS_RESULT is a fault. */
#define SF_STREAM_LOW 0x00
#define SF_STREAM_HIGH 0x04
#define SF_STREAM_CONTROL 0x08
#define SF_STREAM_CONTROL_FIRST 1 /* tuser */
#define SF_STREAM_CONTROL_LAST 2  /* tlast */
#define SF_STREAM_STATUS 0x0c
#define SF_STREAM_STATUS_CAN_SEND 1
#define SF_STREAM_STATUS_HAS_RESULT 2
#define SF_STREAM_RESULT_LOW 0x10
#define SF_STREAM_RESULT_HIGH 0x14

/* The same of rays. A beat in: its words (rtl/sf_ray_top.sv), lowest first, then CONTROL; words that were not written
 * are those of the beat before. A pixel out: its words, of which reading the last one takes it. */
#define SF_RAYS_BEAT 0x00
#define SF_RAYS_BEAT_WORDS 8
#define SF_RAYS_CONTROL 0x20 /* SF_STREAM_CONTROL_* */
#define SF_RAYS_STATUS 0x24  /* SF_STREAM_STATUS_* */
#define SF_RAYS_PIXEL 0x40
#define SF_RAYS_PIXEL_WORDS 12
#endif
