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
#include "ricochet/systems/bouncing_ball.hpp"
#include "ricochet/systems/coulomb_oscillator.hpp"
#include "ricochet/systems/impact_oscillator.hpp"
#include "ricochet/systems/pendulum.hpp"
#include "ricochet/systems/stick_slip.hpp"
#include "ricochet/systems/thermostat.hpp"
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
class ReadyDoor final : public RunDoor {
public:
    ReadyDoor(const System& system, std::string_view name)
        : system_(system, name, watch()), door_(system_, State{})
    {
    }

    void choose_method(detail::RunSetup<State>& setup) override
    {
        if constexpr (std::is_same_v<Method, MethodByName>) {
            RunDoor::choose_method(setup);
        } else {
            detail::step_by_series<Watched<System>, State, Method::components>(setup);
        }
    }

    [[nodiscard]] const detail::SystemTable<State>& table() const noexcept override
    {
        return detail::system_table<Watched<System>, State>;
    }
    [[nodiscard]] void* door() noexcept override
    {
        return static_cast<detail::Door<Watched<System>, State>*>(&door_);
    }
    [[nodiscard]] bool is_free() const noexcept override { return true; }

private:
    Watched<System> system_;
    detail::StepperDoor<Watched<System>, State, Method> door_;
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
    detail::PartsOfRun<Watched<System>, X, Stepping, Extremum, Newton> parts(
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
    explicit ReadySource(const typename System::Parameters& parameters) : system_(parameters) {}

    [[nodiscard]] const System& system() const noexcept { return system_; }

    [[nodiscard]] std::unique_ptr<RunDoor> open(const State& x0) const override
    {
        require_size(x0);
        return std::make_unique<ReadyDoor<Driven, MethodByName>>(system_, System::name);
    }

    [[nodiscard]] std::unique_ptr<RunDoor> open_by_series(const State& x0) const override
    {
        require_size(x0);
        constexpr std::size_t components = detail::fixed_size<X>();
        return std::make_unique<ReadyDoor<Driven, detail::TaylorOf<components>>>(system_,
                                                                                 System::name);
    }

    [[nodiscard]] std::unique_ptr<RunDoor> open_implicit(const State& x0) const override
    {
        return implicit_door(open(x0), x0);
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
            names.emplace_back(name.empty() ? "floor" : name);
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

template <class System, std::size_t... i>
typename System::Parameters parameters_from(std::span<const double> values,
                                            std::index_sequence<i...>)
{
    return {values[i]...};
}

template <class System, std::size_t count>
std::shared_ptr<Source> made(std::span<const double> values)
{
    static_assert(sizeof(typename System::Parameters) == count * sizeof(double));
    if (values.size() != count) {
        throw std::invalid_argument(std::string(System::name) + ": found " +
                                    std::to_string(values.size()) + " parameters, expected " +
                                    std::to_string(count));
    }
    return std::make_shared<ReadySource<System>>(
        parameters_from<System>(values, std::make_index_sequence<count>{}));
}

template <class System>
const System* as(const Source& source)
{
    const auto* ready = dynamic_cast<const ReadySource<System>*>(&source);
    return ready ? &ready->system() : nullptr;
}

}  // namespace

std::shared_ptr<Source> ready_system(std::string_view name, std::span<const double> parameters)
{
    if (name == BouncingBall::name) return made<BouncingBall, 2>(parameters);
    if (name == Pendulum::name) return made<Pendulum, 2>(parameters);
    if (name == ImpactOscillator::name) return made<ImpactOscillator, 4>(parameters);
    if (name == CoulombOscillator::name) return made<CoulombOscillator, 4>(parameters);
    if (name == StickSlip::name) return made<StickSlip, 5>(parameters);
    if (name == Thermostat::name) return made<Thermostat, 5>(parameters);
    throw std::invalid_argument("ready_system: found no system '" + std::string(name) + "'");
}

std::vector<double> closed_form(const Source& system, std::string_view what,
                                std::span<const double> arguments)
{
    for (const double argument : arguments) {
        if (std::isfinite(argument)) continue;
        throw std::invalid_argument(std::string(what) + ": found " + std::to_string(argument) +
                                    ", expected finite numbers");
    }
    const auto argument = [&](std::size_t i) { return i < arguments.size() ? arguments[i] : 0; };
    const auto count = [&](std::size_t i) {
        const double n = argument(i);
        if (n >= 0 && n <= std::numeric_limits<int>::max() && n == std::floor(n)) {
            return static_cast<int>(n);
        }
        throw std::invalid_argument(std::string(what) + ": found n = " + std::to_string(n) +
                                    ", expected a whole number that is not negative");
    };
    if (const auto* ball = as<BouncingBall>(system)) {
        if (what == "impact_time") return {ball->impact_time(count(0), argument(1), argument(2))};
        if (what == "zeno_time") return {ball->zeno_time(argument(0), argument(1))};
    } else if (const auto* pendulum = as<Pendulum>(system)) {
        if (what == "half_period") return {pendulum->half_period(argument(0))};
    } else if (const auto* oscillator = as<ImpactOscillator>(system)) {
        if (what == "impacts") return oscillator->impacts(argument(0));
    } else if (const auto* coulomb = as<CoulombOscillator>(system)) {
        if (what == "turning_time") return {coulomb->turning_time(count(0))};
        if (what == "turning_point") return {coulomb->turning_point(count(0), argument(1))};
    } else if (const auto* thermostat = as<Thermostat>(system)) {
        if (what == "switch_time") return {thermostat->switch_time(count(0), argument(1))};
    }
    throw std::invalid_argument("closed_form: found no function '" + std::string(what) + "'");
}

}  // namespace ricochet::python
