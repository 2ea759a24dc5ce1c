/* Two threads at one simulation are refused; at simulations of one system they run at once. */
#define _POSIX_C_SOURCE 200809L
#include <pthread.h>
#include <sched.h>

#include "ball.h"

/* Set by the other thread, or read by it, under a lock: C99 has no atomics. */
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static int inside, go_on;

static int get(const int* flag)
{
    int value;
    pthread_mutex_lock(&lock);
    value = *flag;
    pthread_mutex_unlock(&lock);
    return value;
}
static void set(int* flag)
{
    pthread_mutex_lock(&lock);
    *flag = 1;
    pthread_mutex_unlock(&lock);
}

/* Waits in its callback until it may continue. */
static int waiting_flow(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    if (t > 1) {
        set(&inside);
        while (!get(&go_on)) sched_yield();
    }
    return ball_flow(user, mode, t, x, dxdt, n);
}

static void* run_it(void* simulation)
{
    CHECK_STATUS(RC_OK, rc_run(simulation));
    return NULL;
}

static void refuses_a_second_thread(void)
{
    rc_callbacks callbacks = ball_callbacks();
    const rc_options options = options_until(20.5);
    rc_simulation* simulation;
    pthread_t thread;
    rc_event event;
    char bytes[16];
    size_t size = sizeof bytes;
    event.size = sizeof event;
    callbacks.flow = waiting_flow;
    simulation = start_ball(&callbacks, &options);
    CHECK(pthread_create(&thread, NULL, run_it, simulation) == 0);
    while (!get(&inside)) sched_yield();
    CHECK_REFUSED(RC_BUSY, rc_run(simulation), "in use by another call");
    CHECK_STATUS(RC_BUSY, rc_step(simulation, NULL));
    CHECK_STATUS(RC_BUSY, rc_advance(simulation, NULL));
    CHECK_STATUS(RC_BUSY, rc_simulation_free(simulation));
    CHECK_STATUS(RC_BUSY, rc_event_at(simulation, 0, &event));
    CHECK_STATUS(RC_BUSY, rc_save(simulation, bytes, &size));
    CHECK_STATUS(RC_BUSY, rc_restore(simulation, bytes, size));
    CHECK(rc_state(simulation) == NULL && rc_event_count(simulation) == 0);
    CHECK_STATUS(RC_OK, rc_cancel(simulation));
    set(&go_on);
    CHECK(pthread_join(thread, NULL) == 0);
    CHECK(rc_outcome(simulation) == RC_CANCELLED);
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(rc_event_count(simulation) == 13);
    CHECK_STATUS(RC_OK, rc_simulation_free(simulation));
}

/* --- monitors --- */

static const double start_of_fall[2] = {10, 0};

/* Waits in its callback until it may continue. */
static int waiting_step(void* user, double s, double* x, size_t n)
{
    (void)user, (void)n;
    set(&inside);
    while (!get(&go_on)) sched_yield();
    x[0] = 10 - 9.81 / 2 * s * s;
    x[1] = -9.81 * s;
    return 0;
}

static void* examine_it(void* monitor)
{
    static const double end[2] = {10 - 9.81 * 2, -9.81 * 2};
    static const double rate0[2] = {0, -9.81}, rate1[2] = {-9.81 * 2, -9.81};
    rc_host_step step;
    rc_verdict verdict;
    memset(&step, 0, sizeof step);
    step.size = sizeof step;
    step.n = 2;
    step.h = 2;
    step.x0 = start_of_fall, step.x1 = end, step.rate0 = rate0, step.rate1 = rate1;
    step.restep = waiting_step;
    CHECK_STATUS(RC_OK, rc_monitor_examine(monitor, &step, &verdict));
    CHECK(verdict == RC_CUT);
    return NULL;
}

static void refuses_a_second_thread_at_a_monitor(void)
{
    const rc_callbacks callbacks = ball_callbacks();
    rc_system* system;
    rc_monitor* monitor;
    rc_verdict verdict;
    rc_cut cut;
    pthread_t thread;
    size_t size = 0;
    cut.size = sizeof cut;
    inside = go_on = 0;
    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
    CHECK_STATUS(RC_OK, rc_monitor_new(system, NULL, &monitor));
    rc_system_free(system);
    CHECK_STATUS(RC_OK, rc_monitor_start(monitor, 0, start_of_fall, NULL, 2, 0, 2, &verdict));
    CHECK(pthread_create(&thread, NULL, examine_it, monitor) == 0);
    while (!get(&inside)) sched_yield();
    CHECK_REFUSED(RC_BUSY, rc_monitor_resume(monitor, NULL, 0, 1, &verdict),
                  "rc_monitor: found it in use by another call");
    CHECK(verdict == RC_NO_VERDICT);
    CHECK_STATUS(RC_BUSY, rc_monitor_start(monitor, 0, start_of_fall, NULL, 2, 0, 2, &verdict));
    CHECK_STATUS(RC_BUSY, rc_monitor_cut(monitor, &cut));
    CHECK_STATUS(RC_BUSY, rc_monitor_save(monitor, NULL, &size));
    CHECK_STATUS(RC_BUSY, rc_monitor_free(monitor));
    CHECK(rc_monitor_state(monitor) == NULL && rc_monitor_event_count(monitor) == 0);
    set(&go_on);
    CHECK(pthread_join(thread, NULL) == 0);
    CHECK_STATUS(RC_OK, rc_monitor_cut(monitor, &cut)); /* the next thread may use it */
    CHECK(cut.fired_count == 1);
    CHECK_STATUS(RC_OK, rc_monitor_free(monitor));
}

enum { threads = 4 };

static void runs_simulations_of_one_system_at_once(void)
{
    const rc_callbacks callbacks = ball_callbacks();
    const rc_options options = options_until(20.5);
    const double start[2] = {10, 0};
    rc_system* system;
    rc_simulation* simulations[threads];
    pthread_t running[threads];
    int i;
    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
    for (i = 0; i < threads; ++i) {
        CHECK_STATUS(RC_OK, rc_simulation_new(system, start, 2, &options, &simulations[i]));
    }
    rc_system_free(system);
    for (i = 0; i < threads; ++i) {
        CHECK(pthread_create(&running[i], NULL, run_it, simulations[i]) == 0);
    }
    for (i = 0; i < threads; ++i) CHECK(pthread_join(running[i], NULL) == 0);
    for (i = 0; i < threads; ++i) {
        CHECK(memcmp(rc_state(simulations[i]), rc_state(simulations[0]), sizeof start) == 0);
    }
    for (i = 0; i < threads; ++i) CHECK_STATUS(RC_OK, rc_simulation_free(simulations[i]));
}

static void* fail_here(void* unused)
{
    (void)unused;
    CHECK(strcmp(rc_last_error(), "") == 0);
    CHECK_REFUSED(RC_INVALID, rc_system_new(NULL, NULL), "null");
    return NULL;
}

static void keeps_a_message_for_each_thread(void)
{
    pthread_t thread;
    CHECK_REFUSED(RC_BAD_HANDLE, rc_run(NULL), "rc_simulation");
    CHECK(pthread_create(&thread, NULL, fail_here, NULL) == 0);
    CHECK(pthread_join(thread, NULL) == 0);
    CHECK(strstr(rc_last_error(), "rc_simulation"));
}

int main(void)
{
    refuses_a_second_thread();
    refuses_a_second_thread_at_a_monitor();
    runs_simulations_of_one_system_at_once();
    keeps_a_message_for_each_thread();
    return 0;
}
