"""What the formula of a function depends on, so that one that is recorded can be kept."""

import builtins
import dis
from enum import Enum, EnumMeta
from functools import lru_cache
from types import BuiltinFunctionType, CodeType, FunctionType, MethodType, ModuleType

import numpy as np

from . import _ricochet
from ._formula import ParameterSymbol

#: Functions of Python whose results depend on their arguments alone.
_PURE = {getattr(builtins, name) for name in (
    "abs", "all", "any", "bool", "dict", "divmod", "enumerate", "filter", "float", "int", "isinstance",
    "len", "list", "map", "max", "min", "pow", "range", "reversed", "round", "set", "sorted", "str",
    "sum", "tuple", "zip")}
#: Modules whose members do not change; what they have of random numbers is named below.
_MODULES = ("numpy", "math", "numpy.linalg", "cmath")
_RANDOM = ("random", "empty", "empty_like", "fromfile", "load")
_MOST = 64  # numbers in an array or a container


# What `_ricochet.unchanged` compares: a kind, an object, a key or None, and what was there.
CELL, ITEM, LIST, DICT, TYPE, ARRAY, FUNCTION = range(7)
_ABSENT = _ricochet.absent  # in the place of an item that a dictionary did not have


class _Unknown(Exception):
    """Something whose changes cannot be seen."""


#: Also of empty cells, and of members that cannot be hashed.
_CANNOT_KNOW = (_Unknown, TypeError, ValueError, RecursionError)


class _Seen(dict):
    """Numbers of the functions that were seen, and the places where something may change."""

    def __init__(self, of_maker=False):
        super().__init__()
        self.places = []
        self.of_maker = of_maker  # classes are followed to what makes their objects


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
        if kind is list:
            seen.places.append((LIST, x, None, tuple(x)))
        return kind, tuple([_value(each, seen) for each in x])
    if kind is FunctionType:
        return id(x) if seen.of_maker and _is_fixed(x) else _function(x, seen)
    if kind is MethodType:
        return _function(x.__func__, seen), id(x.__self__)
    if kind is np.ndarray:
        if x.size > _MOST or x.dtype == object:
            raise _Unknown
        seen.places.append((ARRAY, x, x.shape, x.tobytes()))
        return x.dtype.str, x.shape, x.tobytes()
    if isinstance(x, np.generic):
        return x.dtype.str, x.tobytes()
    if isinstance(x, (Enum, EnumMeta)):
        return id(x)
    if isinstance(x, ModuleType):
        if x.__name__ not in _MODULES and not (seen.of_maker and x.__name__ == "ricochet"):
            raise _Unknown
        return x.__name__
    if seen.of_maker and kind is type:
        return _of_class(x, seen)
    if kind is BuiltinFunctionType or kind is np.ufunc or kind is type:
        if x in _PURE or getattr(x, "__module__", None) in _MODULES or kind is np.ufunc:
            return id(x)
        raise _Unknown
    if kind is dict:
        if len(x) > _MOST:
            raise _Unknown
        seen.places.append((DICT, x, None, dict(x)))
        return kind, tuple([(_value(key, seen), _value(each, seen)) for key, each in x.items()])
    if kind is ParameterSymbol:
        return id(x._tape), x._index
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
    code, given, places = function.__code__, function.__globals__, seen.places
    out = [number, code]
    places.append((FUNCTION, function, code, (function.__defaults__, function.__kwdefaults__)))
    for cell in function.__closure__ or ():
        places.append((CELL, cell, None, cell.cell_contents))
        out.append(_value(cell.cell_contents, seen))
    out.append(_value(function.__defaults__, seen))
    for more in (function.__kwdefaults__, function.__dict__):
        if more:
            out.append(_value(more, seen))
    places.append((DICT, function.__dict__, None, dict(function.__dict__)))
    for name in _names_of(code):
        if name in _RANDOM:
            raise _Unknown
        places.append((ITEM, given, name, given.get(name, _ABSENT)))
        if name in given:
            out.append((name, _value(given[name], seen)))
        else:
            known = vars(builtins).get(name)
            if known is not None and known not in _PURE and not (seen.of_maker and known is super):
                raise _Unknown
            out.append(name)
    return tuple(out)


def _is_fixed(cls):
    """Whether a class or function is of this package, or `object`."""
    return cls is object or (cls.__module__ or "").split(".")[0] == "ricochet"


def _members(owner, seen):
    """The attributes of an object that the functions seen may read."""
    own, out = vars(owner), []
    for function in tuple(seen):
        for name in _names_of(function.__code__):
            if name in own:
                out.append((name, _value(own[name], seen)))
                continue  # the owner's dictionary, and those of its classes, are compared as a whole
            for cls in type(owner).__mro__:
                if name in vars(cls):
                    if not _is_fixed(cls):
                        out.append((name, _value(vars(cls)[name], seen)))
                    break
    return out


def fingerprint(functions, owner, args, places=None):
    """All that formulas of these functions depend on, equal as long as they are; or None.

    None: something among it could change unseen, such as an object of a class. ``places`` is extended
    by all places from where it was read, but those of `places_of_members`.
    """
    seen = _Seen()
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
    except _CANNOT_KNOW:
        return None
    if places is not None:
        places += seen.places
    return out


def places_of_members(owner, values):
    """The places of an object's attributes, and of the contents of these ``values``; or None.

    None: a class computes attributes, or something could change unseen.
    """
    seen = _Seen()
    try:
        for value in values:
            if not callable(value):
                _value(value, seen)
    except _Unknown:
        return None
    out = [(DICT, vars(owner), None, dict(vars(owner)))]
    for cls in type(owner).__mro__:
        if _is_fixed(cls):
            continue
        members = dict(vars(cls))
        if any(isinstance(member, property) for member in members.values()) or (
                not members.keys().isdisjoint(("__getattr__", "__getattribute__"))):
            return None
        out.append((TYPE, cls, None, members))
    return out + seen.places


def _of_class(cls, seen):
    """A class by the functions that make its objects."""
    if cls in _PURE or _is_fixed(cls):
        return id(cls)
    out = [id(cls)]
    for base in cls.__mro__:
        if _is_fixed(base):
            return tuple(out)
        for name in ("__new__", "__init__"):
            if name in vars(base):
                out.append(_value(vars(base)[name], seen))
    raise _Unknown


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


def pure_fingerprint(functions, owner, args, places=None):
    """As `fingerprint`, of functions that change nothing outside of them; else None."""
    found = fingerprint(functions, owner, args, places)
    if found is None:
        return None
    seen = _Seen()
    for function in functions:
        _value(function, seen)
    if owner is not None:
        _members(owner, seen)
    return None if any(_changes_something(function, owner) for function in tuple(seen)) else found


class Kept:
    """Formulas with the fingerprint of what they were recorded from; copies begin without any.

    Or a source with the dictionary of the system that it belongs to.
    """

    __slots__ = ("pair",)  # replaced as a whole, for other threads

    def __init__(self):
        self.pair = None, None

    def __reduce__(self):
        return Kept, ()

    def __copy__(self):
        return Kept()

    def __deepcopy__(self, memo):
        return Kept()


#: Names of what tells a symbol from a number, or one object from another, without an exception.
_TELLING = frozenset(("isinstance", "type", "issubclass", "callable", "hasattr", "getattr", "id",
                      "__class__", "__dict__"))
#: Operations of what does so by catching an exception or by matching a class.
_CATCHING = frozenset(("SETUP_FINALLY", "PUSH_EXC_INFO", "CHECK_EXC_MATCH", "MATCH_CLASS"))
#: Operations of what changes something outside of a function.
_CHANGING_OUTSIDE = frozenset(("STORE_GLOBAL", "STORE_SUBSCR", "DELETE_ATTR", "DELETE_GLOBAL",
                               "DELETE_SUBSCR", "YIELD_VALUE", "IMPORT_NAME"))


@lru_cache(maxsize=1024)
def _tells(code):
    """Whether a function may do something else with symbols than with numbers."""
    return bool(_TELLING.intersection(_names_of(code)) or _CATCHING & _operations_of(code))


@lru_cache(maxsize=1024)
def _sets_others(code):
    """Whether a function sets anything but attributes of its first argument and its own variables."""
    before = None
    for instruction in dis.get_instructions(code):
        if instruction.opname == "STORE_DEREF" and instruction.argval in code.co_freevars:
            return True
        if instruction.opname == "STORE_ATTR":
            loaded = before.argval if before.opname.startswith("LOAD_FAST") else None
            if isinstance(loaded, tuple):  # of an instruction that loads two
                loaded = loaded[-1]
            if code.co_argcount == 0 or loaded != code.co_varnames[0]:
                return True
        before = instruction
    return any(type(constant) is CodeType and _sets_others(constant) for constant in code.co_consts)


def _makes_alone(code):
    """Whether a function that makes systems changes nothing else, and tells no symbols from numbers."""
    changing = _CHANGING_OUTSIDE & _operations_of(code) or set(_CHANGING).intersection(_names_of(code))
    return not (changing or _tells(code) or _sets_others(code))


def may_make(maker):
    """Whether ``maker``, given symbols, does what it does with numbers, and changes nothing but its result.

    False also where that cannot be known.
    """
    seen = _Seen(of_maker=True)
    try:
        if isinstance(maker, type):
            _of_class(maker, seen)
        elif type(maker) is FunctionType:
            _value(maker, seen)
        else:
            return False
    except _CANNOT_KNOW:
        return False
    return all(_makes_alone(function.__code__) for function in seen)


def take_symbols(functions, owner):
    """Whether functions of a system made of symbols do what they do in one made of numbers."""
    seen = _Seen()
    try:
        for function in functions:
            _value(function, seen)
        _members(owner, seen)
    except _CANNOT_KNOW:
        return False
    return not any(_tells(function.__code__) for function in seen)
