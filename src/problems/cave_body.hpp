// A rigid body that tumbles through a cave: mesh against mesh.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string_view>

#include "problems/geometry/mesh.hpp"
#include "problems/geometry/triangles.hpp"
#include "ricochet/guard.hpp"

namespace ricochet {

/// A rigid body of unit mass flies and turns in a closed cave, with drag, while gravity
/// turns slowly.
///
/// State x = (position p [m], attitude as a quaternion (scalar first), velocity v [m/s],
/// angular velocity w [rad/s]), 13 components in the axes of the cave. The moment of inertia is the
/// same about every axis, gyration² [m²]. The quaternion need not have unit length.
///
///     flow    p' = v,  q' = (0, w) q / 2,  v' = gravity (sin turn t, 0, -cos turn t) - drag |v| v,
///             w' = -spin_drag w
///     guard   least distance between the surfaces, less the clearance; falling
///     reset   an impulse along the direction n between the nearest points, after which
///             these part at the speed max(-restitution u, kick), u their relative speed before
///
/// Where the surfaces cross, the guard is minus the clearance.
///
/// *Bounds.* The point r of the body, |r| <= R, R the distance of the farthest from p, moves with
/// v + w x r, and w x r is a vector of at most R |w| at a right angle to w: no point is faster than
/// the root of u² + (s + R |w|)², u and s the parts of v along w and across it. Until the next
/// impact |v| <= max(|v|, sqrt(gravity / drag)) and |w| falls, so that this speed changes by at
/// most gravity + drag |v|² + R spin_drag |w|.
///
/// *Lower bound.* The body is covered by balls; the distance of their centres to the cave comes
/// from a table.
///
/// Functions are generic in the state type.
class CaveBody {
public:
    using State = std::array<double, 13>;

    enum class Search {
        tree,
        brute  ///< every face against every face: tens of millions of pairs
    };

    struct Parameters {
        int cave_refinements = 5;  ///< the cave has 20 * 4^n faces, n in [0, 7]
        int body_refinements = 3;  ///< the body has 20 * 4^n faces
        double cave_size = 5;      ///< [m] mean distance of the cave from the origin
        double body_size = 0.5;    ///< [m] mean distance of the body from its centre
        double clearance = 0.02;   ///< [m] positive
        double gravity = 9.81;     ///< [m/s²] zero or positive
        double turn = 0.05;        ///< [rad/s] of gravity
        double drag = 0.1;         ///< [1/m] positive
        double spin_drag = 0.2;    ///< [1/s] zero or positive
        double gyration = 0.3;     ///< [m] radius, positive
        double restitution = 0.9;  ///< in [0, 1]
        double kick = 4;           ///< [m/s] least speed of parting, zero or positive
        Search search = Search::tree;
        std::size_t grid = 64;   ///< cells along a side of the table for `lower_bound`; 0: none
        std::size_t balls = 96;  ///< largest number of balls that cover the body; positive
    };

    /// A bumpy cave and a bumpy body; 20 480 and 1 280 faces.
    CaveBody() : CaveBody(Parameters{}) {}

    /// @throws std::invalid_argument if a parameter is outside its range, or if the body
    /// touches the cave at the start.
    explicit CaveBody(const Parameters& parameters);

    /// Uses these meshes, not refinements and sizes. The body starts at its given position.
    /// @throws std::invalid_argument also for a mesh that is empty, open or has a
    /// coordinate that is not a number, naming the face, and for a body that is not inside of the
    /// cave.
    CaveBody(const Parameters& parameters, const geometry::Mesh& cave, const geometry::Mesh& body);

    /// The bumpy meshes of these parameters.
    [[nodiscard]] static geometry::Mesh cave_of(const Parameters& parameters);
    [[nodiscard]] static geometry::Mesh body_of(const Parameters& parameters);

    static constexpr std::string_view name = "cave-body";
    static constexpr bool unilateral = true;

    /// Initial state: at the origin, moving and rotating.
    [[nodiscard]] static State start() noexcept
    {
        return {0, 0, 0, 1, 0, 0, 0, 3, 1, 0, 0.5, 1, 0.3};
    }

    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t /*which*/) noexcept
    {
        return {.name = "cave", .unilateral = true};
    }

    template <class X>
    void flow(double t, const X& x, X& dxdt) const noexcept
    {
        const double resistance = p_.drag * norm(x, 7);
        for (std::size_t k = 0; k < 3; ++k) {
            dxdt[k] = x[7 + k];
            dxdt[7 + k] = -resistance * x[7 + k];
            dxdt[10 + k] = -p_.spin_drag * x[10 + k];
        }
        dxdt[7] += p_.gravity * std::sin(p_.turn * t);
        dxdt[9] -= p_.gravity * std::cos(p_.turn * t);
        dxdt[3] = -0.5 * (x[10] * x[4] + x[11] * x[5] + x[12] * x[6]);
        dxdt[4] = 0.5 * (x[10] * x[3] + x[11] * x[6] - x[12] * x[5]);
        dxdt[5] = 0.5 * (x[11] * x[3] + x[12] * x[4] - x[10] * x[6]);
        dxdt[6] = 0.5 * (x[12] * x[3] + x[10] * x[5] - x[11] * x[4]);
    }

    template <class X>
    [[nodiscard]] double guard(double /*t*/, const X& x) const noexcept
    {
        return clearance(p_.search, attitude(x));
    }

    template <class X, class D>
    [[nodiscard]] double guard_rate(double /*t*/, const X& x, const D& dxdt) const noexcept
    {
        return parting_speed(attitude(x), {dxdt[0], dxdt[1], dxdt[2], x[10], x[11], x[12]});
    }

    template <class X>
    void reset(double /*t*/, X& x) const noexcept
    {
        const Motion after = rebound(attitude(x), {x[7], x[8], x[9], x[10], x[11], x[12]});
        for (std::size_t k = 0; k < 6; ++k) x[7 + k] = after[k];
    }

    [[nodiscard]] static constexpr double lipschitz() noexcept { return 1; }

    template <class X>
    [[nodiscard]] double speed_bound(double /*t*/, const X& x) const noexcept
    {
        const double v = norm(x, 7);
        const double w = norm(x, 10);
        const double along = w > 0 ? (x[7] * x[10] + x[8] * x[11] + x[9] * x[12]) / w : v;
        const double across = std::sqrt(std::fmax(v * v - along * along, 0)) + farthest_ * w;
        // Rounding of the two parts of v is far below 1e-12 of it.
        return (1 + 1e-12) * std::sqrt(along * along + across * across);
    }

    template <class X>
    [[nodiscard]] double acceleration_bound(double /*t*/, const X& x) const noexcept
    {
        const double v = norm(x, 7);
        return p_.gravity + std::fmax(p_.drag * v * v, p_.gravity) +
               farthest_ * p_.spin_drag * norm(x, 10);
    }

    template <class X>
    [[nodiscard]] double lower_bound(double /*t*/, const X& x) const noexcept
    {
        return tabulated(attitude(x));
    }

    /// Position and quaternion.
    using Attitude = std::array<double, 7>;

    /// The guard by either search.
    [[nodiscard]] double clearance(Search search, const Attitude& at) const noexcept;

private:
    using Motion = std::array<double, 6>;  ///< velocity and angular velocity
    struct Shapes;

    template <class X>
    [[nodiscard]] static double norm(const X& x, std::size_t k) noexcept
    {
        return std::sqrt(x[k] * x[k] + x[k + 1] * x[k + 1] + x[k + 2] * x[k + 2]);
    }
    template <class X>
    [[nodiscard]] static Attitude attitude(const X& x) noexcept
    {
        return {x[0], x[1], x[2], x[3], x[4], x[5], x[6]};
    }

    [[nodiscard]] geometry::NearestFaces nearest(Search search, const Attitude& at) const noexcept;
    [[nodiscard]] double parting_speed(const Attitude& at, const Motion& motion) const noexcept;
    [[nodiscard]] Motion rebound(const Attitude& at, const Motion& motion) const noexcept;
    [[nodiscard]] double tabulated(const Attitude& at) const noexcept;

    Parameters p_;
    double farthest_ = 0;  ///< [m] R
    std::shared_ptr<const Shapes> shapes_;
};

}  // namespace ricochet
