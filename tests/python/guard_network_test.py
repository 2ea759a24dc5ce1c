"""Networks as guards."""

import copy
import pickle

import numpy as np
import pytest

from ricochet import Guard, GuardNetwork, System, integrate, solve_ivp

GRAVITY = 9.81


def line(a=0.3, b=1.0, c=-0.2, **options):
    """g = a x + b y - c, by two ReLU that add up to the identity, with their kink at g = -1."""
    first = [[a, b], [-a, -b]], [1 - c, c - 1]
    return GuardNetwork.from_layers([first, ([[1.0, -1.0]], [-1.0])], "relu", **options)


def random_network(seed, activation="tanh", components=(), residual=(1,)):
    of = np.random.default_rng(seed)
    layers = [(of.normal(size=(16, 2)), of.normal(size=16)),
              (of.normal(size=(16, 16)) / 4, of.normal(size=16)),
              (of.normal(size=(1, 16)) / 4, of.normal(size=1))]
    return layers, GuardNetwork.from_layers(layers, activation, offset=[0.1, -0.2], scale=[2, 0.5],
                                            residual=residual, components=components)


ACTIVATIONS = {"tanh": np.tanh, "relu": lambda z: np.maximum(z, 0), "sin": np.sin,
               "softplus": lambda z: np.logaddexp(0, z), "silu": lambda z: z / (1 + np.exp(-z))}


@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_values_and_gradients_are_those_of_the_layers(activation):
    layers, network = random_network(1, activation)
    points = np.random.default_rng(2).normal(size=(40, 2))
    act = ACTIVATIONS[activation]

    def by_hand(x):
        z = act(((x - [0.1, -0.2]) * [2, 0.5]) @ layers[0][0].T + layers[0][1])
        z = act(z @ layers[1][0].T + layers[1][1]) + z
        return (z @ layers[2][0].T + layers[2][1])[:, 0]

    np.testing.assert_allclose(network.value(points), by_hand(points), rtol=0, atol=1e-13)
    assert network(0, points[3]) == network.value(points[3]) == network.value(points)[3]
    h = 1e-6
    differences = np.column_stack([(by_hand(points + step) - by_hand(points - step)) / (2 * h)
                                   for step in h * np.eye(2)])
    # A difference is off by h^2 times the third derivative, and by rounding over h.
    np.testing.assert_allclose(network.gradient(points), differences, rtol=0, atol=1e-7)
    normals = network.normal(points)
    np.testing.assert_allclose(np.hypot(*normals.T), 1, rtol=1e-15)
    assert network.gradient(points[0]).shape == (2,) and network.value(points[0]).shape == ()


def reflect(surface, y, restitution=0.5):
    n = surface.normal(y[:2])
    v = np.asarray(y[2:])
    return np.concatenate((y[:2], v - (1 + restitution) * (v @ n) * n))


def bounces(event):
    return solve_ivp(lambda t, y: [y[2], y[3], 0.0, -GRAVITY], (0, 1.5), [0.0, 2.0, 1.0, 0.0],
                     events=event, rtol=1e-10, atol=1e-12)


def test_events_are_those_of_the_same_guard_in_python():
    surface = line()
    surface.direction = -1
    surface.reset = lambda t, y: reflect(surface, y)

    def formula(t, y):
        return 0.3 * y[0] + y[1] + 0.2

    formula.direction = -1
    formula.reset = surface.reset
    found, expected = bounces(surface), bounces(formula)
    assert len(found.t_events[0]) == len(expected.t_events[0]) == 2
    # Rounding of the guard over its speed, and what the impacts before make of it.
    np.testing.assert_allclose(found.t_events[0], expected.t_events[0], rtol=0, atol=1e-12)
    first = found.y_events[0][0]
    assert abs(0.3 * first[0] + first[1] + 0.2) < 1e-14


def test_components_choose_the_inputs():
    _, network = random_network(3, components=[3, 1])
    y = [0.5, -0.7, 9.0, 0.25]
    assert network(0, y) == network.value([0.25, -0.7])
    assert network.components == (3, 1) and network.inputs == 2
    with pytest.raises(ValueError, match=r"events\[0\] must be finite at the start, got nan"):
        solve_ivp(lambda t, y: [1.0, 0.0], (0, 1), [0.0, 0.0], events=network)


def test_it_is_a_guard_of_a_system_with_its_rate():
    surface = line(1.0, 0.0, 0.0)
    ball = System(lambda t, x: [x[1], -GRAVITY],
                  [Guard(surface, reset=lambda t, x: [0.0, -0.5 * x[1]], unilateral=True,
                         rest=lambda t, x: [0.0, 0.0])])
    run = integrate(ball, [1.0, 0.0], 2.0)
    first = np.sqrt(2 / GRAVITY)
    times = run.events["t"]
    assert run.outcome == "reached_end"
    # Each flight takes half as long as the one before; the first is a fall.
    np.testing.assert_allclose(times[:5], first * (1 + 2 * (1 - 0.5 ** np.arange(5))), atol=1e-9)
    # A difference of two values would be off by a millionth.
    np.testing.assert_allclose(run.events["slope"][:5], run.events["before"][:5, 1], rtol=1e-13)


def test_terminal_and_either_direction():
    surface = line(1.0, 0.0, 0.0)
    surface.direction = 0
    surface.terminal = 2
    run = solve_ivp(lambda t, y: [-y[1], y[0]], (0, 20), [1.0, 0.0], events=surface, rtol=1e-10,
                    atol=1e-12)
    np.testing.assert_allclose(run.t_events[0], [np.pi / 2, 3 * np.pi / 2], atol=1e-8)
    assert run.status == 1


def test_it_is_stored_copied_and_passed_to_processes(tmp_path):
    _, network = random_network(5, "silu", components=[1, 0])
    network.direction = 1
    points = np.random.default_rng(6).normal(size=(20, 2))
    path = tmp_path / "surface.safetensors"
    network.save(path)
    for other in (GuardNetwork(path, [1, 0]), pickle.loads(pickle.dumps(network)),
                  copy.deepcopy(network), GuardNetwork.from_bytes(network.to_bytes(), [1, 0])):
        assert np.array_equal(other.value(points), network.value(points))
        assert other.components == (1, 0)
    assert pickle.loads(pickle.dumps(network)).direction == 1


def test_networks_that_are_given_in_turn_are_not_mistaken_for_one_another():
    def flow(t, y):
        return [1.0]

    def zero_at(c):
        return GuardNetwork.from_layers([([[1.0]], [-c])])

    for c in (0.25, 0.5, 0.75):
        surface = zero_at(c)
        surface.direction = 1
        assert abs(solve_ivp(flow, (0, 1), [0.0], events=surface).t_events[0][0] - c) < 1e-14


@pytest.mark.parametrize("layers, options, words", [
    ([], {}, "layer"),
    ([([[1.0, 2.0]], [0.0, 1.0])], {}, "shape"),
    ([([[1.0, 2.0], [1.0, 0.0]], [0.0, 1.0])], {}, "output"),
    ([([[np.nan, 2.0]], [0.0])], {}, "finite"),
    ([([[1.0, 2.0]], [0.0])], {"activation": "gelu"}, "gelu"),
    ([([[1.0, 2.0]], [0.0])], {"components": [0]}, "components: found 1, expected 2"),
    ([([[1.0, 2.0]], [0.0])], {"components": [0, -1]}, "-1"),
    ([([[1.0, 2.0]], [0.0])], {"components": [0, 1.5]}, "1.5"),
    ([([[1.0, 2.0]], [0.0])], {"scale": [1.0]}, "scale"),
    ([([[1.0, 2.0]], [0.0])], {"residual": [0]}, "residual"),
    ([(np.ones((1, 513)), [0.0])], {}, "512"),
])
def test_what_is_no_guard_is_refused(layers, options, words):
    with pytest.raises(ValueError, match=words):
        GuardNetwork.from_layers(layers, **options)


def test_wrong_calls_say_what_is_expected(tmp_path):
    network = line()
    with pytest.raises(ValueError, match=r"found shape \(3,\), expected \(2,\) or \(rows, 2\)"):
        network.value([1.0, 2.0, 3.0])
    path = tmp_path / "damaged.safetensors"
    path.write_bytes(network.to_bytes()[:-3])
    with pytest.raises(ValueError, match="damaged"):
        GuardNetwork(path)
    with pytest.raises(FileNotFoundError):
        GuardNetwork(tmp_path / "none")
