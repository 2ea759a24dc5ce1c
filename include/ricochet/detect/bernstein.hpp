// All roots of the guard on the step's polynomial, excluded or isolated.
//
// A polynomial lies between the least and the greatest of its coefficients in Bernstein
// form. Along a step's polynomial of degree m a guard that is a polynomial of degree k in
// time and state is one of degree k m in the offset, and k m + 1 samples recover it up to
// rounding: where all coefficients exceed the error of that, no root is possible, and
// "no event" is proved. Other guards are interpolated, the interpolant is compared with
// further samples, and the step is halved where they disagree: "no event" is checked.
//
// Where the coefficients reach the surface, the step is cut into pieces on which the
// guard is monotone, and the samples between them, taken from the guard itself, say what
// happened: a crossing, a touch, neither, in the order of time.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <type_traits>
#include <utility>

#include "ricochet/detail/finding.hpp"
#include "ricochet/detail/dense_polynomial.hpp"
#include "ricochet/hybrid/step.hpp"
#include "ricochet/hybrid/system.hpp"

namespace ricochet {

namespace detail {

inline constexpr int most_bernstein_degree = 32;
/// Of the interpolant of a guard whose degree is not known.
inline constexpr int sampled_degree = 8;

/// Where a polynomial on [0, 1] is sampled: the extrema of the Chebyshev polynomial of
/// that degree, ascending, `degree` + 1 of them. @param degree in [1, 32]
[[nodiscard]] const double* bernstein_nodes(int degree) noexcept;

/// The guard along the step's polynomial, as a function of the offset [s].
class GuardCurve {
public:
    /// Keeps a reference to the probe.
    template <class Probe>
    explicit GuardCurve(Probe& probe) noexcept
        : probe_(&probe),
          value_([](void* of, double s) { return static_cast<Probe*>(of)->dense_value(s).value; })
    {
    }

    [[nodiscard]] double operator()(double s) const { return value_(probe_, s); }

private:
    void* probe_;
    double (*value_)(void*, double);
};

/// What is looked for, and on what.
struct BernsteinTask {
    Crossing crossing = Crossing::falling;
    int degree = 0;        ///< of the guard in the offset; 0: not known
    double clock = 0;      ///< [s] rounding of the time
    bool goes_on = false;  ///< the curve is defined beyond the end of the step
};

/// Whether the samples of a polynomial at its nodes keep it on the armed side all along.
/// Of degree 0: whether those at the nodes of `sampled_degree` do so for a smooth guard.
[[nodiscard]] bool stays_on_side(const BernsteinTask& task, const Watch& watch,
                                 const double* values) noexcept;

/// The first event of the stretch. @param values as for `stays_on_side`
[[nodiscard]] Finding first_event(const BernsteinTask& task, Watch& watch, const double* values,
                                  const GuardCurve& curve);

}  // namespace detail

/// `proved` speaks of the polynomial through the guard's samples, which are taken to be
/// rounded to four units in the last place of the largest, and believes the degree that
/// the system declares. Dense output that a method lacks costs it further steps.
struct Bernstein {
    static constexpr bool uses_rates = true;
    static constexpr Evidence evidence = Evidence::proved;  ///< of a step without armed guards

    /// Every step deserves a look.
    [[nodiscard]] static constexpr bool suspects(double sign, double /*g0*/, double /*rate0*/,
                                                 double /*g1*/, double /*rate1*/,
                                                 double /*h*/) noexcept
    {
        return sign != 0;
    }

    /// What the ends tell is never enough.
    [[nodiscard]] static constexpr bool leaves_plainly(double /*sign*/,
                                                       const GuardSample& /*start*/,
                                                       const GuardSample& /*end*/,
                                                       double /*touch*/) noexcept
    {
        return false;
    }

    template <class Probe>
    [[nodiscard]] Finding examine(Probe& probe, Watch& watch) const
    {
        watch.side_after = watch.side;
        const double width = watch.end.s - watch.start.s;
        if (watch.side == Side::plateau || !(width > 0)) {
            return Finding::clear(Evidence::checked);
        }
        const detail::BernsteinTask task{.crossing = probe.guard().crossing(),
                                         .degree = degree(probe),
                                         .clock = clock(probe),
                                         .goes_on = is_polynomial<Probe>};
        const int n = task.degree > 0 ? task.degree : detail::sampled_degree;
        const double* nodes = detail::bernstein_nodes(n);
        std::array<double, detail::most_bernstein_degree + 1> values;
        const auto at = [&](int j) -> double& { return values[static_cast<std::size_t>(j)]; };
        const auto sample = [&](int j) {
            return probe.dense_value(watch.start.s + width * nodes[j]).value;
        };
        at(0) = watch.start.s == 0 ? watch.start.value : sample(0);
        for (int j = 1; j < n; ++j) at(j) = sample(j);
        at(n) = watch.end.s == probe.step().h() ? watch.end.value : sample(n);

        if (detail::stays_on_side(task, watch, values.data())) {
            return Finding::clear(task.degree > 0 ? Evidence::proved : Evidence::checked);
        }
        return detail::first_event(task, watch, values.data(), detail::GuardCurve(probe));
    }

private:
    template <class Probe>
    static constexpr bool is_polynomial =
        DenseStep<std::remove_cvref_t<decltype(std::declval<Probe>().step())>,
                  typename Probe::State>;

    /// Degree of the guard in the offset, 0 if not known or too high.
    template <class Probe>
    [[nodiscard]] static int degree(const Probe& probe)
    {
        if constexpr (is_polynomial<Probe>) {
            const auto& guard = probe.guard();
            const int in_state =
                guard_info_of<typename Probe::State>(guard.system(), guard.which()).degree;
            if (in_state <= 0 || in_state > detail::most_bernstein_degree) return 0;
            const int n = in_state * degree_of(probe.step().dense().nodes);
            return n <= detail::most_bernstein_degree ? n : 0;
        } else {
            return 0;
        }
    }

    /// How far a time in the step may be rounded [s].
    template <class Probe>
    [[nodiscard]] static double clock(const Probe& probe) noexcept
    {
        const auto& step = probe.step();
        return 1.2e-16 * std::max(std::fabs(step.time(0)), std::fabs(step.time(step.h())));
    }
};

}  // namespace ricochet
