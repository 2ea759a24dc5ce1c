// Options as a C program gives them, checked.
#pragma once

#include <string>

#include "bindings/c/error.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/options.hpp"

namespace ricochet::c {

/// How events are detected and located.
struct FinderOptions {
    rc_detector detector = RC_EXTREMUM;
    rc_locator locator = RC_NEWTON;
    std::string gate;  ///< path of a model; empty: none
};

struct RunOptions {
    Options options;
    rc_method method = RC_DOPRI5;
    bool fixed_step = false;
    FinderOptions finders;
};

struct MonitorOptions {
    Options options;  ///< of the engine, from here to the end of time
    FinderOptions finders;
    bool backward = false;
    bool cut_at_all = false;
};

/// @throws Refusal naming the option.
[[nodiscard]] RunOptions read_options(const rc_options* given);
/// @throws Refusal for an option that no run with set-valued motion has.
void require_options_of_phases(const RunOptions& options);
/// The method of an option that has been read.
[[nodiscard]] MethodName method_of(rc_method method) noexcept;
/// Null: the defaults.
/// @throws Refusal or std::invalid_argument naming the option.
[[nodiscard]] MonitorOptions read_options(const rc_monitor_options* given);

}  // namespace ricochet::c
