#!/usr/bin/env python3
"""Time and error of SciPy's LSODA on the two inclusions, with smoothed signs.

The usual way to integrate a relay without an integrator for inclusions is to replace
sign(w) by w / (|w| + eps). This prints what that costs, on the samples on which
`ricochet compare sliding-mode` and `ricochet compare diode-circuit` take their errors,
against the closed solution and against a hand-over at rtol 1e-13.

Needs SciPy (on Debian python3-scipy, run with /usr/bin/python3) and the command line
program:  scripts/compare_lsoda.py build/release/bin/ricochet
"""
import argparse
import json
import math
import subprocess
import sys
import time

try:
    import numpy as np
    from scipy.integrate import solve_ivp
except ImportError:
    sys.exit("compare_lsoda.py: found no SciPy; on Debian: apt-get install python3-scipy, "
             "and run with /usr/bin/python3")

SAMPLES = 5001


def smoothed(w, eps):
    return w / (abs(w) + eps)


def sliding_mode(eps):
    def rate(t, w):
        return [1.75 * math.sin(50 * t) - 2 * smoothed(w[0], eps)]
    return rate


def diode_circuit(eps):
    c1, c2, g, ell, current = 1 / 9, 1.0, 0.7, 1 / 7, 0.8

    def rate(t, w):
        v1, v2, i = w
        through = g * (v2 - v1)
        return [(through - current * smoothed(v1, eps)) / c1, (i - through) / c2, -v2 / ell]
    return rate


def reference(program, system):
    words = [program, "simulate", system, "--json", "--samples", str(SAMPLES)]
    words += ["--rtol", "1e-13", "--atol", "1e-13"]
    run = json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)
    return np.array(run["trajectory"]["t"]), np.array(run["trajectory"]["state"])


def best_time(solve, repeats=5):
    best = math.inf
    for _ in range(repeats):
        start = time.perf_counter()
        out = solve()
        best = min(best, time.perf_counter() - start)
    return best, out


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", help="the ricochet program")
    program = parser.parse_args().program
    print(f"{'':<16}{'eps':>8}{'rtol':>8}{'calls':>8}{'ms':>9}{'L2':>11}{'relative':>11}")
    for name, make in (("sliding-mode", sliding_mode), ("diode-circuit", diode_circuit)):
        t, exact = reference(program, name)
        for eps, rtol in ((1e-6, 1e-3), (1e-6, 1e-6), (1e-8, 1e-3), (1e-8, 1e-8)):
            rate = make(eps)

            def solve():
                return solve_ivp(rate, (t[0], t[-1]), exact[0], method="LSODA", t_eval=t,
                                 rtol=rtol, atol=rtol)
            seconds, run = best_time(solve)
            if not run.success:
                print(f"{name:<16}{eps:>8.0e}{rtol:>8.0e}   {run.message}")
                continue
            w = run.y.T
            weight = np.full(len(t), t[1] - t[0])
            weight[0] = weight[-1] = weight[0] / 2
            error = math.sqrt(np.sum(weight[:, None] * (w - exact) ** 2))
            size = math.sqrt(np.sum(weight[:, None] * exact ** 2))
            print(f"{name:<16}{eps:>8.0e}{rtol:>8.0e}{run.nfev:>8}"
                  f"{1e3 * seconds:>9.2f}{error:>11.2e}{error / size:>11.2e}")


if __name__ == "__main__":
    main()
