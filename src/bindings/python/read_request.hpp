// Translation of options from Python.
#pragma once

#include <pybind11/pybind11.h>

#include <string>
#include <vector>

#include "request.hpp"

namespace ricochet::python {

/// @throws TypeError for an unknown option, naming the known ones, or for one of another type;
/// ValueError for an unknown name as value.
[[nodiscard]] Request request_from(const pybind11::dict& given);

/// The names of the options that users give.
[[nodiscard]] std::vector<std::string> option_names();

}  // namespace ricochet::python
