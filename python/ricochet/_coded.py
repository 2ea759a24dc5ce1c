"""States of `solve_ivp` that the core does not have: complex numbers as pairs, and no numbers."""

import numpy as np

from ._compiled import is_compiled
from ._numbers import state_from
from ._system import Stop

#: Functions of a guard by what they return: a number, or a state.
_NUMBERS = ("value", "enabled", "speed_bound", "acceleration_bound", "lower_bound", "upper_bound")
_STATES = ("reset", "rest")


class _Coded:
    """A state of ``components`` as the caller has it, and as real numbers in the core.

    ``shown`` makes the caller's state of the core's, along the last axis, ``kept`` the reverse.
    """

    def __init__(self, components):
        self.components = components

    def returned(self, result, what):
        """The core's state of what a function has returned."""
        array = np.asarray(result)
        if array.dtype.kind not in "biufc" and array.size:
            raise TypeError(f"{what} returned {result!r}, expected a sequence of numbers")
        if array.ndim > 1:
            raise ValueError(f"{what} returned an array of {array.ndim} dimensions, expected 1")
        if array.size != self.components:
            raise ValueError(f"{what} returned {array.size} numbers for a state of "
                             f"{self.components}")
        return self.kept(array.ravel())

    def flow(self, fun):
        """``fun`` for the core."""
        if is_compiled(fun):
            raise TypeError(f"fun: found a compiled function beside {self.what}, expected real "
                            "components")

        def flow(t, y, *further):
            return self.returned(fun(t, self.shown(y), *further), "fun")
        return flow

    def jacobian(self, jac):
        """``jac`` for the core."""
        if is_compiled(jac):
            raise TypeError(f"jac: found a compiled function beside {self.what}, expected one of "
                            "Python")

        def jacobian(t, y, *further):
            found = jac(t, self.shown(y), *further)
            found = np.asarray(found.toarray() if hasattr(found, "toarray") else found)
            if found.shape != (self.components, self.components):
                raise ValueError(f"jac returned the shape {found.shape}, expected an array of shape "
                                 f"{(self.components, self.components)}")
            return self.kept_matrix(found)
        return jacobian

    def guard(self, specification):
        """The functions of a guard for the core."""
        out = dict(specification)
        for name in (*_NUMBERS, "rate", *_STATES):
            function = specification[name]
            if function is None:
                continue
            if is_compiled(function):
                raise TypeError(f"{specification['title']}: found a compiled function beside "
                                f"{self.what}, expected real components")
            if not callable(function):  # refused by the core
                continue
            what = f"{name} of {specification['title']}"
            out[name] = (self._rate(function) if name == "rate" else self._number(function)
                         if name in _NUMBERS else self._state(function, what))
        return out

    def _number(self, function):
        return lambda t, y, *further: function(t, self.shown(y), *further)

    def _rate(self, function):
        return lambda t, y, dydt, *further: function(t, self.shown(y), self.shown(dydt), *further)

    def _state(self, function, what):
        def reset(t, y, *further):
            try:
                after = function(t, self.shown(y), *further)
            except Stop as stop:
                after = stop
            if not isinstance(after, Stop):
                return self.returned(after, what)
            return Stop(after.reason, None if after.after is None
                        else self.returned(after.after, what))
        return reset


class Complex(_Coded):
    """Complex components as pairs of real numbers."""

    what = "a complex y0"

    def shown(self, x):
        return np.ascontiguousarray(x).view(complex)

    def kept(self, x):
        return np.ascontiguousarray(x, complex).view(float)

    def kept_matrix(self, a):
        """A product by complex numbers as one of pairs."""
        out = np.empty((2 * len(a), 2 * len(a)))
        out[0::2, 0::2] = out[1::2, 1::2] = a.real
        out[1::2, 0::2] = a.imag
        out[0::2, 1::2] = -a.imag
        return out

    def tolerances(self, atol):
        """``atol`` of the core's components."""
        return np.repeat(atol, 2) if np.shape(atol) == (self.components,) else atol


class Empty(_Coded):
    """No components; the core has one that stays zero."""

    what = "an empty y0"

    def shown(self, x):
        return np.asarray(x)[..., :0]

    def kept(self, x):
        return np.zeros(1)

    def kept_matrix(self, a):
        return np.zeros((1, 1))

    def tolerances(self, atol):
        return 1.0 if np.shape(atol) == (0,) else atol


def coded(y0):
    """The start of the core as a list, and how it is coded; None for real components."""
    if type(y0) in (list, tuple) and y0 and all(type(x) in (float, int) for x in y0):
        return state_from(y0, "y0"), None
    array = np.asarray(y0)
    if array.ndim == 1 and array.dtype.kind == "c" and array.size:
        code = Complex(array.size)
    elif array.shape == (0,):
        code = Empty(0)
    else:
        return state_from(y0, "y0"), None
    return code.kept(array).tolist(), code
