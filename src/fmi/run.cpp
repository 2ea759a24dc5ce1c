#include "ricochet/fmi/run.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <stdexcept>

#include "fmi/parts.hpp"

namespace ricochet::fmi {

namespace {

std::unique_ptr<Simulation::Parts> start(const Fmu& fmu, const Options& options)
{
    const Description& d = fmu.description();
    const bool watches = !options.watch.empty();
    const bool co =
        options.co_simulation.value_or(watches || (!d.model_exchange && d.co_simulation));
    if (watches && !co) {
        throw Error(
            fmt::format("{}: found a watch of '{}' in model exchange; expected co-simulation",
                        d.file, options.watch.front().name));
    }
    if (co) return std::make_unique<Steps>(fmu, options);
    return std::make_unique<Phases>(fmu, options);
}

}  // namespace

std::string_view name(Method method) noexcept
{
    switch (method) {
        case Method::automatic: return "automatic";
        case Method::dopri5: return "dopri5";
        case Method::fehlberg78: return "fehlberg78";
        case Method::rosenbrock4: return "rosenbrock4";
    }
    return "unknown";
}

std::string_view name(End end) noexcept
{
    switch (end) {
        case End::reached_end: return "reached_end";
        case End::terminated: return "terminated";
        case End::chattering: return "chattering";
        case End::call_failed: return "call_failed";
        case End::not_integrated: return "not_integrated";
    }
    return "unknown";
}

std::string describe(const Causes& causes)
{
    std::vector<std::string_view> names;
    if (causes.state) names.emplace_back("state");
    if (causes.time) names.emplace_back("time");
    if (causes.step) names.emplace_back("step");
    if (causes.input) names.emplace_back("input");
    if (causes.passage) names.emplace_back("passage");
    return fmt::format("{}", fmt::join(names, " and "));
}

std::string describe(const Run& run)
{
    switch (run.end) {
        case End::reached_end: return "the end was reached";
        case End::terminated:
            return fmt::format("the FMU has asked for the end at t = {} s", run.t);
        case End::chattering:
        case End::call_failed: return run.message;
        case End::not_integrated: break;
    }
    return fmt::format("{} at t = {} s: {}", ricochet::name(run.integration), run.t, run.message);
}

double Run::last(std::string_view name) const
{
    const auto found = std::ranges::find(output, name);
    if (found == output.end() || rows.empty()) {
        throw std::invalid_argument(fmt::format("fmi::Run: no value of '{}' is recorded", name));
    }
    return rows.back().values[static_cast<std::size_t>(found - output.begin())];
}

Simulation::Simulation(const Fmu& fmu, const Options& options) : parts_(start(fmu, options)) {}
Simulation::~Simulation() = default;
Simulation::Simulation(Simulation&&) noexcept = default;
Simulation& Simulation::operator=(Simulation&&) noexcept = default;

double Simulation::t() const noexcept
{
    return parts_->t;
}

const std::vector<double>& Simulation::x() const noexcept
{
    return parts_->run.x;
}

bool Simulation::ended() const noexcept
{
    return parts_->ended;
}

const Run& Simulation::run() const noexcept
{
    return parts_->run;
}

bool Simulation::advance()
{
    if (parts_->ended) return false;
    parts_->attempt([&] { parts_->advance(); });
    return !parts_->ended;
}

void Simulation::set(std::string_view name, double value)
{
    const Description& d = parts_->instance.description();
    const std::optional<Element> element = d.find(name);
    if (!element) throw Error(fmt::format("{}: has no variable '{}'", d.file, name));
    const Variable& v = d.variables[element->variable];
    const bool tunable =
        v.causality == Causality::parameter && v.variability == Variability::tunable;
    const bool input = v.causality == Causality::input && !parts_->inputs.gives(*element);
    if (!tunable && !input) {
        throw Error(
            fmt::format("{}: '{}' cannot be set during a run; expected a tunable parameter "
                        "or an input without a table",
                        d.file, name));
    }
    if (parts_->ended) throw Error(fmt::format("{}: the run has ended", d.file));
    parts_->attempt([&] { parts_->answer(*element, value); });
}

double Simulation::get(std::string_view name)
{
    const Description& d = parts_->instance.description();
    const std::optional<Element> element = d.find(name);
    if (!element) throw Error(fmt::format("{}: has no variable '{}'", d.file, name));
    return parts_->instance.get(*element);
}

struct SavedRun::Kept {
    std::shared_ptr<Simulation::Parts> parts;  // first: its instance frees the state
    Progress progress;
    std::function<void()> own;
    std::shared_ptr<void> state;
};

SavedRun Simulation::save()
{
    SavedRun saved;
    saved.kept_ = std::make_shared<SavedRun::Kept>(
        SavedRun::Kept{parts_, *parts_, parts_->keep(), parts_->instance.save_state()});
    return saved;
}

void Simulation::restore(const SavedRun& saved)
{
    const std::string& file = parts_->instance.description().file;
    if (!saved.kept_ || saved.kept_->parts != parts_) {
        throw Error(fmt::format("{}: found a saved run of another simulation", file));
    }
    parts_->instance.restore_state(saved.kept_->state.get());
    static_cast<Progress&>(*parts_) = saved.kept_->progress;
    saved.kept_->own();
}

Run Simulation::finish()
{
    while (advance()) {
    }
    parts_->run.calls = parts_->instance.calls;
    return parts_->run;
}

Run run(const Fmu& fmu, const Options& options)
{
    return Simulation(fmu, options).finish();
}

}  // namespace ricochet::fmi
