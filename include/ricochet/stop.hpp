// The end of a run, decided by a reset.
#pragma once

#include <exception>
#include <optional>
#include <string>
#include <utility>

#include "ricochet/guard.hpp"

namespace ricochet {

/// Thrown by a reset, or a time_reset, to end the run at its event:
///
///     void reset(double t, State& x) const
///     {
///         x[0] = 0;
///         if (++hits == 3) throw ricochet::StopRun("three hits");
///     }
///
/// The run ends as `stopped_by_event`, with what the reset has written as its state, and with the
/// text as `Run::reason`. Where the resets of a set are asked several times, the first time counts.
class StopRun : public std::exception {
public:
    /// @param why  the text of `Run::reason`
    explicit StopRun(std::string why) : why_(std::move(why)) {}
    /// @param mode  the mode after the event
    StopRun(std::string why, Mode mode) : why_(std::move(why)), mode_(mode) {}

    [[nodiscard]] const char* what() const noexcept override { return why_.c_str(); }
    [[nodiscard]] const std::string& why() const noexcept { return why_; }
    /// The mode after the event; without a value it is the mode before.
    [[nodiscard]] std::optional<Mode> mode() const noexcept { return mode_; }

private:
    std::string why_;
    std::optional<Mode> mode_;
};

}  // namespace ricochet
