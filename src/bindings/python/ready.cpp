#include "ready.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <functional>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include "implicit.hpp"
#include "ricochet/simulation.hpp"
#include "ricochet/systems/ready.hpp"
#include "ricochet/taylor/taylor.hpp"

namespace ricochet::python {

namespace {

/// A system whose guard evaluations let Python handle signals.
template <class System>
struct Watched : System {
    static constexpr bool unchecked_names = true;

    constexpr Watched() = default;  // needed by Taylor's method to read the operations
    Watched(const System& system, std::string_view name_of, SignalWatch& watch)
        : System(system), name(name_of), watch_(&watch)
    {
    }

    std::string_view name;  ///< both friction oscillators are `FrictionOscillator` here

    template <class... Arguments>
    requires requires(const System& system, const Arguments&... arguments)
    {
        system.guard(arguments...);
    }
    [[nodiscard]] constexpr auto guard(const Arguments&... arguments) const noexcept
    {
        if (watch_) watch_->tick();
        return System::guard(arguments...);
    }

private:
    SignalWatch* watch_ = nullptr;
};

/// @tparam Method  of the steps
template <class System, class Method>
class ReadyAdapter final : public RunAdapter {
public:
    ReadyAdapter(const System& system, std::string_view name)
        : system_(system, name, watch()), adapter_(system_, State{})
    {
    }

    void choose_method(detail::RunBindings<State>& setup) override
    {
        if constexpr (std::is_same_v<Method, MethodByName>) {
            RunAdapter::choose_method(setup);
        } else {
            detail::step_by_series<Watched<System>, State, Method::components>(setup);
        }
    }

    [[nodiscard]] const detail::SystemTable<State>& table() const noexcept override
    {
        return detail::system_table<Watched<System>, State>;
    }
    [[nodiscard]] void* adapter() noexcept override
    {
        return static_cast<detail::SystemAdapter<Watched<System>, State>*>(&adapter_);
    }
    [[nodiscard]] bool is_free() const noexcept override { return true; }

private:
    Watched<System> system_;
    detail::StepperAdapter<Watched<System>, State, Method> adapter_;
};

/// A whole run by the loop for `System`.
template <class System, class Method>
Record run_by(const Method& method, const Watched<System>& system, const State& x0,
              const Request& request)
{
    using X = typename System::State;
    using Stepping = ErrorControlled<Method>;
    X start;
    std::copy_n(x0.begin(), start.size(), start.begin());
    detail::RunComponents<Watched<System>, X, Stepping, Extremum, Newton> parts(
        system, start, Stepping{method}, Extremum{}, Newton{});
    auto setup = parts.setup();
    setup.cancels_by_itself = true;
    return record_of(detail::run_whole(setup, detail::core_state(start), request.options));
}

template <class System>
class ReadySource final : public Source {
    using X = typename System::State;
    using Driven = std::conditional_t<std::is_base_of_v<FrictionOscillator, System>,
                                      FrictionOscillator, System>;

public:
    explicit ReadySource(const System& system) : system_(system) {}

    [[nodiscard]] std::unique_ptr<RunAdapter> open(const State& x0) const override
    {
        require_size(x0);
        return std::make_unique<ReadyAdapter<Driven, MethodByName>>(system_, System::name);
    }

    [[nodiscard]] std::unique_ptr<RunAdapter> open_by_series(const State& x0) const override
    {
        require_size(x0);
        constexpr std::size_t components = detail::fixed_size<X>();
        return std::make_unique<ReadyAdapter<Driven, detail::TaylorOf<components>>>(system_,
                                                                                    System::name);
    }

    [[nodiscard]] std::unique_ptr<RunAdapter> open_implicit(const State& x0) const override
    {
        return implicit_adapter(open(x0), x0);
    }

    [[nodiscard]] std::optional<Record> run_whole(const State& x0, const Request& request,
                                                  SignalWatch& watch) const override
    {
        if (!request.is_plain()) return std::nullopt;
        require_size(x0);
        const Watched<Driven> watched(system_, System::name, watch);
        if (request.method == MethodName::dopri5) return run_by(Dopri5{}, watched, x0, request);
        return run_by(MethodByName{request.method}, watched, x0, request);
    }

    [[nodiscard]] std::vector<std::string> mode_names() const override
    {
        std::vector<std::string> names;
        if constexpr (requires { System::mode_count; }) {
            for (Mode mode = 0; mode < System::mode_count; ++mode) {
                names.emplace_back(System::mode_name(mode));
            }
        }
        return names;
    }

    [[nodiscard]] std::vector<std::string> guard_names() const override
    {
        std::vector<std::string> names;
        for (std::size_t i = 0; i < guard_count_of<X>(system_); ++i) {
            const std::string_view name = guard_info_of<X>(system_, i).name;
            names.emplace_back(name.empty() ? System::descriptor().guard_name : name);
        }
        return names;
    }

    [[nodiscard]] Mode start_mode() const noexcept override
    {
        if constexpr (requires { System::start_mode; }) return System::start_mode;
        return 0;
    }

private:
    void require_size(const State& x0) const
    {
        constexpr std::size_t components = detail::fixed_size<X>();
        if (x0.size() == components) return;
        throw std::invalid_argument(std::string(System::name) + ": found a start of " +
                                    std::to_string(x0.size()) + " components, expected " +
                                    std::to_string(components));
    }

    System system_;
};

}  // namespace

std::shared_ptr<Source> ready_system(std::string_view name, std::span<const double> parameters)
{
    std::shared_ptr<Source> made;
    ReadySystems::for_each([&]<class System>() {
        if (name != System::name) return;
        made = std::make_shared<ReadySource<System>>(with_parameters<System>(parameters));
    });
    if (made) return made;
    throw std::invalid_argument("ready_system: found no system '" + std::string(name) + "'");
}

namespace {

const KnownFunction& known_function(std::string_view system, std::string_view function)
{
    for (const ReadyDescription& each : ready_descriptions()) {
        if (each.system->name != system) continue;
        for (const KnownFunction& known : each.system->known) {
            if (known.name == function) return known;
        }
    }
    throw std::invalid_argument("closed_form: found no function '" + std::string(function) + "'");
}

void check_argument(std::string_view function, const KnownFunction::Argument& argument,
                    double given)
{
    const std::string found = std::string(function) + ": found " + std::string(argument.name) +
                              " = " + std::to_string(given);
    if (!std::isfinite(given)) throw std::invalid_argument(found + ", expected a finite number");
    const bool whole =
        given >= 0 && given <= std::numeric_limits<int>::max() && given == std::floor(given);
    if (!argument.whole || whole) return;
    throw std::invalid_argument(found + ", expected a whole number that is not negative");
}

}  // namespace

std::vector<double> closed_form(std::string_view system, std::string_view function,
                                std::span<const double> parameters,
                                std::span<const double> arguments)
{
    const KnownFunction& known = known_function(system, function);
    if (arguments.size() != known.arguments.size()) {
        throw std::invalid_argument(std::string(function) + ": found " +
                                    std::to_string(arguments.size()) + " arguments, expected " +
                                    std::to_string(known.arguments.size()));
    }
    for (std::size_t i = 0; i < arguments.size(); ++i) {
        check_argument(function, known.arguments[i], arguments[i]);
    }
    return known.values(parameters, arguments);
}

std::vector<ReadyDescription> ready_descriptions()
{
    std::vector<ReadyDescription> all;
    ReadySystems::for_each([&]<class System>() {
        ReadyDescription description{&System::descriptor(), {}};
        if constexpr (requires { System::mode_count; }) {
            for (Mode mode = 0; mode < System::mode_count; ++mode) {
                description.modes.emplace_back(System::mode_name(mode));
            }
        }
        all.push_back(std::move(description));
    });
    return all;
}

}  // namespace ricochet::python
