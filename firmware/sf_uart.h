/* Text over the UART: no libc, no buffer. */
#ifndef SF_FIRMWARE_SF_UART_H
#define SF_FIRMWARE_SF_UART_H
#include <stdint.h>

void sf_uart_text(const char *text);
void sf_uart_number(const char *label, uint64_t value); /* label, then decimal digits */
void sf_uart_hex(const char *label, uint32_t value);    /* label, then 8 digits */
#endif
