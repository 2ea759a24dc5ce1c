// A gradient against central differences.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace ricochet {

/// Central differences of a function of order one, with h = 1e-5, have errors of h^2 f''' / 6 and
/// of the function's rounding over h: about 1e-10 and 1e-11. Where a gradient is not near zero that
/// is below 1e-6 of it; a thousandth of its largest component counts as near zero.
template <class Parameters, class Function>
void expect_gradient(const std::vector<double>& gradient, Parameters& parameters,
                     const Function& function)
{
    double largest = 0;
    for (const double g : gradient) largest = std::max(largest, std::abs(g));
    ASSERT_GT(largest, 1e-3);
    constexpr double h = 1e-5;
    std::size_t different_from_zero = 0;
    for (std::size_t i = 0; i < gradient.size(); ++i) {
        const double here = parameters[i];
        parameters[i] = here + h;
        const double after = function();
        parameters[i] = here - h;
        const double before = function();
        parameters[i] = here;
        const double tolerance = 1e-6 * std::max(std::abs(gradient[i]), 1e-3 * largest);
        EXPECT_NEAR(gradient[i], (after - before) / (2 * h), tolerance) << "parameter " << i;
        different_from_zero += gradient[i] != 0;
    }
    EXPECT_GT(different_from_zero, gradient.size() / 10);
}

}  // namespace ricochet
