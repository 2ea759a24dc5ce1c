#include "ricochet/enclosure.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <random>
#include <string>

namespace ricochet::enclosure_test {
namespace {

using std::abs, std::acos, std::asin, std::atan, std::atan2, std::cbrt, std::ceil, std::cos,
    std::cosh, std::exp, std::fabs, std::floor, std::hypot, std::log, std::max, std::min, std::pow,
    std::sin, std::sinh, std::sqrt, std::tan, std::tanh;

/// Random quantities along intervals, of any size of slope and radius.
class Quantities {
public:
    struct Two {
        Enclosure a, b;
    };

    [[nodiscard]] double any() { return uniform_(random_); }  ///< in [-1, 1]
    [[nodiscard]] Two two()
    {
        const double size = std::pow(10.0, 4 * any() - 2);
        const double radius = any() < -0.7 ? 0 : 0.1 * size * std::fabs(any());
        return {rounded(3 * any(), any() * size, radius),
                rounded(2 * any(), any() * size, 0.5 * radius)};
    }
    /// A value of the quantity at `tau`: often one of its bounds.
    [[nodiscard]] double value(const Enclosure& of, double tau)
    {
        const double part = any() > 0 ? any() : any() > 0 ? 1 : -1;
        return of.centre + of.slope * tau + 0.9999 * part * of.radius;
    }

private:
    /// Sums of centre, slope and radius are rounded, so that the radius is not quite used up.
    [[nodiscard]] static Enclosure rounded(double centre, double slope, double radius)
    {
        return {centre, slope, radius + 0x1p-40 * (std::fabs(centre) + std::fabs(slope))};
    }

    std::mt19937_64 random_{1};
    std::uniform_real_distribution<double> uniform_{-1, 1};
};

/// Checks that f of points is in f of the interval; the rounding of the sum that bounds it is two
/// units in the last place of its terms. Returns the number of intervals with a finite range.
template <class Function>
int expect_enclosed(const std::string& name, const Function& f)
{
    Quantities quantities;
    int known = 0;
    for (int k = 0; k < 4000; ++k) {
        const auto [a, b] = quantities.two();
        detail::is_undecided = false;
        const Enclosure range = f(a, b);
        if (detail::is_undecided || !range.is_finite()) continue;
        ++known;
        for (int n = 0; n < 8; ++n) {
            const double tau = n == 0 ? -1 : n == 1 ? 1 : quantities.any();
            const double value = f(quantities.value(a, tau), quantities.value(b, tau));
            const double middle = range.centre + range.slope * tau;
            const double rounding = 0x1p-51 * (std::fabs(range.centre) + std::fabs(range.slope));
            EXPECT_LE(std::fabs(value - middle), range.radius + rounding)
                << name << " of " << a.centre << " + " << a.slope << " tau +- " << a.radius
                << " at tau = " << tau;
            if (!(std::fabs(value - middle) <= range.radius + rounding)) return 0;
        }
    }
    return known;
}

TEST(Enclosure, OfEveryOperationHoldsEveryValueOnTheInterval)
{
    // Of 4000 intervals all have a range where the operation is defined everywhere, and where it
    // is not, those inside its domain: a quarter of random ones, a tenth where both have to be in
    // [-1, 1].
#define RICOCHET_EXPECT_ENCLOSED(least, expression)                               \
    EXPECT_GE(expect_enclosed(#expression,                                        \
                              [](const auto& a, [[maybe_unused]] const auto& b) { \
                                  using S = std::remove_cvref_t<decltype(a)>;     \
                                  return S(expression);                           \
                              }),                                                 \
              least)
    RICOCHET_EXPECT_ENCLOSED(4000, a + 2 * b - a / 3.0 + 1);
    RICOCHET_EXPECT_ENCLOSED(4000, a * b);
    RICOCHET_EXPECT_ENCLOSED(4000, a * a - 2 * a * b + b * b);
    RICOCHET_EXPECT_ENCLOSED(1000, a / b);
    RICOCHET_EXPECT_ENCLOSED(1000, sqrt(a));
    RICOCHET_EXPECT_ENCLOSED(3900, exp(a));
    RICOCHET_EXPECT_ENCLOSED(1000, log(a));
    RICOCHET_EXPECT_ENCLOSED(4000, sin(a) + cos(b));
    RICOCHET_EXPECT_ENCLOSED(1000, tan(a));
    RICOCHET_EXPECT_ENCLOSED(4000, tanh(a));
    RICOCHET_EXPECT_ENCLOSED(4000, atan(a));
    RICOCHET_EXPECT_ENCLOSED(3900, sinh(a) - cosh(b));
    RICOCHET_EXPECT_ENCLOSED(400, asin(a) - acos(b));
    RICOCHET_EXPECT_ENCLOSED(4000, cbrt(a));
    RICOCHET_EXPECT_ENCLOSED(4000, floor(a) + ceil(b));
    RICOCHET_EXPECT_ENCLOSED(1000, hypot(a, b));
    RICOCHET_EXPECT_ENCLOSED(1000, atan2(a, b));
    RICOCHET_EXPECT_ENCLOSED(4000, max(a, b) - min(b, a * a));
    RICOCHET_EXPECT_ENCLOSED(4000, abs(a) * fabs(b));
    RICOCHET_EXPECT_ENCLOSED(4000, pow(a, 3));
    RICOCHET_EXPECT_ENCLOSED(1000, pow(a, -2));
    RICOCHET_EXPECT_ENCLOSED(1000, pow(a, 1.7));
    RICOCHET_EXPECT_ENCLOSED(3900, pow(2.0, a));
    RICOCHET_EXPECT_ENCLOSED(1000, a < b ? a : b);
#undef RICOCHET_EXPECT_ENCLOSED
}

TEST(Enclosure, KeepsWhatMovesWithTime)
{
    // Along x = tau and y = 1 - tau the sum is 1 on the whole interval: intervals would give [-1,
    // 3].
    const Enclosure x{0, 1, 0}, y{1, -1, 0};
    const Enclosure sum = x + y;
    EXPECT_NEAR(sum.lower(), 1, 1e-14);
    EXPECT_NEAR(sum.upper(), 1, 1e-14);
}

TEST(Enclosure, RadiusOfASmoothFunctionIsOfSecondOrder)
{
    // f(c + w tau) differs from a line by f'' w^2 tau^2 / 2, half of which is the radius.
    const double w = 1e-4;
    const Enclosure x{1, w, 0};
    EXPECT_NEAR(sin(x).radius, 0.25 * std::sin(1.0) * w * w, 1e-12);
    EXPECT_NEAR((x * x).radius, 0.5 * w * w, 1e-14);
    EXPECT_NEAR(exp(x).radius, 0.25 * std::exp(1.0) * w * w, 1e-12);
    // Between secant and tangent of a convex function: f'' w^2 / 4 for sqrt, with f'' = -1/4.
    EXPECT_NEAR(sqrt(x).radius, w * w / 16, 1e-14);
}

TEST(Enclosure, IsUnknownWhereAFunctionIsNotDefined)
{
    const Enclosure across{0, 1, 0};
    EXPECT_FALSE(sqrt(across).is_finite());
    EXPECT_FALSE(log(across).is_finite());
    EXPECT_FALSE((1 / across).is_finite());
    EXPECT_FALSE(asin(2 * across).is_finite());
    EXPECT_FALSE(atan2(across, Enclosure(-1)).is_finite());
}

TEST(Enclosure, ComparisonThatHoldsOnAPartOnlyIsNotDecided)
{
    const Enclosure x{0, 1, 0};
    detail::is_undecided = false;
    EXPECT_TRUE(x < 2);
    EXPECT_FALSE(x > 2);
    EXPECT_TRUE(x >= -2);
    EXPECT_TRUE(x != 2);
    EXPECT_TRUE(Enclosure(3) == 3);
    EXPECT_FALSE(detail::is_undecided);
    static_cast<void>(x < 0.5);
    EXPECT_TRUE(detail::is_undecided);
    detail::is_undecided = false;
    static_cast<void>(x == 0.5);
    EXPECT_TRUE(detail::is_undecided);
    detail::is_undecided = false;
}

}  // namespace
}  // namespace ricochet::enclosure_test
