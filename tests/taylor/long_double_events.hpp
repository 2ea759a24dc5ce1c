// Events of a smooth motion in long double, by extrapolation of the midpoint rule.
//
// Gragg's rule with 2, 4, ..., 12 substeps, extrapolated to order 12 (Hairer, Norsett and Wanner I,
// section II.9). The guard and its rate are known at the ends of short steps; a change of sign, or
// a turn toward zero, is followed by steps of other lengths from the start of its step.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace ricochet::test {

using Real = long double;

template <class System, std::size_t n>
class LongDoubleMotion {
public:
    using State = std::array<Real, n>;

    LongDoubleMotion(const System& system, const std::array<double, n>& x0, Real h)
        : system_(system), h_(h)
    {
        for (std::size_t i = 0; i < n; ++i) x_[i] = x0[i];
    }

    /// The state after a step of length s.
    [[nodiscard]] State after(Real s) const
    {
        constexpr int rows = 6;
        std::array<State, rows> table;
        for (int j = 0; j < rows; ++j) {
            const int m = 2 * (j + 1);
            const Real part = s / m;
            State a = x_, rate{}, b;
            system_.flow(t_, a, rate);
            for (std::size_t i = 0; i < n; ++i) b[i] = a[i] + part * rate[i];
            for (int q = 1; q < m; ++q) {
                system_.flow(t_ + q * part, b, rate);
                for (std::size_t i = 0; i < n; ++i) {
                    const Real c = a[i] + 2 * part * rate[i];
                    a[i] = b[i];
                    b[i] = c;
                }
            }
            table[at(j)] = b;
            for (int p = j - 1; p >= 0; --p) {
                const Real ratio = static_cast<Real>(m) / (2 * (p + 1));
                for (std::size_t i = 0; i < n; ++i) {
                    const Real above = table[at(p) + 1][i];
                    table[at(p)][i] = above + (above - table[at(p)][i]) / (ratio * ratio - 1);
                }
            }
        }
        return table[0];
    }

    struct Point {
        Real value;
        Real rate;
    };
    /// The guard after a step of length s, and its rate by a central difference along the motion.
    [[nodiscard]] Point guard(Real s) const
    {
        const State x = after(s);
        State dxdt{};
        system_.flow(t_ + s, x, dxdt);
        constexpr Real delta = 1e-5L;
        const auto value = [&](Real ahead) {
            State there = x;
            for (std::size_t i = 0; i < n; ++i) there[i] += ahead * dxdt[i];
            return system_.guard(t_ + s + ahead, there);
        };
        return {value(0), (value(delta) - value(-delta)) / (2 * delta)};
    }

    /// Advances by s, to another state.
    void advance(Real s)
    {
        x_ = after(s);
        t_ += s;
    }
    [[nodiscard]] State& x() noexcept { return x_; }
    [[nodiscard]] Real t() const noexcept { return t_; }
    [[nodiscard]] Real h() const noexcept { return h_; }
    [[nodiscard]] const System& system() const noexcept { return system_; }

private:
    [[nodiscard]] static constexpr std::size_t at(int i) noexcept
    {
        return static_cast<std::size_t>(i);
    }

    const System& system_;
    Real h_;
    Real t_ = 0;
    State x_;
};

/// Crossings of the guard up to `t_end`; `doubtful` where a turn or a start was so near to the
/// surface that rounding decides the events.
struct ExpectedEvents {
    std::vector<Real> t;
    std::vector<Real> slope;
    bool doubtful = false;
};

/// The offset in [lo, hi] where `part` of the guard changes its sign: by the Illinois rule.
template <class Motion, class Part>
[[nodiscard]] Real root_of(const Motion& motion, Real lo, Real hi, const Part& part)
{
    Real at_lo = part(motion.guard(lo)), at_hi = part(motion.guard(hi));
    int kept = 0;
    for (int k = 0; k < 60 && hi - lo > 1e-17L; ++k) {
        const Real s = lo + (hi - lo) * (at_lo / (at_lo - at_hi));
        if (!(s > lo && s < hi)) break;
        const Real there = part(motion.guard(s));
        if (std::fabs(there) < 1e-18L) return s;
        if ((there > 0) == (at_lo > 0)) {
            lo = s;
            at_lo = there;
            if (kept == 1) at_hi /= 2;
            kept = 1;
        } else {
            hi = s;
            at_hi = there;
            if (kept == -1) at_lo /= 2;
            kept = -1;
        }
    }
    return std::fabs(at_lo) < std::fabs(at_hi) ? lo : hi;
}

/// @param reset  maps the state before to the state after, where the guard falls; or nothing,
/// if both directions are recorded
template <class Motion, class Reset>
[[nodiscard]] ExpectedEvents expected_events(Motion motion, Real t_end, bool resets,
                                             const Reset& reset)
{
    constexpr Real near = 1e-9L;
    ExpectedEvents out;
    const auto value = [](const auto& point) { return point.value; };
    const auto rate = [](const auto& point) { return point.rate; };
    Real from = 0;  // the remaining part of the step begins here
    auto lo = motion.guard(0);
    bool leaves = false;  // the step begins on the surface, after a reset
    while (motion.t() < t_end) {
        const Real h = std::fmin(motion.h(), t_end - motion.t());
        const auto hi = motion.guard(h);
        const Real side = leaves ? lo.rate : lo.value;
        Real root = -1;
        if ((side > 0) != (hi.value > 0)) {
            root = from;
            if (leaves) root += (h - from) * 1e-6L;  // beyond the root at the start
            if (leaves && (motion.guard(root).value > 0) != (side > 0)) out.doubtful = true;
            root = root_of(motion, root, h, value);
        } else if ((lo.rate > 0) != (hi.rate > 0) && (side > 0) != (lo.rate > 0) && !leaves) {
            const Real turn = root_of(motion, from, h, rate);
            const auto there = motion.guard(turn);
            if (std::fabs(there.value) < near) out.doubtful = true;
            if ((there.value > 0) != (side > 0)) root = root_of(motion, from, turn, value);
        }
        const bool last = root < 0;
        if (!last) {
            const auto there = motion.guard(root);
            if (std::fabs(there.rate) < 1e-4L) out.doubtful = true;
            out.t.push_back(motion.t() + root);
            out.slope.push_back(there.rate);
            if (resets && there.rate < 0) {
                motion.advance(root);
                reset(motion.t(), motion.x());
                from = 0;
                lo = motion.guard(0);
                leaves = true;
                if (!(lo.rate > 1e-3L)) out.doubtful = true;
                if (out.doubtful) return out;
                continue;
            }
            from = root + 1e-12L;
            lo = motion.guard(from);
            leaves = false;
            continue;
        }
        if (std::fabs(hi.value) < near) out.doubtful = true;
        motion.advance(h);
        from = 0;
        lo = hi;
        leaves = false;
    }
    return out;
}

}  // namespace ricochet::test
