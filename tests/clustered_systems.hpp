// Systems whose events are clustered or simultaneous.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "ricochet/guard.hpp"

namespace ricochet::test {

/// x' = 1 and four guards whose zeros lie 1e-8 and more apart, near x = 0.
///
///     guard   x - offset[which], either direction
struct Clustered {
    using State = std::array<double, 1>;
    static constexpr bool resets = false;

    static constexpr std::size_t guard_count = 4;
    static constexpr std::array<double, 4> offsets{0, 1e-8, 2e-8, 2e-7};

    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t /*which*/) noexcept
    {
        return {.crossing = Crossing::either, .degree = 1};
    }
    template <class X>
    void flow(double, const X&, X& dxdt) const
    {
        dxdt[0] = 1;
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t which, double, const X& x) const
    {
        return x[0] - offsets[which];
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(std::size_t, double, const X&, const D& dxdt) const
    {
        return dxdt[0];
    }
};

/// x' = 1 from x = `shift` and one guard with three zeros, of degree three or six in time.
///
///     guard   (s - 0.1) (s - 0.4) (s - 0.8), either direction, s = x - shift or its square
///
/// With `slip` > 0 every crossing moves x back by that much: less than an event's window,
/// so that no root is crossed twice.
struct ThreeRoots {
    using State = std::array<double, 1>;

    bool squared = false;
    double shift = 0;
    double slip = 0;
    static constexpr std::array<double, 3> roots{0.1, 0.4, 0.8};

    [[nodiscard]] GuardInfo guard_info(std::size_t /*which*/) const noexcept
    {
        return {.crossing = Crossing::either, .resets = slip > 0, .degree = squared ? 6 : 3};
    }
    template <class X>
    void flow(double, const X&, X& dxdt) const
    {
        dxdt[0] = 1;
    }
    template <class X>
    [[nodiscard]] double guard(double, const X& x) const
    {
        const double u = x[0] - shift;
        const double s = squared ? u * u : u;
        return (s - roots[0]) * (s - roots[1]) * (s - roots[2]);
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(double, const X& x, const D& dxdt) const
    {
        const double u = x[0] - shift;
        const double s = squared ? u * u : u;
        const double rate = squared ? 2 * u : 1;
        return dxdt[0] * rate *
               ((s - roots[1]) * (s - roots[2]) + (s - roots[0]) * (s - roots[2]) +
                (s - roots[0]) * (s - roots[1]));
    }
    template <class X>
    void reset(double, X& x) const
    {
        x[0] -= slip;
    }
    /// Time [s] of root i from x = shift, without slips.
    [[nodiscard]] double time(std::size_t i) const
    {
        return squared ? std::sqrt(roots[i]) : roots[i];
    }
};

/// cos 3t and cos t as quadratures: every zero of the second is one of the first.
///
/// State (u, w, sets).
///
///     guard   u and w, in this order or the other, either direction
///     reset   if it `acts`: sets⁺ = sets⁻ + 1, whichever guards have fired together
struct Synchronous {
    using State = std::array<double, 3>;

    bool swapped = false;
    bool acts = false;
    static constexpr std::size_t guard_count = 2;
    static constexpr State start{1, 1, 0};

    /// The component whose value the guard is.
    [[nodiscard]] constexpr std::size_t component(std::size_t which) const noexcept
    {
        return swapped ? 1 - which : which;
    }
    [[nodiscard]] constexpr GuardInfo guard_info(std::size_t /*which*/) const noexcept
    {
        return {.crossing = Crossing::either, .resets = acts, .degree = 1};
    }
    template <class X>
    void flow(double t, const X&, X& dxdt) const
    {
        dxdt[0] = -3 * std::sin(3 * t);
        dxdt[1] = -std::sin(t);
        dxdt[2] = 0;
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t which, double, const X& x) const
    {
        return x[component(which)];
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(std::size_t which, double, const X&, const D& dxdt) const
    {
        return dxdt[component(which)];
    }
    template <class X>
    void reset(std::size_t, double, X& x) const
    {
        x[2] += 1;
    }
};

/// Balls side by side, each with a guard and a reset of its own.
///
/// State (u_0, v_0, u_1, v_1, ...); ball i has the guard u_i, falling, unilateral, and the
/// reset u_i⁺ = 0, v_i⁺ = -e v_i⁻.
struct Balls {
    using State = std::vector<double>;

    std::size_t balls = 2;
    double gravity = 9.81;
    double restitution = 0.9;

    [[nodiscard]] std::size_t guard_count() const noexcept { return balls; }
    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t /*which*/) noexcept
    {
        return {.name = "floor", .unilateral = true, .degree = 1};
    }
    template <class X>
    void flow(double, const X& x, X& dxdt) const
    {
        for (std::size_t i = 0; i < balls; ++i) {
            dxdt[2 * i] = x[2 * i + 1];
            dxdt[2 * i + 1] = -gravity;
        }
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t which, double, const X& x) const
    {
        return x[2 * which];
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(std::size_t which, double, const X&, const D& dxdt) const
    {
        return dxdt[2 * which];
    }
    template <class X>
    void reset(std::size_t which, double, X& x) const
    {
        x[2 * which] = 0;
        x[2 * which + 1] *= -restitution;
    }
    /// All balls at rest at `height`.
    [[nodiscard]] State drop(double height) const
    {
        State x(2 * balls, 0.0);
        for (std::size_t i = 0; i < balls; ++i) x[2 * i] = height;
        return x;
    }
};

}  // namespace ricochet::test
