// Internal: the declarations of this header may change without notice.
//
// Detects when locating events no longer pays.
#pragma once

#include <cstdint>

namespace ricochet::detail {

/// Whether events follow each other so closely that locating them does not pay: 200 of them
/// within `span` [s].
class ChatterWatch {
public:
    ChatterWatch(double t, double span) noexcept : marked_(t), span_(span) {}

    /// Called at time t, after `events` events of the phase.
    [[nodiscard]] bool operator()(double t, std::uint64_t events) noexcept
    {
        if (events < mark_ + most_events) return false;
        const bool chatters = t - marked_ < span_;
        mark_ = events;
        marked_ = t;
        return chatters;
    }

private:
    static constexpr std::uint64_t most_events = 200;
    double marked_;
    double span_;
    std::uint64_t mark_ = 0;
};

/// Whether a y that switches stays within the error of the steps: more than 400 events in a row
/// between which it goes no farther from zero. Their times are then determined by rounding, and
/// unlike the events of an accumulation they need not become denser.
class FlutterWatch {
public:
    /// Called after `events` events, the last of them at t; `speed()` is then the speed of the y
    /// concerned, and `resolved` the part of it that a step resolves.
    template <class Speed>
    [[nodiscard]] bool operator()(std::uint64_t events, double t, double resolved,
                                  const Speed& speed)
    {
        if (events == seen_) return false;
        // The maximum of |y| is that of a parabola between two zeros.
        const bool flutters = events == seen_ + 1 && speed() * (t - t_) / 4 <= resolved;
        in_a_row_ = flutters ? in_a_row_ + 1 : 0;
        seen_ = events;
        t_ = t;
        return in_a_row_ > 400;
    }

private:
    std::uint64_t seen_ = 0;
    int in_a_row_ = 0;
    double t_ = 0;
};

/// Whether a number of steps in a row advances a run by less than 1e-9 of its span.
class StallWatch {
public:
    /// @param most  that number; 0: never
    StallWatch(double t, double t_end, std::uint64_t most) noexcept
        : t_(t), least_(1e-9 * (t_end - t)), most_(most), due_(most)
    {
    }

    /// Called at time t, after that many steps.
    [[nodiscard]] bool operator()(double t, std::uint64_t steps) noexcept
    {
        if (most_ == 0 || steps < due_) return false;
        const bool stalls = t - t_ < least_;
        due_ = steps + most_;
        t_ = t;
        return stalls;
    }

private:
    double t_, least_;
    std::uint64_t most_, due_;
};

/// Whether a run advances so little, over the effort of 20 000 steps without an event, that not
/// even a hundred times the effort it may make would reach its end, and far less than so far.
class PaceWatch {
public:
    PaceWatch(double t, double t_end, std::uint64_t most_effort) noexcept
        : start_(t),
          t_(t),
          least_((t_end - t) * static_cast<double>(interval) /
                 (1e2 * static_cast<double>(most_effort)))
    {
    }

    /// Called at time t, after that effort and `events` events.
    [[nodiscard]] bool operator()(double t, std::uint64_t effort, std::uint64_t events) noexcept
    {
        if (effort < due_) return false;
        const double advance = t - t_;
        const bool hopeless =
            due_ > 0 && events == events_ && advance < least_ && advance < 1e-6 * (t - start_);
        due_ = effort + interval;
        events_ = events;
        t_ = t;
        return hopeless;
    }

private:
    static constexpr std::uint64_t interval = 20'000;
    double start_, t_, least_;
    std::uint64_t due_ = 0, events_ = 0;
};

}  // namespace ricochet::detail
