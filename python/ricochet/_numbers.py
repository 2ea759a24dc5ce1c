"""Numbers that a caller has given, as floats."""

import numpy as np


def _is_complex(array):
    """Whether an array has a complex number, also among objects."""
    return np.iscomplexobj(array) or (
        array.dtype == object and any(map(np.iscomplexobj, array.flat)))


def state_from(given, what):
    """A start as a list of numbers."""
    if type(given) in (list, tuple) and given and all(type(x) in (float, int) for x in given):
        components = given
    else:
        array = np.asarray(given)
        if _is_complex(array):
            raise ValueError(f"{what}: found complex numbers, expected real ones: write real and "
                             "imaginary parts as components")
        if array.dtype.kind in "mM":
            raise TypeError(f"{what}: found times of NumPy, expected numbers")
        if array.ndim != 1:
            raise ValueError(f"{what}: found {array.ndim} dimensions, expected 1")
        if array.size == 0:
            raise ValueError(f"{what}: found no components, expected at least one")
        components = array.tolist()
    try:
        return [float(x) for x in components]
    except (TypeError, ValueError):
        raise TypeError(f"{what}: found {given!r}, expected numbers") from None
    except OverflowError:
        raise ValueError(f"{what}: found an integer above all floats, expected finite "
                         "numbers") from None


def numbers_from(given, what):
    """An array of floats."""
    try:
        array = np.asarray(given)
        # NumPy would drop imaginary parts with a warning, and count the days of dates.
        if array.dtype.kind in "mM" or _is_complex(array):
            raise TypeError
        return array.astype(float, copy=False)
    except (TypeError, ValueError, OverflowError):
        raise TypeError(f"{what}: found {given!r}, expected numbers") from None


def meant_by(name, known):
    """All names, and the one that a misspelt one resembles: the end of a sentence."""
    from difflib import get_close_matches
    near = get_close_matches(str(name), known, 1)
    return ", ".join(known) + (f"; did you mean {near[0]!r}?" if near else "")


def number_from(given, what):
    """A float."""
    if type(given) is float:
        return given
    try:
        if np.asarray(given).dtype.kind in "cmM":
            raise TypeError
        # NumPy turns an array into a float only where it has no dimensions.
        return float(given.item() if isinstance(given, np.ndarray) else given)
    except (TypeError, ValueError, OverflowError):
        raise TypeError(f"{what}: found {given!r}, expected a number") from None
