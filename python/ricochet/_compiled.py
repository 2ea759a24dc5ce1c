"""Compiled functions in place of Python's."""

import sys

#: C declarations of the functions, for ``cffi`` and C headers.
C_FLOW = ("void (uint32_t mode, double t, const double *x, double *dxdt, size_t n, "
          "void *user)")
C_GUARD = "double (uint32_t mode, double t, const double *x, size_t n, void *user)"
C_RATE = ("double (uint32_t mode, double t, const double *x, const double *dxdt, size_t n, "
          "void *user)")
C_RESET = "uint32_t (uint32_t mode, double t, double *x, size_t n, void *user)"


class Compiled:
    """A compiled function, which is called without Python.

    Parameters
    ----------
    function
        A function pointer of ``cffi`` or ``ctypes``, a ``numba.cfunc``, or an address. Its
        signature must be `C_FLOW`, `C_GUARD` (also for bounds), `C_RATE` or `C_RESET` (also for
        ``rest`` and ``time_reset``), according to its use. The signature is not checked; a wrong
        one crashes the program.
    user
        Passed as the last argument: an address, a ``cffi`` or ``ctypes`` pointer, or a NumPy
        array, of which the address of the first element is passed.

    Both are kept alive. A system all of whose functions are compiled runs without the
    interpreter lock.
    """

    def __init__(self, function, user=None):
        self._kept = (function, user)
        self._ricochet_address = _address(function)
        self._ricochet_user = 0 if user is None else _address(user)
        if self._ricochet_address == 0:
            raise ValueError("Compiled: found a null pointer, expected a function")

    def __reduce__(self):
        raise TypeError("Compiled: found one to be copied to another process, in which its address "
                        "means nothing; expected it to be made there")

    def __repr__(self):
        return f"Compiled(0x{self._ricochet_address:x})"


def _address(pointer):
    if isinstance(pointer, int) and not isinstance(pointer, bool):
        if pointer < 0:
            raise ValueError(f"Compiled: found the address {pointer}")
        return pointer
    if isinstance(getattr(pointer, "address", None), int):  # numba.cfunc
        return pointer.address
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
                    "or ctypes, a numba.cfunc, or an address")
