/* A program with its own integrator, Runge-Kutta of order four with fixed steps. A ball falls from
 * 10 m and bounces; the monitor tells where a step ends at an impact. */
#include <stdio.h>
#include <string.h>

#include "ricochet/ricochet.h"

/* --- the system: x = (height [m], velocity [m/s]) --- */

static int fall(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    (void)user, (void)mode, (void)t, (void)n;
    dxdt[0] = x[1];
    dxdt[1] = -9.81;
    return 0;
}

static int height(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                  double* g)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    *g = x[0];
    return 0;
}

static int bounce(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    x[0] = 0;
    x[1] = -0.9 * x[1];
    return 0;
}

/* --- the integrator, which knows nothing of events --- */

struct integrator {
    double t, x[2], dxdt[2];
};

static void step(const struct integrator* from, double h, double* x)
{
    double at[2], k2[2], k3[2], k4[2];
    int i;
    for (i = 0; i < 2; ++i) at[i] = from->x[i] + h / 2 * from->dxdt[i];
    fall(NULL, 0, 0, at, k2, 2);
    for (i = 0; i < 2; ++i) at[i] = from->x[i] + h / 2 * k2[i];
    fall(NULL, 0, 0, at, k3, 2);
    for (i = 0; i < 2; ++i) at[i] = from->x[i] + h * k3[i];
    fall(NULL, 0, 0, at, k4, 2);
    for (i = 0; i < 2; ++i) {
        x[i] = from->x[i] + h * ((from->dxdt[i] + 2 * (k2[i] + k3[i]) + k4[i]) / 6);
    }
}

static void go_to(struct integrator* to, double t, const double* x)
{
    to->t = t;
    memcpy(to->x, x, sizeof to->x);
    fall(NULL, 0, t, x, to->dxdt, 2);
}

/* --- both together --- */

/* Its step can be taken again with another length: events are located on it. */
static int step_again(void* integrator, double s, double* x, size_t n)
{
    (void)n;
    step(integrator, s, x);
    return 0;
}

static int fail(const char* what)
{
    fprintf(stderr, "%s: %s\n", what, rc_last_error());
    return 1;
}

int main(void)
{
    const double start[2] = {10.0, 0.0};
    const double h = 0.1; /* [s] */
    struct integrator own;
    rc_callbacks callbacks;
    rc_system* system;
    rc_monitor* monitor;
    rc_verdict verdict;
    int impacts = 0;

    memset(&callbacks, 0, sizeof callbacks);
    callbacks.size = sizeof callbacks;
    callbacks.dimension = 2;
    callbacks.guard_count = 1;
    callbacks.flow = fall;
    callbacks.guard = height;
    callbacks.reset = bounce;
    if (rc_system_new(&callbacks, &system) != RC_OK) return fail("system");
    if (rc_monitor_new(system, NULL, &monitor) != RC_OK) return fail("monitor");
    rc_system_free(system); /* the monitor keeps what it needs */

    go_to(&own, 0, start);
    if (rc_monitor_start(monitor, 0, own.x, own.dxdt, 2, 0, h, &verdict) != RC_OK) {
        return fail("start");
    }
    while (verdict == RC_STANDS && own.t < 20.4) {
        double end[2], rate[2];
        rc_host_step shown;
        step(&own, h, end);
        fall(NULL, 0, own.t + h, end, rate, 2);

        memset(&shown, 0, sizeof shown);
        shown.size = sizeof shown;
        shown.n = 2;
        shown.t0 = own.t;
        shown.h = h;
        shown.x0 = own.x;
        shown.x1 = end;
        shown.rate0 = own.dxdt;
        shown.rate1 = rate;
        shown.user = &own;
        shown.restep = step_again;
        if (rc_monitor_examine(monitor, &shown, &verdict) != RC_OK) return fail("step");
        if (verdict == RC_STANDS) go_to(&own, own.t + h, end);
        while (verdict == RC_CUT) {
            rc_cut cut;
            cut.size = sizeof cut;
            if (rc_monitor_cut(monitor, &cut) != RC_OK) return fail("cut");
            ++impacts;
            printf("impact at %.12f s, %+.6f m/s -> %+.6f m/s\n", cut.t, cut.before[1],
                   cut.after[1]);
            go_to(&own, cut.t, cut.after);
            if (rc_monitor_resume(monitor, own.dxdt, 2, h, &verdict) != RC_OK) {
                return fail("resume");
            }
        }
    }
    printf("height %.6f m at %.1f s\n", own.x[0], own.t);
    rc_monitor_free(monitor);
    return impacts == 13 ? 0 : 1;
}
