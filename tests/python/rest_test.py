"""Where events of a cycle of guards accumulate, and motions that only go on for long."""

import math

import numpy as np
import pytest

import ricochet
from ricochet import Guard, Kind, System


def cycle(motion, guards, rests, disables=False):
    """A system of two guards in the modes "first" and "second"; in "rest" nothing happens.

    ``motion(mode, x)`` is the flow, ``guards`` two pairs of value(x) and reset(mode, x); with
    ``disables`` each guard belongs to a mode.
    """
    modes = ("first", "second", "rest")

    def guard(k, value, reset):
        return Guard(lambda mode, t, x: value(x), name=f"guard of {modes[k]}",
                     reset=lambda mode, t, x: reset(mode, x),
                     rest=(lambda mode, t, x: "rest") if rests else None,
                     in_modes=[modes[k]] if disables else modes[:2])

    return System(lambda mode, t, x: [0.0, 0.0] if mode == "rest" else motion(mode, x),
                  [guard(k, *of) for k, of in enumerate(guards)], modes=modes)


def expect_limit(make, start, limit, slack):
    """One accumulation, at ``limit`` within its error and ``slack``, the error of the method;
    without a rest the end of the run there, which names both guards."""
    options = dict(mode="first", rtol=1e-12, atol=1e-14, max_steps=200_000)
    run = ricochet.integrate(make(True), start, 2 * limit, **options)
    assert run.outcome == "reached_end" and run.mode == "rest"
    kinds = run.events["kind"].tolist()
    assert kinds == [Kind.CROSSING] * (len(kinds) - 1) + [Kind.ACCUMULATION]
    assert 10 < len(kinds) < 400  # most where zero has no rounding: the block takes 336
    last = run.events[-1]
    assert abs(last["t"] - limit) <= last["error"] + slack
    assert last["error"] < 1e-4 * limit

    ended = ricochet.integrate(make(False), start, 2 * limit, **options)
    assert ended.outcome == "zeno" and abs(ended.t - limit) <= last["error"] + slack
    assert {ended.guard, ended.other_guard} == {0, 1}
    assert "guard of first" in ended.message and "guard of second" in ended.message


def test_a_wheel_without_a_rim_stops_on_two_spokes():
    slope, half = 0.05, 0.3
    part = math.cos(2 * half)

    def excursion(a, v):
        # From the angle a at the speed v: 2 cos(a - d) = 2 cos a + v^2 gives the place of the turn,
        # and with a - d + d u^2 for the angle the integrand is smooth. The midpoint rule.
        d = 0.0
        for _ in range(50):
            d = 2 * math.asin(v * v / (4 * math.sin(a - d / 2)))
        u = (np.arange(5000) + 0.5) / 5000
        s = np.sin(a - d + d * u * u / 2) * np.sin(d * u * u / 2)
        return 2 * np.mean(d * u / np.sqrt(s))

    limit = sum(excursion(half - slope if k % 2 == 0 else half + slope, 0.15 * part**k)
                for k in range(200))

    def onto(angle):
        return lambda mode, x: (mode, [angle, part * x[1]])

    def wheel(rests):
        return cycle(lambda mode, x: [x[1], math.sin(x[0])],
                     [(lambda x: slope + half - x[0], onto(slope - half)),
                      (lambda x: x[0] - (slope - half), onto(slope + half))], rests)

    expect_limit(wheel, [slope - half, 0.15], limit, 1e-7 * limit)


@pytest.mark.parametrize("offset", [0.0, 1.0, 100.0])
def test_a_block_rocks_to_rest_at_any_place(offset):
    # p - |x| grows from p as cosh: a half turn at the speed v takes 2 atanh(v / p).
    p = 0.3
    limit = sum(2 * math.atanh(0.2 * 0.8**k / p) for k in range(300))

    def block(rests):
        return cycle(lambda mode, x: [x[1], x[0] - offset + (p if mode == "second" else -p)],
                     [(lambda x: x[0] - offset, lambda mode, x: ("second", [x[0], 0.8 * x[1]])),
                      (lambda x: offset - x[0], lambda mode, x: ("first", [x[0], 0.8 * x[1]]))],
                     rests, disables=True)

    expect_limit(block, [offset, 0.2], limit, 1e-9 * limit)


@pytest.mark.parametrize("level", [0.0, 1.0, 20.0, 100.0, 1e6])
def test_two_tanks_are_empty_together_at_any_level(level):
    # Two units of water, of which five a second leave and four come. A method that is exact here
    # leaves the rounding of the level, at each of some 60 events.
    def tanks(rests):
        return cycle(lambda mode, x: [2.0, -3.0] if mode == "first" else [-2.0, 1.0],
                     [(lambda x: x[0] - level, lambda mode, x: ("first", [level, x[1]])),
                      (lambda x: x[1] - level, lambda mode, x: ("second", [x[0], level]))], rests)

    expect_limit(tanks, [level + 1, level + 1], 2.0, 100 * 8 * 2.2e-16 * (level + 1))


def test_a_saddle_is_turned_round_between_its_guards():
    # x'' = x from (0.1, 0) with x -> -x, v -> 0.7 v at 1 and -1: acosh(10), and 2 atanh v each.
    limit = math.acosh(10) + sum(2 * math.atanh(0.7**k * math.sqrt(0.99)) for k in range(1, 200))
    assert limit == pytest.approx(8.09774537063384, abs=1e-12)

    def turned(mode, x):
        return mode, [-x[0], 0.7 * x[1]]

    def saddle(rests):
        return cycle(lambda mode, x: [x[1], x[0]],
                     [(lambda x: 1 - x[0], turned), (lambda x: 1 + x[0], turned)], rests)

    expect_limit(saddle, [0.1, 0.0], limit, 1e-9 * limit)


def test_a_limit_lies_within_its_error_where_rounding_takes_the_last_flights():
    # Hops from place to place, lower each time by e = (0.67, 0.90, 0.41) and at other weights; the
    # rounding of the place at 1 takes 2.9e-8 s of their time.
    places, e, g = (0.02904080340079248, 1.0, 0.0), (0.6714, 0.9034, 0.4051), (5.3168, 5.5902, 8.9261)
    hops = ricochet.System(
        lambda m, t, x: [x[1], -g[m] if m < 3 else 0.0],
        [ricochet.Guard(lambda m, t, x, i=i: x[0] - places[i], in_modes=[i], rest=lambda m, t, x: 3,
                        reset=lambda m, t, x, i=i: ((i + 1) % 3, [places[(i + 1) % 3], -e[i] * x[1]]))
         for i in range(3)], modes=4)
    limit, v, k = 0.0, 1.2, 0
    while v > 1e-40:
        limit, v, k = limit + 2 * v / g[k], v * e[k], (k + 1) % 3
    run = ricochet.integrate(hops, [places[0], 1.2], 2 * limit, rtol=1e-12, atol=1e-14, max_steps=200_000)
    end = run.events[run.events["kind"] == ricochet.Kind.ACCUMULATION][0]
    assert abs(end["t"] - limit) <= end["error"] <= 1e-6


def test_events_of_solve_ivp_accumulate_in_turn():
    # The same saddle. Without modes a rest holds nothing, so that the run ends at the limit.
    def turned(t, y):
        return [-y[0], 0.7 * y[1]]

    def right(t, y):
        return 1 - y[0]

    def left(t, y):
        return 1 + y[0]

    for event in (right, left):
        event.reset, event.direction = turned, -1
    result = ricochet.solve_ivp(lambda t, y: [y[1], y[0]], (0, 20), [0.1, 0.0],
                                events=[right, left], rtol=1e-12, atol=1e-14)
    assert not result.success and abs(result.t[-1] - 8.09774537063384) < 1e-6
    assert "right" in result.message and "left" in result.message


# --- long runs ---

def clock(period, most):
    """x' = 1 in formulas; strikes each time that x reaches the period."""
    return System(lambda t, x: [1.0], [Guard(lambda t, x: period - x[0], stop_after=most,
                                             reset=lambda t, x: [0.0])], formula=1)


def test_a_motion_that_keeps_its_pace_is_not_stalled():
    # 1.1e6 steps of a hundred turns a second, and 110 000 events, each step and interval less than
    # 1e-9 of the span of 1e12 s. The times are sums of the period, whose roundings add up.
    swing = ricochet.Pendulum(gravity=(200 * math.pi)**2)
    run = ricochet.integrate(swing, (0.5, 0.0), 1e12, max_steps=1_100_000, record_events=False)
    assert run.outcome == "step_limit"
    run = ricochet.integrate(clock(0.005, 110_000), [0.0], 1e12, record_events=False)
    assert run.outcome == "stopped_by_event" and run.t == pytest.approx(550, abs=1e-9)


def test_instants_that_hardly_advance_the_time_are_counted():
    # After a second, 1e5 events take 1e-8 s: less than 1e-9 of the span, and 1e-6 of the second.
    # The period is resolved there: it is 450 units in the last place of the time.
    run = ricochet.integrate(clock(1e-13, 10**7), [-1.0], 100.0, record_events=False)
    assert run.outcome == "stalled" and 100_000 <= run.statistics.events <= 300_000
