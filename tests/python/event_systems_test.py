"""Twenty-five small systems whose events are decided at their borders, those that no other test in Python has.

Of the others a thermostat, resets that decline, two doses, closures and a relay are in meaning_test.py,
accumulating tanks and saddles in rest_test.py, ticks in instants_test.py and times_test.py, vetoes in
veto_test.py.
"""

import math

import numpy as np
import pytest

import ricochet
from ricochet import Guard, Kind, System

TINY = 2.0 ** -53


def integrate(system, x0, t_end, **options):
    return ricochet.integrate(system, x0, t_end, **{"rtol": 1e-10, "atol": 1e-12, **options})


def still(t, x):
    return [0.0] * len(x)


def both_at_one(*resets):
    """A constant state, and a guard for each reset that crosses at 1."""
    return System(still, [Guard(lambda t, x: 1 - t, reset=reset) for reset in resets])


def counting(flow, value, reset, modes=8, **more):
    """A guard of an automaton whose modes are numbers."""
    return System(flow, [Guard(value, reset=reset)], modes=modes, **more)


def floors(*restitutions):
    """Floors at 0 below a ball that falls from 1 by x'' = -2, with a count of their impacts."""
    def reset(e):
        return lambda t, x: [0.0, -e * x[1], x[2] + 1]
    return System(lambda t, x: [x[1], -2.0, 0.0],
                  [Guard(lambda t, x: x[0], reset=reset(e)) for e in restitutions])


def corner(*normals):
    """Elastic walls through the origin."""
    def wall(n):
        def reset(t, x):
            speed = n[0] * x[2] + n[1] * x[3]
            return [x[0], x[1], x[2] - 2 * speed * n[0], x[3] - 2 * speed * n[1]]
        return Guard(lambda t, x: n[0] * x[0] + n[1] * x[1], reset=reset)
    return System(lambda t, x: [x[2], x[3], 0.0, 0.0], [wall(n) for n in normals])


def bits(to, watched):
    """Clocks that run to 1; clock i is watched in the modes `watched(i)`."""
    return System(lambda m, t, x: [1.0, 1.0],
                  [Guard(lambda m, t, x, i=i: 1 - x[i], reset=lambda m, t, x, i=i: to(m, i),
                         in_modes=watched(i)) for i in range(2)], modes=4)


def idle(enabled):
    """Stands at 0 until a tick at 1 lets it fall; the guard x stops it."""
    return System(lambda m, t, x: [-1.0 if m == "falls" else 0.0],
                  [Guard(lambda m, t, x: x[0], reset=lambda m, t, x: "idle",
                         in_modes=["falls"] if enabled else None)],
                  modes=("idle", "falls"), time_events=[1.0], time_reset=lambda m, t, x: "falls")


def thrown(recorder):
    guards = [Guard(lambda t, x: x[1], reset=lambda t, x: [x[0], 0.0, x[2], -0.5 * x[3]],
                    rest=lambda t, x: [x[0], 0.0, x[2], 0.0])]
    if recorder:
        guards.append(Guard(lambda t, x: x[0] - 10, direction=0))
    return System(lambda t, x: [x[2], x[3], 0.0, -10.0], guards)


def ball(rest, pull=lambda t: -10.0, **more):
    return System(lambda t, x: [x[1], pull(t)],
                  [Guard(lambda t, x: x[0], reset=lambda t, x: [0.0, -0.5 * x[1]],
                         rest=lambda t, x: rest)], **more)


def breakaway():
    return counting(lambda m, t, x: [0.0], lambda m, t, x: 0.5 - math.sin(t),
                    lambda m, t, x: 1 if math.sin(t) >= 0.5 else m, modes=2)


def avalanche(n):
    def kick(i):
        def reset(t, x):
            y = np.array(x)
            y[i] = 0
            if i + 1 < n:
                y[i + 1] += 0.6
            return y
        return reset
    return System(lambda t, x: [1.0] + [0.0] * (n - 1),
                  [Guard(lambda t, x, i=i: x[i] - 1, direction=1, reset=kick(i)) for i in range(n)])


def dose_and_tick():
    return System(lambda t, x: [-x[0]], [Guard(lambda t, x: 2.95 - t, reset=lambda t, x: [x[0] + 2])],
                  time_events=[2.95], time_reset=lambda t, x: [x[0] + 2])


def signed_relay():
    return System(lambda t, x: [-x[1], 0.0],
                  [Guard(lambda t, x: x[1] * x[0], reset=lambda t, x: [x[0], -x[1]])])


def two_guards_of_a_relay():
    return System(lambda m, t, x: [1.0 if m else -1.0],
                  [Guard(lambda m, t, x: x[0], reset=lambda m, t, x: 1),
                   Guard(lambda m, t, x: -x[0], reset=lambda m, t, x: 0)], modes=2)


def rising_relay():
    return System(lambda m, t, x: [-1.0 if m else 1.0],
                  [Guard(lambda m, t, x: x[0] if not m else -x[0], direction=1,
                         reset=lambda m, t, x: 1 - m)], modes=2)


def window():
    return System(still, [Guard(lambda t, x: (t - 1) * (t - 1.05), reset=lambda t, x: [x[0] + 1, x[1]]),
                          Guard(lambda t, x: 1.08 - t, reset=lambda t, x: [x[0], x[1] + 1])])


def touch_at_a_tick():
    return System(lambda m, t, x: [1.0],
                  [Guard(lambda m, t, x: (x[0] - 1) ** 2, reset=lambda m, t, x: 1 - m)], modes=2,
                  time_events=[1.0], time_reset=lambda m, t, x: m)


def clocks():
    return System(lambda t, x: [1.0] * 6,
                  [Guard(lambda t, x, i=i: 0.125 - x[i],
                         reset=lambda t, x, i=i: [0.0 if k == i else x[k] for k in range(6)])
                   for i in range(6)])


E_05 = math.exp(-10) + 4 * math.exp(-7.05)
WIDE = ((math.sqrt(3) / 2, 0.5), (-math.sqrt(3) / 2, 0.5))

#: number of the system, system, start, t_end, and what is expected: times of events, with those of time
#: events, `x` and `mode` at the end, the outcome.
SYSTEMS = [
    ("2", breakaway(), [0.0], 1, dict(times=[0.523598775598299], mode=1)),
    ("5 window", window(), [0.0, 0.0], 2, dict(times=[1.08, 1.08], x=[1, 1], event_window=0.1)),
    ("6 tick", dose_and_tick(), [1.0], 10, dict(times=[2.95, 2.95], x=[E_05])),
    ("7 min", both_at_one(lambda t, x: [min(x[0], 1)], lambda t, x: [min(x[0], 2)]), [3.0], 2, dict(x=[1])),
    ("7 cap", both_at_one(*2 * [lambda t, x: [min(x[0] + 2, 10)]]), [7.0], 2, dict(x=[10])),
    ("7 set", both_at_one(*2 * [lambda t, x: [5.0]]), [1.0], 2, dict(x=[5])),
    ("7 flip", both_at_one(*2 * [lambda t, x: [1 - x[0]]]), [0.0], 2, dict(x=[0])),
    ("8 equal", floors(0.5, 0.5), [1.0, 0.0, 0.0], 1.5, dict(times=[1, 1], x=[0.25, 0, 2])),
    ("8 unequal", floors(0.5, 0.8), [1.0, 0.0, 0.0], 2, dict(outcome="conflicting_resets")),
    ("8 reversed", floors(0.8, 0.5), [1.0, 0.0, 0.0], 2, dict(outcome="conflicting_resets")),
    ("9 right", corner((0.6, 0.8), (-0.8, 0.6)), [0.0, 1.0, 0.0, -1.0], 2, dict(x=[0, 1, 0, 1])),
    ("9 wide", corner(*WIDE), [0.0, 1.0, 0.0, -1.0], 2, dict(outcome="conflicting_resets")),
    ("10", bits(lambda m, i: m | 1 << i, lambda i: [m for m in range(4) if not m >> i & 1]), [0.0, 0.0], 2, dict(times=[1, 1], mode=3)),
    ("10 conflict", bits(lambda m, i: 1 + i, lambda i: [0]), [0.0, 0.0], 2, dict(outcome="conflicting_resets")),
    ("11 two guards", two_guards_of_a_relay(), [1.0], 3, dict(outcome="endless_cascade")),
    ("11 rising", rising_relay(), [-1.0], 3, dict(outcome="endless_cascade")),
    ("11 sign", signed_relay(), [1.0, 1.0], 3, dict(outcome="endless_cascade")),
    ("12", counting(lambda m, t, x: [-1.0], lambda m, t, x: x[0] - 1, lambda m, t, x: m + 1), [3.0], 5,
     dict(times=[2], mode=1, x=[-2])),
    ("13", counting(lambda m, t, x: [(-1.0, 1.0, -1.0)[m]], lambda m, t, x: -x[0] if m else x[0],
                    lambda m, t, x: m + 1, modes=3), [1.0], 3, dict(times=[1, 1], mode=2, x=[-2])),
    ("14", idle(False), [0.0], 3, dict(times=[1, 1], x=[0])),
    ("14 enabled", idle(True), [0.0], 3, dict(times=[1, 1], x=[0])),
    ("15 triangle", counting(lambda m, t, x: [1.0 if m else -1.0], lambda m, t, x: 1 - x[0] if m else x[0],
                             lambda m, t, x: 1 - m, modes=2), [0.5], 4, dict(times=[0.5, 1.5, 2.5, 3.5])),
    ("15 stages", System(lambda m, t, x: [-1.0],
                         [Guard(lambda m, t, x: x[0] - (1, 0.5, 0, 0)[m], reset=lambda m, t, x: m + 1,
                                in_modes=[0, 1, 2])], modes=4), [2.0], 3,
     dict(times=[1, 1.5, 2], mode=3)),
    ("16", thrown(False), [0.0, 0.1, 1.0, 0.0], 4, dict(limits=[0.424264068711929], x=[4, 0, 1, 0])),
    ("16 recorder", thrown(True), [0.0, 0.1, 1.0, 0.0], 4, dict(limits=[0.424264068711929], x=[4, 0, 1, 0])),
    ("17", ball([0.0, 5.0]), [0.2, 0.0], 10, dict(limits=[0.6, 2.6, 4.6, 6.6, 8.6], x=[0.2, -1.5])),
    ("18 kick", ball([0.0, 0.0], time_events=[2.0], time_reset=lambda t, x: [x[0], x[1] + 1]), [0.2, 0.0], 2.1,
     dict(limits=[0.6], x=[0.05, 0])),
    ("18 lift", ball([0.0, 0.0], lambda t: -10.0 if t < 1 else -10 + 10 * (t - 1), time_events=[1.0]),
     [0.2, 0.0], 3, dict(limits=[0.6], x=[5 / 3, 5])),
    ("20", clocks(), [-k * TINY for k in (0, 11, 17, 20, 21, 22)], 5.06, dict(count=240)),
    ("21", avalanche(100), [0.5] * 100, 0.75, dict(times=[0.5] * 100, x=[0.25] + [0] * 99)),
    ("22 touch", touch_at_a_tick(), [0.0], 2, dict(times=[1, 1], mode=0)),
]


@pytest.mark.parametrize("method", ["dopri5", "fehlberg78"])
@pytest.mark.parametrize("system, x0, t_end, expected", [case[1:] for case in SYSTEMS],
                         ids=[case[0] for case in SYSTEMS])
def test_the_system_has_the_meaning_of_its_events(system, x0, t_end, expected, method):
    options = {name: expected[name] for name in ("event_window",) if name in expected}
    run = integrate(system, x0, t_end, method=method, **options)
    assert run.outcome == expected.get("outcome", "reached_end"), run.message
    events = run.events
    limits = events["kind"] == Kind.ACCUMULATION
    if "times" in expected:
        np.testing.assert_allclose(events["t"], expected["times"], atol=1e-8)
    if "count" in expected:
        assert len(events) == expected["count"]
    if "limits" in expected:
        np.testing.assert_allclose(events["t"][limits], expected["limits"], atol=1e-8)
    if "x" in expected:
        np.testing.assert_allclose(run.x, expected["x"], atol=1e-7)
    if "mode" in expected:
        assert run.mode == expected["mode"]


def test_4_each_of_sixteen_events_calls_its_reset_once():
    calls = []

    def reset(t, x):
        calls.append(t)
        return x

    run = integrate(System(lambda t, x: [1.0], [Guard(lambda t, x: math.sin(x[0]), reset=reset)]), [0.5], 100)
    assert len(run.events) == len(calls) == 16


def test_5_a_creeping_state_satisfies_its_condition_at_its_event():
    # The event lies within the rounding of x over its rate of 0.888.
    seen = []

    def reset(t, x):
        seen.append(x[0] - 1)
        return x

    run = integrate(System(lambda t, x: [-1e-15], [Guard(lambda t, x: x[0] - 1, reset=reset)]), [1 + 2.0 ** -50],
                    4)
    assert len(run.events) == 1 and abs(run.events["t"][0] - 0.888) < 0.2
    assert max(seen) <= 0


def test_25_runs_that_follow_each_other_lose_and_double_nothing():
    assert len(integrate(System(lambda t, x: [1.0], [Guard(lambda t, x: 1 - x[0])]), [1 - TINY], 1).events) == 1
    system = System(lambda t, x: [0.07],
                    [Guard(lambda t, x, m=m: 0.07 * m - x[0], stop_after=0) for m in range(2, 41)])
    found, x = [], [0.0]
    for k in range(41):
        run = integrate(system, x, k + 1.0, t_start=float(k), continues=k > 0)
        found += run.events["guard"].tolist()
        x = run.x
    assert sorted(found) == list(range(39))
