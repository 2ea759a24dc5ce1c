"""Set-valued motion beside events. Expected numbers are closed forms."""

import math
import pickle

import numpy as np
import pytest

import ricochet
from ricochet import Guard, Inclusion, Kind, System

CLOSE = dict(rtol=0, atol=1e-9)
FINE = dict(rtol=1e-10, atol=1e-12)


def sign(y):
    return 1.0 if y >= 0 else -1.0


def unit(t, x):
    return -1.0, 1.0


def block(load, **more):
    """x' = load(t) - Sgn x."""
    friction = Inclusion(lambda t, x: [load(t)], unit)
    return System(lambda t, x: [load(t) - sign(x[0])], set_valued=friction, **more)


def times(run, kind):
    return run.events["t"][run.events["kind"] == kind]


def through_all_doors(system, x0, t_end, **options):
    """The run of `integrate`, with which a simulation of saved steps agrees."""
    options = {**FINE, **options}
    run = ricochet.integrate(system, x0, t_end, **options)
    simulation, steps = ricochet.Simulation(system, x0, t_end, **options), 0
    while simulation.step():
        steps += 1
        if steps % 10 == 0:
            saved = simulation.save()
            simulation = ricochet.Simulation(system, x0, t_end, **options)
            simulation.restore(saved)
    np.testing.assert_allclose(simulation.x, run.x, **CLOSE)
    return run


def test_static_bounds_hold_more_than_the_others():
    # Two contacts of one block hold 1 + 3 at rest and 2 where it moves: it slips at 4.
    friction = Inclusion(lambda t, x: [t], lambda t, x: ([-0.5, -1.5], [0.5, 1.5]),
                         observe=[[1], [1]], static_bounds=lambda t, x: [1, 3])
    system = System(lambda t, x: [t - 2 * sign(x[0])], set_valued=friction)
    run = through_all_doors(system, [0.0], 6.0)
    np.testing.assert_allclose(times(run, Kind.SLIP), [4, 4], **CLOSE)
    np.testing.assert_allclose(run.x, [6], **CLOSE)


def test_a_block_stops_and_slips_again():
    # 1/4 - t + t^2 / 4 until it is zero; held until the load is 1.
    run = through_all_doors(block(lambda t: t / 2), [0.25], 4.0)
    stop = 2 - math.sqrt(3)
    np.testing.assert_allclose(times(run, Kind.STICK), [stop], **CLOSE)
    np.testing.assert_allclose(times(run, Kind.SLIP), [2], **CLOSE)
    np.testing.assert_allclose(run.x, [1], **CLOSE)
    assert list(run.events["reaction"]) == [0, 0] and list(run.events["guard"]) == [-1, -1]
    assert [cause for _, _, cause in run.phases] == ["start", "held", "released"]
    assert [held for _, held, _ in run.phases] == [False, True, False]
    again = pickle.loads(pickle.dumps(run))
    assert again.phases == run.phases and list(again.events["reaction"]) == [0, 0]


def contacts(reactions):
    """The load t from rest, which contacts with the bounds 1 and 3 hold."""
    def flow(t, x):
        return [t - (4 if reactions == 2 else 3) * sign(x[0])]

    ones = np.ones((reactions, 1))
    bounds = np.array([1.0, 3.0][-reactions:])
    friction = Inclusion(lambda t, x: [t], lambda t, x: (-bounds, bounds), observe=ones)
    return System(flow, set_valued=friction)


def test_reactions_are_rows_beside_the_states():
    times = [1, 2, 3, 5]
    run = ricochet.integrate(contacts(2), [0.0], 6.0, sample_times=times, **FINE)
    expected = [[-0.5, -0.5], [-1, -1], [-1, -2], [-1, -3]]
    np.testing.assert_allclose(run.reactions, expected, **CLOSE)
    np.testing.assert_allclose(run.reaction, [-1, -3], **CLOSE)
    again = pickle.loads(pickle.dumps(run))
    np.testing.assert_array_equal(again.reactions, run.reactions)
    np.testing.assert_array_equal(again.reaction, run.reaction)
    friction = Inclusion(lambda t, x: [t], lambda t, x: (-3.0, 3.0))
    for t_eval in times, None:
        result = ricochet.solve_ivp(lambda t, x: [t - 3 * sign(x[0])], (0, 6), [0.0], t_eval=t_eval,
                                    set_valued=friction, **FINE)
        held = result.t < 3
        assert result.reactions.shape == (1, result.t.size) and held.sum() > 1
        np.testing.assert_allclose(result.reactions[0], np.where(held, -result.t, -3), **CLOSE)


def test_a_simulation_gives_its_reaction():
    simulation = ricochet.Simulation(contacts(1), [0.0], 6.0, sample_times=[1, 2], **FINE)
    shown = []
    while simulation.advance():
        shown.append((simulation.t, simulation.reaction[0]))
    np.testing.assert_allclose(shown, [(1, -1), (2, -2), (3, -3)], **CLOSE)
    run = simulation.run_to_end()
    np.testing.assert_allclose(run.reaction, [-3], **CLOSE)
    np.testing.assert_array_equal(simulation.reaction, run.reaction)


def test_reactions_are_nan_in_modes_without_an_inclusion_and_none_without_set_valued():
    friction = Inclusion(lambda mode, t, x: [0.5], lambda mode, t, x: (-1.0, 1.0), in_modes=["on"])

    class Brake(System):
        modes = "on", "off"
        set_valued = friction
        time_events = [1.0]

        def flow(self, mode, t, x):
            return [0.5 - (sign(x[0]) if mode == "on" else 0)]

        def time_reset(self, mode, t, x):
            return "off", x

    run = ricochet.integrate(Brake(), [0.0], 2.0, sample_times=[0.5, 1.5], **FINE)
    np.testing.assert_allclose(run.reactions, [[-0.5], [np.nan]], **CLOSE)
    assert run.reaction.shape == (0,)
    plain = ricochet.integrate(System(lambda t, x: -x), [1.0], 1.0, sample_times=[0.5])
    assert plain.reactions.shape == (1, 0) and plain.reaction.shape == (0,)


def test_a_ball_meets_its_floor_while_a_block_is_held():
    friction = Inclusion(lambda t, y: [0, y[2], -1], unit)

    def floor(t, y):
        return y[1]

    floor.reset = lambda t, y: [y[0], y[1], -y[2]]
    floor.unilateral = True
    result = ricochet.solve_ivp(lambda t, y: [-sign(y[0]), y[2], -1.0], (0, 3), [1, 1.125, 0],
                                events=floor, set_valued=friction, **FINE)
    np.testing.assert_allclose(result.y[:, -1], [0, 1.125, 0], **CLOSE)
    np.testing.assert_allclose(result.t_events[0], [1.5], **CLOSE)
    assert result.success and len(result.phases) == 2 and result.phases[1][1:] == (True, "held")


def test_a_guard_that_stands_for_y_shows_the_stick():
    system = block(lambda t: 0.0, guards=[Guard(lambda t, x: 3 * x[0], direction=0)])
    run = through_all_doors(system, [1.0], 2.0)
    assert list(run.events["kind"]) == [Kind.STICK] and list(run.events["guard"]) == [0]
    assert run.x[0] == 0


def test_matrices_say_on_what_a_reaction_acts():
    # Two bodies of masses 1 and 2 rub on each other: their speeds meet at 1 after 2 s.
    friction = Inclusion(lambda t, x: [0, 0], unit, observe=[[1, -1]], act=[[1], [-1]],
                         mass=[[1, 0], [0, 2]])
    system = System(lambda t, x: [-sign(x[0] - x[1]), sign(x[0] - x[1]) / 2], set_valued=friction)
    run = through_all_doors(system, [3.0, 0.0], 3.0)
    np.testing.assert_allclose(run.x, [1, 1], **CLOSE)
    np.testing.assert_allclose(times(run, Kind.STICK), [2], **CLOSE)


class Belts(System):
    """The way and the speed of a block between two belts."""

    modes = "right", "left"

    def belt(self, mode):
        return 0.5 if mode == "right" else -0.5

    def flow(self, mode, t, x):
        return [x[1], -sign(x[1] - self.belt(mode))]

    @ricochet.guard(direction=1, in_modes=["right"])
    def far(self, mode, t, x):
        return x[0] - 1

    @far.reset
    def far(self, mode, t, x):
        return "left"

    @ricochet.guard(in_modes=["left"])
    def near(self, mode, t, x):
        return x[0]

    @near.reset
    def near(self, mode, t, x):
        return "right"

    def set_valued(self):
        return Inclusion(lambda mode, t, x: [x[1], 0], lambda mode, t, x: ([-1], [1]),
                         observe=[[0, 1]], offset=lambda mode, t: [self.belt(mode)],
                         offset_rate=lambda mode, t: 0.0)


def test_the_inclusion_is_that_of_the_mode():
    run = through_all_doors(Belts(), [0.0, 0.5], 10.0)
    np.testing.assert_allclose(run.x, [0.5, -0.5], **CLOSE)
    np.testing.assert_allclose(times(run, Kind.CROSSING), [2, 5, 8], **CLOSE)
    np.testing.assert_allclose(times(run, Kind.STICK), [3, 6, 9], **CLOSE)


def lift(t):
    return -10 + 20 * (t - 1) if 1 <= t < 2 else -10.0


def lifted_ball(**leaving):
    """A ball that rests in a mode of its own until a load lifts it."""
    def fall(mode, t, x):
        return [x[1], lift(t)]

    ground = Inclusion(fall, lambda mode, t, x: (0.0, np.inf), observe=[[0, 1]], stands_for=[0],
                       in_modes="rest", **leaving)
    floor = Guard(lambda mode, t, x: x[0], unilateral=True,
                  reset=lambda mode, t, x: (mode, [0, -x[1] / 2]),
                  rest=lambda mode, t, x: ("rest", [0, 0]))
    return System(fall, [floor], modes=["fly", "rest"], time_events=[1, 2], set_valued=ground)


@pytest.mark.parametrize("leaving", [
    dict(change=lambda mode, t, x, reaction, kind: "fly" if kind == "slip" else None),
    dict(start_mode=lambda mode, t, x: "fly")])
def test_a_ball_rests_in_a_mode_of_its_own_and_is_lifted(leaving):
    run = through_all_doors(lifted_ball(**leaving), [0.2, 0.0], 2.6)
    assert run.mode == "fly"
    np.testing.assert_allclose(run.x, [7 / 60, -3.5], **CLOSE)
    np.testing.assert_allclose(times(run, Kind.ACCUMULATION), [0.6], rtol=0, atol=1e-7)
    np.testing.assert_allclose(times(run, Kind.SLIP), [1.5], **CLOSE)


def test_eight_components_are_followed():
    def still(t, x):
        return [0.0] * 8

    friction = Inclusion(still, lambda t, x: ([-1] * 4, [1] * 4), reactions=4)
    system = System(lambda t, x: [-sign(y) for y in x[:4]] + [0.0] * 4, set_valued=friction)
    run = through_all_doors(system, [1, 2, 3, 4, 5, 6, 7, 8], 5.0)
    assert list(run.x) == [0, 0, 0, 0, 5, 6, 7, 8]
    np.testing.assert_allclose(times(run, Kind.STICK), [1, 2, 3, 4], **CLOSE)
    assert list(run.events["reaction"]) == [0, 1, 2, 3]


def test_several_motions_and_contradictions_are_named():
    repulsive = Inclusion(lambda t, x: [0.0], unit, act=[[-1]])
    run = ricochet.integrate(System(lambda t, x: [sign(x[0])], set_valued=repulsive), [0.0], 1.0)
    assert run.outcome == "several" and "reaction 0" in run.reason and run.reason in run.message
    forgetful = Inclusion(lambda t, x: [0.0], unit)
    run = ricochet.integrate(System(lambda t, x: [-sign(x[0]) / 2], set_valued=forgetful), [1.0],
                             3.0, **FINE)
    assert run.outcome == "law_violated" and "component 0" in run.reason
    assert math.isclose(run.t, 2, abs_tol=1e-9)


def test_exceptions_pass_with_the_run_so_far():
    def smooth(t, x):
        if t > 1.5:
            raise LookupError("the table ends at 1.5 s")
        return [0.0]

    system = System(lambda t, x: [-sign(x[0])], set_valued=Inclusion(smooth, unit))
    with pytest.raises(LookupError, match="the table ends at 1.5 s") as caught:
        ricochet.integrate(system, [1.0], 3.0)
    run = caught.value.ricochet_run
    assert 1 <= run.t <= 1.5 and run.x[0] == 0 and len(run.phases) == 2


@pytest.mark.parametrize("arguments, words", [
    (dict(smooth=None, bounds=unit), "smooth: found None"),
    (dict(smooth=unit, bounds=3), "bounds: found 3"),
    (dict(smooth=unit, bounds=unit, offset=unit), "one of offset and offset_rate"),
    (dict(smooth=unit, bounds=unit, reactions=5), "found 5 reactions, expected 1 to 4"),
    (dict(smooth=unit, bounds=unit, observe=[[1, 0]], reactions=2), "1 and 2 reactions"),
    (dict(smooth=unit, bounds=unit, observe=[1, 0]), r"observe: found shape \(2,\)"),
    (dict(smooth=unit, bounds=unit, observe=[[1, 0]], act=[[1]]), "act: found shape"),
    (dict(smooth=unit, bounds=unit, mass=[[1, 0]]), "mass: found shape"),
    (dict(smooth=unit, bounds=unit, stands_for=[1]), "stands_for: found 1"),
])
def test_what_is_no_inclusion_is_refused(arguments, words):
    with pytest.raises((TypeError, ValueError), match=words):
        Inclusion(**arguments)


def integrate(inclusion, x0=(0.0,), guards=(), modes=None, **options):
    flow = (lambda t, x: [-y for y in x]) if modes is None else (lambda mode, t, x: [-y for y in x])
    system = System(flow, list(guards), set_valued=inclusion, modes=modes)
    return ricochet.integrate(system, list(x0), 3.0, **options)


@pytest.mark.parametrize("inclusion, options, words", [
    (3, {}, "set_valued: found a int, expected a ricochet.Inclusion"),
    (Inclusion(lambda t, x: [0, 0], unit), {}, "smooth of set_valued returned 2 numbers, expected 1"),
    (Inclusion(lambda t, x: [0], lambda t, x: -1), {}, r"expected a tuple \(lower, upper\)"),
    (Inclusion(lambda t, x: [0], lambda t, x: ([-1, 0], 1)), {}, "lower bounds of set_valued returned"),
    (Inclusion(lambda t, x: [0], unit, observe=[[1, 0]]), {}, "matrices for 2 components, expected 1"),
    (Inclusion(lambda t, x: [0], unit, reactions=2), {}, "2 reactions of 1 components"),
    (Inclusion(lambda t, x: [0], unit, in_modes=["on"]), {}, "in_modes, expected none"),
    (Inclusion(lambda t, x: [0], unit, stands_for=[0]), {}, "found 1 of them, expected one for each of 0"),
    (Inclusion(lambda t, x: [0], unit, mass=[[0]]), {}, "matrix A is singular"),
    (Inclusion(lambda t, x: [0], unit), dict(fixed=True, step=0.1), "set_valued: found fixed steps"),
    (Inclusion(lambda t, x: [0], unit), dict(detector="planned"), "detector: found 'planned'"),
])
def test_what_cannot_be_followed_is_refused(inclusion, options, words):
    with pytest.raises((TypeError, ValueError), match=words):
        integrate(inclusion, **options)


def test_more_than_eight_components_are_refused():
    with pytest.raises(ValueError, match="1 to 8 components and 1 to 4 reactions"):
        integrate(Inclusion(lambda t, x: [0.0] * 9, unit), x0=[1.0] * 9)


def test_monitors_and_systems_with_events_of_their_own_are_refused():
    with pytest.raises(ValueError, match="which a monitor cannot follow"):
        ricochet.Monitor(block(lambda t: 0.0), [1.0])
    with pytest.raises(ValueError, match="expected it as a member of the system"):
        ricochet.solve_ivp(block(lambda t: 0.0), (0, 1), [1.0], set_valued=Inclusion(unit, unit))
