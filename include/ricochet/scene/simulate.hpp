// Simulation of a scene: every body has its own time and advances from impact to impact.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "ricochet/run.hpp"
#include "ricochet/scene/scene.hpp"

namespace ricochet {

/// Rule for several contacts of one cluster that are struck at one instant.
enum class ImpactLaw {
    waves,     ///< fastest approaching contacts first, ties together, until none approaches
    together,  ///< Newton's law for all contacts at once
};

/// Maker of groups of bodies in lasting contact, see `scene_contacts()`.
class SceneContacts;

/// The second body, or the surface, of an event.
struct Partner {
    bool is_surface = false;
    std::uint32_t index = 0;  ///< index of the body or of the surface
    friend bool operator==(const Partner&, const Partner&) = default;
};

/// One contact with an impact, or a change in the contact of one body. Contacts of one cluster have
/// the same `number` and time, and are in the order of their waves.
struct SceneEvent {
    /// Kinds of events.
    enum class Kind : std::uint8_t {
        impact,
        held,      ///< impacts on the surface have accumulated: the body slides or rests on it
        stopped,   ///< friction has stopped a sliding body
        joined,    ///< lasting contact: the body is advanced in a group; `other` is the body itself
        released,  ///< the body has left its group
        slept,     ///< the group of the body has come to rest
    };
    double t = 0;  ///< [s]
    std::uint64_t number = 0;
    Kind kind = Kind::impact;
    std::uint32_t body = 0;  ///< the body with the lower index
    Partner other{};
    Vector2 impulse{};                ///< [N s] on `body`; the opposite acts on the other
    std::array<Vector2, 2> before{};  ///< [m/s] velocities of body and other
    std::array<Vector2, 2> after{};
    Vector2 at{};      ///< [m] place of an impact
    Vector2 normal{};  ///< of an impact: the direction in which `body` is pushed, of length 1

    /// [m/s] Relative speed before an impact along the normal; negative if the two move apart.
    [[nodiscard]] double approach() const noexcept
    {
        return -(before[0][0] - before[1][0]) * normal[0] -
               (before[0][1] - before[1][1]) * normal[1];
    }
};

/// Options of a run of a scene.
struct SceneOptions {
    double t_start = 0;                                       ///< [s]
    double t_end = std::numeric_limits<double>::quiet_NaN();  ///< [s] above t_start
    double rtol = 1e-8;  ///< of bodies with springs or drag, as in `Options`
    double atol = 1e-10;
    ImpactLaw impacts = ImpactLaw::waves;

    /// [s] Contact time of the TC model; 0: off. An impact is elastic if one of its bodies had an
    /// impact less than this long ago (S. Luding and S. McNamara, How to handle the inelastic
    /// collapse of a dissipative hard-sphere gas with the TC model, Granular Matter 1, 1998).
    double elastic_within = 0;

    /// Of the velocities with which bodies leave thermal walls. They follow from it and from the
    /// time, place and velocity of each impact, so that labels and samples change nothing.
    std::uint64_t seed = 1;

    /// `scene_contacts()` of `ricochet::scene_contact`. Without it a run ends with `Outcome::zeno`
    /// where bodies stay in contact with each other.
    const SceneContacts* contacts = nullptr;
    double contact_step = 1e-3;  ///< [s] step of groups in lasting contact; order 1

    /// Bodies from which a group in lasting contact may become a crowd; 0: never. It becomes one
    /// where 32 impacts cut its steps within one `contact_step`: it then takes whole steps, at
    /// whose ends the contacts that have closed in them rebound together.
    std::uint64_t crowded_from = 64;

    bool record_events = true;           ///< off: events are counted, not kept
    std::vector<double> sample_times{};  ///< [s] ascending; they do not affect the motion
    std::uint64_t max_events = std::numeric_limits<std::uint64_t>::max();
    const std::atomic<bool>* cancelled = nullptr;  ///< set by another thread to end the run

    /// Called with every event, in the order of time, when it has happened; with `record_events`
    /// off no event is kept in memory. All bodies are then one group. What it throws, `simulate`
    /// throws.
    std::function<void(const SceneEvent&)> observe{};
};

/// State of a body at one time.
struct BodyState {
    Vector2 at{};         ///< [m]
    Vector2 velocity{};   ///< [m/s]
    bool asleep = false;  ///< at rest, and stays so until it is struck
    /// Periods that the body has gone along x and y: it has come to `at` + winding * period.
    std::array<std::int32_t, 2> winding{};
};

/// Angle and spin of a disc that turns.
struct BodyTurn {
    double angle = 0;  ///< [rad] counterclockwise, not reduced to one turn
    double spin = 0;   ///< [rad/s]
};

/// Counts over a run.
struct SceneStatistics {
    std::uint64_t impacts = 0;      ///< contacts with an impact
    std::uint64_t events = 0;       ///< events; the impacts of one cluster count once
    std::uint64_t waves = 0;        ///< waves of impacts in clusters
    std::uint64_t collapses = 0;    ///< clusters whose impacts accumulated
    std::uint64_t predictions = 0;  ///< searches for a first contact, of pairs and surfaces
    std::uint64_t stale = 0;        ///< predicted impacts that did not happen
    std::uint64_t crossings = 0;    ///< from cell to cell
    std::uint64_t layings = 0;      ///< times that cells were laid again, as they had become too
                                    ///< large or too small for a group
    std::uint64_t steps = 0;        ///< steps of islands with springs or drag
    std::uint64_t rejected = 0;
    std::uint64_t flow_calls = 0;
    std::uint64_t joins = 0;             ///< hand-overs of bodies to groups in lasting contact
    std::uint64_t contact_steps = 0;     ///< steps of such groups
    std::uint64_t crowded_steps = 0;     ///< of these steps, those of crowds
    std::uint64_t crowded_rebounds = 0;  ///< contacts that rebounded in them, not among `impacts`
    double contact_defect = 0;           ///< largest residual of their contact law, relative to the
                                         ///< velocities: 1e-10, 1e-7 if bodies are wedged, 1e-4
                                         ///< in crowds
    std::uint64_t alone = 0;             ///< bodies that could meet no other body
    std::uint64_t groups = 0;            ///< groups of bodies that could meet
};

/// Result of a run. Nothing that was computed is lost, whatever the outcome.
struct SceneRun {
    Outcome outcome = Outcome::reached_end;
    std::string message;  ///< empty at the end, otherwise a sentence on what ended the run
    std::vector<std::uint32_t> involved;          ///< bodies that the message is about
    double t = 0;                                 ///< [s] time reached by all bodies
    std::vector<BodyState> bodies;                ///< at that time
    std::vector<std::vector<double>> systems;     ///< states of systems at that time
    std::vector<SceneEvent> events;               ///< in the order of time
    std::vector<double> sample_times;             ///< the sample times reached
    std::vector<std::vector<BodyState>> samples;  ///< one row per sample time
    SceneStatistics statistics;
    /// Angles of all bodies at `t` and at the sample times; empty where no disc has an inertia.
    std::vector<BodyTurn> turns;
    std::vector<std::vector<BodyTurn>> sample_turns;
};

/// Simulates the scene from `t_start` to `t_end`.
/// @throws std::invalid_argument for an invalid scene or option.
[[nodiscard]] SceneRun simulate(const Scene& scene, const SceneOptions& options);

/// A run of a scene that the caller advances, as a game or a master of co-simulation does:
///
///     SceneSimulation game(scene, {.t_end = 3600});
///     while (running) {
///         const double frame = game.t() + 1.0 / 60;
///         while (game.advance(frame)) play(game.events());
///         draw(game.run().bodies);
///     }
///
/// The end may be far away, since nothing is computed far ahead. All bodies are one group. The
/// times to which the run is advanced do not affect the motion. It is that of `simulate` with the
/// same end, which lasting contact and springs step to; to the rounding of the times where
/// `simulate` takes the bounces of a body alone on a wall in closed form. No run counts as stalled.
class SceneSimulation {
public:
    /// Copies the scene and places its bodies at `t_start`.
    /// @throws std::invalid_argument as `simulate`, and for options with sample times.
    SceneSimulation(const Scene& scene, const SceneOptions& options);
    ~SceneSimulation();
    SceneSimulation(SceneSimulation&&) noexcept;
    SceneSimulation& operator=(SceneSimulation&&) noexcept;

    /// Advances to the next event, or to the time `to` [s] where none happens up to then; events
    /// at that time have then happened. Returns whether there was an event. A time before `t()`
    /// counts as `t()`, one after the end as the end.
    bool advance(double to);

    [[nodiscard]] double t() const noexcept;    ///< [s] time reached
    [[nodiscard]] bool ended() const noexcept;  ///< at `t_end`, or where the run cannot go on
    /// Events of the last `advance`, all at one time; valid until the next.
    [[nodiscard]] std::span<const SceneEvent> events() const noexcept;
    /// States and counts at `t()`, as `simulate` returns them at its end, without the events.
    [[nodiscard]] SceneRun run() const;

private:
    struct Parts;
    std::unique_ptr<Parts> parts_;
};

/// Describes, in text, how the scene would be run: islands and their motion, which bodies can meet
/// and when they first do, which tests are skipped and why, and memory. Simulates nothing.
/// @throws std::invalid_argument as `simulate`.
[[nodiscard]] std::string explain(const Scene& scene, const SceneOptions& options);

/// Energy [J] of the bodies that are not part of systems: kinetic, and potential of gravity and
/// springs, at places that count the periods gone. `bodies` holds one state for each body.
[[nodiscard]] double energy(const Scene& scene, const std::vector<BodyState>& bodies);
/// The same, and that of turning discs; `turns` has one entry for each body, or none.
[[nodiscard]] double energy(const Scene& scene, const std::vector<BodyState>& bodies,
                            const std::vector<BodyTurn>& turns);

// Lasting contact of the bodies of a scene: stacks, sleeping bodies that lean on each other, chains
// over an edge. Requires the contact solver; link the separate library `ricochet::scene_contact`.

/// Solver of lasting contacts, by Moreau's time stepping with steps `SceneOptions::contact_step`:
///
///     simulate(scene, {.t_end = 10, .contacts = scene_contacts()})
///
/// Never null; valid as long as the program runs.
[[nodiscard]] const SceneContacts* scene_contacts() noexcept;

// Scenes as JSON text.

/// Error in the text of a scene. The message is one sentence that begins with file and line:
/// "bin.json:12: expected a number for "radius", found "big"".
class SceneFileError : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

/// A scene and the options of its run, as read from a file.
struct SceneFile {
    Scene scene;
    SceneOptions options;  ///< from "run"; t_end is NaN if it is not given
};

/// Reads the scene that `text` describes (docs/scenes.md lists the keys). Error messages name the
/// text `file`.
/// @throws SceneFileError if `text` is not JSON, or is not a valid scene.
[[nodiscard]] SceneFile read_scene(std::string_view text, std::string_view file = "scene");

/// Reads a scene from a file. @throws SceneFileError also if the file cannot be read.
[[nodiscard]] SceneFile load_scene(const std::string& path);

}  // namespace ricochet
