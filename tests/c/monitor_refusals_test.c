/* What a host must not do: a defined error each, and a monitor that continues as if it had not. */
#include "rk4_host.h"

static const double start[2] = {10, 0};

static int every_second(void* user, double t, double* next)
{
    (void)user;
    *next = floor(t) + 1;
    return 0;
}

/* --- monitors that are none --- */

static void refuses_monitors_that_are_none(void)
{
    rc_callbacks callbacks = ball_callbacks();
    rc_monitor_options options;
    struct {
        rc_monitor_options options;
        double more;
    } larger;
    rc_system* system;
    rc_monitor* monitor;
    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));

#define CHECK_OPTION(change, text)                                               \
    CHECK_STATUS(RC_OK, rc_monitor_options_default(&options, sizeof options));   \
    change;                                                                      \
    monitor = (rc_monitor*)&options;                                             \
    CHECK_REFUSED(RC_INVALID, rc_monitor_new(system, &options, &monitor), text); \
    CHECK(monitor == NULL)

    CHECK_OPTION(options.event_tolerance = -1, "event_tolerance");
    CHECK_OPTION(options.event_tolerance = NAN, "event_tolerance");
    CHECK_OPTION(options.event_rtol = -1, "event_rtol");
    CHECK_OPTION(options.event_window = NAN, "event_window");
    CHECK_OPTION(options.detector = 7, "detector");
    CHECK_OPTION(options.locator = -1, "locator");
    CHECK_OPTION(options.check_inside = 2, "check_inside");
    CHECK_OPTION(options.record_events = 2, "record_events");
    CHECK_OPTION(options.event_states = 2, "event_states");
    CHECK_OPTION(options.backward = -1, "backward");
    CHECK_OPTION(options.cut_at_all = 9, "cut_at_all");
    CHECK_OPTION(options.detector = RC_FORESEEN, "gate");
    CHECK_OPTION(options.gate = "gate.safetensors", "gate");

    CHECK_STATUS(RC_OK, rc_monitor_options_default(&larger.options, sizeof larger.options));
    larger.options.size = sizeof larger;
    CHECK_REFUSED(RC_WRONG_SIZE, rc_monitor_new(system, &larger.options, &monitor),
                  "older than the program");
    larger.options.size = 0;
    CHECK_REFUSED(RC_WRONG_SIZE, rc_monitor_new(system, &larger.options, &monitor),
                  "sizeof(rc_monitor_options)");
    CHECK_STATUS(RC_WRONG_SIZE, rc_monitor_options_default(&options, sizeof options + 8));
    CHECK_REFUSED(RC_INVALID, rc_monitor_options_default(NULL, sizeof options), "null");
    CHECK_REFUSED(RC_INVALID, rc_monitor_new(system, NULL, NULL), "null");
    CHECK_REFUSED(RC_BAD_HANDLE, rc_monitor_new(NULL, NULL, &monitor), "null");
    rc_system_free(system);

    callbacks.guard_count = 0;
    callbacks.guard = NULL;
    callbacks.reset = NULL;
    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
    CHECK_REFUSED(RC_INVALID, rc_monitor_new(system, NULL, &monitor), "without guards");
    rc_system_free(system);

    callbacks = ball_callbacks();
    callbacks.dimension = (size_t)1 << 42;
    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
    CHECK_REFUSED(RC_NO_MEMORY, rc_monitor_new(system, NULL, &monitor), "memory");
    CHECK(monitor == NULL);
    rc_system_free(system);
}

static void refuses_handles_that_are_none(void)
{
    const rc_callbacks callbacks = ball_callbacks();
    const rc_options run = options_until(1);
    rc_system* system;
    rc_monitor* monitor;
    rc_simulation* simulation;
    rc_verdict verdict = RC_STANDS;
    double remainder;
    CHECK_REFUSED(RC_BAD_HANDLE, rc_monitor_start(NULL, 0, start, NULL, 2, 0, 1, &verdict),
                  "rc_monitor: found null");
    CHECK(verdict == RC_NO_VERDICT);
    CHECK_STATUS(RC_BAD_HANDLE, rc_monitor_examine(NULL, NULL, &verdict));
    CHECK_STATUS(RC_BAD_HANDLE, rc_monitor_hold(NULL, 1, &verdict));
    CHECK_STATUS(RC_BAD_HANDLE, rc_monitor_cut(NULL, NULL));
    CHECK_STATUS(RC_OK, rc_monitor_free(NULL));
    CHECK(isnan(rc_monitor_time(NULL, &remainder)) && isnan(rc_monitor_quiet_until(NULL)));
    CHECK(rc_monitor_state(NULL) == NULL && rc_monitor_mode(NULL) == UINT32_MAX);
    CHECK(isnan(rc_monitor_must_stop_at(NULL)) && rc_monitor_guard(NULL) == RC_NO_GUARD);
    CHECK(rc_monitor_outcome(NULL) == RC_RUNNING && rc_monitor_event_count(NULL) == 0);

    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
    CHECK_STATUS(RC_OK, rc_monitor_new(system, NULL, &monitor));
    CHECK_STATUS(RC_OK, rc_simulation_new(system, start, 2, &run, &simulation));
    CHECK_REFUSED(RC_BAD_HANDLE, rc_monitor_hold((rc_monitor*)simulation, 1, &verdict),
                  "no such handle");
    CHECK_REFUSED(RC_BAD_HANDLE, rc_run((rc_simulation*)monitor), "no such handle");
    CHECK_STATUS(RC_BAD_HANDLE, rc_monitor_free((rc_monitor*)system));
    CHECK_STATUS(RC_OK, rc_simulation_free(simulation));
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
    rc_system_free(system);
}

/* --- arguments --- */

static void refuses_starts_that_are_none(void)
{
    rc_callbacks callbacks = ball_callbacks();
    rc_guard_info info;
    rc_monitor* monitor;
    rc_verdict verdict = RC_STANDS;
    const double lost[2] = {NAN, 0};
    const double below[2] = {-1, 0};
    rc_side side;
    memset(&info, 0, sizeof info);
    info.size = sizeof info;
    info.name = "floor";
    info.unilateral = 1;
    callbacks.guard_infos = &info;
    monitor = monitor_of(&callbacks, NULL);
    CHECK_REFUSED(RC_INVALID, rc_monitor_start(monitor, 0, NULL, NULL, 2, 0, 1, &verdict), "x");
    CHECK(verdict == RC_NO_VERDICT);
    CHECK_REFUSED(RC_INVALID, rc_monitor_start(monitor, 0, start, NULL, 3, 0, 1, &verdict),
                  "n = 3");
    CHECK_REFUSED(RC_INVALID, rc_monitor_start(monitor, 0, start, NULL, 2, 0, 1, NULL), "verdict");
    CHECK_REFUSED(RC_INVALID, rc_monitor_start(monitor, NAN, start, NULL, 2, 0, 1, &verdict),
                  "nan");
    CHECK_STATUS(RC_INVALID, rc_monitor_start(monitor, 0, lost, NULL, 2, 0, 1, &verdict));
    CHECK_REFUSED(RC_INVALID, rc_monitor_start(monitor, 0, start, lost, 2, 0, 1, &verdict),
                  "dxdt must be finite");
    CHECK_STATUS(RC_INVALID, rc_monitor_start(monitor, 0, start, NULL, 2, 0, 0, &verdict));
    CHECK_STATUS(RC_INVALID, rc_monitor_start(monitor, 0, start, NULL, 2, 0, INFINITY, &verdict));
    CHECK_REFUSED(RC_INVALID, rc_monitor_start(monitor, 0, start, NULL, 2, 1, 1, &verdict), "mode");
    CHECK_REFUSED(RC_INVALID, rc_monitor_start(monitor, 0, below, NULL, 2, 0, 1, &verdict),
                  "floor");
    CHECK_STATUS(RC_OUT_OF_TURN, rc_monitor_side(monitor, 0, &side));
    CHECK_STATUS(RC_OK, rc_monitor_start(monitor, 0, start, NULL, 2, 0, 1, &verdict));
    CHECK(verdict == RC_STANDS);
    CHECK_REFUSED(RC_INVALID, rc_monitor_side(monitor, 1, &side), "guard 1");
    CHECK_REFUSED(RC_INVALID, rc_monitor_side(monitor, 0, NULL), "null");
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
}

static void refuses_steps_that_are_none(void)
{
    const rc_callbacks callbacks = ball_callbacks();
    rc_monitor* monitor = monitor_of(&callbacks, NULL);
    struct host host;
    rc_host_step step;
    rc_verdict verdict;
    struct {
        rc_host_step step;
        double more;
    } larger;
    CHECK(host_start(&host, monitor, &callbacks, 0, start, 0.1) == RC_STANDS);

#define CHECK_STEP(status, change, text)                                       \
    step = host_step(&host, 0.1);                                              \
    change;                                                                    \
    CHECK_REFUSED(status, rc_monitor_examine(monitor, &step, &verdict), text); \
    CHECK(verdict == RC_NO_VERDICT && rc_monitor_time(monitor, NULL) == 0)

    CHECK_STEP(RC_INVALID, step.n = 1, "n = 1");
    CHECK_STEP(RC_INVALID, step.n = 0, "n = 0");
    CHECK_STEP(RC_INVALID, step.x0 = NULL, "x0");
    CHECK_STEP(RC_INVALID, step.x1 = NULL, "x1");
    CHECK_STEP(RC_INVALID, step.rate0 = NULL, "rate0");
    CHECK_STEP(RC_INVALID, step.rate1 = NULL, "rate1");
    CHECK_STEP(RC_INVALID, step.interpolate_rate = host_restep, "without an interpolate");
    CHECK_STEP(RC_INVALID, step.h = 0, "length");
    CHECK_STEP(RC_INVALID, step.h = -0.1, "length");
    CHECK_STEP(RC_INVALID, step.h = NAN, "length");
    CHECK_STEP(RC_INVALID, step.h = INFINITY, "length");
    CHECK_STEP(RC_WRONG_SIZE, step.size = 0, "sizeof(rc_host_step)");
    CHECK_STEP(RC_WRONG_SIZE, step.size = SIZE_MAX, "older than the program");
    CHECK_STEP(RC_OUT_OF_TURN, step.t0 = 0.1, "0.1");
    CHECK_STEP(RC_OUT_OF_TURN, step.t0 = -0.1, "0.1");
    CHECK_STEP(RC_OUT_OF_TURN, step.t0 = NAN, "nan");
    CHECK_STEP(RC_INVALID, step.t0_remainder = NAN, "t0_remainder");
    CHECK_STEP(RC_INVALID, step.t0_remainder = 0.01, "t0_remainder");
    CHECK_STEP(RC_OUT_OF_TURN, host.x[0] = 9, "x0[0] = 9");
    host.x[0] = 10;
    CHECK_STEP(RC_INVALID, host.x1[1] = NAN, "x1 must be finite, got nan in component 1");
    CHECK_STEP(RC_INVALID, host.rate1[0] = INFINITY, "rate1 must be finite");
    CHECK_STEP(RC_INVALID, host.rate[1] = NAN, "rate0 must be finite");
    host_restart(&host, 0, start, 0);
    larger.step = host_step(&host, 0.1);
    larger.step.size = sizeof larger;
    CHECK_STATUS(RC_WRONG_SIZE, rc_monitor_examine(monitor, &larger.step, &verdict));
    CHECK_REFUSED(RC_INVALID, rc_monitor_examine(monitor, NULL, &verdict), "rc_host_step");
    step = host_step(&host, 0.1);
    CHECK_REFUSED(RC_INVALID, rc_monitor_examine(monitor, &step, NULL), "verdict");

    /* Nothing has changed. */
    CHECK_STATUS(RC_OK, rc_monitor_examine(monitor, &step, &verdict));
    CHECK(verdict == RC_STANDS && rc_monitor_time(monitor, NULL) == 0.1);
    CHECK_STATUS(RC_OUT_OF_TURN, rc_monitor_examine(monitor, &step, &verdict)); /* shown twice */
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
}

/* --- calls out of turn --- */

static void refuses_calls_out_of_turn(void)
{
    const rc_callbacks callbacks = ball_callbacks();
    rc_monitor* monitor = monitor_of(&callbacks, NULL);
    struct host host;
    rc_host_step step;
    rc_verdict verdict;
    rc_cut cut;
    rc_event event;
    rc_statistics statistics;
    size_t size = 0;
    const double lost[2] = {0, NAN};
    memset(&host, 0, sizeof host);
    host.system = &callbacks;
    host_restart(&host, 0, start, 0);
    step = host_step(&host, 2);
    CHECK_REFUSED(RC_OUT_OF_TURN, rc_monitor_examine(monitor, &step, &verdict), "`start`");
    CHECK_STATUS(RC_OUT_OF_TURN, rc_monitor_save(monitor, NULL, &size));
    CHECK_STATUS(RC_OUT_OF_TURN, rc_monitor_skip_to(monitor, 0, start, host.rate, 2));
    CHECK_STATUS(RC_OK, rc_monitor_start(monitor, 0, start, host.rate, 2, 0, 2, &verdict));
    CHECK_REFUSED(RC_OUT_OF_TURN, rc_monitor_resume(monitor, NULL, 0, 1, &verdict), "`cut`");
    CHECK_STATUS(RC_OUT_OF_TURN, rc_monitor_resume_at(monitor, start, NULL, 2, 0, 1, &verdict));
    CHECK_REFUSED(RC_OUT_OF_TURN, rc_monitor_hold(monitor, 1, &verdict), "`rests`");
    cut.size = sizeof cut;
    CHECK_REFUSED(RC_OUT_OF_TURN, rc_monitor_cut(monitor, &cut), "no set");
    CHECK_REFUSED(RC_OUT_OF_TURN, rc_monitor_skip_to(monitor, 1, start, host.rate, 2),
                  "`quiet_until`");
    CHECK_REFUSED(RC_INVALID, rc_monitor_skip_to(monitor, 0, start, NULL, 2), "dxdt");
    CHECK_REFUSED(RC_INVALID, rc_monitor_skip_to(monitor, 0, start, host.rate, 4), "n = 4");
    CHECK_REFUSED(RC_INVALID, rc_monitor_skip_to(monitor, 0, NULL, host.rate, 2), "x");

    /* A host that forgets to resume. */
    CHECK_STATUS(RC_OK, rc_monitor_examine(monitor, &step, &verdict));
    CHECK(verdict == RC_CUT);
    CHECK_REFUSED(RC_OUT_OF_TURN, rc_monitor_examine(monitor, &step, &verdict), "`resume`");
    CHECK_STATUS(RC_OUT_OF_TURN, rc_monitor_save(monitor, NULL, &size));
    CHECK_REFUSED(RC_INVALID, rc_monitor_resume(monitor, lost, 1, 1, &verdict), "n = 1");
    CHECK_REFUSED(RC_INVALID, rc_monitor_resume(monitor, lost, 2, 1, &verdict), "finite");
    CHECK_REFUSED(RC_INVALID, rc_monitor_resume_at(monitor, lost, NULL, 2, 0, 1, &verdict),
                  "finite");
    CHECK_STATUS(RC_INVALID, rc_monitor_resume(monitor, NULL, 0, 0, &verdict));
    CHECK_STATUS(RC_INVALID, rc_monitor_resume(monitor, NULL, 0, NAN, &verdict));
    CHECK_REFUSED(RC_INVALID, rc_monitor_resume_at(monitor, NULL, NULL, 2, 0, 1, &verdict), "x");
    CHECK_REFUSED(RC_INVALID, rc_monitor_resume_at(monitor, start, NULL, 2, 3, 1, &verdict),
                  "mode");
    cut.size = sizeof cut + 8;
    CHECK_STATUS(RC_WRONG_SIZE, rc_monitor_cut(monitor, &cut));
    CHECK_REFUSED(RC_INVALID, rc_monitor_cut(monitor, NULL), "rc_cut");
    cut = cut_of(monitor);
    host_restart(&host, cut.t, cut.after, 0);
    CHECK_STATUS(RC_OK, rc_monitor_resume(monitor, host.rate, 2, 0.1, &verdict));
    CHECK(verdict == RC_STANDS);
    CHECK_STATUS(RC_OUT_OF_TURN, rc_monitor_resume(monitor, host.rate, 2, 0.1, &verdict));

    event.size = sizeof event;
    CHECK_REFUSED(RC_INVALID, rc_monitor_event_at(monitor, 1, &event), "found 1");
    CHECK_REFUSED(RC_INVALID, rc_monitor_event_at(monitor, 0, NULL), "null");
    event.size = 3;
    CHECK_STATUS(RC_WRONG_SIZE, rc_monitor_event_at(monitor, 0, &event));
    statistics.size = 1;
    CHECK_STATUS(RC_WRONG_SIZE, rc_monitor_statistics(monitor, &statistics));
    CHECK_REFUSED(RC_INVALID, rc_monitor_save(monitor, NULL, NULL), "size");
    CHECK_REFUSED(RC_INVALID, rc_monitor_restore(monitor, NULL, 8), "null");
    CHECK_STATUS(RC_INVALID, rc_monitor_restore(monitor, "nonsense", 8));
    CHECK_REFUSED(RC_INVALID, rc_monitor_callback_failure(monitor, NULL), "null");
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
    CHECK(strcmp(rc_status_name(RC_OUT_OF_TURN), "RC_OUT_OF_TURN") == 0);
}

static void refuses_steps_beyond_a_time_event(void)
{
    rc_callbacks callbacks = ball_callbacks();
    rc_monitor* monitor;
    struct host host;
    rc_host_step step;
    rc_verdict verdict;
    callbacks.next_time_event = every_second;
    monitor = monitor_of(&callbacks, NULL);
    CHECK(host_start(&host, monitor, &callbacks, 0.5, start, 0.6) == RC_STANDS);
    CHECK(rc_monitor_must_stop_at(monitor) == 1);
    step = host_step(&host, 0.6);
    CHECK_REFUSED(RC_OUT_OF_TURN, rc_monitor_examine(monitor, &step, &verdict), "time event");
    step = host_step(&host, 0.5);
    CHECK_STATUS(RC_OK, rc_monitor_examine(monitor, &step, &verdict));
    CHECK(verdict == RC_CUT && cut_of(monitor).on_time && cut_of(monitor).t == 1);
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
}

/* Snapshots are of a system, and of a monitor. */
static void refuses_snapshots_of_something_else(void)
{
    rc_callbacks callbacks = ball_callbacks();
    const rc_options run = options_until(20.5);
    rc_monitor* monitor = monitor_of(&callbacks, NULL);
    rc_simulation* simulation = start_ball(&callbacks, &run);
    struct host host;
    static char bytes[1 << 14];
    size_t size = sizeof bytes;
    CHECK(host_start(&host, monitor, &callbacks, 0, start, 0.1) == RC_STANDS);
    CHECK_STATUS(RC_OK, rc_save(simulation, bytes, &size));
    CHECK_STATUS(RC_INVALID, rc_monitor_restore(monitor, bytes, size));
    size = sizeof bytes;
    CHECK_STATUS(RC_OK, rc_monitor_save(monitor, bytes, &size));
    CHECK_STATUS(RC_INVALID, rc_restore(simulation, bytes, size));
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
    callbacks.name = "another";
    monitor = monitor_of(&callbacks, NULL);
    CHECK_REFUSED(RC_INVALID, rc_monitor_restore(monitor, bytes, size), "another");
    CHECK(isnan(rc_monitor_time(monitor, NULL)));
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
    CHECK_STATUS(RC_OK, rc_simulation_free(simulation));
}

/* --- numbers that are none --- */

static int forgets(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                   double* g)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    if (x[0] > 9) *g = 1;
    return 0; /* further down nothing is written */
}
static int reset_to_nan(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    x[1] = NAN;
    return 0;
}

static void ends_at_numbers_that_are_none(void)
{
    rc_callbacks callbacks = ball_callbacks();
    rc_monitor* monitor;
    struct host host;
    struct met met = {0};
    rc_verdict verdict;
    callbacks.guard = forgets;
    monitor = monitor_of(&callbacks, NULL);
    CHECK(host_start(&host, monitor, &callbacks, 0, start, 0.1) == RC_STANDS);
    CHECK(host_run(&host, monitor, RC_STANDS, 2, 0.1, &met) == RC_ENDED);
    CHECK(rc_monitor_outcome(monitor) == RC_NON_FINITE && rc_monitor_guard(monitor) == 0);
    CHECK(rc_monitor_state(monitor)[0] > 9); /* of the last step that was good */
    CHECK_STATUS(RC_OUT_OF_TURN, rc_monitor_resume(monitor, NULL, 0, 0.1, &verdict));
    CHECK_STATUS(RC_OK, rc_monitor_start(monitor, 0, start, NULL, 2, 0, 0.1, &verdict));
    CHECK(verdict == RC_STANDS && rc_monitor_outcome(monitor) == RC_RUNNING);
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));

    callbacks = ball_callbacks();
    callbacks.reset = reset_to_nan;
    monitor = monitor_of(&callbacks, NULL);
    CHECK(host_start(&host, monitor, &callbacks, 0, start, 0.1) == RC_STANDS);
    CHECK(host_run(&host, monitor, RC_STANDS, 2, 0.1, &met) == RC_ENDED);
    CHECK(rc_monitor_outcome(monitor) == RC_NON_FINITE);
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
}

/* --- calls from its own callbacks --- */

static rc_monitor* inner;
static int goes_on_with_it(void* user, double s, double* x, size_t n)
{
    rc_verdict verdict = RC_STANDS;
    CHECK_REFUSED(RC_BUSY, rc_monitor_resume(inner, NULL, 0, 1, &verdict), "rc_monitor: found it");
    CHECK(verdict == RC_NO_VERDICT);
    CHECK_STATUS(RC_BUSY, rc_monitor_free(inner));
    CHECK(rc_monitor_state(inner) == NULL && isnan(rc_monitor_time(inner, NULL)));
    return host_restep(user, s, x, n);
}

static void refuses_calls_from_its_own_callbacks(void)
{
    const rc_callbacks callbacks = ball_callbacks();
    struct host host;
    rc_host_step step;
    rc_verdict verdict;
    inner = monitor_of(&callbacks, NULL);
    CHECK(host_start(&host, inner, &callbacks, 0, start, 2) == RC_STANDS);
    step = host_step(&host, 2);
    step.restep = goes_on_with_it;
    CHECK_STATUS(RC_OK, rc_monitor_examine(inner, &step, &verdict));
    CHECK(verdict == RC_CUT);
    CHECK_STATUS(RC_OK, rc_monitor_free(inner));
}

int main(void)
{
    refuses_monitors_that_are_none();
    refuses_handles_that_are_none();
    refuses_starts_that_are_none();
    refuses_steps_that_are_none();
    refuses_calls_out_of_turn();
    refuses_steps_beyond_a_time_event();
    refuses_snapshots_of_something_else();
    ends_at_numbers_that_are_none();
    refuses_calls_from_its_own_callbacks();
    return 0;
}
