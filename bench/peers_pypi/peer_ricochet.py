"""ricochet from Python: ready systems, functions, formulas, functions compiled by numba, ensembles."""
import sys

import numpy as np

import problems
import ricochet
from cell import events, main, rows, values, version

LEAST = 2.3e-16
# Formulas may depend on global variables, not on attributes of a module: those are read again in each run.
GRAVITY, RESTITUTION = problems.GRAVITY, problems.RESTITUTION


def times_of(run):
    return events(run.events["t"])


def ball_flow(t, x):
    return [x[1], -GRAVITY]


def ball_bounce(t, x):
    return [0.0, -RESTITUTION * x[1]]


def ball(kind, method, tolerance):
    def make():
        options = {"method": method, "rtol": tolerance, "atol": tolerance}
        if kind == "ready":
            system = ricochet.BouncingBall()
        elif kind == "compiled":
            system = compiled_ball()
        else:
            floor = ricochet.Guard(lambda t, x: x[0], unilateral=True, reset=ball_bounce)
            more = {"formula": 2} if kind == "formulas" else {"vector": "list"}
            system = ricochet.System(ball_flow, [floor], **more)
        return lambda: ricochet.integrate(system, [problems.HEIGHT, 0.0], problems.T_END, **options), times_of
    return make


def compiled_ball():
    import numba
    from numba import types as n
    numbers = n.CPointer(n.double)

    @numba.cfunc(n.void(n.uint32, n.double, numbers, numbers, n.uintp, n.voidptr))
    def flow(mode, t, x, dxdt, size, user):
        dxdt[0] = x[1]
        dxdt[1] = -9.81

    @numba.cfunc(n.double(n.uint32, n.double, numbers, n.uintp, n.voidptr))
    def height(mode, t, x, size, user):
        return x[0]

    @numba.cfunc(n.uint32(n.uint32, n.double, numbers, n.uintp, n.voidptr))
    def bounce(mode, t, x, size, user):
        x[0] = 0.0
        x[1] *= -0.9
        return mode
    return ricochet.System(flow, [ricochet.Guard(height, unilateral=True, reset=bounce)])


def ball_like_scipy(tolerance):
    def make():
        def floor(t, y):
            return y[0]
        floor.direction = -1
        floor.reset = ball_bounce
        return (lambda: ricochet.solve_ivp(ball_flow, (0, problems.T_END), [problems.HEIGHT, 0.0], t_eval=[],
                                           events=floor, method="RK45", rtol=tolerance, atol=tolerance),
                lambda run: events(run.t_events[0]))
    return make


def star_flow(t, s):
    x, y, u, v = s
    return [u, v, -x - 2.0 * x * y, y * y - y - x * x]


def lorenz_flow(t, s):
    x, y, z = s
    return [10.0 * (y - x), x * (28.0 - z) - y, x * y - (8.0 / 3.0) * z]


def plain(flow, surface, start, t_end, kind, method, tolerance):
    def make():
        more = {"formula": len(start)} if kind == "formulas" else {"vector": "list"}
        system = ricochet.System(flow, [ricochet.Guard(surface, direction=1)], **more)
        options = {"method": method, "rtol": tolerance, "atol": tolerance}
        return lambda: ricochet.integrate(system, start, t_end, **options), times_of
    return make


def belt_flow(mode, t, x):
    if mode == "slip":
        return [x[1], 1.0 / (1.0 + 3.0 * (0.2 - x[1])) - x[0]]
    return [0.2, 0.0 * x[0]]


def stick_slip(kind, method, tolerance):
    def make():
        options = {"method": method, "rtol": tolerance, "atol": tolerance}
        if kind == "ready":
            system = ricochet.StickSlip()
        else:
            stop = ricochet.Guard(lambda mode, t, x: 0.2 - x[1], in_modes=["slip"],
                                  reset=lambda mode, t, x: ("stick", [x[0], 0.2 + 0.0 * x[1]]))
            pull = ricochet.Guard(lambda mode, t, x: 1.0 - x[0], in_modes=["stick"],
                                  reset=lambda mode, t, x: ("slip", [1.0 + 0.0 * x[0], 0.2 + 0.0 * x[1]]))
            system = ricochet.System(belt_flow, [stop, pull], modes=("slip", "stick"), formula=2)
        return lambda: ricochet.integrate(system, [1.0, 0.2], problems.STICK_SLIP_END, **options), times_of
    return make


class Ball(ricochet.System):
    """Its restitution is a parameter, its height the start."""

    formula = 2

    def __init__(self, restitution):
        self.restitution = restitution

    def flow(self, t, x):
        return [x[1], -GRAVITY]

    @ricochet.guard(unilateral=True)
    def floor(self, t, x):
        return x[0]

    @floor.reset
    def floor(self, t, x):
        return [0.0, -self.restitution * x[1]]


def last_events(found, count):
    """Counts and last times of an ensemble, of its table of events."""
    table = found.event_table
    last = np.zeros(count)
    np.maximum.at(last, table["row"], table["t"])
    return rows(found.events, last)


def balls(method, tolerance):
    def make():
        heights, restitutions = problems.ball_table()
        starts = np.column_stack([heights, np.zeros(len(heights))])
        parameters = {"restitution": np.array(restitutions)}
        options = {"method": method, "rtol": tolerance, "atol": tolerance, "threads": 1}
        return (lambda: ricochet.ensemble(Ball, starts, problems.BALLS_END, parameters=parameters, **options),
                lambda found: last_events(found, len(starts)))
    return make


def orbits(tolerance):
    def make():
        starts = np.array(problems.orbit_table())
        system = ricochet.System(star_flow, [ricochet.Guard(lambda t, s: s[0], direction=1)], formula=4)
        options = {"method": "taylor", "rtol": tolerance, "atol": tolerance, "threads": 1}
        return (lambda: ricochet.ensemble(system, starts, problems.ORBITS_END, **options),
                lambda found: last_events(found, len(starts)))
    return make


def gradient(tolerance):
    def make():
        system = ricochet.BouncingBall()

        def solve():
            return ricochet.gradient(lambda run: run.event_times[problems.IMPACTS - 1], system,
                                     [problems.HEIGHT, 0.0], problems.T_END, rtol=tolerance, atol=tolerance)
        return solve, lambda found: values([found.x0[0], *found.args])
    return make


class OwnBall(ricochet.System):
    unilateral = True

    def flow(self, t, x, gravity, restitution):
        return [x[1], -gravity]

    def guard(self, t, x, gravity, restitution):
        return x[0]

    def reset(self, t, x, gravity, restitution):
        return [0, -restitution * x[1]]


def own_gradient(tolerance):
    def make():
        system = OwnBall()

        def solve():
            return ricochet.gradient(lambda run: run.event_times[problems.IMPACTS - 1], system,
                                     [problems.HEIGHT, 0.0], problems.T_END, rtol=tolerance, atol=tolerance,
                                     args=(problems.GRAVITY, problems.RESTITUTION))
        return solve, lambda found: values([found.x0[0], *found.args])
    return make


def cells():
    out = [("ball", "ricochet", f"{kind}, {method}", tolerance, ball(kind, method, tolerance))
           for kind, method, tolerance in (
               ("ready", "dopri5", 1e-10), ("ready", "taylor", 1e-10), ("compiled", "dopri5", 1e-10),
               ("formulas", "dopri5", 1e-10), ("formulas", "taylor", 1e-10), ("functions", "dopri5", 1e-10))]
    out.append(("ball", "ricochet", "functions, solve_ivp, RK45", 1e-10, ball_like_scipy(1e-10)))
    for name, flow, surface, start, t_end in (
            ("henon-heiles", star_flow, lambda t, s: s[0], problems.HENON_HEILES, problems.HENON_HEILES_END),
            ("lorenz", lorenz_flow, lambda t, s: s[2] - 27.0, problems.LORENZ, problems.LORENZ_END)):
        for kind, method, tolerance in (
                ("formulas", "taylor", 1e-9), ("formulas", "taylor", 1e-13), ("formulas", "taylor", LEAST),
                ("formulas", "fehlberg78", 1e-9), ("formulas", "fehlberg78", 1e-13),
                ("functions", "fehlberg78", 1e-9), ("functions", "fehlberg78", 1e-13)):
            out.append((name, "ricochet", f"{kind}, {method}", tolerance,
                        plain(flow, surface, start, t_end, kind, method, tolerance)))
    for kind, method, tolerance in (
            ("ready", "taylor", 1e-9), ("ready", "taylor", 1e-12), ("ready", "dopri5", 1e-10),
            ("formulas", "taylor", 1e-9), ("formulas", "taylor", 1e-12), ("formulas", "taylor", LEAST)):
        out.append(("stick-slip", "ricochet", f"{kind}, {method}", tolerance,
                    stick_slip(kind, method, tolerance)))
    out += [("balls", "ricochet", f"ensemble, formulas, {method}", tolerance, balls(method, tolerance))
            for method, tolerance in (("dopri5", 1e-10), ("taylor", 1e-10))]
    out += [("orbits", "ricochet", "ensemble, formulas, taylor", tolerance, orbits(tolerance))
            for tolerance in (1e-9, 1e-13, LEAST)]
    out += [("gradient", "ricochet", "ready, adjoint, dopri5", 1e-10, gradient(1e-10)),
            ("gradient", "ricochet", "formulas, adjoint, dopri5", 1e-10, own_gradient(1e-10))]
    return out


if __name__ == "__main__":
    sys.exit(main({"ricochet": version("ricochet") if version("ricochet") != "unknown" else ricochet.__version__},
                  cells()))
