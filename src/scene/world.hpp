// The bodies of a scene in motion.
//
// A body's record holds its state when its velocity last changed, and its motion since then.
// Nothing else advances it: the time at which a pair meets is a function of two records alone,
// independent of earlier queries, so calendars, cells, samples and labels do not change a bit.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ricochet/instant.hpp"
#include "ricochet/scene/simulate.hpp"
#include "scene/arcs.hpp"
#include "scene/motion.hpp"
#include "scene/options.hpp"
#include "scene/roots.hpp"
#include "scene/vector2.hpp"

namespace ricochet::detail {

inline constexpr std::uint32_t none = ~0U;
inline constexpr double epsilon = 2.220446049250313e-16;

[[nodiscard]] inline bool before(const Instant& a, const Instant& b) noexcept
{
    return a.value < b.value || (a.value == b.value && a.remainder < b.remainder);
}
/// Seconds from `a` to `b`.
[[nodiscard]] inline double seconds(const Instant& a, const Instant& b) noexcept
{
    return (b.value - a.value) + (b.remainder - a.remainder);
}
inline constexpr Instant no_instant{never, 0};

/// Times closer than this are not distinguished, for events and for the ends of a flight.
[[nodiscard]] inline double resolution(const Instant& t) noexcept
{
    return 4 * epsilon * std::fabs(t.value);
}

/// 128 bytes: the first half holds the data that neighbours read.
struct alignas(64) Body {
    Vector2 p{}, v{}, a{};  ///< at t: position, velocity and second derivative
    Instant t{};
    double radius = 0;
    double inverse_mass = 0;
    std::uint32_t version = 0;                   ///< counts changes of the motion
    std::uint32_t next = none, previous = none;  ///< in the cell
    std::uint32_t bucket = none;
    std::uint32_t material = 0;
    std::uint32_t island = none;   ///< index, if it advances by steps
    std::uint32_t held = none;     ///< face on which it slides
    std::uint32_t contact = none;  ///< group in lasting contact: a is 0, v the step's chord
    /// For a point: segments that it touches at t, 2 face + (whether it is above).
    std::array<std::uint32_t, 3> sides{none, none, none};
    bool asleep = false;
    bool quartic = false;  ///< its step has terms of degree 3 and 4
    bool mapped = false;   ///< in a system: its step has no polynomial, but a bound
    bool big = false;      ///< in the second grid (grid.hpp)
};
static_assert(sizeof(Body) == 128);

/// An obstacle that is no body: a wall, a segment, an arc, or an end of segments or arcs.
struct Face {
    enum class Kind : std::uint8_t { wall, vertex, segment, arc };
    Kind kind = Kind::wall;
    Vector2 at{};       ///< point of a wall, start of a segment, vertex, centre of an arc
    Vector2 normal{};   ///< of length 1
    double length = 0;  ///< of a segment; radius of an arc
    std::uint32_t surface = 0;
    std::uint32_t material = 0;
    std::uint32_t previous = none, next = none;  ///< segments of the same chain
    /// [m] Of a segment: rounding of the distance of a point, with that of the segments that are
    /// linked with it. Their lines meet beside the corner by as much.
    double blur = 0;
    ArcSpan span{};  ///< of an arc
};

/// Whether bodies meet a face from both sides.
[[nodiscard]] constexpr bool has_two_sides(Face::Kind kind) noexcept
{
    return kind >= Face::Kind::segment;
}

/// Whether its normal follows from the place of a body.
[[nodiscard]] constexpr bool is_round(Face::Kind kind) noexcept
{
    return kind == Face::Kind::vertex || kind == Face::Kind::arc;
}

/// The point of a face of terrain that is nearest to p.
[[nodiscard]] Vector2 nearest_on(const Face& face, const Vector2& p) noexcept;

/// The least box around a face, or around the whole circle of an arc.
[[nodiscard]] Square box_of(const Face& face) noexcept;

/// Gap between a face and a body, and the direction in which the face pushes.
struct FaceGap {
    double gap = never;
    Vector2 normal{};
};

/// Motion of a face.
struct MovingFace {
    const SurfaceMotion* motion = nullptr;
    MotionBounds bounds{};
    bool given = false;  ///< whether it is given by functions
};

/// A violated bound of a motion, or a motion that is not finite.
struct BrokenBound {
    bool non_finite = false;
    std::string sentence;
};

/// Links the segments of open terrain where exactly two of them end at the same point, and orients
/// them so that the end of one is the start of the next.
void join_chains(const Scene& scene, std::uint32_t wall_count, std::vector<Face>& faces);

/// The side of a segment on which a point that touches it lies.
struct Side {
    std::uint32_t face = none;
    bool above = true;  ///< side to which the normal points
};

/// Position from an instant on: c[0] + c[1] s + ... within `until`.
struct Path {
    std::array<Vector2, 5> c{};
    int degree = 0;
    double until = never;
};

class Islands;

struct World {
    World(const Scene& scene, const SceneOptions& options);
    ~World();
    World(const World&) = delete;
    World& operator=(const World&) = delete;

    const Scene& scene;
    const SceneOptions& options;
    SceneTuning tuning;
    bool keeps_events = true;  ///< where they are recorded: not only for the observer
    Vector2 gravity{};
    Vector2 period{};       ///< [m] 0 along an axis that does not repeat
    bool periodic = false;  ///< whether one of them repeats
    std::vector<std::array<std::int32_t, 2>> windings;  ///< of bodies, where it is
    std::vector<Body> bodies;
    struct Bend {
        Vector2 c3{}, c4{};  ///< terms of degree 3 and 4
        Vector2 sweep{};     ///< bounds of the distances along x and y from the start of the step
    };
    bool any_drag = false;              ///< whether drag slows a body
    std::vector<Bend> bends;            ///< of bodies, where there are islands
    std::vector<Face> faces;            ///< walls first, then terrain, then moving faces
    std::uint32_t wall_count = 0;       ///< walls that do not move
    std::uint32_t fixed_count = 0;      ///< of these and of terrain that does not move
    std::vector<MovingFace> motions;    ///< of the faces from there on
    std::vector<double> accelerations;  ///< [m/s^2] bounds for mapped bodies in their steps
    mutable std::optional<BrokenBound> broken;
    std::unique_ptr<Islands> islands;
    struct Drift {
        Vector2 v{}, rate{};  ///< at the start of the step of its group
    };
    std::vector<Drift> drifts;  ///< of bodies in lasting contact, where there have been any
    SceneStatistics statistics;

    /// The angle of a disc since its spin last changed.
    struct Turn {
        Instant t{};
        double angle = 0;
        double spin = 0;
        double rate = 0;  ///< [rad/s^2] while friction turns it on a surface
        double inverse_inertia = 0;
        std::optional<double> chord{};  ///< [rad/s] of the angle, in a step of lasting contact
    };
    /// A plate, and the sides of it on which bodies without a radius are.
    struct Plate {
        std::uint32_t body = 0;
        Vector2 along{};      ///< of length 1: direction of the line on which it moves
        Vector2 normal{};     ///< of length 1
        double length = 0;    ///< [m] from its middle to an end
        Vector2 pull{};       ///< [m/s^2] of gravity along the line
        double mobility = 0;  ///< [1/kg] an impulse p adds mobility (along . p) along
        /// Of points and plates, since the last contact: 1 where the normal points, else -1. Their
        /// rounded places do not tell the side on which they touch.
        std::vector<std::int8_t> sides{};

        /// [m] How far it reaches in a direction from its middle.
        [[nodiscard]] double reach(const Vector2& direction) const noexcept
        {
            return length * std::fabs(dot(turned(normal), direction));
        }
        /// Whether an impulse in this direction moves it.
        [[nodiscard]] bool yields(const Vector2& direction) const noexcept
        {
            return std::fabs(dot(along, direction)) > 1e-12;
        }
    };
    std::vector<Plate> plates;
    std::vector<std::uint32_t> plate_numbers;  ///< of bodies, where there are plates

    [[nodiscard]] const Plate* plate(std::uint32_t i) const noexcept
    {
        return plates.empty() || plate_numbers[i] == none ? nullptr : &plates[plate_numbers[i]];
    }
    /// Whether a body cannot follow every impulse: that of a system, or a plate.
    [[nodiscard]] bool is_guided(std::uint32_t i) const noexcept
    {
        return bodies[i].mapped || plate(i) != nullptr;
    }
    /// [m] How far a body reaches from its middle towards a wall.
    [[nodiscard]] double reach_to(std::uint32_t i, const Face& wall) const noexcept
    {
        const Plate* plate = this->plate(i);
        return plate ? plate->reach(wall.normal) : bodies[i].radius;
    }
    /// [m/s^2] Acceleration of a body that nothing holds.
    [[nodiscard]] Vector2 fall(std::uint32_t i) const noexcept
    {
        const Plate* plate = this->plate(i);
        return plate ? plate->pull : gravity;
    }

    std::vector<Turn> turns;  ///< of bodies, where a disc has an inertia
    bool any_turning = false;

    [[nodiscard]] bool turning(std::uint32_t i) const noexcept
    {
        return any_turning && turns[i].inverse_inertia > 0;
    }
    [[nodiscard]] double spin(std::uint32_t i, const Instant& t) const noexcept
    {
        return turns[i].spin + seconds(turns[i].t, t) * turns[i].rate;
    }
    [[nodiscard]] BodyTurn turn(std::uint32_t i, const Instant& t) const noexcept
    {
        const Turn& turn = turns[i];
        const double s = seconds(turn.t, t);
        const double mean = turn.chord ? *turn.chord : turn.spin + 0.5 * s * turn.rate;
        return {turn.angle + s * mean, turn.spin + s * turn.rate};
    }
    /// Lets a disc turn with this spin from t on.
    void set_spin(std::uint32_t i, const Instant& t, double spin, double rate = 0) noexcept
    {
        turns[i].angle = turn(i, t).angle;
        turns[i].t = t;
        turns[i].spin = spin;
        turns[i].rate = rate;
        turns[i].chord.reset();
    }
    /// [m/s] Speed at which the edge of a disc on a face slips along it, counterclockwise about the
    /// side from which the face pushes.
    [[nodiscard]] double slip_on(std::uint32_t i, std::uint32_t face) const;

    /// [m] Bound of the distance along a direction from the start of the current step of a body.
    [[nodiscard]] double reach_of_step(std::uint32_t i, const Vector2& direction) const noexcept
    {
        const Vector2& sweep = bends[i].sweep;
        return (1 + 1e-9) *
               (std::fabs(direction[0]) * sweep[0] + std::fabs(direction[1]) * sweep[1]);
    }

    /// What is added to a place so that its difference from another one, `apart`, is that of the
    /// nearest images.
    [[nodiscard]] Vector2 image_shift(const Vector2& apart) const noexcept
    {
        Vector2 shift{};
        for (std::size_t c = 0; c < 2; ++c) {
            if (period[c] > 0) shift[c] = period[c] * std::nearbyint(apart[c] / period[c]);
        }
        return shift;
    }
    /// The middle between the nearest images of two places, in the cell that repeats. It does not
    /// depend on the order of the two.
    [[nodiscard]] Vector2 between_images(const Vector2& a, const Vector2& b) const noexcept
    {
        const Vector2 shift = image_shift(a - b);
        Vector2 middle = 0.5 * ((a + b) + shift);
        for (std::size_t c = 0; c < 2; ++c) {
            if (shift[c] == 0) continue;
            const double other = 0.5 * ((a[c] + b[c]) - shift[c]);
            if (other >= 0 && other < period[c]) middle[c] = other;
        }
        return middle;
    }
    /// The state of a body at t.
    [[nodiscard]] BodyState state(std::uint32_t i, const Instant& t) const
    {
        BodyState state{position(i, t), velocity(i, t), bodies[i].asleep};
        if (periodic) state.winding = windings[i];
        return state;
    }

    /// From its record; by the method's own map where it advances by steps.
    [[nodiscard]] Vector2 position(std::uint32_t i, const Instant& t) const;
    [[nodiscard]] Vector2 velocity(std::uint32_t i, const Instant& t) const;
    /// Derivative of the position: in lasting contact it is the chord of the step.
    [[nodiscard]] Vector2 heading(std::uint32_t i, const Instant& t) const;
    [[nodiscard]] Path path(std::uint32_t i, const Instant& t) const;

    /// Whether restitution is constant and no wall is thermal.
    bool plain_laws = true;
    bool any_thermal = false;
    bool any_pairs = false;  ///< of materials
    bool ordinary = true;    ///< plain laws, and neither a period, a disc that turns nor a plate

    /// Of two materials; where it depends on the speed of approach, that of high speeds.
    [[nodiscard]] double restitution(std::uint32_t a, std::uint32_t b) const noexcept
    {
        if (any_pairs) {
            if (const MaterialPair* pair = scene.pair_of(a, b)) return pair->restitution;
        }
        return std::min(scene.materials()[a].restitution, scene.materials()[b].restitution);
    }
    /// The same at a speed of approach [m/s].
    [[nodiscard]] double restitution(std::uint32_t a, std::uint32_t b, double speed) const;
    /// Whether it depends on that speed.
    [[nodiscard]] bool depends_on_speed(std::uint32_t a, std::uint32_t b) const noexcept;
    [[nodiscard]] double friction(std::uint32_t a, std::uint32_t b) const noexcept
    {
        if (any_pairs) {
            if (const MaterialPair* pair = scene.pair_of(a, b)) return pair->friction;
        }
        return std::min(scene.materials()[a].friction, scene.materials()[b].friction);
    }

    [[nodiscard]] bool moves(std::uint32_t face) const noexcept { return face >= fixed_count; }
    [[nodiscard]] const MovingFace& moving(std::uint32_t face) const
    {
        return motions[face - fixed_count];
    }
    /// Gap of a moving face at t.
    [[nodiscard]] FaceGap moving_gap(std::uint32_t face, double radius, const Vector2& p,
                                     const Instant& t) const;
    /// Zero where it does not move.
    [[nodiscard]] Vector2 surface_velocity(std::uint32_t face, const Instant& t) const;

    /// The direction in which a face pushes a body that slides on it.
    [[nodiscard]] Vector2 push_of(const Body& body, std::uint32_t face) const;

    /// Whether a body is on the side to which a segment's normal points, or outside the circle of
    /// an arc: at the start of its record, and at p with velocity v, to which the record has led. A
    /// point on the line is on the side from which it came, which its record stores.
    [[nodiscard]] bool begins_above(const Body& body, std::uint32_t face) const;
    [[nodiscard]] bool arrives_above(const Body& body, std::uint32_t face, const Vector2& p,
                                     const Vector2& v) const;
    /// Unifies the sides of adjacent segments: where they differ the point is on the side with the
    /// larger angle.
    void make_one(std::vector<Side>& sides) const;
    /// Stores the sides on which a point lies from now on, and undoes its displacement by rounding.
    /// `flown` [m] is the rounding of the flight that has led there.
    void remember(Body& body, const std::vector<Side>& sides, double flown) const;
    /// Whether a point that reaches the end of a segment at p with velocity v, after a flight with
    /// this rounding, passes there.
    [[nodiscard]] bool passes_end(const Body& body, std::uint32_t face, bool above,
                                  const Vector2& p, const Vector2& v, double flown) const;
    /// Whether a body at the foot of p on a segment leaves it over one of its ends.
    [[nodiscard]] bool leads_off(const Face& face, const Vector2& p, const Vector2& heading) const;
    /// Makes a body on a face move along it from now on: pulled by gravity, slowed by friction.
    void slide(std::uint32_t i, std::uint32_t face);
    /// The same for a disc that turns, where there is friction: it slips, or rolls.
    void roll(std::uint32_t i, std::uint32_t face);

    /// [m] Distance beyond its ends up to which a segment holds a point; at a sharp corner the
    /// rounding of two sides moves a point by a multiple of itself.
    [[nodiscard]] static double end_slack(const Face& face, const Vector2& p, double flown) noexcept
    {
        return 32 * (rounding(p, 0) + blur(face, 0) + flown);
    }
    /// [m] The same at the corner with an adjacent segment. A point on both lines by rounding may
    /// be farther from a flat corner, in proportion to 1 / sine of its angle.
    [[nodiscard]] double corner_slack(const Face& face, std::uint32_t other, const Vector2& p,
                                      double flown) const;
    /// Whether a point on the line of a segment is between its ends, within these distances.
    [[nodiscard]] bool holds(const Face& face, const Vector2& p, double flown) const;

    /// Rounding of a gap at these coordinates [m].
    [[nodiscard]] static double rounding(const Vector2& p, double radius) noexcept
    {
        return 8 * epsilon * (std::fabs(p[0]) + std::fabs(p[1]) + radius);
    }

    /// [m] The part of a face in the rounding of its gap to a body.
    [[nodiscard]] static double blur(const Face& face, double radius) noexcept
    {
        const bool meets_corners = radius == 0 && face.kind == Face::Kind::segment;
        return meets_corners ? face.blur : rounding(face.at, 0);
    }

private:
    [[nodiscard]] bool arrives_outside(const Body& body, std::uint32_t face, const Vector2& p,
                                       const Vector2& v) const;
    void find_laws();
    void add_plates();
    void add_arcs();
    void add_images();
    void blur_segments();
    [[nodiscard]] Vector2 stepped_position(std::uint32_t i, const Instant& t) const;
    [[nodiscard]] Vector2 stepped_velocity(std::uint32_t i, const Instant& t) const;
    void add_moving_faces();
    void put_to_sleep();
};

/// Place by the record, for bodies in closed form.
[[nodiscard]] inline Vector2 place(const Body& b, double s) noexcept
{
    return {b.p[0] + s * (b.v[0] + 0.5 * s * b.a[0]), b.p[1] + s * (b.v[1] + 0.5 * s * b.a[1])};
}
[[nodiscard]] inline Vector2 speed(const Body& b, double s) noexcept
{
    return {b.v[0] + s * b.a[0], b.v[1] + s * b.a[1]};
}

inline Vector2 World::position(std::uint32_t i, const Instant& t) const
{
    const Body& b = bodies[i];
    return b.quartic ? stepped_position(i, t) : place(b, seconds(b.t, t));
}
inline Vector2 World::velocity(std::uint32_t i, const Instant& t) const
{
    const Body& b = bodies[i];
    return b.quartic || b.contact != none ? stepped_velocity(i, t) : speed(b, seconds(b.t, t));
}

/// [m] Rounding of a place to which a record has led in s seconds: that of a long, high flight
/// exceeds that of its end, which may be a corner at the origin.
[[nodiscard]] inline double rounding_of_flight(const Body& b, double s) noexcept
{
    return 4 * epsilon * s * (norm(b.v) + s * norm(b.a));
}

/// A first contact, `after` seconds after `from`; infinite if there is none. `presses`: the two
/// touch without approaching, and are pushed together.
struct Meeting {
    Instant from{};
    double after = never;
    bool presses = false;
};
[[nodiscard]] inline const Instant& later(const Instant& a, const Instant& b) noexcept
{
    return before(a, b) ? b : a;
}

/// Velocities below it are rounding.
[[nodiscard]] inline double noise(const Vector2& a, const Vector2& b) noexcept
{
    return 8 * epsilon * (norm(a) + norm(b));
}

struct Squares {
    double at_once = 0;  ///< constant term of the squared distance minus the reach
    double rate = 0;     ///< half its derivative
    double tolerance = 0;
};

/// The squared gap of two bodies now: dp.dp - reach^2 in factors, which keeps its digits.
[[nodiscard]] inline Squares squares(const Vector2& dp, const Vector2& dv, double reach,
                                     double rounding)
{
    const double distance = norm(dp);
    return {(distance - reach) * (distance + reach), dot(dp, dv), 2 * reach * rounding};
}

/// Of the equation for the meeting of two straight flights; negative where they pass each other.
/// Formed from the reach and the distance at which the paths pass, so a small reach keeps its
/// digits.
[[nodiscard]] inline double discriminant(const Vector2& dp, const Vector2& dv,
                                         double reach) noexcept
{
    const double passing = dp[0] * dv[1] - dp[1] * dv[0];
    return dot(dv, dv) * (reach * reach) - passing * passing;
}

/// Meeting of two straight flights, or of two with the same acceleration.
[[nodiscard]] inline double straight(const Squares& now, const Vector2& dp, const Vector2& dv,
                                     double reach) noexcept
{
    if (now.rate >= 0) return never;
    if (now.at_once <= 0) return 0;
    const double square = discriminant(dp, dv, reach);
    if (square < 0) return never;
    return now.at_once / (std::sqrt(square) - now.rate);
}

/// Meeting of bodies of which at least one moves by steps, or whose accelerations differ.
[[nodiscard]] Meeting meet_curved(const World& world, std::uint32_t i, std::uint32_t j);

[[nodiscard]] inline Meeting meet(const World& world, std::uint32_t i, std::uint32_t j)
{
    const Body& a = world.bodies[i];
    const Body& b = world.bodies[j];
    const double reach = a.radius + b.radius;
    if (reach == 0) return {};
    if (a.quartic || b.quartic || a.a != b.a) return meet_curved(world, i, j);
    const Instant& from = later(a.t, b.t);
    const double sa = seconds(a.t, from);
    const double sb = seconds(b.t, from);
    const Vector2 va = speed(a, sa);
    const Vector2 vb = speed(b, sb);
    const Vector2 dv = va - vb;
    const Vector2 pa = place(a, sa);
    const Vector2 dp = pa - place(b, sb);
    const double rate = dot(dp, dv);
    const double square = dot(dp, dp) - reach * reach;
    const bool far = square > 1e-6 * reach * reach;
    const double under_root = discriminant(dp, dv, reach);
    // One branch for most pairs: whether they approach cannot be predicted.
    if ((rate >= 0) | (far & (under_root < 0))) return {};
    if (far) {
        // Far from touching the sum of squares keeps its digits.
        return {.from = from, .after = square / (std::sqrt(under_root) - rate)};
    }
    const Squares now = squares(dp, dv, reach, 0);
    if (now.at_once <= 4 * reach * World::rounding(pa, reach) && -rate <= noise(va, vb) * reach) {
        return {};
    }
    return {.from = from, .after = straight(now, dp, dv, reach)};
}
[[nodiscard]] Meeting meet_face(const World& world, std::uint32_t i, std::uint32_t face);

/// Meeting of the images of two bodies that are nearest to each other now.
[[nodiscard]] Meeting meet_image(const World& world, std::uint32_t i, std::uint32_t j,
                                 const Instant& now);

/// Gap between a face and a body that its flight has led to p.
[[nodiscard]] FaceGap face_gap(const Face& face, const Body& body, const Vector2& p, bool above,
                               double flown = 0);
/// Whether the foot of p on the line lies on the segment.
[[nodiscard]] bool lies_on(const Face& face, const Vector2& p, double slack);

}  // namespace ricochet::detail
