"""Running systems."""

from enum import IntEnum

import numpy as np

from . import _progress, _ricochet
from ._compiled import is_compiled
from ._network import set_gate
from ._numbers import number_from, numbers_from, state_from
from ._ready import Ready
from ._system import System


class Named(IntEnum):
    """A number that is printed by its name."""

    def __str__(self):
        return self.name

    def __format__(self, specification):
        return int.__format__(self, specification) if specification else self.name


class Kind(Named):
    """Kind of an event: the field ``kind`` of ``run.events``.

    CROSSING : the guard changed sign
    TOUCH : the guard reached its surface and turned back
    TIME : a time event
    ACCUMULATION : the limit of infinitely many events
    MODE : the flow lifts what the rest of the guard held; a reaction goes to its other bound
    STICK : a reaction begins to hold something, with ``set_valued``
    SLIP : it no longer does
    JUMP : the guard changed sign without a zero
    """

    CROSSING = 0
    TOUCH = 1
    TIME = 2
    ACCUMULATION = 3
    MODE = 4
    STICK = 5
    SLIP = 6
    JUMP = 7


def set_tolerance(options, atol, components):
    """``atol`` as one number, or as one for each component of the start."""
    array = numbers_from(atol, "atol")
    if array.ndim == 0:
        options["atol"] = float(array)
        return
    if array.shape != (components,):
        raise ValueError(f"atol: found shape {array.shape}, expected a number or "
                         f"({components},)")
    if not np.all(np.isfinite(array)) or np.any(array < 0):
        raise ValueError("atol: found a number that is negative or not finite")
    options["component_atol"] = array.tolist()
    # The tolerance of components that a reset adds.
    options["atol"] = float(array[array > 0].min()) if np.any(array > 0) else 0.0


def set_mode(options, system, modes):
    """The mode at the start as a number."""
    names = modes if modes is not None else getattr(system, "modes", None)
    if names is None or "mode" not in options:
        return
    given = options["mode"]
    if given in names:
        options["mode"] = list(names).index(given)
    elif not isinstance(given, int) or given not in range(len(names)):
        raise ValueError(f"mode: found {given!r}, expected one of {list(names)}")


def set_start_mode(options, source, x0):
    """The mode of a `Filippov` at the start, where the caller gives none."""
    if "mode" not in options and isinstance(source, _ricochet.FilippovSource):
        t_start = number_from(options.get("t_start", 0.0), "t_start")
        options["mode"] = source.start_mode_at(t_start, x0, 0.0)


def source_of(system, args=None, watch=None):
    """The C++ object of a system, and its list of modes."""
    if isinstance(system, Ready):
        if args:
            raise TypeError("args: found some for a ready system, expected none")
        return system._source, None
    if isinstance(system, System):
        return system._source(args, watch), system._mode_list()
    raise TypeError(f"system: found a {type(system).__name__}, expected a ricochet.System or a "
                    "ready system")


def is_called_from_python(system):
    """Whether the flow of a system is a Python function, called in every step."""
    flow = system.flow if isinstance(system, System) else None
    if flow is None:
        flow = next(iter(getattr(system, "fields", ())), None)  # of a Filippov
    return flow is not None and system.formula is None and not is_compiled(flow)


def prepare(system, x0, t_end, options, args=None, watch=None):
    """The arguments of the C++ functions."""
    source, modes = source_of(system, args, watch)
    x0 = state_from(x0, "x0")
    options = dict(options, t_end=number_from(t_end, "t_end"))
    set_mode(options, system, modes)
    set_start_mode(options, source, x0)
    set_gate(options)
    if not isinstance(options.get("atol", 0), (float, int)):
        set_tolerance(options, options["atol"], len(x0))
    samples = options.get("sample_times")
    if samples is not None:
        samples = numbers_from(samples, "sample_times")
        if samples.ndim > 1:
            raise ValueError(f"sample_times: found {samples.ndim} dimensions, expected 1")
        options["sample_times"] = samples.ravel().tolist()
    else:
        options.pop("sample_times", None)
    if options.pop("record_steps", False):
        options["dense"] = True
        options["record_steps"] = samples is None
    return source, x0, options, modes


def _integrate_with(progress, system, x0, t_end, options):
    """A run that shows its progress, from the flow or, where that is compiled, between steps."""
    end = number_from(t_end, "t_end")
    with _progress.OfTime(progress, number_from(options.get("t_start", 0.0), "t_start"), end) as shown:
        if is_called_from_python(system):
            source, x0, options, modes = prepare(system, x0, end, options, watch=shown.watching)
            run = _ricochet.integrate(source, x0, options, modes)
        elif options.get("record_steps"):
            raise TypeError("progress: found beside record_steps for a system that is computed "
                            "without Python, expected sample_times")
        else:
            simulation = Simulation(system, x0, end, **options)
            while simulation.step():
                shown.at(simulation.t)
            run = simulation.finish()
        shown.show(run.t)
    return run


def integrate(system, x0, t_end, *, progress=None, **options):
    """Integrates a system from ``x0`` at ``t_start`` to ``t_end``.

    Parameters
    ----------
    system : System or a ready one
    x0 : array_like, shape (n,)
    t_end : float
        Before ``t_start``: backward in time. Infinite where a guard with ``stop_after``,
        ``stop_at_event`` or ``max_steps`` ends the run.
    t_start : float
        Default 0.
    continues : bool
        The run goes on where another has ended: nothing happens at ``t_start`` by ``time_events``
        or by ``at_start`` of guards. A timer of ``next_time_event(t, x)`` that is due there has its
        event.
    mode
        The mode at the start; by default the first, or that of the ready system.
    method : str
        ``"dopri5"`` (default), ``"fehlberg78"``, ``"taylor"`` (ready systems and formulas),
        ``"rosenbrock4"`` (implicit, for stiff systems of up to a few dozen components, with the
        ``jacobian`` of the system, else differences), ``"cash-karp54"``, ``"rk4"``, ``"euler"``;
        the last two have no error estimate and need ``fixed=True``.
    fixed : bool
        Steps of length ``step`` instead of error control.
    rtol, atol : float
        1e-8, 1e-10. ``atol`` may have one number for each component; components that a reset adds
        then have the smallest of these that is not zero.
    sample_times : array_like
        Times at which states are recorded, in ``run.times`` and ``run.states``.
    record_steps : bool
        Keep the whole solution, for ``run.solution``, and, without ``sample_times``, the ends of
        all steps, both sides of resets, in ``run.times`` and ``run.states``.
    detector : str
        ``"extremum"`` (default), ``"ends"``, ``"bernstein"``, ``"planned"``; with a ``gate``
        ``"foreseen"``, ``"certified"``, ``"calibrated"``, ``"calibrated-bounds"`` or ``"network"``.
    gate : Network or path
        The network of a detector that uses one. The ``name`` and the ``parameters`` of the system
        must be those for which it was trained.
    progress : bool or function (t, t_end)
        True: a bar is shown, by tqdm where that is installed; a function is called about ten times
        a second. Its exceptions end the run.
    locator : str
        ``"newton"`` (default), ``"bisection"`` or ``"toms748"``.
    step, h_min, h_max, event_tolerance, event_rtol, event_window, check_inside, stop_at_event,
    record_events, event_states, max_steps, stall_steps
        As in C++.

    Returns
    -------
    Run

    If a function of the system raises an exception, it is passed on unchanged, with the `Run` so
    far as its attribute ``ricochet_run``.
    """
    progress = _progress.check(progress)
    if progress is not None:
        return _integrate_with(progress, system, x0, t_end, options)
    if isinstance(system, Ready):
        run = _ricochet.integrate_plain(system._source, x0, t_end, options)
        if run is not None:
            return run
    elif isinstance(system, System):
        kept = system._kept_run()
        run = _ricochet.integrate_kept(*kept, x0, t_end, options) if kept is not None else None
        if run is not None:
            return run
    source, x0, options, modes = prepare(system, x0, t_end, options)
    return _ricochet.integrate(source, x0, options, modes)


class Simulation(_ricochet.Simulation):
    """A run that the caller drives step by step; arguments as for `integrate`.

    Only one thread at a time may use it: a second one gets a RuntimeError, as does a function of
    the system that uses the simulation by which it is called.
    """

    def __init__(self, system, x0, t_end, **options):
        source, x0, options, modes = prepare(system, x0, t_end, options)
        super().__init__(source, x0, options, modes)
        self._of = system, modes

    def restart(self, t, x, mode=None):
        """Goes on from state ``x`` at time ``t`` in a mode (default: the present one), as from a start.

        Guards are armed and the first step is estimated again. An event of ``time_events`` or
        ``next_time_event(t)`` at ``t`` belongs to the past; a timer of ``next_time_event(t, x)`` that
        is due there has its event. ``t`` may be any time from ``t_start`` to before ``t_end``, also one
        that `advance` has stopped at inside a step; what was recorded after it is dropped. A run that
        has ended goes on, unless `finish` was called or a function of the system has raised. Raises
        ValueError if ``t`` lies outside of the run, or `integrate` would refuse such a start; then
        nothing has changed.
        """
        options = {} if mode is None else {"mode": mode}
        set_mode(options, *self._of)
        self._restart(number_from(t, "t"), state_from(x, "x"), options.get("mode"))

    def extend(self, t_end):
        """Moves the end of the run to ``t_end``, which must lie ahead of the last step.

        A run that has reached its end goes on, unless `finish` was called. Raises ValueError if
        ``t_end`` does not lie ahead; then nothing has changed.
        """
        self._extend(number_from(t_end, "t_end"))

    def __iter__(self):
        """The times and states of all events and sample times to come."""
        while self.advance():
            yield self.t, self.x
