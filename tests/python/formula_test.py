"""Systems whose flow and guards are formulas."""

import math

import numpy as np
import pytest

import ricochet

METHODS = ["dopri5", "fehlberg78", "taylor"]


def pendulum(**members):
    return ricochet.System(
        lambda t, x: [x[1], -9.81 * np.sin(x[0]) + 0.1 * np.cos(2 * t)],
        guards=[ricochet.Guard(lambda t, x: x[0], name="wall", direction=-1, unilateral=True,
                               reset=lambda t, x: [0.0, -0.8 * x[1]])], **members)


@pytest.mark.parametrize("method", METHODS)
def test_a_formula_gives_what_its_function_gives(method):
    # The tolerance is that of the method; the functions are evaluated to the last bit or two.
    options = dict(rtol=1e-12, atol=1e-12, record_steps=True)
    by_calls = ricochet.integrate(pendulum(), [1.0, 0.0], 8.0, method="fehlberg78", **options)
    run = ricochet.integrate(pendulum(formula=2), [1.0, 0.0], 8.0, method=method, **options)
    assert run.success and len(run.events) == len(by_calls.events) > 5
    np.testing.assert_allclose(run.events["t"], by_calls.events["t"], atol=1e-9)
    np.testing.assert_allclose(run.solution(3.0), by_calls.solution(3.0), atol=1e-9)


def test_taylor_series_prove_steps_of_formulas_and_go_backward():
    swing = ricochet.System(lambda t, x: [x[1], -np.sin(x[0])], formula=2,
                            guards=[ricochet.Guard(lambda t, x: x[1], direction=0)])
    options = dict(method="taylor", rtol=1e-14, atol=1e-14)
    run = ricochet.integrate(swing, [1.0, 0.0], 50.0, **options)
    half = ricochet.Pendulum(gravity=1.0).half_period(1.0)
    np.testing.assert_allclose(run.events["t"], half * np.arange(1, len(run.events) + 1),
                               atol=1e-12)
    assert run.statistics.evidence.proved > 20
    home = ricochet.integrate(swing, run.x, 0.0, t_start=50.0, **options)
    np.testing.assert_allclose(home.x, [1.0, 0.0], atol=1e-11)
    free = ricochet.System(lambda t, x: [x[1], -np.sin(x[0])], formula=2)
    np.testing.assert_allclose(ricochet.integrate(free, [1.0, 0.0], 50.0, **options).x, run.x,
                               atol=1e-12)


def test_every_operation_of_a_formula():
    def everything(t, x):
        u, v = x
        return [np.sqrt(1.5 + v * v) - np.cbrt(2 + u) + (1.2 + u**2) ** 1.7 / 9 - u / 2.0**v,
                np.exp(-v * v) + np.sinh(0.5 * u) - np.cosh(0.4 * v) + np.log(3 + u * u) / 3
                + np.tanh(v) / (1 + t * t) - np.arcsin(0.1 * u) + np.arccos(0.1 * v)
                + np.arctan(u) * v - np.tan(0.1 * u) + np.arctan2(v, 2 + u * u)
                - np.hypot(1 + u, v) + +np.pi - np.sin(t) * np.cos(u) + (-v) * np.square(u)
                - x.sum() / 3 + np.array([0.1, 0.2]) @ x]

    expected = ricochet.integrate(ricochet.System(everything), [0.3, 0.2], 1.0,
                                  method="fehlberg78", rtol=1e-13, atol=1e-13)
    assert expected.success
    for method in METHODS:
        run = ricochet.integrate(ricochet.System(everything, formula=2), [0.3, 0.2], 1.0,
                                 method=method, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(run.x, expected.x, rtol=1e-9)


def test_numbers_before_symbols_in_functions_of_two():
    def beside(t, x):
        numbers = np.array([2.0, 3.0])
        return (np.arctan2(1.5, x) + np.hypot(numbers, x) / 4 + np.arctan2(x, numbers)
                + [np.arctan2(2, x[0]) * np.float64(0.5), np.hypot(np.float32(0.5), x[1])])

    expected = ricochet.integrate(ricochet.System(beside), [0.3, 0.2], 1.0, rtol=1e-12, atol=1e-12)
    assert expected.success
    for method in METHODS:
        run = ricochet.integrate(ricochet.System(beside, formula=2), [0.3, 0.2], 1.0,
                                 method=method, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(run.x, expected.x, rtol=1e-9)


def test_modes_arguments_and_times_of_formulas():
    # From 2 down to 1 in log 2 / decay, and up again in log(3 / 2) / growth.
    def flow(mode, t, x, decay, growth):
        return [-decay * x[0] if mode == "off" else growth * (4.0 - x[0])]

    heater = ricochet.System(flow, modes=["off", "on"], formula=1, guards=[
        ricochet.Guard(lambda mode, t, x, *args: x[0] - 1, name="cold", in_modes="off",
                       reset=lambda mode, t, x, *args: "on"),
        ricochet.Guard(lambda mode, t, x, *args: 2 - x[0], name="warm", in_modes="on",
                       reset=lambda mode, t, x, *args: "off")])
    for method in ("Taylor", "DOP853"):
        found = ricochet.solve_ivp(heater, (0, 5), [2.0], method=method, args=(2.0, 0.25),
                                   rtol=1e-12, atol=1e-12)
        down, up = math.log(2) / 2, math.log(1.5) / 0.25
        assert found.t_events[0][0] == pytest.approx(down, abs=1e-11)
        assert found.t_events[1][0] == pytest.approx(down + up, abs=1e-11)
    kicked = ricochet.System(lambda t, x: [x[1], -x[0]], formula=2, time_events=[1.0, 2.5],
                             time_reset=lambda t, x: [x[0], x[1] + 1])
    by_series, by_stages = (ricochet.integrate(kicked, [1.0, 0.0], 4.0, method=method, rtol=1e-12,
                                               atol=1e-12) for method in ("taylor", "fehlberg78"))
    np.testing.assert_allclose(by_series.x, by_stages.x, atol=1e-10)
    assert len(by_series.events) == 2


def test_runs_of_formulas_can_be_saved():
    options = dict(method="taylor", rtol=1e-13, atol=1e-13)
    whole = ricochet.integrate(pendulum(formula=2), [1.0, 0.0], 8.0, **options)
    first = ricochet.Simulation(pendulum(formula=2), [1.0, 0.0], 8.0, **options)
    for _ in range(5):
        first.step()
    second = ricochet.Simulation(pendulum(formula=2), [1.0, 0.0], 8.0, **options)
    second.restore(first.save())
    assert np.array_equal(second.run_to_end().x, whole.x)


def test_an_exception_of_a_reset_arrives_as_it_is():
    def fail(t, x):
        raise KeyError("mine")

    falling = ricochet.System(lambda t, x: [x[1], -9.81], formula=2,
                              guards=[ricochet.Guard(lambda t, x: x[0], reset=fail)])
    for method in METHODS:
        with pytest.raises(KeyError, match="mine") as raised:
            ricochet.integrate(falling, [1.0, 0.0], 5.0, method=method)
        assert raised.value.ricochet_run.t <= math.sqrt(2 / 9.81)


@pytest.mark.parametrize("flow, message", [
    (lambda t, x: [abs(x[0])], "kink"),
    (lambda t, x: [np.maximum(x[0], 0)], "kink"),
    (lambda t, x: [1.0 if x[0] > 0 else 2.0], "comparison"),
    (lambda t, x: [1.0 if x[0] else 2.0], "comparison"),
    (lambda t, x: [math.sin(x[0])], "np.sin"),
    (lambda t, x: [x[0] % 2], "kink"),
    (lambda t, x: [np.floor(x[0])], "kink"),
    (lambda t, x: [x[0], x[0]], "returned 2 numbers, expected 1"),
    (lambda t, x: ["a"], "expected formulas and numbers"),
])
def test_what_is_no_formula_is_refused(flow, message):
    with pytest.raises((TypeError, ValueError), match=message):
        ricochet.integrate(ricochet.System(flow, formula=1), [1.0], 1.0)


def test_formulas_of_another_size_are_refused():
    with pytest.raises(ValueError, match="found 3 components for a formula of 2"):
        ricochet.integrate(pendulum(formula=2), [1.0, 0.0, 0.0], 1.0)
    with pytest.raises(ValueError, match="found 3 components for a formula of 2"):
        ricochet.integrate(pendulum(formula=2), [1.0, 0.0, 0.0], 1.0, method="taylor")
    for wrong in (0, -1, 1.5, "two", True):
        with pytest.raises(ValueError, match="formula"):
            ricochet.integrate(pendulum(formula=wrong), [1.0, 0.0], 1.0)
    with pytest.raises(ValueError, match="guard_values"):
        ricochet.integrate(pendulum(formula=2, guard_values=lambda t, x: [x[0]]), [1.0, 0.0], 1.0)
    with pytest.raises(ValueError, match="not finite"):
        ricochet.integrate(ricochet.System(lambda t, x: [math.nan * x[0]], formula=1), [1.0], 1.0,
                           method="taylor")


def test_a_reset_is_told_the_direction_by_series_too():
    seen = []

    def reset(t, x, direction):
        seen.append(direction)
        return x

    guard = ricochet.Guard(lambda t, x: x[0], direction=0, directed=True, reset=reset)
    system = ricochet.System(lambda t, x: [x[1], -x[0]], [guard], formula=2)
    for method in ("taylor", "fehlberg78"):
        seen.clear()
        run = ricochet.integrate(system, [1.0, 0.0], 9.0, method=method)
        assert len(run.events) >= 3 and seen[:3] == [-1, 1, -1]


# --- formulas that a system keeps ---

FACTOR = 2.0


def helper(x):
    return FACTOR * x


class Calls(ricochet.System):
    """Counts how often its functions are called with symbols."""

    formula = 1
    rate = 1.0
    table = [1.0, 2.0]

    def __init__(self):
        super().__init__()
        self.offset = 0.0

    def flow(self, t, x):
        calls.append("flow")
        return [helper(x[0]) * self.rate + self.offset + self.table[1]]

    def guard(self, t, x):
        return x[0] - 5


calls = []


def recorded(system, **more):
    calls.clear()
    run = ricochet.integrate(system, [1.0], 0.1, **more)
    return bool(calls), run.x[0]


def test_formulas_are_recorded_again_where_something_they_read_has_changed():
    global FACTOR

    system = Calls()
    assert recorded(system)[0]
    # `calls` itself is read by the function, and has changed by the call; another one has not.
    first = recorded(system)
    again = recorded(system)
    assert not again[0] and again[1] == first[1]
    seen = {again[1]}
    for change in (lambda: setattr(system, "offset", 1.0), lambda: setattr(Calls, "rate", 3.0),
                   lambda: Calls.table.__setitem__(1, 7.0), lambda: setattr(system, "rate", -0.5),
                   lambda: globals().__setitem__("FACTOR", 4.0)):
        change()
        was_recorded, x = recorded(system)
        assert was_recorded and x not in seen
        seen.add(x)
    FACTOR = 2.0


def test_a_sign_of_zero_is_a_change():
    sign = [0.0]
    system = ricochet.System(lambda t, x: [1.0 + 0 * x[0] / np.hypot(x[0], 1) + np.arctan2(sign[0], -1.0 + 0 * x[0])],
                             formula=1)
    up = ricochet.integrate(system, [1.0], 1.0).x[0]
    sign[0] = -0.0
    assert ricochet.integrate(system, [1.0], 1.0).x[0] < 0 < up


def test_what_may_change_unseen_is_recorded_for_every_run():
    class Box:
        value = 1.0

    box, noted = Box(), []

    def flow(t, x):
        noted.append(1)
        return [box.value * x[0]]

    system = ricochet.System(flow, formula=1)
    first = ricochet.integrate(system, [1.0], 1.0).x[0]
    box.value = 2.0
    assert abs(ricochet.integrate(system, [1.0], 1.0).x[0] - first**2) < 1e-6 and len(noted) == 2
    flow.factor = 1.0
    for factor in (1.0, 3.0):
        flow.factor = factor
        own = ricochet.System(lambda t, x: [flow.factor + 0 * x[0]], formula=1)
        assert ricochet.integrate(own, [0.0], 1.0).x[0] == pytest.approx(factor)


def test_kept_formulas_do_not_hinder_copies_and_threads():
    import copy
    import pickle
    from concurrent.futures import ThreadPoolExecutor

    system = Calls()
    expected = recorded(system)[1]
    for again in (copy.copy(system), copy.deepcopy(system), pickle.loads(pickle.dumps(system))):
        assert recorded(again)[1] == expected
    with ThreadPoolExecutor(4) as threads:
        ends = list(threads.map(lambda _: ricochet.integrate(system, [1.0], 0.1).x[0], range(40)))
    assert set(ends) == {expected}


SCALE = [2.0]


def scaled(x, by=1.0, *, more=1.0):
    return SCALE[0] * by * more * x


def test_a_system_that_is_kept_sees_every_change():
    cell, table, array = 1.0, {"a": 1.0}, np.array([1.0, 2.0])

    class Growth(ricochet.System):
        formula = 1
        rate = 0.1

        def __init__(self):
            super().__init__()
            self.offset = 0.0
            self.guards = [ricochet.Guard(lambda t, x: x[0] - 1.2, direction=1)]

        def flow(self, t, x):
            return [scaled(x[0]) * self.rate + self.offset + cell + table["a"] + array[1] * flow_of.factor]

    def flow_of():
        return None

    flow_of.factor = 1.0
    system = Growth()

    def end():
        run = ricochet.integrate(system, [1.0], 0.1)
        return run.x[0], run.events["t"].tolist()

    def change_cell():
        nonlocal cell
        cell = 2.0

    def other_code(x, by=1.0, *, more=1.0):
        return 7.0 * by * more * x

    changes = (
        change_cell, lambda: table.__setitem__("a", 3.0), lambda: array.__setitem__(1, 5.0),
        lambda: SCALE.__setitem__(0, 4.0), lambda: setattr(flow_of, "factor", 2.0),
        lambda: setattr(system, "offset", 0.5), lambda: setattr(Growth, "rate", 0.2),
        lambda: setattr(system, "rate", 0.3), lambda: setattr(scaled, "__defaults__", (2.0,)),
        lambda: scaled.__kwdefaults__.__setitem__("more", 3.0),
        lambda: setattr(scaled, "__code__", other_code.__code__),
        lambda: setattr(Growth, "flow", lambda self, t, x: [1.0 + 0 * x[0]]),
        lambda: system.guards.__setitem__(0, ricochet.Guard(lambda t, x: x[0] - 1.05, direction=1)),
        lambda: system.guards.append(ricochet.Guard(lambda t, x: x[0] - 1.07, direction=1)),
        lambda: setattr(system, "guards", []))
    seen = []
    kept = scaled.__code__, dict(scaled.__kwdefaults__)
    try:
        for change in (lambda: None, *changes):
            change()
            first = end()
            assert seen[-1:] != [first]
            seen.append(first)
            assert [end(), end(), end()] == 3 * [first]
            assert system._kept_run() is not None
    finally:
        SCALE[0] = 2.0
        scaled.__code__, scaled.__kwdefaults__, scaled.__defaults__ = *kept, (1.0,)


def test_a_copy_of_a_system_that_is_kept_is_another_one():
    import copy

    class Shift(ricochet.System):
        formula = 1
        offset = 0.0

        def flow(self, t, x):
            return [self.offset + 0 * x[0]]

    first = Shift()
    for _ in range(3):
        assert ricochet.integrate(first, [0.0], 1.0).x[0] == 0
    second = copy.copy(first)
    second.offset = 2.0
    for _ in range(3):
        assert ricochet.integrate(second, [0.0], 1.0).x[0] == pytest.approx(2.0)
        assert ricochet.integrate(first, [0.0], 1.0).x[0] == 0


def test_systems_that_are_kept_are_given_back():
    import gc
    import weakref

    class Fall(ricochet.System):
        formula = 2

        def __init__(self):
            super().__init__()
            self.own = self.flow  # a cycle

        def flow(self, t, x):
            return [x[1], -9.81]

    system = Fall()
    for _ in range(3):
        ricochet.integrate(system, [10.0, 0.0], 1.0)
    gone = weakref.ref(system)
    del system
    gc.collect()
    assert gone() is None


def test_modes_args_and_guards_have_their_own_formulas():
    system = ricochet.System(lambda mode, t, x: [1.0 if mode == "up" else -1.0 + 0 * x[0]],
                             modes=("up", "down"), formula=1)
    for mode, end in (("up", 1.0), ("down", -1.0), ("up", 1.0)):
        assert ricochet.integrate(system, [0.0], 1.0, mode=mode).x[0] == pytest.approx(end)
    scaled = ricochet.System(lambda t, x, a: [a + 0 * x[0]], formula=1)
    for a in (1.0, 2.0, 1.0):
        assert ricochet.solve_ivp(scaled, (0, 1), [0.0], args=(a,)).y[0, -1] == pytest.approx(a)
    guard = ricochet.Guard(lambda t, x: x[0] - 0.5, direction=1)
    guarded = ricochet.System(lambda t, x: [1.0 + 0 * x[0]], [guard], formula=1)
    assert ricochet.integrate(guarded, [0.0], 1.0).events["t"][0] == pytest.approx(0.5)
    guarded.guards = [ricochet.Guard(lambda t, x: x[0] - 0.75, direction=1)]
    assert ricochet.integrate(guarded, [0.0], 1.0).events["t"][0] == pytest.approx(0.75)


def fall(t, x):
    return [x[1], -9.81]


def ball(reset, **guard):
    return ricochet.System(fall, [ricochet.Guard(lambda t, x: x[0], reset=reset, unilateral=True, **guard)],
                           formula=2)


def impacts(system, t_end=8.0):
    return ricochet.integrate(system, [10.0, 0.0], t_end).events["t"]


def test_a_reset_that_changes_nothing_outside_is_called_for_its_formula_alone():
    restitution = 0.8

    def by_list(t, x):
        return [0.0, -restitution * x[1]]

    def in_place(t, x):
        x[0], x[1] = 0, -restitution * x[1]
        return x

    expected = impacts(ricochet.System(fall, [ricochet.Guard(lambda t, x: x[0], reset=by_list,
                                                             rate=lambda t, x, dxdt: dxdt[0])]))
    assert len(expected) == 4
    for reset in by_list, in_place:
        system = ball(reset, rest=lambda t, x: [0.0, 0.0])
        assert np.array_equal(impacts(system), expected)
        kept = system._kept_resets.pair[1]
        assert set(kept) == {("0", "reset"), ("0", "rest")} and all(kept.values())
        recorded = kept["0", "reset"]
        assert np.array_equal(impacts(system), expected)
        assert system._kept_resets.pair[1]["0", "reset"] is recorded
    # What it reads is read again.
    restitution = 0.5
    assert impacts(system)[1] != expected[1]
    assert impacts(system)[1] == pytest.approx(2 * math.sqrt(20 / 9.81), abs=1e-12)


def test_a_reset_with_an_effect_outside_is_called_at_each_event():
    times, counts, total = [], {"floor": 0}, 0
    random = np.random.default_rng(1)

    def appends(t, x):
        times.append(t)
        return [0.0, -0.8 * x[1]]

    def counts_in_a_dictionary(t, x):
        counts["floor"] += 1
        return [0.0, -0.8 * x[1]]

    def counts_in_a_variable(t, x):
        nonlocal total
        total += 1
        return [0.0, -0.8 * x[1]]

    def by_another(t, x):
        return appends(t, x)

    found = impacts(ball(appends))
    assert times == list(found) and len(found) == 4
    impacts(ball(by_another))
    assert times == 2 * list(found)
    impacts(ball(counts_in_a_dictionary))
    impacts(ball(counts_in_a_variable))
    assert counts["floor"] == total == len(found)
    drawn = impacts(ball(lambda t, x: [0.0, -random.uniform(0.7, 0.9) * x[1]]))
    flights = np.diff(drawn)
    assert len(set(np.round(flights[1:] / flights[:-1], 6))) == len(flights) - 1

    class Counted(ricochet.System):
        formula, n = 2, 0
        flow = staticmethod(fall)

        @ricochet.guard(unilateral=True)
        def floor(self, t, x):
            return x[0]

        @floor.reset
        def floor(self, t, x):
            self.n += 1
            return [0.0, -0.8 * x[1]]

    system = Counted()
    impacts(system)
    assert system.n == len(found)


def test_resets_that_compare_or_stop_remain_functions():
    slow = impacts(ball(lambda t, x: [0.0, -0.8 * x[1] if x[1] < -5 else 0.0]), 20.0)
    assert 3 < len(slow) < 12
    run = ricochet.integrate(ball(lambda t, x: ricochet.Stop("enough")), [10.0, 0.0], 8.0)
    assert run.outcome == "stopped_by_event" and len(run.events) == 1
    with pytest.raises(ValueError, match="reset"):
        impacts(ball(lambda t, x: [0.0]))


def test_recorded_resets_change_modes_and_act_at_times():
    class Thermostat(ricochet.System):
        modes, formula = ("off", "on"), 1
        time_events = [3.0]

        def flow(self, mode, t, x):
            return [-0.1 * (x[0] - (30.0 if mode == "on" else 0.0))]

        def time_reset(self, mode, t, x):
            return mode, x + 0.5

        @ricochet.guard(in_modes=["off"])
        def too_cold(self, mode, t, x):
            return x[0] - 18

        @too_cold.reset
        def too_cold(self, mode, t, x):
            return "on"

        @ricochet.guard(in_modes=["on"])
        def too_warm(self, mode, t, x):
            return 22 - x[0]

        @too_warm.reset
        def too_warm(self, mode, t, x):
            return "off", x - 0.25

    class Called(Thermostat):
        formula = None
        too_cold = Thermostat.too_cold.rate(lambda self, mode, t, x, dxdt: dxdt[0])
        too_warm = Thermostat.too_warm.rate(lambda self, mode, t, x, dxdt: -dxdt[0])

    system = Thermostat()
    run = ricochet.integrate(system, [20.0], 48.0, mode="off")
    expected = ricochet.integrate(Called(), [20.0], 48.0, mode="off")
    assert all(system._kept_resets.pair[1].values()) and len(system._kept_resets.pair[1]) == 3
    assert run.mode == expected.mode and len(run.events) == len(expected.events) > 10
    assert np.array_equal(run.events["t"], expected.events["t"])
    assert np.array_equal(run.x, expected.x)


def test_guards_of_formulas_need_no_more_calls_than_those_of_cpp():
    ready = ricochet.integrate(ricochet.BouncingBall(gravity=9.81, restitution=0.9), [10.0, 0.0], 20.5)
    own = ricochet.System(
        lambda t, x: [x[1], -9.81], [ricochet.Guard(lambda t, x: x[0], unilateral=True,
                                                    reset=lambda t, x: [0.0, -0.9 * x[1]])], formula=2)
    for options in {}, dict(record_steps=True):  # the loop for small states, and the general one
        run = ricochet.integrate(own, [10.0, 0.0], 20.5, **options)
        assert run.statistics.guard_calls == ready.statistics.guard_calls
        assert run.events["t"].tolist() == ready.events["t"].tolist()


def test_a_rate_of_a_formula_that_is_infinite_is_a_difference():
    fall = ricochet.System(lambda t, x: [x[1], -9.81], [ricochet.Guard(lambda t, x: np.cbrt(x[0]))], formula=2)
    for options in {}, dict(record_steps=True):
        run = ricochet.integrate(fall, [2.0, 0.0], 1.0, **options)
        assert abs(run.events["t"][0] - np.sqrt(4 / 9.81)) < 1e-12
