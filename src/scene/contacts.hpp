// Bodies in lasting contact: groups that advance by steps of their own.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "scene/lasting.hpp"
#include "scene/world.hpp"

namespace ricochet::detail {

/// Gaps, relative to the coordinates, that the steps of groups in contact leave.
inline constexpr double loose = 1e-10;

/// Groups in lasting contact. In a step of its group a body moves on the straight line of its
/// record; its velocity changes along it (`World::drifts`).
class Contacts {
public:
    explicit Contacts(World& world) : world_(world) {}

    [[nodiscard]] bool available() const noexcept { return world_.options.contacts != nullptr; }

    /// These bodies and all that are joined with them, by a group or by springs, in ascending
    /// order.
    [[nodiscard]] std::vector<std::uint32_t> closure(
        const std::vector<std::uint32_t>& bodies) const;

    /// Makes a group of `members`, a closure, which meets `faces`; their previous groups are
    /// removed. Returns its number. @throws std::invalid_argument where bodies overlap
    std::uint32_t join(std::vector<std::uint32_t> members, std::vector<std::uint32_t> faces,
                       const std::vector<std::uint32_t>& patience, const Instant& now,
                       bool crowded = false);

    /// Plans the next step; its members get new records.
    IslandOutcome plan(std::uint32_t group, const Instant& now, const Instant& t_end);
    /// Advances to `now` in the planned step; the group then needs another plan.
    void commit(std::uint32_t group, const Instant& now);
    void set_velocity(std::uint32_t group, std::uint32_t body, const Vector2& v)
    {
        groups_[group]->motion->set_velocity(body, v);
    }
    void set_spin(std::uint32_t group, std::uint32_t body, double spin)
    {
        groups_[group]->motion->set_spin(body, spin);
    }
    /// Counts an impact that cuts a step of a group; true where it makes it a crowd.
    bool crowds(std::uint32_t group, const Instant& now);
    /// Whether a crowd is still one after another step.
    bool stays_crowded(std::uint32_t group);
    /// Removes a group: its members fly on from their records.
    void dissolve(std::uint32_t group, const Instant& now);

    struct Group {
        std::unique_ptr<LastingContact> motion;
        std::vector<std::uint32_t> members;
        std::vector<std::uint32_t> faces;                    ///< those that the group itself meets
        std::vector<std::unique_ptr<WallMotion>> motions{};  ///< of the faces that move
        Instant start{}, end{};
        double length = 0;  ///< [s] from start to end
        IslandOutcome outcome = IslandOutcome::reached;
        bool planned = false;
        std::uint32_t apart = 0;     ///< steps in which it has been several groups
        bool crowded = false;        ///< impacts among its bodies are part of its steps
        Instant counted{-never, 0};  ///< start of the step in which its cuts are counted
        std::uint32_t cuts = 0;      ///< of its steps, by impacts and by bodies that join
        std::uint32_t rebounds = 0;  ///< in the planned step of a crowd
        std::uint32_t calm = 0;      ///< steps of a crowd with few rebounds
    };
    [[nodiscard]] bool exists(std::uint32_t group) const
    {
        return group < groups_.size() && groups_[group];
    }
    [[nodiscard]] Group& operator[](std::uint32_t group) { return *groups_[group]; }
    [[nodiscard]] const Group& operator[](std::uint32_t group) const { return *groups_[group]; }
    [[nodiscard]] bool knows(std::uint32_t group, std::uint32_t face) const;

private:
    [[nodiscard]] IslandSetup setup_of(const std::vector<std::uint32_t>& members,
                                       const std::vector<std::uint32_t>& faces) const;
    void set_motions(IslandSetup& setup, Group& group, const Instant& now) const;
    [[nodiscard]] double largest_overlap(const Group& group) const;
    void plan_turn(std::uint32_t i, const Group& group, double step);
    static void leave_crowd(Group& group);

    World& world_;
    std::vector<std::unique_ptr<Group>> groups_;
};

}  // namespace ricochet::detail
