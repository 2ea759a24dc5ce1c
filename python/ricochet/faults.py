"""Rate-and-state friction, the spring-slider and the strike-slip fault.

``import ricochet.faults`` needs the module ``ricochet._faults``, which CMake builds with
``RICOCHET_FAULTS`` and pip with ``CMAKE_ARGS=-DRICOCHET_FAULTS=ON``::

    from ricochet import faults
    slider = faults.SpringSlider(stiffness=2.7e4, load_velocity=1.5e-4)
    run = slider.run(1.0, threshold=1e-3)
"""

from numbers import Integral
from os import fspath

import numpy as np

from ._compiled import Compiled
from ._numbers import number_from, numbers_from, state_from
from ._system import System

try:
    from . import _faults
except ModuleNotFoundError as error:
    raise ImportError(
        "ricochet: found a package without faults, expected the module ricochet._faults: build it with "
        "the CMake option RICOCHET_FAULTS, or pip's CMAKE_ARGS=-DRICOCHET_FAULTS=ON") from error

__all__ = ["Fault", "FaultFriction", "FaultRun", "FaultSystem", "Friction", "SliderRun", "SpringSlider"]

_EVOLUTIONS = ("ageing", "slip", "prz")
_EFFECTS = ("log", "asinh")
_SLIDER_STATE = np.dtype([("t", "f8"), ("x", "f8"), ("v", "f8"), ("xi", "f8")])
_SLIDER_EVENT = np.dtype([("kind", "U8"), *_SLIDER_STATE.descr])
_EARTHQUAKE = np.dtype([("start", "f8"), ("end", "f8"), ("mean_slip", "f8"), ("largest_velocity", "f8")])


def _place(given, names, what):
    if given not in names:
        raise ValueError(f"{what}: found {given!r}, expected one of {list(names)}")
    return names.index(given)


def _whole(given, what):
    if not isinstance(given, Integral) or isinstance(given, bool) or given < 0:
        raise ValueError(f"{what}: found {given!r}, expected a whole number, not negative")
    return int(given)


def _rows(array, dtype):
    """Rows of as many numbers as a structured type has, as an array of that type."""
    return np.ascontiguousarray(array).view(dtype)[:, 0] if len(array) else np.empty(0, dtype)


class Friction:
    """A law of rate-and-state friction.

    f = f* + a log(V / V*) + b xi, with xi = log(V* theta / D_RS), slip rate V [m/s] and state
    theta [s].

    Parameters
    ----------
    a, b : float
        The direct effect and that of the state, positive; weakening for b > a.
    f_star : float
        Steady friction coefficient at V*, positive.
    v_star : float
        V* [m/s], positive.
    d_rs : float
        D_RS [m], the characteristic slip distance, positive.
    evolution : str
        ``"ageing"`` (Dieterich), ``"slip"`` (Ruina) or ``"prz"`` (Perrin, Rice and Zheng).
    effect : str
        ``"asinh"``, for any V, or ``"log"``, for V > 0 alone.
    """

    def __init__(self, a=0.011, b=0.016, f_star=0.5109, v_star=1e-4, d_rs=1e-6, *,
                 evolution="ageing", effect="asinh"):
        given = dict(a=a, b=b, f_star=f_star, v_star=v_star, d_rs=d_rs)
        self._law = {name: number_from(value, name) for name, value in given.items()}
        self._law["evolution"] = _place(evolution, _EVOLUTIONS, "evolution")
        self._law["effect"] = _place(effect, _EFFECTS, "effect")
        _faults.evaluate(self._law, [v_star], [0.0])  # raises for parameters outside their range

    def evaluate(self, v, xi):
        """Friction coefficients and rates xi' [1/s], of numbers or arrays of one shape."""
        v, xi = np.broadcast_arrays(numbers_from(v, "v"), numbers_from(xi, "xi"))
        friction, rate = _faults.evaluate(self._law, v.ravel(), xi.ravel())
        if v.ndim == 0:
            return float(friction[0]), float(rate[0])
        return friction.reshape(v.shape), rate.reshape(v.shape)

    def critical_stiffness(self, mass, normal_force, v):
        """The stiffness [N/m] of a spring above which a block slides steadily at ``v`` [m/s]."""
        return _faults.critical_stiffness(self._law, number_from(mass, "mass"),
                                          number_from(normal_force, "normal_force"),
                                          number_from(v, "v"))

    def __repr__(self):
        values = ", ".join(f"{name}={self._law[name]:g}" for name in ("a", "b", "f_star", "v_star", "d_rs"))
        return (f"Friction({values}, evolution={_EVOLUTIONS[self._law['evolution']]!r}, "
                f"effect={_EFFECTS[self._law['effect']]!r})")


class _Found:
    """What a run has found, by name."""

    def __init__(self, found):
        vars(self).update(found)

    @property
    def success(self):
        """Whether the run reached its end, or rest."""
        return self.outcome in ("reached_end", "at_rest")


class SliderRun(_Found):
    """What a run of a `SpringSlider` has found.

    Attributes
    ----------
    outcome : str
    state : numpy.void
        The end: t [s], x [m], v [m/s], xi.
    events : structured array
        kind (``"onset"``, ``"arrest"``, ``"reversal"``), t, x, v, xi, located to neighbouring floats.
    samples : structured array
        t, x, v, xi, evenly spaced.
    steps, rejected, stages, iterations, unsolved, not_convex : int
        Counts; ``unsolved`` and ``not_convex`` are of stages of accepted steps.
    residual : float
        The largest of a stage.
    """

    def __repr__(self):
        return f"<SliderRun: {self.outcome} at t = {self.state['t']:g}, {len(self.events)} events>"


class SpringSlider:
    """A block on a spring whose far end is moved, with rate-and-state friction.

    Parameters
    ----------
    friction : Friction
        Its law; the slider takes the asinh form of the direct effect.
    stiffness : float
        Of the spring [N/m], not negative.
    mass, normal_force : float
        [kg] and [N], positive.
    load_velocity : float or sequence of (t, velocity)
        Velocity [m/s] of the driven end, or pieces of constant velocity with the times [s] from
        which they hold, ascending.
    load_start : float, optional
        Place of the driven end [m] at the first of them; by default where the spring holds the
        block against the friction f*.
    """

    def __init__(self, friction=None, *, stiffness=1e4, mass=1.0, normal_force=9.81,
                 load_velocity=1e-4, load_start=None):
        friction = Friction() if friction is None else friction
        if not isinstance(friction, Friction):
            raise TypeError(f"friction: found a {type(friction).__name__}, expected a Friction")
        self.friction = friction
        block = dict(mass=number_from(mass, "mass"), stiffness=number_from(stiffness, "stiffness"),
                     normal_force=number_from(normal_force, "normal_force"))
        pieces = numbers_from(load_velocity, "load_velocity")
        if pieces.ndim == 0:
            pieces = np.array([[0.0, float(pieces)]])
        if pieces.ndim != 2 or pieces.shape[1] != 2:
            raise ValueError(f"load_velocity: found shape {pieces.shape}, expected a number or "
                             "(pieces, 2)")
        self._block = block
        self.largest_convex_step = _faults.largest_convex_step(friction._law, block)
        if load_start is None:
            load_start = 0.0
            if block["stiffness"] > 0:
                load_start = block["normal_force"] * friction._law["f_star"] / block["stiffness"]
        self._slider = dict(friction._law, **block, load_start=number_from(load_start, "load_start"),
                            load_velocity=[(float(t), float(v)) for t, v in pieces])

    def run(self, t_end, *, t=0.0, x=0.0, v=None, xi=0.0, order=4, step=0.0, rtol=1e-8,
            first_step=1e-5, threshold=0.0, samples=0, max_steps=10_000_000):
        """Runs the slider by variational steps, which have a solution whatever their length.

        Parameters
        ----------
        t_end : float
            [s] after the start.
        t, x, v, xi : float
            The start: time [s], place [m], slip rate [m/s] (V* by default) and state.
        order : 1, 2 or 4
        step : float
            [s] of all steps; 0: by error control.
        rtol : float
            Relative to the slip rate, to \\|x\\| + D_RS for x, and to 1 for xi.
        first_step : float
            [s] under error control.
        threshold : float
            [m/s] of onset and arrest; 0: these are not searched for.
        samples : int
            Number of samples, both ends included.

        Returns
        -------
        SliderRun
        """
        v = self.friction._law["v_star"] if v is None else v
        start = [number_from(each, name) for each, name in ((t, "t"), (x, "x"), (v, "v"), (xi, "xi"))]
        found = _faults.run_slider(self._slider, start, dict(
            t_end=number_from(t_end, "t_end"), order=_whole(order, "order"),
            step=number_from(step, "step"), rtol=number_from(rtol, "rtol"),
            first_step=number_from(first_step, "first_step"),
            threshold=number_from(threshold, "threshold"), samples=_whole(samples, "samples"),
            max_steps=_whole(max_steps, "max_steps")))
        events = np.empty(len(found["kinds"]), _SLIDER_EVENT)
        events["kind"] = found.pop("kinds")
        at = _rows(found["events"], _SLIDER_STATE)
        for name in _SLIDER_STATE.names:
            events[name] = at[name]
        return SliderRun(dict(found, events=events, samples=_rows(found["samples"], _SLIDER_STATE),
                              state=_rows(found["state"], _SLIDER_STATE)[0]))


class FaultFriction:
    """Rate-and-state friction of a fault, its load and its start; uniform but for the normal stress.

    Parameters
    ----------
    law : Friction
        By default a = 0.01, b = 0.02, f* = 0.6, V* = 1e-6 m/s, D_RS = 0.01 m.
    plate_velocity : float
        [m/s] of the plates, not negative.
    normal_stress : float
        [Pa] of all elements; 0: that of the fault, which grows with depth.
    slip_rate : float
        [m/s] at the start, not zero; positive with the log form.
    theta : float, optional
        [s] at the start, positive; by default steady at ``slip_rate``.
    overload : float
        The stress at the start is 1 + overload times the friction there; above -1.
    """

    def __init__(self, law=None, *, plate_velocity=1e-9, normal_stress=0.0, slip_rate=1e-9, theta=None,
                 overload=1e-5):
        law = Friction(0.01, 0.02, 0.6, 1e-6, 0.01) if law is None else law
        if not isinstance(law, Friction):
            raise TypeError(f"law: found a {type(law).__name__}, expected a Friction")
        self.law = law
        given = dict(plate_velocity=plate_velocity, normal_stress=normal_stress, slip_rate=slip_rate,
                     overload=overload)
        self._given = dict(law._law, **{name: number_from(value, name) for name, value in given.items()},
                           theta=None if theta is None else number_from(theta, "theta"))


class FaultRun(_Found):
    """What a run of a `Fault` has found.

    Fields on the elements have the shape (n, n), rows downward from the surface.

    Attributes
    ----------
    outcome : str
    t : float
        [s] reached.
    mean_slip, peak_velocity, peak_time : float
        The mean slip [m], and the largest mean velocity [m/s] with its time [s].
    arrest_time, rest_time : float
        [s]; from when the mean velocity stays below 1e-3 of its peak, and when the last element
        stopped; NaN if it does not.
    slip, velocity, peak_velocity_of, arrival : arrays (n, n)
        At the end [m], [m/s]; the largest velocity of each element and its time.
    times, mean_slips, mean_velocities : arrays
    snapshots : structured array
        t, slip and velocity at ``snapshot_times``.
    longest_step, stable_step : float
        [s]
    statistics : dict
        Counts.
    earthquakes : structured array
        Of `Fault.earthquakes`: start, end [s], mean_slip [m], largest_velocity [m/s].
    xi, step_times, fastest : arrays
        Likewise: the state of the elements at the end, the ends of steps [s], and the velocity
        [m/s] of the fastest element at these times.
    residual, unsolved, inner, handed_over, elements_of_front
        Likewise: see docs/fault.md.
    """

    def __repr__(self):
        return f"<FaultRun: {self.outcome} at t = {self.t:g}, mean slip {self.mean_slip:g} m>"


class Fault:
    """A square strike-slip fault of n x n elements.

    Parameters
    ----------
    elements : int
        n, positive.
    side : float
        [m]
    shear_modulus, poisson, density : float
        [Pa], in [0, 0.5), [kg/m^3]
    damping : float
        Not negative.
    stress_gradient : float
        Of the normal stress with depth [Pa/m].
    residual_friction, friction_drop, slip_distance, overload : float
        Of friction that weakens with slip, in `rupture`.
    medium : str
        ``"full_space"`` or ``"half_space"``, with a free surface.
    mesh : str
        ``"plain"`` or ``"tip_corrected"``.
    kernel : path, optional
        A .npy or .safetensors file with the stresses due to slip, (n^2, n^2) [1/km].
    memory_limit : float
        [bytes]
    """

    def __init__(self, elements=1, *, side=3000.0, shear_modulus=30e9, poisson=0.25, density=2500.0,
                 damping=0.8 / 3, stress_gradient=15e3, residual_friction=0.5, friction_drop=0.1,
                 slip_distance=0.1, overload=1e-5, medium="full_space", mesh="plain", kernel=None,
                 memory_limit=2.0**30):
        given = dict(side=side, shear_modulus=shear_modulus, poisson=poisson, density=density,
                     damping=damping, stress_gradient=stress_gradient,
                     residual_friction=residual_friction, friction_drop=friction_drop,
                     slip_distance=slip_distance, overload=overload, memory_limit=memory_limit)
        self.elements = _whole(elements, "elements")
        self._fault = _faults.Fault(dict(
            {name: number_from(value, name) for name, value in given.items()}, elements=self.elements,
            medium=_place(medium, ("full_space", "half_space"), "medium"),
            mesh=_place(mesh, ("plain", "tip_corrected"), "mesh"),
            kernel="" if kernel is None else fspath(kernel)))

    @property
    def factor(self):
        """The factor of the stiffness, for which a uniform drop of friction gives the slip of a spring."""
        return self._fault.factor

    @property
    def time_unit(self):
        """L sqrt(rho / G) [s]."""
        return self._fault.time_unit

    @property
    def depths(self):
        """Depths [m] of the centres of the rows, shape (n,)."""
        return np.array([self._fault.depth(row) for row in range(self.elements)])

    def rupture(self, t_end, *, step=0.0, rtol=None, snapshot_times=(), polynomial_bound=0.0,
                max_steps=1_000_000, integrator="explicit", controller="constant", policy=None):
        """Runs the rupture, with Coulomb friction that weakens with slip.

        Parameters
        ----------
        t_end : float
            [s]
        step : float
            [s]; the longest explicit step, 0: chosen; the first implicit step, or all of them.
        rtol : float, optional
            Allowed error of a step, relative to the fields: 1e-4 of explicit steps (infinite: steps
            of one length), 1e-3 of implicit steps.
        snapshot_times : array_like
            [s] ascending.
        polynomial_bound : float
            Largest relative error of the polynomial for sqrt(K); 0: chosen.
        integrator : str
            ``"explicit"``, or Bathe's implicit steps: ``"bathe"``, of order 2, ``"bathe-published"``.
        controller : str
            Of implicit steps: ``"constant"``, ``"error"``, ``"heuristic"``, ``"pi"``, ``"filter"``,
            or ``"learned"``, with the model file ``policy``.

        Returns
        -------
        FaultRun
        """
        _place(integrator, ("explicit", "bathe", "bathe-published"), "integrator")
        _place(controller, ("constant", "error", "heuristic", "pi", "filter", "learned"), "controller")
        is_implicit = integrator != "explicit"
        if controller != "constant" and not is_implicit:
            raise ValueError(f"controller: found {controller!r} of explicit steps, expected integrator='bathe'")
        if integrator == "bathe-published" and controller in ("error", "learned"):
            raise ValueError(f"controller: found {controller!r} beside integrator='bathe-published', expected "
                             "'bathe', whose averaged scheme it belongs to")
        if (policy is not None) != (controller == "learned"):
            raise ValueError("policy: found one of policy and controller='learned', expected both")
        bathe = None
        if is_implicit:
            bathe = dict(published=integrator == "bathe-published", controller=controller,
                         rtol=1e-3 if rtol is None else number_from(rtol, "rtol"),
                         policy="" if policy is None else fspath(policy))
        found = self._fault.rupture(self._options(t_end, step, 1e-4 if rtol is None else rtol,
                                                  snapshot_times, polynomial_bound, max_steps), bathe)
        return self._run(found)

    def earthquakes(self, t_end, friction=None, *, step=0.0, rtol=1e-4, snapshot_times=(),
                    polynomial_bound=0.0, max_steps=1_000_000, order=4, first_step=0.0, threshold=1e-3):
        """Runs earthquake cycles, with rate-and-state friction, from years to microseconds.

        Parameters
        ----------
        t_end : float
            [s]
        friction : FaultFriction
        step : float
            [s] The longest step; 0: no limit.
        rtol : float
            Allowed error of a step; infinite: all steps have the length ``step``.
        order : 1, 2 or 4
        first_step : float
            [s]; 0: chosen.
        threshold : float
            [m/s] of the fastest element, which starts and ends an earthquake.

        Returns
        -------
        FaultRun
        """
        friction = FaultFriction() if friction is None else friction
        if not isinstance(friction, FaultFriction):
            raise TypeError(f"friction: found a {type(friction).__name__}, expected a FaultFriction")
        options = dict(self._options(t_end, step, rtol, snapshot_times, polynomial_bound, max_steps),
                       order=_whole(order, "order"), first_step=number_from(first_step, "first_step"),
                       threshold=number_from(threshold, "threshold"))
        found = self._fault.earthquakes(options, friction._given)
        found["earthquakes"] = _rows(found["earthquakes"], _EARTHQUAKE)
        found["xi"] = self._field(found["xi"])
        return self._run(found)

    def system(self, friction=None, *, polynomial_bound=0.0):
        """The fault with rate-and-state friction as a `FaultSystem`."""
        return FaultSystem(self, friction, polynomial_bound=polynomial_bound)

    @staticmethod
    def _options(t_end, step, rtol, snapshot_times, polynomial_bound, max_steps):
        times = numbers_from(snapshot_times, "snapshot_times")
        if times.ndim != 1:
            raise ValueError(f"snapshot_times: found {times.ndim} dimensions, expected 1")
        return dict(t_end=number_from(t_end, "t_end"), step=number_from(step, "step"),
                    rtol=number_from(rtol, "rtol"), snapshot_times=times.tolist(),
                    polynomial_bound=number_from(polynomial_bound, "polynomial_bound"),
                    max_steps=_whole(max_steps, "max_steps"))

    def _field(self, values):
        return values.reshape(self.elements, self.elements)

    def _run(self, found):
        n = self.elements
        for name in ("slip", "velocity", "peak_velocity_of", "arrival"):
            found[name] = self._field(found[name])
        kind = np.dtype([("t", "f8"), ("slip", "f8", (n, n)), ("velocity", "f8", (n, n))])
        snapshots = np.empty(len(found["snapshots"]), kind)
        for row, (t, slip, velocity) in zip(snapshots, found["snapshots"]):
            row["t"], row["slip"], row["velocity"] = t, self._field(slip), self._field(velocity)
        return FaultRun(dict(found, snapshots=snapshots))

    def __repr__(self):
        return f"Fault({self.elements})"


class FaultSystem(System):
    """A fault with rate-and-state friction as an ordinary differential equation.

    For `ricochet.integrate` by any method, with the Jacobian written out for ``"rosenbrock4"``; runs
    do not hold the interpreter lock. The state has u / D_RS, log(V / V*) and xi of all elements, one
    block after the other; docs/fault.md says which method to take. V is positive here.

    Parameters
    ----------
    fault : Fault
    friction : FaultFriction
    polynomial_bound : float
        Largest relative error of the polynomial for sqrt(K); 0: the exact root on up to 400
        elements, 1e-8 on more.
    """

    _unchecked_names = True
    name = "rate-state-fault"

    def __init__(self, fault, friction=None, *, polynomial_bound=0.0):
        friction = FaultFriction() if friction is None else friction
        if not isinstance(fault, Fault):
            raise TypeError(f"fault: found a {type(fault).__name__}, expected a Fault")
        if not isinstance(friction, FaultFriction):
            raise TypeError(f"friction: found a {type(friction).__name__}, expected a FaultFriction")
        self.fault, self.friction = fault, friction
        self._of = _faults.FaultSystem(fault._fault, friction._given,
                                       number_from(polynomial_bound, "polynomial_bound"))
        super().__init__(self._compiled(self._of.flow), jacobian=self._compiled(self._of.jacobian))

    def _compiled(self, address):
        out = Compiled(address, self._of.user)
        out._kept = self._of  # as long as the function may be called
        return out

    def start(self):
        """The start that the friction describes, shape (3 n^2,)."""
        return self._of.start()

    def slip(self, t, x):
        """Slips [m] of a state at time ``t`` [s], shape (n, n)."""
        return self.fault._field(self._of.slip(number_from(t, "t"), state_from(x, "x")))

    def velocity(self, x):
        """Slip rates [m/s] of a state, shape (n, n)."""
        return self.fault._field(self._of.velocity(state_from(x, "x")))
