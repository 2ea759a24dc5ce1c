// The ready systems with their known solutions, as a list for tests.
#pragma once

#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "problems/detest_f1.hpp"
#include "problems/detest_f2.hpp"
#include "problems/detest_f3.hpp"
#include "problems/detest_f4.hpp"
#include "problems/detest_f5.hpp"
#include "problems/grow_decay.hpp"
#include "problems/henon_heiles.hpp"
#include "problems/hidden_pair.hpp"
#include "problems/near_tangent.hpp"
#include "problems/three_body.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/systems/buck_converter.hpp"
#include "ricochet/systems/coulomb_oscillator.hpp"
#include "ricochet/systems/descriptor.hpp"
#include "ricochet/systems/impact_oscillator.hpp"
#include "ricochet/systems/pendulum.hpp"
#include "ricochet/systems/stick_slip.hpp"
#include "ricochet/systems/thermostat.hpp"

namespace ricochet::test {

/// Stepper and detector of a run.
enum class How { dopri5_extremum, dopri5_ends, fehlberg78_extremum };

/// An event of a known solution, or of a run.
struct Happening {
    double t = 0;  ///< [s]
    std::size_t guard = 0;
    EventKind kind = EventKind::crossing;
};

/// A run, for any type of state.
struct PlainRun {
    Outcome outcome = Outcome::reached_end;
    std::vector<Happening> events;
    std::vector<double> x;
    Mode mode = 0;
};

/// A system, a problem and its known solution.
struct KnownSolution {
    std::string name;
    std::vector<double> start;
    Options options{};
    std::vector<Happening> events{};
    std::vector<double> end{};  ///< state at the end; empty: not known
    Mode mode = 0;              ///< at the end
    double time_error = 1e-12;  ///< largest error of an event at t, over max(1, |t|)
    double end_error = 1e-12;   ///< largest error of a component, over max(1, its size)
    /// Methods that can run it at tight tolerances.
    std::vector<How> hows{How::dopri5_extremum, How::dopri5_ends, How::fehlberg78_extremum};
    double turn_at = std::numeric_limits<double>::quiet_NaN();  ///< [s]; see `SystemsBackward`
    std::function<PlainRun(const std::vector<double>& x0, const Options&, How)> run{};
};

template <class X>
[[nodiscard]] PlainRun plain(const Run<X>& run)
{
    PlainRun out{.outcome = run.outcome,
                 .events = {},
                 .x = std::vector<double>(run.x.begin(), run.x.end()),
                 .mode = run.mode};
    for (const Event<X>& event : run.events) {
        out.events.push_back({.t = event.t, .guard = event.guard, .kind = event.kind});
    }
    return out;
}

/// Runs a system from a start given as a vector.
template <class System>
[[nodiscard]] auto runs(const System& system)
{
    using State = typename System::State;
    return [system](const std::vector<double>& from, const Options& options, How how) {
        State x0{};
        for (std::size_t i = 0; i < x0.size(); ++i) x0[i] = from.at(i);
        if (how == How::fehlberg78_extremum) {
            return plain(integrate(system, x0, options, ErrorControlled<Fehlberg78>{}));
        }
        if constexpr (Guarded<System, State>) {
            if (how == How::dopri5_ends) {
                return plain(integrate(system, x0, options, ErrorControlled<Dopri5>{}, Ends{}));
            }
        }
        return plain(integrate(system, x0, options));
    };
}

template <class Array>
[[nodiscard]] std::vector<double> as_vector(const Array& x)
{
    return std::vector<double>(x.begin(), x.end());
}

/// Crossings of one guard.
[[nodiscard]] inline std::vector<Happening> crossings(const std::vector<double>& times)
{
    std::vector<Happening> out;
    for (const double t : times) out.push_back({.t = t});
    return out;
}

/// The events nth(0), nth(1), ... of a known solution up to `t_end`.
template <class Function>
[[nodiscard]] std::vector<Happening> happenings(double t_end, const Function& nth)
{
    std::vector<Happening> out;
    for (int n = 0;; ++n) {
        const Happening next = nth(n);
        if (next.t > t_end) return out;
        out.push_back(next);
    }
}

/// Time events at the integers from `first` to `last`.
[[nodiscard]] inline std::vector<Happening> ticks(int first, int last)
{
    std::vector<Happening> out;
    for (int t = first; t <= last; ++t) {
        out.push_back({.t = static_cast<double>(t), .guard = no_guard, .kind = EventKind::time});
    }
    return out;
}

/// The stops of the Coulomb oscillator's default problem.
[[nodiscard]] inline std::vector<Happening> coulomb_stops()
{
    const CoulombOscillator oscillator;
    std::vector<Happening> out;
    for (int n = 1; n <= oscillator.stops(); ++n) {
        out.push_back({.t = oscillator.turning_time(n), .guard = CoulombOscillator::stop});
    }
    return out;
}

/// Stick and slip in turn, a period apart.
[[nodiscard]] inline std::vector<Happening> stick_slip_events(double t_end)
{
    return happenings(t_end, [](int n) {
        const double periods = StickSlip::period * ((n + 1) / 2);
        return n % 2 == 0
                   ? Happening{.t = periods + StickSlip::stick_time, .guard = StickSlip::stop}
                   : Happening{.t = periods, .guard = StickSlip::pulled_left};
    });
}

/// The converter is switched off and on in turn.
[[nodiscard]] inline std::vector<Happening> converter_switches(double t_end)
{
    const SystemDescriptor& of = BuckConverter::descriptor();
    std::vector<double> parameters;
    for (const ParameterInfo& each : of.parameters) parameters.push_back(each.initial);
    std::vector<Happening> out;
    for (const double t : of.event_times(parameters, BuckConverter::start, t_end)) {
        const bool off = out.size() % 2 == 0;
        out.push_back({.t = t, .guard = off ? BuckConverter::at_high : BuckConverter::at_low});
    }
    return out;
}

/// Every ready system with its default problem.
[[nodiscard]] inline std::vector<KnownSolution> known_solutions()
{
    // A step adds an error of up to 1e-13 to every component of the state, relative to its size
    // if that is larger than one. Most steps add a tenth of that or less, and the flows
    // are stable or nearly so: over the few hundred to few thousand steps of a run 1e-12
    // of the time has been enough for events at rates of order one. Exceptions state
    // their reasons.
    const auto tight = [](double t_end) {
        return Options{.t_end = t_end, .rtol = 1e-13, .atol = 1e-13};
    };
    const std::vector<How> timed{How::dopri5_extremum, How::fehlberg78_extremum};  // no guards
    std::vector<KnownSolution> all;

    all.push_back(
        {.name = "pendulum",
         .start = as_vector(Pendulum::start),
         .options = tight(20),
         .events = happenings(
             20, [](int n) { return Happening{.t = (n + 1) * Pendulum().half_period()}; }),
         .turn_at = 19.75,
         .run = runs(Pendulum())});
    all.push_back({.name = "henon_heiles",
                   .start = as_vector(HenonHeiles::start),
                   .options = tight(35),
                   .events = crossings(as_vector(HenonHeiles::section_times)),
                   .run = runs(HenonHeiles())});
    all.push_back({.name = "three_body",
                   .start = as_vector(ThreeBody::start),
                   .options = tight(6.2),
                   .events = crossings({ThreeBody::farthest_time, ThreeBody::return_time}),
                   .turn_at = 5.95,
                   .run = runs(ThreeBody())});
    all.push_back({.name = "hidden_pair",
                   .start = as_vector(HiddenPair::start),
                   .options = {.t_start = HiddenPair::t_start,
                               .t_end = HiddenPair::t_end,
                               .rtol = 1e-13,
                               .atol = 1e-13},
                   .events = crossings(as_vector(HiddenPair::zeros)),
                   .end = {120},
                   // Long steps: the ends alone do not reveal the pair.
                   .hows = {How::dopri5_extremum, How::fehlberg78_extremum},
                   .turn_at = 3.75,
                   .run = runs(HiddenPair())});
    all.push_back({.name = "near_tangent",
                   .start = as_vector(NearTangent().start()),
                   .options = tight(20),
                   .events = crossings(NearTangent().events(20)),
                   .end = {std::cos(21), -std::sin(21)},
                   // The level is met at the slope sin(half-width).
                   .time_error = 1e-12 / std::sin(NearTangent().half_width()),
                   .turn_at = 19.75,
                   .run = runs(NearTangent())});
    all.push_back({.name = "thermostat",
                   .start = as_vector(Thermostat::start),
                   .options = tight(100),
                   .events = happenings(100,
                                        [](int n) {
                                            return Happening{.t = Thermostat().switch_time(n),
                                                             .guard = n % 2 == 0
                                                                          ? Thermostat::too_cold
                                                                          : Thermostat::too_warm};
                                        }),
                   .mode = Thermostat::on,
                   .run = runs(Thermostat())});
    all.push_back({.name = "grow_decay",
                   .start = as_vector(GrowDecay::start),
                   .options = tight(20),
                   .events = happenings(20,
                                        [](int n) {
                                            return Happening{.t = GrowDecay::switch_time(n),
                                                             .guard = n % 2 == 0
                                                                          ? GrowDecay::full
                                                                          : GrowDecay::empty};
                                        }),
                   .mode = GrowDecay::decay,
                   .run = runs(GrowDecay())});
    all.push_back({.name = "impact_oscillator",
                   .start = as_vector(ImpactOscillator::start),
                   .options = tight(100),
                   .events = crossings(ImpactOscillator().impacts(100)),
                   .run = runs(ImpactOscillator())});
    all.push_back({.name = "coulomb_oscillator",
                   .start = as_vector(CoulombOscillator::start),
                   .options = tight(20),
                   .events = coulomb_stops(),
                   .end = {-0.2, 0},
                   .mode = CoulombOscillator::stick,
                   .run = runs(CoulombOscillator())});
    all.back().options.mode = CoulombOscillator::start_mode;
    all.push_back({.name = "stick_slip",
                   .start = as_vector(StickSlip::start),
                   .options = tight(50),
                   .events = stick_slip_events(50),
                   .mode = StickSlip::slip_left,
                   .run = runs(StickSlip())});
    all.back().options.mode = StickSlip::start_mode;
    all.push_back(
        {.name = "buck_converter",
         .start = as_vector(BuckConverter::start),
         .options = tight(0.003),
         .events = converter_switches(0.003),
         .mode = converter_switches(0.003).size() % 2 == 0 ? BuckConverter::on : BuckConverter::off,
         .run = runs(BuckConverter())});
    all.back().options.mode = BuckConverter::start_mode;
    all.push_back({.name = "detest_f1",
                   .start = as_vector(DetestF1::start),
                   .options = tight(DetestF1::t_end),
                   .events = ticks(1, 20),
                   .end = as_vector(DetestF1::solution(20)),
                   .end_error = 40e-12,  // y' is 40 in size, and errors grow as it does
                   .hows = timed,
                   .turn_at = 19.75,
                   .run = runs(DetestF1())});
    all.push_back({.name = "detest_f2",
                   .start = as_vector(DetestF2::start),
                   .options = tight(DetestF2::t_end),
                   .events = ticks(1, 20),
                   .end = as_vector(DetestF2::solution(20)),
                   .hows = timed,
                   .turn_at = 3.75,  // backward in time errors grow by exp(3.75)
                   .run = runs(DetestF2())});
    all.push_back({.name = "detest_f3",
                   .start = as_vector(DetestF3::start),
                   .options = tight(DetestF3::t_end),
                   .events = ticks(1, 20),
                   .end = as_vector(DetestF3::at_end),
                   .hows = timed,
                   .turn_at = 19.75,
                   .run = runs(DetestF3())});
    // The end of F4 is 1e-10 in size, and its relative error matters. Fehlberg's
    // pair is not suited to F4 and F5, as their headers explain.
    all.push_back({.name = "detest_f4",
                   .start = as_vector(DetestF4::start),
                   .options = {.t_end = DetestF4::t_end, .rtol = 1e-13, .atol = 1e-22},
                   .events = ticks(10, 10),
                   .end = as_vector(DetestF4::solution(20)),
                   .mode = DetestF4::decay,
                   .end_error = 1e-11 * DetestF4::solution(20)[0],
                   .hows = {How::dopri5_extremum},
                   .turn_at = 11,
                   .run = runs(DetestF4())});
    all.push_back({.name = "detest_f5",
                   .start = as_vector(DetestF5::start),
                   .options = tight(DetestF5::t_end),
                   .events = ticks(1, 19),
                   .end = as_vector(DetestF5::solution(20)),
                   .end_error = 1e-10,  // 400 times the tolerance is measured
                   .hows = {How::dopri5_extremum},
                   .turn_at = 19.75,
                   .run = runs(DetestF5())});
    return all;
}

}  // namespace ricochet::test
