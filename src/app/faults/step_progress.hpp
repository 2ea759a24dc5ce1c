// Progress of a long command, on standard error.
#pragma once

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <string>
#include <string_view>
#include <utility>

#include "ricochet/faults/strike_slip_fault.hpp"
#include "say.hpp"

namespace ricochet::app {

/// Silent for two seconds. After that it redraws a line on a terminal; elsewhere it prints a line
/// immediately and others at growing intervals, so that a log of an hour has some dozens.
class LongRun {
public:
    LongRun() = default;
    ~LongRun() { clear(); }
    LongRun(const LongRun&) = delete;
    LongRun& operator=(const LongRun&) = delete;

    /// @param done  completed fraction of the task named by `label`
    void show(std::string_view label, double done)
    {
        const double now = seconds();
        if (now < next_) return;
        const std::string line =
            fmt::format("{}, {:.0f} %, {:.0f} s", label, 100 * std::clamp(done, 0.0, 1.0), now);
        if (terminal_) {
            say("\r{}\x1b[K", line);
            std::fflush(stderr);
            drawn_ = true;
            next_ = now + 0.1;
        } else {
            say("ricochet: {}\n", line);
            next_ = now + std::max(patience, 0.2 * now);
        }
    }

    /// Frees the line for other output.
    void clear()
    {
        if (drawn_) say("\r\x1b[K");
        drawn_ = false;
    }

private:
    using Clock = std::chrono::steady_clock;
    static constexpr double patience = 2;  // [s]

    [[nodiscard]] double seconds() const
    {
        return std::chrono::duration<double>(Clock::now() - start_).count();
    }

    Clock::time_point start_ = Clock::now();
    bool terminal_ = isatty(STDERR_FILENO) == 1;
    bool drawn_ = false;
    double next_ = patience;  // [s]
};

/// Returns the options with a callback that shows the progress.
[[nodiscard]] inline RuptureOptions shown(RuptureOptions options, LongRun& progress,
                                          std::string label)
{
    options.progress = [&progress, label = std::move(label), t_end = options.t_end,
                        asked = std::move(options.progress)](double t) {
        progress.show(label, t / t_end);
        return !asked || asked(t);
    };
    return options;
}

}  // namespace ricochet::app
