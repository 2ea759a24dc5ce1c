"""SciPy's solve_ivp on the problems of the report, behind the protocol of ricochet_report.

    scipy_peer.py list             versions and cells, as JSON
    scipy_peer.py serve <cell>     answers lines of standard input: `solve`, `time <n>`
    scipy_peer.py run <cell>       both once, for people

Events as its manual says: `events` with `direction`, `terminal` where there is a reset, and a new
call after it with the first step left to solve_ivp. LSODA takes the inclusions with smoothed signs,
since SciPy has no integrator for inclusions; the rate-and-state slider, which is stiff, is taken by
LSODA, Radau and BDF. The problems are those of problems.hpp; a slip in one
of them would be an error against the reference that no tolerance removes.
"""
import math
import sys

from peer import answer, main

try:
    import numpy as np
    import scipy
    from scipy.integrate import solve_ivp
except ImportError:
    sys.exit("found no SciPy; on Debian: apt-get install python3-scipy, with /usr/bin/python3")

TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)


class Problem:
    """Start, flow, guards with their direction, and resets, which None leaves out."""

    direction = -1
    reset = None
    guards = 1

    def tasks(self):
        return [self]


class Ball(Problem):
    x0, t_end = [10.0, 0.0], 20.5

    def flow(self, t, x):
        return [x[1], -9.81]

    def guard(self, which, t, x):
        return x[0]

    def reset(self, which, t, x):
        return [0.0, -0.9 * x[1]]


class Impacts(Problem):
    x0, t_end = [0.0, 0.0], 200 * 2 * math.pi / 0.8

    def flow(self, t, x):
        return [x[1], math.cos(0.8 * t) - x[0] - 0.1 * x[1]]

    def guard(self, which, t, x):
        return 1.2 - x[0]

    def reset(self, which, t, x):
        return [1.2, -0.8 * x[1]]


class NearTangent(Problem):
    direction = 0
    t_end = 20

    def __init__(self, depth, phase=None):
        self.depth = depth
        if phase is not None:
            self.x0 = [math.cos(phase), -math.sin(phase)]

    def tasks(self):
        golden = [0.6180339887498949 * (k + 1) for k in range(32)]
        return [NearTangent(self.depth, 1.5 + 4 * (g - math.floor(g))) for g in golden]

    def flow(self, t, x):
        return [x[1], -x[0]]

    def guard(self, which, t, x):
        return (x[0] - 1) + self.depth


class HenonHeiles(Problem):
    direction = 1
    x0 = [-0.2525875586263492, -0.2178423952983717, 0.0, 0.2587703282931232]
    t_end = 36

    def flow(self, t, x):
        vx, vy, x, y = x
        return [-x - 2 * x * y, -y - x * x + y * y, vx, vy]

    def guard(self, which, t, x):
        return x[2]


class Arenstorf(Problem):
    direction = 0
    x0 = [0.994, 0.0, 0.0, -2.00158510637908252240537862224]
    t_end = 17.2

    def flow(self, t, x):
        moon = 0.012277471
        earth = 1 - moon
        a, b, y2 = x[0] + moon, x[0] - earth, x[1] * x[1]
        r1, r2 = a * a + y2, b * b + y2
        p1, p2 = earth / (r1 * math.sqrt(r1)), moon / (r2 * math.sqrt(r2))
        return [x[2], x[3], x[0] + 2 * x[3] - p1 * a - p2 * b,
                x[1] - 2 * x[2] - (p1 + p2) * x[1]]

    def guard(self, which, t, x):
        return x[1]


class Belt(Problem):
    x0, t_end = [1.0, 0.2], 100.5 * 12.001031294830578647
    slips = True

    def flow(self, t, x):
        if self.slips:
            return [x[1], 1 / (1 + 3 * (0.2 - x[1])) - x[0]]
        return [0.2, 0.0]

    def guard(self, which, t, x):
        return 0.2 - x[1] if self.slips else 1 - x[0]

    def reset(self, which, t, x):
        self.slips = not self.slips
        return [1.0 if self.slips else x[0], 0.2]


class Balls(Problem):
    def __init__(self, n):
        self.guards = n
        self.t_end = 15 if n <= 10 else 3 if n <= 100 else 1.1
        self.x0 = np.zeros(2 * n)
        self.x0[::2] = 5 + 5 * (np.arange(n) + 0.5) / n

    def flow(self, t, x):
        out = np.empty_like(x)
        out[::2] = x[1::2]
        out[1::2] = -9.81
        return out

    def guard(self, which, t, x):
        return x[2 * which]

    def reset(self, which, t, x):
        x[2 * which] = 0
        x[2 * which + 1] *= -0.9
        return x


class Block(Problem):
    """Slides with v' = -braking, then rests; the mode is the flow that is taken."""

    x0, t_end = [0.0, 4.0], 2
    braking = 0.3 * 9.81

    def __init__(self):
        self.slides = True

    def flow(self, t, x):
        return [x[1], -self.braking if self.slides else 0.0]

    def guard(self, which, t, x):
        return x[1] if self.slides else 1.0

    def reset(self, which, t, x):
        self.slides = False
        return [x[0], 0.0]


class Rolling(Block):
    x0 = [0.0, 4.0, 0.0]

    def flow(self, t, x):
        if self.slides:
            return [x[1], -self.braking, 2.5 * self.braking]
        return [x[1], 0.0, 0.0]

    def guard(self, which, t, x):
        return x[1] - x[2] if self.slides else 1.0

    def reset(self, which, t, x):
        self.slides = False
        return [x[0], x[1], x[1]]


class Thermostats(Problem):
    t_end = 20

    def __init__(self, n):
        self.guards = n
        self.x0 = np.zeros(2 * n)
        self.x0[::2] = 18.5 + 3 * (np.arange(n) + 0.5) / n

    def flow(self, t, x):
        out = np.zeros_like(x)
        out[::2] = -0.1 * (x[::2] - 30 * x[1::2])
        return out

    def guard(self, which, t, x):
        return x[2 * which] - 18 if x[2 * which + 1] == 0 else 22 - x[2 * which]

    def reset(self, which, t, x):
        x[2 * which + 1] = 1 - x[2 * which + 1]
        return x


class Watched(Problem):
    x0, t_end = [1.0, 0.0], 20

    def __init__(self, n):
        self.guards = n

    def flow(self, t, x):
        return [x[1], -9.8 * math.sin(x[0])]

    def guard(self, which, t, x):
        return x[0] + (10 + which)


class Rotations(Problem):
    guards, t_end = 0, 20

    def __init__(self, n):
        self.x0 = [1 / (1 + i % 7) for i in range(n)]

    def flow(self, t, x):
        rate = np.empty_like(x)
        rate[0::2], rate[1::2] = x[1::2], -x[0::2]
        return rate


PROBLEMS = {"ball": Ball, "impacts": Impacts, "henon-heiles": HenonHeiles,
            "arenstorf": Arenstorf, "stick-slip": Belt, "block": Block, "rolling": Rolling}
PROBLEMS |= {f"near-tangent-1e-{d}": lambda d=d: NearTangent(10.0 ** -d) for d in range(2, 13, 2)}
PROBLEMS |= {f"balls-{n}": lambda n=n: Balls(n) for n in (1, 10, 100)}
PROBLEMS |= {f"thermostats-{n}": lambda n=n: Thermostats(n) for n in (10, 100)}
PROBLEMS |= {f"plain-{n}": lambda n=n: Rotations(n) for n in (20, 200, 2000)}
PROBLEMS |= {f"guards-{n}": lambda n=n: Watched(n) for n in (0, 1, 10, 100)}


def events_of(problem, counts):
    def one(which):
        def guard(t, x):
            counts[0] += 1
            return problem.guard(which, t, x)
        guard.direction = problem.direction
        guard.terminal = problem.reset is not None
        return guard
    return [one(which) for which in range(problem.guards)]


def solve_one(problem, method, tolerance, out, offset):
    counts = [0]
    events = events_of(problem, counts) or None
    t, x = 0.0, np.array(problem.x0, dtype=float)
    finished = False
    while True:
        run = solve_ivp(problem.flow, (t, problem.t_end), x, method=method, events=events,
                        rtol=max(tolerance, 2.3e-14), atol=tolerance)
        out["flow_calls"] += run.nfev
        out["steps"] += len(run.t) - 1
        found = sorted((s, which) for which, times in enumerate(run.t_events or ())
                       for s in times)
        if run.status == 1:
            t = run.t[-1]
            which = next(i for s, i in found if s == t)
            out["times"].append(t)
            out["guards"].append(which + offset)
            x = np.array(problem.reset(which, t, run.y[:, -1]), dtype=float)
            continue
        for s, which in found:
            out["times"].append(s)
            out["guards"].append(which + offset)
        finished = run.status == 0
        if not finished:
            out["note"] = run.message
        break
    out["guard_calls"] += counts[0]
    return finished


def hybrid(name, method, tolerance):
    def solve():
        out = answer(flow_calls=0, guard_calls=0, steps=0, finished=True)
        for k, problem in enumerate(PROBLEMS[name]().tasks()):
            out["finished"] &= solve_one(problem, method, tolerance, out, 1000 * k)
        return out
    return solve


def slider_rate(t, x):
    """Of slip over D_RS, log(V / V*) and xi; rate-and-state friction with the ageing law."""
    v = 1e-4 * math.exp(x[1])
    stiffness, normal = 3e4, 9.81
    pull = stiffness * (normal * 0.5109 / stiffness + 1.5e-4 * t - 1e-6 * x[0])
    friction = 0.5109 + 0.011 * x[1] + 0.016 * x[2]
    return [v / 1e-6, (pull - normal * friction) / v, (1e-4 * math.exp(-x[2]) - v) / 1e-6]


def slider(method, tolerance):
    level = math.log(2e-4 / 1e-4)

    def threshold(t, x):
        return x[1] - level

    def solve():
        run = solve_ivp(slider_rate, (0, 1), [0.0, 0.0, 0.0], method=method, events=threshold,
                        rtol=max(tolerance, 2.3e-14), atol=tolerance)
        rising = [float(slider_rate(t, x)[1]) > 0 for t, x in zip(run.t_events[0], run.y_events[0])]
        return answer(finished=bool(run.success), times=[float(t) for t in run.t_events[0]],
                      guards=[0 if up else 1 for up in rising], steps=len(run.t) - 1,
                      flow_calls=run.nfev, note="" if run.success else run.message)
    return solve


def smoothed(w, eps):
    return w / (abs(w) + eps)


def sliding_mode(eps):
    def rate(t, w):
        return [1.75 * math.sin(50 * t) - 2 * smoothed(w[0], eps)]
    return rate, [0.15], 0.5


def diode_circuit(eps):
    c1, c2, g, ell, current = 1 / 9, 1.0, 0.7, 1 / 7, 0.8

    def rate(t, w):
        v1, v2, i = w
        through = g * (v2 - v1)
        return [(through - current * smoothed(v1, eps)) / c1, (i - through) / c2, -v2 / ell]
    return rate, [9.998048, 1.980972, -10.908448], 20.0


def inclusion(make, eps):
    def solve():
        rate, start, t_end = make(eps)
        run = solve_ivp(rate, (0, t_end), start, method="LSODA", rtol=eps, atol=eps,
                        t_eval=np.linspace(0, t_end, 101))
        return answer(finished=bool(run.success), samples=run.y.T.tolist(), flow_calls=run.nfev,
                      note="" if run.success else run.message)
    return solve


CELLS = [(name, "SciPy", method, tolerance, hybrid(name, method, tolerance))
         for name in PROBLEMS for method in ("RK45", "DOP853") for tolerance in TOLERANCES
         if tolerance in (1e-6, 1e-10)
         or not name.startswith(("near-tangent", "balls-100", "thermostats-100"))]
CELLS += [(name, "SciPy", "LSODA, sign smoothed over the tolerance", eps, inclusion(make, eps))
          for name, make in (("sliding-mode", sliding_mode), ("diode-circuit", diode_circuit))
          for eps in (1e-4, 1e-6, 1e-8, 1e-10)]
CELLS += [("slider", "SciPy", method, tolerance, slider(method, tolerance))
          for method in ("LSODA", "Radau", "BDF") for tolerance in TOLERANCES
          if method == "LSODA" or tolerance > 1e-11]  # where Radau and BDF take tens of seconds

if __name__ == "__main__":
    sys.exit(main({"SciPy": scipy.__version__}, CELLS))
