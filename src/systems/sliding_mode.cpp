#include "ricochet/systems/sliding_mode.hpp"

#include <algorithm>

#include "base/require.hpp"

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

const StepLayout& SlidingMode::step_layout() noexcept
{
    static constexpr StepLayout layout{.system = name,
                                       .version = 1,
                                       .state = {{{"log_distance", 0, 3},
                                                  {"approach", -0.5, 1},
                                                  {"log_time_to_switch", 2, 3},
                                                  {"reaction", 0.7, 0.5},
                                                  {"disturbance", 0, 1},
                                                  {"disturbance_rate", 0, 1}}}};
    return layout;
}

void SlidingMode::step_inputs(double t, const Vector& w, const Vector& rate, const Vector& reaction,
                              std::array<double, StepView::state_inputs>& out) const noexcept
{
    // The motion is symmetric: signs are those of the state, or, where it is zero, follow from the
    // reaction.
    const double sign = w[0] > 0 || (w[0] == 0 && reaction[0] < 0) ? 1 : -1;
    const double gain = std::max(p_.gain, 1e-300);
    const double distance = std::abs(w[0]) * p_.frequency / gain;
    const double approach = sign * rate[0] / gain;
    constexpr double far = 8;  // used as the logarithm of an infinite time
    const double reached =
        distance > 0 && approach < 0 ? std::clamp(std::log(distance / -approach), -far, far) : far;
    out = {std::log(std::max(distance, 1e-6)),
           approach,
           reached,
           std::abs(reaction[0]) / gain,
           sign * p_.amplitude * std::sin(p_.frequency * t) / gain,
           sign * p_.amplitude * std::cos(p_.frequency * t) / gain};
}

}  // namespace ricochet
