"""heyoka.py: adaptive Taylor series, events as expressions, batches."""
import sys

import heyoka as hy
import numpy as np

import problems
from cell import events, main, rows, version

TOLERANCES = (1e-9, 1e-13, 0.0)  # 0: the default, the rounding of a double


def tol(tolerance):
    return {"tol": tolerance} if tolerance else {}


def bouncing(tolerance, parameter=False):
    """The integrator of a ball; the callback of its terminal event turns the velocity."""
    x, v = hy.make_vars("x", "v")
    times = []
    restitution = [problems.RESTITUTION]

    def bounce(integrator, sign):
        times.append(integrator.time)
        integrator.state[0], integrator.state[1] = 0.0, -restitution[0] * integrator.state[1]
        return True

    floor = hy.t_event(x, callback=bounce, direction=hy.event_direction.negative)
    integrator = hy.taylor_adaptive([(x, v), (v, hy.expression(-problems.GRAVITY))], [problems.HEIGHT, 0.0],
                                    t_events=[floor], **tol(tolerance))
    return integrator, times, restitution


def ball(tolerance):
    def make():
        integrator, times, _ = bouncing(tolerance)

        def solve():
            times.clear()
            integrator.time = 0.0
            integrator.state[:] = [problems.HEIGHT, 0.0]
            integrator.reset_cooldowns()
            integrator.propagate_until(problems.T_END)
            return times
        return solve, events
    return make


def balls(tolerance):
    def make():
        integrator, times, restitution = bouncing(tolerance)
        heights, restitutions = problems.ball_table()

        def solve():
            counts, last = [], []
            for height, restitution[0] in zip(heights, restitutions):
                times.clear()
                integrator.time = 0.0
                integrator.state[:] = [height, 0.0]
                integrator.reset_cooldowns()
                integrator.propagate_until(problems.BALLS_END)
                counts.append(len(times))
                last.append(times[-1])
            return counts, last
        return solve, lambda raw: rows(*raw)
    return make


def star():
    x, y, u, v = hy.make_vars("x", "y", "u", "v")
    return [(x, u), (y, v), (u, -x - 2.0 * x * y), (v, y * y - y - x * x)], x


def lorenz():
    x, y, z = hy.make_vars("x", "y", "z")
    return [(x, 10.0 * (y - x)), (y, x * (28.0 - z) - y), (z, x * y - (8.0 / 3.0) * z)], z - 27.0


def crossings(of, start, t_end, tolerance):
    def make():
        times = []

        def seen(integrator, t, sign):
            times.append(t)

        system, surface = of()
        event = hy.nt_event(surface, callback=seen, direction=hy.event_direction.positive)
        integrator = hy.taylor_adaptive(system, start, nt_events=[event], **tol(tolerance))

        def solve():
            times.clear()
            integrator.time = 0.0
            integrator.state[:] = start
            integrator.propagate_until(t_end)
            return times
        return solve, events
    return make


def orbits(width, tolerance):
    def make():
        starts = np.array(problems.orbit_table())
        counts, last = [0] * len(starts), [0.0] * len(starts)
        base = [0]

        def seen(integrator, t, sign, lane):
            counts[base[0] + lane] += 1
            last[base[0] + lane] = t

        system, surface = star()
        event = hy.nt_event_batch(surface, callback=seen, direction=hy.event_direction.positive)
        integrator = hy.taylor_adaptive_batch(system, np.ascontiguousarray(starts[:width].T),
                                              nt_events=[event], **tol(tolerance))

        def solve():
            counts[:] = [0] * len(starts)
            for base[0] in range(0, len(starts), width):
                integrator.set_time(0.0)
                integrator.state[:] = starts[base[0]:base[0] + width].T
                integrator.propagate_until(problems.ORBITS_END)
            return counts, last
        return solve, lambda raw: rows(*raw)
    return make


def stick_slip(tolerance):
    """An integrator for each mode; the event of one starts the other."""
    def make():
        x, v = hy.make_vars("x", "v")
        slip = hy.taylor_adaptive(
            [(x, v), (v, 1.0 / (1.0 + 3.0 * (0.2 - v)) - x)], [1.0, 0.2],
            t_events=[hy.t_event(v - 0.2, direction=hy.event_direction.positive)], **tol(tolerance))
        stick = hy.taylor_adaptive(
            [(x, v), (v, hy.expression(0.0))], [0.0, 0.2],
            t_events=[hy.t_event(x - 1.0, direction=hy.event_direction.positive)], **tol(tolerance))

        def solve():
            times, here, other = [], slip, stick
            start, t = (1.0, 0.2), 0.0
            while True:
                here.time = t
                here.state[:] = start
                here.reset_cooldowns()
                ended = here.propagate_until(problems.STICK_SLIP_END)[0]
                if ended == hy.taylor_outcome.time_limit:
                    return times
                t = here.time
                times.append(t)
                start = (1.0 if here is stick else here.state[0], 0.2)
                here, other = other, here
        return solve, events
    return make


def cells():
    out = []
    for tolerance in (1e-9, 0.0):
        out.append(("ball", "heyoka", "terminal event", tolerance, ball(tolerance)))
    for tolerance in TOLERANCES:
        out.append(("henon-heiles", "heyoka", "event", tolerance,
                    crossings(star, problems.HENON_HEILES, problems.HENON_HEILES_END, tolerance)))
        out.append(("lorenz", "heyoka", "event", tolerance,
                    crossings(lorenz, problems.LORENZ, problems.LORENZ_END, tolerance)))
        out.append(("stick-slip", "heyoka", "an integrator a mode", tolerance, stick_slip(tolerance)))
    for width in (4, 8):
        for tolerance in (1e-9, 1e-13, 1e-14):
            out.append(("orbits", "heyoka", f"batch of {width}", tolerance, orbits(width, tolerance)))
    out.append(("balls", "heyoka", "one integrator, ball by ball", 1e-9, balls(1e-9)))
    return out


if __name__ == "__main__":
    sys.exit(main({"heyoka": version("heyoka")}, cells()))
