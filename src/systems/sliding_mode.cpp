#include "ricochet/systems/sliding_mode.hpp"

#include "require.hpp"

namespace ricochet {

SlidingMode::SlidingMode(const Parameters& parameters) : p_(parameters)
{
    detail::require_not_negative("SlidingMode", "amplitude", p_.amplitude);
    detail::require_positive("SlidingMode", "frequency", p_.frequency);
    detail::require_not_negative("SlidingMode", "gain", p_.gain);
}

double SlidingMode::reaching(double t, double from) const noexcept
{
    // 1 - cos x = 2 sin^2(x / 2) without cancellation.
    const double s = std::sin(p_.frequency * t / 2);
    return from + p_.amplitude / p_.frequency * 2 * s * s - p_.gain * t;
}

double SlidingMode::exact(double t, double from) const noexcept
{
    return t < reaching_time(from) ? reaching(t, from) : 0;
}

double SlidingMode::reaching_time(double from) const noexcept
{
    // w falls monotonically, since the gain exceeds the disturbance.
    double low = 0;
    double high = from / (p_.gain - p_.amplitude);
    for (double middle = high / 2; middle > low && middle < high; middle = low + (high - low) / 2) {
        (reaching(middle, from) > 0 ? low : high) = middle;
    }
    return high;
}

}  // namespace ricochet
