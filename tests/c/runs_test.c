/* Runs of callbacks: what they find, record and keep. */
#include <float.h>
#include <math.h>

#include "ball.h"

/* Impact n of a ball that falls from 10 m and keeps 0.9 of its velocity. */
static double impact_time(int n)
{
    const double first = sqrt(2 * 10 / 9.81);
    double flight = 2 * first;
    double t = first;
    while (n-- > 0) t += flight *= 0.9;
    return t;
}

static void finds_the_impacts_of_a_ball(void)
{
    const rc_callbacks callbacks = ball_callbacks();
    const rc_options options = options_until(20.5);
    rc_simulation* simulation = start_ball(&callbacks, &options);
    rc_statistics statistics;
    size_t i;
    CHECK(rc_outcome(simulation) == RC_RUNNING);
    CHECK(rc_time(simulation) == 0 && rc_state(simulation)[0] == 10);
    CHECK(rc_mode_now(simulation) == 0);
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(rc_outcome(simulation) == RC_REACHED_END);
    CHECK(strcmp(rc_outcome_name(rc_outcome(simulation)), "reached_end") == 0);
    CHECK(rc_time(simulation) == 20.5);
    CHECK(rc_event_count(simulation) == 13);
    for (i = 0; i < 13; ++i) {
        const rc_event impact = event_at(simulation, i);
        CHECK(fabs(impact.t - impact_time((int)i)) < 1e-13);
        CHECK(impact.kind == RC_CROSSING && impact.guard == 0 && !impact.late);
        CHECK(impact.before[1] < 0 && impact.after[0] == 0);
        CHECK(impact.after[1] == -0.9 * impact.before[1]);
        CHECK(impact.bracket_lo <= impact.t && impact.t <= impact.bracket_hi);
    }
    statistics = statistics_of(simulation);
    CHECK(statistics.events == 13 && statistics.steps >= 14 && statistics.flow_calls > 0);
    CHECK(statistics.guard_calls > 0 && statistics.guard == RC_NO_GUARD);
    CHECK_STATUS(RC_OK, rc_run(simulation)); /* stays at its end */
    CHECK(rc_event_count(simulation) == 13);
    CHECK_STATUS(RC_OK, rc_simulation_free(simulation));
}

static void goes_step_by_step_and_from_event_to_event(void)
{
    const rc_callbacks callbacks = ball_callbacks();
    const rc_options options = options_until(20.5);
    rc_simulation* by_steps = start_ball(&callbacks, &options);
    rc_simulation* by_events = start_ball(&callbacks, &options);
    int goes_on = 1;
    int shown = 0;
    double t = 0;
    while (goes_on) {
        CHECK_STATUS(RC_OK, rc_step(by_steps, &goes_on));
        CHECK(!goes_on || rc_time(by_steps) > t);
        t = rc_time(by_steps);
    }
    for (;;) {
        CHECK_STATUS(RC_OK, rc_advance(by_events, &goes_on));
        if (!goes_on) break;
        CHECK(rc_time(by_events) == event_at(by_steps, (size_t)shown++).t);
    }
    CHECK(shown == 13 && rc_event_count(by_steps) == 13);
    CHECK(memcmp(rc_state(by_steps), rc_state(by_events), 2 * sizeof(double)) == 0);
    CHECK_STATUS(RC_OK, rc_step(by_steps, NULL));
    rc_simulation_free(by_steps);
    rc_simulation_free(by_events);
}

static void takes_samples_and_keeps_the_solution(void)
{
    const rc_callbacks callbacks = ball_callbacks();
    const double times[4] = {0, 1, 1.5, 2};
    rc_options options = options_until(2);
    rc_simulation* simulation;
    double x[2], t;
    const double* sample;
    rc_mode mode = 7;
    options.sample_times = times;
    options.sample_count = 4;
    options.record_steps = 1;
    simulation = start_ball(&callbacks, &options);
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(rc_sample_count(simulation) == 4);
    CHECK_STATUS(RC_OK, rc_sample_at(simulation, 1, &t, &sample));
    CHECK(t == 1 && fabs(sample[0] - (10 - 9.81 / 2)) < 1e-14);
    CHECK_STATUS(RC_OK, rc_sample_at(simulation, 3, NULL, &sample));
    CHECK(sample[0] == rc_state(simulation)[0]);
    CHECK_STATUS(RC_OK, rc_solution(simulation, 1, x, 2));
    CHECK(fabs(x[0] - (10 - 9.81 / 2)) < 1e-14);
    t = event_at(simulation, 0).t;
    CHECK_STATUS(RC_OK, rc_solution(simulation, t, x, 2));
    CHECK(x[1] > 0);
    CHECK_STATUS(RC_OK, rc_solution_before(simulation, t, x, 2));
    CHECK(x[1] < 0);
    CHECK_STATUS(RC_OK, rc_solution_mode(simulation, 1, &mode));
    CHECK(mode == 0);
    rc_simulation_free(simulation);
}

static void goes_on_from_what_was_saved(void)
{
    const rc_callbacks callbacks = ball_callbacks();
    const rc_options options = options_until(20.5);
    rc_simulation* first = start_ball(&callbacks, &options);
    rc_simulation* second = start_ball(&callbacks, &options);
    static char bytes[1 << 16];
    size_t size = 0, needed = 0;
    int goes_on, i;
    for (i = 0; i < 5; ++i) CHECK_STATUS(RC_OK, rc_advance(first, &goes_on));
    CHECK_STATUS(RC_OK, rc_save(first, NULL, &needed));
    size = needed - 1;
    CHECK_REFUSED(RC_INVALID, rc_save(first, bytes, &size), "room");
    CHECK(size == needed && needed < sizeof bytes);
    CHECK_STATUS(RC_OK, rc_save(first, bytes, &size));
    CHECK_STATUS(RC_OK, rc_restore(second, bytes, size));
    CHECK(rc_time(second) == rc_time(first));
    CHECK_STATUS(RC_OK, rc_run(first));
    CHECK_STATUS(RC_OK, rc_run(second));
    CHECK(rc_event_count(second) == 8);
    CHECK(event_at(second, 7).t == event_at(first, 12).t);
    CHECK(memcmp(rc_state(first), rc_state(second), 2 * sizeof(double)) == 0);
    CHECK_STATUS(RC_OK, rc_restore(first, bytes, size)); /* and back, from the end */
    CHECK(rc_outcome(first) == RC_RUNNING);
    CHECK_STATUS(RC_OK, rc_run(first));
    CHECK(memcmp(rc_state(first), rc_state(second), 2 * sizeof(double)) == 0);
    bytes[size / 2] ^= 1;
    CHECK_STATUS(RC_INVALID, rc_restore(first, bytes, size));
    CHECK_STATUS(RC_INVALID, rc_restore(first, bytes, 3));
    rc_simulation_free(first);
    rc_simulation_free(second);
}

/* --- modes: a thermostat, which has two guards at once --- */

static int heat(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    (void)user, (void)t, (void)n;
    dxdt[0] = (mode ? 30 : 10) - x[0];
    return 0;
}
static int limits(void* user, rc_mode mode, double t, const double* x, size_t n, double* g,
                  size_t count)
{
    (void)user, (void)mode, (void)t, (void)n, (void)count;
    g[0] = x[0] - 19;
    g[1] = 21 - x[0];
    return 0;
}
static int toggle(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)t, (void)x, (void)n;
    *mode = which == 0 ? 1 : 0;
    return 0;
}
static int limit_of_mode(void* user, size_t which, rc_mode mode, int* enabled)
{
    (void)user;
    *enabled = which == mode;
    return 0;
}

static void switches_between_modes(void)
{
    const double start = 20;
    rc_callbacks callbacks;
    rc_options options = options_until(5);
    rc_system* system;
    rc_simulation* simulation;
    size_t i;
    memset(&callbacks, 0, sizeof callbacks);
    callbacks.size = sizeof callbacks;
    callbacks.dimension = 1;
    callbacks.guard_count = 2;
    callbacks.mode_count = 2;
    callbacks.flow = heat;
    callbacks.guards = limits;
    callbacks.reset = toggle;
    callbacks.enabled_in = limit_of_mode;
    options.mode = 1;
    options.detector = RC_ENDS;
    options.locator = RC_TOMS748;
    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
    CHECK_STATUS(RC_OK, rc_simulation_new(system, &start, 1, &options, &simulation));
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(rc_event_count(simulation) > 10);
    /* From 20 to 21 degrees with a limit of 30: log(10 / 9) s. */
    CHECK(fabs(event_at(simulation, 0).t - log(10. / 9)) < 1e-7);
    for (i = 0; i < rc_event_count(simulation); ++i) {
        const rc_event event = event_at(simulation, i);
        CHECK(event.guard == (i + 1) % 2 && event.mode_before == event.guard);
        CHECK(event.mode_after == 1 - event.mode_before);
    }
    rc_simulation_free(simulation);
    options.mode = 2;
    CHECK_REFUSED(RC_INVALID, rc_simulation_new(system, &start, 1, &options, &simulation), "mode");
    rc_system_free(system);
}

/* --- time events, backward runs, rest --- */

static int every_second(void* user, double t, double* next)
{
    (void)user;
    *next = floor(t) + 1;
    return 0;
}
static int second_before(void* user, double t, double* previous)
{
    (void)user;
    *previous = ceil(t) - 1;
    return 0;
}
static int kick(void* user, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)mode, (void)t, (void)n;
    x[1] += 1;
    return 0;
}

static void meets_time_events_exactly_and_runs_backward(void)
{
    rc_callbacks callbacks = ball_callbacks();
    rc_options options = options_until(-3.5);
    rc_simulation* simulation;
    callbacks.guard_count = 0;
    callbacks.guard = NULL;
    callbacks.reset = NULL;
    callbacks.next_time_event = every_second;
    callbacks.previous_time_event = second_before;
    callbacks.time_reset = kick;
    simulation = start_ball(&callbacks, &options);
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(rc_event_count(simulation) == 3);
    CHECK(event_at(simulation, 2).t == -3 && event_at(simulation, 2).kind == RC_TIME);
    CHECK(event_at(simulation, 2).guard == RC_NO_GUARD);
    CHECK(fabs(rc_state(simulation)[1] - (3.5 * 9.81 + 3)) < 1e-12);
    rc_simulation_free(simulation);
}

static int lie(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    x[0] = x[1] = 0;
    return 0;
}

static void comes_to_rest_where_events_accumulate(void)
{
    rc_callbacks callbacks = ball_callbacks();
    const rc_options options = options_until(60);
    rc_simulation* simulation = start_ball(&callbacks, &options);
    /* The series of flights ends at t0 (1 + e) / (1 - e). */
    const double limit = sqrt(2 * 10 / 9.81) * 1.9 / 0.1;
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(rc_outcome(simulation) == RC_ZENO);
    CHECK(statistics_of(simulation).guard == 0);
    CHECK(fabs(rc_time(simulation) - limit) < 1e-6);
    rc_simulation_free(simulation);
    callbacks.rest = lie;
    simulation = start_ball(&callbacks, &options);
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(rc_outcome(simulation) == RC_REACHED_END && rc_state(simulation)[0] == 0);
    CHECK(event_at(simulation, rc_event_count(simulation) - 1).kind == RC_ACCUMULATION);
    CHECK(fabs(event_at(simulation, rc_event_count(simulation) - 1).t - limit) < 1e-9);
    rc_simulation_free(simulation);
}

/* --- what is said of guards --- */

static void does_what_is_said_of_guards(void)
{
    rc_callbacks callbacks = ball_callbacks();
    rc_options options = options_until(20.5);
    rc_simulation* simulation;
    rc_guard_info floor_info;
    memset(&floor_info, 0, sizeof floor_info);
    floor_info.size = sizeof floor_info;
    floor_info.name = "floor";
    floor_info.stop_after = 3;
    floor_info.unilateral = 1;
    callbacks.guard_infos = &floor_info;
    simulation = start_ball(&callbacks, &options);
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(rc_outcome(simulation) == RC_STOPPED_BY_EVENT && rc_event_count(simulation) == 3);
    CHECK(statistics_of(simulation).guard == 0);
    rc_simulation_free(simulation);

    floor_info.stop_after = 0;
    floor_info.unilateral = 0;
    floor_info.notifies = 1;
    simulation = start_ball(&callbacks, &options);
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(rc_event_count(simulation) == 1); /* recorded, and through the floor */
    CHECK(rc_state(simulation)[0] < -1000);
    rc_simulation_free(simulation);

    options.stop_at_event = 1;
    simulation = start_ball(&callbacks, &options);
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(fabs(rc_time(simulation) - impact_time(0)) < 1e-13);
    rc_simulation_free(simulation);
}

/* --- plans and gates --- */

static int fall_speed(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                      double* bound)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    *bound = fabs(x[1]);
    return 0;
}
static int weight(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                  double* bound)
{
    (void)user, (void)which, (void)mode, (void)t, (void)x, (void)n;
    *bound = 9.81;
    return 0;
}

static void plans_by_bounds(void)
{
    rc_callbacks callbacks = ball_callbacks();
    rc_options options = options_until(20.5);
    rc_simulation* exact;
    rc_simulation* planned;
    size_t i;
    callbacks.speed_bound = fall_speed;
    callbacks.acceleration_bound = weight;
    options.fixed_step = 1;
    options.method = RC_RK4;
    options.step = 0.001;
    exact = start_ball(&callbacks, &options);
    options.detector = RC_PLANNED;
    planned = start_ball(&callbacks, &options);
    CHECK_STATUS(RC_OK, rc_run(exact));
    CHECK_STATUS(RC_OK, rc_run(planned));
    CHECK(rc_event_count(planned) == 13 && rc_event_count(exact) == 13);
    for (i = 0; i < 13; ++i) CHECK(event_at(planned, i).t == event_at(exact, i).t);
    CHECK(statistics_of(planned).guard_calls < statistics_of(exact).guard_calls / 10);
    CHECK(statistics_of(planned).proved > 10000);
    rc_simulation_free(exact);
    rc_simulation_free(planned);

    callbacks.speed_bound = callbacks.acceleration_bound = NULL;
    planned = start_ball(&callbacks, &options); /* the exact detector */
    CHECK_STATUS(RC_OK, rc_run(planned));
    CHECK(rc_event_count(planned) == 13 && statistics_of(planned).checks_deferred == 0);
    rc_simulation_free(planned);
}

static int swing(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    (void)user, (void)mode, (void)t, (void)n;
    dxdt[0] = x[1];
    dxdt[1] = -9.8 * sin(x[0]);
    return 0;
}
static int angular_velocity(void* user, size_t which, rc_mode mode, double t, const double* x,
                            size_t n, double* g)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    *g = x[1];
    return 0;
}
static int parameter_of_pendulum(void* user, const char* name, double* value)
{
    if (strcmp(name, "gravity") == 0) *value = *(const double*)user;
    if (strcmp(name, "length") == 0) *value = 1;
    return 0;
}

static void asks_a_gate(const char* models)
{
    const double start[2] = {1, 0};
    double gravity = 9.8;
    char path[4096];
    rc_callbacks callbacks;
    rc_guard_info turning;
    rc_options options = options_until(20);
    rc_system* system;
    rc_simulation* exact;
    rc_simulation* gated;
    size_t i;
    snprintf(path, sizeof path, "%s/pendulum-gate.safetensors", models);
    memset(&callbacks, 0, sizeof callbacks);
    memset(&turning, 0, sizeof turning);
    turning.size = sizeof turning;
    turning.crossing = RC_EITHER;
    callbacks.size = sizeof callbacks;
    callbacks.name = "pendulum";
    callbacks.dimension = 2;
    callbacks.guard_count = 1;
    callbacks.guard_infos = &turning;
    callbacks.user = &gravity;
    callbacks.flow = swing;
    callbacks.guard = angular_velocity;
    callbacks.parameter = parameter_of_pendulum;
    options.fixed_step = 1;
    options.method = RC_RK4;
    options.step = 0.01;
    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
    CHECK_STATUS(RC_OK, rc_simulation_new(system, start, 2, &options, &exact));
    options.detector = RC_CALIBRATED;
    options.gate = path;
    CHECK_STATUS(RC_OK, rc_simulation_new(system, start, 2, &options, &gated));
    CHECK_STATUS(RC_OK, rc_run(exact));
    CHECK_STATUS(RC_OK, rc_run(gated));
    CHECK(rc_event_count(exact) > 10 && rc_event_count(gated) == rc_event_count(exact));
    for (i = 0; i < rc_event_count(exact); ++i) {
        CHECK(event_at(gated, i).t == event_at(exact, i).t);
    }
    CHECK(statistics_of(gated).gated > 500);
    CHECK(statistics_of(gated).guard_calls < statistics_of(exact).guard_calls / 4);
    rc_simulation_free(exact);
    rc_simulation_free(gated);

    gravity = 1.6; /* not what it was trained for */
    CHECK_REFUSED(RC_INVALID, rc_simulation_new(system, start, 2, &options, &gated), "gravity");
    options.gate = "no-such-file.safetensors";
    CHECK_REFUSED(RC_INVALID, rc_simulation_new(system, start, 2, &options, &gated),
                  "no-such-file");
    options.gate = NULL;
    CHECK_REFUSED(RC_INVALID, rc_simulation_new(system, start, 2, &options, &gated), "gate");
    rc_system_free(system);
}

/* --- many components --- */

static int rotate(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    size_t i;
    (void)user, (void)mode, (void)t;
    for (i = 0; i < n; i += 2) {
        dxdt[i] = x[i + 1];
        dxdt[i + 1] = -x[i];
    }
    return 0;
}

static void takes_states_of_many_components(void)
{
    enum { n = 200 };
    double start[n];
    rc_callbacks callbacks;
    rc_options options = options_until(6.283185307179586);
    rc_system* system;
    rc_simulation* simulation;
    int i, method;
    memset(&callbacks, 0, sizeof callbacks);
    callbacks.size = sizeof callbacks;
    callbacks.dimension = n;
    callbacks.flow = rotate;
    options.rtol = options.atol = 1e-10;
    for (i = 0; i < n; ++i) start[i] = i % 7;
    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
    for (method = RC_DOPRI5; method <= RC_EULER; ++method) {
        options.method = method;
        options.fixed_step = method >= RC_RK4;
        options.step = method == RC_EULER ? 1e-4 : method == RC_RK4 ? 1e-2 : 0;
        CHECK_STATUS(RC_OK, rc_simulation_new(system, start, n, &options, &simulation));
        CHECK_STATUS(RC_OK, rc_run(simulation));
        for (i = 0; i < n; ++i) {
            CHECK(fabs(rc_state(simulation)[i] - start[i]) < (method == RC_EULER ? 1e-2 : 1e-7));
        }
        CHECK(rc_event_count(simulation) == 0);
        rc_simulation_free(simulation);
    }
    rc_system_free(system);
}

/* --- tolerances --- */

/* A rotation, beside one of which nothing is asked. */
static int rotate_fast_and_slow(void* user, rc_mode mode, double t, const double* x, double* dxdt,
                                size_t n)
{
    (void)user, (void)mode, (void)t, (void)n;
    dxdt[0] = x[1];
    dxdt[1] = -x[0];
    dxdt[2] = 50 * x[3];
    dxdt[3] = -50 * x[2];
    return 0;
}

static uint64_t steps_with(double atol, const double* component_atol)
{
    const double start[4] = {1, 0, 1, 0};
    rc_callbacks callbacks;
    rc_options options = options_until(6);
    rc_statistics statistics;
    rc_system* system;
    rc_simulation* simulation;
    memset(&callbacks, 0, sizeof callbacks);
    callbacks.size = sizeof callbacks;
    callbacks.dimension = 4;
    callbacks.flow = rotate_fast_and_slow;
    options.atol = atol;
    options.component_atol = component_atol;
    options.component_count = component_atol ? 4 : 0;
    statistics.size = sizeof statistics;
    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
    CHECK_STATUS(RC_OK, rc_simulation_new(system, start, 4, &options, &simulation));
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK_STATUS(RC_OK, rc_get_statistics(simulation, &statistics));
    rc_simulation_free(simulation);
    rc_system_free(system);
    return statistics.steps;
}

static void takes_a_tolerance_for_each_component(void)
{
    const double equal[4] = {1e-9, 1e-9, 1e-9, 1e-9};
    const double slow[4] = {1e-9, 1e-9, 1, 1};
    CHECK(steps_with(1, equal) == steps_with(1e-9, NULL));
    CHECK(2 * steps_with(1, slow) < steps_with(1e-9, NULL));
}

/* --- cancelling --- */

static rc_simulation* to_cancel;

static int cancel_at_five(void* user, rc_mode mode, double t, const double* x, double* dxdt,
                          size_t n)
{
    if (t > 5) {
        int* once = user;
        if (*once) CHECK_STATUS(RC_OK, rc_cancel(to_cancel));
        *once = 0;
    }
    return ball_flow(user, mode, t, x, dxdt, n);
}

static void is_cancelled_and_continued(void)
{
    rc_callbacks callbacks = ball_callbacks();
    rc_options options = options_until(20.5);
    rc_simulation* whole = start_ball(&callbacks, &options);
    int once = 1;
    callbacks.flow = cancel_at_five;
    callbacks.user = &once;
    to_cancel = start_ball(&callbacks, &options);
    CHECK_STATUS(RC_OK, rc_run(whole));
    CHECK_STATUS(RC_OK, rc_run(to_cancel));
    CHECK(rc_outcome(to_cancel) == RC_CANCELLED);
    CHECK(rc_time(to_cancel) < 20.5 && rc_event_count(to_cancel) < 13);
    CHECK_STATUS(RC_OK, rc_run(to_cancel));
    CHECK(rc_outcome(to_cancel) == RC_REACHED_END && rc_event_count(to_cancel) == 13);
    CHECK(memcmp(rc_state(to_cancel), rc_state(whole), 2 * sizeof(double)) == 0);
    rc_simulation_free(to_cancel);
    to_cancel = start_ball(&callbacks, &options);
    CHECK_STATUS(RC_OK, rc_cancel(to_cancel)); /* before it starts */
    CHECK_STATUS(RC_OK, rc_run(to_cancel));
    CHECK(rc_outcome(to_cancel) == RC_CANCELLED && rc_time(to_cancel) == 0);
    CHECK_STATUS(RC_OK, rc_run(to_cancel));
    CHECK(rc_outcome(to_cancel) == RC_REACHED_END);
    rc_simulation_free(to_cancel);
    rc_simulation_free(whole);
}

int main(int argc, char** argv)
{
    CHECK(argc == 2); /* the directory of the models */
    finds_the_impacts_of_a_ball();
    goes_step_by_step_and_from_event_to_event();
    takes_samples_and_keeps_the_solution();
    goes_on_from_what_was_saved();
    switches_between_modes();
    meets_time_events_exactly_and_runs_backward();
    comes_to_rest_where_events_accumulate();
    does_what_is_said_of_guards();
    plans_by_bounds();
    asks_a_gate(argv[1]);
    takes_states_of_many_components();
    takes_a_tolerance_for_each_component();
    is_cancelled_and_continued();
    return 0;
}
