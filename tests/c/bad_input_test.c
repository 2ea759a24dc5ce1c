/* Everything that is not as it has to be: a defined error each, and a message that names it. */
#include <limits.h>
#include <math.h>

#include "ball.h"

static const double start[2] = {10, 0};

/* --- systems --- */

/* In places where they are not wanted; never called. */
static int any_reset_set(void* user, const size_t* fired, size_t count, int on_time, rc_mode* mode,
                         double t, double* x, size_t n)
{
    (void)user, (void)fired, (void)count, (void)on_time, (void)mode, (void)t, (void)x, (void)n;
    return 1;
}
static int any_rest(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)which, (void)mode, (void)t, (void)x, (void)n;
    return 1;
}
static int any_time_reset(void* user, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)mode, (void)t, (void)x, (void)n;
    return 1;
}
static int any_time(void* user, double t, double* next)
{
    (void)user, (void)t, (void)next;
    return 1;
}

static void refuses_systems_that_are_none(void)
{
    rc_callbacks callbacks = ball_callbacks();
    rc_system* system = (rc_system*)&callbacks;
    CHECK_REFUSED(RC_INVALID, rc_system_new(NULL, &system), "null");
    CHECK(system == NULL);
    CHECK_REFUSED(RC_INVALID, rc_system_new(&callbacks, NULL), "null");

#define CHECK_SYSTEM(change, text)                                       \
    callbacks = ball_callbacks();                                        \
    change;                                                              \
    CHECK_REFUSED(RC_INVALID, rc_system_new(&callbacks, &system), text); \
    CHECK(system == NULL)

    CHECK_SYSTEM(callbacks.flow = NULL, "flow");
    CHECK_SYSTEM(callbacks.dimension = 0, "dimension");
    CHECK_SYSTEM(callbacks.guard = NULL, "guard");
    CHECK_SYSTEM(callbacks.guard_count = 0, "guard_count");
    CHECK_SYSTEM((callbacks.guard_count = 0, callbacks.guard = NULL), "guard_count");
    CHECK_SYSTEM(callbacks.reset_set = any_reset_set, "reset_set");
    CHECK_SYSTEM((callbacks.reset = NULL, callbacks.rest = any_rest), "rest without a reset");
    CHECK_SYSTEM(callbacks.time_reset = any_time_reset, "next_time_event");
    CHECK_SYSTEM(callbacks.previous_time_event = any_time, "next_time_event");
    CHECK_SYSTEM(callbacks.lower_bound = ball_guard, "speed_bound");
    CHECK_SYSTEM(callbacks.mode_count = SIZE_MAX, "mode_count");
    rc_system_free(NULL);
}

static void refuses_infos_that_are_none(void)
{
    rc_callbacks callbacks = ball_callbacks();
    rc_guard_info info;
    rc_system* system;

#define CHECK_INFO(change, text)                                         \
    memset(&info, 0, sizeof info);                                       \
    info.size = sizeof info;                                             \
    change;                                                              \
    callbacks.guard_infos = &info;                                       \
    CHECK_REFUSED(RC_INVALID, rc_system_new(&callbacks, &system), text); \
    CHECK(strstr(rc_last_error(), "guard 0"))

    CHECK_INFO(info.crossing = 3, "rc_crossing");
    CHECK_INFO(info.crossing = -1, "rc_crossing");
    CHECK_INFO(info.notifies = 2, "notifies");
    CHECK_INFO(info.unilateral = -1, "unilateral");
    CHECK_INFO(info.boolean = 77, "boolean");
    CHECK_INFO(info.degree = -2, "degree");
    CHECK_INFO(info.touch = NAN, "touch");
    CHECK_INFO(info.touch = -1, "touch");
    CHECK_INFO(info.lipschitz = INFINITY, "lipschitz");
}

/* --- options and starts --- */

static void refuses_options_that_are_none(void)
{
    const rc_callbacks callbacks = ball_callbacks();
    rc_options options;
    rc_system* system;
    rc_simulation* simulation;
    double sample = 30;
    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));

#define CHECK_OPTION(change, text)                                                               \
    options = options_until(20.5);                                                               \
    change;                                                                                      \
    CHECK_REFUSED(RC_INVALID, rc_simulation_new(system, start, 2, &options, &simulation), text); \
    CHECK(simulation == NULL)

    CHECK_OPTION(options.t_end = NAN, "rc_options: t_end: found nan, expected a finite time");
    CHECK_OPTION(options.t_end = INFINITY, "t_end");
    CHECK_OPTION(options.t_start = NAN, "t_start");
    CHECK_OPTION(options.rtol = NAN, "rtol");
    CHECK_OPTION(options.atol = -1, "atol");
    CHECK_OPTION(options.rtol = options.atol = 0, "rtol");
    CHECK_OPTION(options.h_min = NAN, "h_min");
    CHECK_OPTION(options.h_max = 0, "h_max");
    CHECK_OPTION(options.h_max = NAN, "h_max");
    CHECK_OPTION(options.step = NAN, "step");
    CHECK_OPTION(options.fixed_step = 1, "step");
    CHECK_OPTION(options.event_tolerance = NAN, "event_tolerance");
    CHECK_OPTION(options.event_rtol = -1, "event_rtol");
    CHECK_OPTION(options.event_window = NAN, "event_window");
    CHECK_OPTION(options.method = 6, "method");
    CHECK_OPTION(options.method = -1, "method");
    CHECK_OPTION(options.method = RC_TAYLOR, "expected RC_FEHLBERG78");
    CHECK_OPTION(options.method = RC_RK4, "error");
    CHECK_OPTION(options.method = RC_EULER, "expected fixed_step = 1 and a step, or RC_DOPRI5");
    CHECK_OPTION(options.detector = 7, "detector");
    CHECK_OPTION(options.detector = INT_MIN, "detector");
    CHECK_OPTION(options.locator = 3, "locator");
    CHECK_OPTION(options.fixed_step = 2, "fixed_step");
    CHECK_OPTION(options.check_inside = -1, "check_inside");
    CHECK_OPTION(options.stop_at_event = 255, "stop_at_event");
    CHECK_OPTION(options.record_events = 3, "record_events");
    CHECK_OPTION(options.event_states = 3, "event_states");
    CHECK_OPTION(options.record_steps = 3, "record_steps");
    CHECK_OPTION(options.mode = 1, "mode");
    CHECK_OPTION(options.sample_count = 1, "sample_times");
    CHECK_OPTION((options.sample_count = 1, options.sample_times = &sample), "sample time");
    CHECK_OPTION((sample = NAN, options.sample_count = 1, options.sample_times = &sample),
                 "sample_times");
    CHECK_OPTION(options.component_count = 2, "component_atol");
    CHECK_OPTION((options.component_count = 1, options.component_atol = start),
                 "each of the 2 components");
    CHECK_OPTION(options.gate = "gate.safetensors", "gate");
    CHECK_OPTION(options.detector = RC_FORESEEN, "gate");
    CHECK_REFUSED(RC_INVALID, rc_options_default(NULL, sizeof options), "null");
    rc_system_free(system);
}

static void refuses_starts_that_are_none(void)
{
    rc_callbacks callbacks = ball_callbacks();
    rc_options options = options_until(20.5);
    rc_system* system;
    rc_simulation* simulation = (rc_simulation*)&options;
    const double lost[2] = {NAN, 0};
    const double below[2] = {-1, 0};
    rc_guard_info info;
    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
    CHECK_REFUSED(RC_INVALID, rc_simulation_new(system, NULL, 2, &options, &simulation), "x0");
    CHECK(simulation == NULL);
    CHECK_REFUSED(RC_INVALID, rc_simulation_new(system, start, 2, NULL, &simulation), "null");
    CHECK_REFUSED(RC_INVALID, rc_simulation_new(system, start, 2, &options, NULL), "null");
    CHECK_REFUSED(RC_INVALID, rc_simulation_new(system, start, 0, &options, &simulation), "n = 0");
    CHECK_REFUSED(RC_INVALID, rc_simulation_new(system, start, 3, &options, &simulation), "n = 3");
    CHECK_STATUS(RC_INVALID, rc_simulation_new(system, lost, 2, &options, &simulation));
    CHECK_REFUSED(RC_BAD_HANDLE, rc_simulation_new(NULL, start, 2, &options, &simulation), "null");
    rc_system_free(system);

    memset(&info, 0, sizeof info);
    info.size = sizeof info;
    info.name = "floor";
    info.unilateral = 1;
    callbacks.guard_infos = &info;
    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
    CHECK_REFUSED(RC_INVALID, rc_simulation_new(system, below, 2, &options, &simulation), "floor");
    rc_system_free(system);
}

/* --- sizes of structs --- */

static void refuses_structs_of_other_versions(void)
{
    rc_callbacks callbacks = ball_callbacks();
    rc_options options = options_until(1);
    struct {
        rc_options options;
        double more;
    } larger;
    rc_system* system;
    rc_simulation* simulation;
    rc_event event;
    rc_statistics statistics;
    rc_guard_info infos[2];

    callbacks.size = sizeof callbacks + 8;
    CHECK_REFUSED(RC_WRONG_SIZE, rc_system_new(&callbacks, &system), "older than the program");
    callbacks.size = 0;
    CHECK_REFUSED(RC_WRONG_SIZE, rc_system_new(&callbacks, &system), "sizeof(rc_callbacks)");
    callbacks.size = sizeof callbacks - 3;
    CHECK_STATUS(RC_WRONG_SIZE, rc_system_new(&callbacks, &system));
    callbacks.size = SIZE_MAX;
    CHECK_STATUS(RC_WRONG_SIZE, rc_system_new(&callbacks, &system));

    callbacks = ball_callbacks();
    memset(infos, 0, sizeof infos);
    infos[0].size = sizeof infos[0] + 16;
    callbacks.guard_infos = infos;
    CHECK_REFUSED(RC_WRONG_SIZE, rc_system_new(&callbacks, &system), "rc_guard_info");
    infos[0].size = sizeof infos[0];
    callbacks.guard_count = 2;
    CHECK_REFUSED(RC_WRONG_SIZE, rc_system_new(&callbacks, &system), "rc_guard_info");

    callbacks = ball_callbacks();
    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
    larger.options = options;
    larger.more = 0;
    larger.options.size = sizeof larger;
    CHECK_REFUSED(RC_WRONG_SIZE, rc_simulation_new(system, start, 2, &larger.options, &simulation),
                  "older than the program");
    CHECK_STATUS(RC_WRONG_SIZE, rc_options_default(&options, sizeof options + 8));
    CHECK_STATUS(RC_WRONG_SIZE, rc_options_default(&options, 3));

    CHECK_STATUS(RC_OK, rc_simulation_new(system, start, 2, &options, &simulation));
    options = options_until(20.5);
    CHECK_STATUS(RC_OK, rc_simulation_free(simulation));
    CHECK_STATUS(RC_OK, rc_simulation_new(system, start, 2, &options, &simulation));
    CHECK_STATUS(RC_OK, rc_run(simulation));
    event.size = sizeof event + 8;
    CHECK_STATUS(RC_WRONG_SIZE, rc_event_at(simulation, 0, &event));
    CHECK_REFUSED(RC_INVALID, rc_event_at(simulation, 0, NULL), "null");
    statistics.size = 1;
    CHECK_STATUS(RC_WRONG_SIZE, rc_get_statistics(simulation, &statistics));
    CHECK_REFUSED(RC_INVALID, rc_get_statistics(simulation, NULL), "null");
    rc_simulation_free(simulation);
    rc_system_free(system);
}

/* --- results --- */

static void refuses_what_there_is_not(void)
{
    const rc_callbacks callbacks = ball_callbacks();
    rc_options options = options_until(20.5);
    rc_simulation* simulation = start_ball(&callbacks, &options);
    rc_event event;
    rc_mode mode;
    double x[2];
    double t;
    size_t size = 8;
    event.size = sizeof event;
    CHECK_REFUSED(RC_INVALID, rc_event_at(simulation, 0, &event), "event 0");
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK_REFUSED(RC_INVALID, rc_event_at(simulation, 13, &event), "found 13");
    CHECK_STATUS(RC_INVALID, rc_event_at(simulation, SIZE_MAX, &event));
    CHECK_REFUSED(RC_INVALID, rc_sample_at(simulation, 0, &t, NULL), "sample 0");
    CHECK_REFUSED(RC_INVALID, rc_solution(simulation, 1, x, 2), "record_steps");
    CHECK_REFUSED(RC_INVALID, rc_solution_mode(simulation, 1, &mode), "record_steps");
    CHECK_REFUSED(RC_INVALID, rc_save(simulation, x, NULL), "size");
    CHECK_REFUSED(RC_INVALID, rc_save(simulation, x, &size), "room");
    CHECK_REFUSED(RC_INVALID, rc_restore(simulation, NULL, 8), "null");
    CHECK_STATUS(RC_INVALID, rc_restore(simulation, "nonsense", 8));
    CHECK(rc_outcome(simulation) == RC_REACHED_END);
    rc_simulation_free(simulation);

    options.record_steps = 1;
    simulation = start_ball(&callbacks, &options);
    CHECK_STATUS(RC_INVALID, rc_solution(simulation, 1, x, 2)); /* no step yet */
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK_REFUSED(RC_INVALID, rc_solution(simulation, NAN, x, 2), "NaN");
    CHECK_REFUSED(RC_INVALID, rc_solution(simulation, 1, NULL, 2), "null");
    CHECK_REFUSED(RC_INVALID, rc_solution(simulation, 1, x, 1), "n = 1");
    CHECK_REFUSED(RC_INVALID, rc_solution_mode(simulation, 1, NULL), "null");
    rc_simulation_free(simulation);

    CHECK(strcmp(rc_status_name((rc_status)99), "unknown") == 0);
    CHECK(strcmp(rc_status_name(RC_BUSY), "RC_BUSY") == 0);
    CHECK(strcmp(rc_outcome_name((rc_outcome_code)99), "unknown") == 0);
    CHECK(strcmp(rc_outcome_name(RC_RUNNING), "running") == 0);
    CHECK(strlen(rc_outcome_text((rc_outcome_code)-5)) > 0);
    CHECK(strlen(rc_outcome_text(RC_STOPPED_BY_CALLBACK)) > 40);
    CHECK(strcmp(rc_version(), EXPECTED_VERSION) == 0);
}

/* --- handles --- */

static void refuses_handles_that_are_none(void)
{
    const rc_callbacks callbacks = ball_callbacks();
    const rc_options options = options_until(20.5);
    rc_system* system;
    rc_simulation* none = NULL;
    rc_simulation* simulation;
    rc_event event;
    event.size = sizeof event;
    CHECK_REFUSED(RC_BAD_HANDLE, rc_run(none), "null");
    CHECK_STATUS(RC_BAD_HANDLE, rc_step(none, NULL));
    CHECK_STATUS(RC_BAD_HANDLE, rc_advance(none, NULL));
    CHECK_STATUS(RC_BAD_HANDLE, rc_cancel(none));
    CHECK_STATUS(RC_BAD_HANDLE, rc_event_at(none, 0, &event));
    CHECK_STATUS(RC_OK, rc_simulation_free(none));
    CHECK(isnan(rc_time(none)) && rc_state(none) == NULL && rc_mode_now(none) == UINT32_MAX);
    CHECK(rc_event_count(none) == 0 && rc_sample_count(none) == 0);
    CHECK(rc_outcome(none) == RC_RUNNING);

    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
    CHECK_REFUSED(RC_BAD_HANDLE, rc_run((rc_simulation*)system), "no such handle");
    CHECK_STATUS(RC_OK, rc_simulation_new(system, start, 2, &options, &simulation));
    CHECK_STATUS(RC_BAD_HANDLE,
                 rc_simulation_new((rc_system*)simulation, start, 2, &options, &none));
    rc_system_free((rc_system*)simulation); /* not one: nothing is freed */
    CHECK_STATUS(RC_OK, rc_run(simulation));
    rc_simulation_free(simulation);
    rc_system_free(system);
}

/* --- callbacks that misbehave --- */

static int reset_to_nan(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    x[1] = NAN;
    return 0;
}
static int reset_to_mode_9(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)which, (void)t, (void)x, (void)n;
    *mode = 9;
    return 0;
}
static int forgets(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                   double* g)
{
    (void)user, (void)which, (void)mode, (void)x, (void)n;
    if (t < 0.1) *g = 1;
    return 0; /* later on nothing is written */
}
static int flow_of_nan(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    ball_flow(user, mode, t, x, dxdt, n);
    if (t > 0.5) dxdt[1] = NAN;
    return 0;
}
static int time_that_is_past(void* user, double t, double* next)
{
    (void)user;
    *next = t < 0.5 ? 0.5 : 0.5;
    return 0;
}
static int fails(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    (void)user, (void)mode, (void)t, (void)x, (void)dxdt, (void)n;
    return -7;
}

static rc_outcome_code outcome_of(const rc_callbacks* callbacks)
{
    const rc_options options = options_until(3);
    rc_simulation* simulation = start_ball(callbacks, &options);
    rc_outcome_code outcome;
    CHECK_STATUS(RC_OK, rc_run(simulation));
    outcome = rc_outcome(simulation);
    CHECK(isfinite(rc_state(simulation)[0]) && isfinite(rc_state(simulation)[1]));
    rc_simulation_free(simulation);
    return outcome;
}

static void ends_runs_of_callbacks_that_misbehave(void)
{
    rc_callbacks callbacks = ball_callbacks();
    rc_options options = options_until(3);
    rc_callback_error error;
    rc_system* system;
    rc_simulation* simulation;
    callbacks.reset = reset_to_nan;
    CHECK(outcome_of(&callbacks) == RC_NON_FINITE);
    callbacks.reset = reset_to_mode_9;
    CHECK(outcome_of(&callbacks) == RC_UNKNOWN_MODE);
    callbacks = ball_callbacks();
    callbacks.guard = forgets;
    CHECK(outcome_of(&callbacks) == RC_NON_FINITE);
    callbacks = ball_callbacks();
    callbacks.flow = flow_of_nan;
    CHECK(outcome_of(&callbacks) == RC_NON_FINITE);
    callbacks = ball_callbacks();
    callbacks.next_time_event = time_that_is_past;
    CHECK(outcome_of(&callbacks) == RC_TIME_EVENT_NOT_AHEAD);

    callbacks = ball_callbacks();
    callbacks.flow = fails;
    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
    CHECK_REFUSED(RC_CALLBACK, rc_simulation_new(system, start, 2, &options, &simulation),
                  "flow returned -7");
    CHECK(simulation == NULL);
    error.size = sizeof error;
    CHECK_STATUS(RC_OK, rc_callback_failure(NULL, &error));
    CHECK(error.code == -7 && strcmp(error.callback, "flow") == 0);
    CHECK(error.guard == RC_NO_GUARD && error.t == 0);
    CHECK_REFUSED(RC_INVALID, rc_callback_failure(NULL, NULL), "null");
    rc_system_free(system);
}

/* A callback that continues with the run that called it. */
static rc_simulation* inner;
static int goes_on_with_it(void* user, rc_mode mode, double t, const double* x, double* dxdt,
                           size_t n)
{
    if (inner) {
        CHECK_REFUSED(RC_BUSY, rc_step(inner, NULL), "in use");
        CHECK_STATUS(RC_BUSY, rc_simulation_free(inner));
        CHECK(rc_state(inner) == NULL && isnan(rc_time(inner)));
    }
    return ball_flow(user, mode, t, x, dxdt, n);
}

static void refuses_calls_from_its_own_callbacks(void)
{
    rc_callbacks callbacks = ball_callbacks();
    const rc_options options = options_until(20.5);
    callbacks.flow = goes_on_with_it;
    inner = NULL;
    inner = start_ball(&callbacks, &options);
    CHECK_STATUS(RC_OK, rc_run(inner));
    CHECK(rc_event_count(inner) == 13);
    CHECK_STATUS(RC_OK, rc_simulation_free(inner));
}

/* --- memory --- */

static void says_that_there_is_no_memory(void)
{
    const size_t dimensions[3] = {SIZE_MAX, SIZE_MAX / 16, (size_t)1 << 42};
    rc_callbacks callbacks;
    const rc_options options = options_until(1);
    int i;
    memset(&callbacks, 0, sizeof callbacks);
    callbacks.size = sizeof callbacks;
    callbacks.flow = ball_flow;
    for (i = 0; i < 3; ++i) {
        rc_system* system;
        rc_simulation* simulation;
        callbacks.dimension = dimensions[i];
        CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
        /* The start is not read. */
        CHECK_REFUSED(RC_NO_MEMORY,
                      rc_simulation_new(system, start, dimensions[i], &options, &simulation),
                      "memory");
        CHECK(simulation == NULL);
        rc_system_free(system);
    }
    {
        rc_system* system;
        callbacks = ball_callbacks();
        callbacks.guard_count = SIZE_MAX / 8;
        CHECK_STATUS(RC_NO_MEMORY, rc_system_new(&callbacks, &system));
        CHECK(system == NULL);
    }
}

int main(void)
{
    CHECK(strcmp(rc_last_error(), "") == 0);
    refuses_systems_that_are_none();
    refuses_infos_that_are_none();
    refuses_options_that_are_none();
    refuses_starts_that_are_none();
    refuses_structs_of_other_versions();
    refuses_what_there_is_not();
    refuses_handles_that_are_none();
    ends_runs_of_callbacks_that_misbehave();
    refuses_calls_from_its_own_callbacks();
    says_that_there_is_no_memory();
    return 0;
}
