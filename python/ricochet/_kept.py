"""What the formula of a function depends on, so that one that is recorded can be kept."""

import builtins
import dis
from enum import Enum, EnumMeta
from functools import lru_cache
from types import BuiltinFunctionType, CodeType, FunctionType, MethodType, ModuleType

import numpy as np

#: Functions of Python whose results depend on their arguments alone.
_PURE = {getattr(builtins, name) for name in (
    "abs", "all", "any", "bool", "dict", "divmod", "enumerate", "filter", "float", "int", "isinstance",
    "len", "list", "map", "max", "min", "pow", "range", "reversed", "round", "set", "sorted", "str",
    "sum", "tuple", "zip")}
#: Modules whose members do not change; what they have of random numbers is named below.
_MODULES = ("numpy", "math", "numpy.linalg", "cmath")
_RANDOM = ("random", "empty", "empty_like", "fromfile", "load")
_MOST = 64  # numbers in an array or a container


class _Unknown(Exception):
    """Something whose changes cannot be seen."""


def _value(x, seen):
    """A value as it is now, for comparison; functions by what they depend on."""
    kind = type(x)
    if kind is float:
        return x.hex()  # which tells -0.0 from 0.0, and is equal for NaN
    if kind is int or kind is str or kind is bool or x is None or kind is bytes or kind is complex:
        return kind, x
    if kind in (tuple, list):
        if len(x) > _MOST:
            raise _Unknown
        return kind, tuple([_value(each, seen) for each in x])
    if kind is FunctionType:
        return _function(x, seen)
    if kind is MethodType:
        return _function(x.__func__, seen), id(x.__self__)
    if kind is np.ndarray:
        if x.size > _MOST or x.dtype == object:
            raise _Unknown
        return x.dtype.str, x.shape, x.tobytes()
    if isinstance(x, np.generic):
        return x.dtype.str, x.tobytes()
    if isinstance(x, (Enum, EnumMeta)):
        return id(x)
    if isinstance(x, ModuleType):
        if x.__name__ not in _MODULES:
            raise _Unknown
        return x.__name__
    if kind is BuiltinFunctionType or kind is np.ufunc or kind is type:
        if x in _PURE or getattr(x, "__module__", None) in _MODULES or kind is np.ufunc:
            return id(x)
        raise _Unknown
    if kind is dict:
        if len(x) > _MOST:
            raise _Unknown
        return kind, tuple([(_value(key, seen), _value(each, seen)) for key, each in x.items()])
    raise _Unknown


def _names(code, names):
    names.update(code.co_names)
    for constant in code.co_consts:
        if type(constant) is CodeType:
            _names(constant, names)


@lru_cache(maxsize=1024)
def _names_of(code):
    """The names in a code, which does not change."""
    found = set()
    _names(code, found)
    return tuple(sorted(found))


def _function(function, seen):
    """A function with everything that it reads from outside."""
    if function in seen:
        return seen[function]
    seen[function] = number = len(seen)  # also ends recursion
    code, given = function.__code__, function.__globals__
    out = [number, code]
    for cell in function.__closure__ or ():
        out.append(_value(cell.cell_contents, seen))
    out.append(_value(function.__defaults__, seen))
    for more in (function.__kwdefaults__, function.__dict__):
        if more:
            out.append(_value(more, seen))
    for name in _names_of(code):
        if name in _RANDOM:
            raise _Unknown
        if name in given:
            out.append((name, _value(given[name], seen)))
        else:
            known = getattr(builtins, name, None)
            if known is not None and known not in _PURE:
                raise _Unknown
            out.append(name)
    return tuple(out)


def _members(owner, seen):
    """The attributes of an object that the functions seen may read."""
    own, out = vars(owner), []
    for function in tuple(seen):
        for name in _names_of(function.__code__):
            if name in own:
                out.append((name, _value(own[name], seen)))
                continue
            for cls in type(owner).__mro__:
                if name in vars(cls):
                    if cls is not object and not cls.__module__.startswith("ricochet"):
                        out.append((name, _value(vars(cls)[name], seen)))
                    break
    return out


def fingerprint(functions, owner, args):
    """All that formulas of these functions depend on, equal as long as they are; or None.

    None: something among it could change unseen, such as an object of a class.
    """
    seen = {}
    try:
        out = [_value(args, seen)]
        for function in functions:
            out.append(_value(function, seen))
        if owner is not None:
            count = -1
            while count != len(seen):  # members may be functions with names of their own
                count = len(seen)
                members = _members(owner, seen)
            out.append(members)
    except (_Unknown, TypeError, ValueError, RecursionError):  # of empty cells, unhashable members
        return None
    return out


#: Methods that change their object, of lists, dictionaries, sets, files and generators.
_CHANGING = ("append", "add", "update", "pop", "popitem", "clear", "extend", "insert", "remove",
             "setdefault", "discard", "write", "send", "put", "appendleft", "sort", "reverse", "fill")
_STORES = ("STORE_ATTR", "STORE_GLOBAL", "STORE_DEREF", "DELETE_ATTR", "DELETE_GLOBAL", "DELETE_SUBSCR",
           "YIELD_VALUE", "IMPORT_NAME")


@lru_cache(maxsize=1024)
def _operations_of(code):
    found = {instruction.opname for instruction in dis.get_instructions(code)}
    for constant in code.co_consts:
        if type(constant) is CodeType:
            found |= _operations_of(constant)
    return found


def _changes_something(function, owner):
    """Whether a function may change what is outside of it."""
    code = function.__code__
    operations = _operations_of(code)
    names = _names_of(code)
    if operations.intersection(_STORES) or set(names).intersection(_CHANGING):
        return True
    if "STORE_SUBSCR" not in operations:
        return False
    read = [cell.cell_contents for cell in function.__closure__ or ()]
    read += [function.__globals__.get(name) for name in names]
    read += [vars(owner).get(name) for name in names] if owner is not None else []
    return any(isinstance(value, (list, dict, set, np.ndarray)) for value in read)


def pure_fingerprint(functions, owner, args):
    """As `fingerprint`, of functions that change nothing outside of them; else None."""
    found = fingerprint(functions, owner, args)
    if found is None:
        return None
    seen = {}
    for function in functions:
        _value(function, seen)
    if owner is not None:
        _members(owner, seen)
    return None if any(_changes_something(function, owner) for function in tuple(seen)) else found


class Kept:
    """Formulas with the fingerprint of what they were recorded from; copies begin without any."""

    __slots__ = ("pair",)  # replaced as a whole, for other threads

    def __init__(self):
        self.pair = None, None

    def __reduce__(self):
        return Kept, ()

    def __copy__(self):
        return Kept()

    def __deepcopy__(self, memo):
        return Kept()
