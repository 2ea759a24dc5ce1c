// A ball in a closed cavern whose wall is a polygon of many segments.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "problems/geometry/segments.hpp"
#include "ricochet/guard.hpp"

namespace ricochet {

/// A ball flies through a cavern, with drag, while gravity turns slowly.
///
/// State x = (position [m], velocity [m/s]), two components each.
///
///     flow    p' = v,  v' = gravity (sin turn t, -cos turn t) - drag |v| v
///     guard   distance of the centre to the wall, positive inside, less the radius; falling
///     reset   with n the direction from the nearest point of the wall to the centre, the
///             velocity along the wall is kept and v.n becomes
///             max(-restitution v.n, min(kick, sqrt(top² - v_along²)))
///
/// The wall gives the ball a least speed of departure, the kick, so that it never comes to rest:
/// with a large kick it flies, with a small one it skims along the wall. It is never thrown faster
/// than `top_speed` = max(sqrt(gravity / drag), launch_speed). Above the first of these speeds drag
/// exceeds gravity, so no motion that starts below `top_speed` ever exceeds it.
///
/// *Bounds.* The distance to a set changes by at most 1 per unit of length. Along the flow
/// ||v|'| <= gravity + drag |v|², and with |v| <= top_speed at one time of a motion it
/// stays so.
///
/// The distance is exact, from a tree or from every segment in turn; both give the same
/// bits. Functions are generic in the state type.
class Cavern {
public:
    using State = std::array<double, 4>;

    enum class Search {
        tree,
        brute  ///< every segment
    };

    struct Parameters {
        std::size_t segments = 10'000;  ///< of the wall, at least 8
        std::uint64_t seed = 1;         ///< seed of the shape of the wall
        double size = 10;               ///< [m] mean distance of the wall from the origin
        double radius = 0.1;            ///< [m] of the ball, positive
        double gravity = 9.81;          ///< [m/s²], zero or positive
        double turn = 0.05;             ///< [rad/s] angular velocity of gravity's direction
        double drag = 0.1;              ///< [1/m], positive
        double restitution = 0.9;       ///< in [0, 1]
        double kick = 6;                ///< [m/s], zero or positive, at most top_speed
        double launch_speed = 5;        ///< [m/s], zero or positive
        Search search = Search::tree;
        std::size_t grid = 256;  ///< cells along a side of the table for `lower_bound`; 0: none
    };

    /// The same cavern with a ball that is barely lifted from its wall.
    [[nodiscard]] static Parameters skimming() { return {.kick = 0.5}; }

    Cavern() : Cavern(Parameters{}) {}

    /// A random cavern, star-shaped about the origin: a sum of waves, and stones of the
    /// size of a segment.
    /// @throws std::invalid_argument if a parameter is outside its range, or if the ball
    /// does not fit around the origin.
    explicit Cavern(const Parameters& parameters);

    /// Makes a cavern with this wall. `segments`, `seed` and `size` are not used.
    /// @throws std::invalid_argument also if the vertices are no polygon around the ball at
    /// the origin.
    Cavern(const Parameters& parameters, const std::vector<geometry::Point2>& wall);

    static constexpr std::string_view name = "cavern";
    static constexpr bool unilateral = true;

    /// Initial state: at the origin, moving to the right at the launch speed.
    [[nodiscard]] State start() const noexcept { return {0, 0, p_.launch_speed, 0}; }
    [[nodiscard]] double top_speed() const noexcept { return top_speed_; }
    [[nodiscard]] const Parameters& parameters() const noexcept { return p_; }

    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t /*which*/) noexcept
    {
        return {.name = "wall", .unilateral = true};
    }

    template <class X>
    void flow(double t, const X& x, X& dxdt) const noexcept
    {
        const double resistance = p_.drag * speed(x);
        dxdt[0] = x[2];
        dxdt[1] = x[3];
        dxdt[2] = p_.gravity * std::sin(p_.turn * t) - resistance * x[2];
        dxdt[3] = -p_.gravity * std::cos(p_.turn * t) - resistance * x[3];
    }

    template <class X>
    [[nodiscard]] double guard(double /*t*/, const X& x) const noexcept
    {
        return clearance(p_.search, {x[0], x[1]});
    }

    template <class X, class D>
    [[nodiscard]] double guard_rate(double /*t*/, const X& x, const D& dxdt) const noexcept
    {
        return geometry::dot(inward({x[0], x[1]}), {dxdt[0], dxdt[1]});
    }

    template <class X>
    void reset(double /*t*/, X& x) const noexcept
    {
        const geometry::Point2 v = rebound(inward({x[0], x[1]}), {x[2], x[3]});
        x[2] = v.x;
        x[3] = v.y;
    }

    [[nodiscard]] static constexpr double lipschitz() noexcept { return 1; }

    template <class X>
    [[nodiscard]] double speed_bound(double /*t*/, const X& x) const noexcept
    {
        return speed(x);
    }

    template <class X>
    [[nodiscard]] double acceleration_bound(double /*t*/, const X& x) const noexcept
    {
        const double fastest = std::max(top_speed_, speed(x));
        return p_.gravity + p_.drag * fastest * fastest;
    }

    /// From the table: 0.04 m below the guard at worst where the cavern is 10 m wide and the
    /// table has 512 cells along a side.
    template <class X>
    [[nodiscard]] double lower_bound(double /*t*/, const X& x) const noexcept
    {
        return tabulated({x[0], x[1]});
    }

    /// For certificates: the distance of the centres, and the rounding of the guard at positions
    /// within some ten times the extent of the wall.
    template <class X>
    [[nodiscard]] double guard_slack(const X& half_widths) const noexcept
    {
        return std::hypot(half_widths[0], half_widths[1]) + rounding();
    }

    /// The parameter with the given name, for models that depend on it. For a given wall, none of
    /// the parameters that would generate it.
    [[nodiscard]] std::optional<double> parameter(std::string_view of) const noexcept;

    /// The guard at a position, by either search.
    [[nodiscard]] double clearance(Search search, geometry::Point2 p) const noexcept;

private:
    struct Rock;

    template <class X>
    [[nodiscard]] static double speed(const X& x) noexcept
    {
        return std::sqrt(x[2] * x[2] + x[3] * x[3]);
    }

    Cavern(const Parameters& parameters, std::shared_ptr<const Rock> rock);

    [[nodiscard]] geometry::NearestOnSegment nearest(Search search,
                                                     geometry::Point2 p) const noexcept;
    [[nodiscard]] geometry::Point2 inward(geometry::Point2 p) const noexcept;
    [[nodiscard]] geometry::Point2 rebound(geometry::Point2 normal,
                                           geometry::Point2 v) const noexcept;
    [[nodiscard]] double tabulated(geometry::Point2 p) const noexcept;
    [[nodiscard]] double rounding() const noexcept;

    Parameters p_;
    bool given_ = false;  ///< whether the wall was given
    double top_speed_;
    std::shared_ptr<const Rock> rock_;
};

}  // namespace ricochet
