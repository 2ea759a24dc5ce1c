"""Wrong input, callbacks that fail, interrupts, threads: a defined error each."""

import math
import os
import signal
import threading
import time

import numpy as np
import pytest

import ricochet


def decay(t, y):
    return -y


def fall(t, y):
    return [y[1], -9.81]


# --- arguments ---

@pytest.mark.parametrize("times, error", [
    (1.0, TypeError), (["a"], TypeError), ([1.0, math.nan], ValueError), ([math.nan], ValueError)])
def test_time_events_that_are_none(times, error):
    with pytest.raises(error, match="time_events"):
        ricochet.integrate(ricochet.System(decay, time_events=times), [1.0], 2.0)


def test_a_time_reset_needs_time_events():
    with pytest.raises(ValueError, match="time_reset: found one without time events, expected "
                                         "time_events or next_time_event"):
        ricochet.integrate(ricochet.System(decay, time_reset=lambda t, x: x), [1.0], 2.0)


@pytest.mark.parametrize("members, words", [
    ({"guard_values": lambda t, x: [x[0] - 0.5]}, r"guard_values: .* guards=\[Guard\(name=...\)"),
    ({"reset_set": lambda t, x, fired: x}, "reset_set: found it without guards, expected some, or"),
    ({"reset_set": lambda t, x, fired: x, "time_events": [1.0]}, "reset_set: found it without")])
def test_functions_of_guards_need_guards(members, words):
    with pytest.raises(ValueError, match=words):
        ricochet.integrate(ricochet.System(decay, **members), [1.0], 2.0)
    members = dict(members, guards=[ricochet.Guard(lambda t, x: x[0] - 0.5, name="half")])
    assert "half" in ricochet.integrate(ricochet.System(decay, **members), [1.0], 2.0).guard_names


@pytest.mark.parametrize("name, meant", [
    ("unilatral", "unilateral"), ("time_event", "time_events"), ("mode", "modes")])
def test_attributes_that_are_misspelt(name, meant):
    words = f"Named: found an attribute {name!r}, expected {meant!r}; if it means what it says"
    with pytest.raises(TypeError, match=words):
        type("Named", (ricochet.System,), {name: 1})

    class Named(ricochet.System):
        low, model, names, resets = 18.0, None, ["height"], 0

        def flow(self, t, x):
            return -x

    system = Named()
    assert ricochet.integrate(system, [1.0], 1.0).success
    setattr(system, name, 1)
    with pytest.raises(TypeError, match=words):
        ricochet.integrate(system, [1.0], 1.0)
    Named._unchecked_names = True
    assert ricochet.integrate(system, [1.0], 1.0).success


@pytest.mark.parametrize("name, value", [("unilateral", True), ("direction", 1)])
def test_attributes_of_a_guard_need_the_method_guard(name, value):
    with pytest.raises(TypeError, match=f"found '{name}' without a method guard"):
        ricochet.integrate(ricochet.System(decay, **{name: value}), [1.0], 1.0)


def test_modes_are_not_letters():
    with pytest.raises(TypeError, match="modes: found 'on', expected a number, a sequence of"):
        ricochet.integrate(ricochet.System(lambda mode, t, x: -x, modes="on"), [1.0], 1.0)


def test_a_reset_returns_the_mode_before_the_state():
    system = ricochet.System(
        lambda mode, t, x: [-1.0],
        [ricochet.Guard(lambda mode, t, x: x[0], name="up", reset=lambda mode, t, x: (x, "b"))],
        modes=("a", "b"))
    with pytest.raises(ValueError, match=r"reset of up returned \(state, mode\), expected "
                                         r"\(mode, state\)"):
        ricochet.integrate(system, [1.0], 2.0)


def test_a_solution_at_no_time():
    solution = ricochet.solve_ivp(decay, (0, 1), [1.0], dense_output=True).sol
    with pytest.raises(ValueError, match="nan"):
        solution(math.nan)
    with pytest.raises(ValueError, match="nan"):
        solution([0.5, math.nan])



@pytest.mark.parametrize("y0, error", [
    ([[1.0, 2.0]], ValueError), (1.0, ValueError), ([[1j]], ValueError),
    (["a"], (TypeError, ValueError)), ([None], (TypeError, ValueError)), ([math.nan], ValueError),
    ([math.inf], ValueError), ({"a": 1}, (TypeError, ValueError))])
def test_starts_that_are_none(y0, error):
    with pytest.raises(error):
        ricochet.solve_ivp(decay, (0, 1), y0)
    with pytest.raises(error):
        ricochet.integrate(ricochet.System(decay), y0, 1.0)


@pytest.mark.parametrize("options, error, words", [
    ({"method": "rk"}, ValueError, "'rk'"), ({"method": 3}, ValueError, "3"),
    ({"t_eval": [0.5, 2.0]}, ValueError, "2.0"), ({"t_eval": [-1.0]}, ValueError, "-1.0"),
    ({"t_eval": [0.5, 0.2]}, ValueError, "order"), ({"t_eval": [[0.5]]}, ValueError, "dimensions"),
    ({"t_eval": [math.nan]}, ValueError, "nan"), ({"rtol": math.nan}, ValueError, "rtol"),
    ({"atol": -1}, ValueError, "atol"),
    ({"atol": [1, 2]}, ValueError, "shape"), ({"atol": [math.nan]}, ValueError, "atol"),
    ({"atol": ["a"]}, TypeError, "atol: found .*, expected numbers"),
    ({"max_step": 0}, ValueError, "max_step"), ({"max_step": -1}, ValueError, "max_step"),
    ({"first_step": 0}, ValueError, "first_step"), ({"first_step": 5}, ValueError, "first_step"),
    ({"args": 3}, TypeError, "args"), ({"events": 3}, TypeError, "int"),
    ({"events": [3]}, TypeError, "int"), ({"rtoll": 1}, TypeError, "rtoll"),
    ({"record_steps": 1}, TypeError, "record_steps"), ({"detector": "x"}, ValueError, "detector"),
    ({"max_steps": "many"}, TypeError, "max_steps"), ({"max_steps": -1}, TypeError, "max_steps"),
])
def test_options_that_are_none(options, error, words):
    with pytest.raises(error, match=words):
        ricochet.solve_ivp(decay, (0, 1), [1.0], **options)


@pytest.mark.parametrize("atol, error, words", [
    ([1e-9], ValueError, r"atol: found shape \(1,\), expected a number or \(2,\)"),
    ([[1e-9, 1e-9]], ValueError, r"atol: found shape \(1, 2\)"),
    ([1e-9, -1], ValueError, "atol: found a number that is negative or not finite"),
    ([1e-9, math.nan], ValueError, "atol: found a number that is negative or not finite"),
    ([1e-9, math.inf], ValueError, "atol: found a number that is negative or not finite"),
    (["a", "b"], TypeError, "atol: found .*, expected numbers"),
    ([1e-9, 1j], TypeError, "atol: found .*, expected numbers")])
@pytest.mark.parametrize("system", [ricochet.System(fall), ricochet.BouncingBall()])
def test_tolerances_of_components_that_are_none(system, atol, error, words):
    for run in ricochet.integrate, ricochet.Simulation:
        with pytest.raises(error, match=words):
            run(system, [1.0, 0.0], 1.0, atol=atol)


@pytest.mark.parametrize("system", [ricochet.System(fall), ricochet.BouncingBall()])
def test_without_rtol_no_tolerance_of_a_component_is_zero(system):
    run = ricochet.integrate(system, [1.0, 0.0], 0.1, rtol=0, atol=[1e-9, 1e-8])
    assert run.outcome == "reached_end"
    with pytest.raises(ValueError, match="rtol must be positive"):
        ricochet.integrate(system, [1.0, 0.0], 0.1, rtol=0, atol=[1e-9, 0.0])


def marked(**attributes):
    def event(t, y):
        return y[0] - 0.5

    for name, value in attributes.items():
        setattr(event, name, value)
    return event


@pytest.mark.parametrize("options, error, words", [
    ({"events": [decay, lambda t, y: math.nan]}, ValueError,
     r"solve_ivp: events\[1\] must be finite at the start, got nan"),
    ({"events": marked(unilateral=True)}, ValueError,
     r"solve_ivp: events\[0\] \(event\) is unilateral and needs a reset"),
    ({"events": marked(reset=3)}, TypeError, r"reset of events\[0\] \(event\): found a int"),
    ({"events": [decay, 3]}, TypeError, r"events\[1\]: found a int, expected a function \(t, y\)"),
    ({"events": marked(terminal="x")}, ValueError, r"events\[0\].terminal: found 'x'"),
    ({"events": marked(terminal=-1)}, ValueError, r"events\[0\].terminal: found -1"),
    ({"events": marked(terminal=2**32 + 1)}, ValueError,
     r"events\[0\].terminal: found 4294967297, expected .* up to 4294967295"),
    ({"events": marked(terminal=math.inf)}, ValueError, r"events\[0\].terminal: found inf"),
    ({"events": marked(terminal=math.nan)}, ValueError, r"events\[0\].terminal: found nan"),
    ({"events": marked(direction="x")}, TypeError, r"events\[0\].direction: found 'x'"),
    ({"events": marked(direction=math.nan)}, TypeError, r"events\[0\].direction: found nan"),
    ({"events": lambda t, y: np.complex64(y[0] - 0.5)}, TypeError,
     r"^events\[0\] returned numpy.complex64, expected a number"),
    ({"t_span": (math.inf, math.inf)}, ValueError, "t_span: found .*, expected finite times"),
    ({"t_span": (1, 1), "y0": [math.nan]}, ValueError, "y0: found .*, expected finite numbers"),
    ({"events": lambda t, y: "a"}, TypeError, r"^events\[0\] returned str, expected a number"),
    ({"t_span": (0, math.inf)}, ValueError, r"solve_ivp: t_span\[1\] must be a finite time"),
    ({"y0": [math.nan]}, ValueError, "solve_ivp: y0 must be finite"),
    ({"fun": 3}, TypeError, "fun: found a int, expected a function"),
    ({"fun": lambda t, y: [1.0, 2.0]}, ValueError, "^fun returned 2 numbers for a state of 1"),
    ({"rtol": "a"}, TypeError, "rtol: found 'a'"), ({"max_step": "a"}, ValueError, "max_step"),
    ({"t_eval": "a"}, TypeError, "t_eval: found 'a'"),
    ({"maxstep": 1.0}, TypeError, "'maxstep', expected some of method, .*max_step, .*detector")])
def test_solve_ivp_says_it_in_its_own_words(options, error, words):
    given = dict(dict(fun=decay, t_span=(0, 1), y0=[1.0]), **options)
    with pytest.raises(error, match=words) as raised:
        ricochet.solve_ivp(**given)
    assert "guard" not in str(raised.value) and "flow" not in str(raised.value)
    # A system has guards and a flow.
    with pytest.raises(TypeError, match="'h_maxx', expected some of .*h_max, .*t_start"):
        ricochet.integrate(ricochet.System(decay), [1.0], 1.0, h_maxx=1)
    with pytest.raises(ValueError, match="integrate: guard 0 must be finite"):
        ricochet.integrate(ricochet.System(decay, [ricochet.Guard(lambda t, x: math.nan)]), [1.0],
                           1.0)


def test_how_it_ended_is_said_in_the_words_of_solve_ivp():
    for fun, events, outcome, words in (
            (lambda t, y: [math.nan], None, "non_finite", "fun, an event or a reset"),
            (decay, marked(unilateral=True, reset=lambda t, y: [0.3]), "outside_mode",
             "unilateral event")):
        found = ricochet.solve_ivp(fun, (0, 2), [1.0], events=events)
        assert found.status == -1 and found.outcome == outcome and words in found.message


@pytest.mark.parametrize("span", [(0,), 5, (0, 1, 2), ("a", "b"), (0, math.nan), (0, math.inf)])
def test_spans_that_are_none(span):
    with pytest.raises(ValueError):
        ricochet.solve_ivp(decay, span, [1.0])


def test_functions_that_are_none():
    with pytest.raises(TypeError, match="int"):
        ricochet.solve_ivp(3, (0, 1), [1.0])
    with pytest.raises(TypeError, match="flow"):
        ricochet.integrate(ricochet.System(), [1.0], 1.0)
    with pytest.raises(TypeError, match="ricochet.System"):
        ricochet.integrate(decay, [1.0], 1.0)
    with pytest.raises(TypeError, match="gravty"):
        ricochet.BouncingBall(gravty=1.0)
    with pytest.raises(ValueError, match="restitution"):
        ricochet.BouncingBall(restitution=1.2)
    with pytest.raises(ValueError, match="components"):
        ricochet.integrate(ricochet.BouncingBall(), [1.0], 1.0)
    with pytest.raises(TypeError, match="t_endd"):
        ricochet.integrate(ricochet.BouncingBall(), [1.0, 0.0], 1.0, t_endd=2.0)
    with pytest.raises(ValueError, match="step"):
        ricochet.integrate(ricochet.BouncingBall(), [1.0, 0.0], 1.0, method="rk4", fixed=True)
    with pytest.raises(ValueError, match="estimate"):
        ricochet.integrate(ricochet.BouncingBall(), [1.0, 0.0], 1.0, method="rk4")
    with pytest.raises(ValueError, match="mode"):
        ricochet.integrate(ricochet.Thermostat(), [20.0], 1.0, mode="hot")
    with pytest.raises(ValueError, match="mode"):
        ricochet.integrate(ricochet.Thermostat(), [20.0], 1.0, mode=7)
    with pytest.raises(TypeError, match="guards_value"):
        ricochet.System(decay, guards_value=1)
    with pytest.raises(TypeError, match="resett"):
        class Misspelt(ricochet.System):
            def resett(self, t, x):
                return x
    with pytest.raises(ValueError, match="no mode|does not have"):
        ricochet.integrate(ricochet.System(lambda m, t, x: x, [ricochet.Guard(
            lambda m, t, x: 1.0, in_modes=["c"])], modes=("a", "b")), [1.0], 1.0)
    import ctypes  # which would take a text for a pointer to its letters
    for wrong in ("flow", b"flow", 1.5, None, decay, ctypes):
        with pytest.raises(TypeError, match="pointer"):
            ricochet.Compiled(wrong)
    with pytest.raises(ValueError, match="null"):
        ricochet.Compiled(0)
    with pytest.raises(ValueError, match="unilateral|reset"):
        ricochet.integrate(ricochet.System(fall, [ricochet.Guard(
            lambda t, x: x[0], unilateral=True)]), [1.0, 0.0], 1.0)
    with pytest.raises(ValueError, match="snapshot|text|checksum"):
        ricochet.Snapshot.from_text("nothing")


# --- what callbacks return ---

@pytest.mark.parametrize("result, error", [
    (None, TypeError), ([1.0], ValueError), ([1.0, 2.0, 3.0], ValueError), (3.0, ValueError),
    (np.ones((1, 2)), ValueError), (np.ones((2, 2)), ValueError), ("ab", TypeError),
    (["a", "b"], TypeError), ([1j, 0], TypeError), (np.array([1j, 0]), TypeError),
    ([None, 1.0], TypeError), ([[1.0], 2.0], (TypeError, ValueError)), (object(), TypeError),
    ([], ValueError), ([10**400, 1], TypeError), (np.array([10**400, 1]), TypeError),
    (np.array([np.complex128(1j), 0], dtype=object), TypeError),
    (np.array([np.complex64(1j), 0], dtype=object), TypeError)])
def test_flows_that_return_something_else(result, error):
    with pytest.raises(error, match="fun returned"):
        ricochet.solve_ivp(lambda t, y: result, (0, 1), [1.0, 2.0])

    def reset(t, y):
        return result

    def event(t, y):
        return y[0] - 0.5

    event.reset = reset
    with pytest.raises(error, match=r"reset of events\[0\] \(event\) returned") as raised:
        ricochet.solve_ivp(lambda t, y: [-1.0, 0.0], (0, 1), [1.0, 2.0], events=event)
    assert raised.value.ricochet_run.t <= 0.5


@pytest.mark.parametrize("result", [
    np.arange(2), np.array([1, 2], dtype=np.float32), np.arange(8.0)[::4], (1, True),
    [np.float64(1), np.int32(2)], np.asfortranarray([1.0, 2.0]), range(2),
    np.array([1.0, 2.0], dtype=object), np.array([1.0, 2.0]).astype(">f8")])
def test_flows_that_return_any_two_numbers(result):
    expected = 1.0 + np.asarray(result, dtype=float)
    found = ricochet.solve_ivp(lambda t, y: result, (0, 1), [1.0, 1.0]).y[:, -1]
    np.testing.assert_allclose(found, expected)
    start = np.array([1.0, 9.0, 1.0, 9.0])[::2]
    np.testing.assert_allclose(
        ricochet.solve_ivp(lambda t, y: result, (0, 1), start).y[:, -1], expected)


@pytest.mark.parametrize("result", [None, "a", 1j, np.complex128(1j), [1.0, 2.0], np.ones(2)])
def test_events_that_return_something_else(result):
    with pytest.raises(TypeError, match="returned .* expected a number"):
        ricochet.solve_ivp(decay, (0, 1), [1.0], events=lambda t, y: result)


@pytest.mark.parametrize("name", ["Reset", "terminl", "direciton", "rset", "unilatral"])
def test_attributes_that_are_misspelt(name):
    def event(t, y):
        return y[0]

    setattr(event, name, 1)
    event.weight = 3  # of no concern
    with pytest.raises(ValueError, match=f"found an attribute '{name}', expected"):
        ricochet.solve_ivp(lambda t, y: [-1.0], (0, 1), [0.5], events=event)


def test_events_that_return_arrays_of_one_and_truths():
    result = ricochet.solve_ivp(lambda t, y: [-1.0], (0, 1), [1.0], max_step=0.1,
                                events=[lambda t, y: y - 0.5, lambda t, y: bool(y[0] > 0.25),
                                        lambda t, y: y[0] > 0.25])
    assert result.t_events[0] == pytest.approx([0.5])
    assert result.t_events[1] == pytest.approx([0.75])
    assert result.t_events[2] == pytest.approx([0.75])


def wave(t, x):
    return [math.cos(t)]


@pytest.mark.parametrize("truth", [
    lambda t, y: y > 0.5, lambda t, y: y[:1] > 0.5, lambda t, y: np.array(y[0] > 0.5),
    lambda t, y: y[0] > 0.5, lambda t, y: bool(y[0] > 0.5)])
def test_arrays_of_one_truth_are_truths(truth):
    # The wave sin(t) goes through a half at pi / 6 and 5 pi / 6, and again a period later.
    expected = math.pi * np.array([1 / 6, 5 / 6, 13 / 6, 17 / 6])
    found = ricochet.solve_ivp(wave, (0, 10), [0.0], events=truth, rtol=1e-9, atol=1e-9,
                               max_step=0.5)
    np.testing.assert_allclose(found.t_events[0], expected, atol=1e-6)
    guard = ricochet.Guard(truth, direction=0)
    run = ricochet.integrate(ricochet.System(wave, [guard]), [0.0], 10.0, h_max=0.5)
    np.testing.assert_allclose(run.events["t"], expected, atol=1e-6)


@pytest.mark.parametrize("values, boolean", [
    (lambda t, x: [x[0] > 0.5, x[0] - 2], False), (lambda t, x: (bool(x[0] > 0.5), -1.0), False),
    (lambda t, x: np.array([x[0] > 0.5, x[0] > 2]), False),
    (lambda t, x: np.array([x[0] > 0.5, -1.0]), True),
    (lambda t, x: [int(x[0] > 0.5), -1.0], True)])
def test_truths_among_the_values_of_all_guards(values, boolean):
    guards = [ricochet.Guard(direction=0, boolean=boolean), ricochet.Guard(direction=0)]
    system = ricochet.System(wave, guards, guard_values=values)
    run = ricochet.integrate(system, [0.0], 10.0, h_max=0.5)
    np.testing.assert_allclose(run.events["t"], math.pi * np.array([1 / 6, 5 / 6, 13 / 6, 17 / 6]),
                               atol=1e-6)


def test_a_boolean_guard_may_be_zero_where_it_is_false():
    guard = ricochet.Guard(lambda t, x: 1.0 * (x[0] > 0.5), direction=0, boolean=True)
    run = ricochet.integrate(ricochet.System(wave, [guard]), [0.0], 10.0, h_max=0.5)
    assert len(run.events) == 4


def test_generators_are_read_once_for_all_runs():
    class Class(ricochet.System):
        time_events = (t for t in [0.25, 0.75])

        def flow(self, t, x):
            return [1.0]

    rising = {"direction": 1}
    systems = (
        ricochet.System(lambda t, x: [1.0], (ricochet.Guard(g, **rising) for g in [
            lambda t, x: x[0] - 0.5, lambda t, x: x[0] - 0.25])),
        ricochet.System(lambda t, x: [1.0], time_events=iter([0.25, 0.5])),
        ricochet.System(lambda mode, t, x: [1.0], modes=iter("ab"), time_events=iter([0.25]),
                        guards=[ricochet.Guard(lambda mode, t, x: x[0] - 0.5, in_modes=iter("a"),
                                               **rising)]),
        Class())
    for system in systems:
        for _ in range(3):
            assert len(ricochet.integrate(system, [0.0], 1.0).events) == 2
    assert len(ricochet.integrate(Class(), [0.0], 1.0).events) == 2


def test_what_a_ready_system_would_not_use():
    ball = ricochet.BouncingBall()
    with pytest.raises(AttributeError, match="restitution: found an assignment"):
        ball.restitution = 0.5
    assert ball.restitution == 0.9
    ball.note = "mine"
    with pytest.raises(TypeError, match="Own: found 'reset' in a subclass of a ready system"):
        class Own(ricochet.BouncingBall):
            def reset(self, t, x):
                return [0.0, 0.0]


def test_what_a_guard_would_not_use():
    guard = ricochet.Guard(lambda t, x: x[0] - 0.5)
    for name, argument in (("direction", "direction"), ("terminal", "stop_after"),
                           ("reset", "reset")):
        with pytest.raises(AttributeError, match=rf"Guard\(..., {argument}=...\)"):
            setattr(guard, name, 1)

    def event(t, x):
        return x[0] - 0.5

    event.weight = 3  # of no concern
    system = ricochet.System(decay, [event])
    assert len(ricochet.integrate(system, [1.0], 1.0).events) == 1
    event.terminal = True
    with pytest.raises(TypeError, match=r"guards\[0\]: found a function with an attribute "
                                        r"'terminal', expected Guard\(function, stop_after"):
        ricochet.integrate(system, [1.0], 1.0)


class Floored(ricochet.System):
    def flow(self, t, x):
        return [-1.0]

    @ricochet.guard
    def floor(self, t, x):
        return x[0]


def test_what_a_system_would_not_use():
    class Replaced(Floored):
        def floor(self, t, x):
            return x[0] - 0.5

    class Raised(Floored):
        @ricochet.guard
        def floor(self, t, x):
            return x[0] - 0.5

    class Own(Floored):
        def __init__(self):
            self.ceiling = ricochet.Guard(lambda t, x: x[0] - 0.25)

    class Listed(Floored):
        def __init__(self):
            self.ceiling = ricochet.Guard(lambda t, x: x[0] - 0.25)
            self.guards = [self.ceiling]

    class Resetting(Floored):
        def reset(self, t, x):
            return [1.0]

    def events(system, t_end=2.0, **options):
        return ricochet.integrate(system, [1.0], t_end, **options).events["t"].tolist()

    assert events(Floored()) == pytest.approx([1.0])
    assert events(Raised()) == pytest.approx([0.5])
    assert events(Listed()) == pytest.approx([0.75, 1.0])
    for system, words in ((Replaced(), "'floor' in place of a guard of a base class"),
                          (Own(), "the guard 'ceiling' as an attribute of an instance"),
                          (Resetting(), "'reset' without a method guard")):
        with pytest.raises(TypeError, match=words):
            events(system)
    changed = Floored()
    changed.floor = lambda t, x: x[0] - 0.5
    with pytest.raises(TypeError, match="'floor' of an instance in place of a guard"):
        events(changed)
    back = ricochet.System(decay, previous_time_event=lambda t: 0.5 if t > 0.5 else None)
    with pytest.raises(ValueError, match="previous_time_event: found one without next_time_event"):
        events(back, 0.0, t_start=1.0)


def test_a_mode_of_a_system_without_modes():
    for system, x0 in ((ricochet.System(decay), [1.0]), (ricochet.BouncingBall(), [1.0, 0.0])):
        with pytest.raises(ValueError, match="mode must be 0, the only one of the system, got 3"):
            ricochet.integrate(system, x0, 1.0, mode=3)


COMPLEX = np.complex128(0.5 + 1j)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("call", [
    lambda: ricochet.solve_ivp(decay, (0, COMPLEX), [1.0]),
    lambda: ricochet.solve_ivp(decay, np.array([0, COMPLEX]), [1.0]),
    lambda: ricochet.solve_ivp(decay, (0, 1), [1.0], t_eval=np.array([0, COMPLEX])),
    lambda: ricochet.solve_ivp(decay, (0, 1), [1.0], t_eval=[0, 0.5 + 1j]),
    lambda: ricochet.solve_ivp(decay, (0, 1), [1.0], rtol=COMPLEX),
    lambda: ricochet.solve_ivp(decay, (0, 1), [1.0], atol=COMPLEX),
    lambda: ricochet.solve_ivp(decay, (0, 1), [1.0], max_step=COMPLEX),
    lambda: ricochet.solve_ivp(decay, (0, 1), [1.0], first_step=COMPLEX),
    lambda: ricochet.solve_ivp(decay, (0, 1), [1.0], dense_output=True).sol(np.array([COMPLEX])),
    lambda: ricochet.integrate(ricochet.System(decay), [1.0], COMPLEX),
    lambda: ricochet.integrate(ricochet.System(decay), [1.0], 1.0, sample_times=[COMPLEX]),
    lambda: ricochet.integrate(ricochet.System(decay), [1.0], 1.0, event_tolerance=COMPLEX),
    lambda: ricochet.integrate(ricochet.System(decay, time_events=[COMPLEX]), [1.0], 1.0),
    lambda: ricochet.BouncingBall(restitution=COMPLEX),
    lambda: ricochet.solve_ivp(decay, (0, 1), np.array([COMPLEX, 1], dtype=object)),
    lambda: ricochet.solve_ivp(decay, (0, 1), [1.0], t_eval=np.array([COMPLEX], dtype=object)),
    lambda: ricochet.ensemble(ricochet.BouncingBall, {"height": np.array([COMPLEX])}, 1.0)])
def test_complex_numbers_keep_their_imaginary_parts(call):
    with pytest.raises((TypeError, ValueError), match="found .*(0.5|complex)"):
        call()


@pytest.mark.parametrize("given", [10**400, [1.0, 10**400], np.array([10**400], dtype=object)])
def test_integers_above_all_floats(given):
    y0 = [given] if isinstance(given, int) else given
    with pytest.raises(ValueError, match="y0: found an integer above all floats"):
        ricochet.solve_ivp(decay, (0, 1), y0)
    with pytest.raises(ValueError, match="t_span: found"):
        ricochet.solve_ivp(decay, (0, 10**400), [1.0])


@pytest.mark.parametrize("arguments, words", [
    ({"stop_after": 2**32 + 1}, "stop_after: found 4294967297, .* at most 4294967295"),
    ({"stop_after": math.nan}, "stop_after: found nan"), ({"stop_after": "3"}, "found '3'"),
    ({"degree": 2**32 + 1}, "degree: found 4294967297, .* at most 2147483647"),
    ({"direction": math.nan}, "direction: found nan, expected -1, 0 or 1"),
    ({"direction": 2}, "guard level: direction: found 2, expected -1, 0 or 1"),
    ({"direction": "rising"}, "guard level: direction: found 'rising', expected -1, 0 or 1"),
    ({"in_modes": [0]}, "guard level: found in_modes, expected none in a system without modes")])
def test_arguments_of_guards_that_are_none(arguments, words):
    guard = ricochet.Guard(lambda t, x: x[0] - 0.5, name="level", **arguments)
    with pytest.raises(ValueError, match=words):
        ricochet.integrate(ricochet.System(decay, [guard]), [1.0], 1.0)


@pytest.mark.parametrize("result", [None, "", [], np.array([True, False])])
def test_enabled_that_returns_something_else(result):
    guard = ricochet.Guard(lambda t, x: x[0] - 0.5, name="level", enabled=lambda t, x: result)
    with pytest.raises(TypeError, match="enabled of level returned .*, expected True or False"):
        ricochet.integrate(ricochet.System(decay, [guard]), [1.0], 1.0)


@pytest.mark.parametrize("result, events", [(True, 1), (0, 0), (np.bool_(True), 1),
                                            (np.array([False]), 0)])
def test_enabled_that_returns_any_truth(result, events):
    guard = ricochet.Guard(lambda t, x: x[0] - 0.5, enabled=lambda t, x: result)
    run = ricochet.integrate(ricochet.System(decay, [guard]), [1.0], 1.0)
    assert len(run.events) == events


@pytest.mark.parametrize("modes, words", [
    (["on", "on"], r"modes: found \['on', 'on'\], expected each of them once"),
    ([1, True], "expected each of them once"), (0, "modes: found none"), ([], "modes: found none")])
def test_modes_that_cannot_be_told_apart(modes, words):
    with pytest.raises(ValueError, match=words):
        ricochet.integrate(ricochet.System(lambda mode, t, x: -x, modes=modes), [1.0], 1.0)


@pytest.mark.parametrize("call, words", [
    (lambda: ricochet.BouncingBall().impact_time(-1, 10), "impact_time: found n = -1"),
    (lambda: ricochet.BouncingBall().impact_time(0.5, 10), "impact_time: found n = 0.5"),
    (lambda: ricochet.BouncingBall().impact_time(2**31, 10), "n = 2147483648"),
    (lambda: ricochet.BouncingBall().impact_time(math.nan, 10), "impact_time: found n = nan"),
    (lambda: ricochet.CoulombOscillator().turning_time(1.5), "turning_time: found n = 1.5"),
    (lambda: ricochet.Thermostat().switch_time(-2), "switch_time: found n = -2"),
    (lambda: ricochet.ImpactOscillator().impacts(math.inf), "impacts: found t_end = inf")])
def test_known_solutions_where_there_are_none(call, words):
    with pytest.raises(ValueError, match=words):
        call()


def test_modes_that_there_are_not():
    def system(result):
        return ricochet.System(lambda mode, t, x: [-1.0], [ricochet.Guard(
            lambda mode, t, x: x[0], reset=lambda mode, t, x: result, name="g")], modes=("a", "b"))

    for result in ("c", None, 0, ("c", [1.0]), ("b", [1.0], 3), ("b", None), [1.0], ["b"]):
        with pytest.raises((ValueError, TypeError), match="reset of g"):
            ricochet.integrate(system(result), [0.5], 1.0)
    assert ricochet.integrate(system("b"), [0.5], 1.0).mode == "b"


def test_numbers_that_are_none():
    found = ricochet.solve_ivp(lambda t, y: [math.nan if t > 0.5 else 1.0], (0, 1), [1.0])
    assert found.status == -1 and found.outcome == "non_finite" and not found.success
    assert found.t[-1] <= 0.5

    def event(t, y):
        return y[0] - 1.25

    event.reset = lambda t, y: [math.nan]
    found = ricochet.solve_ivp(lambda t, y: [1.0], (0, 1), [1.0], events=event)
    assert found.status == -1 and found.outcome == "non_finite"
    with pytest.raises(ValueError, match="guard|finite"):
        ricochet.solve_ivp(decay, (0, 1), [1.0], events=lambda t, y: math.nan)


def test_taylor_series_of_functions_of_python_are_refused():
    decay = ricochet.System(lambda t, x: [-x[0]])
    with pytest.raises(ValueError, match="taylor.*formula.*ready system.*fehlberg78"):
        ricochet.integrate(decay, [1.0], 1.0, method="taylor")
    with pytest.raises(ValueError, match="formula"):
        ricochet.Simulation(decay, [1.0], 1.0, method="taylor")
    with pytest.raises(ValueError, match="formula"):
        ricochet.solve_ivp(lambda t, y: -y, (0, 1), [1.0], method="Taylor")
    with pytest.raises(ValueError, match="components"):
        ricochet.integrate(ricochet.Pendulum(), [1.0], 1.0, method="taylor")
    with pytest.raises(ValueError, match="taylor"):
        ricochet.integrate(ricochet.Pendulum(), [1.0, 0.0], 1.0, method="tailor")


# --- exceptions ---

class Mine(Exception):
    pass


@pytest.mark.parametrize("method", ["dopri5", "fehlberg78"])
@pytest.mark.parametrize("where", ["flow", "guard", "reset", "rest", "enabled", "rate"])
def test_an_exception_at_any_call_arrives_as_it_is(where, method):
    # Raised at the first call, the second, ... until a run has none left: wherever in the
    # library that is, nothing is lost and nothing crashes.
    calls = 0
    fatal = 0
    thrown = Mine("unchanged")

    def count(name):
        nonlocal calls
        if name == where:
            calls += 1
            if calls == fatal:
                raise thrown

    class Ball(ricochet.System):
        def flow(self, t, x):
            count("flow")
            at_rest = x[0] == 0 and x[1] == 0
            return [x[1], 0.0 if at_rest else -9.81 - 0.1 * x[1], 1.0]

        @ricochet.guard(unilateral=True)
        def floor(self, t, x):
            count("guard")
            return x[0]

        @floor.reset
        def floor(self, t, x):
            count("reset")
            return [0.0, -0.4 * x[1], x[2]]

        @floor.rest
        def floor(self, t, x):
            count("rest")
            return [0.0, 0.0, x[2]]

        @floor.enabled
        def floor(self, t, x):
            count("enabled")
            return True

        if where == "rate":
            @floor.rate
            def floor(self, t, x, dxdt):
                count("rate")
                return dxdt[0]

        @ricochet.guard(direction=0)
        def middle(self, t, x):
            return x[2] - 0.3

    ball = Ball()
    while True:
        calls, fatal = 0, fatal + 1 + fatal // 20
        try:
            run = ricochet.integrate(ball, [0.5, 0.0, 0.0], 1.0, method=method,
                                     sample_times=[0.25, 0.5])
        except Mine as error:
            assert error is thrown
            so_far = error.ricochet_run
            assert 0 <= so_far.t <= 1 and so_far.outcome == "cancelled"
            assert so_far.events.size == 0 or so_far.events["t"].max() <= so_far.t + 1e-9
        else:
            break
    assert fatal > 1 and run.outcome == "reached_end"


def test_a_simulation_ends_with_an_exception():
    def flow(t, x):
        if t > 0.5:
            raise Mine
        return [1.0]

    simulation = ricochet.Simulation(ricochet.System(flow), [0.0], 1.0, h_max=0.1)
    with pytest.raises(Mine) as raised:
        while simulation.step():
            pass
    assert 0.3 < raised.value.ricochet_run.t <= 0.5
    assert simulation.ended and not simulation.step() and not simulation.advance()
    assert simulation.finish().t == raised.value.ricochet_run.t


# --- interrupts ---

def slow_ready():
    # Some hours of impacts.
    return ricochet.integrate(ricochet.ImpactOscillator(), [0.0, 0.0], 1e12, rtol=1e-10,
                              record_events=False, stall_steps=0)


def slow_quiet():
    return ricochet.integrate(ricochet.Pendulum(), [0.1, 0.0], 1e12, h_max=1e-3,
                              record_events=False, stall_steps=0)


def slow_simulation():
    simulation = ricochet.Simulation(ricochet.ImpactOscillator(wall=1e9), [0.0, 0.0], 1e12,
                                     stall_steps=0)
    simulation.advance()


def slow_callbacks():
    ricochet.solve_ivp(lambda t, y: [y[1], -y[0]], (0, 1e12), [1.0, 0.0], max_step=1e-3,
                       t_eval=[], stall_steps=0)


@pytest.fixture
def interruptible():
    # A process that a shell has started in the background ignores interrupts.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("run", [slow_ready, slow_quiet, slow_simulation, slow_callbacks])
def test_an_interrupt_ends_a_run_within_a_tenth_of_a_second(run, interruptible):
    sent = None

    def send():
        nonlocal sent
        time.sleep(0.2)
        sent = time.perf_counter()
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=send)
    thread.start()
    try:
        with pytest.raises(KeyboardInterrupt) as raised:
            run()
        took = time.perf_counter() - sent
    finally:
        thread.join()
    # A loaded machine may let the thread of the test wait for as long again.
    assert took < 0.3
    assert raised.value.ricochet_run.t > 0


# --- threads ---

def test_other_threads_go_on_while_a_ready_system_runs():
    counted = 0
    done = False

    def count():
        nonlocal counted
        while not done:
            counted += 1

    thread = threading.Thread(target=count)
    thread.start()
    before = counted
    ricochet.integrate(ricochet.ImpactOscillator(), [0.0, 0.0], 1e9, max_steps=500_000,
                       record_events=False)
    during = counted - before
    done = True
    thread.join()
    assert during > 10_000


def test_two_threads_on_one_simulation():
    simulation = ricochet.Simulation(ricochet.ImpactOscillator(), [0.0, 0.0], 1e9,
                                     max_steps=500_000, record_events=False)
    errors = []
    thread = threading.Thread(target=lambda: simulation.run_to_end())
    thread.start()
    time.sleep(0.05)
    for use in (simulation.step, simulation.save, lambda: simulation.t, lambda: simulation.x,
                simulation.finish):
        if thread.is_alive():
            try:
                use()
            except RuntimeError as error:
                errors.append(str(error))
    thread.join()
    assert not errors or all("in use" in error for error in errors)
    # For certain: a callback that asks the simulation which has called it.
    asked = []

    def flow(t, x):
        try:
            asked.append(own.step())
        except NameError:
            pass  # at the start
        except RuntimeError as error:
            asked.append(str(error))
        return [1.0]

    own = ricochet.Simulation(ricochet.System(flow), [0.0], 1.0)
    own.step()
    assert asked and all("in use" in str(answer) for answer in asked)


def test_one_system_in_many_threads():
    system = ricochet.System(fall, [ricochet.Guard(
        lambda t, x: x[0], reset=lambda t, x: [0.0, -0.9 * x[1]])])
    expected = ricochet.integrate(system, [10.0, 0.0], 15.0).events["t"]
    found = [None] * 4

    def run(k):
        found[k] = ricochet.integrate(system, [10.0, 0.0], 15.0).events["t"]

    threads = [threading.Thread(target=run, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for times in found:
        assert np.array_equal(times, expected)


@pytest.mark.parametrize("members, words", [
    ({"guards": ricochet.Guard(decay)}, r"guards: found a Guard, expected a sequence: guards=\["),
    ({"guards": decay}, r"guards: found a function, expected a sequence"),
    ({"guard": [ricochet.Guard(decay)]}, r"guard: found a list, expected a function, or guards="),
    ({"modes": 2}, r"found flow\(t, y\) in a system with modes, expected flow\(mode, t, x\)"),
    ({"flow": lambda mode, t, x: -x},
     r"found flow\(mode, t, x\) in a system without modes, expected flow\(t, x\)")])
def test_members_of_another_form(members, words):
    with pytest.raises(TypeError, match=words):
        ricochet.integrate(ricochet.System(**{"flow": decay, **members}), [1.0], 1.0)
    for flow in decay, lambda t, x, k=1: -x, lambda *given: -given[-1], np.vectorize(decay):
        assert ricochet.integrate(ricochet.System(flow), [1.0], 1.0).success


@pytest.mark.parametrize("options, error, words", [
    ({"max_step": 3}, TypeError, "found an option 'max_step'.*; did you mean 'max_steps'.$"),
    ({"colour": 3}, TypeError, "found an option 'colour', expected some of atol, check_inside"),
    ({"max_steps": -1}, TypeError, "max_steps: found -1, expected a whole number, not negative$"),
    ({"stop_at_event": "yes"}, TypeError, "stop_at_event: found 'yes', expected True or False$"),
    ({"rtol": "x"}, TypeError, "rtol: found 'x', expected a number$"),
    ({"method": 3}, TypeError, "method: found 3, expected a text$"),
    ({"sample_times": [[1.0, 2.0]]}, ValueError, "sample_times: found 2 dimensions, expected 1"),
    ({"method": "rk4"}, ValueError, "method: found 'rk4', which has no error estimate, expected "
                                    "fixed=True and a step beside it, or 'cash-karp54', 'dopri5'"),
    ({"method": "euler"}, ValueError, "method: found 'euler', which")])
def test_options_of_integrate_that_are_none(options, error, words):
    for system in ricochet.System(decay), ricochet.BouncingBall():
        x0 = [1.0] if isinstance(system, ricochet.System) else [1.0, 0.0]
        for run in ricochet.integrate, ricochet.Simulation:
            with pytest.raises(error, match=words):
                run(system, x0, 1.0, **options)


def test_misspelt_options_of_solve_ivp_and_a_monitor_and_members():
    with pytest.raises(TypeError, match="option 'dense_ouput'.*; did you mean 'dense_output'.$"):
        ricochet.solve_ivp(decay, (0, 1), [1.0], dense_ouput=True)
    with pytest.raises(TypeError, match="option 'set_value'.*; did you mean 'set_valued'.$"):
        ricochet.solve_ivp(decay, (0, 1), [1.0], set_value=None)
    with pytest.raises(TypeError, match="found an option 'locater'.*; did you mean 'locator'.$"):
        ricochet.Monitor(ricochet.BouncingBall(), [1.0, 0.0], locater="newton")
    with pytest.raises(TypeError, match="found a member 'gaurds'.*; did you mean 'guards'.$"):
        ricochet.System(decay, gaurds=[])


def test_a_rest_needs_a_reset():
    rest = {"rest": lambda t, x: x}
    with pytest.raises(ValueError, match="guard low: found a rest without a reset, expected both"):
        ricochet.integrate(ricochet.System(decay, [ricochet.Guard(decay, name="low", **rest)]),
                           [1.0], 1.0)
    with pytest.raises(ValueError, match=r"events\[0\] \(event\): found a rest without a reset"):
        ricochet.solve_ivp(decay, (0, 1), [1.0], events=marked(**rest))
    system = ricochet.System(decay, [ricochet.Guard(lambda t, x: x[0] - 0.5, **rest)],
                             reset_set=lambda t, x, fired: x + 1)
    assert len(ricochet.integrate(system, [1.0], 1.0).events) == 1


def test_messages_name_a_guard_without_a_name_by_its_number_and_list_the_modes():
    guard = ricochet.Guard(lambda t, x: x[0] - 0.5, reset=lambda t, x: None)
    with pytest.raises(TypeError, match="^reset of guard 0 returned None"):
        ricochet.integrate(ricochet.System(decay, [guard]), [1.0], 1.0)
    guard = ricochet.Guard(lambda mode, t, x: x[0], name="low", in_modes=["onn"])
    with pytest.raises(ValueError, match=r"guard low: found the mode 'onn', which the system does "
                                         r"not have, expected some of \['off', 'on'\]"):
        ricochet.integrate(ricochet.System(lambda mode, t, x: -x, [guard], modes=["off", "on"]),
                           [1.0], 1.0)


def test_resets_that_contradict_each_other():
    def run(**members):
        return ricochet.integrate(ricochet.System(lambda t, x: [-1.0], **members), [1.0], 2.0)

    low = [ricochet.Guard(lambda t, x: x[0], name=name, reset=lambda t, x, to=to: [to])
           for name, to in (("low", 1.0), ("lower", 2.0))]
    both = run(guards=low)
    assert (both.outcome, both.guard, both.other_guard) == ("conflicting_resets", 0, 1)
    assert both.message.endswith("declare reset_set(t, x, fired) to say what happens then: low, "
                                 "lower")
    timed = run(guards=low[:1], time_events=[1.0], time_reset=lambda t, x: [5.0])
    assert (timed.outcome, timed.guard, timed.other_guard) == ("conflicting_resets", 0, -1)
    assert timed.message.endswith(": low, a time event")
    assert run(guards=low[:1]).other_guard is None
