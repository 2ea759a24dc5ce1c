// Interfaces between the loop of a scene and the separate library that makes and advances groups of
// bodies in lasting contact.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "scene/contact_setup.hpp"

namespace ricochet::detail {

/// A group of bodies in lasting contact.
class LastingContact {
public:
    LastingContact() = default;
    virtual ~LastingContact() = default;
    LastingContact(const LastingContact&) = delete;
    LastingContact& operator=(const LastingContact&) = delete;

    /// The next step, no longer than `longest`. The plan moves nothing.
    struct Plan {
        IslandOutcome outcome = IslandOutcome::reached;
        double length = 0;           ///< [s] until it ends, or an arrival ends it
        double step = 0;             ///< [s] in which velocities change to those of the chords
        double defect = 0;           ///< of the contact law, as a fraction
        double wakes = 0;            ///< [s] until a wall begins to move, infinite if none does
        std::uint32_t rebounds = 0;  ///< contacts of a crowd that rebound at its end
    };
    virtual Plan plan(double longest) = 0;
    /// Advances by s seconds in the planned step.
    virtual void commit(double s) = 0;
    /// Velocity [m/s] of the straight line of a body in the planned step.
    [[nodiscard]] virtual std::array<double, 2> chord(std::uint32_t id) const = 0;
    /// [rad/s] Rate of the angle of a body in the planned step.
    [[nodiscard]] virtual double chord_spin(std::uint32_t id) const = 0;
    [[nodiscard]] virtual IslandBody body(std::uint32_t id) const = 0;
    virtual void set_crowded(bool crowded) = 0;
    virtual void set_velocity(std::uint32_t id, const std::array<double, 2>& velocity) = 0;
    virtual void set_spin(std::uint32_t id, double spin) = 0;
    /// Bodies grouped by springs and by contacts that push.
    [[nodiscard]] virtual std::vector<std::vector<std::uint32_t>> groups() const = 0;
    /// Contacts that pushed in the last step.
    [[nodiscard]] virtual std::vector<IslandContact> contacts() const = 0;
    /// Contacts that meet at the end of a step whose outcome is `impact`.
    [[nodiscard]] virtual std::vector<IslandContact> arrivals() const = 0;
    /// Why a step was not solved, in a clause.
    [[nodiscard]] virtual std::string failure() const = 0;
};

}  // namespace ricochet::detail

namespace ricochet {

/// Maker of groups in lasting contact.
class SceneContacts {
public:
    SceneContacts() = default;
    virtual ~SceneContacts() = default;
    SceneContacts(const SceneContacts&) = delete;
    SceneContacts& operator=(const SceneContacts&) = delete;

    /// @throws std::invalid_argument for bodies that overlap
    [[nodiscard]] virtual std::unique_ptr<detail::LastingContact> make(
        detail::IslandSetup setup, const detail::IslandOptions& options) const = 0;
};

}  // namespace ricochet
