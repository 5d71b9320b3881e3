/* Runs a suite of Check; what they return is main's. */
#ifndef SF_TESTS_CK_RUN_H
#define SF_TESTS_CK_RUN_H
#include <check.h>
#include <stdlib.h>

static inline int ck_run_in(Suite *suite, enum fork_status fork)
{
  SRunner *runner = srunner_create(suite);
  srunner_set_fork_status(runner, fork);
  srunner_run_all(runner, CK_ENV);
  const int failed = srunner_ntests_failed(runner);
  srunner_free(runner);
  return failed ? EXIT_FAILURE : EXIT_SUCCESS;
}

static inline int ck_run(Suite *suite) /* a process for each test, so that a crash ends one */
{
  return ck_run_in(suite, CK_FORK_GETENV);
}
#endif
