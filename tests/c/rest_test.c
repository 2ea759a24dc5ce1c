/* Where events of a cycle of guards accumulate, and motions that only go on for long. */
#include <math.h>

#include "ball.h"

/* A cycle of two guards, by its kind; in the mode `at_rest` nothing happens. */

enum kind { wheel, block, tanks, saddle };
enum { at_rest = 2 };

struct cycle {
    enum kind kind;
    double offset; /* of the block, or the level of the tanks when they are empty */
};

static const double slope = 0.05, half = 0.3, pivot = 0.3; /* [rad] */

static int cycle_flow(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    const struct cycle* cycle = user;
    const double tilt = x[0] - cycle->offset;
    (void)t, (void)n;
    dxdt[0] = x[1];
    dxdt[1] = 0;
    if (mode == at_rest) {
        dxdt[0] = 0;
        return 0;
    }
    switch (cycle->kind) {
        case wheel: dxdt[1] = sin(x[0]); break;
        case block: dxdt[1] = mode == 1 ? tilt + pivot : tilt - pivot; break;
        case tanks:
            dxdt[0] = mode == 0 ? 4 - 2 : -2;
            dxdt[1] = mode == 1 ? 4 - 3 : -3;
            break;
        case saddle: dxdt[1] = x[0]; break;
    }
    return 0;
}

static int cycle_guard(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                       double* g)
{
    const struct cycle* cycle = user;
    const double sign = which == 0 ? 1 : -1;
    (void)mode, (void)t, (void)n;
    switch (cycle->kind) {
        case wheel: *g = which == 0 ? slope + half - x[0] : x[0] - (slope - half); break;
        case block: *g = sign * (x[0] - cycle->offset); break;
        case tanks: *g = x[which] - cycle->offset; break;
        case saddle: *g = 1 - sign * x[0]; break;
    }
    return 0;
}

static int cycle_reset(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    const struct cycle* cycle = user;
    (void)t, (void)n;
    switch (cycle->kind) {
        case wheel:
            x[0] = which == 0 ? slope - half : slope + half;
            x[1] *= cos(2 * half);
            break;
        case block:
            x[1] *= 0.8;
            *mode = 1 - (rc_mode)which;
            break;
        case tanks:
            x[which] = cycle->offset;
            *mode = (rc_mode)which;
            break;
        case saddle:
            x[0] = -x[0];
            x[1] *= 0.7;
            break;
    }
    return 0;
}

static int cycle_enabled(void* user, size_t which, rc_mode mode, int* enabled)
{
    const struct cycle* cycle = user;
    *enabled = mode != at_rest && (cycle->kind != block || mode == (rc_mode)which);
    return 0;
}

static int cycle_rest(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)which, (void)t, (void)x, (void)n;
    *mode = at_rest;
    return 0;
}

static rc_simulation* run_cycle(struct cycle* cycle, const double* start, double t_end, int rests)
{
    rc_callbacks callbacks = ball_callbacks();
    rc_options options = options_until(t_end);
    rc_system* system;
    rc_simulation* simulation;
    callbacks.guard_count = 2;
    callbacks.mode_count = 3;
    callbacks.user = cycle;
    callbacks.flow = cycle_flow;
    callbacks.guard = cycle_guard;
    callbacks.reset = cycle_reset;
    callbacks.enabled_in = cycle_enabled;
    if (rests) callbacks.rest = cycle_rest;
    options.rtol = 1e-12;
    options.atol = 1e-14;
    options.max_steps = 200000;
    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
    CHECK_STATUS(RC_OK, rc_simulation_new(system, start, 2, &options, &simulation));
    rc_system_free(system);
    CHECK_STATUS(RC_OK, rc_run(simulation));
    return simulation;
}

/* Expects one accumulation, at `limit` within its stated error and `slack`, the error of the
 * method; without a rest the end of the run there, which names both guards. */
static void expect_limit(enum kind kind, double offset, double x0, double x1, double limit,
                         double slack)
{
    const double start[2] = {x0, x1};
    struct cycle cycle = {kind, offset};
    rc_simulation* simulation = run_cycle(&cycle, start, 2 * limit, 1);
    const size_t count = rc_event_count(simulation);
    rc_event last;
    size_t k;
    CHECK(rc_outcome(simulation) == RC_REACHED_END);
    CHECK(rc_mode_now(simulation) == at_rest);
    CHECK(count > 10 && count < 400); /* most where zero has no rounding: the block takes 336 */
    for (k = 0; k + 1 < count; ++k) CHECK(event_at(simulation, k).kind == RC_CROSSING);
    last = event_at(simulation, count - 1);
    CHECK(last.kind == RC_ACCUMULATION);
    CHECK(fabs(last.t - limit) <= last.error + slack);
    CHECK(last.error < 1e-4 * limit);
    rc_simulation_free(simulation);

    simulation = run_cycle(&cycle, start, 2 * limit, 0);
    CHECK(rc_outcome(simulation) == RC_ZENO);
    CHECK(fabs(rc_time(simulation) - limit) <= last.error + slack);
    CHECK(statistics_of(simulation).guard + statistics_of(simulation).other_guard == 1);
    rc_simulation_free(simulation);
}

/* An excursion of the wheel from the angle a at the speed v: 2 cos(a - d) = 2 cos a + v^2 gives the
 * place of its turn, and with a - d + d u^2 for the angle the integrand is smooth. */
static double excursion(double a, double v)
{
    double d = 0, sum = 0;
    int k;
    for (k = 0; k < 50; ++k) d = 2 * asin(v * v / (4 * sin(a - d / 2)));
    for (k = 0; k < 5000; ++k) { /* the midpoint rule, wrong by 1e-7 of it */
        const double u = (k + 0.5) / 5000;
        sum += d * u / sqrt(sin(a - d + d * u * u / 2) * sin(d * u * u / 2));
    }
    return 2 * sum / 5000;
}

static void a_wheel_without_a_rim_stops_on_two_spokes(void)
{
    double v = 0.15, limit = 0;
    int k;
    for (k = 0; v > 1e-30; ++k, v *= cos(2 * half)) {
        limit += excursion(k % 2 == 0 ? half - slope : half + slope, v);
    }
    expect_limit(wheel, 0, slope - half, 0.15, limit, 1e-7 * limit);
}

static void a_block_rocks_to_rest_at_any_place(void)
{
    /* p - |x| grows from p as cosh: a half turn at the speed v takes 2 atanh(v / p). */
    const double offsets[] = {0, 1, 100};
    double v, limit = 0;
    size_t k;
    for (v = 0.2; v > 1e-30; v *= 0.8) limit += 2 * atanh(v / pivot);
    for (k = 0; k < 3; ++k) expect_limit(block, offsets[k], offsets[k], 0.2, limit, 1e-9 * limit);
}

static void two_tanks_are_empty_together_at_any_level(void)
{
    /* Two units of water, of which five a second leave and four come. A method that is exact here
     * leaves the rounding of the level, at each of some 60 events. */
    const double levels[] = {0, 1, 20, 100, 1e6};
    size_t k;
    for (k = 0; k < 5; ++k) {
        const double full = levels[k] + 1;
        expect_limit(tanks, levels[k], full, full, 2, 100 * 8 * 2.2e-16 * full);
    }
}

static void a_saddle_is_turned_round_between_its_guards(void)
{
    /* x'' = x from (0.1, 0) with x -> -x, v -> 0.7 v at 1 and -1: acosh(10), and 2 atanh v each. */
    double v, limit = acosh(10);
    for (v = 0.7 * sqrt(0.99); v > 1e-30; v *= 0.7) limit += 2 * atanh(v);
    CHECK(fabs(limit - 8.09774537063384) < 1e-12);
    expect_limit(saddle, 0, 0.1, 0, limit, 1e-9 * limit);
}

/* A clock x' = 1 that strikes each time that it reaches its period, and an oscillator. */

static int runs(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    (void)user, (void)mode, (void)t, (void)x, (void)n;
    dxdt[0] = 1;
    dxdt[1] = 0;
    return 0;
}

static int until_period(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                        double* g)
{
    (void)which, (void)mode, (void)t, (void)n;
    *g = *(const double*)user - x[0];
    return 0;
}

static int strike(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    x[0] = 0;
    x[1] += 1;
    return 0;
}

static int hundred_turns_a_second(void* user, rc_mode mode, double t, const double* x, double* dxdt,
                                  size_t n)
{
    (void)user, (void)mode, (void)t, (void)n;
    dxdt[0] = 628 * x[1];
    dxdt[1] = -628 * x[0];
    return 0;
}

static rc_simulation* run_to(const rc_callbacks* callbacks, double start, rc_options options)
{
    const double x0[2] = {start, 0};
    rc_system* system;
    rc_simulation* simulation;
    options.record_events = 0;
    CHECK_STATUS(RC_OK, rc_system_new(callbacks, &system));
    CHECK_STATUS(RC_OK, rc_simulation_new(system, x0, 2, &options, &simulation));
    rc_system_free(system);
    CHECK_STATUS(RC_OK, rc_run(simulation));
    return simulation;
}

static rc_callbacks clock_of(double* period, rc_guard_info* info, uint32_t most)
{
    rc_callbacks callbacks = ball_callbacks();
    memset(info, 0, sizeof *info);
    info->size = sizeof *info;
    info->stop_after = most;
    callbacks.guard_infos = info;
    callbacks.user = period;
    callbacks.flow = runs;
    callbacks.guard = until_period;
    callbacks.reset = strike;
    return callbacks;
}

static void a_motion_that_keeps_its_pace_is_not_stalled(void)
{
    /* More than 1e6 steps, and 1e5 events, each less than 1e-9 of the span of 1e12 s. */
    rc_guard_info info;
    double period = 0.005;
    rc_callbacks callbacks = clock_of(&period, &info, 150000);
    rc_options options = options_until(1e12);
    rc_simulation* simulation = run_to(&callbacks, 0, options);
    CHECK(rc_outcome(simulation) == RC_STOPPED_BY_EVENT);
    CHECK(fabs(rc_time(simulation) - 750) < 1e-9); /* 150 000 periods, whose roundings add up */
    rc_simulation_free(simulation);

    callbacks = ball_callbacks();
    callbacks.guard_count = 0;
    callbacks.guard = NULL;
    callbacks.reset = NULL;
    callbacks.flow = hundred_turns_a_second;
    options.max_steps = 2100000;
    simulation = run_to(&callbacks, 1, options);
    CHECK(rc_outcome(simulation) == RC_STEP_LIMIT);
    rc_simulation_free(simulation);
}

static void instants_that_hardly_advance_the_time_are_counted(void)
{
    /* After a second, 1e5 events take 1e-8 s: less than 1e-9 of the span, and 1e-6 of the second.
     * The period is resolved there: it is 450 units in the last place of the time. */
    rc_guard_info info;
    double period = 1e-13;
    const rc_callbacks callbacks = clock_of(&period, &info, 10000000);
    rc_simulation* simulation = run_to(&callbacks, -1, options_until(100));
    CHECK(rc_outcome(simulation) == RC_STALLED);
    CHECK(statistics_of(simulation).events >= 100000);
    CHECK(statistics_of(simulation).events <= 300000);
    rc_simulation_free(simulation);
}

int main(void)
{
    a_wheel_without_a_rim_stops_on_two_spokes();
    a_block_rocks_to_rest_at_any_place();
    two_tanks_are_empty_together_at_any_level();
    a_saddle_is_turned_round_between_its_guards();
    a_motion_that_keeps_its_pace_is_not_stalled();
    instants_that_hardly_advance_the_time_are_counted();
    return 0;
}
