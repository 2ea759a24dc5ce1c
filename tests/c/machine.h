/* Small systems put together from functions without the arguments that these do not need. */
#ifndef RICOCHET_TESTS_C_MACHINE_H
#define RICOCHET_TESTS_C_MACHINE_H

#include <math.h>

#include "ball.h"

enum { most_times = 5 };

/* What a run of it must show; numbers that are not given are zero. */
struct expected {
    rc_outcome_code outcome;
    size_t events;            /* with those of time events; 0: not compared */
    double times[most_times]; /* of them, or of accumulations where `accumulates` is set */
    int accumulates;
    rc_mode mode;
    double x[4];
};

struct machine {
    const char* name;
    size_t n, guards, modes;
    void (*flow)(rc_mode m, double t, const double* x, double* d);
    double (*guard)(size_t i, rc_mode m, double t, const double* x);
    void (*reset)(size_t i, rc_mode* m, double t, double* x);
    double start[6], t_end;
    void (*rest)(size_t i, rc_mode* m, double* x);
    int (*enabled)(size_t i, rc_mode m);
    int (*allowed)(double t, const double* x); /* `enabled` of every crossing */
    double tick;                               /* [s] above 0 */
    void (*at_tick)(rc_mode* m, double* x);
    int32_t crossing, boolean;
    size_t recorded; /* the first of the guards, which only record */
    uint64_t stop_after;
    double window; /* [s] */
    struct expected expected;
};

#define UNUSED (void)m, (void)t, (void)x
#define FLOW(name, body)                                              \
    static void name(rc_mode m, double t, const double* x, double* d) \
    {                                                                 \
        UNUSED;                                                       \
        body;                                                         \
    }
#define GUARD(name, value)                                             \
    static double name(size_t i, rc_mode m, double t, const double* x) \
    {                                                                  \
        UNUSED, (void)i;                                               \
        return value;                                                  \
    }
#define RESET(name, body)                                       \
    static void name(size_t i, rc_mode* m, double t, double* x) \
    {                                                           \
        UNUSED, (void)i;                                        \
        body;                                                   \
    }
#define TICK(name, body)                    \
    static void name(rc_mode* m, double* x) \
    {                                       \
        (void)m, (void)x;                   \
        body;                               \
    }
#define REST(name, body)                              \
    static void name(size_t i, rc_mode* m, double* x) \
    {                                                 \
        (void)i, (void)m, (void)x;                    \
        body;                                         \
    }

static inline const struct machine* of(void* user)
{
    return user;
}
static inline int flow_of(void* user, rc_mode mode, double t, const double* x, double* dxdt,
                          size_t n)
{
    (void)n;
    of(user)->flow(mode, t, x, dxdt);
    return 0;
}
static inline int guard_of(void* user, size_t which, rc_mode mode, double t, const double* x,
                           size_t n, double* g)
{
    (void)n;
    *g = of(user)->guard(which, mode, t, x);
    return 0;
}
static inline int reset_of(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)n;
    of(user)->reset(which, mode, t, x);
    return 0;
}
static inline int rest_of(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)t, (void)n;
    of(user)->rest(which, mode, x);
    return 0;
}
static inline int enabled_of(void* user, size_t which, rc_mode mode, int* enabled)
{
    *enabled = of(user)->enabled(which, mode);
    return 0;
}
static inline int allowed_of(void* user, size_t which, rc_mode mode, double t, const double* x,
                             size_t n, int* enabled)
{
    (void)which, (void)mode, (void)n;
    *enabled = of(user)->allowed(t, x);
    return 0;
}
static inline int tick_of(void* user, rc_mode* mode, double t, double* x, size_t n)
{
    (void)t, (void)n;
    of(user)->at_tick(mode, x);
    return 0;
}

static inline rc_options options_of(const struct machine* machine, int32_t method)
{
    rc_options options = options_until(machine->t_end);
    options.method = method;
    options.rtol = 1e-10;
    options.atol = 1e-12;
    options.event_window = machine->window;
    return options;
}

static inline rc_simulation* simulation_of(const struct machine* machine, const double* start,
                                           const rc_options* options)
{
    rc_guard_info infos[6];
    rc_callbacks callbacks = ball_callbacks();
    rc_system* system;
    rc_simulation* simulation;
    size_t i;
    memset(infos, 0, sizeof infos);
    for (i = 0; i < machine->guards; ++i) {
        infos[i].size = sizeof infos[i];
        infos[i].crossing = machine->crossing;
        infos[i].boolean = machine->boolean;
        infos[i].notifies = i < machine->recorded;
        infos[i].stop_after = machine->stop_after;
    }
    callbacks.dimension = machine->n;
    callbacks.guard_count = machine->guards;
    callbacks.mode_count = machine->modes;
    callbacks.guard_infos = infos;
    callbacks.user = (void*)machine;
    callbacks.flow = flow_of;
    callbacks.guard = guard_of;
    callbacks.reset = reset_of;
    callbacks.rest = machine->rest ? rest_of : NULL;
    callbacks.enabled_in = machine->enabled ? enabled_of : NULL;
    callbacks.enabled = machine->allowed ? allowed_of : NULL;
    if (machine->tick > 0) {
        callbacks.time_events = &machine->tick;
        callbacks.time_event_count = 1;
        callbacks.time_reset = tick_of;
    }
    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &system));
    CHECK_STATUS(RC_OK, rc_simulation_new(system, start, machine->n, options, &simulation));
    rc_system_free(system);
    return simulation;
}

#endif
