// The parts of the module `_ricochet`.
#pragma once

#include <pybind11/pybind11.h>

namespace ricochet::python {

void bind_results(pybind11::module_& module);
void bind_runs(pybind11::module_& module);
void bind_monitor(pybind11::module_& module);
void bind_ensemble(pybind11::module_& module);
void bind_guard_network(pybind11::module_& module);
void bind_network(pybind11::module_& module);
void bind_places(pybind11::module_& module);

}  // namespace ricochet::python
