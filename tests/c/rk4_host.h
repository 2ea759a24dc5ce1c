/* A host: the classical Runge-Kutta method with fixed steps, and nothing that knows of events. */
#ifndef RICOCHET_TESTS_C_RK4_HOST_H
#define RICOCHET_TESTS_C_RK4_HOST_H

#include <math.h>

#include "ball.h"

enum { most_components = 4, most_cuts = 64 };

struct host {
    const rc_callbacks* system; /* of which it calls the flow */
    rc_mode mode;
    double t;
    double x[most_components], rate[most_components];   /* where it is */
    double x1[most_components], rate1[most_components]; /* the end of the current step */
    double h;
    int restep_error; /* that its restep returns; 0: none */
};

static inline void host_flow(const struct host* host, const double* x, double* dxdt)
{
    const rc_callbacks* of = host->system;
    CHECK(of->flow(of->user, host->mode, host->t, x, dxdt, of->dimension) == 0);
}

static inline void host_place(const struct host* host, double s, double* x)
{
    double at[most_components] = {0}, k2[most_components], k3[most_components];
    double k4[most_components];
    const size_t n = host->system->dimension;
    size_t i;
    for (i = 0; i < n; ++i) at[i] = host->x[i] + s / 2 * host->rate[i];
    host_flow(host, at, k2);
    for (i = 0; i < n; ++i) at[i] = host->x[i] + s / 2 * k2[i];
    host_flow(host, at, k3);
    for (i = 0; i < n; ++i) at[i] = host->x[i] + s * k3[i];
    host_flow(host, at, k4);
    for (i = 0; i < n; ++i) {
        x[i] = host->x[i] + s * ((host->rate[i] + 2 * (k2[i] + k3[i]) + k4[i]) / 6);
    }
}

static inline int host_restep(void* user, double s, double* x, size_t n)
{
    const struct host* host = user;
    (void)n;
    host_place(host, s, x);
    return host->restep_error;
}

static inline void host_restart(struct host* host, double t, const double* x, rc_mode mode)
{
    host->t = t;
    host->mode = mode;
    memcpy(host->x, x, host->system->dimension * sizeof *x);
    host_flow(host, host->x, host->rate);
}

/* Takes a step of length h, which is not accepted yet, and shows it. */
static inline rc_host_step host_step(struct host* host, double h)
{
    rc_host_step step;
    host->h = h;
    host_place(host, h, host->x1);
    host_flow(host, host->x1, host->rate1);
    memset(&step, 0, sizeof step);
    step.size = sizeof step;
    step.n = host->system->dimension;
    step.t0 = host->t;
    step.h = h;
    step.x0 = host->x;
    step.x1 = host->x1;
    step.rate0 = host->rate;
    step.rate1 = host->rate1;
    step.user = host;
    step.restep = host_restep;
    return step;
}

static inline void host_accept(struct host* host)
{
    host->t += host->h;
    memcpy(host->x, host->x1, sizeof host->x);
    memcpy(host->rate, host->rate1, sizeof host->rate);
}

/* What a host has met. */
struct met {
    size_t cuts;
    double t[most_cuts], after[most_cuts][most_components];
    size_t fired[most_cuts], first[most_cuts];
    int on_time[most_cuts], accumulation[most_cuts], state_changed[most_cuts];
    rc_mode mode[most_cuts];
};

static inline rc_cut cut_of(rc_monitor* monitor)
{
    rc_cut cut;
    cut.size = sizeof cut;
    CHECK_STATUS(RC_OK, rc_monitor_cut(monitor, &cut));
    return cut;
}

/* Goes on to t_end, in steps of h, from where a verdict has left host and monitor. */
static inline rc_verdict host_run(struct host* host, rc_monitor* monitor, rc_verdict verdict,
                                  double t_end, double h, struct met* met)
{
    const size_t n = host->system->dimension;
    for (;;) {
        rc_host_step step;
        double end;
        while (verdict == RC_CUT) {
            const rc_cut cut = cut_of(monitor);
            CHECK(met->cuts < most_cuts);
            met->t[met->cuts] = cut.t;
            memcpy(met->after[met->cuts], cut.after, n * sizeof(double));
            met->fired[met->cuts] = cut.fired_count;
            met->first[met->cuts] = cut.fired_count > 0 ? cut.fired[0] : RC_NO_GUARD;
            met->on_time[met->cuts] = cut.on_time;
            met->accumulation[met->cuts] = cut.accumulation;
            met->state_changed[met->cuts] = cut.state_changed;
            met->mode[met->cuts++] = cut.mode_after;
            host_restart(host, cut.t, cut.after, cut.mode_after);
            CHECK_STATUS(RC_OK, rc_monitor_resume(monitor, host->rate, n, h, &verdict));
            /* What a rest holds stands still from here on. */
            if (rc_monitor_held(monitor, NULL)) host_flow(host, host->x, host->rate);
        }
        if (verdict == RC_RESTS && rc_monitor_must_stop_at(monitor) <= t_end) {
            const double until = rc_monitor_must_stop_at(monitor);
            CHECK_STATUS(RC_OK, rc_monitor_hold(monitor, until, &verdict));
            continue;
        }
        if (verdict != RC_STANDS || host->t >= t_end) return verdict;
        end = fmin(t_end, rc_monitor_must_stop_at(monitor));
        step = host_step(host, h * (1 + 1e-9) < end - host->t ? h : end - host->t);
        CHECK_STATUS(RC_OK, rc_monitor_examine(monitor, &step, &verdict));
        if (verdict == RC_STANDS) host_accept(host);
    }
}

static inline rc_monitor* monitor_of(const rc_callbacks* callbacks,
                                     const rc_monitor_options* options)
{
    rc_system* system;
    rc_monitor* monitor;
    CHECK_STATUS(RC_OK, rc_system_new(callbacks, &system));
    CHECK_STATUS(RC_OK, rc_monitor_new(system, options, &monitor));
    rc_system_free(system); /* the monitor keeps what it needs */
    return monitor;
}

/* Places the host, and starts the monitor there. */
static inline rc_verdict host_start(struct host* host, rc_monitor* monitor,
                                    const rc_callbacks* system, double t, const double* x, double h)
{
    rc_verdict verdict;
    memset(host, 0, sizeof *host);
    host->system = system;
    host_restart(host, t, x, 0);
    CHECK_STATUS(RC_OK,
                 rc_monitor_start(monitor, t, x, host->rate, system->dimension, 0, h, &verdict));
    return verdict;
}

#endif
