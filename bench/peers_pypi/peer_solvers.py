"""Solvers of differential equations that stop at an event: SciPy, scikit-sundae, numbalsoda, casadi.

None has resets (casadi has transitions); the run is started again behind each event, as their manuals
show. `restarts` is that loop for SciPy and scikit-sundae, numbalsoda's is compiled by numba.
"""
import sys

import numpy as np

import problems
from cell import events, main, values, version

LEAST_RTOL = 2.3e-14  # SciPy's


def ball_flow(t, y):
    return [y[1], -problems.GRAVITY]


def star_flow(t, s):
    x, y, u, v = s
    return [u, v, -x - 2.0 * x * y, y * y - y - x * x]


def lorenz_flow(t, s):
    x, y, z = s
    return [10.0 * (y - x), x * (28.0 - z) - y, x * y - (8.0 / 3.0) * z]


def slip_flow(t, y):
    return [y[1], 1.0 / (1.0 + 3.0 * (0.2 - y[1])) - y[0]]


def stick_flow(t, y):
    return [0.2, 0.0]


def of_state(value, direction, terminal):
    def surface(t, y):
        return value(y)
    surface.direction, surface.terminal = direction, terminal
    return surface


# Of each problem: start, end, phases of (flow, value of the guard, direction, state after it or none).
PHASES = {
    "ball": ([problems.HEIGHT, 0.0], problems.T_END,
             [(ball_flow, lambda y: y[0], -1, lambda y: [0.0, -problems.RESTITUTION * y[1]])]),
    "henon-heiles": (problems.HENON_HEILES, problems.HENON_HEILES_END,
                     [(star_flow, lambda y: y[0], 1, None)]),
    "lorenz": (problems.LORENZ, problems.LORENZ_END, [(lorenz_flow, lambda y: y[2] - 27.0, 1, None)]),
    "stick-slip": ([1.0, 0.2], problems.STICK_SLIP_END,
                   [(slip_flow, lambda y: y[1] - 0.2, 1, lambda y: [y[0], 0.2]),
                    (stick_flow, lambda y: y[0] - 1.0, 1, lambda y: [1.0, 0.2])]),
}


def restarts(name, piece):
    """`piece(phase, t, y, t_end)` gives the times of its events, and the state at the last or none."""
    start, t_end, phases = PHASES[name]

    def solve():
        times, t, y, phase = [], 0.0, start, 0
        while True:
            found, end = piece(phase, t, y, t_end)
            times += found
            if end is None:
                return times
            t, y = found[-1], phases[phase][3](end)
            phase = (phase + 1) % len(phases)
    return solve, events


def by_scipy(name, method, tolerance):
    def make():
        from scipy.integrate import solve_ivp
        surfaces = [of_state(value, direction, reset is not None)
                    for _, value, direction, reset in PHASES[name][2]]

        def piece(phase, t, y, t_end):
            flow, _, _, reset = PHASES[name][2][phase]
            run = solve_ivp(flow, (t, t_end), y, method=method, events=surfaces[phase],
                            rtol=max(tolerance, LEAST_RTOL), atol=tolerance)
            return [float(s) for s in run.t_events[0]], run.y[:, -1] if run.status == 1 else None
        return restarts(name, piece)
    return make


def by_sundae(name, tolerance):
    def make():
        from sksundae.cvode import CVODE

        def solver_of(flow, value, direction, reset):
            def rate(t, y, yp):
                yp[:] = flow(t, y)

            def surface(t, y, out):
                out[0] = value(y)
            surface.terminal, surface.direction = [reset is not None], [direction]
            # Anew for each piece: a solver keeps the events of all its runs.
            return lambda: CVODE(rate, method="Adams", rtol=max(tolerance, 1e-15), atol=tolerance,
                                 eventsfn=surface, num_events=1, max_num_steps=100000)
        solvers = [solver_of(*phase) for phase in PHASES[name][2]]

        def piece(phase, t, y, t_end):
            run = solvers[phase]().solve(np.array([t, t_end]), np.array(y))
            times = [] if run.t_events is None else [float(s) for s in run.t_events]
            ended = bool(times) and PHASES[name][2][phase][3] is not None
            return times, run.y_events[-1] if ended else None
        return restarts(name, piece)
    return make


def by_numbalsoda(tolerance):
    """`solve_ivp` of numbalsoda, called from a loop that numba compiles."""
    def make():
        import numba
        import numbalsoda
        from numba import types as n
        signature = n.void(n.double, n.CPointer(n.double), n.CPointer(n.double), n.CPointer(n.double))

        @numba.cfunc(signature)
        def flow(t, y, dy, p):
            dy[0] = y[1]
            dy[1] = -9.81

        @numba.cfunc(signature)
        def height(t, y, out, p):
            out[0] = y[0]

        return ball_of_numbalsoda(numba, numbalsoda, flow.address, height.address, tolerance)
    return make


def ball_of_numbalsoda(numba, numbalsoda, flow, height, tolerance):
    solve_ivp = numbalsoda.solve_ivp

    @numba.njit
    def run(tolerance):
        times = np.full(2 * 13, np.inf)
        t, y, k = 0.0, np.array([10.0, 0.0]), 0
        while k < times.size:
            found = solve_ivp(flow, np.array([t, 20.5]), y, n_events=1, event_fcn=height,
                              rtol=tolerance, atol=tolerance)
            if not found.event_found:
                break
            t = found.t_event
            times[k] = t
            k += 1
            y = np.array([1e-12, -0.9 * found.y_event[1]])
        return times
    return lambda: run(tolerance), lambda times: events(times[np.isfinite(times)])


def casadi_ball(tolerance):
    """The last time of a run to the end as a function of height, gravity and restitution, and all times.

    The transition keeps the times of its impacts in components whose rate is zero.
    """
    import casadi as ca
    t, x, p = ca.SX.sym("t"), ca.SX.sym("x", 2 + problems.IMPACTS), ca.SX.sym("p", 2)
    z, u = ca.SX.sym("z", 0), ca.SX.sym("u", 0)
    rate = ca.vertcat(x[1], -p[0], ca.SX.zeros(problems.IMPACTS))
    after = ca.vertcat(0, -p[1] * x[1], t, x[2:-1])
    transition = ca.Function("transition", [ca.SX.sym("index"), t, x, z, p, u], [after, z],
                             ca.event_in(), ca.event_out())
    options = {"transition": transition, "reltol": tolerance, "abstol": tolerance, "event_tol": tolerance,
               "max_events": 2 * problems.IMPACTS}
    run = ca.integrator("run", "erk", {"t": t, "x": x, "p": p, "ode": rate, "zero": x[0]}, 0.0,
                        problems.T_END, options)
    by = ca.MX.sym("by", 3)
    end = run(x0=ca.vertcat(by[0], ca.MX.zeros(1 + problems.IMPACTS)), p=by[1:])["xf"]
    at = [problems.HEIGHT, problems.GRAVITY, problems.RESTITUTION]
    return ca, by, end, at


def by_casadi(tolerance):
    def make():
        ca, by, end, at = casadi_ball(tolerance)
        run = ca.Function("times", [by], [end[2:]])
        return lambda: run(at), lambda raw: events(sorted(float(t) for t in raw.full().ravel() if t > 0))
    return make


def gradient_by_casadi(tolerance):
    def make():
        ca, by, end, at = casadi_ball(tolerance)
        run = ca.Function("gradient", [by], [ca.jacobian(end[2], by)])
        return lambda: run(at), lambda raw: values(raw.full().ravel())
    return make


def by_drake(tolerance):
    """A system of Drake in Python: a witness function, and an event that turns the velocity."""
    def make():
        from pydrake.systems.analysis import Simulator
        from pydrake.systems.framework import LeafSystem, UnrestrictedUpdateEvent, WitnessFunctionDirection
        times = []

        class Ball(LeafSystem):
            def __init__(self):
                super().__init__()
                self.DeclareContinuousState(1, 1, 0)
                self.floor = self.MakeWitnessFunction(
                    "floor", WitnessFunctionDirection.kPositiveThenNonPositive, self.height,
                    UnrestrictedUpdateEvent(self.bounce))

            def DoCalcTimeDerivatives(self, context, rates):
                v = context.get_continuous_state_vector().GetAtIndex(1)
                rates.get_mutable_vector().SetFromVector([v, -problems.GRAVITY])

            def height(self, context):
                return context.get_continuous_state_vector().GetAtIndex(0)

            def bounce(self, context, event, state):
                v = context.get_continuous_state_vector().GetAtIndex(1)
                times.append(context.get_time())
                state.get_mutable_continuous_state().SetFromVector([0.0, -problems.RESTITUTION * v])

            def DoGetWitnessFunctions(self, context):
                return [self.floor]

        simulator = Simulator(Ball())
        simulator.get_mutable_integrator().set_target_accuracy(tolerance)

        def solve():
            times.clear()
            context = simulator.get_mutable_context()
            context.SetTime(0.0)
            context.SetAccuracy(tolerance)
            context.SetContinuousState([problems.HEIGHT, 0.0])
            simulator.Initialize()
            simulator.AdvanceTo(problems.T_END)
            return times
        return solve, events
    return make


def cells():
    out = []
    for tolerance in (1e-6, 1e-9, 1e-12):
        out += [(name, "SciPy", "DOP853", tolerance, by_scipy(name, "DOP853", tolerance)) for name in PHASES]
        out += [(name, "scikit-sundae", "CVODE, Adams", tolerance, by_sundae(name, tolerance))
                for name in PHASES]
        out.append(("ball", "numbalsoda", "DOP853, loop compiled by numba", tolerance,
                    by_numbalsoda(tolerance)))
    for tolerance in (1e-8, 1e-12):
        out.append(("ball", "casadi", "erk, transition", tolerance, by_casadi(tolerance)))
        out.append(("gradient", "casadi", "erk, transition, Jacobian", tolerance,
                    gradient_by_casadi(tolerance)))
    out += [("ball", "Drake", "witness function in Python", tolerance, by_drake(tolerance))
            for tolerance in (1e-4, 1e-8)]
    return out


PACKAGES = {"SciPy": "scipy", "scikit-sundae": "scikit-sundae", "numbalsoda": "numbalsoda",
            "casadi": "casadi", "Drake": "drake"}

if __name__ == "__main__":
    sys.exit(main({peer: version(package) for peer, package in PACKAGES.items()}, cells()))
