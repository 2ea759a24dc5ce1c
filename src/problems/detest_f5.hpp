// A flow with a vertical tangent every second.
#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <string_view>

namespace ricochet {

/// Problem F5 of the DETEST collection: a flow that is continuous, and steep without
/// bound at 19 instants.
///
/// State (y), dimensionless. With c the sum of i^(4/3) for i = 1, ..., 19,
///
///     flow    y' = 4 / (3 c) y sum sgn(t - i) |t - i|^(1/3)
///     time    events at t = 1, ..., 19, where nothing happens: steps end there
///
/// (W. H. Enright and J. D. Pryce, Two FORTRAN packages for assessing initial value
/// methods, ACM Transactions on Mathematical Software 13, 1987, pages 1 to 27.)
///
/// Where a step ends at a singularity the error is of order h^(4/3) for any method. Error control
/// therefore takes tiny steps on both sides of each singularity, and an error remains: with dopri5
/// the measured error at the end is about 400 times the tolerance, down to 4e-12 at 1e-14.
/// Fehlberg's pair, whose error estimate is nearly blind to terms that depend on t alone (see
/// `DetestF4`), is unsuitable.
///
/// Known solution: y = exp(sum |t - i|^(4/3) / c - 1), see `solution`. Functions are
/// generic in the state type.
class DetestF5 {
public:
    using State = std::array<double, 1>;

    static constexpr std::string_view name = "detest-f5";
    static constexpr State start{1};
    static constexpr double t_end = 20;  ///< [s]

    template <class X>
    void flow(double t, const X& x, X& dxdt) const noexcept
    {
        double sum = 0;
        for (int i = 1; i <= last; ++i) sum += std::cbrt(t - i);
        dxdt[0] = 4 / (3 * c) * x[0] * sum;
    }

    [[nodiscard]] double next_time_event(double t) const noexcept
    {
        if (t < 1) return 1;
        return t < last ? std::floor(t) + 1 : std::numeric_limits<double>::infinity();
    }
    [[nodiscard]] double previous_time_event(double t) const noexcept
    {
        if (t > last) return last;
        return t > 1 ? std::ceil(t) - 1 : -std::numeric_limits<double>::infinity();
    }

    /// The state at t [s] from `start` at time 0.
    [[nodiscard]] static State solution(double t) noexcept;

private:
    static constexpr int last = 19;
    static constexpr double c = 438.4461015267793782;
};

}  // namespace ricochet
