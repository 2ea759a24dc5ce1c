/* Whichever call of a callback fails, the run continues afterwards with the bits of one in which
 * none has failed. */
#include <math.h>

#include "ball.h"

enum { calls_of = 12 };
enum {
    in_flow,
    in_guards,
    in_guard,
    in_rates,
    in_rate,
    in_reset,
    in_reset_set,
    in_rest,
    in_enabled,
    in_enabled_in,
    in_time,
    in_bound
};

struct world {
    size_t calls;    /* so far */
    size_t fails_at; /* the call that fails, once; 0: none */
    int moves;       /* after that, another simulation continues from a snapshot */
    int moded;       /* impacts of the first ball change the mode */
    size_t seen[calls_of];
};

static int visit(void* user, int where)
{
    struct world* world = user;
    ++world->seen[where];
    return ++world->calls == world->fails_at ? 42 : 0;
}

/* Two balls, x = (height, velocity) each, and as many components at rest as the state has more.
 * Guards: the floors, the passage of the first ball through 3 m (recorded only). */
static int flow(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    size_t i;
    (void)t;
    for (i = 0; i < n; ++i) dxdt[i] = 0;
    for (i = 0; i + 1 < n && i < 4; i += 2) {
        dxdt[i] = x[i + 1];
        dxdt[i + 1] = -9.81 - (mode ? 0.5 : 0.1) * x[i + 1];
    }
    return visit(user, in_flow);
}
static double value(size_t which, const double* x)
{
    return which == 0 ? x[0] : which == 1 ? x[0] - 3 : x[2];
}
static double rate(size_t which, const double* dxdt)
{
    return which == 2 ? dxdt[2] : dxdt[0];
}
static int guards(void* user, rc_mode mode, double t, const double* x, size_t n, double* g,
                  size_t count)
{
    size_t i;
    (void)mode, (void)t, (void)n;
    for (i = 0; i < count; ++i) g[i] = value(i, x);
    return visit(user, in_guards);
}
static int guard(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                 double* g)
{
    (void)mode, (void)t, (void)n;
    *g = value(which, x);
    return visit(user, in_guard);
}
static int guard_rates(void* user, rc_mode mode, double t, const double* x, const double* dxdt,
                       size_t n, double* rates, size_t count)
{
    size_t i;
    (void)mode, (void)t, (void)x, (void)n;
    for (i = 0; i < count; ++i) rates[i] = rate(i, dxdt);
    return visit(user, in_rates);
}
static int guard_rate(void* user, size_t which, rc_mode mode, double t, const double* x,
                      const double* dxdt, size_t n, double* to)
{
    (void)mode, (void)t, (void)x, (void)n;
    *to = rate(which, dxdt);
    return visit(user, in_rate);
}
static void bounce(double* x)
{
    x[0] = 0;
    x[1] *= -0.7;
}
static int reset(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)t, (void)n;
    bounce(which == 2 ? x + 2 : x);
    if (which == 0 && ((struct world*)user)->moded) *mode = 1 - *mode;
    return visit(user, in_reset);
}
static int reset_set(void* user, const size_t* fired, size_t count, int on_time, rc_mode* mode,
                     double t, double* x, size_t n)
{
    size_t i;
    (void)t, (void)n, (void)on_time;
    for (i = 0; i < count; ++i) {
        if (fired[i] != 1) bounce(fired[i] == 2 ? x + 2 : x);
        if (fired[i] == 0 && ((struct world*)user)->moded) *mode = 1 - *mode;
    }
    return visit(user, in_reset_set);
}
static int rest(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)t, (void)n, (void)mode;
    x = which == 2 ? x + 2 : x;
    x[0] = x[1] = 0;
    return visit(user, in_rest);
}
static int enabled(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                   int* yes)
{
    (void)which, (void)mode, (void)t, (void)x, (void)n;
    *yes = which != 1 || t > 0.9;
    return visit(user, in_enabled);
}
static int enabled_in(void* user, size_t which, rc_mode mode, int* yes)
{
    *yes = which != 1 || mode == 0;
    return visit(user, in_enabled_in);
}
static int next_time(void* user, double t, double* next)
{
    *next = 0.7 * (floor(t / 0.7 + 1e-9) + 1);
    return visit(user, in_time);
}
static int time_reset(void* user, rc_mode* mode, double t, double* x, size_t n)
{
    (void)mode, (void)t, (void)n;
    x[1] += 0.25;
    return visit(user, in_reset);
}
static int speed_bound(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                       double* bound)
{
    (void)mode, (void)t, (void)n;
    *bound = fabs(which == 2 ? x[3] : x[1]);
    return visit(user, in_bound);
}
static int acceleration_bound(void* user, size_t which, rc_mode mode, double t, const double* x,
                              size_t n, double* bound)
{
    (void)mode, (void)t, (void)n;
    *bound = 9.81 + fabs(which == 2 ? x[3] : x[1]);
    return visit(user, in_bound);
}

enum { most_events = 400, samples = 23 };

struct result {
    int outcome;
    double t, x[6];
    rc_mode mode;
    size_t events;
    double when[most_events], speed[most_events];
    size_t guard[most_events];
    int kind[most_events];
    double sampled[samples], between[samples];
    uint64_t steps, counted;
};

struct setting {
    const char* name;
    size_t dimension, guards;
    int method, fixed, detector;
    int together; /* guards, rates and resets from one call each */
    int timed, moded, records, by_advance;
    double t_end;
};

static struct result run(const struct setting* of, struct world* world, size_t* failures)
{
    static const double start[6] = {4, 0, 4.5, 1, 2, 3};
    double times[samples];
    struct result result;
    rc_guard_info infos[3];
    rc_callbacks callbacks;
    rc_options options = options_until(of->t_end);
    rc_system* system;
    rc_simulation* simulation;
    rc_status status;
    rc_statistics statistics;
    size_t events_before = 0;
    size_t i;

    world->moded = of->moded;
    memset(&result, 0, sizeof result);
    memset(infos, 0, sizeof infos);
    memset(&callbacks, 0, sizeof callbacks);
    for (i = 0; i < 3; ++i) {
        infos[i].size = sizeof infos[i];
        infos[i].crossing = i == 1 ? RC_EITHER : RC_FALLING;
        infos[i].notifies = i == 1;
    }
    callbacks.size = sizeof callbacks;
    callbacks.dimension = of->dimension;
    callbacks.guard_count = of->guards;
    callbacks.mode_count = of->moded ? 2 : 0;
    callbacks.user = world;
    callbacks.guard_infos = infos;
    callbacks.flow = flow;
    if (of->together) {
        callbacks.guards = guards;
        callbacks.guard_rates = guard_rates;
        callbacks.reset_set = reset_set;
    } else {
        callbacks.guard = guard;
        callbacks.guard_rate = of->guards > 1 ? guard_rate : NULL;
        callbacks.reset = reset;
    }
    callbacks.rest = rest;
    if (of->guards > 1) callbacks.enabled = enabled;
    if (of->moded) callbacks.enabled_in = enabled_in;
    if (of->timed) {
        callbacks.next_time_event = next_time;
        callbacks.time_reset = time_reset;
    }
    if (of->detector == RC_PLANNED) {
        callbacks.speed_bound = speed_bound;
        callbacks.acceleration_bound = acceleration_bound;
    }
    options.method = of->method;
    options.fixed_step = of->fixed;
    options.step = of->fixed ? 0.02 : 0;
    options.detector = of->detector;
    options.record_steps = of->records;
    for (i = 0; i < samples; ++i) times[i] = of->t_end * (double)i / (samples - 1);
    options.sample_times = times;
    options.sample_count = of->records ? samples : 0;

    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
    status = rc_simulation_new(system, start, of->dimension, &options, &simulation);
    if (status == RC_CALLBACK) {
        CHECK(simulation == NULL);
        ++*failures;
        status = rc_simulation_new(system, start, of->dimension, &options, &simulation);
    }
    CHECK_STATUS(RC_OK, status);
    for (;;) {
        int goes_on = 0;
        status = of->by_advance ? rc_advance(simulation, &goes_on) : rc_run(simulation);
        if (status == RC_CALLBACK) {
            rc_callback_error error;
            error.size = sizeof error;
            CHECK(rc_outcome(simulation) == RC_STOPPED_BY_CALLBACK);
            CHECK_STATUS(RC_OK, rc_callback_failure(simulation, &error));
            CHECK(error.code == 42 && error.callback != NULL);
            CHECK(rc_time(simulation) <= of->t_end);
            ++*failures;
            if (world->moves) {
                static char bytes[1 << 18];
                size_t size = sizeof bytes;
                events_before = rc_event_count(simulation);
                CHECK_STATUS(RC_OK, rc_save(simulation, bytes, &size));
                CHECK_STATUS(RC_OK, rc_simulation_free(simulation));
                CHECK_STATUS(
                    RC_OK, rc_simulation_new(system, start, of->dimension, &options, &simulation));
                CHECK_STATUS(RC_OK, rc_restore(simulation, bytes, size));
            }
        } else {
            CHECK_STATUS(RC_OK, status);
            if (!goes_on) break;
        }
    }
    rc_system_free(system);
    result.outcome = rc_outcome(simulation);
    result.t = rc_time(simulation);
    memcpy(result.x, rc_state(simulation), of->dimension * sizeof(double));
    result.mode = rc_mode_now(simulation);
    result.events = rc_event_count(simulation);
    CHECK(result.events <= most_events);
    if (world->moves && *failures > 0) { /* what was recorded stays with the first */
        result.events += events_before;
        CHECK_STATUS(RC_OK, rc_simulation_free(simulation));
        return result;
    }
    for (i = 0; i < result.events; ++i) {
        const rc_event event = event_at(simulation, i);
        result.when[i] = event.t;
        result.speed[i] = event.after[1];
        result.guard[i] = event.guard;
        result.kind[i] = event.kind;
    }
    CHECK(rc_sample_count(simulation) == options.sample_count);
    for (i = 0; i < options.sample_count; ++i) {
        const double* x;
        double at[6];
        CHECK_STATUS(RC_OK, rc_sample_at(simulation, i, NULL, &x));
        result.sampled[i] = x[0];
        CHECK_STATUS(RC_OK, rc_solution(simulation, 0.9 * times[i], at, of->dimension));
        result.between[i] = at[0];
    }
    statistics = statistics_of(simulation);
    result.steps = statistics.steps;
    result.counted = statistics.events;
    CHECK_STATUS(RC_OK, rc_simulation_free(simulation));
    return result;
}

static int ends_alike(const struct result* a, const struct result* b)
{
    return a->outcome == b->outcome && a->t == b->t && memcmp(a->x, b->x, sizeof a->x) == 0 &&
           a->mode == b->mode && a->events == b->events;
}

static int flow_until_it_fails(void* user, rc_mode mode, double t, const double* x, double* dxdt,
                               size_t n)
{
    return *(int*)user ? 42 : ball_flow(NULL, mode, t, x, dxdt, n);
}
static int guard_until_it_fails(void* user, size_t which, rc_mode mode, double t, const double* x,
                                size_t n, double* g)
{
    return *(int*)user ? 43 : ball_guard(NULL, which, mode, t, x, n, g);
}
static int bound_of_ball(void* user, size_t which, rc_mode mode, double t, const double* x,
                         size_t n, double* bound)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    *bound = 9.81 + fabs(x[1]);
    return 0;
}

/* A run whose callbacks still fail returns to a snapshot all the same. */
static void returns_while_callbacks_fail(void)
{
    static char bytes[1 << 16];
    size_t size = sizeof bytes, needed = 0;
    int fails = 0, i;
    rc_callbacks callbacks = ball_callbacks();
    rc_options options = options_until(3);
    rc_callback_error error;
    rc_simulation* simulation;
    double x[2], t;
    callbacks.user = &fails;
    callbacks.flow = flow_until_it_fails;
    callbacks.guard = guard_until_it_fails;
    callbacks.speed_bound = bound_of_ball;
    callbacks.acceleration_bound = bound_of_ball;
    options.detector = RC_PLANNED;
    options.h_max = 0.05;
    simulation = start_ball(&callbacks, &options);
    for (i = 0; i < 5; ++i) CHECK_STATUS(RC_OK, rc_step(simulation, NULL));
    CHECK_STATUS(RC_OK, rc_save(simulation, bytes, &size));
    t = rc_time(simulation);
    CHECK_STATUS(RC_OK, rc_run(simulation));
    memcpy(x, rc_state(simulation), sizeof x);
    CHECK_STATUS(RC_OK, rc_restore(simulation, bytes, size));
    for (i = 0; i < 9; ++i) CHECK_STATUS(RC_OK, rc_step(simulation, NULL));
    fails = 1;
    CHECK_STATUS(RC_CALLBACK, rc_run(simulation));
    error.size = sizeof error;
    CHECK_STATUS(RC_OK, rc_callback_failure(simulation, &error));
    CHECK(error.code == 42 && strcmp(error.callback, "flow") == 0);
    CHECK_STATUS(RC_CALLBACK, rc_save(simulation, NULL, &needed));
    CHECK_STATUS(RC_OK, rc_callback_failure(simulation, &error));
    CHECK(error.code == 43 && strcmp(error.callback, "guard") == 0);
    CHECK_STATUS(RC_INVALID, rc_restore(simulation, bytes, size - 1));
    CHECK(rc_outcome(simulation) == RC_STOPPED_BY_CALLBACK);
    CHECK_STATUS(RC_OK, rc_restore(simulation, bytes, size));
    CHECK(rc_outcome(simulation) == RC_RUNNING && rc_time(simulation) == t);
    fails = 0;
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(memcmp(x, rc_state(simulation), sizeof x) == 0);
    CHECK_STATUS(RC_OK, rc_simulation_free(simulation));
}

int main(void)
{
    static const struct setting settings[] = {
        {"one guard", 2, 1, RC_DOPRI5, 0, RC_EXTREMUM, 0, 0, 0, 0, 0, 4},
        {"one guard until it rests", 2, 1, RC_DOPRI5, 0, RC_EXTREMUM, 0, 0, 0, 0, 0, 40},
        {"one guard, recorded", 2, 1, RC_FEHLBERG78, 0, RC_EXTREMUM, 0, 1, 0, 1, 0, 3},
        {"two guards, modes", 2, 2, RC_DOPRI5, 0, RC_EXTREMUM, 1, 1, 1, 1, 0, 3},
        {"three guards", 4, 3, RC_DOPRI5, 0, RC_BERNSTEIN, 0, 0, 1, 1, 0, 3.5},
        {"many components", 6, 3, RC_DOPRI5, 0, RC_EXTREMUM, 1, 1, 1, 1, 0, 3.5},
        {"many components, order 8", 6, 3, RC_FEHLBERG78, 0, RC_EXTREMUM, 0, 1, 0, 1, 0, 3},
        {"fixed steps", 4, 3, RC_RK4, 1, RC_ENDS, 0, 1, 1, 1, 0, 3.5},
        {"planned", 4, 3, RC_RK4, 1, RC_PLANNED, 0, 0, 1, 0, 0, 3},
        {"planned, recorded", 6, 3, RC_DOPRI5, 0, RC_PLANNED, 0, 1, 0, 1, 0, 3},
        {"from event to event", 4, 3, RC_DOPRI5, 0, RC_EXTREMUM, 1, 1, 1, 1, 1, 3.5},
        {"planned, from event to event", 4, 3, RC_RK4, 1, RC_PLANNED, 0, 1, 1, 1, 1, 3.5},
    };
    size_t seen[calls_of] = {0};
    size_t s, k;
    returns_while_callbacks_fail();
    for (s = 0; s < sizeof settings / sizeof settings[0]; ++s) {
        const struct setting* of = &settings[s];
        struct world undisturbed;
        struct result expected;
        size_t failures = 0;
        memset(&undisturbed, 0, sizeof undisturbed);
        expected = run(of, &undisturbed, &failures);
        CHECK(failures == 0 && expected.events > 2);
        for (k = 0; k < calls_of; ++k) seen[k] += undisturbed.seen[k];
        for (k = 1; k <= undisturbed.calls; k += undisturbed.calls > 3000 ? 7 : 1) {
            struct world world;
            struct result found;
            memset(&world, 0, sizeof world);
            world.fails_at = k;
            world.moves = k % 3 == 0;
            failures = 0;
            found = run(of, &world, &failures);
            CHECK(failures == 1);
            if (world.moves ? !ends_alike(&found, &expected)
                            : memcmp(&found, &expected, sizeof found) != 0) {
                fprintf(stderr,
                        "%s, call %lu of %lu: %lu events in %lu steps, not %lu in %lu; "
                        "t %.17g, not %.17g, x %.17g, not %.17g\n",
                        of->name, (unsigned long)k, (unsigned long)undisturbed.calls,
                        (unsigned long)found.events, (unsigned long)found.steps,
                        (unsigned long)expected.events, (unsigned long)expected.steps, found.t,
                        expected.t, found.x[0], expected.x[0]);
                return 1;
            }
        }
        printf("%s: any of %lu calls may fail; %lu events\n", of->name,
               (unsigned long)undisturbed.calls, (unsigned long)expected.events);
    }
    for (k = 0; k < calls_of; ++k) CHECK(seen[k] > 0);
    return 0;
}
