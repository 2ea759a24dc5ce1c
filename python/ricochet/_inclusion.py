"""Set-valued motion: dry friction, relays, diodes, stops."""

from numbers import Integral

from ._numbers import numbers_from


def _matrix(given, name, rows=None, columns=None):
    """The rows of a matrix one after the other, and its shape."""
    if given is None:
        return None, None
    array = numbers_from(given, name)
    if array.ndim != 2 or rows not in (None, array.shape[0]) or columns not in (None, array.shape[1]):
        expected = ", ".join("any" if count is None else str(count) for count in (rows, columns))
        raise ValueError(f"Inclusion: {name}: found shape {array.shape}, expected ({expected})")
    return [float(number) for number in array.ravel()], array.shape


class Inclusion:
    """Set-valued motion of the state of a system, for its ``set_valued``.

    With reactions r and y = E x - s(t)::

        A x' = smooth(t, x) + G r,    lower <= r <= upper,

    and r is at its upper bound where y < 0, at its lower bound where y > 0, and in between where
    y = 0. The flow of the system is followed while every y is clear of zero. In a system with
    modes all functions take the mode as first argument.

    Parameters
    ----------
    smooth : function (t, x) -> numbers, shape (n,)
    bounds : function (t, x) -> (lower, upper)
        Shape (m,) each, or one number each for one reaction; may be infinite.
    observe : array_like, shape (m, n)
        E; by default y is the first ``reactions`` components.
    act : array_like, shape (n, m)
        G; by default the transpose of E.
    mass : array_like, shape (n, n)
        A; by default the unit matrix.
    offset, offset_rate : functions (t) -> numbers, shape (m,)
        s and its rate; both or neither.
    static_bounds : function (t, x) -> numbers, shape (m,)
        The largest |r| with which each reaction holds its y at zero, no less than ``bounds``, which
        have to contain 0: static friction. None: ``bounds`` hold it, too.
    reactions : int
        m, 1 to 4; by default the number of rows of ``observe`` or columns of ``act``, or 1. The
        state has at most 8 components.
    stands_for : sequence of int or None
        For each guard the number of the reaction that is asked where its events accumulate, press,
        or leave it on its surface with y at rest, or None. Found for guards that are a y.
    in_modes : sequence of modes
        Modes that have the inclusion; in others the flow alone is followed. By default all.
    change : function (t, x, reaction, kind) -> x
        The reset of a change of a reaction, whose ``kind`` is 'stick', 'slip' or 'mode'. With modes
        a mode, or a tuple (mode, x). None: nothing changes.
    start_mode : function (mode, t, x) -> mode
        The mode in which the flow is followed again; by default the mode stays.
    """

    def __init__(self, smooth, bounds, *, observe=None, act=None, mass=None, offset=None,
                 offset_rate=None, reactions=None, stands_for=None, in_modes=None, change=None,
                 start_mode=None, static_bounds=None):
        functions = dict(smooth=smooth, bounds=bounds, offset=offset, offset_rate=offset_rate,
                         change=change, start_mode=start_mode, static_bounds=static_bounds)
        for name, function in functions.items():
            needed = name in ("smooth", "bounds")
            if not callable(function) and (needed or function is not None):
                raise TypeError(f"Inclusion: {name}: found {function!r}, expected a function")
        if (offset is None) != (offset_rate is None):
            raise TypeError("Inclusion: found one of offset and offset_rate, expected both")
        self._functions = functions
        e, observed = _matrix(observe, "observe")
        g, acting = _matrix(act, "act")
        known = [observed[0]] if observed else []
        known += [acting[1]] if acting else []
        known += [reactions] if reactions is not None else []
        m = known[0] if known else 1
        if not isinstance(m, Integral) or any(count != m for count in known) or not 1 <= m <= 4:
            found = " and ".join(map(str, known))
            raise ValueError(f"Inclusion: found {found} reactions, expected 1 to 4, as many in "
                             "observe, act and reactions")
        n = observed[1] if observed else acting[0] if acting else None
        _matrix(act, "act", n, m)
        a, shape = _matrix(mass, "mass", n, n)
        if shape and shape[0] != shape[1]:
            raise ValueError(f"Inclusion: mass: found shape {shape}, expected a square")
        n = n or (shape[0] if shape else 0)
        if stands_for is not None:
            stands_for = list(stands_for)
            for reaction in stands_for:
                if reaction is not None and not (isinstance(reaction, Integral)
                                                 and 0 <= reaction < m):
                    raise ValueError(f"Inclusion: stands_for: found {reaction!r}, expected None or "
                                     f"the number of a reaction below {m}")
        self._values = dict(observe=e, act=g, mass=a, components=n, reactions=int(m),
                            stands_for=stands_for)
        if isinstance(in_modes, str):
            in_modes = [in_modes]
        self._in_modes = None if in_modes is None else list(in_modes)

    def _specification(self):
        return dict(self._functions, **self._values, in_modes=self._in_modes)


def specification_of(given):
    """What the module reads, of an `Inclusion` or a method that returns one; None of None."""
    if given is None:
        return None
    if callable(given) and not isinstance(given, Inclusion):
        given = given()
    if not isinstance(given, Inclusion):
        raise TypeError(f"set_valued: found a {type(given).__name__}, expected a "
                        "ricochet.Inclusion")
    return given._specification()
