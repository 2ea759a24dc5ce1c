"""Gradients through events in Python, against closed forms, differences and C++."""

import math

import numpy as np
import pytest

import ricochet
from ricochet import Guard, Perceptron, System

pytest.importorskip("ricochet._gradients", reason="the package was built without gradients")


def ball_derivatives(u0=10.0, g=9.81, r=0.9, n=12):
    """The time of impact n = 0, 1, ... and its derivatives by u0, v0 (at 0), g, r."""
    t1 = math.sqrt(2 * u0 / g)
    t = t1 * (1 + 2 * sum(r**k for k in range(1, n + 1)))
    by_r = 2 * t1 * sum(k * r**(k - 1) for k in range(1, n + 1))
    return t, [t / (2 * u0), 1 / g], [-t / (2 * g), by_r]


class Ball(System):
    unilateral = True

    def flow(self, t, x, gravity, restitution):
        return [x[1], -gravity]

    def guard(self, t, x, gravity, restitution):
        return x[0]

    def reset(self, t, x, gravity, restitution):
        return [0, -restitution * x[1]]


@pytest.mark.parametrize("system, args", [(ricochet.BouncingBall(), ()), (Ball(), (9.81, 0.9))])
def test_thirteen_impacts_of_the_ball(system, args):
    t, by_start, by_args = ball_derivatives()
    # Flights are parabolas, which steps integrate exactly: rounding, some ulp an impact.
    found = ricochet.gradient(lambda run: run.event_times[12], system, [10.0, 0.0], 20.5, args=args,
                              rtol=1e-10, atol=1e-10)
    assert found.value == pytest.approx(t, rel=1e-14)
    np.testing.assert_allclose(found.x0, by_start, rtol=1e-13)
    np.testing.assert_allclose(found.args, by_args, rtol=1e-13)


def test_a_loss_is_a_formula_of_the_numbers_of_a_run():
    def loss(run):
        return (np.sum((run.samples[:, 0] - 1) ** 2) + np.exp(run.x[1] / 10) + run.event_times[0]
                + run.before[1, 1] * run.after[0, 1])

    def value(h, which):
        x0, args = np.array([10.0, 0.0]), np.array([9.81, 0.9])
        (x0 if which < 2 else args)[which % 2] += h
        return ricochet.gradient(loss, Ball(), x0, 5.5, args=args, sample_times=[1, 3, 5]).value

    found = ricochet.gradient(loss, Ball(), [10.0, 0.0], 5.5, args=(9.81, 0.9),
                              sample_times=[1, 3, 5])
    for which, slope in enumerate([*found.x0, *found.args]):
        h = 1e-3  # error h^4 / 30 of the fifth derivative, rounding 1e-13 / h
        expected = (8 * (value(h, which) - value(-h, which))
                    - value(2 * h, which) + value(-2 * h, which)) / (12 * h)
        assert slope == pytest.approx(expected, rel=1e-8, abs=1e-8)


def test_functions_that_are_no_formulas_are_differentiated_by_differences():
    system = System(lambda t, x, g: [x[1], -g if x[1] < 1e9 else 0],
                    [Guard(lambda t, x, g: float(x[0]), name="floor",
                           reset=lambda t, x, g: [0, -0.9 * x[1]])])
    found = ricochet.gradient(lambda run: run.event_times[2], system, [10.0, 0.0], 7, args=[9.81])
    _, by_start, by_args = ball_derivatives(n=2)
    np.testing.assert_allclose(found.x0, by_start, rtol=1e-9)
    assert found.args[0] == pytest.approx(by_args[0], rel=1e-9)


def test_modes_and_args():
    system = System(lambda mode, t, x, low, high: [-0.1 * (x[0] - (30 if mode == "on" else 0))], [
        Guard(lambda mode, t, x, low, high: x[0] - low, name="cold", in_modes=["off"],
              reset=lambda mode, t, x, low, high: "on"),
        Guard(lambda mode, t, x, low, high: high - x[0], name="warm", in_modes=["on"],
              reset=lambda mode, t, x, low, high: "off")], modes=["off", "on"])
    run = ricochet.adjoint(system, [20.0], 20, args=(18.0, 22.0), mode="off", rtol=1e-11, atol=1e-11)
    assert run.event_guards[:2] == ["cold", "warm"] and run.mode in ("off", "on")
    # 20 exp(-t/10) = low, then 30 + (low - 30) exp(-s/10) = high.
    t1 = 10 * math.log(20 / 18)
    assert run.event_times[0] == pytest.approx(t1, rel=1e-10)
    by = run.gradient(event_times=[0, 1] + [0] * (len(run.event_times) - 2))
    assert by.x0[0] == pytest.approx(10 / 20, rel=1e-8)
    assert by.args[0] == pytest.approx(-10 / 18 - 10 / (30 - 18), rel=1e-8)
    assert by.args[1] == pytest.approx(10 / (30 - 22), rel=1e-8)


def network(inputs, seed):
    random = np.random.default_rng(seed)
    widths = [inputs, 8, 1]
    return Perceptron([(0.3 * random.standard_normal((b, a)), 0.3 * random.standard_normal(b))
                       for a, b in zip(widths, widths[1:])])


def test_networks_in_flow_guard_and_reset():
    flow, surface, kept = network(2, 1), network(2, 2), network(1, 3)
    system = System(lambda t, x: [x[1], flow(x[0], x[1]) - 9.8],
                    [Guard(lambda t, x: x[0] + surface(x[0], x[1]), name="floor",
                           reset=lambda t, x: [x[0], -x[1] / (1 + np.exp(-kept(x[1])))])])
    options = dict(sample_times=[0.5 * k for k in range(1, 8)], rtol=1e-12, atol=1e-12)

    def loss(run):
        return np.sum(run.samples[:, 0] ** 2)
    found = ricochet.gradient(loss, system, [5.0, 0.0], 4, **options)
    run = ricochet.adjoint(system, [5.0, 0.0], 4, **options)
    assert len(run.event_times) >= 2 and run.networks == (flow, surface, kept)
    random = np.random.default_rng(4)
    for k, each in enumerate(run.networks):
        assert found.networks[k].shape == each.parameters.shape
        direction = random.standard_normal(each.parameters.size)

        def value(h):
            values = [other.parameters for other in run.networks]
            values[k] = values[k] + h * direction
            return ricochet.gradient(loss, system, [5.0, 0.0], 4, networks=values, **options).value
        h = 1e-4
        expected = (8 * (value(h) - value(-h)) - value(2 * h) + value(-2 * h)) / (12 * h)
        assert found.networks[k] @ direction == pytest.approx(expected, rel=1e-7)


def test_a_network_computes_as_numpy_does():
    each = network(2, 5)
    (w, b), (v, c) = each.layers
    assert each(0.3, -0.2) == pytest.approx((v @ np.tanh(w @ [0.3, -0.2] + b) + c)[0])
    with pytest.raises(ValueError, match="found 3 inputs, expected 2"):
        each(1, 2, 3)
    with pytest.raises(ValueError, match="layer 1"):
        Perceptron([(np.zeros((3, 2)), np.zeros(3)), (np.zeros((1, 4)), np.zeros(1))])


def test_sensitivities_are_columns_of_start_and_arguments():
    found = ricochet.sensitivities(ricochet.BouncingBall(), [10.0, 0.0], 20.5, rtol=1e-10, atol=1e-10)
    _, by_start, by_args = ball_derivatives()
    np.testing.assert_allclose(found.event_times[12], by_start + by_args, rtol=1e-13)
    assert found.state.shape == (2, 4) and found.undefined_at is None


def test_a_forced_orbit_with_an_impact():
    system = ricochet.ImpactOscillator(frequency=0.8)
    period = 2 * math.pi / 0.8
    orbit = ricochet.find_periodic_orbit(system, [0.5, -1.5], period)
    assert orbit.converged, orbit.message
    matrix = ricochet.monodromy(system, orbit.x, period)
    np.testing.assert_allclose(matrix, orbit.monodromy, atol=1e-7)
    # The derivative of the motion after a period, by differences of runs.
    h = 1e-4
    for j in range(2):
        def end(sign):
            start = np.array(orbit.x)
            start[j] += sign * h
            return ricochet.adjoint(system, start, period, rtol=1e-12, atol=1e-12).x
        difference = (8 * (end(1) - end(-1)) - end(2) + end(-2)) / (12 * h)
        np.testing.assert_allclose(matrix[:, j], difference, atol=1e-6)
    # Liouville: the determinant is that of the damping, times e^2 for the impact's saltation.
    events = ricochet.adjoint(system, orbit.x, period, rtol=1e-12, atol=1e-12).event_times
    assert len(events) == 1
    assert np.linalg.det(matrix) == pytest.approx(0.8**2 * math.exp(-0.1 * period), rel=1e-6)
    assert abs(orbit.multipliers[0]) < 1  # it attracts


def test_the_limit_cycle_of_a_clock():
    # A damped pendulum that gets a kick k whenever it passes its lowest point upward: after a period
    # T = 2 pi / w, w^2 = 1 - d^2, the speed v is v exp(-d T) + k.
    damping, kick = 0.1, 0.3
    system = System(lambda t, x, d, k: [x[1], -x[0] - 2 * d * x[1]],
                    [Guard(lambda t, x, d, k: x[0], name="lowest", direction=1,
                           reset=lambda t, x, d, k: [x[0], x[1] + k])])
    w = math.sqrt(1 - damping**2)
    period = 2 * math.pi / w
    left = math.exp(-damping * period)
    # A quarter of a period behind the kick, where the angle is about that of the cycle.
    speed = kick / (1 - left)
    t = period / 4
    start = [speed / w * math.exp(-damping * t) * 1.05, 0.02]
    orbit = ricochet.find_periodic_orbit(system, start, 1.02 * period, autonomous=True,
                                         args=(damping, kick))
    assert orbit.converged, orbit.message
    assert orbit.period == pytest.approx(period, rel=1e-9)
    multipliers = sorted(orbit.multipliers.real)
    assert multipliers == pytest.approx([left, 1], abs=1e-8)


def test_spikes_of_an_integrate_and_fire_neuron():
    # v' = I - v from 0 to the threshold 1: ln(I / (I - 1)) from spike to spike.
    system = System(lambda t, v, current: [current - v[0]],
                    [Guard(lambda t, v, current: 1 - v[0], name="spike",
                           reset=lambda t, v, current: [0])])
    current = 1.5
    found = ricochet.gradient(lambda run: run.event_times[4], system, [0.0], 8, args=[current],
                              rtol=1e-11, atol=1e-11)
    assert found.value == pytest.approx(5 * math.log(3), rel=1e-10)
    assert found.args[0] == pytest.approx(-5 / (current * (current - 1)), rel=1e-9)
    assert found.x0[0] == pytest.approx(-1 / current, rel=1e-9)  # v0 is worth -dv / I of time


def test_a_billiard_in_a_circle():
    def reset(t, x):
        along = x[0] * x[2] + x[1] * x[3]
        size = x[0] * x[0] + x[1] * x[1]
        return [x[0], x[1], x[2] - 2 * along / size * x[0], x[3] - 2 * along / size * x[1]]
    table = System(lambda t, x: [x[2], x[3], 0, 0],
                   [Guard(lambda t, x: 1 - x[0] * x[0] - x[1] * x[1], name="cushion", reset=reset,
                          unilateral=True)])
    start, t_end = np.array([0.1, -0.2, 1.0, 0.7]), 9.0

    def loss(run):
        return run.x[0] + 0.3 * run.x[3] + run.event_times[-1]

    def value(h, i):
        moved = start.copy()
        moved[i] += h
        return ricochet.gradient(loss, table, moved, t_end).value
    found = ricochet.gradient(loss, table, start, t_end)
    for i in range(4):
        h = 1e-4  # every cushion magnifies; the fifth derivative is of size 1e6
        expected = (8 * (value(h, i) - value(-h, i)) - value(2 * h, i) + value(-2 * h, i)) / (12 * h)
        assert found.x0[i] == pytest.approx(expected, rel=1e-8)


def test_behind_a_grazing_event_the_gradient_is_nan():
    system = System(lambda t, x: [x[1], -x[0]],
                    [Guard(lambda t, x: 1 - 1e-10 - x[0], name="wall",
                           reset=lambda t, x: [x[0], -x[1]])])
    run = ricochet.adjoint(system, [0.0, 1.0], 2, method="rk4", step=1e-3, rtol=1e-9, atol=1e-9,
                           sample_times=[0.5])
    event, reason, sentence = run.undefined_at
    assert (event, reason) == (0, "grazing") and "touches" in sentence
    assert np.isnan(run.gradient(end=[1, 0]).x0).all()
    np.testing.assert_allclose(run.gradient(samples=[[1, 0]]).x0, [math.cos(0.5), math.sin(0.5)],
                               rtol=1e-11)


def test_time_events_stay_where_they_are():
    system = System(lambda t, x, k: [-x[0]], time_events=[1.0],
                    time_reset=lambda t, x, k: [k * x[0]])
    found = ricochet.gradient(lambda run: run.x[0], system, [2.0], 3, args=[0.5], rtol=1e-11,
                              atol=1e-11)
    assert found.x0[0] == pytest.approx(0.5 * math.exp(-3), rel=1e-9)
    assert found.args[0] == pytest.approx(2 * math.exp(-3), rel=1e-9)


def test_refusals_say_what_was_found():
    with pytest.raises(TypeError, match="found the ready system Thermostat"):
        ricochet.adjoint(ricochet.Thermostat(), [20.0], 5)
    with pytest.raises(ValueError, match="args: found some for a ready system"):
        ricochet.adjoint(ricochet.BouncingBall(), [10.0, 0.0], 5, args=[1.0])
    with pytest.raises(ValueError, match="method: found 'radau'"):
        ricochet.adjoint(ricochet.BouncingBall(), [10.0, 0.0], 5, method="radau")
    with pytest.raises(ValueError, match="found slopes of 3 events"):
        ricochet.adjoint(ricochet.BouncingBall(), [10.0, 0.0], 2).gradient(event_times=[1, 2, 3])
    with pytest.raises(ValueError, match="enabled"):
        ricochet.adjoint(System(lambda t, x: [1.0], [Guard(
            lambda t, x: 1 - x[0], enabled=lambda t, x: True)]), [0.0], 2)
    with pytest.raises(ValueError, match="activation"):
        Perceptron([(np.zeros((1, 1)), np.zeros(1))], "gelu")
