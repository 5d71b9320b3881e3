/* For the tests of prices: a plain technology, whose ledgers can be made by hand. */
#ifndef SF_TESTS_TECHNOLOGY_FIXTURE_H
#define SF_TESTS_TECHNOLOGY_FIXTURE_H
#include "energy/energy.h"
#include "base/io.h"
#include "folder_fixture.h"

/* An adder costs its bits, a multiplier the product of its widths, a register file its bits, an access 80 of memory and
 * 8000 of DRAM. */
static const char plain[] = "# comment\n"
                            "name plain\n"
                            "title  A plain technology  \n"
                            "\n"
                            "fp32_mac 4.6 pJ paper\n"
                            "fp32_add 0.9 pJ paper\n"
                            "int_add.32 32 fJ made up\n"
                            "int_add.8 8 fJ made up\n"
                            "int_multiply.8 64 fJ made up\n"
                            "int_multiply.32 1.024 pJ made up\r\n"
                            "sram.16384 80 fJ made up\n"
                            "sram.64 80 fJ made up\n"
                            "dram 0.008 nJ made up\n"
                            "register 32 fJ made up";

/* No two prices in proportion to their points. */
static const char crooked[] =
    "name crooked\ntitle Crooked\nfp32_mac 4.7 pJ a\nfp32_add 0.8 pJ b\nint_add.8 31 fJ c\n"
    "int_add.16 47 fJ c\nint_add.64 350 fJ c\nint_multiply.4 61 fJ d\nint_multiply.8 210 fJ d\n"
    "int_multiply.32 3.1 pJ d\nsram.1024 6 pJ e\nsram.8192 11 pJ e\nsram.65536 29 pJ e\n"
    "dram 1.95 nJ f\n";

static inline sf_status load_text(sf_technology *tech, const char *text)
{
  ck_ok(sf_write_file(in("t.tech"), text, strlen(text)));
  return sf_technology_load(tech, in("t.tech"));
}

static inline sf_technology plain_technology(void)
{
  sf_technology tech;
  ck_ok(load_text(&tech, plain));
  return tech;
}

#endif
