// Options as a C program gives them, checked.
#pragma once

#include <array>
#include <cstddef>
#include <string>

#include "bindings/c/error.hpp"
#include "core/detect/named_detectors.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/options.hpp"

namespace ricochet::c {

/// The detectors of `detail::NamedDetectors`, in its order.
struct NamedDetector {
    rc_detector value;
    const char* spelled;
};
inline constexpr std::array named_detectors{NamedDetector{RC_EXTREMUM, "RC_EXTREMUM"},
                                            NamedDetector{RC_ENDS, "RC_ENDS"},
                                            NamedDetector{RC_BERNSTEIN, "RC_BERNSTEIN"}};
static_assert(named_detectors.size() == detail::NamedDetectors::size,
              "a detector of detail::NamedDetectors has no line here");
inline constexpr rc_detector last_detector = RC_FORESEEN;  ///< largest value of the enumeration

/// The place in this list; its size for a detector that needs bounds or a gate.
[[nodiscard]] constexpr std::size_t place_of_detector(rc_detector detector) noexcept
{
    std::size_t place = 0;
    while (place < named_detectors.size() && named_detectors[place].value != detector) ++place;
    return place;
}

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
