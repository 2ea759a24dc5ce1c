// The bouncing ball, the standard example of a hybrid system.
#pragma once

#include <array>
#include <optional>
#include <string_view>

#include "ricochet/guard.hpp"

namespace ricochet {

struct SystemDescriptor;

/// A point mass falling onto a rigid floor at height 0.
///
/// State x = (height u [m], velocity v [m/s]); one mode, one transition.
///
///     flow    x' = (v, -gravity)
///     guard   u, falling
///     reset   u⁺ = 0,  v⁺ = -restitution v⁻
///     rest    u = 0,   v = 0
///
/// (Saunders, Steyer and Kuether, SAND2023-06682C, eqs. 1 and 2.) For 0 <
/// restitution < 1 the impacts accumulate at `zeno_time`. Functions are generic
/// in the state and its scalar.
class BouncingBall {
public:
    using State = std::array<double, 2>;

    struct Parameters {
        double gravity = 9.81;     ///< [m/s²], positive
        double restitution = 0.9;  ///< Newton's coefficient, in [0, 1]
    };

    /// The source paper's ball.
    constexpr BouncingBall() = default;

    /// @throws std::invalid_argument if a parameter is outside its range.
    explicit BouncingBall(const Parameters& parameters);

    [[nodiscard]] double gravity() const noexcept { return gravity_; }
    [[nodiscard]] double restitution() const noexcept { return restitution_; }

    static constexpr std::string_view name = "bouncing-ball";
    /// Names, units, ranges and what is known; see descriptor.hpp.
    [[nodiscard]] static const SystemDescriptor& descriptor();

    /// The parameter of that name, for models that depend on it.
    [[nodiscard]] std::optional<double> parameter(std::string_view of) const noexcept
    {
        if (of == "gravity") return gravity_;
        if (of == "restitution") return restitution_;
        return std::nullopt;
    }

    /// The floor bounds the motion.
    static constexpr bool unilateral = true;

    template <class X>
    constexpr void flow(const ScalarOf<X>& /*t*/, const X& x, X& dxdt) const noexcept
    {
        dxdt[0] = x[1];
        dxdt[1] = -gravity_;
    }

    template <class X>
    [[nodiscard]] constexpr ScalarOf<X> guard(const ScalarOf<X>& /*t*/, const X& x) const noexcept
    {
        return x[0];
    }

    template <class X>
    constexpr void reset(const ScalarOf<X>& /*t*/, X& x) const noexcept
    {
        x[0] = 0;
        x[1] *= -restitution_;
    }

    /// After infinitely many impacts the ball lies on the floor.
    template <class X>
    constexpr void rest(const ScalarOf<X>& /*t*/, X& x) const noexcept
    {
        x[0] = 0;
        x[1] = 0;
    }

    /// Time [s] from `height` [m] >= 0 and `velocity` [m/s] to the first impact.
    [[nodiscard]] double first_impact(double height, double velocity = 0) const noexcept;

    /// Time [s] of impact n = 0, 1, 2, ... from the same start: each flight is
    /// `restitution` times the one before.
    [[nodiscard]] double impact_time(int n, double height, double velocity = 0) const noexcept;

    /// Limit [s] of the impact times; infinite for restitution 1.
    [[nodiscard]] double zeno_time(double height, double velocity = 0) const noexcept;

private:
    double gravity_ = Parameters{}.gravity;
    double restitution_ = Parameters{}.restitution;
};

}  // namespace ricochet
