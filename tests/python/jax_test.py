"""Runs as functions of JAX."""

import numpy as np
import pytest

jax = pytest.importorskip("jax")
pytest.importorskip("ricochet._gradients", reason="the package was built without gradients")

import jax.numpy as jnp  # noqa: E402
import ricochet  # noqa: E402
import ricochet.jax as rj  # noqa: E402

jax.config.update("jax_enable_x64", True)


class Ball(ricochet.System):
    def flow(self, t, x, g, r):
        return [x[1], -g]

    def guard(self, t, x, g, r):
        return x[0]

    def reset(self, t, x, g, r):
        return [0, -r * x[1]]


def test_grad_and_jit_of_impact_times():
    system = Ball()

    def time(x0, args):
        return rj.run(system, x0, 5.5, args=args, events=3).event_times[1]
    x0, args = jnp.array([10.0, 0.0]), jnp.array([9.81, 0.9])
    t1 = np.sqrt(20 / 9.81)
    t = t1 * 2.8
    for function in (time, jax.jit(time)):
        assert function(x0, args) == pytest.approx(t, rel=1e-12)
        by_x0, by_args = jax.grad(function, argnums=(0, 1))(x0, args)
        np.testing.assert_allclose(by_x0, [t / 20, 1 / 9.81], rtol=1e-11)
        np.testing.assert_allclose(by_args, [-t / (2 * 9.81), 2 * t1], rtol=1e-11)
    # There are but two impacts in time.
    assert np.isnan(rj.run(system, x0, 5.5, args=args, events=3).event_times[2])


def test_networks_have_gradients():
    random = np.random.default_rng(1)
    layers = [(0.3 * random.standard_normal((8, 2)), 0.3 * random.standard_normal(8)),
              (0.3 * random.standard_normal((1, 8)), 0.3 * random.standard_normal(1))]
    a = ricochet.Perceptron(layers)
    system = ricochet.System(lambda t, x: [x[1], a(x[0], x[1]) - 9.8],
                             [ricochet.Guard(lambda t, x: x[0], name="floor",
                                             reset=lambda t, x: [0, -0.8 * x[1]])])

    def loss(networks):
        out = rj.run(system, [3.0, 0.0], 3.0, networks=networks, sample_times=[1.0, 2.5],
                     rtol=1e-12, atol=1e-12)
        return jnp.sum(out.samples ** 2) + out.x[0]
    given = [[tuple(jnp.asarray(part) for part in layer) for layer in layers]]
    slopes = jax.grad(loss)(given)
    h = 1e-5
    for k, part, index in ((0, 0, (3, 1)), (0, 1, (2,)), (1, 0, (0, 5)), (1, 1, (0,))):
        def moved(step):
            other = [[np.array(each) for each in layer] for layer in layers]
            other[k][part][index] += step
            return loss([[tuple(layer) for layer in other]])
        # Differences of order two: 1e-10 of the third derivative.
        expected = (moved(h) - moved(-h)) / (2 * h)
        assert slopes[0][k][part][index] == pytest.approx(expected, rel=1e-6)
