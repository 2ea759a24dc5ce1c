/* A program that was compiled with the header of the first release, and runs with this library;
 * and one of fewer fields still, whose missing options have their defaults. */
#include <math.h>

#include "ball.h"
#include "first_release.h"

static void runs_a_program_of_the_first_release(void)
{
    const rc_callbacks now = ball_callbacks();
    const double start[2] = {10, 0};
    struct first_callbacks callbacks;
    struct first_options options;
    struct first_guard_info info;
    struct first_event event;
    struct first_statistics statistics;
    rc_system* system;
    rc_simulation* simulation;
    CHECK(sizeof callbacks <= sizeof now && sizeof options <= sizeof(rc_options));
    memcpy(&callbacks, &now, sizeof callbacks);
    callbacks.size = sizeof callbacks;
    memset(&info, 0, sizeof info);
    info.size = sizeof info;
    info.stop_after = 5;
    callbacks.guard_infos = &info;
    CHECK_STATUS(RC_OK, rc_system_new((const rc_callbacks*)&callbacks, &system));
    CHECK_STATUS(RC_OK, rc_options_default((rc_options*)&options, sizeof options));
    CHECK(options.size == sizeof options && options.rtol == 1e-8 && isnan(options.t_end));
    options.t_end = 20.5;
    CHECK_STATUS(RC_OK,
                 rc_simulation_new(system, start, 2, (const rc_options*)&options, &simulation));
    CHECK_STATUS(RC_OK, rc_run(simulation));
    event.size = sizeof event;
    CHECK_STATUS(RC_OK, rc_event_at(simulation, 4, (rc_event*)&event));
    CHECK(event.size == sizeof event && event.t == rc_time(simulation));
    statistics.size = sizeof statistics;
    CHECK_STATUS(RC_OK, rc_get_statistics(simulation, (rc_statistics*)&statistics));
    CHECK(statistics.events == 5 && statistics.guard == 0);
    rc_simulation_free(simulation);
    rc_system_free(system);
}

static int fall_by(void* user, double s, double* x, size_t n)
{
    (void)user, (void)n;
    x[0] = 10 - 9.81 / 2 * s * s;
    x[1] = -9.81 * s;
    return 0;
}

static void runs_a_host_of_the_first_release(void)
{
    const rc_callbacks callbacks = ball_callbacks();
    const double start[2] = {10, 0}, end[2] = {10 - 9.81 * 2, -9.81 * 2};
    const double rate0[2] = {0, -9.81}, rate1[2] = {-9.81 * 2, -9.81};
    struct first_monitor_options options;
    struct first_host_step step;
    struct first_cut cut;
    rc_system* system;
    rc_monitor* monitor;
    rc_verdict verdict;
    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
    CHECK_STATUS(RC_OK, rc_monitor_options_default((rc_monitor_options*)&options, sizeof options));
    CHECK(options.size == sizeof options && options.look_inside == 1 && options.gate == NULL);
    CHECK_STATUS(RC_OK, rc_monitor_new(system, (const rc_monitor_options*)&options, &monitor));
    rc_system_free(system);
    CHECK_STATUS(RC_OK, rc_monitor_start(monitor, 0, start, rate0, 2, 0, 2, &verdict));
    memset(&step, 0, sizeof step);
    step.size = sizeof step;
    step.n = 2;
    step.h = 2;
    step.x0 = start;
    step.x1 = end;
    step.rate0 = rate0;
    step.rate1 = rate1;
    step.interpolate = fall_by;
    CHECK_STATUS(RC_OK, rc_monitor_examine(monitor, (const rc_host_step*)&step, &verdict));
    CHECK(verdict == RC_CUT);
    cut.size = sizeof cut;
    CHECK_STATUS(RC_OK, rc_monitor_cut(monitor, (rc_cut*)&cut));
    CHECK(cut.size == sizeof cut && fabs(cut.t - sqrt(2 * 10 / 9.81)) < 1e-14);
    CHECK(cut.fired_count == 1 && cut.fired[0] == 0 && cut.state_changed == 1);
    CHECK(cut.after[1] == -0.9 * cut.before[1] && cut.mode_after == 0);
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
}

static void takes_missing_fields_at_their_defaults(void)
{
    const double start[2] = {10, 0};
    rc_callbacks callbacks = ball_callbacks();
    rc_options options;
    rc_event event;
    rc_system* system;
    rc_simulation* simulation;
    /* As if everything behind had been added later. */
    callbacks.size = offsetof(rc_callbacks, next_time_event);
    callbacks.next_time_event = (rc_time_event_fn)(void (*)(void))ball_flow;
    memset(&options, 0xff, sizeof options);
    CHECK_STATUS(RC_OK, rc_options_default(&options, offsetof(rc_options, event_tolerance)));
    CHECK(isnan(options.event_tolerance)); /* not written to */
    options.t_end = 20.5;
    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
    CHECK_STATUS(RC_OK, rc_simulation_new(system, start, 2, &options, &simulation));
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(rc_event_count(simulation) == 13);
    memset(&event, 0xff, sizeof event);
    event.size = offsetof(rc_event, before);
    CHECK_STATUS(RC_OK, rc_event_at(simulation, 12, &event));
    CHECK(event.t > 19 && event.size == offsetof(rc_event, before));
    CHECK(isnan(event.slope)); /* not written to */
    rc_simulation_free(simulation);
    rc_system_free(system);
}

int main(void)
{
    runs_a_program_of_the_first_release();
    runs_a_host_of_the_first_release();
    takes_missing_fields_at_their_defaults();
    return 0;
}
