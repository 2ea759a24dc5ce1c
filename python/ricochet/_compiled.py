"""Compiled functions in place of Python's."""

import re
import sys
from functools import lru_cache

#: C declarations of the functions, for ``cffi`` and C headers.
C_FLOW = ("void (uint32_t mode, double t, const double *x, double *dxdt, size_t n, "
          "void *user)")
C_GUARD = "double (uint32_t mode, double t, const double *x, size_t n, void *user)"
C_RATE = ("double (uint32_t mode, double t, const double *x, const double *dxdt, size_t n, "
          "void *user)")
C_RESET = "uint32_t (uint32_t mode, double t, double *x, size_t n, void *user)"
C_JACOBIAN = ("void (uint32_t mode, double t, const double *x, double *rows, size_t n, "
              "void *user)")

#: Types by how they are passed: v nothing, i 32 bits, l 64 bits, d double, p any pointer.
_PASSED = {"void": "v", "none": "v", "double": "d", "float64": "d"}
_PASSED.update(dict.fromkeys(("int", "int32", "int32_t", "uint", "uint32", "uint32_t", "unsigned",
                              "unsigned int"), "i"))
_PASSED.update(dict.fromkeys((
    "long", "ulong", "unsigned long", "longlong", "ulonglong", "long long", "unsigned long long",
    "int64", "int64_t", "uint64", "uint64_t", "size_t", "ssize_t", "intptr_t", "uintptr_t", "intp",
    "uintp", "Py_ssize_t"), "l"))


def _passed(name):
    """How a type is passed, of its name in C or of numba; '?' for any other one."""
    name = re.sub(r"\b(const|volatile|restrict)\b", " ", name).strip()
    if "*" in name or "ointer" in name or name == "voidptr":
        return "p"
    name = " ".join(name.split())
    return _PASSED.get(name, "?")


@lru_cache(maxsize=256)
def _code(text):
    """A signature of C, with or without names of parameters, by how its types are passed."""
    found = re.fullmatch(r"([^(]*)\((.*)\)", text.strip(), re.S)
    if not found:
        return "?"
    out = [_passed(found[1])]
    for parameter in filter(None, map(str.strip, found[2].split(","))):
        code = _passed(parameter)
        if code == "?" and " " in parameter:  # with a name
            code = _passed(parameter.rsplit(None, 1)[0])
        out.append(code)
    return "".join(out)


class Compiled:
    """A compiled function, which is called without Python.

    Parameters
    ----------
    function
        A function pointer of ``cffi`` or ``ctypes``, a ``numba.cfunc``, a
        ``scipy.LowLevelCallable``, or an address. Its signature must be `C_FLOW`, `C_JACOBIAN`,
        `C_GUARD` (also for bounds), `C_RATE` or `C_RESET` (also for ``rest`` and ``time_reset``),
        according to its use. It is checked where the pointer has one; an address has none, and one
        of a function with another signature crashes the program.
    user
        Passed as the last argument: an address, a ``cffi`` or ``ctypes`` pointer, or a NumPy
        array, of which the address of the first element is passed. By default null, or the
        ``user_data`` of a ``LowLevelCallable``.

    Both are kept alive. A system all of whose functions are compiled runs without the
    interpreter lock. All but addresses may also be given bare, wherever a function is expected.
    """

    def __init__(self, function, user=None):
        self._kept = (function, user)
        self._ricochet_address, given = _address(function), 0
        if _is_low_level(function):
            self._ricochet_address, given = _of_capsule(_capsule(function))
        self._ricochet_user = given if user is None else _address(user)
        self._signature = _signature(function)
        if self._ricochet_address == 0:
            raise ValueError("Compiled: found a null pointer, expected a function")

    def _refuse_other_than(self, declaration, who):
        if self._signature is None or _code(self._signature) == _code(declaration):
            return
        raise TypeError(f"{who}: found a compiled function {self._signature}, expected "
                        f"{declaration}")

    def __reduce__(self):
        raise TypeError("Compiled: found one to be copied to another process, in which its address "
                        "means nothing; expected it to be made there")

    def __repr__(self):
        return f"Compiled(0x{self._ricochet_address:x})"


def as_function(given, declaration, who):
    """A function as the module takes it: compiled ones as `Compiled`, of this signature.

    Anything else is returned as it is.
    """
    if given is None or hasattr(given, "__code__"):
        return given
    if not isinstance(given, Compiled):
        if not _is_compiled(given):
            return given
        given = Compiled(given)
    given._refuse_other_than(declaration, who)
    return given


def is_compiled(given):
    """Whether a function is called without Python."""
    return not hasattr(given, "__code__") and (
        isinstance(given, Compiled) or _is_compiled(given))


def _is_compiled(given):
    return _is_numba(given) or _is_low_level(given) or _is_ctypes(given) or _is_cffi(given)


def _is_numba(given):
    return isinstance(getattr(given, "address", None), int) and hasattr(given, "native_name")


def _is_low_level(given):
    # A class of SciPy, which is not imported for it.
    return isinstance(given, tuple) and type(given).__name__ == "LowLevelCallable" and len(given) > 0


def _is_ctypes(given):
    ctypes = sys.modules.get("ctypes")
    return ctypes is not None and isinstance(given, ctypes._CFuncPtr)


def _is_cffi(given):
    backend = sys.modules.get("_cffi_backend")
    return (backend is not None and isinstance(given, backend._CDataBase)
            and backend.FFI().typeof(given).kind == "function")


def _signature(function):
    """The signature of a pointer as C writes it, or None."""
    if _is_numba(function):
        of = function._sig
        return f"{of.return_type} ({', '.join(map(str, of.args))})"
    if _is_low_level(function):
        return _name_of_capsule(_capsule(function))
    if _is_ctypes(function):
        if function.argtypes is None:
            return None
        names = [_ctypes_name(each) for each in (function.restype, *function.argtypes)]
        return f"{names[0]} ({', '.join(names[1:])})"
    if _is_cffi(function):
        of = sys.modules["_cffi_backend"].FFI().typeof(function)
        return f"{of.result.cname} ({', '.join(each.cname for each in of.args)})"
    return None


def _ctypes_name(given):
    import ctypes

    if given is None:
        return "void"
    if given is ctypes.c_void_p or hasattr(given, "contents") or hasattr(given, "_ndpointer_params_"):
        return "void *"
    if given is ctypes.c_double:
        return "double"
    if getattr(given, "_type_", "") in ("i", "I", "l", "L", "q", "Q"):
        return "int32_t" if ctypes.sizeof(given) == 4 else "int64_t"
    return getattr(given, "__name__", str(given))


def _capsule(low_level):
    return tuple.__getitem__(low_level, 0)  # its own operator refuses


def _name_of_capsule(capsule):
    import ctypes

    name = ctypes.pythonapi.PyCapsule_GetName
    name.restype, name.argtypes = ctypes.c_char_p, [ctypes.py_object]
    return (name(capsule) or b"").decode()


def _of_capsule(capsule):
    """The address of the function and that of its data."""
    import ctypes

    pointer = ctypes.pythonapi.PyCapsule_GetPointer
    pointer.restype, pointer.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    context = ctypes.pythonapi.PyCapsule_GetContext
    context.restype, context.argtypes = ctypes.c_void_p, [ctypes.py_object]
    name = _name_of_capsule(capsule)
    return pointer(capsule, name.encode()) or 0, context(capsule) or 0


def _address(pointer):
    if isinstance(pointer, int) and not isinstance(pointer, bool):
        if pointer < 0:
            raise ValueError(f"Compiled: found the address {pointer}")
        return pointer
    if isinstance(getattr(pointer, "address", None), int):  # numba.cfunc
        return pointer.address
    if _is_low_level(pointer):
        return _of_capsule(_capsule(pointer))[0]
    if hasattr(pointer, "__array_interface__"):
        return pointer.__array_interface__["data"][0]
    ctypes = sys.modules.get("ctypes")
    if ctypes is not None and isinstance(
            pointer, (ctypes._SimpleCData, ctypes._Pointer, ctypes.Array, ctypes._CFuncPtr)):
        return ctypes.cast(pointer, ctypes.c_void_p).value or 0
    backend = sys.modules.get("_cffi_backend")
    if backend is not None and isinstance(pointer, backend._CDataBase):
        return int(backend.FFI().cast("uintptr_t", pointer))
    raise TypeError(f"Compiled: found a {type(pointer).__name__}, expected a pointer of cffi "
                    "or ctypes, a numba.cfunc, a scipy.LowLevelCallable, or an address")
