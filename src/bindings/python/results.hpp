// Results as exposed to Python.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <memory>
#include <string>
#include <vector>

#include "record.hpp"
#include "source.hpp"

namespace ricochet::python {

namespace py = pybind11;

/// A record with the names of its modes and guards.
struct PyRun {
    Record record;
    py::object modes = py::none();  ///< a list, or None
    std::vector<std::string> guard_names;

    [[nodiscard]] py::object mode_named(Mode mode) const
    {
        if (modes.is_none()) return py::int_(mode);
        const py::list names(modes);
        return mode < names.size() ? py::object(names[mode]) : py::object(py::int_(mode));
    }
};

/// The solution at any time.
struct PySolution {
    std::shared_ptr<Solution<State>> solution;
    py::object modes = py::none();

    /// The states at t, a number or an array of them; at an event before it, or after it.
    [[nodiscard]] py::array at(const py::object& t, bool before) const;
};

/// The events of a record as a structured array, which keeps `owner` alive.
[[nodiscard]] py::array events_of(const Record& record, const py::handle& owner);

/// A new structured array of events with states of `width` components, which are not set.
[[nodiscard]] py::array new_events(std::size_t width, std::size_t count);

/// Names of the modes of a system: `given`, else the names that the system has, else None.
[[nodiscard]] py::object modes_of(const Source& source, const py::object& given);

/// Raises `error` with the run so far attached to it.
[[noreturn]] void raise_with(const PythonError& error, PyRun&& run);

}  // namespace ricochet::python
