// Times of whole runs of scenes.
#pragma once

#include <ctime>
#include <functional>

#include "timing.hpp"

namespace ricochet::bench {

/// [s] of processor time of this thread.
[[nodiscard]] inline double time_of(const std::function<void()>& call)
{
    timespec from{};
    timespec to{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &from);
    call();
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &to);
    return static_cast<double>(to.tv_sec - from.tv_sec) +
           1e-9 * static_cast<double>(to.tv_nsec - from.tv_nsec);
}

/// Processor time [s] of a call, the least of three, scaled by the least of the yardsticks beside
/// it: a disturbed yardstick would make the call seem fast.
[[nodiscard]] inline double least_time(const std::function<void()>& call)
{
    double least = 1e300;
    Timing stick{.median = 1e300};
    for (int k = 0; k < 3; ++k) {
        const Timing beside = time_alone(yardstick());
        if (beside.median < stick.median) stick = beside;
        least = std::min(least, time_of(call));
    }
    return scaled(least, stick);
}

/// Ratio of the times of two calls, each the minimum over `turns` alternating repetitions.
[[nodiscard]] inline double time_ratio(const std::function<void()>& one,
                                       const std::function<void()>& other, int turns)
{
    double first = 1e300;
    double second = 1e300;
    for (int k = 0; k < turns; ++k) {
        first = std::min(first, time_of(one));
        second = std::min(second, time_of(other));
    }
    return first / second;
}

}  // namespace ricochet::bench
