// Scenes as FMUs for co-simulation: one library, which finds the scene in its resources.
//
// The variables of a body "a" are a.x, a.y, a.vx and a.vy, and a.angle and a.spin where discs turn;
// names that are none in FMI's structured naming are quoted. An event mode is at every event of the
// scene; until it has been handled the velocities are those before it.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "fmi/export/references.hpp"
#include "ricochet/scene/simulate.hpp"

namespace ricochet::fmi::detail {

namespace {

/// The last time that is resolved: a run computes nothing ahead, so that its end may be far away.
/// An oscillation is resolved up to 1e12 periods.
[[nodiscard]] double horizon(const Scene& scene, double t_start)
{
    double most = std::max(1e9, 2 * std::fabs(t_start));
    for (const Scene::Surface& surface : scene.surfaces()) {
        const auto* const motion = std::get_if<Oscillation>(&surface.motion);
        if (motion) most = std::min(most, 1e12 / motion->frequency);
    }
    return most;
}

[[nodiscard]] bool is_identifier(std::string_view name)
{
    const auto is_letter = [](unsigned char c) { return std::isalpha(c) || c == '_'; };
    const auto is_inner = [&](unsigned char c) { return is_letter(c) || std::isdigit(c); };
    return !name.empty() && is_letter(static_cast<unsigned char>(name[0])) &&
           std::ranges::all_of(name, is_inner);
}

/// A name in FMI's structured naming: "row 3 1", a body of a grid, as row[3,1]; names that are no
/// identifiers in quotes.
[[nodiscard]] std::string structured(std::string_view name)
{
    const std::size_t space = std::min(name.find(' '), name.size());
    const std::string_view first = name.substr(0, space);
    std::string numbers(name.substr(space));
    const bool counts =
        std::ranges::all_of(numbers, [](unsigned char c) { return c == ' ' || std::isdigit(c); });
    if (is_identifier(first) && first != "gravity" && counts && !numbers.ends_with(' ')) {
        if (numbers.empty()) return std::string(first);
        std::ranges::replace(numbers, ' ', ',');
        return fmt::format("{}[{}]", first, numbers.substr(1));
    }
    std::string out = "'";
    for (const char c : name) {
        if (c == '\'' || c == '\\') out += '\\';
        out += c;
    }
    return out + '\'';
}

/// The scene of a file, and what the description says of it. What a library is told is the name of
/// the model, with a hash of the file behind #, and start values.
struct Told {
    SceneFile file;
    bool turns = false;
    ModelFacts said;

    explicit Told(const ModelSource& source) : file(read_scene(source.resource, "model.json"))
    {
        const Scene& scene = file.scene;
        ModelFacts& facts = said;
        const std::string_view first = source.told.substr(0, source.told.find(' '));
        facts.name = facts.identifier = first.substr(0, first.find('#'));
        facts.rates = facts.tunable = false;
        facts.co_simulation = true;
        facts.t_start = file.options.t_start;
        facts.t_end = std::isnan(file.options.t_end) ? facts.t_start + 1 : file.options.t_end;
        for (const Disc& body : scene.bodies()) turns = turns || body.inertia > 0;
        for (std::uint32_t i = 0; i < scene.bodies().size(); ++i) {
            const Disc& body = scene.bodies()[i];
            const std::string name = structured(scene.name_of(BodyId{i}));
            add(facts.states, name + ".x", body.at[0], "m");
            add(facts.states, name + ".y", body.at[1], "m");
            add(facts.states, name + ".vx", body.velocity[0], "m/s");
            add(facts.states, name + ".vy", body.velocity[1], "m/s");
            if (!turns) continue;
            add(facts.states, name + ".angle", body.angle, "rad");
            add(facts.states, name + ".spin", body.spin, "rad/s");
        }
        add(facts.parameters, "gravity.x", scene.settings().gravity[0], "m/s2");
        add(facts.parameters, "gravity.y", scene.settings().gravity[1], "m/s2");
        for (const Material& material : scene.materials().subspan(1)) {
            const std::string name = structured(material.name);
            add(facts.parameters, name + ".restitution", material.restitution, "");
            add(facts.parameters, name + ".friction", material.friction, "");
        }
        facts.outputs.push_back({"energy", 0, "J", "of motion, gravity and springs"});
        std::string_view starts = source.told.substr(first.size());
        // The description does not tell walls and springs: the token tells the file.
        facts.told = fmt::format("{}#{:016x}{}", facts.name, hash(source.resource), starts);
        if (!starts.empty()) starts.remove_prefix(1);
        facts.take_starts(starts);
    }

private:
    void add(std::vector<Exported>& to, std::string name, double start, const char* unit)
    {
        to.push_back({said.keep(std::move(name)), start, unit});
    }
};

class SceneModel final : private Told, public ExportedModel {
public:
    explicit SceneModel(const ModelSource& source) : Told(source), ExportedModel(said)
    {
        (void)scene();  // refuses what cannot be run
    }

    void start() override
    {
        t_first_ = t;
        x_first_ = x;
        begin();
    }

    void rates(std::span<double> /*dxdt*/) override {}
    void outputs(std::span<double> values) override
    {
        std::vector<BodyState> bodies;
        std::vector<BodyTurn> angles;
        for (std::size_t i = 0; i < count(); ++i) {
            const double* const at = of(i);
            bodies.push_back({.at = {at[0], at[1]}, .velocity = {at[2], at[3]}});
            if (turns) angles.push_back({at[4], at[5]});
        }
        for (std::size_t i = 0; i < winding_.size(); ++i) bodies[i].winding = winding_[i];
        values[0] = energy(file.scene, bodies, angles);
    }
    void indicators(std::span<double> /*z*/) override {}
    ModelUpdate update() override { return {}; }

    ModelStep step(double to, bool stops_at_events) override
    {
        ModelStep out;
        std::vector<SceneEvent> happened;
        while (advance(to)) {
            if (!stops_at_events) continue;
            // Everything of this instant is one event.
            do {
                const auto some = simulation_->events();
                happened.insert(happened.end(), some.begin(), some.end());
            } while (advance(simulation_->t()));
            out.event = true;
            break;
        }
        const SceneRun run = show();
        out.failure = run.message;
        for (auto event = happened.rbegin(); event != happened.rend(); ++event) show_before(*event);
        waits_ = out.event;
        return out;
    }

    void handle_event() override
    {
        if (waits_) (void)show();
        waits_ = false;
    }

    ModelState save() override
    {
        ModelState out;
        ricochet::detail::SnapshotWriter writer(out.own);
        visit(writer);
        return out;
    }

    /// Takes the run again from its start, whose bits do not depend on where it stops on its way.
    void restore(const ModelState& saved) override
    {
        ricochet::detail::SnapshotReader reader(saved.own);
        visit(reader);
        reader.finish();
        const ModelFacts& all = ExportedModel::facts();
        if (x.size() != all.states.size() || parameters.size() != all.parameters.size() ||
            x_first_.size() != x.size() || saved.run) {
            throw std::invalid_argument("the state is of another model");
        }
        simulation_.reset();
        if (!started_) return;
        const std::vector<double> x_now = x;
        const std::uint64_t events_now = events, advances_now = advances_;
        const double t_now = t;
        begin();
        while (advances_ < advances_now && advance(t_now + 1)) {
        }
        while (advance(t_now)) {
        }
        (void)show();
        if (advances_ != advances_now || events != events_now || t != t_now) {
            throw std::invalid_argument("the state is of another run");
        }
        x = x_now;
    }

private:
    [[nodiscard]] std::size_t count() const { return file.scene.bodies().size(); }
    [[nodiscard]] std::size_t components() const { return turns ? 6 : 4; }
    [[nodiscard]] double* of(std::size_t body) { return x.data() + components() * body; }

    /// The scene with the parameters and the start of this instance.
    [[nodiscard]] Scene scene()
    {
        Scene out = file.scene;
        out.set_gravity({parameters[0], parameters[1]});
        for (std::size_t k = 1; k < out.materials().size(); ++k) {
            out.set_coefficients(MaterialId{static_cast<std::uint32_t>(k)}, parameters[2 * k],
                                 parameters[2 * k + 1]);
        }
        for (std::uint32_t i = 0; i < count(); ++i) {
            const double* const at = of(i);
            out.set_start(BodyId{i}, {at[0], at[1]}, {at[2], at[3]});
            if (turns) out.set_turn(BodyId{i}, at[4], at[5]);
        }
        return out;
    }

    /// Begins the run from the start that is kept.
    void begin()
    {
        x = x_first_;
        t = t_first_;
        file.scene = scene();
        SceneOptions options = file.options;
        options.t_start = t;
        options.t_end = horizon(file.scene, t);
        options.sample_times.clear();
        options.contacts = scene_contacts();
        simulation_.emplace(file.scene, options);
        started_ = true;
        waits_ = false;
        advances_ = 0;
        (void)show();
    }

    bool advance(double to)
    {
        const bool event = simulation_->advance(to);
        advances_ += event;
        return event;
    }

    /// Takes time and state from the run.
    SceneRun show()
    {
        SceneRun run = simulation_->run();
        t = run.t;
        events = run.statistics.events;
        for (std::size_t i = 0; i < count(); ++i) {
            double* const at = of(i);
            std::ranges::copy(run.bodies[i].at, at);
            std::ranges::copy(run.bodies[i].velocity, at + 2);
            if (!turns) continue;
            at[4] = run.turns[i].angle;
            at[5] = run.turns[i].spin;
        }
        winding_.clear();
        for (const BodyState& body : run.bodies) winding_.push_back(body.winding);
        return run;
    }

    /// Shows the velocities before an event.
    void show_before(const SceneEvent& event)
    {
        std::ranges::copy(event.before[0], of(event.body) + 2);
        if (event.other.is_surface || event.other.index == event.body) return;
        std::ranges::copy(event.before[1], of(event.other.index) + 2);
    }

    template <class Visitor>
    void visit(Visitor& visit)
    {
        visit(t);
        visit(events);
        visit(waits_);
        visit(started_);
        visit(advances_);
        visit(t_first_);
        visit.state(x);
        visit.state(x_first_);
        visit.state(parameters);
    }

    std::optional<SceneSimulation> simulation_;
    std::vector<std::array<std::int32_t, 2>> winding_;
    bool waits_ = false, started_ = false;
    std::uint64_t advances_ = 0;  ///< that ended at an event
    // Where the run began.
    double t_first_ = 0;
    std::vector<double> x_first_ = x;
};

}  // namespace

std::unique_ptr<ExportedModel> make_exported_model(const ModelSource& source)
{
    return std::make_unique<SceneModel>(source);
}

}  // namespace ricochet::fmi::detail
