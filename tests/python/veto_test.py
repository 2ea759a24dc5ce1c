"""``enabled``: a veto concerns the instant of a crossing, and what is passed stays passed."""

import pytest

import ricochet
from ricochet import Guard, Kind, System

METHODS = ["dopri5", "fehlberg78"]


def platform(push=0.0, pull=0.0, to=0.0, tick=None, reset=lambda t, x: [x[0], x[1], -x[2]], **more):
    """A point (x, y) beside or above a platform at y = 0 that reaches from the left to x = 1.

    The third component is y'. x' is ``push`` less as much each second, y'' is ``pull``; at the
    tick x is put to ``to``.
    """
    guard = Guard(lambda t, x: x[1], enabled=lambda t, x: x[0] < 1, reset=reset, **more)
    if tick is not None:
        times = dict(time_events=[tick], time_reset=lambda t, x: [to, x[1], x[2]])
    else:
        times = {}
    return System(lambda t, x: [push * (1 - t), x[2], pull], [guard], **times)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("unilateral", [False, True])
def test_a_point_that_has_passed_is_not_struck_from_below(method, unilateral):
    # x = 0.5 + 2 t - t^2, y = 0.4 - 1.2 t + t^2 / 2: down through 0 at 0.4 where x = 1.14, below
    # the platform from 1.707 on, where x is 1 again, and up through 0 at 2.
    run = ricochet.integrate(platform(2.0, 1.0, unilateral=unilateral), [0.5, 0.4, -1.2], 3.0,
                             method=method)
    assert run.outcome == "reached_end" and len(run.events) == 0
    assert run.statistics.disabled == 1
    assert run.x[1] == pytest.approx(1.3, abs=1e-9)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("unilateral", [False, True])
def test_a_veto_that_ends_on_the_surface_leaves_the_event(method, unilateral):
    # y = 1 - t is 0 at the tick, which puts the point on the platform: it presses, and rebounds.
    run = ricochet.integrate(platform(tick=1.0, unilateral=unilateral), [2.0, 1.0, -1.0], 3.0,
                             method=method)
    assert run.events["kind"].tolist() == [Kind.TIME, Kind.CROSSING]
    assert run.events["t"].tolist() == [1, 1]
    assert run.x[1] == pytest.approx(2, abs=1e-12)
    # A quarter of a second later it has passed.
    run = ricochet.integrate(platform(tick=1.25, unilateral=unilateral), [2.0, 1.0, -1.0], 3.0,
                             method=method)
    assert run.events["kind"].tolist() == [Kind.TIME] and run.statistics.disabled == 1
    assert run.x[1] == pytest.approx(-2, abs=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_a_touch_of_a_disabled_guard_is_counted_and_not_recorded(method):
    # y = (t - 1)^2 touches 0 at 1, beside the platform or on it.
    for x, touches in ((2.0, 0), (0.0, 1)):
        run = ricochet.integrate(platform(pull=2.0, reset=None, touch=1e-12), [x, 1.0, -2.0], 1.75,
                                 method=method)
        assert run.events["kind"].tolist() == [Kind.TOUCH] * touches
        assert run.statistics.disabled == 1 - touches


def test_a_start_beside_the_platform_is_allowed_below_it():
    beside = ricochet.integrate(platform(unilateral=True), [2.0, -1.0, 1.0], 3.0)
    assert beside.outcome == "reached_end" and len(beside.events) == 0
    with pytest.raises(ValueError, match="guard 0"):
        ricochet.integrate(platform(unilateral=True), [0.0, -1.0, 1.0], 3.0)
