/* A block that friction stops while a ball beside it bounces: set-valued motion is a phase of the
 * run.
 *
 *   x = (speed of the block, height of the ball, its speed), friction 1, gravity 1
 */
#include <stdio.h>

#include <ricochet/ricochet.h>

/* Without friction. */
static int smooth(void* user, rc_mode mode, double t, const double* w, double* f, size_t n)
{
    (void)user, (void)mode, (void)t, (void)n;
    f[0] = 0;
    f[1] = w[2];
    f[2] = -1;
    return 0;
}

/* While the block slides. */
static int flow(void* user, rc_mode mode, double t, const double* x, double* dxdt, size_t n)
{
    const int status = smooth(user, mode, t, x, dxdt, n);
    dxdt[0] = x[0] >= 0 ? -1 : 1;
    return status;
}

static int bounds(void* user, rc_mode mode, double t, const double* w, size_t n, double* lower,
                  double* upper, size_t m)
{
    (void)user, (void)mode, (void)t, (void)w, (void)n, (void)m;
    lower[0] = -1;
    upper[0] = 1;
    return 0;
}

static int height(void* user, size_t which, rc_mode mode, double t, const double* x, size_t n,
                  double* g)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    *g = x[1];
    return 0;
}

static int bounce(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n)
{
    (void)user, (void)which, (void)mode, (void)t, (void)n;
    x[2] = -x[2];
    return 0;
}

int main(void)
{
    const rc_inclusion friction = {
        .size = sizeof friction, .reactions = 1, .smooth = smooth, .bounds = bounds};
    const rc_guard_info floor_info = {.size = sizeof floor_info, .unilateral = 1};
    const rc_callbacks callbacks = {.size = sizeof callbacks,
                                    .dimension = 3,
                                    .guard_count = 1,
                                    .guard_infos = &floor_info,
                                    .flow = flow,
                                    .guard = height,
                                    .reset = bounce,
                                    .set_valued = &friction};
    const double x0[3] = {1, 1.125, 0};
    rc_options options;
    rc_system* system = NULL;
    rc_simulation* simulation = NULL;
    size_t i;
    int right = 0;

    if (rc_options_default(&options, sizeof options) != RC_OK) return 1;
    options.t_end = 3;
    if (rc_system_new(&callbacks, &system) != RC_OK ||
        rc_simulation_new(system, x0, 3, &options, &simulation) != RC_OK ||
        rc_run(simulation) != RC_OK) {
        fprintf(stderr, "%s\n", rc_last_error());
    } else {
        for (i = 0; i < rc_event_count(simulation); ++i) {
            rc_event event = {.size = sizeof event};
            rc_event_at(simulation, i, &event);
            printf("%.9f s: %s\n", event.t, event.kind == RC_STICK ? "the block sticks" : "impact");
        }
        right = rc_outcome(simulation) == RC_REACHED_END && rc_state(simulation)[0] == 0;
    }
    rc_simulation_free(simulation);
    rc_system_free(system);
    return right ? 0 : 1;
}
