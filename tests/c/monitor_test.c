/* The events of a host's own steps: what a monitor finds, records and keeps. */
#include "rk4_host.h"

static const double start[2] = {10, 0};

static int lie(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)mode, (void)t, (void)n;
    x[2 * which] = x[2 * which + 1] = 0;
    return 0;
}

static rc_monitor_options monitor_options(void)
{
    rc_monitor_options options;
    CHECK_STATUS(RC_OK, rc_monitor_options_default(&options, sizeof options));
    return options;
}

/* Impact n of a ball that falls from 10 m and keeps 0.9 of its velocity. */
static double impact_time(size_t n)
{
    const double first = sqrt(2 * 10 / 9.81);
    double flight = 2 * first;
    double t = first;
    while (n-- > 0) t += flight *= 0.9;
    return t;
}

static rc_statistics counts_of(rc_monitor* monitor)
{
    rc_statistics statistics;
    statistics.size = sizeof statistics;
    CHECK_STATUS(RC_OK, rc_monitor_statistics(monitor, &statistics));
    return statistics;
}

static void finds_the_impacts_of_a_ball(void)
{
    const rc_callbacks callbacks = ball_callbacks();
    rc_monitor* monitor = monitor_of(&callbacks, NULL);
    struct host host;
    struct met met = {0};
    rc_event event;
    rc_side side;
    double remainder = 7;
    size_t i;
    CHECK(isnan(rc_monitor_time(monitor, &remainder)) && rc_monitor_state(monitor) == NULL);
    CHECK(rc_monitor_mode(monitor) == UINT32_MAX && isnan(rc_monitor_must_stop_at(monitor)));
    CHECK(host_start(&host, monitor, &callbacks, 0, start, 0.1) == RC_STANDS);
    CHECK(rc_monitor_time(monitor, &remainder) == 0 && remainder == 0);
    CHECK(rc_monitor_state(monitor)[0] == 10 && rc_monitor_mode(monitor) == 0);
    CHECK(rc_monitor_must_stop_at(monitor) == INFINITY && rc_monitor_quiet_until(monitor) == 0);
    CHECK_STATUS(RC_OK, rc_monitor_side(monitor, 0, &side));
    CHECK(side == RC_ABOVE);
    CHECK(host_run(&host, monitor, RC_STANDS, 20.5, 0.1, &met) == RC_STANDS);
    CHECK(met.cuts == 13 && rc_monitor_event_count(monitor) == 13);
    event.size = sizeof event;
    for (i = 0; i < 13; ++i) {
        /* The method is exact on a parabola: what is left is the rounding of 200 steps, 1e-15 m of
         * the height in each at 5 m/s or more, and that of the host's sum of times. */
        CHECK(fabs(met.t[i] - impact_time(i)) < 1e-12);
        CHECK(met.fired[i] == 1 && met.first[i] == 0 && met.state_changed[i]);
        CHECK(met.after[i][0] == 0 && met.after[i][1] > 0 && !met.accumulation[i]);
        CHECK_STATUS(RC_OK, rc_monitor_event_at(monitor, i, &event));
        CHECK(event.t == met.t[i] && event.guard == 0 && event.kind == RC_CROSSING);
        CHECK(event.after[1] == met.after[i][1] && event.after[1] == -0.9 * event.before[1]);
    }
    CHECK(counts_of(monitor).events == 13 && counts_of(monitor).steps > 190);
    CHECK(rc_monitor_outcome(monitor) == RC_RUNNING && rc_monitor_guard(monitor) == RC_NO_GUARD);
    CHECK_STATUS(RC_OK, rc_monitor_clear_events(monitor));
    CHECK(rc_monitor_event_count(monitor) == 0 && counts_of(monitor).events == 13);
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
}

/* Two balls, side by side. */
static int fall_both(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    (void)n;
    return ball_flow(user, mode, t, x, dxdt, 2) + ball_flow(user, mode, t, x + 2, dxdt + 2, 2);
}
static int height_of(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                     double* g)
{
    return ball_guard(user, which, mode, t, x + 2 * which, n, g);
}
static int bounce_one(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    return ball_reset(user, which, mode, t, x + 2 * which, n);
}

static void finds_simultaneous_impacts_in_sets(void)
{
    const double both[4] = {10, 0, 10, 0};
    rc_callbacks callbacks = ball_callbacks();
    rc_monitor* monitor;
    struct host host;
    struct met met = {0};
    size_t i;
    callbacks.dimension = 4;
    callbacks.guard_count = 2;
    callbacks.flow = fall_both;
    callbacks.guard = height_of;
    callbacks.reset = bounce_one;
    monitor = monitor_of(&callbacks, NULL);
    CHECK(host_start(&host, monitor, &callbacks, 0, both, 0.1) == RC_STANDS);
    CHECK(host_run(&host, monitor, RC_STANDS, 20.5, 0.1, &met) == RC_STANDS);
    CHECK(met.cuts == 13 && rc_monitor_event_count(monitor) == 26);
    for (i = 0; i < 13; ++i) CHECK(met.fired[i] == 2 && met.first[i] == 0);
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
}

static int bounce_half(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    x[0] = 0;
    x[1] *= -0.5;
    return 0;
}
static int at_ten(void* user, double t, double* next)
{
    (void)user;
    *next = t < 10 ? 10 : INFINITY;
    return 0;
}
static int strike(void* user, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)mode, (void)t, (void)n;
    x[1] = 3;
    return 0;
}

static void comes_to_rest_and_is_held_until_a_time_event(void)
{
    /* The series of flights ends at t0 (1 + e) / (1 - e). */
    const double limit = sqrt(2 * 10 / 9.81) * 1.5 / 0.5;
    rc_callbacks callbacks = ball_callbacks();
    rc_monitor* monitor;
    struct host host;
    struct met met = {0};
    rc_verdict verdict;
    size_t last;
    callbacks.reset = bounce_half;
    monitor = monitor_of(&callbacks, NULL);
    CHECK(host_start(&host, monitor, &callbacks, 0, start, 0.1) == RC_STANDS);
    CHECK(host_run(&host, monitor, RC_STANDS, 20, 0.1, &met) == RC_ENDED);
    CHECK(rc_monitor_outcome(monitor) == RC_ZENO && rc_monitor_guard(monitor) == 0);
    CHECK(fabs(rc_monitor_time(monitor, NULL) - limit) < 1e-6);
    CHECK_STATUS(RC_OUT_OF_TURN, rc_monitor_hold(monitor, 20, &verdict));
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));

    callbacks.rest = lie;
    callbacks.next_time_event = at_ten;
    callbacks.time_reset = strike;
    monitor = monitor_of(&callbacks, NULL);
    memset(&met, 0, sizeof met);
    verdict = host_start(&host, monitor, &callbacks, 0, start, 0.1);
    CHECK(rc_monitor_must_stop_at(monitor) == 10);
    verdict = host_run(&host, monitor, verdict, 9, 0.1, &met);
    CHECK(verdict == RC_RESTS && met.accumulation[met.cuts - 1] && met.cuts < 60);
    CHECK(fabs(met.t[met.cuts - 1] - limit) < 1e-12);
    CHECK(met.after[met.cuts - 1][0] == 0 && met.after[met.cuts - 1][1] == 0);
    CHECK_STATUS(RC_OK, rc_monitor_hold(monitor, 9, &verdict));
    CHECK(verdict == RC_RESTS && rc_monitor_time(monitor, NULL) == 9);
    memset(&met, 0, sizeof met);
    verdict = host_run(&host, monitor, verdict, 12, 0.1, &met);
    CHECK(verdict == RC_RESTS); /* once more */
    CHECK(met.t[0] == 10 && met.on_time[0] && met.fired[0] == 0 && met.after[0][1] == 3);
    last = met.cuts - 1;
    /* Thrown up by 3 m/s it comes down after 2 v / g, and rests after as long again. */
    CHECK(met.accumulation[last] && fabs(met.t[last] - (10 + 4 * 3 / 9.81)) < 1e-12);
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
}

/* --- a rest that holds a part of a state that moves --- */

/* x, y and their rates; x is the time, and y is lifted from 1 s on. */
static int slide(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    rc_monitor** const monitor = user;
    size_t count = 0, i;
    const size_t* held;
    (void)mode, (void)t, (void)n;
    dxdt[0] = x[2];
    dxdt[1] = x[3];
    dxdt[2] = 0;
    dxdt[3] = -10 + (x[0] > 1 ? 10 * (x[0] - 1) : 0);
    /* As a host computes it. The monitor calls it, too, to see what lifts the ball: it asks with
     * the bare flow, since no monitor is set then. */
    if (!*monitor) return 0;
    held = rc_monitor_held(*monitor, &count);
    for (i = 0; i < count; ++i) dxdt[held[i]] = 0;
    return 0;
}
static int over_floor(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                      double* g)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    *g = x[1];
    return 0;
}
static int bounce_off(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    x[1] = 0;
    x[3] *= -0.5;
    return 0;
}
static int lie_there(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    x[1] = x[3] = 0;
    return 0;
}

static void keeps_what_a_rest_holds_while_the_rest_moves(void)
{
    static const double thrown[4] = {0, 0.1, 1, 0};
    rc_monitor *none = NULL, *monitor;
    rc_callbacks callbacks, of_host;
    struct host host;
    struct met met = {0};
    size_t count = 7;
    rc_event event;
    memset(&callbacks, 0, sizeof callbacks);
    callbacks.size = sizeof callbacks;
    callbacks.dimension = 4;
    callbacks.guard_count = 1;
    callbacks.user = &none;
    callbacks.flow = slide;
    callbacks.guard = over_floor;
    callbacks.reset = bounce_off;
    callbacks.rest = lie_there;
    monitor = monitor_of(&callbacks, NULL);
    of_host = callbacks;
    of_host.user = &monitor;
    CHECK(rc_monitor_held(monitor, &count) == NULL && count == 0);
    CHECK(host_start(&host, monitor, &of_host, 0, thrown, 0.1) == RC_STANDS);
    CHECK(host_run(&host, monitor, RC_STANDS, 1.5, 0.1, &met) == RC_STANDS);
    /* The flights end at sqrt(2 0.1 / 10) (1 + e) / (1 - e), with e = 0.5. */
    CHECK(met.accumulation[met.cuts - 1] && fabs(met.t[met.cuts - 1] - 3 * sqrt(0.02)) < 1e-12);
    CHECK(rc_monitor_held(monitor, &count)[0] == 1 && rc_monitor_held(monitor, NULL)[1] == 3);
    CHECK(count == 2 && host.x[1] == 0 && fabs(host.x[0] - 1.5) < 1e-12);
    /* It hangs free at 2 s; then y = 5/3 (t - 2)^3, which steps of rk4 follow exactly. */
    CHECK(host_run(&host, monitor, RC_STANDS, 3, 0.1, &met) == RC_STANDS);
    CHECK(met.fired[met.cuts - 1] == 0 && fabs(met.t[met.cuts - 1] - 2) < 1e-12);
    CHECK(rc_monitor_held(monitor, &count) == NULL && count == 0);
    CHECK(fabs(host.x[0] - 3) < 1e-12 && fabs(host.x[1] - 5.0 / 3) < 1e-11);
    event.size = sizeof event;
    CHECK_STATUS(RC_OK, rc_monitor_event_at(monitor, rc_monitor_event_count(monitor) - 1, &event));
    CHECK(event.kind == RC_MODE && event.guard == 0);
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
}

/* --- a cart (x, v) that stands at 0, and a clock that pushes it outward once a second --- */

static int cart_flow(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    (void)user, (void)mode, (void)t, (void)n;
    dxdt[0] = x[1];
    dxdt[1] = 0;
    dxdt[2] = 1;
    return 0;
}
static int place_and_clock(void* user, size_t which, rc_mode mode, double t, const double* x,
                           size_t n, double* g)
{
    (void)user, (void)mode, (void)t, (void)n;
    *g = which == 0 ? x[0] : 1 - x[2];
    return 0;
}
static int stop_or_push(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)mode, (void)t, (void)n;
    x[1] = which == 0 ? 0 : -1;
    if (which == 1) x[2] = 0;
    return 0;
}

static void gives_a_standing_guard_its_event_where_another_moves_it(void)
{
    const double start[3] = {0, 0, 0};
    rc_callbacks callbacks;
    rc_monitor* monitor;
    struct host host;
    struct met met = {0};
    memset(&callbacks, 0, sizeof callbacks);
    callbacks.size = sizeof callbacks;
    callbacks.dimension = 3;
    callbacks.guard_count = 2;
    callbacks.flow = cart_flow;
    callbacks.guard = place_and_clock;
    callbacks.reset = stop_or_push;
    monitor = monitor_of(&callbacks, NULL);
    CHECK(host_start(&host, monitor, &callbacks, 0, start, 0.1) == RC_STANDS);
    CHECK(host_run(&host, monitor, RC_STANDS, 3.5, 0.1, &met) == RC_STANDS);
    CHECK(host.x[0] == 0 && host.x[1] == 0);
    CHECK(met.cuts >= 3 && fabs(met.t[met.cuts - 1] - 3) < 1e-13);
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
}

/* --- modes, recorded events, hosts with resets of their own --- */

static int heat(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    (void)user, (void)t, (void)n;
    dxdt[0] = (mode ? 30 : 10) - x[0];
    return 0;
}
static int limits(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                  double* g)
{
    (void)user, (void)mode, (void)t, (void)n;
    *g = which == 0 ? x[0] - 19 : 21 - x[0];
    return 0;
}
static int toggle(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)t, (void)x, (void)n;
    *mode = which == 0;
    return 0;
}

static void switches_between_modes(void)
{
    const double room = 20;
    rc_callbacks callbacks;
    rc_monitor* monitor;
    struct host host;
    struct met met = {0};
    size_t i;
    memset(&callbacks, 0, sizeof callbacks);
    callbacks.size = sizeof callbacks;
    callbacks.dimension = 1;
    callbacks.guard_count = 2;
    callbacks.mode_count = 2;
    callbacks.flow = heat;
    callbacks.guard = limits;
    callbacks.reset = toggle;
    monitor = monitor_of(&callbacks, NULL);
    CHECK(host_start(&host, monitor, &callbacks, 0, &room, 0.01) == RC_STANDS);
    CHECK(host_run(&host, monitor, RC_STANDS, 1, 0.01, &met) == RC_STANDS);
    CHECK(met.cuts > 3 && fabs(met.t[0] - log(10. / 9)) < 1e-9);
    for (i = 0; i < met.cuts; ++i) {
        CHECK(met.mode[i] == (i + 1) % 2 && !met.state_changed[i] && met.first[i] == i % 2);
    }
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
}

static void lets_a_host_make_the_state_itself(void)
{
    rc_callbacks callbacks = ball_callbacks();
    rc_monitor_options options = monitor_options();
    rc_guard_info info;
    rc_monitor* monitor;
    struct host host;
    rc_host_step step;
    rc_verdict verdict;
    const double after[2] = {0, 4};
    memset(&info, 0, sizeof info);
    info.size = sizeof info;
    info.notifies = 1;
    callbacks.guard_infos = &info;
    monitor = monitor_of(&callbacks, NULL);
    CHECK(host_start(&host, monitor, &callbacks, 0, start, 2) == RC_STANDS);
    step = host_step(&host, 2);
    CHECK_STATUS(RC_OK, rc_monitor_examine(monitor, &step, &verdict));
    CHECK(verdict == RC_STANDS && rc_monitor_event_count(monitor) == 1); /* only recorded */
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));

    options.cut_at_all = 1;
    options.record_events = 0;
    monitor = monitor_of(&callbacks, &options);
    CHECK(host_start(&host, monitor, &callbacks, 0, start, 2) == RC_STANDS);
    step = host_step(&host, 2);
    CHECK_STATUS(RC_OK, rc_monitor_examine(monitor, &step, &verdict));
    CHECK(verdict == RC_CUT && !cut_of(monitor).state_changed);
    CHECK(rc_monitor_event_count(monitor) == 0 && counts_of(monitor).events == 1);
    host_restart(&host, cut_of(monitor).t, after, 0);
    CHECK_STATUS(RC_OK, rc_monitor_resume_at(monitor, after, host.rate, 2, 0, 0.1, &verdict));
    CHECK(verdict == RC_STANDS && rc_monitor_state(monitor)[1] == 4);
    step = host_step(&host, 0.1);
    CHECK_STATUS(RC_OK, rc_monitor_examine(monitor, &step, &verdict));
    CHECK(verdict == RC_STANDS);
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
}

static size_t flows_asked;
static int counted_flow(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    ++flows_asked;
    return ball_flow(user, mode, t, x, dxdt, n);
}

static void asks_the_flow_where_a_host_gives_no_rate(void)
{
    rc_callbacks callbacks = ball_callbacks();
    rc_monitor* given;
    rc_monitor* asking;
    struct host host;
    rc_host_step step;
    rc_verdict verdict;
    callbacks.flow = counted_flow;
    given = monitor_of(&callbacks, NULL);
    asking = monitor_of(&callbacks, NULL);
    CHECK(host_start(&host, given, &callbacks, 0, start, 2) == RC_STANDS);
    flows_asked = 0;
    CHECK_STATUS(RC_OK, rc_monitor_start(asking, 0, start, NULL, 2, 0, 2, &verdict));
    CHECK(flows_asked == 1);
    step = host_step(&host, 2);
    CHECK_STATUS(RC_OK, rc_monitor_examine(given, &step, &verdict));
    CHECK_STATUS(RC_OK, rc_monitor_examine(asking, &step, &verdict));
    CHECK(verdict == RC_CUT && cut_of(given).t == cut_of(asking).t);
    flows_asked = 0;
    CHECK_STATUS(RC_OK, rc_monitor_resume(asking, NULL, 0, 0.1, &verdict));
    CHECK(verdict == RC_STANDS && flows_asked == 1);
    CHECK_STATUS(RC_OK, rc_monitor_free(given));
    CHECK_STATUS(RC_OK, rc_monitor_free(asking));
}

/* --- backward in time --- */

static int square(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    (void)user, (void)mode, (void)x, (void)n;
    dxdt[0] = 2 * t;
    return 0;
}
static int square_at(void* t0, double s, double* x, size_t n)
{
    const double t = *(const double*)t0 - s;
    (void)n;
    x[0] = t * t - 1;
    return s > 0.125 && t < -1.8 ? 23 : 0;
}

static void follows_a_host_that_runs_backward(void)
{
    /* x = t^2 - 1, from t = 2 down: above its surface until t = 1, and again from t = -1 on. */
    rc_callbacks callbacks = ball_callbacks();
    rc_monitor_options options = monitor_options();
    rc_monitor* monitor;
    rc_verdict verdict;
    rc_event event;
    rc_callback_error error;
    double t, x0 = 3, rate0 = -4, x1, rate1;
    rc_host_step step;
    callbacks.dimension = 1;
    callbacks.flow = square;
    callbacks.reset = NULL;
    options.backward = 1;
    monitor = monitor_of(&callbacks, &options);
    memset(&step, 0, sizeof step);
    step.size = sizeof step;
    step.n = 1;
    step.h = 0.25;
    step.x0 = &x0, step.x1 = &x1, step.rate0 = &rate0, step.rate1 = &rate1;
    step.user = &t;
    step.interpolate = square_at;
    CHECK_STATUS(RC_OK, rc_monitor_start(monitor, 2, &x0, &rate0, 1, 0, 0.25, &verdict));
    for (t = 2; t > -1.75; t -= 0.25, x0 = x1, rate0 = rate1) {
        const double end = t - 0.25;
        step.t0 = t;
        x1 = end * end - 1;
        rate1 = -2 * end;
        CHECK_STATUS(RC_OK, rc_monitor_examine(monitor, &step, &verdict));
        CHECK(verdict == RC_STANDS);
    }
    event.size = sizeof event;
    CHECK(rc_monitor_event_count(monitor) == 1);
    CHECK_STATUS(RC_OK, rc_monitor_event_at(monitor, 0, &event));
    CHECK(fabs(event.t - 1) < 1e-14 && rc_monitor_time(monitor, NULL) == -1.75);
    /* The time of a failure is the host's. The step crosses, so that it is looked into. */
    step.t0 = t;
    x1 = -1;
    CHECK_STATUS(RC_CALLBACK, rc_monitor_examine(monitor, &step, &verdict));
    error.size = sizeof error;
    CHECK_STATUS(RC_OK, rc_monitor_callback_failure(monitor, &error));
    CHECK(error.code == 23 && error.t < -1.8 && error.t >= -2);
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
}

/* --- guards that need no look --- */

static size_t heights_asked;
static int height_asked(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                        double* g)
{
    ++heights_asked;
    return ball_guard(user, which, mode, t, x, n, g);
}
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

static void spares_guards_by_bounds(void)
{
    rc_callbacks callbacks = ball_callbacks();
    rc_monitor_options options = monitor_options();
    rc_monitor* monitor;
    struct host host;
    struct met watched, spared;
    size_t asked;
    rc_verdict verdict;
    size_t skipped = 0;
    callbacks.guard = height_asked;
    callbacks.speed_bound = fall_speed;
    callbacks.acceleration_bound = weight;
    memset(&watched, 0, sizeof watched);
    memset(&spared, 0, sizeof spared);
    monitor = monitor_of(&callbacks, &options);
    heights_asked = 0;
    verdict = host_start(&host, monitor, &callbacks, 0, start, 0.001);
    CHECK(host_run(&host, monitor, verdict, 20.5, 0.001, &watched) == RC_STANDS);
    asked = heights_asked;
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));

    options.detector = RC_PLANNED;
    monitor = monitor_of(&callbacks, &options);
    heights_asked = 0;
    verdict = host_start(&host, monitor, &callbacks, 0, start, 0.001);
    CHECK(host_run(&host, monitor, verdict, 20.5, 0.001, &spared) == RC_STANDS);
    CHECK(spared.cuts == 13 && memcmp(&spared, &watched, sizeof spared) == 0);
    CHECK(heights_asked < asked / 10);

    /* Steps that need no look need not be shown. */
    verdict = host_start(&host, monitor, &callbacks, 0, start, 0.001);
    while (verdict == RC_STANDS && host.t < 1.5) {
        const rc_host_step step = host_step(&host, 0.001);
        if (host.t + 0.001 <= rc_monitor_quiet_until(monitor)) {
            host_accept(&host);
            CHECK_STATUS(RC_OK, rc_monitor_skip_to(monitor, host.t, host.x, host.rate, 2));
            ++skipped;
        } else {
            CHECK_STATUS(RC_OK, rc_monitor_examine(monitor, &step, &verdict));
            if (verdict == RC_STANDS) host_accept(&host);
        }
    }
    CHECK(verdict == RC_CUT && fabs(cut_of(monitor).t - impact_time(0)) < 1e-11 && skipped > 1000);
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
}

/* --- saving --- */

static void goes_on_from_what_was_saved(void)
{
    const rc_callbacks callbacks = ball_callbacks();
    rc_monitor* monitor = monitor_of(&callbacks, NULL);
    rc_monitor* other = monitor_of(&callbacks, NULL);
    struct host host, twin;
    struct met whole, before, after;
    static char bytes[1 << 14];
    size_t size = 0;
    memset(&whole, 0, sizeof whole);
    memset(&before, 0, sizeof before);
    memset(&after, 0, sizeof after);
    CHECK(host_start(&host, monitor, &callbacks, 0, start, 0.1) == RC_STANDS);
    CHECK(host_run(&host, monitor, RC_STANDS, 10, 0.1, &before) == RC_STANDS);
    CHECK_STATUS(RC_OK, rc_monitor_save(monitor, NULL, &size));
    --size;
    CHECK_REFUSED(RC_INVALID, rc_monitor_save(monitor, bytes, &size), "room");
    CHECK(size < sizeof bytes);
    CHECK_STATUS(RC_OK, rc_monitor_save(monitor, bytes, &size));
    twin = host;
    CHECK(host_run(&host, monitor, RC_STANDS, 20.5, 0.1, &whole) == RC_STANDS);
    CHECK_STATUS(RC_OK, rc_monitor_restore(other, bytes, size));
    CHECK(rc_monitor_time(other, NULL) == twin.t && rc_monitor_state(other)[1] == twin.x[1]);
    CHECK(host_run(&twin, other, RC_STANDS, 20.5, 0.1, &after) == RC_STANDS);
    CHECK(before.cuts + after.cuts == 13 && memcmp(&after, &whole, sizeof after) == 0);
    CHECK(memcmp(twin.x, host.x, sizeof host.x) == 0);
    CHECK(rc_monitor_event_count(other) == after.cuts); /* what was recorded is no part of it */
    bytes[size / 2] ^= 1;
    CHECK_STATUS(RC_INVALID, rc_monitor_restore(other, bytes, size));
    CHECK(rc_monitor_time(other, NULL) == 20.5);
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
    CHECK_STATUS(RC_OK, rc_monitor_free(other));
}

/* --- callbacks that fail --- */

/* A ball whose call number `fails_at` of all of its callbacks fails. */
struct failing {
    struct host host;
    size_t calls, fails_at;
};

static int visit(struct failing* world)
{
    return ++world->calls == world->fails_at ? 42 : 0;
}
static int failing_flow(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    return ball_flow(NULL, mode, t, x, dxdt, n) + visit(user);
}
static int failing_guard(void* user, size_t which, rc_mode mode, double t, const double* x,
                         size_t n, double* g)
{
    return ball_guard(NULL, which, mode, t, x, n, g) + visit(user);
}
static int failing_reset(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    return bounce_half(NULL, which, mode, t, x, n) + visit(user);
}
static int failing_rest(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    return lie(NULL, which, mode, t, x, n) + visit(user);
}
static int failing_time(void* user, double t, double* next)
{
    *next = t < 2 ? 2 : INFINITY;
    return visit(user);
}
static int failing_strike(void* user, rc_mode* mode, double t, double* x, size_t n)
{
    (void)mode, (void)t, (void)n;
    x[1] += 0.5;
    return visit(user);
}
static int failing_restep(void* user, double s, double* x, size_t n)
{
    struct failing* world = user;
    return host_restep(&world->host, s, x, n) + visit(world);
}
static int failing_path(void* user, double s, double* x, size_t n)
{
    struct failing* world = user;
    size_t i;
    for (i = 0; i < n; ++i) {
        x[i] = world->host.x[i] + s * world->host.rate[i] - (i == 0 ? 9.81 / 2 * s * s : 0);
    }
    return visit(world);
}
static int failing_path_rate(void* user, double s, double* dxdt, size_t n)
{
    const struct failing* world = user;
    (void)n;
    dxdt[0] = world->host.x[1] - 9.81 * s;
    dxdt[1] = -9.81;
    return visit(user);
}

enum { most_bytes = 1 << 13 };

/* All that a host needs to go back. */
struct place {
    struct host host;
    size_t cuts, size;
    char bytes[most_bytes];
};

static void keep(struct place* place, const struct failing* world, rc_monitor* monitor, size_t cuts)
{
    place->host = world->host;
    place->cuts = cuts;
    place->size = sizeof place->bytes;
    CHECK_STATUS(RC_OK, rc_monitor_save(monitor, place->bytes, &place->size));
}

/* After a failure the host goes back to the last step that stood, and on from there. */
static void run_failing(const rc_callbacks* callbacks, struct failing* world, struct met* met,
                        size_t* failures)
{
    static const rc_callbacks plain_fall = {
        .size = sizeof plain_fall, .dimension = 2, .flow = ball_flow};
    static struct place place;
    rc_monitor* monitor = monitor_of(callbacks, NULL);
    rc_verdict verdict;
    rc_status status;
    memset(met, 0, sizeof *met);
    memset(&world->host, 0, sizeof world->host);
    world->host.system = &plain_fall;
    host_restart(&world->host, 0, start, 0);
    do {
        status = rc_monitor_start(monitor, 0, start, NULL, 2, 0, 0.1, &verdict);
        *failures += status == RC_CALLBACK;
    } while (status == RC_CALLBACK);
    CHECK_STATUS(RC_OK, status);
    keep(&place, world, monitor, 0);
    while (verdict != RC_RESTS) {
        if (verdict == RC_CUT) {
            const rc_cut cut = cut_of(monitor);
            met->t[met->cuts] = cut.t;
            met->accumulation[met->cuts] = cut.accumulation;
            memcpy(met->after[met->cuts++], cut.after, 2 * sizeof(double));
            host_restart(&world->host, cut.t, cut.after, 0);
            status = rc_monitor_resume(monitor, NULL, 0, 0.1, &verdict);
        } else {
            const double ahead = rc_monitor_must_stop_at(monitor) - world->host.t;
            rc_host_step step = host_step(&world->host, fmin(0.1, ahead));
            step.user = world;
            step.restep = failing_restep;
            step.interpolate = failing_path;
            step.interpolate_rate = failing_path_rate;
            status = rc_monitor_examine(monitor, &step, &verdict);
            if (status == RC_OK && verdict == RC_STANDS) host_accept(&world->host);
        }
        if (status == RC_CALLBACK) {
            rc_callback_error error;
            rc_verdict ignored;
            const size_t saved = place.size;
            ++*failures;
            error.size = sizeof error;
            CHECK(verdict == RC_NO_VERDICT);
            CHECK(rc_monitor_outcome(monitor) == RC_STOPPED_BY_CALLBACK);
            CHECK_STATUS(RC_OK, rc_monitor_callback_failure(monitor, &error));
            CHECK(error.code == 42 && error.callback != NULL && strstr(rc_last_error(), "42"));
            /* It waits for a start, or for what was saved. */
            CHECK_STATUS(RC_OUT_OF_TURN, rc_monitor_resume(monitor, NULL, 0, 0.1, &ignored));
            CHECK_STATUS(RC_OUT_OF_TURN, rc_monitor_save(monitor, NULL, &place.size));
            CHECK_STATUS(RC_OK, rc_monitor_restore(monitor, place.bytes, saved));
            place.size = saved;
            CHECK(rc_monitor_outcome(monitor) == RC_RUNNING);
            world->host = place.host;
            met->cuts = place.cuts;
            verdict = RC_STANDS;
        } else {
            CHECK_STATUS(RC_OK, status);
            if (verdict == RC_STANDS) keep(&place, world, monitor, met->cuts);
        }
    }
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
}

static void goes_back_to_a_snapshot_after_any_failure(void)
{
    struct failing world;
    struct met expected, found;
    rc_callbacks callbacks = ball_callbacks();
    size_t failures = 0;
    size_t calls, k;
    callbacks.user = &world;
    callbacks.flow = failing_flow;
    callbacks.guard = failing_guard;
    callbacks.reset = failing_reset;
    callbacks.rest = failing_rest;
    callbacks.next_time_event = failing_time;
    callbacks.time_reset = failing_strike;
    world.calls = world.fails_at = 0;
    run_failing(&callbacks, &world, &expected, &failures);
    CHECK(failures == 0 && expected.cuts > 20 && expected.accumulation[expected.cuts - 1]);
    calls = world.calls;
    for (k = 1; k <= calls; ++k) {
        failures = world.calls = 0;
        world.fails_at = k;
        run_failing(&callbacks, &world, &found, &failures);
        CHECK(failures == 1);
        CHECK(found.cuts == expected.cuts);
        CHECK(memcmp(found.t, expected.t, found.cuts * sizeof found.t[0]) == 0);
        CHECK(memcmp(found.after, expected.after, found.cuts * sizeof found.after[0]) == 0);
    }
    printf("any of %lu calls may fail; %lu sets of events\n", (unsigned long)calls,
           (unsigned long)expected.cuts);
}

/* --- older programs --- */

static void takes_structs_of_fewer_fields(void)
{
    const rc_callbacks callbacks = ball_callbacks();
    rc_monitor_options options;
    rc_monitor* monitor;
    struct host host;
    rc_host_step step;
    rc_verdict verdict;
    rc_cut cut;
    memset(&options, 0xff, sizeof options);
    CHECK_STATUS(RC_OK,
                 rc_monitor_options_default(&options, offsetof(rc_monitor_options, event_window)));
    CHECK(options.event_tolerance == 0 && isnan(options.event_window)); /* not written to */
    monitor = monitor_of(&callbacks, &options);
    CHECK(host_start(&host, monitor, &callbacks, 0, start, 2) == RC_STANDS);
    step = host_step(&host, 2);
    step.size = offsetof(rc_host_step, interpolate); /* what follows is not read */
    host.restep_error = 1;
    CHECK_STATUS(RC_OK, rc_monitor_examine(monitor, &step, &verdict));
    CHECK(verdict == RC_CUT);
    memset(&cut, 0xff, sizeof cut);
    cut.size = offsetof(rc_cut, before);
    CHECK_STATUS(RC_OK, rc_monitor_cut(monitor, &cut));
    CHECK(fabs(cut.t - impact_time(0)) < 1e-14 && cut.fired_count == SIZE_MAX);
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
}

/* The speed of a ball as its bound, and a bound that it exceeds. */
static int false_speed_bound(void* user, size_t which, rc_mode mode, double t, const double* x,
                             size_t n, double* bound)
{
    (void)which, (void)mode, (void)t, (void)x, (void)n;
    *bound = *(const int*)user ? 5 : 100;
    return 0;
}

static void starts_again_after_a_wrong_bound(void)
{
    rc_callbacks callbacks = ball_callbacks();
    rc_monitor_options options = monitor_options();
    rc_monitor* monitor;
    struct host host;
    struct met met = {0};
    int lies = 1;
    callbacks.user = &lies;
    callbacks.speed_bound = false_speed_bound;
    options.detector = RC_PLANNED;
    monitor = monitor_of(&callbacks, &options);
    CHECK(host_start(&host, monitor, &callbacks, 0, start, 0.1) == RC_STANDS);
    CHECK(host_run(&host, monitor, RC_STANDS, 20.5, 0.1, &met) == RC_ENDED);
    CHECK(rc_monitor_outcome(monitor) == RC_WRONG_BOUND && met.cuts == 0);
    lies = 0;
    CHECK(host_start(&host, monitor, &callbacks, 0, start, 0.1) == RC_STANDS);
    CHECK(host_run(&host, monitor, RC_STANDS, 20.5, 0.1, &met) == RC_STANDS);
    CHECK(met.cuts == 13 && rc_monitor_outcome(monitor) == RC_RUNNING);
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
}

struct tally {
    uint64_t flows, resteps;
};

static int tallied_flow(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    ++((struct tally*)user)->flows;
    return ball_flow(user, mode, t, x, dxdt, n);
}

static int tallied_restep(void* user, double s, double* x, size_t n)
{
    const double fall[2] = {10, 0};
    ++((struct tally*)user)->resteps;
    (void)n;
    x[0] = fall[0] - 9.81 / 2 * s * s;
    x[1] = fall[1] - 9.81 * s;
    return 0;
}

static int moving_guard(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                        double* g)
{
    (void)user, (void)which, (void)mode, (void)n;
    *g = x[0] - 0.1 * t * t * t;
    return 0;
}

static int only_while_high(void* user, size_t which, rc_mode mode, double t, const double* x,
                           size_t n, int* yes)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    *yes = x[0] > 5;
    return 0;
}

static void counts_flows_resteps_and_disabled_crossings(void)
{
    const double from[2] = {10, 0}, rate0[2] = {0, -9.81}, rate1[2] = {-9.81 * 2, -9.81};
    const double to[2] = {10 - 9.81 * 2, -9.81 * 2};
    rc_callbacks callbacks = ball_callbacks();
    int k;
    for (k = 0; k < 3; ++k) { /* with a map of the host's own, without one, and disabled */
        struct tally tally = {0, 0};
        rc_host_step step;
        rc_monitor* monitor;
        rc_verdict verdict;
        callbacks.user = &tally;
        callbacks.flow = tallied_flow;
        callbacks.guard = moving_guard;
        callbacks.enabled = k == 2 ? only_while_high : NULL;
        monitor = monitor_of(&callbacks, NULL);
        CHECK_STATUS(RC_OK, rc_monitor_start(monitor, 0, from, NULL, 2, 0, 2, &verdict));
        memset(&step, 0, sizeof step);
        step.size = sizeof step;
        step.n = 2;
        step.h = 2;
        step.x0 = from, step.x1 = to, step.rate0 = rate0, step.rate1 = rate1;
        step.user = &tally;
        step.restep = k == 0 ? tallied_restep : NULL;
        CHECK_STATUS(RC_OK, rc_monitor_examine(monitor, &step, &verdict));
        CHECK(verdict == (k == 2 ? RC_STANDS : RC_CUT));
        CHECK(tally.flows > 0 && counts_of(monitor).flow_calls == tally.flows);
        CHECK((tally.resteps > 0) == (k == 0));
        CHECK(counts_of(monitor).resteps == tally.resteps);
        CHECK(counts_of(monitor).disabled == (k == 2));
        CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
    }
}

static int flow_that_may_fail(void* user, rc_mode mode, double t, const double* x, double* dxdt,
                              size_t n)
{
    return *(const int*)user ? 42 : ball_flow(user, mode, t, x, dxdt, n);
}

static void waits_for_a_start_after_one_has_failed(void)
{
    const double below[2] = {-3, 1}, end[2] = {-2.9, 1}, rate[2] = {1, 0};
    rc_callbacks callbacks = ball_callbacks();
    rc_monitor* monitor;
    rc_host_step step;
    rc_verdict verdict;
    int fails = 0;
    callbacks.user = &fails;
    callbacks.flow = flow_that_may_fail;
    monitor = monitor_of(&callbacks, NULL);
    CHECK_STATUS(RC_OK, rc_monitor_start(monitor, 0, start, NULL, 2, 0, 0.1, &verdict));
    fails = 1;
    CHECK_STATUS(RC_CALLBACK, rc_monitor_start(monitor, 5, below, NULL, 2, 0, 0.1, &verdict));
    CHECK(rc_monitor_outcome(monitor) == RC_STOPPED_BY_CALLBACK);
    memset(&step, 0, sizeof step);
    step.size = sizeof step;
    step.n = 2;
    step.t0 = 5;
    step.h = 0.1;
    step.x0 = below, step.x1 = end, step.rate0 = rate, step.rate1 = rate;
    /* Its guard is still armed above the floor, where the first start was. */
    CHECK_STATUS(RC_OUT_OF_TURN, rc_monitor_examine(monitor, &step, &verdict));
    CHECK_STATUS(RC_OK, rc_monitor_start(monitor, 5, below, rate, 2, 0, 0.1, &verdict));
    CHECK_STATUS(RC_OK, rc_monitor_examine(monitor, &step, &verdict));
    CHECK(verdict == RC_STANDS && rc_monitor_event_count(monitor) == 0);
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
}

static int still_flow(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    size_t i;
    (void)user, (void)mode, (void)t, (void)x;
    for (i = 0; i < n; ++i) dxdt[i] = 0;
    return 0;
}

/* A monitor of a system of another dimension, or of a host that runs the other way, has no use for
 * a snapshot, although neither system has a name. */
static void refuses_the_snapshot_of_another_dimension_or_direction(void)
{
    static const double five[5] = {1, 2, 3, 4, 5};
    static char bytes[1 << 12];
    size_t size = sizeof bytes, dimension;
    rc_callbacks callbacks = ball_callbacks();
    rc_verdict verdict;
    rc_monitor* monitor;
    callbacks.flow = still_flow;
    callbacks.dimension = 5;
    monitor = monitor_of(&callbacks, NULL);
    CHECK_STATUS(RC_OK, rc_monitor_start(monitor, 0, five, NULL, 5, 0, 0.1, &verdict));
    CHECK_STATUS(RC_OK, rc_monitor_save(monitor, bytes, &size));
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
    for (dimension = 4; dimension <= 6; ++dimension) {
        rc_monitor_options options = monitor_options();
        callbacks.dimension = dimension;
        options.backward = dimension == 5;
        monitor = monitor_of(&callbacks, &options);
        CHECK_STATUS(RC_INVALID, rc_monitor_restore(monitor, bytes, size));
        CHECK(strstr(rc_last_error(), dimension == 5 ? "direction" : "components") != NULL);
        CHECK(rc_monitor_state(monitor) == NULL);
        CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
    }
}

static void goes_on_from_a_snapshot_of_a_name_of_two_lines(void)
{
    static char bytes[1 << 12];
    size_t size = sizeof bytes;
    rc_callbacks callbacks = ball_callbacks();
    rc_verdict verdict;
    rc_monitor* monitor;
    callbacks.name = "a ball\nand its floor";
    monitor = monitor_of(&callbacks, NULL);
    CHECK_STATUS(RC_OK, rc_monitor_start(monitor, 0, start, NULL, 2, 0, 0.1, &verdict));
    CHECK_STATUS(RC_OK, rc_monitor_save(monitor, bytes, &size));
    CHECK_STATUS(RC_OK, rc_monitor_restore(monitor, bytes, size));
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
}

int main(void)
{
    goes_on_from_a_snapshot_of_a_name_of_two_lines();
    refuses_the_snapshot_of_another_dimension_or_direction();
    waits_for_a_start_after_one_has_failed();
    starts_again_after_a_wrong_bound();
    counts_flows_resteps_and_disabled_crossings();
    finds_the_impacts_of_a_ball();
    finds_simultaneous_impacts_in_sets();
    comes_to_rest_and_is_held_until_a_time_event();
    keeps_what_a_rest_holds_while_the_rest_moves();
    gives_a_standing_guard_its_event_where_another_moves_it();
    switches_between_modes();
    lets_a_host_make_the_state_itself();
    asks_the_flow_where_a_host_gives_no_rate();
    follows_a_host_that_runs_backward();
    spares_guards_by_bounds();
    goes_on_from_what_was_saved();
    goes_back_to_a_snapshot_after_any_failure();
    takes_structs_of_fewer_fields();
    return 0;
}
