// A system of this library as an FMU, of FMI 2.0 and 3.0, for model exchange and co-simulation.
//
//     // ball.cpp
//     #include <ricochet/fmi/export.hpp>
//     #include <ricochet/systems/bouncing_ball.hpp>
//
//     struct Ball {
//         static constexpr ricochet::fmi::Exported states[] = {{"height", 10, "m"}, {"velocity", 0,
//         "m/s"}}; static constexpr ricochet::fmi::Exported parameters[] = {{"gravity", 9.81,
//         "m/s2"}, {"restitution", 0.9}}; static ricochet::BouncingBall make(std::span<const
//         double> p)
//         {
//             return ricochet::BouncingBall({.gravity = p[0], .restitution = p[1]});
//         }
//     };
//     RICOCHET_FMU(Ball)
//
// and in CMake, with find_package(ricochet COMPONENTS fmi),
//
//     ricochet_add_fmu(ball SOURCES ball.cpp)
//
// A model has the members of the ball, and may have
//
//     static constexpr const char* name          of the model; else that of the target
//     static constexpr Exported inputs[]         and static void set_inputs(System&,
//     std::span<const double> inputs) static constexpr Exported outputs[]        and static void
//     get_outputs(const System&, Mode, double t, const State&,
//                                                                             std::span<double>
//                                                                             outputs)
//     static constexpr Mode mode                 at the start; or, by the state there,
//     static Mode mode_at(const System&, const State&)
//     using State                                else that of the system
//     using Method                               else Dopri5; for co-simulation
//     static constexpr double rtol, t_end        1e-10 and 10 s; for co-simulation, of the default
//     experiment
//
// In co-simulation the loop of this library runs inside, one run from communication point to
// communication point, so that events are where they are in a run of its own. In model exchange the
// other tool integrates and locates: its events are as accurate as that tool. Parameters are
// tunable; changes of parameters and inputs hold from the next communication point on.
#pragma once

#include <algorithm>
#include <concepts>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "ricochet/fmi/detail/exchange.hpp"
#include "ricochet/fmi/detail/exported.hpp"
#include "ricochet/ricochet.hpp"

namespace ricochet::fmi {

namespace detail {

using ricochet::detail::copy_state;
using ricochet::detail::core_state;
using ricochet::detail::CoreState;
using ricochet::detail::SystemAdapter;

template <class Model>
using SystemOf = std::remove_cvref_t<decltype(Model::make(std::span<const double>()))>;

template <class Model>
struct StateOf {
    using type = typename SystemOf<Model>::State;
};
template <class Model>
requires requires
{
    typename Model::State;
}
struct StateOf<Model> {
    using type = typename Model::State;
};

template <class Model>
struct MethodOf {
    using type = Dopri5;
};
template <class Model>
requires requires
{
    typename Model::Method;
}
struct MethodOf<Model> {
    using type = typename Model::Method;
};

template <class Model>
[[nodiscard]] constexpr double rtol_of() noexcept
{
    if constexpr (requires { Model::rtol; }) return Model::rtol;
    return 1e-10;
}

template <class Model>
[[nodiscard]] constexpr Mode start_mode() noexcept
{
    if constexpr (requires { Model::mode; }) return Model::mode;
    return 0;
}

template <class Model>
class ExportedOf final : public ExportedModel {
    using System = SystemOf<Model>;
    using X = typename StateOf<Model>::type;
    using C = CoreState<X>;
    using Run = ricochet::Simulation<System, X, ErrorControlled<typename MethodOf<Model>::type>>;
    // The inclusion of a set-valued system is followed by the loop of this library alone.
    static constexpr bool exchanges = !requires(const System& system) { system.set_valued(); }
    &&!requires(const System& system) { system.set_valued(Mode{}); };

public:
    /// What the description says of the model. @param identifier  of the library
    [[nodiscard]] static ModelFacts facts_of(const char* identifier, bool me, bool cs)
    {
        ModelFacts facts;
        facts.name = facts.identifier = identifier;
        if constexpr (requires { Model::name; }) facts.name = Model::name;
        facts.states.assign(std::begin(Model::states), std::end(Model::states));
        if constexpr (requires { Model::parameters; }) {
            facts.parameters.assign(std::begin(Model::parameters), std::end(Model::parameters));
        }
        if constexpr (requires { Model::inputs; }) {
            facts.inputs.assign(std::begin(Model::inputs), std::end(Model::inputs));
        }
        if constexpr (requires { Model::outputs; }) {
            facts.outputs.assign(std::begin(Model::outputs), std::end(Model::outputs));
        }
        facts.modes = Moded<System, X>;
        facts.model_exchange = me && exchanges;
        facts.co_simulation = cs;
        facts.t_end = 10;
        if constexpr (requires { Model::t_end; }) facts.t_end = Model::t_end;
        std::vector<double> p;
        for (const Exported& parameter : facts.parameters) p.push_back(parameter.start);
        if constexpr (exchanges && Guarded<System, X>) {
            const System system = Model::make(p);
            for (std::size_t i = 0; i < guard_count_of<X>(system); ++i) {
                const GuardInfo info = guard_info_of<X>(system, i);
                facts.guards.emplace_back(info.name.empty() ? "guard " + std::to_string(i + 1)
                                                            : std::string(info.name));
            }
        }
        return facts;
    }

    explicit ExportedOf(ModelFacts facts) : ExportedModel(std::move(facts))
    {
        mode = start_mode<Model>();
    }

    void start() override
    {
        make_system();
        if constexpr (requires(const System& system, const X& at) {
                          {
                              Model::mode_at(system, at)
                              } -> std::convertible_to<Mode>;
                      }) {
            mode = Model::mode_at(*system_, state());
        }
        run_.reset();
        waits_ = false;
        if constexpr (exchanges) {
            if (this->facts().model_exchange) exchange_.start(t, core_state(state()), mode);
        }
    }

    void rates(std::span<double> dxdt) override
    {
        refresh();
        if constexpr (exchanges) {
            const C at = core_state(state());
            C rate = at;
            exchange_.rates(t, at, mode, rate);
            std::copy_n(rate.begin(), dxdt.size(), dxdt.begin());
        } else {
            std::fill(dxdt.begin(), dxdt.end(), 0.0);
        }
    }

    void outputs([[maybe_unused]] std::span<double> values) override
    {
        refresh();
        if constexpr (requires { Model::outputs; }) {
            Model::get_outputs(*system_, mode, t, state(), values);
        }
    }

    // --- model exchange ---

    void indicators([[maybe_unused]] std::span<double> z) override
    {
        refresh();
        if constexpr (exchanges) exchange_.indicators(t, core_state(state()), mode, z);
    }

    ModelUpdate update() override
    {
        refresh();
        if constexpr (exchanges) {
            C at = core_state(state());
            const ModelUpdate out = exchange_.update(t, at, mode, events);
            copy_state(at, x);
            return out;
        }
        return {};
    }

    // --- co-simulation ---

    ModelStep step(double to, bool stops_at_events) override
    {
        ModelStep out;
        if (!(to > t)) return out;
        const std::uint64_t counted = run_ ? run_->run().statistics.events : 0;
        if (!run_) {
            refresh();
            begin(to, stops_at_events);
        } else {
            run_->extend(to);
            if (changed) {
                refresh();
                run_->restart(t, state(), mode);
            }
        }
        // What happens at the start of a run has happened before the step.
        std::size_t seen = run_->run().events.size();
        while (!out.event && !run_->ended()) {
            run_->step();
            out.event = stops_at_events && has_acted(seen);
        }
        events += run_->run().statistics.events - counted;
        t = run_->t();
        copy_state(run_->x(), x);
        mode = run_->mode();
        const Outcome outcome = run_->run().outcome;
        if (!out.event && outcome != Outcome::reached_end) {
            out.failure = std::string(ricochet::describe(outcome));
        }
        if (out.event) show_before(seen);
        return out;
    }

    void handle_event() override
    {
        if (!waits_) return;
        waits_ = false;
        copy_state(run_->x(), x);
        mode = run_->mode();
    }

    // --- states ---

    ModelState save() override
    {
        ModelState out;
        ricochet::detail::SnapshotWriter writer(out.own);
        visit(writer);
        if (run_) out.run = run_->save();
        return out;
    }

    void restore(const ModelState& saved) override
    {
        refresh();
        ricochet::detail::SnapshotReader reader(saved.own);
        visit(reader);
        reader.finish();
        const ModelFacts& facts = this->facts();
        if (x.size() != facts.states.size() || parameters.size() != facts.parameters.size() ||
            inputs.size() != facts.inputs.size() || x_first_.size() != facts.states.size() ||
            !exchange_.is_valid()) {
            throw std::invalid_argument("the state is of another model");
        }
        make_system();
        run_.reset();
        if (!saved.run) return;
        // A step of any length begins the same run.
        const std::vector<double> x_now = std::exchange(x, x_first_);
        const double t_now = std::exchange(t, t_first_);
        const Mode mode_now = std::exchange(mode, mode_first_);
        begin(std::max(t_now, t_first_) + 1, stops_);
        x = x_now;
        t = t_now;
        mode = mode_now;
        run_->restore(*saved.run);
    }

private:
    [[nodiscard]] X state() const
    {
        X out{};
        copy_state(x, out);
        return out;
    }

    void make_system()
    {
        system_.emplace(Model::make(parameters));
        if constexpr (requires { Model::inputs; }) Model::set_inputs(*system_, inputs);
        changed = false;
        if constexpr (exchanges) {
            adapter_.emplace(*system_, state());
            exchange_.bind(ricochet::detail::system_table<System, X>, &*adapter_, x.size());
        }
    }

    void refresh()
    {
        if (changed || !system_) make_system();
    }

    void begin(double to, bool stops_at_events)
    {
        t_first_ = t;
        x_first_ = x;
        mode_first_ = mode;
        stops_ = stops_at_events;
        run_ = std::make_unique<Run>(*system_, state(),
                                     ricochet::Options{.t_start = t,
                                                       .t_end = to,
                                                       .mode = mode,
                                                       .rtol = rtol_of<Model>(),
                                                       .atol = rtol_of<Model>(),
                                                       .record_events = stops_at_events});
    }

    /// Whether events from number `seen` on have changed the state or the mode; `seen` becomes the
    /// number of the first of them.
    [[nodiscard]] bool has_acted(std::size_t& seen) const
    {
        const auto& all = run_->run().events;
        for (; seen < all.size(); ++seen) {
            const auto& event = all[seen];
            if (event.mode_before != event.mode_after || !(event.before == event.after))
                return true;
        }
        return false;
    }

    /// Shows the state before the event until it is handled.
    void show_before(std::size_t which)
    {
        const auto& event = run_->run().events[which];
        copy_state(event.before, x);
        mode = event.mode_before;
        waits_ = true;
    }

    template <class Visitor>
    void visit(Visitor& visit)
    {
        visit(t);
        visit(mode);
        visit(events);
        visit(waits_);
        visit.state(x);
        if (!parameters.empty()) visit.state(parameters);
        if (!inputs.empty()) visit.state(inputs);
        visit(stops_);
        visit(t_first_);
        visit(mode_first_);
        visit.state(x_first_);
        exchange_.visit(visit);
    }

    std::optional<System> system_;
    std::optional<SystemAdapter<System, X>> adapter_;
    Exchange<C> exchange_;
    std::unique_ptr<Run> run_;
    bool waits_ = false, stops_ = false;
    // Where the run began.
    double t_first_ = 0;
    std::vector<double> x_first_ = std::vector<double>(x.size());
    Mode mode_first_ = 0;
};

}  // namespace detail

}  // namespace ricochet::fmi

// Given by ricochet_add_fmu.
#ifndef RICOCHET_FMU_IDENTIFIER
#define RICOCHET_FMU_IDENTIFIER "model"
#define RICOCHET_FMU_MODEL_EXCHANGE true
#define RICOCHET_FMU_CO_SIMULATION true
#endif

/// Defines the model of an FMU; once in its sources. The names of the library and its interfaces
/// come from `ricochet_add_fmu`.
#define RICOCHET_FMU(Model)                                                                     \
    std::unique_ptr<ricochet::fmi::detail::ExportedModel>                                       \
    ricochet::fmi::detail::make_exported_model(const ModelSource&)                              \
    {                                                                                           \
        return std::make_unique<ExportedOf<Model>>(ExportedOf<Model>::facts_of(                 \
            RICOCHET_FMU_IDENTIFIER, RICOCHET_FMU_MODEL_EXCHANGE, RICOCHET_FMU_CO_SIMULATION)); \
    }
