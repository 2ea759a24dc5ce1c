// A run of an FMU in a process of its own: its library is foreign code, which may crash, exit,
// print or change the locale.
#pragma once

#include <vector>

#include "ricochet/fmi/check.hpp"
#include "ricochet/fmi/run.hpp"

namespace ricochet::app {

/// Runs the FMU as `fmi::run`, with its errors. What the library prints goes to standard error. If
/// it ends the process, the run has the events and rows until then, ends with `call_failed`, and
/// says how the process ended.
[[nodiscard]] fmi::Run run_isolated(const fmi::Fmu& fmu, const fmi::Options& options);

/// The findings of `fmi::check`, likewise; the end of the process is one of them.
[[nodiscard]] std::vector<fmi::Finding> check_isolated(const fmi::Fmu& fmu);

}  // namespace ricochet::app
