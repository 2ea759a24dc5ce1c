// Internal: the declarations of this header may change without notice.
//
// A step of Taylor's method: its coefficients, its length, its polynomial.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "ricochet/guard.hpp"
#include "ricochet/instant.hpp"

namespace ricochet::detail {

inline constexpr int most_taylor_order = 20;
inline constexpr int least_taylor_order = 12;

[[nodiscard]] constexpr int taylor_order(int given, double rtol) noexcept
{
    if (given != 0) return given;
    return rtol >= 1e-8 ? 12 : rtol >= 1e-11 ? 16 : 20;
}

/// log2 of a positive normal number, to 1e-3: a step, computed from 1/12 of it, is right to 1e-4.
[[nodiscard]] inline double rough_log2(double x) noexcept
{
    const auto bits = std::bit_cast<std::uint64_t>(x);
    const auto exponent = static_cast<double>(static_cast<std::int64_t>(bits >> 52) - 1023);
    const auto m =
        std::bit_cast<double>((bits & 0xfffffffffffffULL) | 0x3ff0000000000000ULL);  // in [1, 2)
    // Interpolates log2 at the four Chebyshev nodes of [1, 2].
    return (exponent - 2.1362320654130670) +
           m * ((3.0111621508367876 - 1.0268049073983060 * m) + 0.1527002847975194 * (m * m));
}

/// 2^x for |x| < 1000, to 1e-4.
[[nodiscard]] inline double rough_exp2(double x) noexcept
{
    constexpr double shift = 0x1.8p52;  // rounds to a whole number
    const double whole = (x + shift) - shift;
    const double y = x - whole;
    // Interpolates 2^y at the four Chebyshev nodes of [-1/2, 1/2].
    const double part = (0.9999245569508709 + 0.6931367338836214 * y) +
                        y * y * (0.2426394785462585 + 0.0558382829462201 * y);
    return part * std::bit_cast<double>(
                      static_cast<std::uint64_t>(static_cast<std::int64_t>(whole) + 1023) << 52);
}

/// Where the lengths at which the last two terms reach the tolerance differ by more than this power
/// of two, one of them vanishes, and they say little about the terms that the series omits.
inline constexpr double most_apart = 0.585;

/// Errors allowed in the components of a state x: atol + rtol |x|.
struct Tolerances {
    double rtol = 0;
    double atol = 0;
    const double* each = nullptr;  ///< of the components, in the place of `atol`, or null

    [[nodiscard]] double absolute(std::size_t i) const noexcept { return each ? each[i] : atol; }
};

/// How far the series of a step reaches.
/// @tparam S, B  double and bool, or several
template <class S, class B>
struct SeriesReach {
    S h;      ///< [s] at which the last two terms are within the tolerances
    B agree;  ///< whether the last two terms agree, see `most_apart`
};

/// The largest h at which the last two terms stay within the tolerances.
/// @param size  scratch, of the size of the state
template <class X, class Array>
[[nodiscard, gnu::always_inline]] inline SeriesReach<double, bool> find_reach(
    const X& x0, const double* c, int order, const Tolerances& allowed, Array& size)
{
    constexpr double infinity = std::numeric_limits<double>::infinity();
    const std::size_t n = size.size();
    const double by_last = -1.0 / order, by_before = -1.0 / (order - 1);
    double apart = infinity;  // of the lengths by either term
    const auto longest = [&] {
        double last = 0, before = 0;
        const double* const cp = c + static_cast<std::size_t>(order) * n;
        for (std::size_t i = 0; i < n; ++i) {
            const double scale = 1 / (allowed.absolute(i) + allowed.rtol * size[i]);
            last = std::max(last, std::fabs(cp[i]) * scale);
            before = std::max(before, std::fabs(cp[i - n]) * scale);
        }
        // The last two terms vanish: the motion is a polynomial, as far as can be detected.
        const double least = std::numeric_limits<double>::min();
        apart = infinity;
        if (!(last > least) && !(before > least)) return infinity;
        const double most = std::numeric_limits<double>::max();
        const double of_last = rough_log2(std::clamp(last, least, most)) * by_last;
        const double of_before = rough_log2(std::clamp(before, least, most)) * by_before;
        apart = std::fabs(of_last - of_before);
        return rough_exp2(std::min(of_last, of_before));
    };
    for (std::size_t i = 0; i < n; ++i) size[i] = std::fabs(x0[i]);
    // A motion that starts near zero and moves away has the size of its end, as with other methods.
    // The length grows at most with the twelfth root of the size: smaller changes need no further
    // root, and three further ones are enough. (The length is computed in one place, so that
    // compilers always inline it.)
    double h = infinity;
    for (int again = 0;; ++again) {
        h = longest();
        if (again == 3 || !(h < infinity)) break;
        bool larger = false;
        for (std::size_t i = 0; i < n; ++i) {
            const double end = std::fabs(x0[i] + std::min(h, 1e100) * c[n + i]);
            larger = larger || end > 16 * size[i];
            size[i] = std::max(size[i], end);
        }
        if (!larger) break;
    }
    return {h, apart <= most_apart};
}

/// Identity of the step for which coefficients were computed.
struct TaylorStepOrigin {
    Instant start;
    Mode mode = 0;
    bool backward = false;
    int order = 0;           ///< of the known coefficients; 0: none
    int asked = 0;           ///< of the run; larger where the motion is a polynomial
    bool is_motion = false;  ///< a polynomial in time, not a truncated series
    bool doubtful = false;   ///< the end of the step is compared with the flow there
    double reach = std::numeric_limits<double>::quiet_NaN();  ///< [s]; see `StepKernel::reach`
};

/// The coefficients of the current step.
template <std::size_t n, std::size_t m>
struct TaylorStep : TaylorStepOrigin {
    alignas(16) std::array<double, (most_taylor_order + 1) * n> coefficients{};
    std::array<double, (most_taylor_order + 1) * m> guards{};
    std::array<double, n> x{};

    [[nodiscard]] static constexpr std::size_t size() noexcept { return n; }
    [[nodiscard]] static constexpr std::size_t guard_count() noexcept { return m; }
};
/// The same for states sized at run time.
struct LargeTaylorStep : TaylorStepOrigin {
    std::vector<double> coefficients, guards, x;

    /// Forgets the current step.
    void resize(std::size_t n, std::size_t m)
    {
        coefficients.assign((most_taylor_order + 1) * n, 0);
        guards.assign((most_taylor_order + 1) * m, 0);
        x.assign(n, 0);
        guard_count_ = m;
        order = 0;
    }
    [[nodiscard]] std::size_t size() const noexcept { return x.size(); }
    [[nodiscard]] std::size_t guard_count() const noexcept { return guard_count_; }

private:
    std::size_t guard_count_ = 0;
};

/// w(s) = sum of the terms of degree 2 and more, and its derivative.
/// @tparam S  double, or several
template <bool with_rate, class S, class Array>
[[gnu::always_inline]] inline void evaluate_departure(const S* c, int order, const S& s, Array& w,
                                                      Array& rate)
{
    const std::size_t n = w.size();
    // Groups of four coefficients reduce the chain of dependent additions to a quarter of Horner's.
    const S s2 = s * s;
    const S s4 = s2 * s2;
    const auto at = [ c, n ](int k, std::size_t i) __attribute__((always_inline))
    {
        return c[static_cast<std::size_t>(k) * n + i];
    };
    for (std::size_t i = 0; i < n; ++i) w[i] = at(order, i);
    if constexpr (with_rate) std::fill(rate.begin(), rate.end(), S(0.0));
    for (int k = order - 4; k > 0; k -= 4) {
        for (std::size_t i = 0; i < n; ++i) {
            w[i] = w[i] * s4 +
                   ((at(k, i) + s * at(k + 1, i)) + s2 * (at(k + 2, i) + s * at(k + 3, i)));
        }
        if constexpr (with_rate) {
            const double d = k;
            for (std::size_t i = 0; i < n; ++i) {
                rate[i] =
                    rate[i] * s4 + (((d + 1) * at(k + 1, i) + s * ((d + 2) * at(k + 2, i))) +
                                    s2 * ((d + 3) * at(k + 3, i) + s * ((d + 4) * at(k + 4, i))));
            }
        }
    }
    for (std::size_t i = 0; i < n; ++i) w[i] = w[i] * s4 + s2 * (at(2, i) + s * at(3, i));
    if constexpr (with_rate) {
        for (std::size_t i = 0; i < n; ++i) {
            rate[i] =
                rate[i] * s4 + (s * (2 * at(2, i)) + s2 * (3 * at(3, i) + s * (4 * at(4, i))));
        }
    }
}

}  // namespace ricochet::detail
