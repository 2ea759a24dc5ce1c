"""What a rest holds, and what goes on from there: runs that continue, restarts, vetoes, snapshots."""

import pickle

import numpy as np
import pytest

import ricochet
from ricochet import Guard, Kind, System


def thrown(**more):
    """A ball thrown sideways above a floor, (x, y, x', y'); its flights end at 3 sqrt(0.02)."""
    floor = Guard(lambda t, x: x[1], reset=lambda t, x: [x[0], 0.0, x[2], -0.5 * x[3]],
                  rest=lambda t, x: [x[0], 0.0, x[2], 0.0], **more)
    return System(lambda t, x: [x[2], x[3], 0.0, -10.0], [floor])


START = [0.0, 0.1, 1.0, 0.0]


def times_of(run, kind):
    return run.events["t"][run.events["kind"] == kind]


@pytest.mark.parametrize("method", ["dopri5", "fehlberg78"])
@pytest.mark.parametrize("unilateral", [False, True])
def test_a_run_that_continues_from_a_rest_is_held_again(method, unilateral):
    system = thrown(unilateral=unilateral)
    first = ricochet.integrate(system, START, 1.5, method=method)
    run = ricochet.integrate(system, first.x, 4.0, t_start=1.5, continues=True, method=method)
    assert times_of(run, Kind.ACCUMULATION).size == 0
    assert run.statistics.armed_beyond == 0
    np.testing.assert_allclose(run.x, [4, 0, 1, 0], atol=1e-12)
    assert run.x[1] == run.x[3] == 0


def test_a_run_that_begins_at_rest_says_why_it_moves_on():
    at_rest = ricochet.integrate(thrown(), START, 1.5).x
    run = ricochet.integrate(thrown(), at_rest, 2.5, t_start=1.5)
    assert run.x[1] < -1 and run.statistics.armed_beyond == 1
    assert run.message.startswith("the end time was reached; began on their surface and moved on beyond "
                                  "it, which is no event (unilateral and at_start give them one")
    assert pickle.loads(pickle.dumps(run)).message == run.message
    beyond = ricochet.integrate(thrown(), [1.5, -1.0, 1.0, 0.0], 2.5, t_start=1.5)
    assert "began beyond their surface" in beyond.message and "began on" not in beyond.message
    assert ricochet.integrate(thrown(unilateral=True), at_rest, 2.5, t_start=1.5).x[1] == 0


@pytest.mark.parametrize("height", [0.0, 0.5, 1.0, -1.0, 1000.0])
def test_a_ball_that_begins_at_rest_at_any_height_says_that_it_fell(height):
    floor = Guard(lambda t, x: x[0] - height, reset=lambda t, x: [height, -0.5 * x[1]],
                  rest=lambda t, x: [height, 0.0])
    run = ricochet.integrate(System(lambda t, x: [x[1], -10.0], [floor]), [height, 0.0], 2.0)
    assert abs(run.x[0] - height + 20) < 1e-9 and run.statistics.armed_beyond == 1
    assert "began on their surface and moved on beyond it" in run.message


def test_a_restart_of_a_rest_is_held_unless_it_moves_what_is_held():
    simulation = ricochet.Simulation(thrown(), START, 4.0)
    while simulation.t < 1.5:
        assert simulation.step()
    simulation.restart(1.5, [1.5, 0.0, 2.0, 0.0])
    np.testing.assert_allclose(simulation.run_to_end().x, [6.5, 0, 2, 0], atol=1e-12)
    simulation.restart(1.5, [1.5, 0.0, 1.0, -1.0])  # on its way through the floor
    run = simulation.run_to_end()
    assert run.statistics.armed_beyond == 1 and run.x[1] < -1


@pytest.mark.parametrize("by_place", [False, True])
def test_a_veto_sets_the_ball_free(by_place):
    # The platform is there until 2 s, or as far as x = 2; a second of free fall follows.
    run = ricochet.integrate(thrown(enabled=lambda t, x: (x[0] if by_place else t) < 2), START, 3.0,
                             rtol=1e-10)
    np.testing.assert_allclose(times_of(run, Kind.MODE), [2], atol=1e-9)
    np.testing.assert_allclose(run.x, [3, -5, 1, -10], atol=1e-7)


def balls():
    """The first ball is lifted off its floor while the second still bounces."""
    def floor(i):
        def rest(t, x):
            return [0.0 if k % 2 == i else x[k] for k in range(4)]

        def reset(t, x):
            y = list(x)
            y[i], y[i + 2] = 0.0, (-0.5 - 0.4 * i) * x[i + 2]
            return y
        return Guard(lambda t, x: x[i], reset=reset, rest=rest)
    return System(lambda t, x: [x[2], x[3], 10 * min(t - 1, 0.1), -1.0], [floor(0), floor(1)])


def test_a_run_that_is_saved_after_a_release_is_the_same_run():
    start = [0.01, 0.1, 0.0, 0.0]
    simulation = ricochet.Simulation(balls(), start, 3.0)
    while simulation.t < 1.5:
        assert simulation.step()
    other = ricochet.Simulation(balls(), start, 3.0)
    other.restore(simulation.save())
    run, same = simulation.run_to_end(), other.run_to_end()
    assert times_of(run, Kind.MODE).size == 1
    assert np.array_equal(run.x, same.x)
    assert np.array_equal(run.events["t"][-len(same.events):], same.events["t"])
