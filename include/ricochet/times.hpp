// Times at which a system has events: a list, or the ticks of a clock.
//
//     ricochet::Times time_events{0, 12, 24};              a member of the system, with time_reset
//     ricochet::Times time_events = ricochet::every(0.1);
//
// A run has an event at each of them from its start to its end, both included, and one for each
// entry where a time is listed several times. In a system that computes its next time event itself,
// `Times` answers for the part that is known beforehand:
//
//     double next_time_event(double t, const State& x) const
//     {
//         return std::min(x[1], ticks.next(t));
//     }
#pragma once

#include <cstddef>
#include <initializer_list>
#include <string>
#include <vector>

namespace ricochet {

/// A list of times, or the ticks of a clock, which `every` makes.
class Times {
public:
    /// No time at all.
    Times() = default;
    /// The entries, in any order; a time that is listed twice is there twice.
    /// @param name  begins the message of refusal
    /// @throws std::invalid_argument naming the entry that is NaN
    explicit Times(std::vector<double> entries, const std::string& name = "times");
    Times(std::initializer_list<double> entries) : Times(std::vector<double>(entries)) {}

    [[nodiscard]] double next(double t) const noexcept;      ///< first after t, or infinity
    [[nodiscard]] double previous(double t) const noexcept;  ///< last before t, or -infinity
    /// How often t is listed: 0 where it is none of the times; at most 1 for a clock.
    [[nodiscard]] std::size_t count(double t) const noexcept;

private:
    friend Times every(double period, double phase, const std::string& name);

    [[nodiscard]] double tick(double number) const noexcept { return phase_ + number * period_; }
    /// The number of the last tick at or before t.
    [[nodiscard]] double last_tick(double t) const noexcept;

    std::vector<double> entries_;
    double period_ = 0;  ///< [s] 0: no clock
    double phase_ = 0;   ///< [s]
};

/// The ticks phase + k period of a clock, for all whole numbers k, each computed by itself.
/// @param period  [s] positive
/// @param phase   [s] time of one of the ticks
/// @param name    begins the message of refusal
/// @throws std::invalid_argument naming the number that is out of its range
[[nodiscard]] Times every(double period, double phase = 0, const std::string& name = "every");

}  // namespace ricochet
