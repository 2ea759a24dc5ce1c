/* A ball falls from 10 m and bounces, in C: flow, guard and reset as callbacks. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "ricochet/ricochet.h"

struct ball {
    double gravity;     /* [m/s^2] */
    double restitution; /* Newton's coefficient, in [0, 1] */
};

/* x = (height [m], velocity [m/s]) */
static int fall(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    const struct ball* ball = user;
    (void)mode, (void)t, (void)n;
    dxdt[0] = x[1];
    dxdt[1] = -ball->gravity;
    return 0;
}

static int height(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                  double* g)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    *g = x[0];
    return 0;
}

static int height_rate(void* user, size_t which, rc_mode mode, double t, const double* x,
                       const double* dxdt, size_t n, double* rate)
{
    (void)user, (void)which, (void)mode, (void)t, (void)x, (void)n;
    *rate = dxdt[0];
    return 0;
}

static int bounce(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    const struct ball* ball = user;
    (void)which, (void)mode, (void)t, (void)n;
    x[0] = 0;
    x[1] = -ball->restitution * x[1];
    return 0;
}

static int fail(const char* what)
{
    fprintf(stderr, "%s: %s\n", what, rc_last_error());
    return 1;
}

int main(void)
{
    struct ball ball = {9.81, 0.9};
    const double start[2] = {10.0, 0.0};
    rc_callbacks callbacks;
    rc_options options;
    rc_system* system;
    rc_simulation* simulation;
    size_t i, impacts;

    memset(&callbacks, 0, sizeof callbacks);
    callbacks.size = sizeof callbacks;
    callbacks.dimension = 2;
    callbacks.guard_count = 1;
    callbacks.user = &ball;
    callbacks.flow = fall;
    callbacks.guard = height;
    callbacks.guard_rate = height_rate;
    callbacks.reset = bounce;
    if (rc_system_new(&callbacks, &system) != RC_OK) return fail("system");

    rc_options_default(&options, sizeof options);
    options.t_end = 20.5;
    if (rc_simulation_new(system, start, 2, &options, &simulation) != RC_OK) return fail("start");
    if (rc_run(simulation) != RC_OK) return fail("run");

    impacts = rc_event_count(simulation);
    for (i = 0; i < impacts; ++i) {
        rc_event impact;
        impact.size = sizeof impact;
        if (rc_event_at(simulation, i, &impact) != RC_OK) return fail("event");
        printf("impact at %.15f s, %+.6f m/s -> %+.6f m/s\n", impact.t, impact.before[1],
               impact.after[1]);
    }
    printf("%s: height %.6f m at %.1f s\n", rc_outcome_text(rc_outcome(simulation)),
           rc_state(simulation)[0], rc_time(simulation));

    rc_simulation_free(simulation);
    rc_system_free(system);
    return impacts == 13 ? 0 : 1;
}
