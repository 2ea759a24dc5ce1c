"""What an event means at its borders: the condition, sets, modes left at once, variables outside."""

import math

import numpy as np
import pytest

import ricochet


def event(function, reset, direction=-1):
    function.reset = reset
    function.direction = direction
    return function


def solve(flow, t_end, y0, events, **more):
    return ricochet.solve_ivp(flow, (0, t_end), y0, events=events, rtol=1e-10, atol=1e-12, **more)


@pytest.mark.parametrize("method", ["dopri5", "fehlberg78"])
@pytest.mark.parametrize("locator", ["newton", "bisection"])
def test_a_thermostat_that_reads_its_temperature_again_stays_in_its_band(method, locator):
    class Room(ricochet.System):
        modes = 2

        def flow(self, mode, t, x):
            return [-0.1 * (x[0] - (30 if mode else 0))]

        def guard(self, mode, t, x):
            return 17 - x[0] if mode else x[0] - 15.5

        def reset(self, mode, t, x):
            return 1 if x[0] <= 15.5 else 0 if x[0] >= 17 else mode

    run = ricochet.integrate(Room(), [15.75], 48.0, rtol=1e-10, atol=1e-12, method=method,
                             locator=locator)
    assert len(run.events) == 48 and run.mode == 0
    assert abs(run.events["t"][-1] - 47.6136971152) < 1e-6
    assert abs(run.x[0] - 16.3558078684) < 1e-6


def test_the_state_before_has_left_its_side():
    seen = []

    def floor(level):
        def reset(t, y):
            seen.append(y[0] - level)
            return [y[0], -0.5 * y[1]]

        return event(lambda t, y: y[0] - level, reset)

    for k in range(50):
        level = 10.0 ** (0.2 * k - 5) * (1 + 0.3 * math.sin(12.9898 * k))
        solve(lambda t, y: [y[1], -1.0], 3 * math.sqrt(level), [2 * level, 0.0], floor(level))
    assert len(seen) >= 50 and max(seen) <= 0


def test_two_doses_at_one_time_are_two_doses():
    doses = [event(lambda t, y: 2.95 - t, lambda t, y: [y[0] + 2]) for _ in range(2)]
    result = solve(lambda t, y: [-y[0]], 10, [1.0], doses)
    expected = math.exp(-10) + 4 * math.exp(-7.05)
    assert abs(result.y[0, -1] - expected) < 1e-9
    halves = [event(lambda t, y: 1 - t, lambda t, y: [y[0] / 2]) for _ in range(2)]
    assert solve(lambda t, y: [0.0], 2, [8.0], halves).y[0, -1] == 2


def test_resets_whose_order_matters_conflict():
    events = [event(lambda t, y: 1 - t, lambda t, y: [-3.5]),
              event(lambda t, y: 1 - t, lambda t, y: [y[0] + 1])]
    for both in (events, events[::-1]):
        result = solve(lambda t, y: [0.0], 2, [-4.5], both)
        assert not result.success and "order" in result.message
        assert result.message.endswith(": events[0], events[1]")


def test_events_that_change_a_variable_of_the_flow_or_of_the_event_cut_the_step():
    k = [1.0]

    def toggle(t, y):
        k[0] = 0.25 if k[0] == 1 else 1.0
        return y

    # A quarter of a period at k = 1 ends at y = 0 with the speed 1, where k becomes 1/4: half a
    # period of 2 pi later the speed is 1 again.
    result = solve(lambda t, y: [y[1], -k[0] * y[0]], 2.5 * math.pi, [1.0, 0.0],
                   event(lambda t, y: y[0], toggle, 0))
    np.testing.assert_allclose(result.t_events[0], [math.pi / 2, 2.5 * math.pi], atol=1e-8)

    level = [1.0]

    def raise_level(t, y):
        level[0] += 1
        return y

    result = solve(lambda t, y: [1.0], 10.5, [0.0], event(lambda t, y: level[0] - y[0], raise_level))
    np.testing.assert_allclose(result.t_events[0], np.arange(1, 11), atol=1e-12)


def test_a_relay_is_reported_and_not_passed_over():
    class Relay(ricochet.System):
        modes = 2

        def flow(self, mode, t, x):
            return [1.0 if mode else -1.0]

        def guard(self, mode, t, x):
            return -x[0] if mode else x[0]

        def reset(self, mode, t, x):
            return 1 - mode

    run = ricochet.integrate(Relay(), [1.0], 3.0)
    assert run.outcome == "endless_cascade"
    assert abs(run.t - 1) < 1e-14 and len(run.events) <= 8


def test_a_reset_that_declines_is_counted():
    class Wall(ricochet.System):
        modes = 2
        acts = True

        def flow(self, mode, t, x):
            return [-1.0]

        def guard(self, mode, t, x):
            return x[0]

        def reset(self, mode, t, x):
            return 1 if self.acts and x[0] < 0 else mode

    for acts in (True, False):
        wall = Wall()
        wall.acts = acts
        run = ricochet.integrate(wall, [1.0], 2.0)
        assert len(run.events) == 1 and run.mode == acts
        assert run.statistics.ineffective_resets == (not acts)
        assert run.statistics.declined_guard == (None if acts else 0)
        assert ("left the state and the mode" in run.message) is not acts
        assert run.statistics.unmet_conditions == 0


@pytest.mark.parametrize("options", [{}, {"method": "rk4", "fixed": True, "step": 0.3},
                                     {"method": "rk4", "fixed": True, "step": 0.1}])
def test_a_dip_within_a_true_bound_is_found(options):
    dip = ricochet.Guard(lambda t, x: min(1.0, 50 * abs(x[0] - 0.37) - 1e-3),
                         speed_bound=lambda t, x: 50.0)
    run = ricochet.integrate(ricochet.System(lambda t, x: [1.0], [dip]), [0.0], 1.0,
                             detector="planned", **options)
    assert len(run.events) == 1
    assert abs(run.events["t"][0] - 0.36998) < 1e-9
    assert run.statistics.unresolved_steps == 0


# --- guards that stand at exactly zero ---

def stop(pull):
    """The guard x of a body that stands at 0, whose reset stops it."""
    def reset(t, y):
        pull[0] = 0.0
        return [y[0], 0.0, *y[2:]]

    return event(lambda t, y: y[0], reset)


@pytest.mark.parametrize("by_state", [True, False])
@pytest.mark.parametrize("detector", ["extremum", "ends"])
@pytest.mark.parametrize("method", ["dopri5", "fehlberg78"])
def test_a_tick_that_moves_a_standing_guard_outward_gives_it_its_event(method, detector, by_state):
    pull = [0.0]

    def kick(t, x):
        if by_state:
            return [x[0], -1.0]
        pull[0] = -1.0
        return x

    floor = stop(pull)
    system = ricochet.System(lambda t, x: [x[1] + pull[0], 0.0],
                             [ricochet.Guard(floor, reset=floor.reset)], time_events=[1.0], time_reset=kick)
    run = ricochet.integrate(system, [0.0, 0.0], 1.5, method=method, detector=detector)
    assert run.events["guard"].tolist() == [-1, 0]
    assert run.events["t"].tolist() == [1, 1] and run.x[0] == 0


@pytest.mark.parametrize("by_tick", [True, False])
@pytest.mark.parametrize("kind", ["recorded", "terminal", "reset"])
@pytest.mark.parametrize(("push", "direction"), [(-1.0, -1), (-1.0, 0), (1.0, 1), (1.0, 0)])
def test_a_standing_guard_has_its_event_whatever_it_does(by_tick, kind, push, direction):
    more = {"recorded": {}, "terminal": {"stop_after": 1}, "reset": {"reset": lambda t, x: [x[0], 0.0, x[2]]}}
    clock = ricochet.Guard(lambda t, x: 1 - x[2], reset=lambda t, x: [x[0], push, x[2]])
    timed = {"time_events": [1.0], "time_reset": lambda t, x: [x[0], push, x[2]]}
    system = ricochet.System(
        lambda t, x: [x[1], 0.0, 1.0],
        [ricochet.Guard(lambda t, x: x[0], direction=direction, **more[kind])] + ([] if by_tick else [clock]),
        **(timed if by_tick else {}))
    run = ricochet.integrate(system, [0.0, 0.0, 0.0], 2.0)
    assert list(run.events["guard"]).count(0) == 1
    np.testing.assert_allclose(run.events["t"], [1, 1], atol=1e-13)


@pytest.mark.parametrize("by_state", [True, False])
@pytest.mark.parametrize("method", ["RK45", "DOP853"])
def test_another_event_that_moves_a_standing_guard_outward_gives_it_its_event(method, by_state):
    pull = [0.0]

    def push(t, y):
        if not by_state:
            pull[0] = -1.0
        return [y[0], -1.0 if by_state else 0.0, 0.0]

    result = solve(lambda t, y: [y[1] + pull[0], 0.0, 1.0], 3.5, [0.0, 0.0, 0.0],
                   [stop(pull), event(lambda t, y: 1 - y[2], push)], method=method)
    np.testing.assert_allclose(result.t_events[0], [1, 2, 3], atol=1e-13)
    np.testing.assert_allclose(result.t_events[1], [1, 2, 3], atol=1e-13)
    assert result.y[0, -1] == 0


def test_a_touch_at_a_tick_is_no_crossing_for_the_signs_at_the_ends_of_steps():
    system = ricochet.System(lambda t, x: [1.0],
                             [ricochet.Guard(lambda t, x: (x[0] - 1) ** 2, reset=lambda t, x: [9.0])],
                             time_events=[1.0])
    for t_end in (1.0, 3.0):
        for step in (0.25, 0.09):
            run = ricochet.integrate(system, [0.0], t_end, method="rk4", fixed=True, step=step,
                                     detector="ends")
            assert run.events["guard"].tolist() == [-1]


# --- guards of which only the sign has a meaning ---

@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
def test_the_event_tolerance_saves_calls_of_boolean_guards(tolerance):
    # A hundredth of a step is seven halvings, of which the places inside are some; with one call
    # after the reset, two in each step, and one at the start.
    calls = [0]

    def level(t, x):
        calls[0] += 1
        return x[0] < 1

    system = ricochet.System(lambda t, x: [1.0], [ricochet.Guard(level, boolean=True, reset=lambda t, x: [0.0])])
    run = ricochet.integrate(system, [0.0], 20.55, method="rk4", fixed=True, step=0.1,
                             event_tolerance=tolerance)
    assert len(run.events) == 20
    assert calls[0] == run.statistics.guard_calls
    assert calls[0] - 1 - 2 * run.statistics.steps <= 20 * (7 + 1 + math.log2(1e-3 / tolerance))
