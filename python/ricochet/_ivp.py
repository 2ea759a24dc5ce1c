"""Initial value problems with SciPy's arguments and SciPy's result."""

from contextlib import nullcontext
from warnings import warn

import numpy as np

from . import _progress, _ricochet
from ._coded import Empty, coded
from ._compiled import C_FLOW, C_GUARD, C_JACOBIAN, Compiled, as_function, is_compiled
from ._inclusion import specification_of
from ._network import set_gate
from ._ready import Ready
from ._numbers import meant_by
from ._run import (Kind, is_called_from_python, number_from, numbers_from, set_mode, set_start_mode,
                   set_tolerance, source_of)
from ._solution import new_result, new_solution
from ._system import MOST_EVENTS, Guard, System

_METHODS = {"RK45": "dopri5", "RK23": "dopri5", "DOP853": "fehlberg78", "Taylor": "taylor",
            **dict.fromkeys(("Radau", "BDF", "LSODA", "rosenbrock4"), "rosenbrock4")}
#: Said at the end of a message, of methods that another one stands in for.
_NOTES = {"RK23": " There is no method of order 3: 'RK23' was run as 'RK45'.",
          **{name: f" '{name}' was run as 'rosenbrock4', an implicit method of order 4."
             for name in ("Radau", "BDF", "LSODA")}}
#: Options of SciPy's implicit methods; all but the first and the last are about cost alone.
_IMPLICIT_OPTIONS = ("jac", "jac_sparsity", "lband", "uband", "min_step")
_KINDS = {kind.value: kind.name.lower() for kind in Kind}
_EPS = np.finfo(float).eps
#: SciPy's messages for these outcomes, for programs that compare them.
_MESSAGES = {"reached_end": "The solver successfully reached the end of the integration interval.",
             "stopped_by_event": "A termination event occurred."}
#: Messages for other outcomes, with the names of SciPy's arguments.
_OWN_MESSAGES = {
    "zeno": "the motion presses on an event with a reset, or its events accumulate there, and "
            "nothing stops it; give the event a rest, or end t_span earlier",
    "outside_mode": "a reset left the state behind a unilateral event; let it put the state where "
                    "the event function is zero or positive",
    "endless_cascade": "resets trigger each other at one time without an end; let each leave the "
                       "zeros of the other events",
    "conflicting_resets": "two events happened together and the order of their resets matters to "
                          "a component; take a System with reset_set to say what happens then",
    "step_underflow": "the step became too small without meeting the tolerance; loosen rtol and "
                      "atol",
    "step_limit": "as many steps were taken as max_steps allows; allow more or end t_span earlier",
    "non_finite": "fun, an event or a reset returned NaN or infinity; the last finite state is "
                  "kept",
    "stalled": "stall_steps steps hardly advanced the time, or nothing ended a run without an "
               "end; end t_span earlier, let events that accumulate come to rest, or raise max_step or stall_steps"}
_WORDS = (("t_end - t_start", "t_span[1] - t_span[0]"), ("t_end", "t_span[1]"),
          ("t_start", "t_span[0]"), ("h_max", "max_step"), ("the start must", "y0 must"),
          ("the start lies", "y0 lies"), ("expected guard >= 0", "expected a value >= 0"),
          ("; g >= 0 bounds", "; event >= 0 bounds"), ("step must", "first_step must"),
          ("a guard with stop_after, stop_at_event, or max_steps, also beside a reset that ends the "
           "run", "a terminal event or max_steps"))


def _in_our_words(error, events):
    """A message of the library with option names replaced by the arguments of solve_ivp."""
    text = str(error)
    if not text.startswith("integrate: ") or hasattr(error, "ricochet_run"):
        return error
    text = "solve_ivp: " + text[len("integrate: "):]
    for theirs, ours in _WORDS:
        text = text.replace(theirs, ours)
    if events:
        import re

        text = re.sub(r"guard (\d+)(?: \(\1\))?", r"events[\1]", text)
        text = text.replace("its crossing must be falling: g >= 0",
                            "its direction must be -1: a value >= 0")
    return type(error)(text)


class _Constant:
    """The solution over an interval of length zero."""

    def __init__(self, t, y):
        self.t_min = self.t_max = t
        self.ts = np.array([t])
        self._y = np.array(y)

    def __call__(self, t):
        t = np.asarray(t)
        return self._y.copy() if t.ndim == 0 else np.tile(self._y[:, None], (1, t.size))

    before = __call__


def solve_ivp(fun, t_span, y0, method="RK45", t_eval=None, dense_output=False, events=None,
              vectorized=False, args=None, *, set_valued=None, vector="array", progress=None,
              **options):
    """Solves y' = fun(t, y), y(t0) = y0, with events and resets.

    Arguments and result are those of ``scipy.integrate.solve_ivp``, and code that uses these runs
    unchanged. Differences:

    - ``method``: ``'RK45'`` (Dormand and Prince, as in SciPy) or ``'DOP853'``, which is replaced
      by Fehlberg's method of order 8; for ready systems and formulas also ``'Taylor'``. ``'RK23'``
      is run as ``'RK45'``, and ``'Radau'``, ``'BDF'``, ``'LSODA'`` as ``'rosenbrock4'``, an implicit
      method of order 4 for up to a few dozen components, which the message says. It takes ``jac``
      as SciPy does.
    - ``y0`` may be complex or empty, as in SciPy; `result.run` has complex components as pairs, and
      real and imaginary parts meet the tolerance by themselves.
    - ``fun`` may also be a `System`, whose guards then are the events.
    - An event may have, besides ``terminal`` (also a number of events) and ``direction``:

      reset(t, y) -> y
          the state after the event;
      rest(t, y) -> y
          what becomes of the motion where infinitely many events accumulate;
      unilateral : bool
          the event function is never negative, as the height above a floor; needs ``reset``;
      name : str
          for messages.

    - ``set_valued`` is an `Inclusion`: friction, relays and stops, of which the motion becomes a part
      where they hold something.
    - ``rtol`` is one number; of several numbers the smallest is used. ``atol`` may have one number
      for each component.
    - ``vector="list"``: functions get states as lists of floats, which is faster where they take
      components one by one.
    - ``fun``, ``jac``, events and their functions may be compiled (`Compiled`).
    - ``progress=True`` shows a bar.
    - Further options are those of `integrate`, such as ``event_tolerance`` and ``max_steps``.

    Returns
    -------
    OdeResult
        With SciPy's ``t, y, sol, t_events, y_events, nfev, njev, nlu, status, message, success``;
        ``y_events`` are the states before resets. At a reset ``t`` holds its time twice where ``t_eval``
        is not given. New: ``y_events_after``, the states after; ``kinds``, for every event
        'crossing', 'touch', 'jump', 'accumulation', 'mode' or, of a guard that stands for a reaction,
        'stick'; ``modes``, before and after; ``phases`` of a system with ``set_valued``, and its
        ``reactions`` at ``t``, in columns; ``outcome`` and ``statistics``, whose ``evidence`` counts why steps were taken to hold no event.

    If ``fun`` or an event raises an exception, it is passed on unchanged, with the `Run` so far as
    its attribute ``ricochet_run``.
    """
    if isinstance(method, type):
        method = method.__name__
    if method not in _METHODS:
        raise ValueError(f"method: found {method!r}, expected some of " + meant_by(method, _METHODS))
    try:
        t0, t1 = (number_from(t, "t_span") for t in t_span)
    except (TypeError, ValueError):
        raise ValueError(f"t_span: found {t_span!r}, expected two numbers") from None
    start, code = coded(y0)
    if args is not None:
        try:
            args = tuple(args)
        except TypeError:
            raise TypeError(f"Supplied 'args' cannot be unpacked. Found {args!r}, expected a "
                            f"tuple; of one argument: args=({args!r},)") from None
    if code is not None:
        if isinstance(fun, (System, Ready)) or set_valued is not None:
            raise ValueError(f"y0: found {code.what} beside a system or set_valued, expected "
                             "real components")
        options["atol"] = code.tolerances(options.get("atol", 1e-6))
    if vector not in ("array", "list"):
        raise ValueError(f"vector: found {vector!r}, expected 'array' or 'list'")
    if vector == "list" and (code is not None or vectorized or isinstance(fun, (System, Ready))):
        raise ValueError("vector: found 'list' beside vectorized, a system, or a y0 that is complex "
                         "or empty, expected 'array'; of a system it is a member")
    given_jac = options.get("jac")
    jac = _jacobian(options, method, fun, start, code)
    given = _options(options, t0, t1, len(start))
    given["method"] = _METHODS[method]
    samples = _sample_times(t_eval, t0, t1)
    if samples is None:
        given["record_steps"] = True
    else:
        given["sample_times"] = samples.tolist()
    if dense_output:
        given["dense"] = True

    shown = _progress_of(progress, fun, t0, t1)
    if isinstance(fun, (System, Ready)):
        if events is not None:
            raise ValueError("events: found some beside a system, expected them as its guards")
        if set_valued is not None:
            raise ValueError("set_valued: found one beside a system, expected it as a member of the "
                             "system")
        source, modes = source_of(fun, args, shown and shown.watching)
        set_mode(given, fun, modes)
        set_start_mode(given, source, start)
        count = source.guard_count
        watched = True
    else:
        guards, is_list = _guards(events, t0, start, args or (), code, vector == "list")
        count = len(guards)
        watched = is_list
        fun = as_function(fun, C_FLOW, "fun")
        if vectorized and not isinstance(fun, Compiled):
            pointwise = fun

            def fun(t, y, *further):
                return np.asarray(pointwise(t, y[:, None], *further)).ravel()
        modes = None
        if code is not None:
            fun = code.flow(fun)
        flow = fun if shown is None else shown.watching(fun, False)
        source = _ricochet.callback_system(dict(
            name="solve_ivp", flow=flow, flow_title="fun", args=args, guards=guards,
            jacobian=jac, jacobian_title="jac", as_list=vector == "list",
            set_valued=specification_of(set_valued)))
    if t0 == t1:
        if not np.isfinite(t0):
            raise ValueError(f"t_span: found {t_span!r}, expected finite times")
        if not np.all(np.isfinite(start)):
            raise ValueError(f"y0: found {y0!r}, expected finite numbers")
        return _nothing(t0, start, samples, dense_output, count if watched else None, code)
    if isinstance(code, Empty) and not count:
        fun(t0, np.zeros(1), *(args or ()))
        return _of_empty(t0, t1, samples, dense_output, count if watched else None, code)
    events_given = not isinstance(fun, (System, Ready))
    try:
        with shown or nullcontext():
            run = _ricochet.integrate(source, start, given, modes)
            if shown is not None:
                shown.show(run.t)
    except (ValueError, RuntimeError) as error:
        said = _in_our_words(error, events_given)
        if said is error:
            raise
        raise said from None
    result = _result(run, count if watched else None, dense_output, events_given, code,
                     _NOTES.get(method, ""))
    if given_jac is not None and not callable(given_jac) and not is_compiled(given_jac):
        result.njev = 0  # it is an array, of which nothing is computed
    return result


def _jacobian(options, method, fun, start, code):
    """``jac`` for the core, of an implicit method; its further options are taken out."""
    if _METHODS[method] != "rosenbrock4":
        return None
    jac = options.pop("jac", None)
    banded = [name for name in ("lband", "uband") if options.pop(name, None) is not None]
    options.pop("jac_sparsity", None)
    least = options.pop("min_step", 0.0)
    if least:
        options["h_min"] = number_from(least, "min_step")
    if jac is None:
        return None
    if banded:
        raise ValueError(f"{banded[0]}: found beside jac, expected one of them: bands are not read")
    if isinstance(fun, (System, Ready)):
        raise ValueError("jac: found one beside a system, expected it as its member jacobian")
    jac = as_function(jac, C_JACOBIAN, "jac")
    if not callable(jac) and not isinstance(jac, Compiled):
        constant = jac.toarray() if hasattr(jac, "toarray") else np.asarray(jac)
        size = len(start) if code is None else code.components
        if constant.shape != (size, size):
            raise ValueError(f"jac: found {'shape ' + str(constant.shape) if constant.ndim else repr(jac)}, "
                             f"expected a function (t, y) or an array of shape {(size, size)}")

        def jac(t, y, *further):
            return constant
    return jac if code is None else code.jacobian(jac)


def _progress_of(progress, fun, t0, t1):
    """What shows the progress of a run from its flow; None for no progress."""
    progress = _progress.check(progress)
    if progress is None or t0 == t1:
        return None
    if isinstance(fun, Ready) or is_compiled(fun) or isinstance(fun, System) and not is_called_from_python(fun):
        raise TypeError("progress: found for a system that is computed without Python, expected it "
                        "in integrate")
    return _progress.OfTime(progress, t0, t1)


def _refuse_near_names(event, who):
    """Rejects misspelt attributes of an event, which SciPy would ignore."""
    known = ("terminal", "direction", "reset", "rest", "rate", "unilateral", "name")
    for found in getattr(event, "__dict__", ()):
        if found in known or found.startswith("_"):
            continue
        from difflib import get_close_matches

        meant = get_close_matches(found.lower(), known, 1, 0.8)
        if meant:
            raise ValueError(f"{who}: found an attribute {found!r}, expected {meant[0]!r}")


#: Options that SciPy's arguments already give.
_HERE = ("t_start", "method", "sample_times", "record_steps", "rtol", "atol")
_ARGUMENTS = ("method", "t_eval", "dense_output", "events", "vectorized", "args", "rtol", "atol",
              "max_step", "first_step", "set_valued", "vector", "jac")


def _is_number(given):
    return (isinstance(given, (int, float, np.integer, np.floating))
            and not isinstance(given, (bool, np.timedelta64)))


def _options(options, t0, t1, components):
    options = dict(options)
    for name in _IMPLICIT_OPTIONS:
        if name in options:
            warn(f"The following arguments have no effect for a chosen solver: `{name}`", stacklevel=3)
            del options[name]
    rtol = float(numbers_from(options.pop("rtol", 1e-3), "rtol").min())
    if rtol < 100 * _EPS:
        warn(f"At least one element of rtol, {rtol}, is too small; {100 * _EPS} is taken",
             stacklevel=3)
        rtol = 100 * _EPS
    given = {"t_start": t0, "t_end": t1, "rtol": rtol}
    atol = options.pop("atol", 1e-6)
    if np.any(numbers_from(atol, "atol") < 0):
        raise ValueError(f"atol: found {atol}, expected numbers that are not negative")
    set_tolerance(given, atol, components)
    max_step = options.pop("max_step", None)
    max_step, first_step = (step.item() if isinstance(step, np.ndarray) and step.ndim == 0 else step
                            for step in (max_step, options.pop("first_step", None)))
    if max_step is not None:
        if not _is_number(max_step) or not max_step > 0:
            raise ValueError(f"max_step: found {max_step!r}, expected a positive number")
        given["h_max"] = float(max_step)
    if first_step is not None:
        if not _is_number(first_step) or not 0 < first_step <= abs(t1 - t0):
            raise ValueError(f"first_step: found {first_step!r}, expected a number in "
                             f"(0, {abs(t1 - t0)}]")
        given["step"] = float(first_step)
    for name in ("t_start", "t_end", "method", "mode", "sample_times", "record_steps", "dense"):
        if name in options:
            if name == "mode":
                given["mode"] = options.pop(name)
            else:
                raise TypeError(f"solve_ivp: found the option {name!r}, expected its name in "
                                "SciPy")
    known = [name for name in _ricochet.option_names() if name not in _HERE]
    for name in options:
        if name not in known:
            raise TypeError(f"solve_ivp: found an option {name!r}, expected some of "
                            + meant_by(name, _ARGUMENTS + tuple(known)))
    given.update(options)
    set_gate(given)
    return given


def _sample_times(t_eval, t0, t1):
    if t_eval is None:
        return None
    times = numbers_from(t_eval, "t_eval")
    if times.ndim != 1:
        raise ValueError(f"t_eval: found {times.ndim} dimensions, expected 1")
    outside = times[~((times >= min(t0, t1)) & (times <= max(t0, t1)))]
    if outside.size:
        raise ValueError(f"t_eval: found {outside[0]}, expected times within t_span, {t0} to {t1}")
    steps = np.diff(times)
    if np.any(steps <= 0 if t1 > t0 else steps >= 0):
        raise ValueError("t_eval: found times out of order or repeated, expected them as the run meets them")
    return times


def _guards(events, t0, start, args, code, as_list):
    """A list of dictionaries of guards, and whether there are events."""
    if events is None:
        return [], False
    if callable(events) or isinstance(events, Guard) or is_compiled(events):
        events = (events,)
    y = np.array(start) if code is None else code.shown(np.array(start))
    out = []
    for index, event in enumerate(events):
        who = f"events[{index}]"
        if isinstance(event, Guard):
            specification = dict(event._specification(index), title=who)
            out.append(specification if code is None else code.guard(specification))
            continue
        value = as_function(event, C_GUARD, who)
        if not callable(event) and not isinstance(value, Compiled):
            raise TypeError(f"{who}: found a {type(event).__name__}, expected a function (t, y)")
        _refuse_near_names(event, who)
        direction = getattr(event, "direction", 0)
        terminal = getattr(event, "terminal", False)
        terminal = 0 if terminal is None else terminal
        if not isinstance(terminal, (bool, np.bool_)) and not _is_number(terminal) or (
                not 0 <= terminal <= MOST_EVENTS or int(terminal) != terminal):
            raise ValueError(f"{who}.terminal: found {terminal!r}, expected a bool or a whole "
                             f"number up to {MOST_EVENTS}")
        if not _is_number(direction) or direction != direction:
            raise TypeError(f"{who}.direction: found {direction!r}, expected a number")
        reset = getattr(event, "reset", None)
        unilateral = bool(getattr(event, "unilateral", False))
        if unilateral and direction == 0:
            direction = -1
        name = getattr(event, "name", None) or getattr(event, "__name__", None)
        guard = Guard(value, name=name if isinstance(name, str) else None,
                      direction=float(np.sign(direction)), reset=reset,
                      rest=getattr(event, "rest", None), rate=getattr(event, "rate", None),
                      unilateral=unilateral, stop_after=int(terminal))
        specification = guard._specification(index)
        own = specification["name"]
        specification["title"] = who if own == str(index) else f"{who} ({own})"
        if not isinstance(value, Compiled):
            try:
                first = event(t0, list(start) if as_list else y.copy(), *args)
            except Exception:  # raised again, and passed on, by the run
                first = None
            specification["boolean"] = isinstance(first, (bool, np.bool_)) or (
                isinstance(first, np.ndarray) and first.dtype == bool)
        out.append(specification if code is None else code.guard(specification))
    return out, True


def _result(run, count, dense_output, events_given, code, note):
    def shown(states):
        return states if code is None else code.shown(states)

    result = new_result(dict(
        t=run.times, y=shown(run.states).T,
        sol=new_solution(run.solution, code) if dense_output else None, t_events=None,
        y_events=None))
    statistics = run.statistics
    message = run.message if run.reason else _MESSAGES.get(run.outcome, run.message)
    if events_given:
        message = _OWN_MESSAGES.get(run.outcome, message)
        if run.other_guard is not None:  # of a cycle that accumulates, or of two resets
            names = [f"events[{k}]" if name == str(k) else name
                     for k, name in enumerate(run.guard_names)]
            message += f": {names[run.guard]}, {names[run.other_guard]}"
    result.update(nfev=statistics.flow_calls, njev=statistics.jacobians,
                  nlu=statistics.factorizations,
                  status={"reached_end": 0, "stopped_by_event": 1}.get(run.outcome, -1),
                  message=message + note, success=run.success)
    result.update(y_events_after=None, kinds=None, modes=None)
    if count is not None:
        events = run.events
        guards = events["guard"]
        chosen = [np.flatnonzero(guards == index) for index in range(count)]
        result.t_events = [events["t"][which] for which in chosen]
        for name, field in (("y_events", "before"), ("y_events_after", "after")):
            states = shown(events[field])
            result[name] = [states[which] if which.size else np.empty(0) for which in chosen]
        kinds = events["kind"]
        result.kinds = [[_KINDS[kind] for kind in kinds[which].tolist()] for which in chosen]
        result.modes = [np.column_stack((events["mode_before"][which],
                                         events["mode_after"][which]))
                        if run.modes else np.zeros((which.size, 2), np.uint32)
                        for which in chosen]
    result.update(outcome=run.outcome, statistics=statistics, guard=run.guard, phases=run.phases,
                  reactions=run.reactions.T, run=run)
    return result


def _of_empty(t0, t1, samples, dense_output, count, code):
    """The result for a state without components: nothing moves."""
    result = _nothing(t0, [0.0], samples, dense_output, count, code)
    if samples is None:
        result.update(t=np.array([t0, t1]), y=np.empty((0, 2)))
    if dense_output:
        result.sol.t_min, result.sol.t_max = min(t0, t1), max(t0, t1)
        result.sol.ts = np.array([t0, t1])
    result.nfev = 1
    return result


def _nothing(t, y, samples, dense_output, count, code):
    """The result of an integration over an interval of length zero."""
    t_out = np.array([t]) if samples is None else samples
    y = np.array(y) if code is None else code.shown(np.array(y))
    no_events = None if count is None else [np.empty(0) for _ in range(count)]
    return new_result(dict(
                     t=t_out, y=np.tile(y[:, None], (1, t_out.size)),
                     sol=_Constant(t, y) if dense_output else None, t_events=no_events,
                     y_events=no_events, nfev=0, njev=0, nlu=0, status=0,
                     message=_MESSAGES["reached_end"], success=True, y_events_after=no_events,
                     kinds=None if count is None else [[] for _ in range(count)],
                     modes=no_events, outcome="reached_end", statistics=None, guard=None, phases=[],
                     reactions=np.empty((0, t_out.size)), run=None))
