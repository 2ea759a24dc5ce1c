// One group of bodies, from event to event in the order of time.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "scene/contacts.hpp"
#include "scene/event_queue.hpp"
#include "scene/grid.hpp"
#include "scene/impacts.hpp"
#include "scene/islands.hpp"
#include "scene/large_pages.hpp"
#include "scene/world.hpp"

namespace ricochet::detail {

/// The reason why a group could not go on.
struct Failure {
    Outcome outcome = Outcome::reached_end;
    Instant t{};
    std::vector<std::uint32_t> bodies{};
    std::string message{};
};

/// Result of a group at `t_end`; the world's records then hold its bodies.
struct GroupResult {
    std::optional<Failure> failure;
    std::vector<SceneEvent> events;
    std::uint64_t event_count = 0;
};

/// State of all bodies of a group at a sample time.
struct Samples {
    std::vector<std::vector<BodyState>>& states;
    std::vector<std::vector<BodyTurn>>& turns;  ///< empty where no disc turns
};

/// A value for each body of a group, in memory for all labels from its first to its last. The value
/// of a body that is alone is always in the same place in memory.
template <class Value>
class PerBody {
public:
    /// @param members  ascending
    void begin(std::span<const std::uint32_t> members)
    {
        first_ = members.front();
        const std::size_t room = members.back() - first_ + std::size_t{1};
        if (list_.size() < room) {
            reserve_large(list_, room);
            list_.resize(room);
        }
        for (const std::uint32_t i : members) (*this)[i] = {};
    }
    [[nodiscard]] Value& operator[](std::uint32_t body) { return list_[body - first_]; }
    [[nodiscard]] const Value& operator[](std::uint32_t body) const { return list_[body - first_]; }

private:
    std::vector<Value> list_;
    std::uint32_t first_ = 0;
};

class SceneLoop {
public:
    SceneLoop(World& world, double t_end);

    /// @param events   the events of this group are appended to it
    /// @param samples  a row for each of the options' sample times, whose bodies of this group are
    ///                 filled in as far as the group runs
    GroupResult run(std::span<const std::uint32_t> bodies, std::vector<SceneEvent> events,
                    Samples& samples);

    // Instead of `run`, driven from outside.

    /// Places these bodies, to be advanced by `advance`. Events at the start are in `result()`.
    void start(std::span<const std::uint32_t> bodies);
    /// Advances to the next event, or to a time up to the end where none happens until then.
    void advance(const Instant& to);
    /// The events of the last `advance`, the number of all, and the reason of an end.
    [[nodiscard]] const GroupResult& result() const noexcept { return result_; }
    /// Time of the last act.
    [[nodiscard]] const Instant& now() const noexcept { return now_; }

private:
    void begin(std::span<const std::uint32_t> bodies, std::vector<SceneEvent> events);
    struct Pending {
        enum class Kind : std::uint8_t {
            nothing,
            pair,
            face,
            presses,
            presses_face,
            stop,
            edge,
            border,  ///< leaves the cell that repeats, on side `other`: 2 axis + (whether upwards)
        };
        Instant t = no_instant;
        Instant crossing = no_instant;
        std::uint32_t other = none;
        std::uint32_t other_version = 0;
        Kind kind = Kind::nothing;
        std::int8_t across_x = 0, across_y = 0;
        Cells::Cell cell{};
    };
    /// Where a body leaves a square, and over which side: -1, 0 or 1 along x and y.
    struct Exit {
        Instant t = no_instant;
        std::int8_t x = 0, y = 0;
    };
    /// The square of terrain of a body, see `FaceTree`.
    struct OnTerrain {
        std::uint32_t square = 0;
        Exit exit{};
    };

    void act(const Instant& t);
    void place_all();
    void predict_all();
    void fill_cells();
    [[nodiscard]] Vector2 place_now(std::uint32_t i) const;
    void lay_cells_again();
    void watch_work();
    void settle_at_start();
    void predict(std::uint32_t i);
    void consider(std::uint32_t i, const Meeting& meeting, bool surface, std::uint32_t other)
    {
        ++world_.statistics.predictions;
        if (meeting.after < never) keep_if_first(i, meeting, surface, other);
    }
    void keep_if_first(std::uint32_t i, const Meeting& meeting, bool surface, std::uint32_t other);
    /// Whether a body cannot touch a wall before it leaves its cell.
    [[nodiscard]] bool is_away_from_walls(std::uint32_t i) const
    {
        const Body& body = world_.bodies[i];
        return celled_ && !body.big && !body.quartic && grid_.is_away_from_walls(pending_[i].cell);
    }
    void consider_walls(std::uint32_t i);
    void consider_body(std::uint32_t i, std::uint32_t j);
    void consider_faces(std::uint32_t i);
    void consider_moving(std::uint32_t i);
    void consider_plates(std::uint32_t i);
    void predict_plate(std::uint32_t i);
    void consider_own(std::uint32_t i);
    void consider_border(std::uint32_t i);
    void cross_border(std::uint32_t i);
    void consider_image(std::uint32_t i, std::uint32_t j);
    [[nodiscard]] Meeting meeting(std::uint32_t i, std::uint32_t j) const
    {
        return world_.periodic ? meet_image(world_, i, j, now_) : meet(world_, i, j);
    }
    void offer(std::uint32_t i);
    [[nodiscard]] Exit exit_of(std::uint32_t i, const Square& square, double outside) const;
    [[nodiscard]] Exit exit_by_step(std::uint32_t i, const Square& square, double outside) const;
    [[nodiscard]] Exit exit_by_bound(std::uint32_t i, const Square& square, double outside) const;
    void predict_crossing(std::uint32_t i);
    void predict_leaving(std::uint32_t i);
    void put_in_calendar(std::uint32_t i);
    void move_to_cell(std::uint32_t i);
    void cross(std::uint32_t i);
    void leave_square(std::uint32_t i);
    /// Whether the next act of a body is to leave its square of terrain.
    [[nodiscard]] bool leaves_first(std::uint32_t i) const
    {
        if (!on_terrain_) return false;
        const Instant& t = terrain_[i].exit.t;
        return before(t, pending_[i].t) && before(t, pending_[i].crossing);
    }
    /// The faces of terrain that a body can touch before it leaves its square.
    [[nodiscard]] const std::vector<std::uint32_t>& faces_of(std::uint32_t i) const
    {
        return grid_.terrain(world_.bodies[i]).faces(terrain_[i].square);
    }
    [[nodiscard]] bool is_cancelled() const
    {
        const auto* cancelled = world_.options.cancelled;
        return cancelled && cancelled->load(std::memory_order_relaxed);
    }
    [[nodiscard]] bool nothing_before(const Instant& t) const;
    void step_island(std::uint32_t island);
    void fail_island(std::uint32_t island);
    void fail_where_broken();
    void happen(std::uint32_t i);
    [[nodiscard]] std::string presses_on(std::uint32_t i, const Face& face) const;
    void impact(std::uint32_t i);
    void resolve_cluster(std::uint32_t i);
    void press(std::uint32_t i, const std::string& sentence);
    void hand_over(const std::vector<std::uint32_t>& bodies, const std::string& sentence);
    [[nodiscard]] bool can_last(const std::vector<std::uint32_t>& members,
                                const std::vector<std::uint32_t>& faces,
                                const std::vector<std::uint32_t>& bodies);
    std::vector<std::uint32_t> take_out(const std::vector<std::uint32_t>& members);
    [[nodiscard]] bool meets_crowd(const std::vector<std::uint32_t>& bodies) const;
    void join(std::vector<std::uint32_t> members, const std::vector<std::uint32_t>& bodies,
              bool crowded);
    void crowd(std::uint32_t group);
    [[nodiscard]] std::vector<std::uint32_t> with_arriving(std::vector<std::uint32_t> members);
    [[nodiscard]] std::vector<std::uint32_t> faces_near(
        const std::vector<std::uint32_t>& members) const;
    [[nodiscard]] std::vector<std::uint32_t> joining(double least, double most) const;
    [[nodiscard]] bool across(const Contact& contact) const;
    [[nodiscard]] bool known_to_group(std::uint32_t i, bool surface, std::uint32_t other) const;
    void note_group(SceneEvent::Kind kind, std::uint32_t i);
    void step_group(std::uint32_t group);
    void plan_group(std::uint32_t group);
    void arrive(std::uint32_t group);
    void restart_group(std::uint32_t group);
    bool divide(std::uint32_t group);
    void release(std::uint32_t group);
    void set_free(const std::vector<std::uint32_t>& bodies);
    [[nodiscard]] bool may_leave(std::uint32_t group, std::uint32_t i) const;
    [[nodiscard]] std::uint32_t entry_of_group(std::uint32_t group) const
    {
        return static_cast<std::uint32_t>(world_.bodies.size() + world_.islands->count()) + group;
    }
    void gather(std::uint32_t i, const Pending& seed);
    void gather_faces(std::uint32_t slot, std::uint32_t sure);
    void gather_moving(std::uint32_t slot, std::uint32_t sure);
    void gather_plate(std::uint32_t slot, const Pending* seed);
    void gather_plates(std::uint32_t slot, std::uint32_t sure);
    void gather_stops(std::uint32_t slot, std::uint32_t sure);
    void try_plate(std::uint32_t slot, const World::Plate& plate, std::uint32_t i, bool sure);
    void couple_plates();
    void touch_sides();
    void rest_on_stop(std::uint32_t i);
    void touch_face(std::uint32_t slot, const Vector2& p, std::uint32_t f, const Vector2& normal);
    [[nodiscard]] double loose_motion(std::uint32_t face, double size) const;
    [[nodiscard]] std::vector<Side> sides_of(std::uint32_t i, std::uint32_t sure) const;
    void gather_pairs(std::uint32_t slot, std::uint32_t sure);
    void set_laws(Contact& contact, std::uint32_t a, std::uint32_t b) const;
    void try_pair(std::uint32_t slot, std::uint32_t j, bool sure);
    std::uint32_t slot_of(std::uint32_t body);
    void set_spins();
    void apply(bool struck);
    std::uint32_t begin_record(std::uint32_t i, const Vector2& velocity,
                               const std::vector<Side>& sides);
    struct Strike {
        Vector2 arrives, leaves, impulse;
    };
    [[nodiscard]] std::optional<Strike> strike_on_wall(const Body& body, const Vector2& arrives,
                                                       const Instant& t) const;
    void record(std::uint32_t i, const Strike& strike);
    bool strikes_alone(std::uint32_t i);
    [[nodiscard]] bool flies_above_one_wall(const Body& body) const;
    bool bounces_from_start();
    [[nodiscard]] bool flies_past_end(std::uint32_t i) const;
    void bounce(std::uint32_t i);
    bool collapses(std::uint32_t slot);
    bool hops_below_rounding(std::uint32_t slot);
    void restart_island(std::uint32_t island);
    void continue_island(std::uint32_t island);
    bool let_events_happen();
    void schedule(std::uint32_t island);
    bool push_system(std::uint32_t island);
    void add_couplings();
    void settle(std::uint32_t i, std::uint32_t was);
    struct Pressed {
        std::vector<std::uint32_t> holding;  ///< faces that a body presses on
        std::vector<Vector2> blocking;  ///< normals into which it cannot be pulled, overhanging
                                        ///< faces included
    };
    [[nodiscard]] Pressed pressed_faces(const Body& body, const std::vector<std::uint32_t>& faces,
                                        double gained) const;
    struct Carrier {
        std::uint32_t face = none;
        bool leaves = false;  ///< whether it slides off a face instead
    };
    Carrier slide_on_one(std::uint32_t i, const Pressed& pressed);
    bool rests_on_face(std::uint32_t i);
    void halt(std::uint32_t i);
    [[nodiscard]] double slips_for(std::uint32_t i) const;
    void stop_turning(std::uint32_t i, const std::vector<std::uint32_t>& faces);
    void leave_edge(std::uint32_t i);
    /// Faces that a body touches; valid until the next call.
    [[nodiscard]] const std::vector<std::uint32_t>& touching_faces(std::uint32_t i);
    void note(SceneEvent::Kind kind, std::uint32_t i, std::uint32_t face, const Vector2& velocity);
    void count_held();
    void sample_until(const Instant& t, bool inclusive, Samples& samples);
    void fail(Outcome outcome, std::vector<std::uint32_t> bodies, std::string message);
    /// Shows new events to the observer, if there is one.
    void show_events()
    {
        if (world_.options.observe && result_.events.size() > shown_) show_new_events();
    }
    void show_new_events();
    [[nodiscard]] std::string called(std::uint32_t i) const
    {
        return world_.scene.name_of(BodyId{i});
    }

    World& world_;
    std::vector<std::uint32_t> members_;
    std::vector<std::uint32_t> placed_;  ///< members that lie in cells: all but plates
    Instant t_end_;
    /// What happens later is left to a later `advance`.
    Instant pause_;
    bool driven_ = false;  ///< by `advance`, an event at a time
    Grid grid_;
    bool celled_ = false;          ///< whether bodies can meet each other
    bool on_terrain_ = false;      ///< whether there is terrain that does not move
    std::vector<Vector2> places_;  ///< of `placed_`, while cells are laid
    EventQueue calendar_;
    PerBody<Pending> pending_;
    PerBody<OnTerrain> terrain_;  ///< where there is any
    struct Work {
        std::uint64_t tests = 0, crossings = 0, events = 0;  ///< at the start of the present count
        std::uint64_t left = 0;                              ///< acts until the next look
        std::uint64_t interval = 0;                          ///< acts from look to look
        double least = 0;  ///< work an event since cells were laid; 0: not known yet
    } work_;
    std::vector<std::uint32_t> slots_;
    std::vector<std::uint32_t> islands_;
    Impacts impacts_;
    Contacts contacts_;
    struct Backoff {
        std::uint32_t steps = 1;
        Instant released{-never, 0};
    };
    std::vector<Backoff> patience_;  ///< of bodies, where there has been lasting contact
    Cluster cluster_;
    std::vector<std::uint32_t> changed_;
    std::vector<std::uint32_t> slots_of_islands_;
    std::vector<std::uint32_t> groups_struck_;
    std::vector<std::uint32_t> touched_;  ///< see `touching_faces`
    std::vector<std::pair<std::uint32_t, Vector2>> velocities_;
    /// After this many impacts of a body at mean intervals within the resolution of time, its
    /// cluster collapses.
    static constexpr std::uint32_t crowded = 64;
    struct Series {
        Instant since{};
        Instant last{-never, 0};
        std::uint32_t count = 0;
        std::uint32_t low = 0;  ///< hops in a row that rise by less than rounding
    };
    PerBody<Series> series_;  ///< of impacts of a body
    Instant now_{};
    std::uint32_t unmoved_ = 0;  ///< consecutive predicted impacts that moved nothing
    std::uint64_t idle_ = 0;     ///< consecutive acts at one time
    std::size_t next_sample_ = 0;
    std::size_t shown_ = 0;  ///< of the events, to the observer
    GroupResult result_;
};

}  // namespace ricochet::detail
