/* Guards of which only the sign has a meaning, touches at ticks, samples at events, and ends of
 * runs that say what has ended them. */
#include "machine.h"

FLOW(rises, d[0] = 1)
GUARD(until_1, 1 - x[0])
RESET(set_back, x[0] = 0)
TICK(nothing, )

static size_t calls = 0;
static double counted(size_t i, rc_mode m, double t, const double* x)
{
    UNUSED, (void)i;
    ++calls;
    return x[0] < 1 ? 1 : -1;
}

static void the_event_tolerance_saves_calls_of_boolean_guards(void)
{
    /* A hundredth of a step is seven halvings, of which the places inside are some; with one call
     * after the reset, two in each step, and one at the start. */
    const struct machine machine = {"level", 1,        1,   0,     rises,
                                    counted, set_back, {0}, 20.55, .boolean = 1};
    rc_options options = options_of(&machine, RC_RK4);
    rc_simulation* simulation;
    rc_statistics statistics;
    options.fixed_step = 1;
    options.step = 0.1;
    options.event_tolerance = 1e-3;
    calls = 0;
    simulation = simulation_of(&machine, machine.start, &options);
    CHECK_STATUS(RC_OK, rc_run(simulation));
    statistics = statistics_of(simulation);
    CHECK(statistics.events == 20 && statistics.guard_calls == calls);
    CHECK(calls - 1 - 2 * statistics.steps <= 20 * (7 + 1));
    rc_simulation_free(simulation);
}

GUARD(square, (x[0] - 1) * (x[0] - 1))
RESET(jump, x[0] = 9)

static void a_touch_at_a_tick_is_no_crossing_for_the_signs_at_the_ends_of_steps(void)
{
    static const double steps[] = {0.25, 0.09}, ends[] = {1, 3};
    size_t k;
    for (k = 0; k < 4; ++k) {
        const struct machine machine = {
            "touch", 1, 1, 0, rises, square, jump, {0}, ends[k / 2], .tick = 1, .at_tick = nothing};
        rc_options options = options_of(&machine, RC_RK4);
        rc_simulation* simulation;
        options.detector = RC_ENDS;
        options.fixed_step = 1;
        options.step = steps[k % 2];
        simulation = simulation_of(&machine, machine.start, &options);
        CHECK_STATUS(RC_OK, rc_run(simulation));
        CHECK(rc_event_count(simulation) == 1);
        CHECK(event_at(simulation, 0).kind == RC_TIME);
        rc_simulation_free(simulation);
    }
}

static void a_sample_at_an_event_is_its_state_after_and_one_stop(void)
{
    const struct machine machine = {"clock", 1,        1,   0,     rises,
                                    until_1, set_back, {0}, 100.5, .crossing = RC_FALLING};
    rc_options options = options_of(&machine, RC_DOPRI5);
    rc_simulation* simulation;
    double samples[100];
    size_t stops = 0;
    int goes_on = 1;
    for (stops = 0; stops < 100; ++stops) samples[stops] = 1.0 + (double)stops;
    options.sample_times = samples;
    options.sample_count = 100;
    simulation = simulation_of(&machine, machine.start, &options);
    for (stops = 0;; ++stops) {
        CHECK_STATUS(RC_OK, rc_advance(simulation, &goes_on));
        if (!goes_on) break;
        CHECK(stops < 100 && rc_time(simulation) == samples[stops]);
        CHECK(rc_state(simulation)[0] == 0);
    }
    CHECK(stops == 100 && rc_event_count(simulation) == 100);
    rc_simulation_free(simulation);
}

FLOW(falls, d[0] = -1)
FLOW(flow_fails, d[0] = t < 0.5 ? -1 : NAN)
GUARD(place, x[0])
GUARD(guard_fails, t < 0.5 ? x[0] : NAN)
GUARD(above_half, x[0] - 0.5)
RESET(reset_fails, x[0] = NAN)

static void a_run_says_which_function_was_not_finite(void)
{
    static const struct machine machines[] = {
        {"the flow", 1, 1, 0, flow_fails, place, set_back, {1}, 2, .crossing = RC_FALLING},
        {"guard 0", 1, 1, 0, falls, guard_fails, set_back, {1}, 2, .crossing = RC_FALLING},
        {"the reset of guard 0",
         1,
         1,
         0,
         falls,
         above_half,
         reset_fails,
         {1},
         2,
         .crossing = RC_FALLING}};
    size_t k;
    for (k = 0; k < 3; ++k) {
        rc_options options = options_of(&machines[k], RC_RK4);
        rc_simulation* simulation;
        options.fixed_step = 1;
        options.step = 0.1;
        simulation = simulation_of(&machines[k], machines[k].start, &options);
        CHECK_STATUS(RC_OK, rc_run(simulation));
        CHECK(rc_outcome(simulation) == RC_NON_FINITE);
        CHECK(strcmp(rc_reason(simulation), machines[k].name) == 0);
        rc_simulation_free(simulation);
    }
}

/* Hops from place to place, lower each time and at other weights; the rounding of the place at 1
 * takes 2.9e-8 s of their time. */
static const double places[] = {0.02904080340079248, 1, 0};
static const double restitutions[] = {0.6714, 0.9034, 0.4051};
static const double weights[] = {5.3168, 5.5902, 8.9261, 0};
FLOW(hops, d[0] = x[1]; d[1] = -weights[m])
GUARD(above_place, x[0] - places[i])
RESET(next_place, *m = (rc_mode)((i + 1) % 3); x[0] = places[*m]; x[1] *= -restitutions[i])
static int of_its_place(size_t i, rc_mode m)
{
    return i == m;
}
REST(remain, *m = 3)

static void a_limit_lies_within_its_error_where_rounding_takes_the_last_flights(void)
{
    const struct machine machine = {"hops",
                                    2,
                                    3,
                                    4,
                                    hops,
                                    above_place,
                                    next_place,
                                    {places[0], 1.2},
                                    3,
                                    .rest = remain,
                                    .enabled = of_its_place};
    rc_options options = options_of(&machine, RC_DOPRI5);
    rc_simulation* simulation;
    double limit = 0, v = 1.2;
    size_t k;
    for (k = 0; v > 1e-40; k = (k + 1) % 3) {
        limit += 2 * v / weights[k];
        v *= restitutions[k];
    }
    options.rtol = 1e-12;
    options.atol = 1e-14;
    simulation = simulation_of(&machine, machine.start, &options);
    CHECK_STATUS(RC_OK, rc_run(simulation));
    for (k = 0; event_at(simulation, k).kind != RC_ACCUMULATION;) ++k;
    CHECK(fabs(event_at(simulation, k).t - limit) <= event_at(simulation, k).error);
    CHECK(event_at(simulation, k).error <= 1e-6);
    rc_simulation_free(simulation);
}

FLOW(stands, d[0] = 0)

static void a_run_without_an_end_that_nothing_ends_stalls(void)
{
    static const struct machine machines[] = {
        {"stands", 1, 1, 0, stands, place, set_back, {1}, INFINITY, .stop_after = 1},
        {"recedes", 1, 1, 0, rises, place, set_back, {1}, INFINITY, .stop_after = 1}};
    size_t k;
    for (k = 0; k < 2; ++k) {
        const rc_options options = options_of(&machines[k], RC_DOPRI5);
        rc_simulation* const simulation = simulation_of(&machines[k], machines[k].start, &options);
        CHECK_STATUS(RC_OK, rc_run(simulation));
        CHECK(rc_outcome(simulation) == RC_STALLED);
        rc_simulation_free(simulation);
    }
}

int main(void)
{
    the_event_tolerance_saves_calls_of_boolean_guards();
    a_touch_at_a_tick_is_no_crossing_for_the_signs_at_the_ends_of_steps();
    a_sample_at_an_event_is_its_state_after_and_one_stop();
    a_run_says_which_function_was_not_finite();
    a_run_without_an_end_that_nothing_ends_stalls();
    a_limit_lies_within_its_error_where_rounding_takes_the_last_flights();
    return 0;
}
