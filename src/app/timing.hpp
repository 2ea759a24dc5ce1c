// Times measured often enough to be reliable.
#pragma once

#include <string>
#include <vector>

namespace ricochet::app {

/// Seconds per call of a timed function, over many batches.
struct Timing {
    double median = 0;
    double lower = 0;  ///< quartile
    double upper = 0;  ///< quartile
};

/// @param seconds  one per batch, not empty
[[nodiscard]] Timing summarise(std::vector<double> seconds);

/// Width of the middle half of the batches over their median: "2 %".
[[nodiscard]] std::string spread(const Timing& timing);

/// A time in readable form: "1.25 us", "3.4 ms".
[[nodiscard]] std::string duration(double seconds);

}  // namespace ricochet::app
