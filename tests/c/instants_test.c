/* What happens at one instant, and runs that the caller drives: ties with ticks, jumps of the flow,
 * the ends of a run, stops, restarts and other ends. */
#include <math.h>

#include "ball.h"

/* A clock x' = 1 of a period, or a flow that is switched on, or one that notes the times seen. */
struct clock {
    double period, switched, first, last;
    int ticks_set_back;
};

static void see(void* user, double t)
{
    struct clock* clock = user;
    if (t < clock->first) clock->first = t;
    if (t > clock->last) clock->last = t;
}

static int clock_flow(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    const struct clock* clock = user;
    (void)mode, (void)x, (void)n;
    see(user, t);
    dxdt[0] = t > clock->switched ? 1 : 0;
    return 0;
}

static int clock_guard(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                       double* g)
{
    const struct clock* clock = user;
    (void)which, (void)mode, (void)n;
    see(user, t);
    *g = clock->period - x[0];
    return 0;
}

static int clock_reset(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    x[0] = 0;
    return 0;
}

static int next_tick(void* user, double t, double* next)
{
    const struct clock* clock = user;
    double n = floor(t / clock->period);
    while (n * clock->period <= t) ++n;
    *next = n * clock->period;
    return 0;
}

static int tick_reset(void* user, rc_mode* mode, double t, double* x, size_t n)
{
    const struct clock* clock = user;
    (void)mode, (void)t, (void)n;
    if (clock->ticks_set_back) x[0] = 0;
    return 0;
}

static rc_callbacks clock_callbacks(struct clock* clock)
{
    rc_callbacks callbacks = ball_callbacks();
    callbacks.dimension = 1;
    callbacks.user = clock;
    callbacks.flow = clock_flow;
    callbacks.guard = clock_guard;
    callbacks.reset = clock_reset;
    callbacks.next_time_event = next_tick;
    callbacks.time_reset = tick_reset;
    clock->first = HUGE_VAL;
    clock->last = -HUGE_VAL;
    return callbacks;
}

static rc_simulation* start_clock(const rc_callbacks* callbacks, const rc_options* options)
{
    const double start = 0;
    rc_system* system;
    rc_simulation* simulation;
    CHECK_STATUS(RC_OK, rc_system_new(callbacks, &system));
    CHECK_STATUS(RC_OK, rc_simulation_new(system, &start, 1, options, &simulation));
    rc_system_free(system);
    return simulation;
}

static void a_guard_and_a_tick_are_one_set(void)
{
    const double periods[] = {1, 0.3, 0.1, 1.0 / 3, 0.001};
    size_t p, i;
    int sets_back;
    for (p = 0; p < 5; ++p) {
        for (sets_back = 0; sets_back < 2; ++sets_back) {
            struct clock clock = {periods[p], -1, 0, 0, sets_back};
            const rc_callbacks callbacks = clock_callbacks(&clock);
            const rc_options options = options_until(1000 * periods[p]);
            rc_simulation* simulation = start_clock(&callbacks, &options);
            CHECK_STATUS(RC_OK, rc_run(simulation));
            CHECK(rc_event_count(simulation) == 2000);
            for (i = 0; i < 2000; i += 2) {
                const rc_event tick = event_at(simulation, i);
                const rc_event guard = event_at(simulation, i + 1);
                CHECK(tick.t == guard.t);
            }
            rc_simulation_free(simulation);
        }
    }
}

static void a_flow_jumps_at_a_time_event(void)
{
    struct clock clock = {1, 1, 0, 0, 0}; /* x' = (t > 1), ticks at 1, 2, ... */
    rc_callbacks callbacks = clock_callbacks(&clock);
    rc_options options = options_until(1.75);
    rc_simulation* simulation;
    callbacks.guard_count = 0;
    callbacks.guard = NULL;
    callbacks.reset = NULL;
    simulation = start_clock(&callbacks, &options);
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(fabs(rc_state(simulation)[0] - 0.75) < 1e-15);
    CHECK(clock.first == 0 && clock.last == 1.75); /* nothing is called outside */
    rc_simulation_free(simulation);
}

static void nothing_is_called_outside_of_a_short_run(void)
{
    struct clock clock = {1, -1, 0, 0, 0};
    const rc_callbacks callbacks = clock_callbacks(&clock);
    const rc_options options = options_until(1e-4);
    rc_simulation* simulation = start_clock(&callbacks, &options);
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(clock.first == 0 && clock.last == 1e-4);
    rc_simulation_free(simulation);
}

/* An oscillator whose zeros of position and velocity are only recorded. */

static int oscillator_flow(void* user, rc_mode mode, double t, const double* x, double* dxdt,
                           size_t n)
{
    (void)user, (void)mode, (void)t, (void)n;
    dxdt[0] = x[1];
    dxdt[1] = -x[0];
    return 0;
}

static int zeros(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                 double* g)
{
    (void)user, (void)mode, (void)t, (void)n;
    *g = x[which];
    return 0;
}

static void advance_stops_at_recorded_events(void)
{
    rc_callbacks callbacks = ball_callbacks();
    rc_options options = options_until(20);
    rc_simulation* simulation;
    size_t stops = 0;
    int goes_on = 1;
    callbacks.flow = oscillator_flow;
    callbacks.guard_count = 2;
    callbacks.guard = zeros;
    callbacks.reset = NULL;
    simulation = start_ball(&callbacks, &options);
    for (;;) {
        CHECK_STATUS(RC_OK, rc_advance(simulation, &goes_on));
        if (!goes_on) break;
        CHECK(rc_time(simulation) == event_at(simulation, stops).t);
        CHECK(rc_state(simulation)[0] == event_at(simulation, stops).before[0]);
        ++stops;
    }
    CHECK(stops == rc_event_count(simulation) && stops >= 6);
    rc_simulation_free(simulation);
}

static void a_run_goes_on_from_another_state_and_to_another_end(void)
{
    const rc_callbacks callbacks = ball_callbacks();
    const rc_options options = options_until(2);
    const double thrown[2] = {5, 0}, below[2] = {-1, 0}, lost[2] = {NAN, 0};
    rc_simulation* simulation = start_ball(&callbacks, &options);
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(rc_outcome(simulation) == RC_REACHED_END && rc_event_count(simulation) == 1);

    CHECK_REFUSED(RC_INVALID, rc_extend(simulation, 2), "ahead");
    CHECK_REFUSED(RC_INVALID, rc_extend(simulation, NAN), "ahead");
    CHECK_REFUSED(RC_INVALID, rc_restart(simulation, 3, thrown, 2, 0), "lie in the run");
    CHECK_REFUSED(RC_INVALID, rc_restart(simulation, NAN, thrown, 2, 0), "lie in the run");
    CHECK_REFUSED(RC_INVALID, rc_restart(simulation, 1, NULL, 2, 0), "null");
    CHECK_STATUS(RC_INVALID, rc_restart(simulation, 1, thrown, 3, 0));
    CHECK_REFUSED(RC_INVALID, rc_restart(simulation, 1, lost, 2, 0), "finite");
    CHECK_REFUSED(RC_INVALID, rc_restart(simulation, 1, thrown, 2, 1), "mode");
    CHECK(rc_time(simulation) == 2);
    CHECK_STATUS(RC_BAD_HANDLE, rc_restart(NULL, 1, thrown, 2, 0));
    CHECK_STATUS(RC_BAD_HANDLE, rc_extend(NULL, 1));

    CHECK_STATUS(RC_OK, rc_restart(simulation, 1, thrown, 2, 0)); /* before the impact at 1.43 */
    CHECK(rc_event_count(simulation) == 0 && rc_outcome(simulation) == RC_RUNNING);
    CHECK(rc_time(simulation) == 1 && rc_state(simulation)[0] == 5);
    CHECK_STATUS(RC_OK, rc_extend(simulation, 2.5));
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(rc_time(simulation) == 2.5 && rc_event_count(simulation) == 1);
    CHECK(fabs(event_at(simulation, 0).t - (1 + sqrt(10 / 9.81))) < 1e-12);
    CHECK_STATUS(RC_OK, rc_extend(simulation, 4));
    CHECK_STATUS(RC_OK, rc_restart(simulation, 3, below, 2, 0)); /* this floor is not unilateral */
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(rc_time(simulation) == 4);
    rc_simulation_free(simulation);
}

static void a_snapshot_later_than_the_end_says_so(void)
{
    const rc_callbacks callbacks = ball_callbacks();
    const rc_options late = options_until(5), early = options_until(3);
    static char bytes[1 << 16];
    size_t size = sizeof bytes;
    rc_simulation* simulation = start_ball(&callbacks, &late);
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK_STATUS(RC_OK, rc_save(simulation, bytes, &size));
    rc_simulation_free(simulation);
    simulation = start_ball(&callbacks, &early);
    CHECK_REFUSED(RC_INVALID, rc_restore(simulation, bytes, size), "later than t_end");
    rc_simulation_free(simulation);
}

int main(void)
{
    a_guard_and_a_tick_are_one_set();
    a_flow_jumps_at_a_time_event();
    nothing_is_called_outside_of_a_short_run();
    advance_stops_at_recorded_events();
    a_run_goes_on_from_another_state_and_to_another_end();
    a_snapshot_later_than_the_end_says_so();
    return 0;
}
