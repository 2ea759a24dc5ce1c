"""diffrax on JAX: `Event` with a Newton iteration, in loops that are compiled; vmap, and grad."""
import sys

import jax

jax.config.update("jax_enable_x64", True)

import diffrax  # noqa: E402
import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402
import optimistix  # noqa: E402

import problems  # noqa: E402
from cell import events, main, rows, values, version  # noqa: E402


def options(tolerance, event, solver=diffrax.Tsit5):
    return {"solver": solver(), "max_steps": 64,
            "stepsize_controller": diffrax.PIDController(rtol=tolerance, atol=tolerance), "event": event}


def floor(tolerance):
    return diffrax.Event(lambda t, y, args, **kwargs: y[0], optimistix.Newton(tolerance, tolerance),
                         direction=False)


def falls(t, y, args):
    return jnp.array([y[1], -args])


def impact(t, y, gravity, t_end, tolerance, solver):
    """From one impact to the next or to the end: where it is, before the impact, and whether there was one."""
    found = diffrax.diffeqsolve(diffrax.ODETerm(falls), t0=t, t1=t_end, dt0=None, y0=y, args=gravity,
                                **options(tolerance, floor(tolerance), solver))
    return found.ts[-1], found.ys[-1], diffrax.is_event(found.result)


def ball(tolerance, solver):
    def make():
        @jax.jit
        def run(y0):
            def flight(carry):
                k, t, y, times, _ = carry
                t, y, hit = impact(t, y, problems.GRAVITY, problems.T_END, tolerance, solver)
                times = times.at[k].set(jnp.where(hit, t, jnp.inf))
                return k + 1, t, jnp.array([0.0, -problems.RESTITUTION * y[1]]), times, hit
            room = jnp.full(2 * problems.IMPACTS, jnp.inf)
            start = (0, jnp.array(0.0), y0, room, jnp.array(True))
            return jax.lax.while_loop(lambda c: c[4], flight, start)[3]
        y0 = jnp.array([problems.HEIGHT, 0.0])
        return lambda: run(y0).block_until_ready(), lambda t: events(t[jnp.isfinite(t)])
    return make


def balls(tolerance, solver):
    """All balls under `vmap`, which go on until the last has ended."""
    def make():
        def one(y0, restitution):
            def flight(carry):
                k, t, y, last, _ = carry
                t, y, hit = impact(t, y, problems.GRAVITY, problems.BALLS_END, tolerance, solver)
                return (k + hit, t, jnp.array([0.0, -restitution * y[1]]), jnp.where(hit, t, last), hit)
            start = (0, jnp.array(0.0), y0, jnp.array(0.0), jnp.array(True))
            end = jax.lax.while_loop(lambda c: c[4], flight, start)
            return end[0], end[3]
        run = jax.jit(jax.vmap(one))
        heights, restitutions = problems.ball_table()
        y0 = jnp.array([[height, 0.0] for height in heights])
        each = jnp.array(restitutions)
        return lambda: jax.block_until_ready(run(y0, each)), lambda raw: rows(*map(np.asarray, raw))
    return make


def gradient(tolerance, solver):
    """Reverse mode through `impacts` runs, each ended by its event."""
    def make():
        def last(height, gravity, restitution):
            def flight(carry, _):
                t, y = carry
                t, y, _ = impact(t, y, gravity, problems.T_END, tolerance, solver)
                return (t, jnp.array([0.0, -restitution * y[1]])), None
            start = (jnp.array(0.0), jnp.array([height, 0.0]))
            (t, _), _ = jax.lax.scan(flight, start, length=problems.IMPACTS)
            return t
        run = jax.jit(jax.value_and_grad(last, (0, 1, 2)))
        at = (problems.HEIGHT, problems.GRAVITY, problems.RESTITUTION)
        return lambda: jax.block_until_ready(run(*at)), lambda raw: values(raw[1])
    return make


def crossings(flow, surface, start, t_end, count, tolerance):
    """A recorded event is one that ends the run: a loop of runs, each from the event before."""
    def make():
        @jax.jit
        def run(y0):
            event = diffrax.Event(lambda t, y, args, **kwargs: surface(y),
                                  optimistix.Newton(tolerance, tolerance), direction=True)

            def piece(carry):
                k, t, y, times, _ = carry
                found = diffrax.diffeqsolve(diffrax.ODETerm(lambda t, y, args: flow(y)), t0=t, t1=t_end, dt0=None,
                                            y0=y, **options(tolerance, event, diffrax.Dopri8))
                hit = diffrax.is_event(found.result)
                t, y = found.ts[-1], found.ys[-1]
                times = times.at[k].set(jnp.where(hit, t, jnp.inf))
                # Off the surface, or the next run finds the same event again.
                return k + 1, t + 1e-9, y + 1e-9 * flow(y), times, hit
            room = jnp.full(2 * count, jnp.inf)
            return jax.lax.while_loop(lambda c: c[4] & (c[0] < 2 * count), piece,
                                      (0, jnp.array(0.0), y0, room, jnp.array(True)))[3]
        y0 = jnp.array(start)
        return lambda: run(y0).block_until_ready(), lambda t: events(t[jnp.isfinite(t)])
    return make


def star(s):
    x, y, u, v = s
    return jnp.array([u, v, -x - 2.0 * x * y, y * y - y - x * x])


def lorenz(s):
    x, y, z = s
    return jnp.array([10.0 * (y - x), x * (28.0 - z) - y, x * y - (8.0 / 3.0) * z])


def cells():
    out = []
    for name, solver in (("Tsit5", diffrax.Tsit5), ("Dopri8", diffrax.Dopri8)):
        for tolerance in (1e-8, 1e-12):
            out.append(("ball", "diffrax", f"jit, {name}", tolerance, ball(tolerance, solver)))
    for tolerance in (1e-6, 1e-8):
        out.append(("balls", "diffrax", "vmap, Tsit5", tolerance, balls(tolerance, diffrax.Tsit5)))
    for tolerance in (1e-8, 1e-12):
        out.append(("gradient", "diffrax", "grad, Tsit5", tolerance, gradient(tolerance, diffrax.Tsit5)))
    for tolerance in (1e-8, 1e-12):
        out.append(("henon-heiles", "diffrax", "jit, Dopri8, a run for each crossing", tolerance,
                    crossings(star, lambda s: s[0], problems.HENON_HEILES, problems.HENON_HEILES_END, 200,
                              tolerance)))
        out.append(("lorenz", "diffrax", "jit, Dopri8, a run for each crossing", tolerance,
                    crossings(lorenz, lambda s: s[2] - 27.0, problems.LORENZ, problems.LORENZ_END, 20,
                              tolerance)))
    return out


if __name__ == "__main__":
    sys.exit(main({"diffrax": version("diffrax"), "JAX": version("jax")}, cells()))
