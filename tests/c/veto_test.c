/* `enabled`: a veto concerns the instant of a crossing, and what is passed stays passed. */
#include <math.h>

#include "ball.h"

/* A point (x, y) beside or above a platform at y = 0 that reaches from the left to x = 1; the third
 * component is the velocity of y. At the tick it is put to another x. */
struct platform {
    double push; /* [m/s] x' at the start, less 1 each second */
    double pull; /* [m/s^2] y'' */
    double tick; /* [s] */
    double to;   /* [m] */
};

static int point_flow(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    const struct platform* platform = user;
    (void)mode, (void)n;
    dxdt[0] = platform->push * (1 - t);
    dxdt[1] = x[2];
    dxdt[2] = platform->pull;
    return 0;
}

static int height(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                  double* g)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    *g = x[1];
    return 0;
}

static int over_the_platform(void* user, size_t which, rc_mode mode, double t, const double* x,
                             size_t n, int* enabled)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    *enabled = x[0] < 1;
    return 0;
}

static int rebound(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    x[2] = -x[2];
    return 0;
}

static int next_tick(void* user, double t, double* next)
{
    const double tick = ((const struct platform*)user)->tick;
    *next = t < tick ? tick : INFINITY;
    return 0;
}

static int put(void* user, rc_mode* mode, double t, double* x, size_t n)
{
    (void)mode, (void)t, (void)n;
    x[0] = ((const struct platform*)user)->to;
    return 0;
}

static rc_callbacks platform_callbacks(struct platform* platform, rc_guard_info* info)
{
    rc_callbacks callbacks = ball_callbacks();
    memset(info, 0, sizeof *info);
    info->size = sizeof *info;
    callbacks.dimension = 3;
    callbacks.user = platform;
    callbacks.guard_infos = info;
    callbacks.flow = point_flow;
    callbacks.guard = height;
    callbacks.enabled = over_the_platform;
    callbacks.reset = rebound;
    if (platform->tick > 0) {
        callbacks.next_time_event = next_tick;
        callbacks.time_reset = put;
    }
    return callbacks;
}

static rc_simulation* run_point(const rc_callbacks* callbacks, double x, double y, double velocity,
                                const rc_options* options)
{
    const double start[3] = {x, y, velocity};
    rc_system* system;
    rc_simulation* simulation;
    CHECK_STATUS(RC_OK, rc_system_new(callbacks, &system));
    CHECK_STATUS(RC_OK, rc_simulation_new(system, start, 3, options, &simulation));
    rc_system_free(system);
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(rc_outcome(simulation) == RC_REACHED_END);
    return simulation;
}

/* Each test runs with a guard that may be left behind and with one that may not, by two methods. */
static const int32_t methods[] = {RC_DOPRI5, RC_FEHLBERG78};

static void a_point_that_has_passed_is_not_struck_from_below(void)
{
    /* x = 0.5 + 2 t - t^2, y = 0.4 - 1.2 t + t^2 / 2: down through 0 at 0.4 where x = 1.14, below
     * the platform from 1.707 on, where x is 1 again, and up through 0 at 2. */
    int k;
    for (k = 0; k < 4; ++k) {
        struct platform platform = {2, 1, 0, 0};
        rc_guard_info info;
        rc_options options = options_until(3);
        const rc_callbacks callbacks = platform_callbacks(&platform, &info);
        rc_simulation* simulation;
        info.unilateral = k % 2;
        options.method = methods[k / 2];
        simulation = run_point(&callbacks, 0.5, 0.4, -1.2, &options);
        CHECK(rc_event_count(simulation) == 0);
        CHECK(statistics_of(simulation).disabled == 1);
        CHECK(fabs(rc_state(simulation)[1] - 1.3) < 1e-9); /* the rounding of ten steps and more */
        rc_simulation_free(simulation);
    }
}

static void a_veto_that_ends_on_the_surface_leaves_the_event(void)
{
    /* y = 1 - t is 0 at the tick, which puts the point on the platform: it presses, and rebounds. A
     * quarter of a second later it has passed. */
    int k;
    for (k = 0; k < 4; ++k) {
        struct platform platform = {0, 0, 1, 0};
        rc_guard_info info;
        rc_options options = options_until(3);
        const rc_callbacks callbacks = platform_callbacks(&platform, &info);
        rc_simulation* simulation;
        info.unilateral = k % 2;
        options.method = methods[k / 2];
        simulation = run_point(&callbacks, 2, 1, -1, &options);
        CHECK(rc_event_count(simulation) == 2);
        CHECK(event_at(simulation, 0).kind == RC_TIME);
        CHECK(event_at(simulation, 1).guard == 0 && event_at(simulation, 1).t == 1);
        CHECK(fabs(rc_state(simulation)[1] - 2) < 1e-12);
        rc_simulation_free(simulation);

        platform.tick = 1.25;
        simulation = run_point(&callbacks, 2, 1, -1, &options);
        CHECK(rc_event_count(simulation) == 1);
        CHECK(statistics_of(simulation).disabled == 1);
        CHECK(fabs(rc_state(simulation)[1] + 2) < 1e-12);
        rc_simulation_free(simulation);
    }
}

static void a_touch_of_a_disabled_guard_is_counted_and_not_recorded(void)
{
    /* y = (t - 1)^2 touches 0 at 1, beside the platform or on it. */
    int beside;
    for (beside = 0; beside < 2; ++beside) {
        struct platform platform = {0, 2, 0, 0};
        rc_guard_info info;
        const rc_options options = options_until(1.75);
        rc_callbacks callbacks = platform_callbacks(&platform, &info);
        rc_simulation* simulation;
        callbacks.reset = NULL;
        info.touch = 1e-12;
        simulation = run_point(&callbacks, beside ? 2 : 0, 1, -2, &options);
        CHECK(rc_event_count(simulation) == !beside);
        CHECK(statistics_of(simulation).disabled == (uint64_t)beside);
        if (!beside) CHECK(event_at(simulation, 0).kind == RC_TOUCH);
        rc_simulation_free(simulation);
    }
}

int main(void)
{
    a_point_that_has_passed_is_not_struck_from_below();
    a_veto_that_ends_on_the_surface_leaves_the_event();
    a_touch_of_a_disabled_guard_is_counted_and_not_recorded();
    return 0;
}
