// The definition of a group of bodies in lasting contact, and the results of its steps.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "scene/arcs.hpp"

namespace ricochet::detail {

struct IslandBody {
    std::uint32_t id = 0;        ///< the scene's; islands of the same bodies have the same bits
                                 ///< whatever the ids
    std::array<double, 2> at{};  ///< [m] centre
    std::array<double, 2> velocity{};  ///< [m/s]
    double mass = 1;                   ///< [kg]
    double radius = 0;                 ///< [m]
    double drag = 0;                   ///< [kg/s]
    double inertia = 0;                ///< [kg m^2] about the centre, 0 where it does not turn
    double spin = 0;                   ///< [rad/s] counterclockwise
    std::uint32_t material = 0;
    std::uint32_t patience = 1;  ///< steps without contact after which it is handed back
};

/// Motion of a wall, without rotation.
struct WallMotion {
    std::function<std::array<double, 2>(double t)> displacement;  ///< [m]
    /// Time until which the wall stands still if it does at t; t where it moves.
    std::function<double(double t)> still_until;
    /// Time of the next jump of its velocity after t, infinite if there is none. May be empty.
    std::function<double(double t)> next_break{};
};

/// A line that bounds bodies on one side, or a segment or an arc that acts on both, including its
/// ends.
struct IslandWall {
    std::uint32_t id = 0;
    bool is_segment = false;
    std::array<double, 2> point{};   ///< [m] of the line, start of the segment, centre of the arc
    std::array<double, 2> normal{};  ///< of the line, of length 1
    std::array<double, 2> end{};     ///< [m] of the segment
    double radius = 0;               ///< [m] of the arc, 0 for others
    ArcSpan span{};                  ///< of the arc
    std::uint32_t material = 0;
    const WallMotion* motion = nullptr;  ///< outlives the island
};

struct IslandSpring {
    std::uint32_t first = 0, second = 0;  ///< ids of bodies
    double rest = 0, stiffness = 0, damping = 0;
};

/// Coefficients for a pair of materials.
struct ContactCoefficients {
    double restitution = 0;
    double friction = 0;
};

struct IslandSetup {
    std::vector<IslandBody> bodies{};
    std::vector<IslandWall> walls{};
    std::vector<IslandSpring> springs{};
    std::array<double, 2> gravity{};
    std::function<ContactCoefficients(std::uint32_t, std::uint32_t)> coefficients{};
};

struct IslandOptions {
    double step = 1e-3;             ///< [s]
    double tolerance = 1e-10;       ///< of the contact law, as a fraction
    double largest_defect = 1e-7;   ///< of a problem in which bodies are wedged, as a fraction
    double sleep_speed = 0;         ///< [m/s] islands slower than this for `sleep_after` sleep
    double sleep_after = 0.5;       ///< [s]
    bool estimate_error = false;    ///< takes every step of `advance` by halves, too
    double largest_overlap = 1e-6;  ///< of a start, as a fraction of the coordinates
    bool crowded = false;  ///< impacts that would rebound are part of the steps, see ContactIsland
};

/// A gap no larger than this fraction of the coordinates is closed.
inline constexpr double closed_gap = 1e-12;

enum class IslandOutcome {
    reached,        ///< the requested time
    asleep,         ///< at rest until struck or woken: its time is the requested one
    released,       ///< no contact for `patience` steps: it must be handed back
    impact,         ///< two of `arrivals` meet at a speed from which they would rebound
    not_converged,  ///< the contact law was not solved, see `failure`
    non_finite,
};

/// A contact of the last step.
struct IslandContact {
    std::uint32_t first = 0;  ///< id of the body that the normal pushes
    bool with_wall = false;
    std::uint32_t second = 0;  ///< id of the other body or wall
    std::array<double, 2> normal{};
    double gap = 0;                   ///< [m] where the step began
    std::array<double, 2> impulse{};  ///< [N s] normal and tangential
};

/// Backoff of a body that is handed over at `t` and was handed back at `released_at`: it doubles
/// where that was within ten steps, so that a body does not alternate for long.
[[nodiscard]] constexpr std::uint32_t next_patience(std::uint32_t patience, double released_at,
                                                    double t, double step) noexcept
{
    const bool at_once = t - released_at < 10 * step;
    return !at_once ? 1 : patience < (1U << 20) ? 2 * patience : patience;
}

}  // namespace ricochet::detail
