// Internal: the declarations of this header may change without notice.
//
// Choice of the length of the next step.
#pragma once

#include <algorithm>
#include <cmath>

namespace ricochet {

/// The step-size rule of error control: with the error scaled so that 1 is just
/// acceptable, and proportional to h^order, the next step is
///
///     h_new = h min(10, max(1/5, 0.9 error^(-1/order)))
///
/// (Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I,
/// eq. II.4.13). It is a value, so that other rules can take its place.
struct ErrorRule {
    double safety = 0.9;
    double smallest = 0.2;
    double largest = 10;

    [[nodiscard]] static constexpr bool accepts(double error) noexcept { return error <= 1; }

    /// h_new / h for a finite `error` >= 0.
    [[nodiscard]] double factor(double error, int order) const noexcept
    {
        if (error == 0) return largest;
        double floor = 1;  // (safety / largest)^order: no power is computed below it
        for (int i = 0; i < order; ++i) {
            floor *= safety / largest;
        }
        if (error <= floor) return largest;
        return std::max(smallest, safety * std::pow(error, -1.0 / order));
    }
};

}  // namespace ricochet
