// Detector that excludes or isolates all roots of a guard on the step's polynomial.
//
// A polynomial lies between the least and the greatest of its coefficients in Bernstein
// form. Along a step's polynomial of degree m a guard that is a polynomial of degree k in
// time and state is one of degree k m in the offset, and k m + 1 samples recover it up to
// rounding: where all coefficients exceed that rounding, no root is possible, and
// "no event" is proved. Other guards are interpolated, the interpolant is compared with
// further samples, and the step is halved if they disagree: "no event" is checked.
//
// Where the coefficients reach the surface, the step is cut into pieces on which the
// guard is monotone, and samples of the guard itself between them determine what happened,
// in order of time: a crossing, a touch, or neither.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <string_view>
#include <type_traits>
#include <utility>

#include "ricochet/detail/dense_polynomial.hpp"
#include "ricochet/step_probe.hpp"
#include "ricochet/system.hpp"

namespace ricochet {

namespace detail {

inline constexpr int most_bernstein_degree = 32;
/// Degree of the interpolant of a guard of unknown degree.
inline constexpr int sampled_degree = 8;

/// The `degree` + 1 points at which a polynomial on [0, 1] is sampled, ascending: the extrema of
/// the Chebyshev polynomial of that degree. @param degree in [1, 32]
[[nodiscard]] const double* bernstein_nodes(int degree) noexcept;

/// The guard along the step's polynomial, as a function of the offset [s].
class GuardCurve {
public:
    /// Keeps a reference to the path.
    explicit GuardCurve(GuardPath& path) noexcept : path_(&path) {}

    [[nodiscard]] double operator()(double s) const { return path_->dense_value(s).value; }

private:
    GuardPath* path_;
};

/// Goal and interval of a search.
struct BernsteinTask {
    Crossing crossing = Crossing::falling;
    int degree = 0;        ///< degree of the guard in the offset; 0: unknown
    double clock = 0;      ///< [s] rounding of the time
    bool goes_on = false;  ///< the curve is defined beyond the end of the step
};

/// Whether the samples of a polynomial at its nodes prove that it stays on the armed side.
/// For degree 0: whether samples at the nodes of `sampled_degree` do so for a smooth guard.
[[nodiscard]] bool stays_on_side(const BernsteinTask& task, const Watch& watch,
                                 const double* values) noexcept;

/// The first event of the interval. @param values as for `stays_on_side`
[[nodiscard]] Finding first_event(const BernsteinTask& task, Watch& watch, const double* values,
                                  const GuardCurve& curve);

}  // namespace detail

/// Detector that excludes or isolates roots by Bernstein coefficients. The evidence `proved` holds
/// for the polynomial through the guard's samples if they are rounded to four units in the last
/// place of the largest and the declared degree is right. Costs steps without dense output.
struct Bernstein {
    static constexpr std::string_view name = "bernstein";
    static constexpr bool uses_rates = true;
    static constexpr detail::Screening screening = detail::Screening::every;
    static constexpr Evidence evidence = Evidence::proved;  ///< for steps without armed guards

    /// Returns true: every step needs a check.
    [[nodiscard]] static constexpr bool suspects(double sign, const GuardSample& /*start*/,
                                                 const GuardSample& /*end*/) noexcept
    {
        return sign != 0;
    }

    /// Returns false: the values at the ends alone never prove a single crossing.
    [[nodiscard]] static constexpr bool leaves_plainly(double /*sign*/,
                                                       const GuardSample& /*start*/,
                                                       const GuardSample& /*end*/,
                                                       double /*touch*/) noexcept
    {
        return false;
    }

    [[nodiscard]] detail::Finding examine(GuardPath& path, detail::Watch& watch) const;
};

}  // namespace ricochet
