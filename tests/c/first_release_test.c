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
    CHECK_STATUS(RC_OK, rc_simulation_new(system, start, 2, (const rc_options*)&options,
                                          &simulation));
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
    takes_missing_fields_at_their_defaults();
    return 0;
}
