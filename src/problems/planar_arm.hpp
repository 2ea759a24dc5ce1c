// A planar robot arm among convex obstacles.
#pragma once

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

/// An arm of revolute joints, driven by torques, bounces off the obstacles around it.
///
/// State x = (joint angles q_1 ... q_n [rad], each relative to the link before, rates
/// w_1 ... w_n [rad/s]). The base is at the origin, all links are equally long.
///
///     flow    q_i' = w_i,
///             w_i' = drive_i sin(f_i t + p_i) - spring_i 2 y / (1 + y²) - damping w_i,
///             y = q_i - m_i
///     guard   least distance between the links and the obstacles, less the clearance; falling
///     reset   w⁺ = -restitution w⁻; if the fastest joint then turns slower than `least_rate`,
///             all rates are scaled up so that it turns at that rate
///
/// A link that enters an obstacle crosses its edge, so that the guard is minus the clearance
/// there.
///
/// *Bounds.* The path of the arm is that of its fastest point, which is the end of a link
/// (velocities are affine along a link, and the norm is convex); the guard changes by at most 1 per
/// unit of it. With |w_i'| <= reach_i + damping |w_i|, reach_i = drive_i + spring_i, a rate that is
/// once below top_i = reach_i / damping stays so. The end of link k accelerates by at most the sum
/// over links j <= k of l sqrt(theta_j''² + theta_j'⁴), with the absolute rates theta_j' = w_1 +
/// ... + w_j at their largest.
///
/// *Lower bound.* Each link is covered by discs; the distance of their centres to the obstacles
/// comes from a table of the workspace.
///
/// Functions are generic in the state type.
template <std::size_t N>
class PlanarArm;

/// Parts that do not depend on the number of joints.
class ArmScene {
public:
    enum class Search {
        tree,
        brute  ///< every edge for every link
    };

    struct Parameters {
        std::size_t obstacles = 40;  ///< octagons, 1 to 1000
        std::uint64_t seed = 1;      ///< of the obstacles and the torques
        double reach = 2;            ///< [m] length of the whole arm, positive
        double clearance = 0.02;     ///< [m] positive
        double drive = 3;            ///< [rad/s²] largest torque over inertia, positive
        double damping = 4;          ///< [1/s] positive
        double restitution = 0.8;    ///< in [0, 1]
        double least_rate =
            0.3;  ///< [rad/s] after an impact, positive, at most 0.8 drive / damping
        Search search = Search::tree;
        std::size_t grid = 512;  ///< cells along a side of the table for `lower_bound`; 0: none
        std::size_t discs = 6;   ///< for each link, 1 to 64
    };

    static constexpr std::size_t most_joints = 8;

    /// @throws std::invalid_argument if a parameter is outside its range.
    ArmScene(const Parameters& parameters, std::size_t joints);

    /// Uses these obstacles, polygons that are not nested, in place of the random ones.
    /// @throws std::invalid_argument also for an obstacle that is no polygon, or that is closer
    /// to the arm at its start than the clearance, by number.
    ArmScene(const Parameters& parameters, std::size_t joints,
             const std::vector<std::vector<geometry::Point2>>& obstacles);

    [[nodiscard]] const Parameters& parameters() const noexcept { return p_; }

    /// Joint angles at the start.
    [[nodiscard]] double start_angle(std::size_t joint) const noexcept
    {
        return joints_[joint].middle;
    }

    /// Drives of all joints, drive sin(f t + p) [rad/s²]. The last ones are kept: the stages of a
    /// step share two.
    [[nodiscard]] std::array<double, most_joints> torques(double t) const noexcept;

    /// @param torque  torque over inertia of the joint at this time
    [[nodiscard]] double acceleration(std::size_t joint, double torque, double q,
                                      double w) const noexcept
    {
        const Joint& j = joints_[joint];
        const double y = q - j.middle;
        return torque - j.spring * 2 * y / (1 + y * y) - p_.damping * w;
    }

    /// Points with which the arm and the nearest obstacle touch.
    struct Contact {
        double distance = 0;      ///< [m]
        std::uint32_t link = 0;   ///< index of the nearest link
        geometry::Point2 point;   ///< nearest point of that link
        geometry::Point2 normal;  ///< from the obstacle to it, of unit length
    };

    /// @param angles  one entry for each joint
    [[nodiscard]] Contact contact(Search search, const double* angles) const noexcept;

    /// Velocity of a point of a link [m/s].
    [[nodiscard]] geometry::Point2 velocity(const double* angles, const double* rates,
                                            std::uint32_t link,
                                            geometry::Point2 point) const noexcept;

    /// Largest speed [m/s] of the ends of the links.
    [[nodiscard]] double largest_speed(const double* angles, const double* rates) const noexcept;
    [[nodiscard]] double largest_acceleration(const double* rates) const noexcept;
    [[nodiscard]] double lower_bound(const double* angles) const noexcept;

    /// How far a point of the arm can move if no angle changes by more than its half-width: each
    /// joint turns the part beyond it. The rounding of the distance is included.
    [[nodiscard]] double slack(const double* half_widths) const noexcept;

    /// The parameter with the given name, for models that depend on it. For given obstacles, none
    /// of the parameters that would generate them.
    [[nodiscard]] std::optional<double> parameter(std::string_view of) const noexcept;

    /// Factor by which an impact multiplies all rates.
    [[nodiscard]] double reversal(const double* rates) const noexcept;

private:
    struct Joint {
        double middle, drive, spring, frequency, phase;
    };
    struct Place;

    /// A lower bound of the distance of a link to the obstacles, from the table.
    [[nodiscard]] double lower_bound_of(const geometry::Segment2& link) const noexcept;

    void check() const;
    void choose_joints();
    void place(const std::vector<std::vector<geometry::Point2>>& obstacles);

    Parameters p_;
    std::size_t n_;
    double link_;         ///< [m] length
    bool given_ = false;  ///< whether the obstacles were given
    std::array<Joint, most_joints> joints_{};
    std::shared_ptr<const Place> place_;
};

template <std::size_t N>
class PlanarArm {
    static_assert(N >= 1 && N <= ArmScene::most_joints, "PlanarArm: 1 to 8 joints");

public:
    using State = std::array<double, 2 * N>;
    using Parameters = ArmScene::Parameters;
    using Search = ArmScene::Search;

    PlanarArm() : PlanarArm(Parameters{}) {}
    /// @throws std::invalid_argument, as `ArmScene`.
    explicit PlanarArm(const Parameters& parameters) : scene_(parameters, N) {}
    PlanarArm(const Parameters& parameters,
              const std::vector<std::vector<geometry::Point2>>& obstacles)
        : scene_(parameters, N, obstacles)
    {
    }

    static constexpr std::string_view name = "arm";
    static constexpr bool unilateral = true;

    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t /*which*/) noexcept
    {
        return {.name = "obstacle", .unilateral = true};
    }

    /// Initial state: at rest, folded around the base.
    [[nodiscard]] State start() const noexcept
    {
        State x{};
        for (std::size_t i = 0; i < N; ++i) x[i] = scene_.start_angle(i);
        return x;
    }

    [[nodiscard]] const ArmScene& scene() const noexcept { return scene_; }

    template <class X>
    void flow(double t, const X& x, X& dxdt) const noexcept
    {
        const auto torques = scene_.torques(t);
        for (std::size_t i = 0; i < N; ++i) {
            dxdt[i] = x[N + i];
            dxdt[N + i] = scene_.acceleration(i, torques[i], x[i], x[N + i]);
        }
    }

    template <class X>
    [[nodiscard]] double guard(double /*t*/, const X& x) const noexcept
    {
        return clearance(scene_.parameters().search, x);
    }

    template <class X, class D>
    [[nodiscard]] double guard_rate(double /*t*/, const X& x, const D& dxdt) const noexcept
    {
        const auto q = part(x, 0);
        const ArmScene::Contact at = scene_.contact(scene_.parameters().search, q.data());
        return dot(at.normal, scene_.velocity(q.data(), part(dxdt, 0).data(), at.link, at.point));
    }

    template <class X>
    void reset(double /*t*/, X& x) const noexcept
    {
        const double factor = scene_.reversal(part(x, N).data());
        for (std::size_t i = 0; i < N; ++i) x[N + i] *= factor;
    }

    [[nodiscard]] static constexpr double lipschitz() noexcept { return 1; }

    template <class X>
    [[nodiscard]] double speed_bound(double /*t*/, const X& x) const noexcept
    {
        return scene_.largest_speed(part(x, 0).data(), part(x, N).data());
    }

    template <class X>
    [[nodiscard]] double acceleration_bound(double /*t*/, const X& x) const noexcept
    {
        return scene_.largest_acceleration(part(x, N).data());
    }

    template <class X>
    [[nodiscard]] double lower_bound(double /*t*/, const X& x) const noexcept
    {
        return scene_.lower_bound(part(x, 0).data());
    }

    /// For certificates; see `ArmScene::slack`.
    template <class X>
    [[nodiscard]] double guard_slack(const X& half_widths) const noexcept
    {
        return scene_.slack(part(half_widths, 0).data());
    }
    [[nodiscard]] std::optional<double> parameter(std::string_view of) const noexcept
    {
        return scene_.parameter(of);
    }

    /// The guard by either search.
    template <class X>
    [[nodiscard]] double clearance(Search search, const X& x) const noexcept
    {
        return scene_.contact(search, part(x, 0).data()).distance - scene_.parameters().clearance;
    }

private:
    template <class X>
    [[nodiscard]] static std::array<double, N> part(const X& x, std::size_t from) noexcept
    {
        std::array<double, N> out;
        for (std::size_t i = 0; i < N; ++i) out[i] = x[from + i];
        return out;
    }

    ArmScene scene_;
};

}  // namespace ricochet
