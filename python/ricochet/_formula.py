"""Functions as formulas: recorded by calling them with symbols, computed without Python."""

import operator

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
        tapes = [x._tape for y in given for x in y.flat if isinstance(x, Symbol)]
        tape = next((tape for tape in tapes if not tape.of_parameters), tapes[0])
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


class ParameterSymbol(Symbol):
    """A parameter of the rows of an ensemble, or an expression of such parameters alone.

    A text made of it would be the same in all rows.
    """

    __slots__ = ()
    __repr__ = __str__ = __format__ = _a_number


def _binary(name, swapped=False):
    def operation(self, other):
        tape = self._tape
        if tape.of_parameters and isinstance(other, Symbol):
            tape = other._tape
        a, b = tape.operand(self), tape.operand(other)
        if b is None:
            return NotImplemented
        return tape.add(name, b, a) if swapped else tape.add(name, a, b)
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
    of_parameters = False
    _symbol = Symbol

    def __init__(self):
        self.ops = []

    def add(self, name, a=0, b=0, value=0.0):
        self.ops.append((name, a, b, value))
        return self._symbol(self, len(self.ops) - 1)

    def operand(self, given):
        """The number of an operation, or None."""
        if isinstance(given, Symbol):
            if given._tape is self:
                return given._index
            if self.of_parameters or not given._tape.of_parameters:
                raise ValueError("formula: found a symbol of another one")
            return self.add("parameter", given._tape.column(given._index))._index
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
        return self._symbol(self, index)


#: What rounds as numbers of Python do, for all rows together.
_EXACT = {"add": np.add, "subtract": np.subtract, "multiply": np.multiply, "divide": np.divide,
          "negate": np.negative, "sqrt": np.sqrt}
#: What is computed for each row as a function of numbers would compute it.
_EACH = {"power": operator.pow, "atan2": np.arctan2, "hypot": np.hypot, "asin": np.arcsin,
         "acos": np.arccos, "atan": np.arctan,
         **{name: getattr(np, name) for name in (
             "cbrt", "exp", "log", "sin", "cos", "tan", "sinh", "cosh", "tanh")}}


def _each(function, *operands):
    """A function of numbers, row by row; NaN where it has no real value."""
    def value(*numbers):
        try:
            return float(function(*numbers))
        except (ArithmeticError, TypeError):  # complex numbers are no floats
            return np.nan
    return np.array([value(*numbers) for numbers in zip(*(x.tolist() for x in operands))])


class ParameterTape(_Tape):
    """The parameters of an ensemble as symbols, and the expressions of them that formulas read."""

    of_parameters = True
    _symbol = ParameterSymbol

    def __init__(self, count):
        super().__init__()
        self.symbols = [self.add("parameter", i) for i in range(count)]
        self._columns = {}  # of the table, by operation

    def column(self, index):
        """The column of the table with an operation's values."""
        return self._columns.setdefault(index, len(self._columns))

    def table(self, parameters):
        """The table of the formulas, shape (rows, columns), and whether all its numbers are finite.

        ``parameters`` are columns. A row with a number that is not finite may fail in Python.
        """
        values = []
        fine = np.ones(len(parameters[0]), bool)
        with np.errstate(all="ignore"):
            for name, a, b, value in self.ops:
                if name == "parameter":
                    values.append(parameters[a])
                elif name == "constant":
                    values.append(np.full(len(fine), value))
                else:
                    of = (values[a], values[b]) if name in _OF_TWO else (values[a],)
                    values.append(_EXACT[name](*of) if name in _EXACT else _each(_EACH[name], *of))
                fine &= np.isfinite(values[-1])
        table = np.empty((len(fine), len(self._columns)))
        for index, column in self._columns.items():
            table[:, column] = values[index]
        return table, fine


_OF_TWO = ("add", "subtract", "multiply", "divide", "power", "atan2", "hypot")


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
