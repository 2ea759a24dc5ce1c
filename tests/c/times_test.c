/* Times of events: lists, clocks, timers in the state; the start and the end of a run. */
#include <math.h>

#include "ball.h"

static int still(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    size_t i;
    (void)user, (void)mode, (void)t, (void)x;
    for (i = 0; i < n; ++i) dxdt[i] = 0;
    return 0;
}

static int dose(void* user, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)mode, (void)t, (void)n;
    x[0] += 100;
    return 0;
}

static rc_callbacks dosed(void)
{
    rc_callbacks callbacks;
    memset(&callbacks, 0, sizeof callbacks);
    callbacks.size = sizeof callbacks;
    callbacks.dimension = 1;
    callbacks.flow = still;
    callbacks.time_reset = dose;
    return callbacks;
}

static rc_simulation* simulation_of(const rc_callbacks* callbacks, const double* start,
                                    const rc_options* options)
{
    rc_system* system;
    rc_simulation* simulation;
    CHECK_STATUS(RC_OK, rc_system_new(callbacks, &system));
    CHECK_STATUS(RC_OK,
                 rc_simulation_new(system, start, callbacks->dimension, options, &simulation));
    rc_system_free(system);
    CHECK_STATUS(RC_OK, rc_run(simulation));
    return simulation;
}

static double end_of(const rc_callbacks* callbacks, double start, const rc_options* options)
{
    rc_simulation* simulation = simulation_of(callbacks, &start, options);
    const double x = rc_state(simulation)[0];
    rc_simulation_free(simulation);
    return x;
}

static void lists_include_both_ends_and_every_entry(void)
{
    const double days[] = {24, 0, 12}, twice[] = {1, 1};
    rc_options options = options_until(24);
    rc_callbacks callbacks = dosed();
    callbacks.time_events = days;
    callbacks.time_event_count = 3;
    CHECK(end_of(&callbacks, 0, &options) == 300);
    options.t_start = 12;
    options.continues = 1;
    CHECK(end_of(&callbacks, 200, &options) == 300);
    callbacks.time_events = twice;
    callbacks.time_event_count = 2;
    options = options_until(2);
    CHECK(end_of(&callbacks, 0, &options) == 200);
}

static void clocks_tick_from_start_to_end(void)
{
    rc_options options = options_until(2);
    rc_callbacks callbacks = dosed();
    callbacks.time_event_period = 0.5;
    CHECK(end_of(&callbacks, 0, &options) == 500);
    callbacks.time_event_phase = 0.25;
    CHECK(end_of(&callbacks, 0, &options) == 400);
    CHECK(rc_next_tick(0.1, 0, 7 * 0.1) == 8 * 0.1);
    CHECK(isnan(rc_next_tick(0, 0, 1)));
    {
        const double times[] = {0, 1, 1, 2};
        CHECK(rc_next_listed(times, 4, 0) == 1);
        CHECK(rc_next_listed(times, 4, 1) == 2);
        CHECK(rc_next_listed(times, 4, 2) == INFINITY);
    }
}

/* Three timers in the state behind a count. */

static int first_due(void* user, rc_mode mode, double t, const double* x, size_t n, double* next)
{
    size_t i;
    (void)user, (void)mode, (void)t;
    *next = INFINITY;
    for (i = 1; i < n; ++i) {
        if (x[i] < *next) *next = x[i];
    }
    return 0;
}

static int spike(void* user, rc_mode* mode, double t, double* x, size_t n)
{
    size_t i;
    (void)user, (void)mode;
    for (i = 1; i < n && x[i] > t; ++i) continue;
    x[i] = 1e9;
    x[0] += 1;
    return 0;
}

static int keep(void* user, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)mode, (void)t, (void)x, (void)n;
    return 0;
}

static void timers_that_are_due_together_each_happen(void)
{
    const double start[] = {0, 1, 1, 1};
    const rc_options options = options_until(2);
    rc_callbacks callbacks = dosed();
    rc_simulation* simulation;
    callbacks.dimension = 4;
    callbacks.next_time_event_at = first_due;
    callbacks.time_reset = spike;
    simulation = simulation_of(&callbacks, start, &options);
    CHECK(rc_state(simulation)[0] == 3);
    CHECK(rc_event_count(simulation) == 3);
    rc_simulation_free(simulation);

    callbacks.time_reset = keep;
    simulation = simulation_of(&callbacks, start, &options);
    CHECK(rc_outcome(simulation) == RC_TIME_EVENT_NOT_AHEAD);
    CHECK(rc_time(simulation) == 1);
    rc_simulation_free(simulation);
}

static int two_spikes(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                      double* g)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    *g = 1.5 - x[0];
    return 0;
}

/* The second spike ends the run; the third is due at the same time, and happens where it goes on.
 */
static void a_timer_that_is_due_where_a_run_goes_on_happens_there(void)
{
    const double start[] = {0, 1, 1, 1};
    rc_options options = options_until(2);
    rc_callbacks callbacks = dosed();
    rc_guard_info info;
    rc_simulation *simulation, *next;
    memset(&info, 0, sizeof info);
    info.size = sizeof info;
    info.notifies = 1;
    info.stop_after = 1;
    callbacks.dimension = 4;
    callbacks.next_time_event_at = first_due;
    callbacks.time_reset = spike;
    callbacks.guard_count = 1;
    callbacks.guard = two_spikes;
    callbacks.guard_infos = &info;
    simulation = simulation_of(&callbacks, start, &options);
    CHECK(rc_outcome(simulation) == RC_STOPPED_BY_EVENT);
    CHECK(rc_time(simulation) == 1 && rc_state(simulation)[0] == 2);

    options.t_start = 1;
    options.continues = 1;
    next = simulation_of(&callbacks, rc_state(simulation), &options);
    CHECK(rc_state(next)[0] == 3 && rc_event_count(next) == 1);
    rc_simulation_free(next);

    CHECK_STATUS(RC_OK, rc_restart(simulation, 1, rc_state(simulation), 4, 0));
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(rc_state(simulation)[0] == 3 && rc_event_count(simulation) == 4);
    rc_simulation_free(simulation);
}

/* A level that falls. */

static int drains(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    (void)user, (void)mode, (void)t, (void)x, (void)n;
    dxdt[0] = -1;
    return 0;
}

static int level(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                 double* g)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    *g = x[0];
    return 0;
}

static int fill(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    x[0] += 10;
    return 0;
}

static int end_empty(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)which, (void)t, (void)n;
    x[0] = -5;
    *mode = 1;
    return rc_stop("the tank is empty");
}

static rc_callbacks tank(rc_guard_info* info, rc_reset_fn reset)
{
    rc_callbacks callbacks = dosed();
    memset(info, 0, sizeof *info);
    info->size = sizeof *info;
    callbacks.flow = drains;
    callbacks.time_reset = NULL;
    callbacks.guard_count = 1;
    callbacks.guard = level;
    callbacks.reset = reset;
    callbacks.guard_infos = info;
    return callbacks;
}

static void guards_fire_at_the_start_if_asked(void)
{
    rc_guard_info info;
    rc_options options = options_until(1);
    rc_callbacks callbacks = tank(&info, fill);
    const double below = -1;
    rc_simulation* simulation = simulation_of(&callbacks, &below, &options);
    CHECK(rc_event_count(simulation) == 0);
    CHECK(statistics_of(simulation).armed_beyond == 1);
    CHECK(strstr(rc_describe(simulation), "guard 0 began beyond its surface"));
    rc_simulation_free(simulation);

    info.at_start = 1;
    CHECK(end_of(&callbacks, below, &options) == 8);
    options.continues = 1;
    CHECK(end_of(&callbacks, below, &options) == -2);
}

static void a_reset_ends_a_run_without_an_end(void)
{
    rc_guard_info info;
    rc_options options = options_until(INFINITY);
    rc_callbacks callbacks = tank(&info, end_empty);
    const double start = 3;
    rc_simulation* simulation;
    callbacks.mode_count = 2;
    options.max_steps = 1000000;
    simulation = simulation_of(&callbacks, &start, &options);
    CHECK(rc_outcome(simulation) == RC_STOPPED_BY_EVENT);
    CHECK(strcmp(rc_reason(simulation), "the tank is empty") == 0);
    CHECK(strcmp(rc_describe(simulation), "a reset ended the run: the tank is empty") == 0);
    CHECK(fabs(rc_time(simulation) - 3) < 1e-14);
    CHECK(rc_state(simulation)[0] == -5);
    CHECK(rc_mode_now(simulation) == 1);
    rc_simulation_free(simulation);
}

static void a_number_that_looks_like_a_stop_is_an_error(void)
{
    rc_guard_info info;
    const rc_options options = options_until(5);
    rc_callbacks callbacks = tank(&info, fill);
    rc_system* system;
    rc_simulation* simulation;
    const double start = 1;
    CHECK(rc_stop("for no callback") != 0);
    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
    CHECK_STATUS(RC_OK, rc_simulation_new(system, &start, 1, &options, &simulation));
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(rc_outcome(simulation) == RC_REACHED_END);
    CHECK(strcmp(rc_reason(simulation), "") == 0);
    rc_simulation_free(simulation);
    rc_system_free(system);
}

static void refuse(const rc_callbacks* callbacks, const char* text)
{
    rc_system* system;
    CHECK_REFUSED(RC_INVALID, rc_system_new(callbacks, &system), text);
    CHECK(system == NULL);
}

static void wrong_times_are_refused_by_name(void)
{
    const double times[] = {1, NAN};
    rc_guard_info info;
    rc_options options = options_until(INFINITY);
    rc_callbacks callbacks = dosed();
    rc_system* system;
    rc_simulation* simulation;
    double start = 1;
    callbacks.time_event_period = -1;
    refuse(&callbacks,
           "rc_callbacks.time_event_period: period must be positive and finite, got -1");
    callbacks.time_event_period = 1;
    callbacks.time_event_phase = NAN;
    refuse(&callbacks, "phase must be finite, got nan");
    callbacks.time_event_count = 2;
    refuse(&callbacks, "found a time_event_count above 0 without time_events");
    callbacks.time_events = times;
    refuse(&callbacks, "found several of next_time_event, next_time_event_at, time_events and");
    callbacks.time_event_period = 0;
    refuse(&callbacks, "rc_callbacks.time_events: entry 1 must be a time, got nan");

    callbacks = tank(&info, NULL);
    info.at_start = 2;
    refuse(&callbacks, "at_start must be 0 or 1, got 2");
    info.at_start = 0;
    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
    CHECK_REFUSED(RC_INVALID, rc_simulation_new(system, &start, 1, &options, &simulation),
                  "t_end must be a finite time where nothing else may end the run, got inf");
    options.t_end = NAN;
    CHECK_REFUSED(RC_INVALID, rc_simulation_new(system, &start, 1, &options, &simulation),
                  "t_end: found nan, expected a finite time");
    options.t_end = 1;
    options.continues = 2;
    CHECK_REFUSED(RC_INVALID, rc_simulation_new(system, &start, 1, &options, &simulation),
                  "continues must be 0 or 1, got 2");
    rc_system_free(system);
}

int main(void)
{
    lists_include_both_ends_and_every_entry();
    clocks_tick_from_start_to_end();
    timers_that_are_due_together_each_happen();
    a_timer_that_is_due_where_a_run_goes_on_happens_there();
    guards_fire_at_the_start_if_asked();
    a_reset_ends_a_run_without_an_end();
    a_number_that_looks_like_a_stop_is_an_error();
    wrong_times_are_refused_by_name();
    return 0;
}
