// Contents of a scene: discs, points and plates, walls, terrain and arcs, springs, gravity and
// drag.
//
// A `Scene` holds and validates the description; `simulate` (scene/simulate.hpp) runs it. The plane
// is vertical with gravity, horizontal without. Discs turn if they have an inertia;
// at others friction acts at the centre.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <variant>
#include <vector>

namespace ricochet {

// Prescribed motions of surfaces: translations as functions of time, with bounds from which a run
// proves that it misses no contact.
//
// A surface is translated, without rotation, from the position in its description. It pushes the
// bodies that it meets; bodies do not affect its motion.

/// A surface that stays where it is described.
struct Fixed {};

/// displacement(t) = amplitude sin(2 pi frequency t + phase)
struct Oscillation {
    std::array<double, 2> amplitude{};  ///< [m]
    double frequency = 1;               ///< [Hz], positive
    double phase = 0;                   ///< [rad]
};

/// displacement(t) = velocity (t - since) for all t, including t < since
struct ConstantVelocity {
    std::array<double, 2> velocity{};  ///< [m/s]
    double since = 0;                  ///< [s] time of zero displacement
};

/// Linear interpolation between displacements at given times; at rest before the first and after
/// the last of them. At a time where the velocity changes, the later velocity applies.
struct PiecewiseLinear {
    std::vector<double> times{};                         ///< [s] strictly ascending, at least one
    std::vector<std::array<double, 2>> displacements{};  ///< [m] one for each time
};

/// Motion given by functions without side effects. The velocity must be the derivative of the
/// displacement and continuous. If a bound is found to be violated between two evaluations, the run
/// ends with `Outcome::wrong_bound`; a violation that is not detected may cause a missed contact.
struct GivenMotion {
    std::function<std::array<double, 2>(double t)> displacement{};         ///< [m]
    std::function<std::array<double, 2>(double t)> velocity{};             ///< [m/s]
    double acceleration_bound = std::numeric_limits<double>::quiet_NaN();  ///< [m/s^2] required
    double speed_bound = std::numeric_limits<double>::infinity();          ///< [m/s] optional
    double reach = std::numeric_limits<double>::infinity();  ///< [m] of |displacement|, optional
};

using SurfaceMotion =
    std::variant<Fixed, Oscillation, ConstantVelocity, PiecewiseLinear, GivenMotion>;

/// Displacement [m] and velocity [m/s] of a surface at the time t [s].
[[nodiscard]] std::array<double, 2> displacement(const SurfaceMotion& motion, double t);
[[nodiscard]] std::array<double, 2> velocity(const SurfaceMotion& motion, double t);

/// (x, y)
using Vector2 = std::array<double, 2>;

/// Handle of a material. Handles are given out by a scene, and valid for that scene.
struct MaterialId {
    std::uint32_t index = 0;
    friend bool operator==(MaterialId, MaterialId) = default;
};
/// Handle of a disc, a point or a plate.
struct BodyId {
    std::uint32_t index = 0;
    friend bool operator==(BodyId, BodyId) = default;
};
/// Handle of a wall, of terrain or of an arc.
struct SurfaceId {
    std::uint32_t index = 0;
    friend bool operator==(SurfaceId, SurfaceId) = default;
};

/// Handle of a system.
struct SystemId {
    std::uint32_t index = 0;
    friend bool operator==(SystemId, SystemId) = default;
};

namespace detail {
class SceneSystem;
}

/// Restitution that falls with the speed of approach v up to `speed`, and is constant above it:
/// e(v) = 1 - (1 - e) (v / speed)^exponent, with the e of the material or pair. The exponent is 1/5
/// for viscoelastic spheres to leading order (R. Ramirez et al., Coefficient of restitution of
/// colliding viscoelastic spheres, Physical Review E 60, 1999), and 3/4 in models of shaken grains.
struct PowerOfSpeed {
    double speed = 1;        ///< [m/s] positive
    double exponent = 0.75;  ///< positive
};

/// Restitutions at given speeds of approach, linear between them, constant below and above.
struct TableOfSpeed {
    std::vector<double> speeds{};        ///< [m/s] strictly ascending, not negative, at least one
    std::vector<double> restitutions{};  ///< in [0, 1], one for each speed
};

/// How restitution depends on the speed of approach [m/s]: not, by a power or a table, or by a
/// function without side effects, whose values are clamped to [0, 1].
using SpeedLaw =
    std::variant<std::monostate, PowerOfSpeed, TableOfSpeed, std::function<double(double)>>;

/// Restitution at a speed of approach [m/s] of a law whose coefficient is `restitution`.
[[nodiscard]] double restitution_at(const SpeedLaw& law, double restitution, double speed);

/// Material of bodies and surfaces. At a contact the smaller of the two restitutions and the
/// smaller of the two coefficients of friction apply, unless the scene has a `MaterialPair` for the
/// two. `MaterialId{}` is elastic and frictionless.
struct Material {
    std::string name{};      ///< may be empty
    double restitution = 1;  ///< Newton's coefficient, in [0, 1]
    double friction = 0;     ///< Coulomb's coefficient
    SpeedLaw by_speed{};     ///< in place of a constant restitution
};

/// Coefficients where two materials, or two parts of one material, touch.
struct MaterialPair {
    std::array<MaterialId, 2> between{};
    double restitution = 1;
    double friction = 0;
    SpeedLaw by_speed{};
};

/// A disc. Without inertia it does not turn.
struct Disc {
    std::string name{};  ///< if empty, the disc is called by its number
    Vector2 at{};        ///< [m] centre
    Vector2 velocity{};  ///< [m/s]
    double radius = 1;   ///< [m], positive
    double mass = 1;     ///< [kg], positive
    double drag = 0;     ///< [kg/s] force -drag velocity, not negative
    MaterialId material{};
    double inertia = 0;  ///< [kg m^2] about the centre: mass radius^2 / 2 for a solid disc; 0: none
    double angle = 0;    ///< [rad] counterclockwise
    double spin = 0;     ///< [rad/s] its rate
};

/// A body without extension. Two points never meet.
struct Point {
    std::string name{};
    Vector2 at{};        ///< [m]
    Vector2 velocity{};  ///< [m/s]
    double mass = 1;     ///< [kg], positive
    double drag = 0;     ///< [kg/s]
    MaterialId material{};
};

/// A straight plate that is guided along a line, such as a piston. It does not turn. Discs, points
/// and parallel plates meet it from both sides, discs also at its ends, and walls stop it; what its
/// guide takes of an impulse across the line is lost.
struct Plate {
    std::string name{};
    std::array<Vector2, 2> ends{};  ///< [m] at the start, two that differ
    Vector2 along{};  ///< direction of the line, of any length; zero: at a right angle to the plate
    double speed = 0;  ///< [m/s] along it
    double mass = 1;   ///< [kg], positive
    MaterialId material{};
};

/// The half plane behind a line: bodies stay where (x - point) . normal is not negative.
struct Wall {
    std::string name{};
    Vector2 point{};   ///< [m]
    Vector2 normal{};  ///< of any length except zero; points towards the bodies
    MaterialId material{};
    SurfaceMotion motion{};
    /// [J] Of a thermal wall: a body that strikes it leaves with a velocity at random, as from a
    /// gas with this kT. 0: an ordinary wall.
    double temperature = 0;
};

/// A chain of segments, met from both sides.
struct Terrain {
    std::string name{};
    std::vector<Vector2> points{};  ///< [m] two or more
    bool closed = false;            ///< whether the last point is joined to the first
    MaterialId material{};
    SurfaceMotion motion{};  ///< if it moves, only discs meet it, not points
    double temperature = 0;  ///< [J] as of a wall
};

/// A circle, or the part of one that leads counterclockwise from one point to another. It is met
/// from both sides and at its ends, and does not move.
struct Arc {
    std::string name{};
    Vector2 centre{};               ///< [m]
    double radius = 0;              ///< [m] of a whole circle; 0: the arc between `ends`
    std::array<Vector2, 2> ends{};  ///< [m] its start and its end, equally far from the centre
    MaterialId material{};
    double temperature = 0;  ///< [J] as of a wall
};

/// A spring between two centres, with tension stiffness (length - rest) + damping d(length)/dt.
struct Spring {
    std::array<BodyId, 2> between{};
    double rest = 0;       ///< [m] length without force
    double stiffness = 0;  ///< [N/m]
    double damping = 0;    ///< [N s/m]
};

/// A hybrid system whose discs other bodies can hit. Surfaces do not affect it, only its guards.
struct SystemBody {
    std::string name{};  ///< its discs are named after it: "arm", or "arm 0" and "arm 1"
    std::shared_ptr<const detail::SceneSystem> motion{};  ///< `system_body(system, x0)`
    MaterialId material{};
};

/// Description of a scene: bodies, the surfaces and springs between them, and materials.
class Scene {
public:
    /// Settings of a whole scene.
    struct Settings {
        Vector2 gravity{};  ///< [m/s^2]
        /// [m] Lengths of a cell that repeats along x and y; 0: none. Bodies are in 0 <= x <
        /// period.
        Vector2 period{};
        double memory_limit = 4e9;  ///< [bytes] a scene that would need more in a run is refused
    };

    Scene() : Scene(Settings{}) {}
    /// @throws std::invalid_argument if a setting is outside its range.
    explicit Scene(const Settings& settings);

    /// Adds a part to the scene and returns its handle, if it has one.
    /// @throws std::invalid_argument, with a message that names the part, for a mass or radius that
    /// is not positive, a value that is not finite, a name in use, an unknown handle, a restitution
    /// outside [0, 1], or a body that lies behind a wall or across terrain or an arc added before,
    /// unless that surface moves.
    MaterialId material(const Material& material);
    void pair(const MaterialPair& pair);
    BodyId disc(const Disc& disc);
    BodyId point(const Point& point);
    BodyId plate(const Plate& plate);
    SurfaceId wall(const Wall& wall);
    SurfaceId terrain(const Terrain& terrain);
    SurfaceId arc(const Arc& arc);
    void spring(const Spring& spring);
    SystemId system(const SystemBody& system);

    // Changes of what has been added, with the checks and errors of the functions above.

    /// Changes the gravity [m/s^2] of all bodies.
    void set_gravity(const Vector2& gravity);
    /// Moves a body that is no disc of a system to another start.
    void set_start(BodyId body, const Vector2& at, const Vector2& velocity);
    /// Turns a disc at the start; a spin [rad/s] needs an inertia.
    void set_turn(BodyId body, double angle, double spin);
    /// Changes restitution and friction of a material.
    void set_coefficients(MaterialId material, double restitution, double friction);

    /// @throws std::invalid_argument if `bodies` more bodies would exceed the memory limit.
    void require_room(double bodies) const;

    /// Validates the positions of the bodies at `t_start` [s]; called by `simulate` and `explain`.
    /// @throws std::invalid_argument for bodies that overlap, naming both and the overlap, and for
    /// bodies that lie behind walls or across terrain.
    void check(double t_start = 0) const;

    [[nodiscard]] const Settings& settings() const noexcept { return settings_; }
    /// All bodies. A point appears as a disc of radius 0, and so does a plate, at its middle.
    [[nodiscard]] std::span<const Disc> bodies() const noexcept { return bodies_; }
    [[nodiscard]] std::span<const Material> materials() const noexcept { return materials_; }
    [[nodiscard]] std::span<const Spring> springs() const noexcept { return springs_; }
    [[nodiscard]] std::span<const MaterialPair> pairs() const noexcept { return pairs_; }
    /// The pair of these materials, in either order; null where there is none.
    [[nodiscard]] const MaterialPair* pair_of(std::uint32_t a, std::uint32_t b) const noexcept;

    /// A system. Its discs are among `bodies()`; the mass given there has no meaning.
    struct System {
        std::shared_ptr<const detail::SceneSystem> motion;
        std::uint32_t first = 0;  ///< index of its first disc
        std::uint32_t count = 0;
    };
    [[nodiscard]] std::span<const System> systems() const noexcept { return systems_; }
    /// The system that a body is a disc of; null for any other body.
    [[nodiscard]] const System* system_of(std::uint32_t body) const noexcept;

    /// A plate, which is among `bodies()`.
    struct PlateShape {
        std::uint32_t body = 0;
        Vector2 half{};   ///< [m] from its middle to its second end
        Vector2 along{};  ///< of length 1: direction of the line on which it moves
    };
    [[nodiscard]] std::span<const PlateShape> plates() const noexcept { return plates_; }
    /// The plate that a body is; null for any other body.
    [[nodiscard]] const PlateShape* plate_of(std::uint32_t body) const noexcept;

    /// A wall, a terrain or an arc. All kinds are in one list, in the order of their addition.
    struct Surface {
        std::string name;
        bool is_wall = true;
        std::vector<Vector2> points;  ///< one for a wall; closed terrain repeats the first; the
                                      ///< ends of an arc, equal for a circle
        Vector2 normal{};             ///< of a wall, of length 1
        MaterialId material{};
        SurfaceMotion motion{};
        Vector2 centre{};        ///< [m] of an arc
        double temperature = 0;  ///< [J] 0 where it is not thermal
        double radius = 0;       ///< [m] of an arc, 0 for other surfaces

        /// Whether it is a circle or an arc.
        [[nodiscard]] bool is_arc() const noexcept { return radius > 0; }
    };
    [[nodiscard]] std::span<const Surface> surfaces() const noexcept { return surfaces_; }

    /// The name as given, or "body 3" and "surface 3".
    [[nodiscard]] std::string name_of(BodyId body) const;
    [[nodiscard]] std::string name_of(SurfaceId surface) const;
    /// The body of this name. @throws std::invalid_argument with the nearest name that is known.
    [[nodiscard]] BodyId body(std::string_view name) const;

    /// Memory [bytes] that a run needs, apart from events and samples.
    [[nodiscard]] double memory() const noexcept;

private:
    BodyId add(const Disc& body, std::string_view kind);
    void require_motion(const Disc& body, std::string_view label, bool of_system) const;
    static void require_turn(const Disc& body, std::string_view label);
    [[nodiscard]] std::string require_movable(BodyId body) const;
    void take_name(const std::string& name, std::string_view kind);
    void require_material(MaterialId material, std::string_view who) const;
    /// Centres of all bodies at t [s]: those of systems move with the time, too.
    [[nodiscard]] std::vector<Vector2> places_at(double t) const;
    void require_outside(const Disc& body, const Surface& surface) const;
    void check_period() const;
    void check_plates() const;
    void require_clear(const PlateShape& plate, const Surface& surface) const;
    static void require_outside_arc(const Disc& body, const Surface& arc, const std::string& label);
    void check_bodies_at(const Surface& surface, std::uint32_t index) const;

    Settings settings_;
    std::vector<Material> materials_;
    std::vector<Disc> bodies_;
    std::vector<Surface> surfaces_;
    std::vector<Spring> springs_;
    std::vector<MaterialPair> pairs_;
    std::unordered_map<std::uint64_t, std::uint32_t> pair_numbers_;
    std::vector<System> systems_;
    std::vector<PlateShape> plates_;
    std::unordered_map<std::string, std::uint32_t> names_;
};

}  // namespace ricochet
