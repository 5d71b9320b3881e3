/* Tests that register themselves: a program's tests are those that its source defines, and its main is in ck_main.c.
 *   TEST(name) { ... }           runs once
 *   LOOP_TEST(name, n) { ... }   runs n times, with _i from 0 to n - 1
 *   LONG_TEST(name) { ... }      runs once, but not under a sanitizer: it judges what a long run comes to, and shorter
 * tests beside it go through the same code Each test has a process of its own, so that a crash ends one test. Beside
 * them the two ways in which a status is judged. */
#ifndef SF_TESTS_CK_RUN_H
#define SF_TESTS_CK_RUN_H
#include "base/status.h"
#include <check.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

/* A variable that TYPE_free frees where its scope ends: OWNED(fx_scene) scene = ...; */
#define OWNED(type) __attribute__((cleanup(type##_free))) type

/* How much of a thing: under a sanitizer, which takes ten times as long, as much as goes through the same code. */
#ifdef __SANITIZE_ADDRESS__
#define CK_AMOUNT(usual, sanitized) (sanitized)
#else
#define CK_AMOUNT(usual, sanitized) (usual)
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
#define LONG_TEST(name) LOOP_TEST(name, CK_AMOUNT(1, 0))

/* Has to succeed; otherwise the test fails with the call's message. */
#define ck_ok(call)                                                                                                    \
  do {                                                                                                                 \
    const sf_status status_ = (call);                                                                                  \
    ck_assert_msg(status_.code == SF_OK, "%s", status_.message);                                                       \
  } while (0)

/* Fails with this code, and the message holds both words and stays on one line. */
static inline void ck_bad(sf_status s, sf_code code, const char *word, const char *other)
{
  ck_assert_msg(s.code == code, "code %d instead of %d: '%s'", s.code, code, s.message);
  ck_assert_msg(strstr(s.message, word), "'%s' does not name '%s'", s.message, word);
  ck_assert_msg(strstr(s.message, other), "'%s' does not name '%s'", s.message, other);
  ck_assert_ptr_null(strchr(s.message, '\n'));
}
#endif
