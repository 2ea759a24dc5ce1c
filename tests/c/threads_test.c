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

/* Waits in its callback until it may go on. */
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
    runs_simulations_of_one_system_at_once();
    keeps_a_message_for_each_thread();
    return 0;
}
