/* A call that has to succeed; otherwise the test fails with the call's message. */
#ifndef SF_TESTS_CK_OK_H
#define SF_TESTS_CK_OK_H
#include "base/status.h"
#include <check.h>

#define ck_ok(call)                                                                                                    \
  do {                                                                                                                 \
    const sf_status status_ = (call);                                                                                  \
    ck_assert_msg(status_.code == SF_OK, "%s", status_.message);                                                       \
  } while (0)
#endif
