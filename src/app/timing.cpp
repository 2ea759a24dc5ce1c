#include "timing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace ricochet::app {

Timing summarise(std::vector<double> seconds)
{
    if (seconds.empty()) seconds.push_back(std::nan(""));
    std::sort(seconds.begin(), seconds.end());
    const std::size_t n = seconds.size();
    return {.median = seconds[n / 2], .lower = seconds[n / 4], .upper = seconds[3 * n / 4]};
}

std::string spread(const Timing& timing)
{
    return fmt::format("{:.0f} %", 100 * (timing.upper - timing.lower) / timing.median);
}

std::string duration(double seconds)
{
    const double size = std::fabs(seconds);
    if (size < 1e-6) return fmt::format("{:.3g} ns", seconds * 1e9);
    if (size < 1e-3) return fmt::format("{:.3g} us", seconds * 1e6);
    if (size < 1) return fmt::format("{:.3g} ms", seconds * 1e3);
    return fmt::format("{:.3g} s", seconds);
}

}  // namespace ricochet::app
