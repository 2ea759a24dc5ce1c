// What an importer can see of the faults of an FMU for model exchange.
#pragma once

#include <string>
#include <vector>

#include "ricochet/fmi/run.hpp"

namespace ricochet::fmi {

/// A fault or a remark.
struct Finding {
    bool fault = false;  ///< against the standard, or the motion; else a remark
    std::string text;    ///< one sentence
};

/// Starts an instance, asks it for the same point twice with others in between, and runs it to the
/// end of `options`.
///
/// Faults: rates, indicators or nominal values that are not finite; an indicator that is zero after
/// event mode; values that depend on the points evaluated before; a time event in the past;
/// directional derivatives that differ from differences; a run that ends before its end. Remarks:
/// indicators of +1 and -1, nominal values that are not positive, states whose nominal values are 1
/// and whose sizes are not.
///
/// @throws Error as `run` where the FMU cannot be started
[[nodiscard]] std::vector<Finding> check(const Fmu& fmu, const Options& options = {});

}  // namespace ricochet::fmi
