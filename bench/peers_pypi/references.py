#!/usr/bin/env python3
"""Makes references.json: event times by heyoka in long double, contacts of the discs by brute force.

usage: build/peers-pypi/environment/bin/python bench/peers_pypi/references.py

heyoka's series at a tolerance of 1e-19 keep 18 digits a step; each time is rounded to double at the
end. The discs are moved from contact to contact with all pairs compared, in NumPy.
"""
import json
from pathlib import Path

import heyoka
import numpy as np

import problems

LONG = np.longdouble


def crossings(make, start, t_end):
    """Times at which the event of `make` rises through zero."""
    times = []

    def seen(integrator, t, sign):
        times.append(t)

    system, surface = make()
    integrator = heyoka.taylor_adaptive(
        system, np.array(start, dtype=LONG), tol=LONG("1e-19"), fp_type=LONG,
        nt_events=[heyoka.nt_event(surface, callback=seen, fp_type=LONG,
                                   direction=heyoka.event_direction.positive)])

    def run(x0):
        times.clear()
        integrator.time, integrator.state[:] = LONG(0), np.array(x0, dtype=LONG)
        integrator.propagate_until(LONG(t_end))
        return [float(t) for t in times]
    return run


def henon_heiles():
    x, y, u, v = heyoka.make_vars("x", "y", "u", "v")
    return [(x, u), (y, v), (u, -x - 2.0 * x * y), (v, y * y - y - x * x)], x


def lorenz():
    x, y, z = heyoka.make_vars("x", "y", "z")
    eight_thirds = heyoka.expression(8.0 / 3.0)
    return [(x, 10.0 * (y - x)), (y, x * (28.0 - z) - y), (z, x * y - eight_thirds * z)], z - 27.0


def contacts():
    """How many contacts the discs have, by the next one of all pairs and walls again and again."""
    at, velocity, radius = problems.disc_table()
    x, v = np.array(at), np.array(velocity)
    n, low, high = len(x), radius, problems.DISCS_BOX - radius
    t, count = 0.0, 0

    def of_pairs(rows):
        away = x[None, :, :] - x[rows, None, :]
        speed = v[None, :, :] - v[rows, None, :]
        approach = (away * speed).sum(-1)
        square = (speed**2).sum(-1)
        gap = (away**2).sum(-1) - 4 * radius**2
        under = approach**2 - square * gap
        with np.errstate(all="ignore"):
            when = gap / (np.sqrt(under) - approach)
        when[(approach >= 0) | (under < 0)] = np.inf
        return t + when

    def of_walls(rows):
        with np.errstate(divide="ignore"):
            when = np.where(v[rows] > 0, (high - x[rows]) / v[rows], (low - x[rows]) / v[rows])
        when[v[rows] == 0] = np.inf
        return t + when

    everyone = np.arange(n)
    pair, wall = of_pairs(everyone), of_walls(everyone)
    nearest, partner = pair.min(1), pair.argmin(1)
    while True:
        a = int(nearest.argmin())
        b, axis = np.unravel_index(int(wall.argmin()), wall.shape)
        when = min(nearest[a], wall[b, axis])
        if when > problems.DISCS_END:
            return count
        x += v * (when - t)
        t, count = when, count + 1
        if nearest[a] < wall[b, axis]:
            c = int(partner[a])
            normal = x[c] - x[a]
            normal /= np.linalg.norm(normal)
            change = (v[c] - v[a]) @ normal * normal
            v[a] += change
            v[c] -= change
            moved = np.array([a, c])
        else:
            v[b, axis] = -v[b, axis]
            moved = np.array([b])
        wall[moved] = of_walls(moved)
        pair[moved] = of_pairs(moved)
        pair[:, moved] = pair[moved].T
        stale = np.isin(partner, moved)
        stale[moved] = True
        nearest[stale], partner[stale] = pair[stale].min(1), pair[stale].argmin(1)
        nearer = pair[:, moved].min(1) < nearest
        nearest[nearer] = pair[nearer][:, moved].min(1)
        partner[nearer] = moved[pair[nearer][:, moved].argmin(1)]


def main():
    star = crossings(henon_heiles, problems.HENON_HEILES, problems.HENON_HEILES_END)
    found = {
        "made by": f"references.py with heyoka {heyoka.__version__} in long double, tolerance 1e-19",
        "henon-heiles": star(problems.HENON_HEILES),
        "lorenz": crossings(lorenz, problems.LORENZ, problems.LORENZ_END)(problems.LORENZ),
        "discs": contacts(),
    }
    star = crossings(henon_heiles, problems.HENON_HEILES, problems.ORBITS_END)
    runs = [star(x0) for x0 in problems.orbit_table()]
    found["orbits"] = {"counts": [len(run) for run in runs], "last": [run[-1] for run in runs]}
    Path(__file__).with_name("references.json").write_text(json.dumps(found) + "\n")
    print({name: value if isinstance(value, (int, str)) else len(value) for name, value in found.items()})


if __name__ == "__main__":
    main()
