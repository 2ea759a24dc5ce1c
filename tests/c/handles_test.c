/* Handles that have been freed, with a library that keeps them, as its debug builds do. */
#include <math.h>

#include "ball.h"

int main(void)
{
    const rc_callbacks callbacks = ball_callbacks();
    const rc_options options = options_until(20.5);
    const double start[2] = {10, 0};
    rc_system* system;
    rc_simulation* simulation;
    rc_simulation* other;
    rc_event event;
    event.size = sizeof event;
    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
    CHECK_STATUS(RC_OK, rc_simulation_new(system, start, 2, &options, &simulation));
    rc_system_free(system);
    CHECK_REFUSED(RC_BAD_HANDLE, rc_simulation_new(system, start, 2, &options, &other), "freed");
    rc_system_free(system); /* once more: nothing happens */
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(rc_event_count(simulation) == 13);
    CHECK_STATUS(RC_OK, rc_simulation_free(simulation));
    CHECK_REFUSED(RC_BAD_HANDLE, rc_run(simulation), "freed");
    CHECK_STATUS(RC_BAD_HANDLE, rc_simulation_free(simulation));
    CHECK_STATUS(RC_BAD_HANDLE, rc_event_at(simulation, 0, &event));
    CHECK_STATUS(RC_BAD_HANDLE, rc_cancel(simulation));
    CHECK(isnan(rc_time(simulation)) && rc_state(simulation) == NULL);
    CHECK(rc_event_count(simulation) == 0);

    {
        rc_monitor* monitor;
        rc_monitor* another;
        rc_verdict verdict;
        CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
        CHECK_STATUS(RC_OK, rc_monitor_new(system, NULL, &monitor));
        rc_system_free(system);
        CHECK_REFUSED(RC_BAD_HANDLE, rc_monitor_new(system, NULL, &another), "freed");
        CHECK_STATUS(RC_OK, rc_monitor_start(monitor, 0, start, NULL, 2, 0, 0.1, &verdict));
        CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
        CHECK_REFUSED(RC_BAD_HANDLE, rc_monitor_start(monitor, 0, start, NULL, 2, 0, 1, &verdict),
                      "rc_monitor: the handle has been freed");
        CHECK(verdict == RC_NO_VERDICT);
        CHECK_STATUS(RC_BAD_HANDLE, rc_monitor_free(monitor));
        CHECK_STATUS(RC_BAD_HANDLE, rc_monitor_clear_events(monitor));
        CHECK(rc_monitor_state(monitor) == NULL && isnan(rc_monitor_must_stop_at(monitor)));
    }
    return 0;
}
