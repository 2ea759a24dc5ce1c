"""Functions as formulas: recorded by calling them with symbols, computed without Python."""

import numpy as np

from . import _ricochet


def _refused(what, expected):
    def refuse(self, *_):
        raise TypeError(f"formula: found {what}; expected {expected}")
    return refuse


_a_kink = _refused("a comparison or a kink (abs, min, max, if, ...) of its symbols",
                   "a guard at the kink and a mode on each side of it, or no formula")
_a_number = _refused("a number wanted of a symbol, as by functions of math",
                     "functions of NumPy, such as np.sin")


def _apply(inputs, ufunc, method, options):
    """A function of NumPy of arrays and symbols."""
    given = [np.asarray(x).astype(object) for x in inputs]  # of Python's numbers
    if ufunc in (np.arctan2, np.hypot):
        # NumPy calls these as methods of the first operand, which numbers do not have.
        tape = next(x._tape for y in given for x in y.flat if isinstance(x, Symbol))
        as_symbol = np.frompyfunc(tape.symbol, 1, 1)
        given = [np.asarray(as_symbol(x), dtype=object) for x in given]
    if "out" in options:
        options["out"] = tuple(np.asarray(x) for x in options["out"])
    result = getattr(ufunc, method)(*given, **options)
    return result.view(Symbols) if isinstance(result, np.ndarray) else result


class Symbols(np.ndarray):
    """An array of symbols."""

    def __array_ufunc__(self, ufunc, method, *inputs, **options):
        return _apply(inputs, ufunc, method, options)


class Symbol:
    """The time, a component of the state, or the result of a formula."""

    __slots__ = ("_tape", "_index")
    __hash__ = None

    def __init__(self, tape, index):
        self._tape = tape
        self._index = index

    def __repr__(self):
        return f"<symbol {self._index} of a formula>"

    def __pos__(self):
        return self

    def __array_ufunc__(self, ufunc, method, *inputs, **options):
        return _apply(inputs, ufunc, method, options)

    __lt__ = __le__ = __gt__ = __ge__ = __eq__ = __ne__ = __bool__ = __abs__ = _a_kink
    __floor__ = __ceil__ = __round__ = __trunc__ = __mod__ = __rmod__ = __floordiv__ = _a_kink
    rint = floor = ceil = trunc = sign = _a_kink
    __float__ = __int__ = __complex__ = __index__ = _a_number


def _binary(name, swapped=False):
    def operation(self, other):
        a, b = self._index, self._tape.operand(other)
        if b is None:
            return NotImplemented
        return self._tape.add(name, b, a) if swapped else self._tape.add(name, a, b)
    return operation


def _unary(name):
    def operation(self):
        return self._tape.add(name, self._index)
    return operation


for _method, _name in dict(add="add", sub="subtract", mul="multiply", truediv="divide",
                           pow="power").items():
    setattr(Symbol, f"__{_method}__", _binary(_name))
    setattr(Symbol, f"__r{_method}__", _binary(_name, swapped=True))
setattr(Symbol, "__neg__", _unary("negate"))
for _name in ("sqrt", "cbrt", "exp", "log", "sin", "cos", "tan", "sinh", "cosh", "tanh"):
    setattr(Symbol, _name, _unary(_name))  # called by the functions of NumPy
for _method, _name in dict(arcsin="asin", arccos="acos", arctan="atan").items():
    setattr(Symbol, _method, _unary(_name))
for _method, _name in dict(arctan2="atan2", hypot="hypot").items():
    setattr(Symbol, _method, _binary(_name))


class _Tape:
    def __init__(self):
        self.ops = []

    def add(self, name, a=0, b=0, value=0.0):
        self.ops.append((name, a, b, value))
        return Symbol(self, len(self.ops) - 1)

    def operand(self, given):
        """The number of an operation, or None."""
        if isinstance(given, Symbol):
            if given._tape is not self:
                raise ValueError("formula: found a symbol of another one")
            return given._index
        if isinstance(given, np.ndarray) and given.ndim > 0:
            return None
        try:
            return self.add("constant", value=float(given))._index
        except (TypeError, ValueError):
            return None

    def symbol(self, given):
        """The number as a symbol, or the symbol itself."""
        index = self.operand(given)
        if index is None:
            raise TypeError(f"formula: found {given!r}, expected a number or a symbol")
        return Symbol(self, index)


def _recording(components):
    """An empty tape, with the symbols of the time and of the state."""
    tape = _Tape()
    x = np.empty(components, dtype=object).view(Symbols)
    for i in range(components):
        x[i] = tape.add("component", i)
    return tape, tape.add("time"), x


def _called(function, modes, mode, t, x, args):
    return function(*(() if modes is None else (mode,)), t, x, *(args or ()))


class Formula:
    """A formula recorded from a Python function, once for each mode.

    function([mode,] t, x, *args) with ``x`` an array of ``components`` symbols.
    """

    def __init__(self, function, components, modes, args, title, is_flow):
        tapes = []
        for mode in [None] if modes is None else modes:
            tape, t, x = _recording(components)
            result = _called(function, modes, mode, t, x, args)
            tapes.append((tape.ops, self._outputs(tape, result, components, title, is_flow)))
        self._ricochet_formula = _ricochet.Formula(components, tapes)
        address = "flow_address" if is_flow else "guard_address"
        self._ricochet_address = getattr(_ricochet.Formula, address)
        self._ricochet_user = self._ricochet_formula.address

    @classmethod
    def of_reset(cls, function, components, modes, within, args, title):
        """A reset: function([mode,] t, x, *args) returns x, or with modes a mode or (mode, x).

        Modes that are not ``within`` leave everything as it is.
        """
        self, tapes, following = cls.__new__(cls), [], []
        for number, mode in enumerate([None] if modes is None else modes):
            tape, t, x = _recording(components)
            state = list(x)
            result = (mode, state)
            if within is None or mode in within:
                result = _called(function, modes, mode, t, x, args)
                if modes is None:
                    result = (mode, result)
                elif not isinstance(result, tuple):
                    result = (result, state)
            after, place = result
            following.append(number if modes is None else modes.index(after))
            tapes.append((tape.ops, cls._outputs(tape, place, components, title, True)))
        self._ricochet_formula = _ricochet.Formula(components, tapes, following)
        self._ricochet_address = _ricochet.Formula.reset_address
        self._ricochet_user = self._ricochet_formula.address
        return self

    @staticmethod
    def _outputs(tape, result, components, title, is_flow):
        results = np.asarray(result, dtype=object).ravel()
        if len(results) != (components if is_flow else 1):
            raise ValueError(f"{title} returned {len(results)} numbers, expected "
                             f"{components if is_flow else 1}")
        out = [tape.operand(value) for value in results]
        if None in out:
            found = results[out.index(None)]
            raise TypeError(f"{title} returned {found!r}, expected formulas and numbers")
        return out
