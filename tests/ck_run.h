/* Tests that register themselves: a program's tests are those that its source defines, and its main is in ck_main.c.
 *   TEST(name) { ... }           runs once
 *   LOOP_TEST(name, n) { ... }   runs n times, with _i from 0 to n - 1
 * Each test has a process of its own, so that a crash ends one test. */
#ifndef SF_TESTS_CK_RUN_H
#define SF_TESTS_CK_RUN_H
#include <check.h>
#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A program that needs other values than these defines the variable. */
extern int ck_timeout; /* seconds for a test: 60 */
typedef struct ck_options {
  void (*set_up)(void), (*tear_down)(void);         /* before and after each test */
  void (*set_up_all)(void), (*tear_down_all)(void); /* before the first and after the last */
  bool one_process;                                 /* for all tests: OpenMP does not survive a fork */
} ck_options;
extern ck_options ck_program; /* nothing of it */

Suite *ck_suite(void);                /* the program's */
TCase *ck_case(void);                 /* where TEST and LOOP_TEST register */
TCase *ck_new_case(const char *name); /* another one of the suite, with the program's options */
int ck_main(void);                    /* runs the suite; main's result */

#ifdef __cplusplus
}
#endif

#define COUNT(table) ((int)(sizeof(table) / sizeof *(table)))

/* A test that the statement `add` registers, before main. */
#define REGISTERED_TEST(name, add)                                                                                     \
  static void name##_body(int _i);                                                                                     \
  START_TEST(name)                                                                                                     \
  {                                                                                                                    \
    name##_body(_i);                                                                                                   \
  }                                                                                                                    \
  END_TEST                                                                                                             \
  __attribute__((constructor)) static void name##_register(void)                                                       \
  {                                                                                                                    \
    add;                                                                                                               \
  }                                                                                                                    \
  static void name##_body(int _i CK_ATTRIBUTE_UNUSED)

#define LOOP_TEST(name, n) REGISTERED_TEST(name, tcase_add_loop_test(ck_case(), name, 0, n))
#define TEST(name) LOOP_TEST(name, 1)
#endif
