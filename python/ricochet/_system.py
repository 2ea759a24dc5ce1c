"""Hybrid systems, as classes or from functions."""

import inspect
from collections.abc import Iterator
from enum import Enum
from functools import lru_cache
from numbers import Real
from types import MethodType

from . import _ricochet
from ._compiled import (C_FLOW, C_GUARD, C_JACOBIAN, C_RATE, C_RESET, Compiled, as_function,
                        is_compiled)
from ._formula import Formula
from ._inclusion import specification_of
from ._kept import DICT, LIST, Kept, fingerprint, places_of_members, pure_fingerprint
from ._numbers import meant_by, number_from

#: The largest number of events after which a guard can end the run.
MOST_EVENTS = 2**32 - 1


#: What a guard is told by arguments, and what events of `solve_ivp` are told by attributes.
_OF_GUARDS = {name: name for name in (
    "value", "direction", "reset", "rest", "rate", "enabled", "in_modes", "unilateral", "boolean",
    "degree", "touch", "stop_after", "at_start", "at_entry", "speed_bound", "acceleration_bound", "lower_bound",
    "upper_bound", "lipschitz", "resets", "directed")}
_OF_GUARDS["terminal"] = "stop_after"

#: What compiled functions of a guard are declared as; `enabled` is not among them.
_DECLARED = {"value": C_GUARD, "rate": C_RATE, "reset": C_RESET, "rest": C_RESET,
             "speed_bound": C_GUARD, "acceleration_bound": C_GUARD, "lower_bound": C_GUARD,
             "upper_bound": C_GUARD}


class Stop(Exception):
    """Ends the run at the event whose reset, or ``time_reset``, returns or raises it.

    ``reason`` is the text that `Run.reason` gives; ``after`` is what the reset would have returned
    otherwise. Without it state and mode stay as they were before the event.
    """

    def __init__(self, reason, after=None):
        if not isinstance(reason, str):
            raise TypeError(f"Stop: found {reason!r}, expected a text")
        super().__init__(reason)
        self.reason = reason
        self.after = after


_ricochet.set_stop_class(Stop)


def every(period, phase=0.0, name="every"):
    """The ticks ``phase + k * period`` of a clock, for ``time_events``; ``name`` is for messages.

    Like `Times`, it has ``next(t)``, the first tick after ``t``, for a system that computes its
    next time event itself.
    """
    return _ricochet.every(number_from(period, "period"), number_from(phase, "phase"), name)


class Guard:
    """A scalar function whose change of sign is an event.

    Parameters
    ----------
    value : function (t, x) -> float
        Positive inside the mode. In a system with modes this and all the following functions
        take the mode as first argument.
    name : str
        Name in messages; by default that of the function.
    direction : -1, 0 or 1
        -1 (default): falling through zero, as a motion leaves the mode; 1: rising; 0: either.
    reset : function (t, x) -> x
        The state after the event; with modes a mode, or a tuple (mode, x). Without it the event is
        only recorded.
    directed : bool
        ``reset`` takes the direction of the crossing as last argument, -1 or 1.
    rest : function (t, x) -> x
        The state after an accumulation of infinitely many events.
    rate : function (t, x, dxdt) -> float
        dg/dt along the flow; by default a difference, which costs two more calls of ``value``.
    enabled : function (t, x) -> bool
        Whether a crossing here and now is an event.
    in_modes : sequence of modes
        Modes in which the guard is examined; by default all.
    unilateral : bool
        The guard bounds the motion: it is never negative. Needs a reset.
    boolean : bool
        Only the sign of the guard has a meaning.
    degree : int
        Degree of the guard as a polynomial in time and state, for ``detector="bernstein"``.
    touch : float
        ``|g|`` at a turning point that counts as a touch.
    stop_after : int
        The run ends with this many events; 0: never.
    at_start, at_entry : bool
        The guard fires at the start of a run, and where its mode begins by a change of mode, if it
        is beyond its surface there, or on it and does not move inside.
    speed_bound, acceleration_bound, lower_bound, upper_bound : functions (t, x) -> float
        With ``lipschitz``, for ``detector="planned"``.

    In a class, ``guard`` turns a method into a guard, whose ``reset``, ``rest`` and further
    functions are methods decorated with ``@name.reset`` and so on, like those of a ``property``,
    but called as one likes.
    """

    def __init__(self, value=None, *, name=None, direction=-1, reset=None, rest=None, rate=None,
                 enabled=None, in_modes=None, unilateral=False, boolean=False, degree=0,
                 touch=0.0, stop_after=0, at_start=False, at_entry=False, speed_bound=None,
                 acceleration_bound=None, lower_bound=None, upper_bound=None, lipschitz=1.0,
                 resets=True, directed=False):
        if isinstance(in_modes, Iterator):  # read for every run
            in_modes = list(in_modes)
        if rate is None and isinstance(value, Compiled):  # that of a GuardNetwork
            rate = getattr(value, "rate", None)
        self._functions = dict(value=value, rate=rate, reset=reset, rest=rest, enabled=enabled,
                               speed_bound=speed_bound, acceleration_bound=acceleration_bound,
                               lower_bound=lower_bound, upper_bound=upper_bound)
        self._numbers = dict(direction=direction, in_modes=in_modes, unilateral=unilateral,
                             boolean=boolean, degree=degree, touch=touch, stop_after=stop_after,
                             at_start=at_start, at_entry=at_entry, lipschitz=lipschitz,
                             resets=resets, directed=directed)
        self.name = name
        self._origin = self  # shared by the guards that ``@name.reset`` and so on make of this one

    def __setattr__(self, name, value):
        if name in _OF_GUARDS:
            raise AttributeError(f"{name}: found an assignment to a Guard, expected an argument: "
                                 f"Guard(..., {_OF_GUARDS[name]}=...)")
        super().__setattr__(name, value)

    def __set_name__(self, owner, name):
        if self.name is None:
            self.name = name

    def _with(self, what, function):
        copy = Guard(name=self.name)
        copy._functions = {**self._functions, what: function}
        copy._numbers = dict(self._numbers)
        copy._origin = self._origin
        return copy

    def _joined(self, other):
        """This guard with the functions that a decorated method of another name has added."""
        out = self
        for what, function in other._functions.items():
            mine = self._functions[what]
            if function is None or function is mine:
                continue
            if mine is not None:
                raise TypeError(f"guard {self.name}: found two functions {what!r}, expected one")
            out = out._with(what, function)
        return out

    def rate(self, function):
        """Decorates the method that gives dg/dt along the flow."""
        return self._with("rate", function)

    def reset(self, function):
        """Decorates the method that gives the state after the event."""
        return self._with("reset", function)

    def rest(self, function):
        """Decorates the method that gives the state where events accumulate."""
        return self._with("rest", function)

    def enabled(self, function):
        """Decorates the method that says whether a crossing is an event."""
        return self._with("enabled", function)

    def speed_bound(self, function):
        """Decorates the method that bounds how fast the guard changes."""
        return self._with("speed_bound", function)

    def acceleration_bound(self, function):
        """Decorates the method that bounds how fast that speed grows."""
        return self._with("acceleration_bound", function)

    def lower_bound(self, function):
        """Decorates the method that bounds the guard from below."""
        return self._with("lower_bound", function)

    def upper_bound(self, function):
        """Decorates the method that bounds the guard from above."""
        return self._with("upper_bound", function)

    def _specification(self, index, owner=None):
        out = dict(self._numbers)
        name = self.name or getattr(self._functions["value"], "__name__", None)
        out["name"] = str(index) if name in (None, "<lambda>", "<cdata>") else name
        for what, function in self._functions.items():
            if function is not None and not hasattr(function, "__code__"):
                function = self._compiled(what, function, out["name"])
            if owner is not None and function is not None and not isinstance(function, Compiled):
                function = MethodType(function, owner)
            out[what] = function
        if out["in_modes"] is not None:
            if isinstance(out["in_modes"], str):
                out["in_modes"] = [out["in_modes"]]
            out["in_modes"] = list(out["in_modes"])
        for what, most in (("degree", 2**31 - 1), ("stop_after", MOST_EVENTS)):
            if out[what] == 0:
                continue
            if not isinstance(out[what], Real) or not 0 <= out[what] <= most or (
                    out[what] != int(out[what])):
                raise ValueError(f"guard {out['name']}: {what}: found {out[what]!r}, expected a "
                                 f"whole number that is not negative, and at most {most}")
        if not isinstance(out["direction"], Real) or out["direction"] not in (-1, 0, 1):
            raise ValueError(f"guard {out['name']}: direction: found {out['direction']!r}, expected "
                             "-1, 0 or 1")
        return out

    @staticmethod
    def _compiled(what, function, name):
        who = f"guard {name}" if what == "value" else f"{what} of guard {name}"
        if what in _DECLARED:
            return as_function(function, _DECLARED[what], who)
        if is_compiled(function):
            raise TypeError(f"{who}: found a compiled function, expected one of Python")
        return function

    def __repr__(self):
        return f"Guard({self.name!r})"


def guard(value=None, **options):
    """Makes a `Guard` of a method: ``@guard`` or ``@guard(unilateral=True)``."""
    if value is not None:
        return Guard(value, **options)
    return lambda function: Guard(function, **options)


_KNOWN = ("flow", "guard", "reset", "rest", "guard_rate", "unilateral", "direction", "modes",
          "name", "guards", "guard_values", "reset_set", "time_events", "next_time_event",
          "previous_time_event", "time_reset", "changes_dimension", "parameters", "formula",
          "set_valued", "jacobian", "vector")


def _plain_guard(function, index):
    """The guard of a function, which must not say more of itself, as an event of solve_ivp does."""
    for name in ("terminal", *_OF_GUARDS):
        if name != "value" and name in getattr(function, "__dict__", ()):
            raise TypeError(f"guards[{index}]: found a function with an attribute {name!r}, "
                            f"expected Guard(function, {_OF_GUARDS[name]}=...)")
    return Guard(function)


@lru_cache(maxsize=1024)  # every run asks for the attributes of its instance
def _known_name_near(name, is_method, further):
    if not is_method and name.removesuffix("s") in _KNOWN:
        return []  # names of components, a count of resets
    from difflib import get_close_matches
    # A parameter may be called ``low`` or ``model``.
    return get_close_matches(name.lower(), _KNOWN + further, 1, 0.8 if is_method else 0.86)


def _refuse_near_name(cls, name, is_method):
    meant = _known_name_near(name, is_method, cls._further_names)
    if meant:
        what = "a method" if is_method else "an attribute"
        raise TypeError(f"{cls.__name__}: found {what} {name!r}, expected {meant[0]!r}; if it means "
                        "what it says, declare class ...(System, unchecked_names=True)")


def _times(given):
    if isinstance(given, _ricochet.Times):
        return given
    try:
        times = [number_from(t, "time_events") for t in given]
    except TypeError:
        raise TypeError(f"time_events: found {given!r}, expected a sequence of times, or "
                        "ricochet.every(period)") from None
    if any(t != t for t in times):
        raise ValueError("time_events: found nan, expected times")
    return _ricochet.Times(times)


def _asks_state(function, is_moded, args):
    """Whether next_time_event takes the state: ([mode,] t, x), and not only t."""
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):  # not written in Python
        return False

    def takes(count):
        try:
            signature.bind(*[None] * (count + len(args or ())))
        except TypeError:
            return False
        return True
    if takes(1):
        return False
    mode = "mode, " if is_moded else ""
    if not takes(2 + is_moded):
        raise TypeError(f"next_time_event: found {signature}, expected (t) or ({mode}t, x)")
    return True


class System:
    """A hybrid system: a subclass with the methods below, or an instance made from functions.

    flow(t, x) -> dx/dt
        The smooth motion. ``x`` is an array that may be kept.
    guard(t, x), reset(t, x), rest(t, x), guard_rate(t, x, dxdt)
        For a system with one guard, with the attributes ``unilateral`` and ``direction``; for
        several guards see `Guard`.
    guards
        A sequence of `Guard`; those that a class makes with ``@guard`` come first.
    modes
        A number, a sequence of names, or an Enum. Every function takes the mode before ``t``, as
        a number, name or member of the Enum, and a reset returns a mode, or a tuple (mode, x).
    guard_values(t, x) -> numbers
        All guards at once, instead of their own functions: ``guards=[Guard(name="low"), ...]``.
    reset_set(t, x, fired) -> x
        The reset of all guards that fired together, instead of their own: ``fired`` is a list of
        their numbers, with ``"time"`` at its end where a time event belongs to it.
    time_events
        Known times of events, from the start to the end of a run, both included, and as often as
        each is listed; or ``ricochet.every(period)``. Or next_time_event(t), the first after ``t``
        or None, and for runs backward in time previous_time_event(t). Or next_time_event(t, x), of
        timers in the state, asked at the start and after every set of events: ``t`` if one is due
        now, a time after it, or None.
    time_reset(t, x) -> x
        What happens at these times. This, and every reset, may end the run: `Stop`.
    changes_dimension
        Whether resets may shorten the state without a change of mode.
    formula : int
        The number of components of a state whose flow and guards are formulas: they are called
        once with symbols, in each mode, and then computed without Python, also by
        ``method="taylor"``. They use arithmetic and functions of NumPy (np.sin, ...). Apart from
        the mode, they must not compare their arguments or branch on them. Resets that do the same,
        and change nothing outside of them, are computed without Python, too.
    set_valued
        An `Inclusion`: friction, relays and stops, of which the motion becomes a part where they
        hold something; or a method that returns one.
    jacobian(t, x) -> numbers, shape (n, n)
        The derivatives of the flow by the state, for ``method="rosenbrock4"``; also a sparse
        matrix. By default differences; exact where the system has a ``formula``.
    vector : "array" or "list"
        What states are passed as: arrays, or lists of floats, which are several times faster in
        functions that take a few components one by one.
    name, parameters
        Identification for networks: a text, and a dictionary of numbers.
    """

    flow = None
    guards = ()
    modes = None
    name = None
    guard_values = None
    reset_set = None
    time_events = None
    next_time_event = None
    previous_time_event = None
    time_reset = None
    changes_dimension = False
    parameters = None
    formula = None
    set_valued = None
    jacobian = None
    vector = "array"
    _unchecked_names = False
    _further_names = ()  #: of members that a subclass of this module adds

    def __init__(self, flow=None, guards=None, **members):
        if flow is not None:
            self.flow = flow
        if guards is not None:
            self.guards = guards
        for name, value in members.items():
            if name not in _KNOWN and name not in self._further_names:
                raise TypeError(f"System: found a member {name!r}, expected some of "
                                + meant_by(name, _KNOWN + self._further_names))
            setattr(self, name, value)

    def __init_subclass__(cls, unchecked_names=False, **options):
        super().__init_subclass__(**options)
        cls._unchecked_names = unchecked_names
        if unchecked_names:
            return
        for name, member in vars(cls).items():
            if name.startswith("_") or name in _KNOWN or isinstance(member, Guard):
                continue
            if name not in cls._further_names:
                _refuse_near_name(cls, name, callable(member))

    def _mode_list(self):
        modes = self._read_again("modes")
        if modes is None:
            return None
        if isinstance(modes, int):
            return list(range(modes))
        if isinstance(modes, str):
            raise TypeError(f"modes: found {modes!r}, expected a number, a sequence of names or an "
                            "Enum")
        return list(modes)

    def _read_again(self, name):
        """A member that every run reads. An iterator, readable only once, becomes a list."""
        value = getattr(self, name)
        if isinstance(value, Iterator):
            value = list(value)
            holder = self if name in vars(self) else next(
                cls for cls in type(self).__mro__ if name in vars(cls))
            setattr(holder, name, value)
        return value

    def _refuse_unused(self, guards, found):
        """Rejects guards and resets that no run would use."""
        who = type(self).__name__
        for name, member in vars(self).items():
            known = name in _KNOWN or name in self._further_names
            if not known and not name.startswith("_") and not self._unchecked_names:
                _refuse_near_name(type(self), name, False)
            if name in found:
                raise TypeError(f"{who}: found an attribute {name!r} of an instance in place of a "
                                "guard of its class, expected another class")
            if isinstance(member, Guard) and not any(member is guard for guard in guards):
                raise TypeError(f"{who}: found the guard {name!r} as an attribute of an instance, "
                                "expected it in the class or in guards")
        if getattr(self, "guard", None) is None and not self._unchecked_names:
            for name in ("reset", "rest", "guard_rate", "unilateral", "direction"):
                if getattr(self, name, None) is not None:
                    raise TypeError(f"{who}: found {name!r} without a method guard, expected that "
                                    "of a Guard")

    def _guard_list(self):
        out = []
        guards = self._read_again("guards")
        if isinstance(guards, Guard) or is_compiled(guards) or callable(guards):
            raise TypeError(f"guards: found a {type(guards).__name__}, expected a sequence: "
                            "guards=[...]")
        if getattr(self, "guard", None) is not None:
            if isinstance(self.guard, (Guard, list, tuple)):
                raise TypeError(f"guard: found a {type(self.guard).__name__}, expected a function, "
                                "or guards=[...]")
            single = Guard(self.guard, name="guard", reset=getattr(self, "reset", None),
                           rest=getattr(self, "rest", None),
                           rate=getattr(self, "guard_rate", None),
                           unilateral=getattr(self, "unilateral", False),
                           direction=getattr(self, "direction", -1))
            out.append(single._specification(0))
        found = {}
        for cls in reversed(type(self).__mro__):
            for name, member in vars(cls).items():
                if isinstance(member, Guard):
                    replaced = found.get(name, member)._origin
                    if member._origin is not replaced and any(
                            replaced is rest._origin for key, rest in found.items() if key != name):
                        raise TypeError(f"{cls.__name__}: found another guard {name!r} in place of "
                                        "one that methods of other names belong to, expected "
                                        f"@{name}.reset and so on above methods called {name!r}")
                    found[name] = member
                elif name in found:
                    raise TypeError(f"{cls.__name__}: found {name!r} in place of a guard of a base "
                                    "class, expected a guard: @ricochet.guard")
        self._refuse_unused(guards, found)
        joined = {}
        for member in found.values():
            key = id(member._origin)
            joined[key] = joined[key]._joined(member) if key in joined else member
        for member in joined.values():
            out.append(member._specification(len(out), self))
        for member in guards:
            if not isinstance(member, Guard):
                member = _plain_guard(member, len(out))
            out.append(member._specification(len(out)))
        return out

    def _kept_run(self):
        """The places, source and modes of the last run by formulas, as they were; or None."""
        kept = vars(self).get("_kept_source")
        of, found = kept.pair if kept is not None else (None, None)
        return found if of is vars(self) else None  # else this is a copy

    def _places(self):
        """The places of all that `_source` reads, beside what formulas depend on; or None."""
        members = [member for cls in type(self).__mro__ for member in vars(cls).values()]
        guards = [each for each in (*self.guards, *members) if isinstance(each, Guard)]
        values = [getattr(self, name, None) for name in (
            "modes", "time_events", "parameters", "unilateral", "direction")]
        values = [value for value in values if not isinstance(value, _ricochet.Times)]
        values += [guard._numbers["in_modes"] for guard in guards]
        out = places_of_members(self, values)
        if out is None or not isinstance(self.guards, (list, tuple)):
            return None
        if isinstance(self.guards, list):
            out.append((LIST, self.guards, None, tuple(self.guards)))
        for guard in guards:
            out += [(DICT, part, None, dict(part))
                    for part in (vars(guard), guard._functions, guard._numbers)]
        return out

    def _formulas(self, args, guards, places):
        """The flow as a formula; those of the guards are put into their specifications."""
        components, modes = self.formula, self._mode_list()
        if type(components) is not int or components < 1:
            raise ValueError(f"formula: found {components!r}, expected the number of components of "
                             "the state")
        if self.jacobian is not None:
            raise ValueError("jacobian: found one beside formula, expected none, since that of a "
                             "formula is exact")
        for what in ("guard_values", "changes_dimension"):
            if getattr(self, what):
                raise ValueError(f"{what}: found one beside formula, expected guards by "
                                 "themselves, and a state that keeps its size")
        for guard in guards:
            if isinstance(guard["value"], Compiled):
                raise TypeError(f"guard {guard['name']}: found a compiled function beside formula")
        if is_compiled(self.flow):
            raise TypeError("flow: found a compiled function beside formula")
        # Functions are called with symbols again only where something that they read has changed.
        functions = [self.flow, *(guard["value"] for guard in guards)]
        of = fingerprint(functions, self, args, places)
        if of is not None and all(isinstance(mode, (int, str, Enum)) for mode in modes or ()):
            of = of, components, modes, [guard["in_modes"] for guard in guards]
        else:
            of = None
        kept = self._kept
        known, formulas = kept.pair
        if of is None or known != of:
            formulas = [Formula(self.flow, components, modes, args, "flow", True)]
            formulas += [self._guard_formula(guard, components, modes, args) for guard in guards]
            kept.pair = of, formulas
        for guard, formula in zip(guards, formulas[1:]):
            guard["value"] = formula
        return formulas[0]

    def _reset_formulas(self, args, guards, places):
        """Puts formulas in place of the resets and rests that can be recorded; the time reset."""
        given = [(guard, key) for guard in guards for key in ("reset", "rest") if guard[key]]
        functions = [guard[key] for guard, key in given if not guard["directed"]]
        if self.time_reset is not None:
            functions.append(self.time_reset)
        functions = [function for function in functions if not is_compiled(function)]
        of = pure_fingerprint(functions, self, args, places)
        modes = self._mode_list()
        if of is None or not all(isinstance(mode, (int, str, Enum)) for mode in modes or ()):
            return self.time_reset
        of = of, self.formula, modes, [guard["in_modes"] for guard in guards]
        kept = self._kept_resets
        known, formulas = kept.pair
        if known != of:
            formulas = {}
            for guard, key in given:
                if not guard["directed"] and not is_compiled(guard[key]):
                    formulas[guard["name"], key] = self._reset_formula(guard[key], guard["in_modes"], args)
            if self.time_reset is not None and not is_compiled(self.time_reset):
                formulas[None] = self._reset_formula(self.time_reset, None, args)
            kept.pair = of, formulas
        for guard, key in given:
            guard[key] = formulas.get((guard["name"], key)) or guard[key]
        return formulas.get(None) or self.time_reset

    def _reset_formula(self, function, within, args):
        """The formula of a reset; None where it cannot be recorded."""
        try:
            return Formula.of_reset(function, self.formula, self._mode_list(), within, args, "reset")
        except Exception:  # a run calls it with numbers, and shows what is wrong
            return None

    @staticmethod
    def _guard_formula(guard, components, modes, args):
        function, within = guard["value"], guard["in_modes"]

        def value(*given):
            return 1.0 if within is not None and given[0] not in within else function(*given)
        return Formula(value, components, modes, args, f"guard {guard['name']}", False)

    def _refuse_arguments(self, args):
        """Rejects a flow with a mode in a system without modes, and the reverse."""
        function = getattr(self.flow, "__func__", self.flow)
        code = getattr(function, "__code__", None)
        if code is None or code.co_flags & 4:  # not written in Python, or with *arguments
            return
        least = code.co_argcount - len(function.__defaults__ or ())
        given = 2 + (self.modes is not None) + len(args or ()) + (function is not self.flow)
        if not least <= given <= code.co_argcount:
            found = ", ".join(code.co_varnames[:code.co_argcount])
            why = "without modes" if self.modes is None else "with modes"
            mode = "" if self.modes is None else "mode, "
            more = ", ..." if args else ""
            raise TypeError(f"{type(self).__name__}: found flow({found}) in a system {why}, expected "
                            f"flow({mode}t, x{more})")

    def _event_members(self, args):
        """What the C++ object reads of guards, times and modes."""
        following, preceding = self.next_time_event, self.previous_time_event
        times = None
        if self.time_events is not None:
            times = _times(self._read_again("time_events"))
            if following is not None or preceding is not None:
                raise ValueError("time_events: found next_time_event or previous_time_event beside "
                                 "it, expected one of them")
        if preceding is not None and following is None:
            raise ValueError("previous_time_event: found one without next_time_event, expected "
                             "both")
        at = following is not None and _asks_state(following, self.modes is not None, args)
        if self.time_reset is not None and following is None and times is None:
            raise ValueError("time_reset: found one without time events, expected time_events or "
                             "next_time_event beside it")
        guards = self._guard_list()
        if not guards and self.guard_values is not None:
            raise ValueError("guard_values: found it without guards, expected one for each value: "
                             "guards=[Guard(name=...), ...]")
        if not guards and self.reset_set is not None:
            raise ValueError("reset_set: found it without guards, expected some, or a time_reset")
        return dict(name=self.name or type(self).__name__, modes=self._mode_list(), guards=guards,
                    guard_values=self.guard_values, reset_set=self.reset_set, time_events=times,
                    next_time_event=None if at else following,
                    next_time_event_at=following if at else None, previous_time_event=preceding)

    def _source(self, args=None, watch=None):
        """The C++ object; ``watch(flow, is_moded)`` may put a function around the flow."""
        may_keep = self.formula is not None and not args and watch is None
        found = self._kept_run() if may_keep else None
        if found is not None and _ricochet.unchanged(found[0]):
            return found[1]
        flow = as_function(self.flow, C_FLOW, "flow")
        if not callable(flow) and not isinstance(flow, Compiled):
            raise TypeError(f"{type(self).__name__}: found no flow, expected flow(t, x)")
        if self.vector not in ("array", "list"):
            raise ValueError(f"vector: found {self.vector!r}, expected 'array' or 'list'")
        self._refuse_arguments(args)
        events = self._event_members(args)
        guards, time_reset = events["guards"], self.time_reset
        if self.formula is not None:
            for name in ("_kept", "_kept_resets", "_kept_source"):
                vars(self).setdefault(name, Kept())
            before, places = (self._kept.pair[1], self._kept_resets.pair[1]), []
            flow = self._formulas(args, guards, places)
            time_reset = self._reset_formulas(args, guards, places)
            # What is the same for a second run may be so for further ones.
            may_keep = may_keep and before[0] is self._kept.pair[1] and before[1] is self._kept_resets.pair[1]
            members = self._places() if may_keep else None
            may_keep = members is not None
        if watch is not None:
            flow = watch(flow, self.modes is not None)
        source = _ricochet.callback_system(dict(
            events, flow=flow, args=args,
            time_reset=as_function(time_reset, C_RESET, "time_reset"),
            changes_dimension=self.changes_dimension, as_list=self.vector == "list",
            jacobian=as_function(self.jacobian, C_JACOBIAN, "jacobian"),
            set_valued=specification_of(self.set_valued)))
        if self.parameters is not None:
            source.parameters = {name.replace("_", "-"): float(value)
                                 for name, value in dict(self.parameters).items()}
        if may_keep and source.is_free:  # then it holds nothing that refers to this system
            self._kept_source.pair = vars(self), ((*members, *places), source, self._mode_list())
        return source
