// Bodies on a floor with Coulomb friction: a block that slides until it rests and sticks, and a
// ball that slides until it rolls. Both have closed forms.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "problems.hpp"

namespace ricochet::report {

using Three = std::array<double, 3>;

namespace sliding {

inline constexpr double gravity = 9.81;                ///< [m/s²]
inline constexpr double friction = 0.3;                ///< Coulomb's coefficient
inline constexpr double start = 4;                     ///< [m/s] velocity
inline constexpr double radius = 0.125;                ///< [m] of the ball
inline constexpr double t_end = 2;                     ///< [s]
inline constexpr double braking = friction * gravity;  ///< [m/s²]

}  // namespace sliding

/// State (x, v). Slides with v' = -braking to v = 0, and stays there.
struct SlidingBlock {
    using State = Two;
    enum : Mode { slides, sticks };
    static constexpr std::size_t mode_count = 2;
    static constexpr std::size_t guard_count = 1;

    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t /*which*/)
    {
        return {.degree = 1};
    }
    template <class T, class X>
    constexpr void flow(Mode mode, const T& /*t*/, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = mode == slides ? -sliding::braking : 0.0;
    }
    /// Always positive while the block sticks: nothing pulls it.
    template <class T, class X>
    [[nodiscard]] constexpr auto guard(std::size_t /*which*/, Mode mode, const T& /*t*/,
                                       const X& x) const
    {
        return mode == slides ? x[1] + 0.0 : x[1] + 1.0;
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(std::size_t /*which*/, Mode /*mode*/, double /*t*/,
                                    const X& /*x*/, const D& dxdt) const
    {
        return dxdt[1];
    }
    template <class X>
    [[nodiscard]] Mode reset(std::size_t /*which*/, Mode /*mode*/, double /*t*/, X& x) const
    {
        x[1] = 0;
        return sticks;
    }
};

/// Rests from start / braking on.
[[nodiscard]] inline Task<SlidingBlock> sliding_block()
{
    return {.x0 = {0, sliding::start},
            .t_end = sliding::t_end,
            .events = {{sliding::start / sliding::braking, 0}}};
}

/// State (x, v, u), where u is the radius times the spin: of a solid ball u' = 5/2 braking while
/// it slides, until u = v.
struct RollingBall {
    using State = Three;
    enum : Mode { slides, rolls };
    static constexpr std::size_t mode_count = 2;
    static constexpr std::size_t guard_count = 1;

    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t /*which*/)
    {
        return {.degree = 1};
    }
    template <class T, class X>
    constexpr void flow(Mode mode, const T& /*t*/, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = mode == slides ? -sliding::braking : 0.0;
        dxdt[2] = mode == slides ? 2.5 * sliding::braking : 0.0;
    }
    template <class T, class X>
    [[nodiscard]] constexpr auto guard(std::size_t /*which*/, Mode mode, const T& /*t*/,
                                       const X& x) const
    {
        return mode == slides ? x[1] - x[2] + 0.0 : x[1] - x[2] + 1.0;
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(std::size_t /*which*/, Mode /*mode*/, double /*t*/,
                                    const X& /*x*/, const D& dxdt) const
    {
        return dxdt[1] - dxdt[2];
    }
    template <class X>
    [[nodiscard]] Mode reset(std::size_t /*which*/, Mode /*mode*/, double /*t*/, X& x) const
    {
        x[2] = x[1];
        return rolls;
    }
};

/// Rolls from 2/7 start / braking on.
[[nodiscard]] inline Task<RollingBall> rolling_ball()
{
    return {.x0 = {0, sliding::start, 0},
            .t_end = sliding::t_end,
            .events = {{2 * sliding::start / (7 * sliding::braking), 0}}};
}

/// Observes the steps of an engine: sliding ends with the first step after which the sliding speed
/// is below a millionth of the initial one. If a body slides again later, the end of that is
/// another event.
class EndOfSliding {
public:
    /// `speed` [m/s] of sliding at the end of the step that ends at t [s].
    template <class Answer>
    void see(double t, double speed, Answer& answer)
    {
        const bool now = std::abs(speed) > 1e-6 * sliding::start;
        if (slides_ && !now) answer.add(t, 0);
        slides_ = now;
    }

private:
    bool slides_ = true;
};

}  // namespace ricochet::report
