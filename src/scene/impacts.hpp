// Impacts of one cluster: contacts that are struck at one instant, or touch a body that is.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "scene/world.hpp"

namespace ricochet::detail {

struct Contact {
    std::uint32_t a = 0;  ///< body that the normal pushes
    std::uint32_t b = 0;  ///< body or face
    bool surface = false;
    std::uint32_t slot_a = 0, slot_b = 0;  ///< in the cluster
    Vector2 normal{};
    Vector2 at{};     ///< place by which contacts are ordered, independent of the labels
    double blur = 0;  ///< [rad] rounding of the normal
    double restitution = 1;
    double friction = 0;
    double impulse = 0;  ///< of the current solve, normal and tangential
    double tangential = 0;
    double target = 0;  ///< [m/s] required separation
    double mass = 0;    ///< effective, along the normal and across
    double tangential_mass = 0;
    bool moving = false;         ///< whether its surface moves
    bool by_speed = false;       ///< whether restitution depends on the speed of approach
    bool thermal = false;        ///< whether its surface is
    Vector2 surface_velocity{};  ///< [m/s]
};

/// Velocity of body a relative to the body or face that it touches; `v` are the cluster's
/// velocities.
[[nodiscard]] inline Vector2 relative_velocity(const std::vector<Vector2>& v,
                                               const Contact& contact)
{
    if (!contact.surface) return v[contact.slot_a] - v[contact.slot_b];
    return contact.moving ? v[contact.slot_a] - contact.surface_velocity : v[contact.slot_a];
}

/// Effect of a push of one body of a system on another one, or on itself; of a plate on itself.
struct Coupling {
    std::uint32_t of = 0, by = 0;      ///< slots
    std::array<Vector2, 2> changes{};  ///< [1/kg] of the velocity, by impulses along x and y

    [[nodiscard]] Vector2 times(const Vector2& impulse) const noexcept
    {
        return impulse[0] * changes[0] + impulse[1] * changes[1];
    }
};

/// The spin of a body of a cluster.
struct TurningBody {
    double spin = 0;             ///< [rad/s]
    double inverse_inertia = 0;  ///< [1/(kg m^2)]
    double radius = 0;           ///< [m]
    double before = 0;           ///< [rad/s] the spin before
};

struct Cluster {
    std::vector<std::uint32_t> bodies;
    std::vector<Vector2> before;  ///< velocities
    std::vector<Vector2> after;
    std::vector<Contact> contacts;
    std::vector<std::vector<Side>> sides;  ///< of bodies that are points
    std::vector<Coupling> couplings;       ///< of systems and plates
    std::vector<Vector2> impulses;         ///< the same, on each body
    double fastest = 0;                    ///< [m/s] the largest speed before
    std::vector<TurningBody> turning;      ///< of bodies, where a disc turns
    bool lasting = false;                  ///< whether one of the bodies is in lasting contact

    /// Whether the spin of a body has changed.
    [[nodiscard]] bool turned(std::size_t slot) const noexcept
    {
        return !turning.empty() && turning[slot].spin != turning[slot].before;
    }

    void clear()
    {
        bodies.clear();
        before.clear();
        after.clear();
        contacts.clear();
        sides.clear();
        couplings.clear();
        impulses.clear();
        turning.clear();
    }
};

/// Resolves the impacts of a cluster: `after` from `before`. The contacts struck are appended to
/// `events`, in the order of the waves, if it is not null.
class Impacts {
public:
    explicit Impacts(World& world) : world_(world) {}

    /// Applies Newton's law by waves, or to all contacts together. Restitution is set to 0 if the
    /// waves do not terminate, and from the start if `spend`. In a cluster with lasting contact the
    /// waves stop earlier, with contacts that still approach. Returns whether they did so.
    bool resolve(Cluster& cluster, double t, bool spend, std::vector<SceneEvent>* events);

private:
    [[nodiscard]] double approach(const Cluster& cluster, const Contact& contact) const;
    [[nodiscard]] double noise(const Cluster& cluster, const Contact& contact) const;
    [[nodiscard]] static double unrecorded(const Cluster& cluster, const Contact& contact);
    void push(Cluster& cluster, const Contact& contact, const Vector2& impulse) const;
    void push_coupled(Cluster& cluster, const Contact& contact, const Vector2& impulse) const;
    void set_masses(Cluster& cluster) const;
    static void set_masses_of_edges(Cluster& cluster);
    [[nodiscard]] static double slip(const Cluster& cluster, const Contact& contact);
    static void turn(Cluster& cluster, const Contact& contact, double tangential);
    void strike(Cluster& cluster, Contact& contact);
    [[nodiscard]] static bool rounds_alike(const Cluster& cluster, const Contact& contact);
    void undo_gain(Cluster& cluster, Contact& contact, double u);
    void strike_thermal(Cluster& cluster, Contact& contact) const;
    [[nodiscard]] bool apply_laws(Cluster& cluster);
    void solve(Cluster& cluster) const;
    void solve_without_gain(Cluster& cluster);
    [[nodiscard]] double kinetic_energy(const Cluster& cluster) const;
    [[nodiscard]] double work_of_surfaces(const Cluster& cluster) const;
    [[nodiscard]] double size_of_works(const Cluster& cluster) const;
    bool solve_exactly(Cluster& cluster) const;
    bool sweep(Cluster& cluster, double smallest, int most) const;
    void stop_slow(Cluster& cluster) const;
    bool wave(Cluster& cluster);
    void emit(const Cluster& cluster, double t, std::vector<SceneEvent>* events);

    World& world_;
    double t_ = 0;                       ///< [s] of the cluster
    std::vector<std::uint32_t> struck_;  ///< contacts of the current wave
    std::vector<Vector2> before_wave_;
    std::vector<Vector2> impulses_before_;
    double gained_ = 0;  ///< [J] by rounding in impacts that round alike, to be undone
};

}  // namespace ricochet::detail
