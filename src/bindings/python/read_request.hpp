// Options of Python in the library's terms.
#pragma once

#include <pybind11/pybind11.h>

#include <string>
#include <vector>

#include "request.hpp"

namespace ricochet::python {

/// @throws TypeError for an option that there is not, naming those that there are, or of another
/// type; ValueError for one with a name that there is not.
[[nodiscard]] Request request_from(const pybind11::dict& given);

/// The names of the options that users give.
[[nodiscard]] std::vector<std::string> option_names();

}  // namespace ricochet::python
