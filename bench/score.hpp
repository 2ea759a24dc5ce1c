// Event times against their reference: the set first, then the times.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace ricochet::bench {

struct Score {
    std::size_t missed = 0;    ///< of the reference, not found
    std::size_t spurious = 0;  ///< events found that are not in the reference
    double error = 0;          ///< [s] largest error of those found

    [[nodiscard]] bool complete() const noexcept { return missed == 0 && spurious == 0; }
};

/// Pairs each time of the reference with the first free one of `found` that is
/// nearer than half the smallest interval of the reference. Both ascend.
[[nodiscard]] inline Score score(const std::vector<double>& found,
                                 const std::vector<double>& reference)
{
    double window = std::numeric_limits<double>::infinity();
    for (std::size_t i = 1; i < reference.size(); ++i) {
        window = std::min(window, (reference[i] - reference[i - 1]) / 2);
    }
    Score score;
    std::size_t next = 0;
    for (const double t : reference) {
        while (next < found.size() && found[next] <= t - window) {
            ++score.spurious;
            ++next;
        }
        if (next < found.size() && found[next] < t + window) {
            score.error = std::max(score.error, std::fabs(found[next] - t));
            ++next;
        } else {
            ++score.missed;
        }
    }
    score.spurious += found.size() - next;
    return score;
}

}  // namespace ricochet::bench
