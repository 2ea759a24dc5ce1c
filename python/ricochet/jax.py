"""Runs of hybrid systems as functions of JAX, with gradients through events.

``import ricochet.jax`` needs JAX. The functions work under ``jit`` and ``grad``; a run takes place on
the host. Numbers are those of float64 inside, and of the type of ``x0`` outside::

    def loss(x0, args):
        out = ricochet.jax.run(system, x0, 5.0, args=args, sample_times=times)
        return jnp.sum((out.samples[:, 0] - data) ** 2)
    jax.grad(loss, argnums=(0, 1))(x0, args)
"""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ._gradient import _recording_of, adjoint


class Result(NamedTuple):
    """Arrays of a run: the state ``x`` at the end, ``samples``, a row for each sample time, and the
    times of the first ``events`` events, NaN where there are fewer."""

    x: Any
    samples: Any
    event_times: Any


class _Call:
    """A run with all but the numbers of its arrays; compared by what it is made of."""

    def __init__(self, system, t_end, events, options, dtype):
        self.system, self.t_end, self.events = system, t_end, events
        self.options, self.dtype = options, dtype

    def adjoint(self, x0, args, networks):
        flat = [np.concatenate([np.asarray(part, dtype=float).ravel() for layer in each
                                for part in layer]) for each in networks]
        return adjoint(self.system, np.asarray(x0, dtype=float), self.t_end,
                       args=np.asarray(args, dtype=float), networks=flat or None, **self.options)

    def times_of(self, run):
        out = np.full(self.events, np.nan)
        known = run.event_times[:self.events]
        out[:len(known)] = known
        return out

    def forward(self, x0, args, networks):
        run = self.adjoint(x0, args, networks)
        return tuple(np.asarray(each, dtype=self.dtype) for each in (
            run.x, run.samples, self.times_of(run)))

    def backward(self, x0, args, networks, x, samples, event_times):
        run = self.adjoint(x0, args, networks)
        times = np.zeros(len(run.event_times))
        known = np.asarray(event_times, dtype=float)[:len(times)]
        times[:len(known)] = np.where(np.isnan(known), 0, known)
        by = run.gradient(end=np.asarray(x, dtype=float),
                          samples=np.asarray(samples, dtype=float) if len(samples) else None,
                          event_times=times)
        shaped = [network.shaped(flat) for network, flat in zip(run.networks, by.networks)]
        slopes = [[tuple(np.asarray(part, dtype=given.dtype) for part, given in zip(layer, like))
                   for layer, like in zip(one, other)] for one, other in zip(shaped, networks)]
        by_args = by.args[:args.size]  # those of a ready system are its parameters
        return np.asarray(by.x0, dtype=self.dtype), np.asarray(by_args, dtype=args.dtype), slopes


def _shapes(tree):
    return jax.tree_util.tree_map(lambda each: jax.ShapeDtypeStruct(each.shape, each.dtype), tree)


@partial(jax.custom_vjp, nondiff_argnums=(0,))
def _run(call, x0, args, networks):
    shapes = tuple(jax.ShapeDtypeStruct(shape, call.dtype) for shape in (
        x0.shape, (len(call.options.get("sample_times", ())), x0.size), (call.events,)))
    return jax.pure_callback(call.forward, shapes, x0, args, networks)


def _run_forward(call, x0, args, networks):
    return _run(call, x0, args, networks), (x0, args, networks)


def _run_backward(call, kept, slopes):
    return tuple(jax.pure_callback(call.backward, _shapes(tuple(kept)), *kept, *slopes))


_run.defvjp(_run_forward, _run_backward)


def run(system, x0, t_end, *, args=(), networks=(), events=0, **options):
    """Runs a system, and returns its numbers as arrays with gradients: a `Result`.

    Parameters
    ----------
    networks : list of lists of (weight, bias)
        Values for the `ricochet.Perceptron` objects that the functions of the system call, in the
        order in which they do; by default their own, without gradients.
    events : int
        The number of events whose times are returned.

    The other arguments are those of `ricochet.adjoint`. ``sample_times`` are fixed numbers, which the
    run must reach.
    """
    x0 = jnp.atleast_1d(jnp.asarray(x0, dtype=None if hasattr(x0, "dtype") else float))
    args = jnp.atleast_1d(jnp.asarray(args, dtype=x0.dtype))
    networks = [[tuple(jnp.asarray(part) for part in layer) for layer in each] for each in networks]
    recording, _ = _recording_of(system, x0.size, np.zeros(args.shape))
    if networks and len(networks) != len(recording.networks):
        raise ValueError(f"networks: found {len(networks)}, expected {len(recording.networks)}")
    if "sample_times" in options:
        options["sample_times"] = tuple(np.atleast_1d(options["sample_times"]).tolist())
    call = _Call(system, t_end, events, options, x0.dtype)
    return Result(*_run(call, x0, args, networks))
