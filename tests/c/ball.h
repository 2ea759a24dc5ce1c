/* A bouncing ball as callbacks: x = (height [m], velocity [m/s]). */
#ifndef RICOCHET_TESTS_C_BALL_H
#define RICOCHET_TESTS_C_BALL_H

#include "check.h"

static inline int ball_flow(void* user, rc_mode mode, double t, const double* x, double* dxdt,
                            size_t n)
{
    (void)user, (void)mode, (void)t, (void)n;
    dxdt[0] = x[1];
    dxdt[1] = -9.81;
    return 0;
}

static inline int ball_guard(void* user, size_t which, rc_mode mode, double t, const double* x,
                             size_t n, double* g)
{
    (void)user, (void)which, (void)mode, (void)t;
    CHECK(n > 0);
    *g = x[0];
    return 0;
}

static inline int ball_reset(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    x[0] = 0;
    x[1] *= -0.9;
    return 0;
}

static inline rc_callbacks ball_callbacks(void)
{
    rc_callbacks callbacks;
    memset(&callbacks, 0, sizeof callbacks);
    callbacks.size = sizeof callbacks;
    callbacks.dimension = 2;
    callbacks.guard_count = 1;
    callbacks.flow = ball_flow;
    callbacks.guard = ball_guard;
    callbacks.reset = ball_reset;
    return callbacks;
}

static inline rc_options options_until(double t_end)
{
    rc_options options;
    CHECK_STATUS(RC_OK, rc_options_default(&options, sizeof options));
    options.t_end = t_end;
    return options;
}

static inline rc_simulation* start_ball(const rc_callbacks* callbacks, const rc_options* options)
{
    const double start[2] = {10, 0};
    rc_system* system;
    rc_simulation* simulation;
    CHECK_STATUS(RC_OK, rc_system_new(callbacks, &system));
    CHECK_STATUS(RC_OK, rc_simulation_new(system, start, 2, options, &simulation));
    rc_system_free(system); /* the simulation keeps what it needs */
    return simulation;
}

static inline rc_event event_at(rc_simulation* simulation, size_t index)
{
    rc_event event;
    event.size = sizeof event;
    CHECK_STATUS(RC_OK, rc_event_at(simulation, index, &event));
    return event;
}

static inline rc_statistics statistics_of(rc_simulation* simulation)
{
    rc_statistics statistics;
    statistics.size = sizeof statistics;
    CHECK_STATUS(RC_OK, rc_get_statistics(simulation, &statistics));
    return statistics;
}

#endif
