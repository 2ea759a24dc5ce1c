/* Checks of the tests in C: the first that fails ends the program. */
#ifndef RICOCHET_TESTS_C_CHECK_H
#define RICOCHET_TESTS_C_CHECK_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "ricochet/ricochet.h"

#define CHECK(condition)                                                                     \
    do {                                                                                     \
        if (!(condition)) {                                                                  \
            fprintf(stderr, "%s:%d: %s does not hold; last error: %s\n", __FILE__, __LINE__, \
                    #condition, rc_last_error());                                            \
            exit(1);                                                                         \
        }                                                                                    \
    } while (0)

#define CHECK_STATUS(expected, call)                                                    \
    do {                                                                                \
        const rc_status found_ = (call);                                                \
        if (found_ != (expected)) {                                                     \
            fprintf(stderr, "%s:%d: %s is %s, not %s: %s\n", __FILE__, __LINE__, #call, \
                    rc_status_name(found_), rc_status_name(expected), rc_last_error()); \
            exit(1);                                                                    \
        }                                                                               \
    } while (0)

/* The call is refused, and the message says so. */
#define CHECK_REFUSED(expected, call, text)                                                  \
    do {                                                                                     \
        CHECK_STATUS(expected, call);                                                        \
        if (!strstr(rc_last_error(), text)) {                                                \
            fprintf(stderr, "%s:%d: the message \"%s\" does not contain \"%s\"\n", __FILE__, \
                    __LINE__, rc_last_error(), text);                                        \
            exit(1);                                                                         \
        }                                                                                    \
    } while (0)

#endif
