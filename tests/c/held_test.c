/* What a rest holds, and what goes on from there: runs that continue, restarts, vetoes, snapshots.
 */
#include "machine.h"

/* A ball thrown sideways above a floor, (x, y, x', y'). */
FLOW(is_thrown, d[0] = x[2]; d[1] = x[3]; d[2] = 0; d[3] = -10)
GUARD(height, x[1])
RESET(bounce, x[1] = 0; x[3] *= -0.5)
REST(slide, x[1] = x[3] = 0)
static int before_2_s(double t, const double* x)
{
    (void)x;
    return t < 2;
}
static int left_of_2_m(double t, const double* x)
{
    (void)t;
    return x[0] < 2;
}

static struct machine thrown(double t_end)
{
    struct machine machine = {
        "thrown", 4, 1, 0, is_thrown, height, bounce, {0, 0.1, 1, 0}, t_end, .rest = slide};
    return machine;
}

static size_t count_of(rc_simulation* simulation, int32_t kind)
{
    size_t k, count = 0;
    for (k = 0; k < rc_event_count(simulation); ++k) {
        count += event_at(simulation, k).kind == kind;
    }
    return count;
}

GUARD(height_above_1, x[1] - 1)

static void a_ball_that_begins_at_rest_at_a_height_says_that_it_fell(void)
{
    static const double at_rest[4] = {0, 1, 1, 0};
    struct machine machine = thrown(4);
    rc_options options = options_of(&machine, RC_DOPRI5);
    rc_simulation* simulation;
    machine.guard = height_above_1;
    simulation = simulation_of(&machine, at_rest, &options);
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(statistics_of(simulation).armed_beyond == 1);
    CHECK(strstr(rc_describe(simulation), "guard 0 began on its surface and moved on beyond it"));
    rc_simulation_free(simulation);
}

static void a_run_that_continues_from_a_rest_is_held_again(void)
{
    static const int32_t methods[] = {RC_DOPRI5, RC_FEHLBERG78};
    size_t k;
    for (k = 0; k < 2; ++k) {
        const struct machine machine = thrown(4);
        rc_options options = options_of(&machine, methods[k]);
        rc_simulation *first, *simulation;
        options.t_end = 1.5;
        first = simulation_of(&machine, machine.start, &options);
        CHECK_STATUS(RC_OK, rc_run(first));
        options.t_start = 1.5;
        options.t_end = 4;
        options.continues = 1;
        simulation = simulation_of(&machine, rc_state(first), &options);
        CHECK_STATUS(RC_OK, rc_run(simulation));
        CHECK(count_of(simulation, RC_ACCUMULATION) == 0);
        CHECK(statistics_of(simulation).armed_beyond == 0);
        CHECK(fabs(rc_state(simulation)[0] - 4) < 1e-12);
        CHECK(rc_state(simulation)[1] == 0 && rc_state(simulation)[3] == 0);
        rc_simulation_free(first);
        rc_simulation_free(simulation);
    }
}

static void a_run_that_begins_at_rest_says_why_it_moves_on(void)
{
    const double at_rest[4] = {1.5, 0, 1, 0};
    const struct machine machine = thrown(2.5);
    const rc_options options = options_of(&machine, RC_DOPRI5);
    rc_simulation* simulation = simulation_of(&machine, at_rest, &options);
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(rc_state(simulation)[1] < -1);
    CHECK(strstr(rc_describe(simulation),
                 "guard 0 began on its surface and moved on beyond it, "
                 "which is no event (unilateral and at_start give it one"));
    CHECK(!strstr(rc_describe(simulation), "began beyond"));
    rc_simulation_free(simulation);
}

static void a_restart_of_a_rest_is_held_unless_it_moves_what_is_held(void)
{
    const struct machine machine = thrown(4);
    const rc_options options = options_of(&machine, RC_DOPRI5);
    const double faster[4] = {1.5, 0, 2, 0}, through[4] = {1.5, 0, 1, -1};
    rc_simulation* simulation = simulation_of(&machine, machine.start, &options);
    while (rc_time(simulation) < 1.5) CHECK_STATUS(RC_OK, rc_step(simulation, NULL));
    CHECK_STATUS(RC_OK, rc_restart(simulation, 1.5, faster, 4, 0));
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(fabs(rc_state(simulation)[0] - 6.5) < 1e-12 && rc_state(simulation)[1] == 0);
    CHECK_STATUS(RC_OK, rc_restart(simulation, 1.5, through, 4, 0));
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(statistics_of(simulation).armed_beyond == 1 && rc_state(simulation)[1] < -1);
    rc_simulation_free(simulation);
}

/* The platform is there until 2 s, or as far as x = 2; a second of free fall follows. */
static void a_veto_sets_the_ball_free(void)
{
    int (*const vetoes[])(double, const double*) = {before_2_s, left_of_2_m};
    size_t k;
    for (k = 0; k < 2; ++k) {
        struct machine machine = thrown(3);
        rc_options options = options_of(&machine, RC_DOPRI5);
        rc_simulation* simulation;
        machine.allowed = vetoes[k];
        simulation = simulation_of(&machine, machine.start, &options);
        CHECK_STATUS(RC_OK, rc_run(simulation));
        CHECK(count_of(simulation, RC_MODE) == 1);
        CHECK(fabs(rc_state(simulation)[0] - 3) < 1e-12);
        CHECK(fabs(rc_state(simulation)[1] + 5) < 1e-7);
        rc_simulation_free(simulation);
    }
}

/* The first ball is lifted off its floor while the second still bounces. */
FLOW(lifted, d[0] = x[2]; d[1] = x[3]; d[2] = 10 * fmin(t - 1, 0.1); d[3] = -1)
GUARD(heights, x[i])
RESET(bounces, x[i] = 0; x[i + 2] *= i == 0 ? -0.5 : -0.9)
REST(lie, x[i] = x[i + 2] = 0)

static void a_run_that_is_saved_after_a_release_is_the_same_run(void)
{
    const struct machine machine = {"balls", 4,       2,           0, lifted,
                                    heights, bounces, {0.01, 0.1}, 3, .rest = lie};
    const rc_options options = options_of(&machine, RC_DOPRI5);
    static char bytes[1 << 16];
    size_t size = sizeof bytes;
    rc_simulation *first, *second;
    first = simulation_of(&machine, machine.start, &options);
    second = simulation_of(&machine, machine.start, &options);
    while (count_of(first, RC_MODE) == 0) CHECK_STATUS(RC_OK, rc_step(first, NULL));
    CHECK_STATUS(RC_OK, rc_save(first, bytes, &size));
    CHECK_STATUS(RC_OK, rc_restore(second, bytes, size));
    CHECK_STATUS(RC_OK, rc_run(first));
    CHECK_STATUS(RC_OK, rc_run(second));
    CHECK(memcmp(rc_state(first), rc_state(second), 4 * sizeof(double)) == 0);
    rc_simulation_free(first);
    rc_simulation_free(second);
}

int main(void)
{
    a_run_that_continues_from_a_rest_is_held_again();
    a_run_that_begins_at_rest_says_why_it_moves_on();
    a_ball_that_begins_at_rest_at_a_height_says_that_it_fell();
    a_restart_of_a_rest_is_held_unless_it_moves_what_is_held();
    a_veto_sets_the_ball_free();
    a_run_that_is_saved_after_a_release_is_the_same_run();
    return 0;
}
