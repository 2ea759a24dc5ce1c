// Whether anything has changed that formulas were recorded from.
#pragma once

#include "python_error.hpp"

namespace ricochet::python {

/// Whether all is as it was at these places: a tuple of tuples (kind, object, key, what was there),
/// as `_kept.py` makes them. Numbers and texts may have been replaced by equal ones.
[[nodiscard]] bool are_unchanged(PyObject* places);

}  // namespace ricochet::python
