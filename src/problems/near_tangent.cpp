#include "problems/near_tangent.hpp"

#include <cmath>
#include <numbers>

#include "base/require.hpp"

namespace ricochet {

namespace {

/// 2 asin(sqrt(depth / 2)) = acos(1 - depth), without the cancellation.
long double half_width_of(double depth) noexcept
{
    return 2 * std::asin(std::sqrt(static_cast<long double>(depth) / 2));
}

}  // namespace

NearTangent::NearTangent(const Parameters& parameters) : parameters_(parameters)
{
    detail::require(std::isfinite(parameters.depth) && parameters.depth < 2, "NearTangent", "depth",
                    "be finite and below 2", parameters.depth);
    detail::require_finite("NearTangent", "phase", parameters.phase);
    detail::require_not_negative("NearTangent", "touch", parameters.touch);
}

NearTangent::State NearTangent::start() const noexcept
{
    return {std::cos(parameters_.phase), -std::sin(parameters_.phase)};
}

double NearTangent::half_width() const noexcept
{
    return static_cast<double>(half_width_of(parameters_.depth));
}

std::vector<double> NearTangent::events(double t_end) const
{
    std::vector<double> times;
    if (parameters_.depth < 0) return times;
    constexpr long double turn = 2 * std::numbers::pi_v<long double>;
    const long double half = half_width_of(parameters_.depth);
    const long double phase = parameters_.phase;
    const auto add = [&](long double t) {
        if (t > 0 && t <= t_end) times.push_back(static_cast<double>(t));
    };
    for (long double n = std::floor(phase / turn); turn * n - phase - half <= t_end; ++n) {
        const long double crest = turn * n - phase;
        add(crest - half);
        if (half > 0) add(crest + half);
    }
    return times;
}

}  // namespace ricochet
