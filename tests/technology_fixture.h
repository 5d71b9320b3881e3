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
