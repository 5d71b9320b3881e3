#include "firmware/sf_uart.h"
#include "firmware/sf_soc.h"

static void put(char c)
{
  *(volatile uint32_t *)SF_SOC_UART = (uint8_t)c;
}

void sf_uart_text(const char *text)
{
  while (*text) put(*text++);
}

void sf_uart_number(const char *label, uint64_t value)
{
  char digits[21] = "", *at = digits + 20;
  do *--at = (char)('0' + value % 10);
  while (value /= 10);
  sf_uart_text(label);
  sf_uart_text(at);
}

void sf_uart_hex(const char *label, uint32_t value)
{
  sf_uart_text(label);
  for (int shift = 28; shift >= 0; shift -= 4) put("0123456789abcdef"[value >> shift & 15]);
}
