/* The main of the test programs. */
#include "tests/ck_run.h"
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>

/* A program's own definitions take the place of these. */
__attribute__((weak)) int ck_timeout = 60;
__attribute__((weak)) ck_options ck_program;
__attribute__((weak)) int main(void)
{
  return ck_main();
}

Suite *ck_suite(void)
{
  static Suite *suite;
  if (!suite) suite = suite_create(program_invocation_short_name);
  return suite;
}

TCase *ck_new_case(const char *name)
{
  TCase *tests = tcase_create(name);
  tcase_set_timeout(tests, ck_timeout);
  tcase_add_unchecked_fixture(tests, ck_program.set_up_all, ck_program.tear_down_all);
  tcase_add_checked_fixture(tests, ck_program.set_up, ck_program.tear_down);
  suite_add_tcase(ck_suite(), tests);
  return tests;
}

TCase *ck_case(void)
{
  static TCase *tests;
  if (!tests) tests = ck_new_case("all");
  return tests;
}

int ck_main(void)
{
  setvbuf(stdout, NULL, _IOLBF, 0); /* a fork would print again what waits to be written */
  SRunner *runner = srunner_create(ck_suite());
  srunner_set_fork_status(runner, ck_program.one_process ? CK_NOFORK : CK_FORK_GETENV);
  srunner_run_all(runner, CK_ENV);
  const int failed = srunner_ntests_failed(runner);
  srunner_free(runner);
  return failed ? EXIT_FAILURE : EXIT_SUCCESS;
}
