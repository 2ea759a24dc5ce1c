/* Set-valued motion beside events. Expected numbers are closed forms; the motions are polynomials
 * of degree three or less, exact for the method, so that 1e-9 holds the rounding of locations. */
#include <math.h>

#include "ball.h"

static const double close = 1e-9;

#define CHECK_NEAR(expected, found) CHECK(fabs((expected) - (found)) <= close)

static double sign_of(double y)
{
    return y >= 0 ? 1 : -1;
}

static rc_simulation* start_of(const rc_callbacks* callbacks, const double* x0, double t_end)
{
    rc_options options = options_until(t_end);
    rc_system* system;
    rc_simulation* simulation;
    options.rtol = 1e-10;
    options.atol = 1e-12;
    CHECK_STATUS(RC_OK, rc_system_new(callbacks, &system));
    CHECK_STATUS(RC_OK, rc_simulation_new(system, x0, callbacks->dimension, &options, &simulation));
    rc_system_free(system);
    return simulation;
}

/* Runs to the end, by steps with a new simulation after every tenth, and back again. */
static rc_simulation* run_of(const rc_callbacks* callbacks, const double* x0, double t_end)
{
    rc_simulation* whole = start_of(callbacks, x0, t_end);
    rc_simulation* parts = start_of(callbacks, x0, t_end);
    int goes_on = 1, steps = 0;
    size_t i;
    CHECK_STATUS(RC_OK, rc_run(whole));
    while (goes_on) {
        CHECK_STATUS(RC_OK, rc_step(parts, &goes_on));
        if (++steps % 10 == 0) {
            size_t size = 0;
            char* bytes;
            CHECK_STATUS(RC_OK, rc_save(parts, NULL, &size));
            bytes = malloc(size);
            CHECK_STATUS(RC_OK, rc_save(parts, bytes, &size));
            CHECK_STATUS(RC_OK, rc_simulation_free(parts));
            parts = start_of(callbacks, x0, t_end);
            CHECK_STATUS(RC_OK, rc_restore(parts, bytes, size));
            free(bytes);
        }
    }
    CHECK(rc_outcome(parts) == rc_outcome(whole));
    for (i = 0; i < callbacks->dimension; ++i) CHECK(rc_state(parts)[i] == rc_state(whole)[i]);
    CHECK_STATUS(RC_OK, rc_simulation_free(parts));
    return whole;
}

/* Time of the only event of a kind; NaN if there is not just one. */
static double time_of(rc_simulation* simulation, rc_event_kind kind, size_t guard, size_t reaction)
{
    double t = NAN;
    int count = 0;
    size_t i;
    for (i = 0; i < rc_event_count(simulation); ++i) {
        rc_event event = {.size = sizeof event};
        CHECK_STATUS(RC_OK, rc_event_at(simulation, i, &event));
        if (event.kind != (int32_t)kind || event.guard != guard || event.reaction != reaction) {
            continue;
        }
        ++count;
        t = event.t;
    }
    return count == 1 ? t : NAN;
}

/* --- a block that stops, and a ball beside it: speed; height, speed; and zeros --- */

static int beside_flow(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    size_t i;
    (void)user, (void)mode, (void)t;
    for (i = 0; i < n; ++i) dxdt[i] = 0;
    dxdt[0] = -sign_of(x[0]);
    dxdt[1] = x[2];
    dxdt[2] = -1;
    return 0;
}
static int beside_smooth(void* user, rc_mode mode, double t, const double* w, double* f, size_t n)
{
    beside_flow(user, mode, t, w, f, n);
    f[0] = 0;
    return 0;
}
static int unit_bounds(void* user, rc_mode mode, double t, const double* w, size_t n, double* lower,
                       double* upper, size_t m)
{
    size_t i;
    (void)user, (void)mode, (void)t, (void)w, (void)n;
    for (i = 0; i < m; ++i) {
        lower[i] = -1;
        upper[i] = 1;
    }
    return 0;
}
static int height_guard(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                        double* g)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    *g = x[1];
    return 0;
}
static int elastic_reset(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    x[2] = -x[2];
    return 0;
}

static const rc_guard_info floor_info = {.size = sizeof floor_info, .unilateral = 1};

static rc_callbacks beside(const rc_inclusion* friction, size_t n)
{
    const rc_callbacks callbacks = {.size = sizeof callbacks,
                                    .dimension = n,
                                    .guard_count = 1,
                                    .guard_infos = &floor_info,
                                    .flow = beside_flow,
                                    .guard = height_guard,
                                    .reset = elastic_reset,
                                    .set_valued = friction};
    return callbacks;
}

static void follows_a_ball_while_a_block_is_held(void)
{
    const rc_inclusion friction = {
        .size = sizeof friction, .reactions = 1, .smooth = beside_smooth, .bounds = unit_bounds};
    const double x0[8] = {1, 1.125, 0, 7, 7, 7, 7, 7};
    size_t n;
    for (n = 3; n <= 8; ++n) {
        const rc_callbacks callbacks = beside(&friction, n);
        rc_simulation* simulation = run_of(&callbacks, x0, 3);
        rc_phase phase = {.size = sizeof phase};
        CHECK(rc_outcome(simulation) == RC_REACHED_END);
        CHECK(rc_state(simulation)[0] == 0);
        CHECK_NEAR(1.125, rc_state(simulation)[1]);
        if (n > 3) CHECK(rc_state(simulation)[n - 1] == 7);
        CHECK_NEAR(1, time_of(simulation, RC_STICK, RC_NO_GUARD, 0));
        CHECK_NEAR(1.5, time_of(simulation, RC_CROSSING, 0, RC_NO_REACTION));
        CHECK(rc_phase_count(simulation) == 2);
        CHECK_STATUS(RC_OK, rc_phase_at(simulation, 1, &phase));
        CHECK(phase.set_valued == 1 && phase.cause == RC_CAUSE_HELD);
        CHECK_NEAR(1, phase.from);
        CHECK_REFUSED(RC_INVALID, rc_phase_at(simulation, 2, &phase), "no phase 2");
        CHECK_STATUS(RC_OK, rc_simulation_free(simulation));
    }
}

/* --- reactions: one contact, or two with the bounds 1 and 3, under the load t from rest --- */

static int load_flow(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    (void)mode, (void)n;
    dxdt[0] = t - *(const double*)user * sign_of(x[0]);
    return 0;
}
static int load_smooth(void* user, rc_mode mode, double t, const double* w, double* f, size_t n)
{
    (void)user, (void)mode, (void)w, (void)n;
    f[0] = t;
    return 0;
}
static int contact_bounds(void* user, rc_mode mode, double t, const double* w, size_t n,
                          double* lower, double* upper, size_t m)
{
    size_t i;
    (void)user, (void)mode, (void)t, (void)w, (void)n;
    for (i = 0; i < m; ++i) {
        upper[i] = i == 0 ? 1 : 3;
        lower[i] = -upper[i];
    }
    return 0;
}

static void gives_the_least_reactions_that_hold(void)
{
    const double both[2] = {1, 1}, times[3] = {1, 3, 5}, x0[1] = {0};
    const double expected[3][2] = {{-0.5, -0.5}, {-1, -2}, {-1, -3}};
    double friction = 4;
    const rc_inclusion contacts = {.size = sizeof contacts,
                                   .reactions = 2,
                                   .smooth = load_smooth,
                                   .bounds = contact_bounds,
                                   .observe = both};
    const rc_callbacks callbacks = {.size = sizeof callbacks,
                                    .user = &friction,
                                    .dimension = 1,
                                    .flow = load_flow,
                                    .set_valued = &contacts};
    rc_options options = options_until(6);
    rc_system* system;
    rc_simulation* simulation;
    const double* r;
    size_t m, k;
    options.sample_times = times;
    options.sample_count = 3;
    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
    CHECK_STATUS(RC_OK, rc_simulation_new(system, x0, 1, &options, &simulation));
    CHECK_STATUS(RC_OK, rc_reaction(simulation, &r, &m));
    CHECK(m == 2 && r[0] == 0 && r[1] == 0);
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(rc_sample_count(simulation) == 3);
    for (k = 0; k < 3; ++k) {
        CHECK_STATUS(RC_OK, rc_reaction_at(simulation, k, &r, &m));
        CHECK(m == 2);
        CHECK_NEAR(expected[k][0], r[0]);
        CHECK_NEAR(expected[k][1], r[1]);
    }
    CHECK_REFUSED(RC_INVALID, rc_reaction_at(simulation, 3, &r, &m), "no sample 3");
    CHECK_REFUSED(RC_INVALID, rc_reaction(simulation, NULL, &m), "rc_reaction");
    CHECK_STATUS(RC_OK, rc_reaction(simulation, &r, &m));
    CHECK(m == 2);
    CHECK_NEAR(-1, r[0]);
    CHECK_NEAR(-3, r[1]);
    CHECK_STATUS(RC_OK, rc_simulation_free(simulation));
    rc_system_free(system);
}

static void gives_no_reactions_without_set_valued(void)
{
    const double times[1] = {0.5};
    const rc_callbacks callbacks = ball_callbacks();
    rc_options options = options_until(1);
    rc_simulation* simulation;
    const double* r;
    size_t m = 7;
    options.sample_times = times;
    options.sample_count = 1;
    simulation = start_ball(&callbacks, &options);
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK_STATUS(RC_OK, rc_reaction(simulation, &r, &m));
    CHECK(m == 0);
    m = 7;
    CHECK_STATUS(RC_OK, rc_reaction_at(simulation, 0, &r, &m));
    CHECK(m == 0);
    CHECK_STATUS(RC_OK, rc_simulation_free(simulation));
}

/* --- E, G and A: two bodies of masses 1 and 2 that rub on each other --- */

static int pair_smooth(void* user, rc_mode mode, double t, const double* w, double* f, size_t n)
{
    size_t i;
    (void)user, (void)mode, (void)t, (void)w;
    for (i = 0; i < n; ++i) f[i] = 0;
    return 0;
}
static int pair_flow(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    (void)user, (void)mode, (void)t, (void)n;
    dxdt[0] = -sign_of(x[0] - x[1]);
    dxdt[1] = sign_of(x[0] - x[1]) / 2;
    return 0;
}

static void takes_matrices_by_rows(void)
{
    const double observe[2] = {1, -1}, act[2] = {1, -1}, mass[4] = {1, 0, 0, 2};
    const rc_inclusion friction = {.size = sizeof friction,
                                   .reactions = 1,
                                   .smooth = pair_smooth,
                                   .bounds = unit_bounds,
                                   .mass = mass,
                                   .observe = observe,
                                   .act = act};
    const rc_callbacks callbacks = {
        .size = sizeof callbacks, .dimension = 2, .flow = pair_flow, .set_valued = &friction};
    const double x0[2] = {3, 0};
    /* The difference falls by 3/2 a second: 1 m/s each from 2 s on. */
    rc_simulation* simulation = run_of(&callbacks, x0, 3);
    CHECK(rc_outcome(simulation) == RC_REACHED_END);
    CHECK_NEAR(1, rc_state(simulation)[0]);
    CHECK_NEAR(1, rc_state(simulation)[1]);
    CHECK_NEAR(2, time_of(simulation, RC_STICK, RC_NO_GUARD, 0));
    CHECK_STATUS(RC_OK, rc_simulation_free(simulation));
}

/* --- two belts: the way and the speed of a block; the belt's speed is that of the mode --- */

static double belt(rc_mode mode)
{
    return mode == 0 ? 0.5 : -0.5;
}
static int belts_flow(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    (void)user, (void)t, (void)n;
    dxdt[0] = x[1];
    dxdt[1] = -sign_of(x[1] - belt(mode));
    return 0;
}
static int belts_smooth(void* user, rc_mode mode, double t, const double* w, double* f, size_t n)
{
    (void)user, (void)mode, (void)t, (void)n;
    f[0] = w[1];
    f[1] = 0;
    return 0;
}
static int belts_offset(void* user, rc_mode mode, double t, double* s, double* rate, size_t m)
{
    (void)user, (void)t, (void)m;
    s[0] = belt(mode);
    rate[0] = 0;
    return 0;
}
static int belts_guard(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                       double* g)
{
    (void)user, (void)mode, (void)t, (void)n;
    *g = which == 0 ? x[0] - 1 : x[0];
    return 0;
}
static int belts_reset(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)t, (void)x, (void)n;
    *mode = 1 - (rc_mode)which;
    return 0;
}
static int belts_enabled(void* user, size_t which, rc_mode mode, int* enabled)
{
    (void)user;
    *enabled = which == mode;
    return 0;
}

static void changes_the_inclusion_with_the_mode(void)
{
    const double observe[2] = {0, 1};
    const rc_guard_info infos[2] = {{.size = sizeof infos[0], .crossing = RC_RISING},
                                    {.size = sizeof infos[0], .crossing = RC_FALLING}};
    const rc_inclusion friction = {.size = sizeof friction,
                                   .reactions = 1,
                                   .smooth = belts_smooth,
                                   .bounds = unit_bounds,
                                   .offset = belts_offset,
                                   .observe = observe};
    const rc_callbacks callbacks = {.size = sizeof callbacks,
                                    .dimension = 2,
                                    .guard_count = 2,
                                    .mode_count = 2,
                                    .guard_infos = infos,
                                    .flow = belts_flow,
                                    .guard = belts_guard,
                                    .reset = belts_reset,
                                    .enabled_in = belts_enabled,
                                    .set_valued = &friction};
    const double x0[2] = {0, 0.5};
    rc_simulation* simulation = run_of(&callbacks, x0, 10);
    CHECK(rc_outcome(simulation) == RC_REACHED_END);
    CHECK_NEAR(0.5, rc_state(simulation)[0]);
    CHECK_NEAR(-0.5, rc_state(simulation)[1]);
    CHECK(rc_mode_now(simulation) == 1);
    CHECK_NEAR(5, time_of(simulation, RC_CROSSING, 1, RC_NO_REACTION));
    CHECK_STATUS(RC_OK, rc_simulation_free(simulation));
}

/* --- a ball that rests in a mode of its own, and is lifted: height and speed --- */

enum { flying, resting };

static double lift(double t)
{
    return t < 1 || t >= 2 ? -10 : -10 + 20 * (t - 1);
}
static int lifted_flow(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    (void)user, (void)mode, (void)n;
    dxdt[0] = x[1];
    dxdt[1] = lift(t);
    return 0;
}
static int lifted_guard(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                        double* g)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    *g = x[0];
    return 0;
}
static int lifted_reset(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    x[0] = 0;
    x[1] *= -0.5;
    return 0;
}
static int lifted_rest(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)which, (void)t, (void)n;
    x[0] = x[1] = 0;
    *mode = resting;
    return 0;
}
static int lifted_next(void* user, double t, double* next)
{
    (void)user;
    *next = t < 1 ? 1 : t < 2 ? 2 : INFINITY;
    return 0;
}
static int half_line(void* user, rc_mode mode, double t, const double* w, size_t n, double* lower,
                     double* upper, size_t m)
{
    (void)user, (void)mode, (void)t, (void)w, (void)n, (void)m;
    lower[0] = 0;
    upper[0] = INFINITY;
    return 0;
}
static int lifted_change(void* user, size_t which, int32_t kind, rc_mode* mode, double t, double* x,
                         size_t n)
{
    (void)user, (void)which, (void)t, (void)x, (void)n;
    if (kind == RC_SLIP) *mode = flying;
    return 0;
}
static int lifted_start_mode(void* user, rc_mode* mode, double t, const double* x, size_t n)
{
    (void)user, (void)t, (void)x, (void)n;
    *mode = flying;
    return 0;
}

static void lets_a_ball_rest_and_be_lifted(rc_change_fn change, rc_start_mode_fn start_mode)
{
    const double observe[2] = {0, 1};
    const size_t stands_for[1] = {0};
    const int32_t in_modes[2] = {0, 1};
    const rc_inclusion ground = {.size = sizeof ground,
                                 .reactions = 1,
                                 .smooth = lifted_flow,
                                 .bounds = half_line,
                                 .observe = observe,
                                 .stands_for = stands_for,
                                 .in_modes = in_modes,
                                 .change = change,
                                 .start_mode = start_mode};
    const rc_callbacks callbacks = {.size = sizeof callbacks,
                                    .dimension = 2,
                                    .guard_count = 1,
                                    .mode_count = 2,
                                    .guard_infos = &floor_info,
                                    .flow = lifted_flow,
                                    .guard = lifted_guard,
                                    .reset = lifted_reset,
                                    .rest = lifted_rest,
                                    .next_time_event = lifted_next,
                                    .set_valued = &ground};
    const double x0[2] = {0.2, 0};
    rc_simulation* simulation = run_of(&callbacks, x0, 2.6);
    CHECK(rc_outcome(simulation) == RC_REACHED_END);
    CHECK_NEAR(7.0 / 60, rc_state(simulation)[0]);
    CHECK(rc_mode_now(simulation) == flying);
    CHECK(fabs(0.6 - time_of(simulation, RC_ACCUMULATION, 0, RC_NO_REACTION)) < 1e-7);
    CHECK_NEAR(1.5, time_of(simulation, RC_SLIP, RC_NO_GUARD, 0));
    CHECK_STATUS(RC_OK, rc_simulation_free(simulation));
}

/* --- ends --- */

static int repulsive_flow(void* user, rc_mode mode, double t, const double* x, double* dxdt,
                          size_t n)
{
    (void)user, (void)mode, (void)t, (void)n;
    dxdt[0] = sign_of(x[0]);
    return 0;
}

static void names_the_reaction_of_several_motions(void)
{
    const double act[1] = {-1};
    const rc_inclusion repulsive = {.size = sizeof repulsive,
                                    .reactions = 1,
                                    .smooth = pair_smooth,
                                    .bounds = unit_bounds,
                                    .act = act};
    const rc_callbacks callbacks = {
        .size = sizeof callbacks, .dimension = 1, .flow = repulsive_flow, .set_valued = &repulsive};
    const double x0[1] = {0};
    rc_simulation* simulation = run_of(&callbacks, x0, 1);
    CHECK(rc_outcome(simulation) == RC_SEVERAL);
    CHECK(strstr(rc_reason(simulation), "reaction 0"));
    CHECK(strstr(rc_describe(simulation), "reaction 0"));
    CHECK(strcmp(rc_outcome_name(RC_SEVERAL), "several") == 0);
    CHECK(strcmp(rc_outcome_name((rc_outcome_code)17), "unknown") == 0);
    CHECK_STATUS(RC_OK, rc_simulation_free(simulation));
}

static int failing_bounds(void* user, rc_mode mode, double t, const double* w, size_t n,
                          double* lower, double* upper, size_t m)
{
    if (t > 1.25) return 42;
    return unit_bounds(user, mode, t, w, n, lower, upper, m);
}

static void passes_on_the_failure_of_a_callback(void)
{
    const rc_inclusion friction = {
        .size = sizeof friction, .reactions = 1, .smooth = beside_smooth, .bounds = failing_bounds};
    const rc_callbacks callbacks = beside(&friction, 3);
    const double x0[3] = {1, 1.125, 0};
    rc_simulation* simulation = start_of(&callbacks, x0, 3);
    rc_callback_error error = {.size = sizeof error};
    CHECK_STATUS(RC_CALLBACK, rc_run(simulation));
    CHECK(rc_outcome(simulation) == RC_STOPPED_BY_CALLBACK);
    CHECK_STATUS(RC_OK, rc_callback_failure(simulation, &error));
    CHECK(error.code == 42 && strcmp(error.callback, "bounds") == 0 && error.t > 1.25);
    CHECK(rc_time(simulation) <= 1.25);
    CHECK_STATUS(RC_OK, rc_simulation_free(simulation));
}

/* --- bad input --- */

static void refuses_what_is_no_inclusion(void)
{
    rc_inclusion friction = {
        .size = sizeof friction, .reactions = 1, .smooth = beside_smooth, .bounds = unit_bounds};
    const rc_inclusion right = friction;
    const size_t stands_for[1] = {1};
    const int32_t in_modes[1] = {1};
    rc_callbacks callbacks = beside(&friction, 3);
    rc_system* system;

#define CHECK_INCLUSION(change, text)                                    \
    friction = right;                                                    \
    callbacks = beside(&friction, 3);                                    \
    change;                                                              \
    CHECK_REFUSED(RC_INVALID, rc_system_new(&callbacks, &system), text); \
    CHECK(system == NULL)

    CHECK_INCLUSION(friction.reactions = 0, "reactions must be 1 to 4, got 0");
    CHECK_INCLUSION(friction.reactions = 5, "reactions must be 1 to 4, got 5");
    CHECK_INCLUSION(callbacks.dimension = 9, "at most 8 components, got 9");
    CHECK_INCLUSION(friction.smooth = NULL, "no smooth");
    CHECK_INCLUSION(friction.bounds = NULL, "no bounds");
    CHECK_INCLUSION(friction.reactions = 4, "no observe");
    CHECK_INCLUSION(friction.stands_for = stands_for, "stands_for of guard 0 must be below 1");
    CHECK_INCLUSION(friction.in_modes = in_modes, "in_modes with a mode_count of 0");
    CHECK_INCLUSION(friction.start_mode = lifted_start_mode, "start_mode with a mode_count of 0");
    friction = right;
    friction.size = sizeof friction + 8;
    callbacks = beside(&friction, 3);
    CHECK_REFUSED(RC_WRONG_SIZE, rc_system_new(&callbacks, &system), "rc_inclusion");
}

static void refuses_runs_that_cannot_follow(void)
{
    const rc_inclusion friction = {
        .size = sizeof friction, .reactions = 1, .smooth = beside_smooth, .bounds = unit_bounds};
    const rc_callbacks callbacks = beside(&friction, 3);
    const double x0[3] = {1, 1, 0};
    const double mass[9] = {1, 0, 0, 0, 0, 0, 0, 0, 1};
    rc_options options = options_until(3);
    rc_inclusion singular = friction;
    rc_callbacks massless = beside(&singular, 3);
    rc_simulation* simulation;
    rc_monitor* monitor;
    rc_system* system;
    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
    CHECK_REFUSED(RC_INVALID, rc_monitor_new(system, NULL, &monitor), "set_valued");
    options.fixed_step = 1;
    options.step = 0.1;
    CHECK_REFUSED(RC_INVALID, rc_simulation_new(system, x0, 3, &options, &simulation),
                  "fixed_step = 1 and a system with set_valued");
    options = options_until(3);
    options.detector = RC_PLANNED;
    CHECK_REFUSED(RC_INVALID, rc_simulation_new(system, x0, 3, &options, &simulation), "detector");
    options = options_until(-1);
    CHECK_STATUS(RC_INVALID, rc_simulation_new(system, x0, 3, &options, &simulation));
    rc_system_free(system);
    singular.mass = mass;
    options = options_until(3);
    CHECK_STATUS(RC_OK, rc_system_new(&massless, &system));
    CHECK_REFUSED(RC_INVALID, rc_simulation_new(system, x0, 3, &options, &simulation),
                  "matrix A is singular; its rank is 2");
    rc_system_free(system);
}

int main(void)
{
    follows_a_ball_while_a_block_is_held();
    gives_the_least_reactions_that_hold();
    gives_no_reactions_without_set_valued();
    takes_matrices_by_rows();
    changes_the_inclusion_with_the_mode();
    lets_a_ball_rest_and_be_lifted(lifted_change, NULL);
    lets_a_ball_rest_and_be_lifted(NULL, lifted_start_mode);
    names_the_reaction_of_several_motions();
    passes_on_the_failure_of_a_callback();
    refuses_what_is_no_inclusion();
    refuses_runs_that_cannot_follow();
    return 0;
}
