// Options and results of a hand-over: phases of events and of set-valued steps.
#pragma once

#include <atomic>
#include <cstdint>
#include <limits>
#include <optional>
#include <string_view>
#include <vector>

#include "ricochet/guard.hpp"
#include "ricochet/nonsmooth/set_valued_motion.hpp"
#include "ricochet/options.hpp"
#include "ricochet/phase.hpp"
#include "ricochet/run.hpp"

namespace ricochet {

/// Options of a hand-over: times, tolerances of both kinds of phases, and what ends the run.
struct HandOverOptions {
    double t_start = 0;
    /// Infinite where something else ends the run: `max_steps`, `cancelled`, `until_released`.
    double t_end = std::numeric_limits<double>::quiet_NaN();

    /// Options of the event-driven phases, as in `Options`.
    double rtol = 1e-10;
    double atol = 1e-12;
    double h_max = std::numeric_limits<double>::infinity();
    double event_tolerance = 0;

    /// The run ends, as `not_handed_over`, when a set-valued phase would begin.
    bool events_only = false;

    /// The run ends, as `released`, when every reaction is at a bound and no y is so close to zero
    /// that its sign is due to rounding.
    bool until_released = false;

    /// Options of the set-valued phases; times are those of the run, a step of 0 is a thousandth of
    /// it, which an infinite run does not have. Changes are located for boxes of up to four
    /// reactions; for others see `switches`.
    SetValuedOptions set_valued{.step = 0, .scheme = {.first_stage = FirstStage::switch_aware}};

    std::vector<double> sample_times{};     ///< ascending
    std::uint64_t max_steps = 100'000'000;  ///< of both kinds, including attempts
    /// The run ends as `stalled` if this many steps, of both kinds, advance it by less than 1e-9 of
    /// its span; 0: never.
    std::uint64_t stall_steps = 1'000'000;
    const std::atomic<bool>* cancelled = nullptr;
};

/// The result of a hand-over is a `Run` of the inclusion's vectors. `Event::guard` is the reaction
/// that changed, modes are those of `BranchModes`, and `Run::reaction` belongs to the state, so
/// that another run goes on from both.
template <Inclusion System>
using HandOverRun [[deprecated("Run<StateOf<System>>")]] = Run<StateOf<System>>;

/// Converts the options of `integrate`.
/// @throws std::invalid_argument for invalid options, and for those that a hand-over does not
/// support: `stop_at_event`, `record_steps`, a run backward, an infinite one without `h_max`.
[[nodiscard]] HandOverOptions hand_over_options(const Options& options);

namespace detail {

/// The same for a run in phases of one loop, which has stop_at_event, record_steps and tolerances
/// of components.
[[nodiscard]] HandOverOptions options_of_phases(const Options& options);

/// @throws std::invalid_argument that begins with `who` and names the option.
void check(const HandOverOptions& options, std::string_view who);
/// The options with defaults filled in.
/// @throws std::invalid_argument naming the option.
[[nodiscard]] HandOverOptions completed(HandOverOptions options, bool locate);
/// The options of a run with a part of the steps; a controller has that part of its tolerances,
/// squared.
[[nodiscard]] HandOverOptions with_part_of_steps(HandOverOptions options, bool locate, double part);
/// Cause of the set-valued phase after an event-driven one with this outcome; nothing if the run is
/// over.
[[nodiscard]] std::optional<PhaseCause> cause_after(Outcome outcome) noexcept;

/// The same for a run of an inclusion alone.
/// @throws std::invalid_argument also for options that it does not use
[[nodiscard]] HandOverOptions inclusion_options(const Options& options);

}  // namespace detail

}  // namespace ricochet
