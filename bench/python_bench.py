"""Python against SciPy at equal error, and ready systems against C++.

usage: PYTHONPATH=build/release/python python3 bench/python_bench.py [--lines PROGRAM]

With --lines one line for each target, and exit status 1 where one is missed; PROGRAM is
ricochet_work_precision, whose time of the ball in C++ stands beside Python's.

Processor time of one run, the least of several; errors are the largest of any event's time, against
the closed form (ball) and against a run of tolerance 1e-13 (pendulum). SciPy restarts at
every event, since it has no resets; that is part of its time. Compare rows of equal error.
"""

import json
import math
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp as scipy_solve

import ricochet


def least_time(run, repeats=5):
    def seconds(count):  # of so many runs: the clock takes as long as a short one
        start = time.process_time()
        for _ in range(count):
            run()
        return time.process_time() - start

    count = 1
    while seconds(count) < 0.02:
        count *= 2
    return 1e6 * min(seconds(count) for _ in range(repeats)) / count


def by_scipy(fun, event, reset, t_end, y0, **options):
    event.terminal = True
    t, y, times = 0.0, y0, []
    while True:
        result = scipy_solve(fun, (t, t_end), y, events=event, **options)
        if result.status != 1:
            return np.array(times)
        t = result.t_events[0][0]
        times.append(t)
        y = reset(t, result.y_events[0][0])
        y[0] += 1e-15  # off the surface, or SciPy finds the same event again


def by_ricochet(fun, event, reset, t_end, y0, **options):
    event.terminal, event.reset = False, reset
    return ricochet.solve_ivp(fun, (0, t_end), y0, events=event, t_eval=[], **options).t_events[0]


def ball():
    def fun(t, y):
        return [y[1], -9.81]

    def event(t, y):
        return y[0]

    event.direction = -1
    ready = ricochet.BouncingBall()
    exact = np.array([ready.impact_time(n, 10.0) for n in range(13)])
    return "ball, 13 impacts", fun, event, lambda t, y: [0.0, -0.9 * y[1]], 20.5, [10.0, 0.0], exact


def pendulum():
    sin = math.sin

    def fun(t, y):
        angle, rate = y
        return [rate, -9.81 * sin(angle)]

    def event(t, y):
        return y[0]

    event.direction = -1
    problem = (fun, event, lambda t, y: [0.0, -0.9 * y[1]], 10.0, [1.0, 0.0])
    exact = by_ricochet(*problem, method="DOP853", rtol=1e-13, atol=1e-14)
    return ("pendulum on a wall, 10 s", *problem, exact)


def compiled_pendulum():
    """The same from functions that numba has compiled, where it is installed."""
    try:
        import numba
        from numba import types as n
    except ImportError:
        return None
    sin, number, numbers = math.sin, n.double, n.CPointer(n.double)

    @numba.cfunc(n.void(n.uint32, number, numbers, numbers, n.uintp, n.voidptr))
    def flow(mode, t, x, dxdt, size, user):
        dxdt[0] = x[1]
        dxdt[1] = -9.81 * sin(x[0])

    @numba.cfunc(number(n.uint32, number, numbers, n.uintp, n.voidptr))
    def wall(mode, t, x, size, user):
        return x[0]

    @numba.cfunc(n.uint32(n.uint32, number, numbers, n.uintp, n.voidptr))
    def bounce(mode, t, x, size, user):
        x[0] = 0.0
        x[1] *= -0.9
        return mode

    guard = ricochet.Guard(ricochet.Compiled(wall), reset=ricochet.Compiled(bounce))
    return ricochet.Compiled(flow), guard


def table():
    print(f"{'':48}{'us a run':>10}{'error':>10}")
    for name, *problem, exact in (ball(), pendulum()):
        for who, solve in (("SciPy", by_scipy), ("ricochet", by_ricochet)):
            for method in ("RK45", "DOP853"):
                for rtol in (1e-6, 1e-9, 1e-10):
                    options = dict(method=method, rtol=rtol, atol=rtol)
                    times = solve(*problem, **options)
                    error = (abs(times - exact).max() if times.shape == exact.shape
                             else f"{times.size} events")
                    took = least_time(lambda: solve(*problem, **options), 3)
                    print(f"{name}: {who} {method} {rtol:g}".ljust(48) + f"{took:10.0f}{error:>10.2}")

    compiled = compiled_pendulum()
    if compiled is not None:
        *_, exact = pendulum()
        for method in ("RK45", "DOP853"):
            for rtol in (1e-9, 1e-10):
                def run():
                    return ricochet.solve_ivp(compiled[0], (0, 10.0), [1.0, 0.0], events=compiled[1],
                                              t_eval=[], method=method, rtol=rtol, atol=rtol)
                error = abs(run().t_events[0] - exact).max()
                print(f"{'the same, compiled'}: {method} {rtol:g}".ljust(48)
                      + f"{least_time(run):10.0f}{error:>10.2}")

    print()
    for system, start, t_end in ((ricochet.BouncingBall(), (10.0, 0.0), 20.5),
                                 (ricochet.StickSlip(), (1.0, 0.2), 120.0),
                                 (ricochet.ImpactOscillator(), (0.0, 0.0), 1795.0)):
        took = least_time(lambda: ricochet.integrate(system, start, t_end))
        print(f"{system!r}, {t_end:g} s".ljust(96) + f"{took:10.1f} us")


missed = []


def line(good, what, target, measured):
    print(f"{'pass' if good else 'FAIL':11} {what} | target: {target} | measured: {measured}")
    if not good:
        missed.append(what)


def share_of_callbacks(fun, event, reset, t_end, y0):
    """Of the time of a run, and how much faster than SciPy a run of its callbacks alone would be."""
    options = dict(method="RK45", rtol=1e-9, atol=1e-9)
    calls = []

    def counted(function):
        def call(t, y):
            calls.append(function)
            return function(t, y)
        return call

    crossing = counted(event)
    crossing.direction = event.direction
    by_ricochet(counted(fun), crossing, reset, t_end, y0, **options)
    y = np.array(y0)
    alone = sum(calls.count(function) * least_time(lambda: function(0.0, y), 3)
                for function in (fun, event))
    here, there = (least_time(lambda: solve(fun, event, reset, t_end, y0, **options), 3)
                   for solve in (by_ricochet, by_scipy))
    return alone / here, there / alone


def beside_scipy(problem):
    """The least factor between SciPy and Python callbacks here at equal method and tolerance."""
    name, *problem, exact = problem
    rows = []
    for method in ("RK45", "DOP853"):
        for rtol in (1e-6, 1e-9, 1e-10):
            options = dict(method=method, rtol=rtol, atol=rtol)
            errors, took = [], []
            for solve in (by_scipy, by_ricochet):
                times = solve(*problem, **options)
                errors.append(abs(times - exact).max() if times.shape == exact.shape else math.inf)
                took.append(least_time(lambda: solve(*problem, **options), 3))
            rows.append((took[0] / took[1], f"{method} {rtol:g} {took[0] / took[1]:.0f} times, errors "
                         f"{errors[0]:.0e} and {errors[1]:.0e}", errors[1] <= 2 * errors[0]))
    line(all(factor >= 20 and as_near for factor, _, as_near in rows),
         f"{name}, Python callbacks beside SciPy", ">= 20 times, at no larger error",
         "; ".join(text for _, text, _ in rows))
    share, least = share_of_callbacks(*problem)
    print(f"            at RK45 1e-9 the callbacks alone take {100 * share:.0f} % of ricochet's time; without "
          f"the rest it would be {least:.0f} times faster than SciPy")


def seconds_of_import(modules):
    command = f"import time; s = time.process_time(); import {modules}; print(time.process_time() - s)"
    return min(float(subprocess.run([sys.executable, "-c", command], check=True, text=True,
                                    capture_output=True).stdout) for _ in range(7))


def lines(program):
    beside_scipy(ball())
    beside_scipy(pendulum())

    def of_cpp():
        with tempfile.TemporaryDirectory() as folder:
            found = Path(folder) / "rows.json"
            subprocess.run([program, "--filter", "b1/dopri5/extremum", "--json", found], check=True,
                           capture_output=True)
            rows = json.loads(found.read_text())["rows"]
        return next(1e6 * row["time"]["p10"] for row in rows if row["value"] == 1e-10)

    system, before = ricochet.BouncingBall(), of_cpp()
    here = least_time(lambda: ricochet.integrate(system, (10.0, 0.0), 20.5, rtol=1e-10, atol=1e-10))
    there = min(before, of_cpp())
    line(here <= 1.2 * there, "the ready ball, 13 impacts, beside C++", "<= 1.2 times",
         f"{here:.1f} us, {there:.1f} us in C++: {here / there:.2f} times")
    oscillator = ricochet.ImpactOscillator()
    short, long = (least_time(lambda: ricochet.integrate(oscillator, (0.0, 0.0), t_end))
                   for t_end in (1795.0, 17950.0))
    print(f"            the ready impact oscillator: {short:.0f} us for 200 periods, "
          f"{long / short:.2f} times that for 2000")
    beyond = seconds_of_import("numpy, ricochet") - seconds_of_import("numpy")
    line(beyond <= 0.15, "import beyond NumPy", "<= 0.15 s", f"{beyond:.3f} s")


if sys.argv[1:2] == ["--lines"]:
    lines(sys.argv[2])
    sys.exit(1 if missed else 0)
else:
    table()
