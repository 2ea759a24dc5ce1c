"""Mechanisms with contacts: impacts, friction, rest. Expected numbers are closed forms, or the bits of C++."""

import math
import pickle

import numpy as np
import pytest

import ricochet
from ricochet import Kind, Mechanism, contact_motion


class Ball(Mechanism):
    """A point of 1 kg over a floor with friction; a pull upward [N] from 1 s on."""

    contacts, restitution, friction = 1, 0.5, 0.2
    mass = np.eye(2)
    pull = 0.0

    def force(self, t, q, v):
        return [0.0, -10.0 + (self.pull if t >= 1 else 0.0)]

    def gaps(self, q):
        return [q[1]]

    def directions(self, q):
        return [[0, 1], [1, 0]]


class Lifted(Ball):
    pull = 14.0


def test_impacts_accumulate_into_sliding_and_rest():
    # Dropped from 0.8 m under 10 m/s^2: impacts from 0.4 s with 4 m/s, each half as fast, until 1.2 s. The impulses
    # up to then are the weight over that time, so that friction takes 0.2 * 10 m/s^2 of 4 m/s throughout.
    run = contact_motion(Ball(), [0, 0.8], [4, 0], 3.0, step=1e-3, sample_times=[0.2, 1.5, 3])
    assert run.outcome == "reached_end" and run.guard_names == ["contact 0"]
    at, speed = 0.4, 4.0
    for n in range(20):
        event = run.events[n]
        assert event["guard"] == 0 and event["kind"] == Kind.CROSSING
        assert abs(event["t"] - at) < 1e-14 * (n + 1)
        assert abs(event["after"][3] - speed / 2) < 1e-12
        at, speed = at + speed / 10, speed / 2
    assert [(held, why) for _, held, why in run.phases] == [(False, "start"), (True, "accumulation")]
    assert abs(run.phases[1][0] - 1.2) < 1e-9
    assert abs(run.states[1, 2] - 1) < 1e-9  # 4 - 0.2 * 10 t
    # Zero in flight; then the weight, and friction of 0.2 of it until 2 s.
    np.testing.assert_allclose(run.reactions, [[0, 0, 0, 0], [10, -2, 0, 0], [10, 0, 0, 0]], atol=1e-9)
    np.testing.assert_allclose(run.reaction, [10, 0, 0, 0], atol=1e-9)
    assert run.contact.to_contact == 1 and run.contact.to_flight == 0 and run.contact.failure is None
    assert abs(run.contact.time - 1.8) < 1e-9 and run.contact.steps >= 1800


def test_runs_can_be_pickled():
    run = contact_motion(Ball(), [0, 0.8], [4, 0], 3.0, sample_times=[2.0])
    again = pickle.loads(pickle.dumps(run))
    assert again.contact == run.contact and again.phases == run.phases
    np.testing.assert_array_equal(again.reactions, run.reactions)
    plain = ricochet.integrate(ricochet.System(lambda t, x: -x), [1.0], 1.0)
    assert plain.contact is None and pickle.loads(pickle.dumps(plain)).contact is None


def test_a_contact_opens_where_the_floor_lets_go():
    run = contact_motion(Lifted(), [0, 0], [0, 0], 2.0, step=1e-4, record_steps=True)
    assert [why for _, _, why in run.phases][-1] == "released"
    # At rest until 1 s, then up with 4 m/s^2; the step in which it opens decides the error.
    assert abs(run.x[1] - 2) < 8e-4 and abs(run.x[3] - 4) < 8e-4
    assert run.reactions.shape == (len(run.times), 4)
    np.testing.assert_allclose(run.reactions[(run.times > 0.1) & (run.times < 1), 0], 10, atol=1e-6)
    assert run.solution is not None


# --- the bits of C++, which tests/nonsmooth/contact_motion_test.cpp has, too ---


class Puck(Mechanism):
    contacts, restitution, friction, weight = 1, 0.5, 0.2, 0.16

    def mass(self, q):
        return self.weight * np.eye(2)

    def force(self, t, q, v):
        return [0, -9.81 * self.weight]

    def gaps(self, q):
        return [q[1]]

    def directions(self, q):
        return [[0, 1], [1, 0]]


class Kicked(Puck):
    def guard(self, t, x):
        return 1 - x[0]

    def reset(self, t, x):
        return [x[0], x[1], -x[2], x[3]]

    def next_time_event(self, t):
        return math.floor(t) + 1

    def time_reset(self, t, x):
        return [x[0], x[1], x[2] + 1, x[3]]


class Plate(Mechanism):
    """Three coordinates, two contacts in space, a mass matrix that changes."""

    contacts, tangents, restitution, friction = 2, 2, [0.6, 0.4], [0.3, 0.1]

    def mass(self, q):
        return [[2, 0.1 + 0.01 * q[0], 0.2], [0.1 + 0.01 * q[0], 1, 0.05], [0.2, 0.05, 3]]

    def force(self, t, q, v):
        return [0.3 * t - 0.2 * q[0], -9.81 - v[1], 0.1 * q[1] - 0.5 * v[2]]

    def gaps(self, q):
        return [q[1], q[1] + 0.1 * q[2] + 0.3]

    def directions(self, q):
        return [[0, 1, 0], [1, 0, 0], [0, 0, 1], [0, 1, 0.1], [1, 0, 0.5], [0, 0, 1]]


def hexadecimal(numbers):
    return [float(number).hex() for number in numbers]


@pytest.mark.parametrize("mechanism, q, v, t_end, step, events, times, end", [
    (Puck(), [0, 0.1], [3, 0], 4.0, 1e-4, 49, "0x1.46b0c509219bep+4",
     ["0x1.282352e041aebp+1", "-0x1.18e40f7a0f3fep-24", "0x0.0p+0", "0x0.0p+0"]),
    (Kicked(), [0, 0], [2, 0], 4.0, 0, 8, "0x1.1405c80e94586p+4",
     ["0x1.90f6a6dddc912p-1", "-0x1.b6d024264562bp-14", "0x1.0000000000000p+0",
      "-0x1.0000000000000p-58"]),
    (Plate(), [0.1, 0.5, 0.2], [1, 0, -0.3], 3.0, 1e-3, 66, "0x1.18560054bf007p+6",
     ["0x1.2e62d9b65e23fp-1", "-0x1.9e741c58933fbp-18", "0x1.64d0fdcc01427p-4",
      "-0x1.0000000000000p-63", "-0x1.0000000000000p-59", "0x0.0p+0"])])
def test_bits_are_those_of_cpp(mechanism, q, v, t_end, step, events, times, end):
    run = contact_motion(mechanism, q, v, t_end, step=step)
    total = 0.0
    for t in run.events["t"]:
        total += t
    assert len(run.events) == events and total.hex() == times and hexadecimal(run.x) == end


# --- what a system has beside its contacts ---


class Switched(Ball):
    """The pull acts in a mode, which a guard of the height ends."""

    modes = ("off", "lift")
    time_events = [1.0]

    def force(self, mode, t, q, v):
        return [0, -10.0 + (14.0 if mode == "lift" else 0.0)]

    def time_reset(self, mode, t, x):
        return "lift"

    @ricochet.guard(in_modes=["lift"], direction=1)
    def high(self, mode, t, x):
        return x[1] - 0.5

    @high.rate
    def high(self, mode, t, x, dxdt):
        return dxdt[1]

    @high.reset
    def high(self, mode, t, x):
        return "off"


def test_guards_times_and_modes_act_in_flight_and_in_contact():
    run = contact_motion(Switched(), [0, 0], [0, 0], 2.2, step=1e-4)
    assert run.guard_names == ["contact 0", "high"] and run.modes == ["off", "lift"]
    kinds = [(event["guard"], event["kind"]) for event in run.events[:3]]
    assert kinds == [(-1, Kind.TIME), (1, Kind.CROSSING), (0, Kind.CROSSING)]
    assert run.event_modes[:3] == [("off", "lift"), ("lift", "off"), ("off", "off")]
    # Up with 4 m/s^2 from 1 s to 0.5 m and 2 m/s, then under -10: back after 0.2 + sqrt(0.14) s.
    np.testing.assert_allclose(run.events["t"][:3], [1, 1.5, 1.7 + math.sqrt(0.14)], atol=4e-4)
    assert contact_motion(Switched(), [0, 0], [0, 0], 0.4, mode="lift").mode == "lift"


def test_dry_friction_holds_a_coordinate():
    # 2 x'' = 3 sin t - x - 1 sign(x') from (0.1, 1): the load is below 1 N where it stops at first.
    slide = Mechanism(mass=[[2.0]], force=lambda t, q, v: [0.5 * t], dry_friction=[1.0])
    run = contact_motion(slide, [0], [-1], 4.0, step=1e-3, sample_times=[0.1, 1.7])
    # -2 + t - t^2 / 4 * ... : 2 v = -2 + t + t^2 / 4 is zero at 2 (sqrt(3) - 1); held until the load is 1 N.
    assert [why for _, _, why in run.phases] == ["start", "held", "released"]
    assert abs(run.phases[1][0] - 2 * (math.sqrt(3) - 1)) < 1e-9
    assert abs(run.phases[2][0] - 2) < 3e-3
    assert run.reactions.shape == (2, 1) and abs(run.reactions[1, 0] + 0.85) < 1e-3
    assert len(run.events) == 0


def test_a_simulation_goes_on_from_any_step_with_the_same_bits():
    options = dict(step=1e-2, rtol=1e-10, atol=1e-12)
    run = contact_motion(Lifted(), [0, 0.2], [2, 0], 1.2, step=1e-2)
    simulation, held = ricochet.Simulation(Lifted(), [0, 0.2, 2, 0], 1.2, **options), set()
    while simulation.step():
        held.add(bool(simulation.reaction[0] > 0))
        saved = ricochet.Snapshot.from_text(simulation.save().text)
        simulation = ricochet.Simulation(Lifted(), [0, 0.2, 2, 0], 1.2, **options)
        simulation.restore(saved)
    assert held == {False, True}
    assert hexadecimal(simulation.x) == hexadecimal(run.x)
    again = ricochet.Simulation(Ball(), [0, 0.2, 2, 0], 1.0, **options)
    again.run_to_end()
    again.extend(2.0)
    again.restart(1.0, [0, 0.2, 0, 0])
    assert abs(again.run_to_end().x[1]) < 1e-3


def test_the_run_ends_where_contact_would_begin_if_asked():
    run = contact_motion(Ball(), [0, 0.8], [4, 0], 3.0, events_only=True)
    assert run.outcome == "not_handed_over" and abs(run.t - 1.2) < 1e-9
    with pytest.raises(ValueError, match="events_only: found one for a system without contacts"):
        ricochet.integrate(ricochet.System(lambda t, x: -x), [1.0], 1.0, events_only=True)


def test_a_problem_without_a_solution_is_named():
    # A rod that slides with much friction: no impulse fits (Painleve). Its contact is the one that fails.
    class Rod(Mechanism):
        contacts, friction = 1, 3.0
        mass = np.diag([1.0, 1.0, 1 / 3])

        def force(self, t, q, v):
            return [0, -9.81, 0]

        def gaps(self, q):
            return [q[1] - math.sin(q[2])]

        def directions(self, q):
            return [[0, 1, -math.cos(q[2])], [1, 0, math.sin(q[2])]]

    run = contact_motion(Rod(), [0, math.sin(1.0), 1.0], [10, 0, 0], 0.1, step=1e-3)
    if run.outcome == "not_converged":
        assert run.contact.failure.contact == 0 and run.reason.startswith("contact 0 failed")
    else:
        assert run.success and run.contact.failure is None


# --- wrong input ---


def fallen(**members):
    return Ball(**members)


@pytest.mark.parametrize("members, error, words", [
    (dict(restitution=1.2), ValueError, r"contact 0: restitution must lie in \[0, 1\], got 1.2"),
    (dict(restitution=[0.5, 0.5]), ValueError, r"restitution: found shape \(2,\), expected a number or \(1,\)"),
    (dict(friction=-1), ValueError, "contact 0: friction must be finite, zero or positive"),
    (dict(friction=lambda c: 0.1), TypeError, "friction: found a function, expected a number"),
    (dict(mass=[[1, 0]]), ValueError, r"mass: found shape \(1, 2\), expected a square"),
    (dict(mass=np.eye(3)), ValueError, "mass: found 9 numbers, expected 4 for 2 coordinates"),
    (dict(mass=-np.eye(2)), ValueError, "mass matrix is not positive definite"),
    (dict(mass=lambda q: [1.0, 1.0]), ValueError, r"mass returned the shape \(2,\), expected an array of shape \(2, 2\)"),
    (dict(mass=None), TypeError, r"mass: found none, expected a function mass\(q\)"),
    (dict(force=lambda t, q: [0, 0]), TypeError, r"force: found force\(t, q\), expected force\(t, q, v\)"),
    (dict(force=lambda t, q, v: [0.0]), ValueError, "force returned 1 numbers, expected 2"),
    (dict(gaps=lambda q: [1.0, 2.0]), ValueError, "gaps returned 2 numbers, expected 1"),
    (dict(gaps=lambda t, q: [1.0]), TypeError, r"gaps: found gaps\(t, q\) without surface_rates"),
    (dict(gaps=lambda: [1.0]), TypeError, r"gaps: found gaps\(\), expected gaps\(q\) or gaps\(t, q\)"),
    (dict(directions=lambda q: [[0, 1]]), ValueError, r"directions returned the shape \(1, 2\), expected an array of shape \(2, 2\)"),
    (dict(directions=lambda q: [[1, 0], [0, 1]]), ValueError, "contact 0: the first row of its directions must be"),
    (dict(contacts=0), ValueError, "gaps: found one of a Mechanism without contacts"),
    (dict(contacts=1.5), ValueError, "contacts: found 1.5, expected a whole number"),
    (dict(tangents=0), ValueError, "tangents: found 0, expected a whole number from 1 to 2"),
    (dict(dry_friction=[1.0]), ValueError, "dry_friction: found 1 numbers, expected 2"),
    (dict(dry_friction=[1.0, -1.0]), ValueError, "coordinate 1: dry_friction must be finite"),
    (dict(flow=lambda t, x: x), TypeError, "found 'flow' in a Mechanism, expected force"),
    (dict(formula=2), TypeError, "found 'formula' in a Mechanism, expected none"),
    (dict(frictions=1), TypeError, "found a member 'frictions', expected some of .*did you mean 'friction'"),
    (dict(guards=[ricochet.Guard(lambda t, x: x[0] + 1, reset=lambda t, x: x, rest=lambda t, x: x)]), TypeError,
     "found 'rest' in a guard of a Mechanism"),
])
def test_what_does_not_fit_is_named(members, error, words):
    with pytest.raises(error, match=words):
        contact_motion(Ball(**members), [0, 1], [0, 0], 1.0)


@pytest.mark.parametrize("arguments, options, error, words", [
    (([0, -1], [0, 0], 1.0), {}, ValueError, "inside an obstacle: the gap of contact 0 is -1"),
    (([0, 1], [0], 1.0), {}, ValueError, "v: found 1 numbers, expected 2 as in q"),
    (([0, 1], [0, math.nan], 1.0), {}, ValueError, "initial velocity is not finite"),
    (([0] * 7, [0] * 7, 1.0), {}, ValueError, "found 14 numbers, expected .* of 1 to 6 coordinates"),
    (([0, 1], [0, 0], -1.0), {}, ValueError, "t_end"),
    (([0, 1], [0, 0], math.inf), {}, ValueError, "infinite t_end and no step"),
    (([0, 1], [0, 0], 1.0), dict(method="taylor"), ValueError, "taylor"),
    (([0, 1], [0, 0], 1.0), dict(method="rosenbrock4"), ValueError, "rosenbrock4"),
    (([0, 1], [0, 0], 1.0), dict(detector="planned"), ValueError, "'planned', expected .* beside a mechanism"),
])
def test_starts_and_options_that_do_not_fit_are_named(arguments, options, error, words):
    with pytest.raises(error, match=words):
        contact_motion(Ball(), *arguments, **options)


def test_a_system_that_is_no_mechanism_is_refused():
    with pytest.raises(TypeError, match="mechanism: found a System, expected a ricochet.Mechanism"):
        contact_motion(ricochet.System(lambda t, x: -x), [0], [0], 1.0)
    with pytest.raises(ValueError, match="found 3 numbers, expected coordinates and velocities"):
        ricochet.integrate(Ball(), [0, 1, 0], 1.0)


def test_ensembles_run_mechanisms_and_monitors_refuse_them():
    starts = np.array([[0, 0.8, 4, 0], [0, 0.4, 4, 0]])
    many = ricochet.ensemble(Ball(), starts, 3.0)
    for row, start in zip(many.rows, starts):
        assert hexadecimal(row["x"]) == hexadecimal(ricochet.integrate(Ball(), start, 3.0).x)
    with pytest.raises(ValueError, match="Monitor: found a mechanism, which a monitor cannot follow"):
        ricochet.Monitor(Ball(), [0.0] * 4)


def test_a_misspelt_member_of_a_class_is_named():
    with pytest.raises(TypeError, match="found a method 'surface_rate', expected 'surface_rates'"):
        class Wrong(Mechanism):
            def surface_rate(self, t, q):
                return []


def test_exceptions_pass_with_the_run_so_far():
    class Breaking(Ball):
        def force(self, t, q, v):
            if t > 1.5:
                raise LookupError("the table ends at 1.5 s")
            return [0, -10]

    with pytest.raises(LookupError, match="the table ends") as caught:
        contact_motion(Breaking(), [0, 0.8], [4, 0], 3.0, step=1e-3, h_max=0.05)
    run = caught.value.ricochet_run
    assert 1.4 < run.t <= 1.5 and run.phases[-1][1] and len(run.events) > 20


def test_other_steppers_fly_as_exactly():
    # The flights are polynomials of the second degree, on which each method is exact.
    expected = contact_motion(Ball(), [0, 0.8], [4, 0], 3.0, step=1e-3)
    for options in dict(method="fehlberg78"), dict(method="rk4", fixed=True):
        run = contact_motion(Ball(), [0, 0.8], [4, 0], 3.0, step=1e-3, **options)
        assert abs(run.events["t"][0] - 0.4) < 1e-13 and abs(run.x[0] - expected.x[0]) < 1e-9
