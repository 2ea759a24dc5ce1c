// Length of the first step.
#pragma once

#include <algorithm>
#include <cmath>

#include "ricochet/detail/components.hpp"
#include "ricochet/options.hpp"

namespace ricochet::detail {

/// A first step [s] at which an Euler step and the change of the flow over it stay well
/// inside the tolerance (Hairer, Norsett and Wanner, Solving Ordinary Differential Equations
/// I, section II.4). `step` stands at the start, and the run ends after `span` [s].
template <class CurrentStep>
[[nodiscard]] double initial_step(const CurrentStep& step, const Options& options, double span)
{
    const int order = step.error_order() + 1;
    const auto& x = step.x0();
    const auto& dxdt = step.rate0();
    const auto scale = [&](auto i) {
        const auto c = static_cast<std::size_t>(i);
        const double atol =
            c < options.component_atol.size() ? options.component_atol[c] : options.atol;
        return atol + options.rtol * std::fabs(x[i]);
    };
    double size = 0;
    double speed = 0;
    for (decltype(x.size()) i = 0; i < x.size(); ++i) {
        // An infinite component, which means "never", has no size.
        if (std::fabs(x[i]) < 1e300) size = std::max(size, std::fabs(x[i]) / scale(i));
        speed = std::max(speed, std::fabs(dxdt[i]) / scale(i));
    }
    // The state has no time scale here, nor is the distance to the end one.
    const double least = 1e-6 * std::min(1.0, span);
    const double guess = size > 1e-5 && speed > 1e-5 ? 0.01 * size / speed : least;
    const double euler = std::min(guess, span);  // the flow may not exist beyond the end
    auto moved = x;
    auto rate = dxdt;
    move(moved, x, euler, dxdt);
    step.flow(euler, moved, rate);
    double bend = 0;
    for (decltype(x.size()) i = 0; i < x.size(); ++i) {
        bend = std::max(bend, std::fabs(rate[i] - dxdt[i]) / scale(i));
    }
    const double fastest = std::max(speed, bend / euler);
    const double h =
        fastest <= 1e-15 ? std::max(least, euler * 1e-3) : std::pow(0.01 / fastest, 1.0 / order);
    const double first = std::min(std::min(100 * euler, h), options.h_max);
    return std::isfinite(first) && first > 0 ? first : least;
}

}  // namespace ricochet::detail
