"""What happens at one instant, and runs that the caller drives: ties, jumps, ends, stops, restarts."""

import math

import numpy as np
import pytest

import ricochet

METHODS = ["dopri5", "fehlberg78", "cash-karp54"]


class Clock(ricochet.System):
    """x' = 1; the guard, and with ``sets_back`` every tick, sets it back after a period."""

    def __init__(self, period, sets_back=False):
        self.period, self.sets_back = period, sets_back

    def flow(self, t, x):
        return [1.0]

    def guard(self, t, x):
        return self.period - x[0]

    def reset(self, t, x):
        return [0.0]

    def next_time_event(self, t):
        n = math.floor(t / self.period)
        while n * self.period <= t:
            n += 1
        return n * self.period

    def time_reset(self, t, x):
        return [0.0] if self.sets_back else x


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("period", [1.0, 0.3, 0.1, 1 / 3, 0.001])
@pytest.mark.parametrize("sets_back", [False, True])
def test_a_guard_and_a_tick_at_one_instant_are_one_set(method, period, sets_back):
    run = ricochet.integrate(Clock(period, sets_back), [0.0], 200 * period, method=method)
    events = run.events
    assert len(events) == 400
    assert np.array_equal(events["t"][::2], events["t"][1::2])
    assert (events["guard"][::2] == -1).all() and (events["guard"][1::2] == 0).all()
    assert (np.array([e[0] for e in events["before"]]) >= period).all()


class Switch(ricochet.System):
    def __init__(self, at_once):
        self.at_once = at_once

    def flow(self, t, x):
        return [1.0 if t > 1 or (self.at_once and t == 1) else 0.0]

    def next_time_event(self, t):
        return 1.0 if t < 1 else math.inf


@pytest.mark.parametrize("method", METHODS + ["rk4"])
@pytest.mark.parametrize("at_once", [False, True])
def test_a_flow_that_jumps_at_a_time_event(method, at_once):
    options = {"fixed": True, "step": 0.1} if method == "rk4" else {}
    run = ricochet.integrate(Switch(at_once), [0.0], 2.0, method=method, **options)
    assert abs(run.x[0] - 1) < 1e-15


def test_nothing_is_called_outside_of_the_run():
    # math.sqrt of a negative number raises.
    class Root(ricochet.System):
        def flow(self, t, x):
            return [math.sqrt(t - 1) + 0 * math.sqrt(3 - t)]

        def guard(self, t, x):
            return math.sqrt(t - 1) - 0.5 + 0 * math.sqrt(3 - t)

        def reset(self, t, x):
            return [x[0] + 1]

    root = ricochet.integrate(Root(), [0.0], 3.0, t_start=1.0)
    assert root.success and len(root.events) == 0
    back = ricochet.integrate(Root(), [0.0], 1.0, t_start=3.0)
    assert back.success and len(back.events) == 1
    short = ricochet.solve_ivp(lambda t, y: [math.sqrt(t) + 0 * math.sqrt(1e-4 - t)], (0, 1e-4), [1.0],
                               events=lambda t, y: math.sqrt(t) - 5e-3)
    assert short.success and abs(short.t_events[0][0] - 2.5e-5) < 1e-18


OSCILLATOR = ricochet.System(
    lambda t, x: [x[1], -x[0]],
    guards=[ricochet.Guard(lambda t, x: x[0]), ricochet.Guard(lambda t, x: x[1])])


def oscillation(t_end=20.0, **options):
    return ricochet.Simulation(OSCILLATOR, [1.0, 0.0], t_end, **options)


def test_iteration_stops_at_recorded_events_each_once():
    run = ricochet.integrate(OSCILLATOR, [1.0, 0.0], 20.0)
    stops = list(oscillation())
    assert [t for t, _ in stops] == list(run.events["t"])
    assert len(stops) >= 6
    for (_, x), before in zip(stops, run.events["before"]):
        assert np.array_equal(x, before)


def test_states_of_events_and_the_solution_agree():
    floor = lambda t, y: y[0]
    floor.reset = lambda t, y: [0.0, -0.8 * y[1]]
    floor.direction = -1
    half = lambda t, y: y[0] - 0.5
    for method in ["RK45", "DOP853"]:
        result = ricochet.solve_ivp(lambda t, y: [y[1], -9.81], (0, 3), [1.0, 0.0], events=[floor, half],
                                    dense_output=True, method=method)
        assert len(result.t_events[0]) >= 4 and len(result.t_events[1]) == 3
        for t, y, after in zip(result.t_events[1], result.y_events[1], result.y_events_after[1]):
            assert np.array_equal(result.sol(t), y) and np.array_equal(after, y)
        for t, y, after in zip(result.t_events[0], result.y_events[0], result.y_events_after[0]):
            assert np.array_equal(result.sol.before(t), y)
            assert np.array_equal(result.sol(t), after)


def test_a_restart_goes_on_from_another_state():
    simulation = oscillation(10.0, sample_times=np.arange(0, 10.1, 0.25), record_steps=True)
    while simulation.t != 2.25:
        assert simulation.advance()
    simulation.restart(2.25, [0.0, 1.0])
    run = simulation.run_to_end()
    exact = np.where(run.times <= 2.25, np.cos(run.times), np.sin(run.times - 2.25))
    assert len(run.times) == 41
    assert np.max(np.abs(run.states[:, 0] - exact)) < 1e-6
    assert abs(run.solution(5.0)[0] - math.sin(2.75)) < 1e-6

    simulation.extend(12.0)
    assert simulation.run_to_end().t == 12.0
    simulation.restart(11, np.array([0.0, 1.0]))
    assert abs(simulation.run_to_end().x[0] - math.sin(1)) < 1e-6


def test_a_timer_that_is_due_at_a_restart_is_shown_there():
    class Timer(ricochet.System):
        def flow(self, t, x):
            return [1.0, 0.0]

        def next_time_event(self, t, x):
            return x[1]

        def time_reset(self, t, x):
            return [x[0], x[1] + 1]

    simulation = ricochet.Simulation(Timer(), [0.0, 10.0], 4.0)
    simulation.restart(1.5, [7.0, 1.5])
    assert simulation.advance() and simulation.t == 1.5
    assert list(simulation.x) == [7.0, 2.5]
    assert simulation.advance() and simulation.t == 2.5
    assert list(simulation.run_to_end().events["t"]) == [1.5, 2.5, 3.5]


def test_a_restart_chooses_a_mode_by_its_name():
    class Motor(ricochet.System):
        modes = ["up", "down"]

        def flow(self, mode, t, x):
            return [1.0 if mode == "up" else -1.0]

    simulation = ricochet.Simulation(Motor(), [0.0], 4.0, mode="up")
    simulation.step()
    simulation.restart(1.0, [1.0], mode="down")
    assert simulation.mode == "down"
    assert abs(simulation.run_to_end().x[0] + 2) < 1e-14
    with pytest.raises(ValueError, match="expected one of"):
        simulation.restart(1.0, [1.0], mode="sideways")


def test_bad_restarts_and_ends_are_refused():
    simulation = oscillation(2.0)
    simulation.advance()
    t = simulation.t
    for bad in (math.nan, math.inf, -1.0, 2.0):
        with pytest.raises(ValueError, match="restart"):
            simulation.restart(bad, [1.0, 0.0])
    for x in ([1.0, 0.0, 0.0], [], [1.0, math.nan]):
        with pytest.raises(ValueError):
            simulation.restart(1.0, x)
    with pytest.raises(ValueError, match="mode"):
        simulation.restart(1.0, [1.0, 0.0], mode=3)
    for bad in (math.nan, 0.0, -1.0):
        with pytest.raises(ValueError, match="extend"):
            simulation.extend(bad)
    with pytest.raises(TypeError):
        simulation.extend("late")
    assert simulation.t == t
    simulation.finish()
    with pytest.raises(RuntimeError, match="finished"):
        simulation.restart(1.0, [1.0, 0.0])
    with pytest.raises(RuntimeError, match="finished"):
        simulation.extend(5.0)


def test_a_limited_run_goes_on_from_its_snapshot():
    limited = oscillation(10.0, max_steps=7)
    while limited.step():
        pass
    snapshot = limited.save()
    more = oscillation(10.0)
    more.restore(snapshot)
    assert not more.ended
    assert np.array_equal(more.run_to_end().x, oscillation(10.0).run_to_end().x)
    with pytest.raises(ValueError, match="later than t_end"):
        oscillation(0.001).restore(snapshot)


@pytest.mark.parametrize("period", [1.0, 0.3, 0.1, 1 / 3, 0.001])
def test_a_sample_at_an_event_is_its_state_after_and_one_stop(period):
    samples = [n * period for n in range(1, 101)]
    system = ricochet.System(lambda t, x: [1.0],
                             [ricochet.Guard(lambda t, x: period - x[0], reset=lambda t, x: [0.0])])
    stops = list(ricochet.Simulation(system, [0.0], 100.5 * period, sample_times=samples))
    assert [t for t, _ in stops] == samples
    assert all(x[0] == 0 for _, x in stops)


def test_a_reset_that_acts_in_one_direction_only_is_not_ineffective():
    guard = ricochet.Guard(lambda t, x: math.sin(t), direction=0, directed=True,
                           reset=lambda t, x, direction: [x[0] + 1] if direction > 0 else x)
    run = ricochet.integrate(ricochet.System(lambda t, x: [0.0], [guard]), [0.0], 20.0, t_start=0.1, h_max=0.5)
    assert run.x[0] == 3 and len(run.events) == 6
    assert run.statistics.ineffective_resets == 0 and run.statistics.declined_guard is None


NAN = math.nan


@pytest.mark.parametrize("flow, value, reset, reason", [
    (lambda t, x: [-1.0 if t < 0.5 else NAN], lambda t, x: x[0], lambda t, x: x, "the flow"),
    (lambda t, x: [-1.0], lambda t, x: x[0] if t < 0.5 else NAN, lambda t, x: x, "guard 0"),
    (lambda t, x: [-1.0], lambda t, x: x[0] - 0.5, lambda t, x: [NAN], "the reset of guard 0"),
])
def test_a_run_says_which_function_was_not_finite(flow, value, reset, reason):
    system = ricochet.System(flow, [ricochet.Guard(value, reset=reset)])
    run = ricochet.integrate(system, [1.0], 2.0, method="rk4", fixed=True, step=0.1)
    assert run.outcome == "non_finite" and run.reason == reason
    assert run.message.startswith(reason)


@pytest.mark.parametrize("method", METHODS)
def test_no_function_is_called_in_a_mode_that_has_been_left(method):
    left, late = [False], []

    def flow(mode, t, x):
        if mode == 0 and left[0]:
            late.append(("flow", t))
        return [x[1], -1 + 0.1 * math.sin(t) if mode == 0 else 0.5]

    def height(mode, t, x):
        if mode == 0 and left[0]:
            late.append(("guard", t))
        return x[0] if mode == 0 else 1.0

    def reset(mode, t, x):
        left[0] = True
        return 1, [0.0, 0.0]

    system = ricochet.System(flow, [ricochet.Guard(height, reset=reset)], modes=2)
    run = ricochet.integrate(system, [1.0, 0.0], 4.0, method=method, sample_times=np.arange(0, 4, 0.1),
                             record_steps=True)
    assert run.mode == 1 and len(run.events) == 1 and late == []


@pytest.mark.parametrize("step", [0.11, 0.17, 0.23, 0.29])
def test_a_window_is_held_by_one_step_wherever_the_steps_end(step):
    system = ricochet.System(
        lambda t, x: [0.0, 0.0],
        [ricochet.Guard(lambda t, x: (t - 1) * (t - 1.05), reset=lambda t, x: [x[0] + 1, x[1]]),
         ricochet.Guard(lambda t, x: 1.08 - t, reset=lambda t, x: [x[0], x[1] + 1])])
    for options in ({"method": "rk4", "fixed": True}, {"h_max": step}):
        run = ricochet.integrate(system, [0.0, 0.0], 2.0, event_window=0.1, step=step, **options)
        assert list(run.x) == [1, 1] and len(run.events) == 2
        np.testing.assert_allclose(run.events["t"], 1.08, atol=1e-14)
