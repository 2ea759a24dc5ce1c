/* What an event means at its borders: the condition, sets, modes that are left at once. */
#include <math.h>

#include "ball.h"

static rc_simulation* run_from(const rc_callbacks* callbacks, double start, double t_end)
{
    rc_options options = options_until(t_end);
    rc_system* system;
    rc_simulation* simulation;
    options.rtol = 1e-10;
    options.atol = 1e-12;
    CHECK_STATUS(RC_OK, rc_system_new(callbacks, &system));
    CHECK_STATUS(RC_OK, rc_simulation_new(system, &start, 1, &options, &simulation));
    rc_system_free(system);
    CHECK_STATUS(RC_OK, rc_run(simulation));
    return simulation;
}

static rc_callbacks callbacks_of(rc_flow_fn flow, rc_guard_fn guard, rc_reset_fn reset)
{
    rc_callbacks callbacks = ball_callbacks();
    callbacks.dimension = 1;
    callbacks.flow = flow;
    callbacks.guard = guard;
    callbacks.reset = reset;
    return callbacks;
}

/* A room that heats below 15.5 and stops above 17, and reads its temperature again. */

static int room_flow(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    (void)user, (void)t, (void)n;
    dxdt[0] = -0.1 * (x[0] - (mode ? 30 : 0));
    return 0;
}

static int room_guard(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                      double* g)
{
    (void)user, (void)which, (void)t, (void)n;
    *g = mode ? 17 - x[0] : x[0] - 15.5;
    return 0;
}

static int room_reset(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)which, (void)t, (void)n;
    if (x[0] <= 15.5) *mode = 1;
    if (x[0] >= 17) *mode = 0;
    return 0;
}

static void a_room_stays_in_its_band(void)
{
    rc_callbacks callbacks = callbacks_of(room_flow, room_guard, room_reset);
    rc_simulation* simulation;
    callbacks.mode_count = 2;
    simulation = run_from(&callbacks, 15.75, 48);
    CHECK(rc_event_count(simulation) == 48);
    CHECK(rc_mode_now(simulation) == 0);
    CHECK(fabs(rc_state(simulation)[0] - 16.3558078684) < 1e-6);
    CHECK(statistics_of(simulation).unmet_conditions == 0);
    rc_simulation_free(simulation);
}

/* A relay: each mode drives the state back over the surface that it has just left. */

static int relay_flow(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    (void)user, (void)t, (void)x, (void)n;
    dxdt[0] = mode ? 1 : -1;
    return 0;
}

static int relay_guard(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                       double* g)
{
    (void)user, (void)which, (void)t, (void)n;
    *g = mode ? -x[0] : x[0];
    return 0;
}

static int toggle(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)which, (void)t, (void)x, (void)n;
    *mode = 1 - *mode;
    return 0;
}

static void a_relay_is_reported(void)
{
    rc_callbacks callbacks = callbacks_of(relay_flow, relay_guard, toggle);
    rc_simulation* simulation;
    callbacks.mode_count = 2;
    simulation = run_from(&callbacks, 1, 3);
    CHECK(rc_outcome(simulation) == RC_ENDLESS_CASCADE);
    CHECK(fabs(rc_time(simulation) - 1) < 1e-14);
    CHECK(statistics_of(simulation).declined_guard == RC_NO_GUARD);
    rc_simulation_free(simulation);
}

static int leave_alone(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)which, (void)mode, (void)t, (void)x, (void)n;
    return 0;
}

static void a_reset_that_declines_is_named(void)
{
    rc_callbacks callbacks = callbacks_of(relay_flow, relay_guard, leave_alone);
    rc_simulation* simulation;
    rc_statistics statistics;
    callbacks.mode_count = 2;
    simulation = run_from(&callbacks, 1, 3);
    CHECK(rc_outcome(simulation) == RC_REACHED_END);
    statistics = statistics_of(simulation);
    CHECK(statistics.ineffective_resets == 1 && statistics.declined_guard == 0);
    CHECK(statistics.either_relays == 0 && statistics.relay_guard == RC_NO_GUARD);
    rc_simulation_free(simulation);
}

/* Two doses at one time, and two resets whose order matters. */

static int decay(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    (void)user, (void)mode, (void)t, (void)n;
    dxdt[0] = -x[0];
    return 0;
}

static int until_2_95(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                      double* g)
{
    (void)user, (void)which, (void)mode, (void)x, (void)n;
    *g = 2.95 - t;
    return 0;
}

static int dose(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    x[0] += 2;
    return 0;
}

static int set_or_add(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)mode, (void)t, (void)n;
    if (which == 0) {
        x[0] = -3.5;
    } else {
        x[0] += 1;
    }
    return 0;
}

static void resets_of_a_common_component_follow_each_other(void)
{
    rc_callbacks callbacks = callbacks_of(decay, until_2_95, dose);
    rc_simulation* simulation;
    rc_statistics statistics;
    callbacks.guard_count = 2;
    simulation = run_from(&callbacks, 1, 10);
    CHECK(fabs(rc_state(simulation)[0] - (exp(-10) + 4 * exp(-7.05))) < 1e-9);
    rc_simulation_free(simulation);

    callbacks.reset = set_or_add;
    simulation = run_from(&callbacks, -4.5, 10);
    CHECK(rc_outcome(simulation) == RC_CONFLICTING_RESETS);
    statistics = statistics_of(simulation);
    CHECK(statistics.guard == 0 && statistics.other_guard == 1);
    rc_simulation_free(simulation);
}

/* A dip of 4e-5 s in a step of any length, within a true bound. */

static int unit_flow(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    (void)user, (void)mode, (void)t, (void)x, (void)n;
    dxdt[0] = 1;
    return 0;
}

static int dip(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
               double* g)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    *g = fmin(1, 50 * fabs(x[0] - 0.37) - 1e-3);
    return 0;
}

static int at_most_50(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                      double* bound)
{
    (void)user, (void)which, (void)mode, (void)t, (void)x, (void)n;
    *bound = 50;
    return 0;
}

static void a_dip_within_a_true_bound_is_found(void)
{
    const double steps[] = {0, 0.3, 0.1}; /* 0: dopri5 under error control */
    rc_callbacks callbacks = callbacks_of(unit_flow, dip, NULL);
    size_t k;
    callbacks.speed_bound = at_most_50;
    callbacks.acceleration_bound = NULL;
    callbacks.guard_rate = NULL;
    for (k = 0; k < 3; ++k) {
        const double start = 0;
        rc_options options = options_until(1);
        rc_system* system;
        rc_simulation* simulation;
        options.detector = RC_PLANNED;
        options.step = steps[k];
        options.fixed_step = k > 0;
        if (k > 0) options.method = RC_RK4;
        CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
        CHECK_STATUS(RC_OK, rc_simulation_new(system, &start, 1, &options, &simulation));
        rc_system_free(system);
        CHECK_STATUS(RC_OK, rc_run(simulation));
        CHECK(statistics_of(simulation).events == 1);
        CHECK(statistics_of(simulation).unresolved_steps == 0);
        rc_simulation_free(simulation);
    }
}

int main(void)
{
    a_dip_within_a_true_bound_is_found();
    a_room_stays_in_its_band();
    a_relay_is_reported();
    a_reset_that_declines_is_named();
    resets_of_a_common_component_follow_each_other();
    return 0;
}
