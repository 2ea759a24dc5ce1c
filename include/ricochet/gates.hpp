// Networks before a detector: the bare network, and gates, which change what a run costs and never
// what it finds.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <optional>
#include <string_view>
#include <utility>

#include "ricochet/base/detail/owner.hpp"
#include "ricochet/detail/arithmetic.hpp"
#include "ricochet/detail/features.hpp"
#include "ricochet/detail/meter.hpp"
#include "ricochet/detail/wrapped_detector.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/gate.hpp"
#include "ricochet/nn/mlp.hpp"
#include "ricochet/planned.hpp"

namespace ricochet {

// The bare network: a prediction decides whether the guard is examined.
//
// Before a step the network is asked whether the step will meet the event surface
// (Saunders, Steyer and Kuether, SAND2023-06682C, eq. 4). If not, the guard is not
// evaluated, and "no event" is only assumed. If so, the end of the step is checked:
//
//   false alarm   the guard is still on its side: counted, the step stands
//   late event    the guard had left its side before the step began, so the network
//                 missed the event: located at the start of the step, and marked late
//
// A wrong network therefore loses time or accuracy; `Ends` and `Extremum` lose
// neither and are there for comparison.

namespace detail {

/// @throws std::invalid_argument because the model is for another system than `name`.
void check_model_system(const Model& model, std::string_view name);
/// @throws std::invalid_argument because the model was trained for another parameter value.
void check_model_parameter(const Model& model, std::string_view parameter, double trained,
                           std::optional<double> value);
/// @throws std::invalid_argument because the system does not provide the model's features.
void check_model_features(const Model& model, Recipe recipe, std::size_t features, bool offered);
/// @throws std::invalid_argument because the model was trained for none of the steps [s] taken.
void check_model_step(const Model& model, double smallest, double largest);

/// Examines the end of a step that was not cleared. An event whose guard had left
/// its side before the step began was missed by an earlier prediction, and is late.
[[nodiscard]] inline Finding examine_prediction(GuardPath& probe, Watch& watch)
{
    Finding finding = Ends{}.examine(probe, watch);
    if (finding.hit && watch.start.s == 0) {
        finding.lo.value = probe.start_value();
        finding.late = side_of(finding.lo.value) == opposite(finding.side);
    }
    return finding;
}

}  // namespace detail

/// Detector that evaluates a guard only after steps for which a network predicts an event. Nothing
/// is proved: an event that the network does not predict is missed, or found late.
class BareNetwork {
public:
    static constexpr bool uses_rates = false;
    static constexpr detail::Screening screening = detail::Screening::ends;
    static constexpr Evidence evidence = Evidence::assumed;  ///< evidence for a step not suspected
    static constexpr bool checks_every_step = false;
    static constexpr std::size_t max_features = 16;

    /// @throws std::invalid_argument if the model names an unknown recipe or has
    /// more features than `max_features`.
    explicit BareNetwork(Model model);

    [[nodiscard]] const Model& model() const noexcept { return classifier_->model(); }

    /// Whether this network can be evaluated for `system` in steps between `smallest`
    /// and `largest` [s], at least in some of them. The system must declare its
    /// `name`, and through `parameter(name)` the parameters on which the model depends.
    ///
    /// @throws std::invalid_argument naming the model's system, parameters, features
    /// or steps, and what is required of them.
    template <class System, class X>
    void check(const System& system, const X& x, double smallest, double largest) const
    {
        if constexpr (requires { std::string_view(system.name); }) {
            detail::check_model_system(model(), system.name);
        } else {
            detail::check_model_system(model(), {});
        }
        for (const auto& [parameter, trained] : model().parameters) {
            std::optional<double> value;
            if constexpr (requires { system.parameter(std::string_view()); }) {
                value = system.parameter(std::string_view(parameter));
            }
            detail::check_model_parameter(model(), parameter, trained, value);
        }
        detail::check_model_features(model(), recipe_, detail::dimension(recipe_, x.size()),
                                     detail::offers<System, X>(recipe_));
        detail::check_model_step(model(), smallest, largest);
    }

    /// Whether the step is predicted to be free of events. Always false for a step shorter
    /// or longer than the network was trained for, and outside its domain.
    template <class Guard, class Step>
    [[nodiscard]] bool clears(const Guard& guard, const Step& step) const noexcept
    {
        if (!(step.h() >= model().step_min && step.h() <= model().step_max)) return false;
        std::array<double, max_features> input;
        if (recipe_ == detail::Recipe::ballistic) guard.count();
        const detail::StepAhead start{step.time(0), step.x0(), step.rate0(), step.h()};
        detail::features(recipe_, guard.system(), start, input.data());
        return classifier_->in_domain(input.data()) &&
               !classifier_->alarm(classifier_->logit(input.data()));
    }

    [[nodiscard]] static constexpr bool suspects(double sign, const GuardSample& start,
                                                 const GuardSample& end) noexcept
    {
        return Ends::suspects(sign, start, end);
    }

    /// Returns true: a prediction may have been late, so that every event is examined carefully.
    [[nodiscard]] static bool leaves_plainly(double, const GuardSample&, const GuardSample&,
                                             double) noexcept
    {
        return false;
    }

    [[nodiscard]] detail::Finding examine(GuardPath& probe, detail::Watch& watch) const
    {
        return detail::examine_prediction(probe, watch);
    }

private:
    detail::Shared<Classifier> classifier_;
    detail::Recipe recipe_;
};

// Gates: networks that decide whether the guards of a step are checked.

// The verified gate: a network may change the cost of a run, never its events.
//
// The network proposes which exact checks to defer, and every interval is closed
// by an exact check that covers all of it. An interval longer than one step can be covered only by
// a bound on the guard's rate; without a declared bound no interval can be
// covered, and every step keeps its exact check. The network then saves nothing: the
// statistics show no deferred checks, and how often its prediction would have
// been right. For any weights the events are those of the exact detector,
// bit for bit.

/// Detector that counts how often a network predicts the finding of `Exact`, and defers checks if
/// the guard declares bounds. The events are those of `Exact`, bit for bit, whatever the weights.
template <class Exact = Extremum>
class Verified : public detail::WrappedDetector<Exact> {
public:
    static constexpr bool checks_every_step = true;
    static constexpr bool keeps_events = true;

    /// Takes the network that predicts and the exact detector that decides.
    explicit Verified(BareNetwork network, const Exact& exact = {})
        : detail::WrappedDetector<Exact>(exact), network_(std::move(network))
    {
    }

    /// Checks the system like `BareNetwork::check`.
    template <class System, class X>
    void check(const System& system, const X& x, double smallest, double largest) const
    {
        network_.check(system, x, smallest, largest);
    }

    /// Prediction of the network for the step, for the statistics.
    template <class Guard, class Step>
    [[nodiscard]] bool clears(const Guard& guard, const Step& step) const noexcept
    {
        return network_.clears(guard, step);
    }

private:
    BareNetwork network_;
};

// Calibrated gates: checks deferred by the prediction of a network, without proof.
//
// These detectors skip checks without proof, and so must be requested by name. Skipped checks count
// as `gated`; how often events are missed was measured, on runs, when the gate was trained
// (`Calibration` in its model). Outside the box of the model every step keeps its exact check, and
// is counted in `Statistics::outside_domain`.
//
//     Calibrated        a horizon gate, for a guard of which only the value or the sign is
//                       known. No check until the end of the longest horizon that is cleared,
//                       then one; if it finds the guard on its other side, the run returns to the
//                       event. An event is missed if, within a horizon, the guard crosses
//                       its surface and returns, and the network did not predict it.
//     CalibratedBounds  a level gate, for a guard with declared bounds: works as `Planned`, but
//                       evaluates the gate before the guard and uses the level that it clears
//                       as a lower bound. Misses events only where that bound is wrong; if this
//                       is detected, the run ends as `Outcome::wrong_bound`.
//     Foreseen          a horizon gate as the forecast of `Planned`, and nothing more: it decides
//                       when to check; exact values and declared bounds close every interval.
//                       Verified: with any weights the events are those of the exact detector, bit
//                       for bit.

namespace detail {

/// @throws std::invalid_argument unless the gate is of the required kind.
void check_gate_kind(const gates::Gate& gate, bool horizon);
/// @throws std::invalid_argument because no step would be kept.
void check_longest_interval(std::size_t steps);
/// Steps of the longest horizon of a gate for fixed steps, at least 256 and at most 65 536.
[[nodiscard]] std::size_t longest_horizon(const gates::Gate& gate) noexcept;

/// A detector that holds a gate.
template <class Base>
class AsksGate : public Base {
public:
    [[nodiscard]] const gates::Gate& gate() const noexcept { return gate_; }

    /// Checks the system like `Gate::check`.
    template <class System, class X>
    void check(const System& system, const X& x, double smallest, double largest) const
    {
        gate_.check(system, x, smallest, largest);
    }

protected:
    /// @throws std::invalid_argument if the gate is of the other kind, or as `Base` does.
    template <class... Arguments>
    AsksGate(gates::Gate gate, bool horizon, const Arguments&... arguments)
        : Base(arguments...), gate_(std::move(gate))
    {
        check_gate_kind(gate_, horizon);
    }

private:
    gates::Gate gate_;
};

}  // namespace detail

/// Defers checks while a calibrated gate predicts that no event is near: misses events at the rate
/// of its calibration, and needs no bounds. Backward runs check every step.
/// @tparam Exact  detector of the steps that are checked
template <class Exact = Extremum>
class Calibrated : public detail::AsksGate<detail::PutsOff<Exact>> {
    using Base = detail::AsksGate<detail::PutsOff<Exact>>;

public:
    static constexpr bool needs_bounds = false;
    static constexpr Evidence deferred = Evidence::gated;

    /// @param longest_interval  largest number of steps without a check, by default those of the
    ///        longest horizon; as many starts are kept
    /// @throws std::invalid_argument for a level gate, or if `longest_interval` is 0.
    explicit Calibrated(gates::Gate gate, std::optional<std::size_t> longest_interval = {},
                        const Exact& exact = {})
        : Base(std::move(gate), true, exact),
          longest_(longest_interval.value_or(detail::longest_horizon(this->gate())))
    {
        detail::check_longest_interval(longest_);
    }

    [[nodiscard]] std::size_t longest() const noexcept { return longest_; }
    [[nodiscard]] static constexpr bool checks_bounds() noexcept { return false; }
    [[nodiscard]] static constexpr double margin() noexcept { return 0; }
    [[nodiscard]] static double sure(const GuardBound&, double) noexcept { return 0; }
    [[nodiscard]] static double hoped(const GuardBound&, double, double) noexcept { return 0; }
    [[nodiscard]] static bool closes(const GuardBound& from, const GuardBound& to, double,
                                     double band) noexcept
    {
        return from.distance > 0 && to.distance > band;
    }

    /// Time [s] from here that needs no check: the horizon, lengthened by a billionth. A horizon is
    /// a number of steps, and without the allowance rounding would cut off the last one.
    template <class System, class X>
    [[nodiscard]] gates::Gate::Answer horizon(const System& system, Mode mode, double t,
                                              const X& x) const
    {
        gates::Gate::Answer answer = this->gate().ask(system, mode, t, x);
        answer.cleared *= 1 + 1e-9;
        return answer;
    }

private:
    std::size_t longest_;
};

/// Uses the levels of a calibrated gate as lower bounds of the guard in the planner, along with the
/// bounds that the system declares: misses events at the rate of its calibration.
template <class Exact = Extremum>
class CalibratedBounds : public detail::AsksGate<Planned<Exact>> {
public:
    static constexpr Evidence deferred = Evidence::gated;

    /// @throws std::invalid_argument for a horizon gate, or as `Planned`.
    explicit CalibratedBounds(gates::Gate gate, const PlannerOptions& options = {},
                              const Exact& exact = {})
        : detail::AsksGate<Planned<Exact>>(std::move(gate), false, options, exact)
    {
    }

    /// The lowest level that the gate ever clears.
    [[nodiscard]] double lowest_level() const noexcept
    {
        return this->gate().model().levels.front().value;
    }

    /// A level that the guard is predicted to be above; 0: none.
    template <class System, class X>
    [[nodiscard]] gates::Gate::Answer level(const System& system, std::size_t /*which*/, Mode mode,
                                            double t, const X& x) const
    {
        return this->gate().ask(system, mode, t, x);
    }
};

/// Uses a horizon gate as a forecast of when a check is worth making; declared bounds close every
/// interval, so that the events are those of `Exact`, bit for bit, whatever the weights.
template <class Exact = Extremum>
class Foreseen : public detail::AsksGate<Planned<Exact>> {
public:
    static constexpr bool keeps_events = true;

    /// @throws std::invalid_argument for a level gate, or as `Planned`.
    explicit Foreseen(gates::Gate gate, const PlannerOptions& options = {}, const Exact& exact = {})
        : detail::AsksGate<Planned<Exact>>(std::move(gate), true, options, exact)
    {
    }

    /// Forecast of the latest time [s] from here at which to check.
    template <class System, class X>
    [[nodiscard]] gates::Gate::Answer horizon(const System& system, Mode mode, double t,
                                              const X& x) const
    {
        return this->gate().ask(system, mode, t, x);
    }
};

// The certified gate: every prediction that clears a state has been proved.
//
// A certificate (nn/mlp.hpp) states that wherever the network clears, the first guard is
// above a margin. With the system's own bounds that is as good as a value: `Planned` closes
// intervals with it, and skips the exact check if it suffices. Such steps are `proved`, and the
// events are those of the exact detector, bit for bit. Outside the box of the certificate, in a
// box that it lists as unproved, in modes other than 0 and for other guards the exact guard is
// evaluated. A system without bounds has every step checked: a state that is clear implies
// nothing about the next one.

/// Uses the levels of a gate that a certificate proves as lower bounds of the guard in the planner:
/// the events are those of `Exact`, bit for bit.
template <class Exact = Extremum>
class Certified : public Planned<Exact> {
public:
    static constexpr bool keeps_events = true;

    /// @throws std::invalid_argument if the model has no certificate or a void one, names no
    /// known recipe of features, or has too many features; or as `Planned`.
    explicit Certified(Model model, const PlannerOptions& options = {}, const Exact& exact = {})
        : Planned<Exact>(options, exact),
          certified_(detail::Shared<CertifiedClassifier>::make(std::move(model))),
          recipe_(gate_recipe(this->model().recipe))
    {
        detail::check_certified(this->model());
    }

    [[nodiscard]] const Model& model() const noexcept { return certified_->classifier().model(); }
    [[nodiscard]] const Certificate& certificate() const noexcept
    {
        return certified_->certificate();
    }

    /// Checks that the certificate applies to this system: its name, if it has one, and the
    /// parameters that the model depends on, where it declares them. Steps may be of any length.
    /// @throws std::invalid_argument naming what the model was made for and what is required.
    template <class System, class X>
    void check(const System& system, const X& x, double /*smallest*/, double /*largest*/) const
    {
        detail::check_gate_model(model(), system);
        detail::check_gate_layout(model(), recipe_, feature_count(recipe_, system, x),
                                  mode_count_of(system));
    }

    /// The lowest margin that the gate ever clears.
    [[nodiscard]] double lowest_level() const noexcept
    {
        return certificate().levels.front().margin;
    }

    /// A margin that the guard is proved to be above; 0: none.
    template <class System, class X>
    [[nodiscard]] gates::Gate::Answer level(const System& system, std::size_t which, Mode mode,
                                            double t, const X& x) const
    {
        if (which != 0 || mode != 0) return {};
        std::array<double, GateRecipe::most> features;
        recipe_.write(system, mode, t, x, features.data());
        if (!certified_->classifier().in_domain(features.data())) return {.outside = true};
        return {.cleared = detail::greatest_of(certified_->lower_bound(features.data()), 0.0)};
    }

private:
    detail::Shared<CertifiedClassifier> certified_;
    GateRecipe recipe_;
};

// A network that is evaluated only while that saves time.
//
//     integrate(system, x0, options, FixedStep<Rk4>{}, Metered(Foreseen(gate)));
//
// For gates that cannot change the events (`Verified`, `Foreseen`, `Certified`): events are
// the same, bit for bit, whether or not the network is asked. How often it is asked depends on
// the clock, and so differs from run to run; `MeterOptions::decision` fixes it.

/// A gate under which the events are those of its exact detector, whatever the network predicts
/// (or, for a certified gate, whether or not it is asked).
template <class Detector>
concept KeepsEvents = requires
{
    requires Detector::keeps_events;
};

/// Detector that asks its network only while that saves time, measured on the run itself; the
/// events are those of `Detector`.
template <class Detector>
class Metered : public Detector {
    static_assert(KeepsEvents<Detector>,
                  "ricochet: found a detector that may miss events in Metered; expected one that "
                  "keeps them all, such as Foreseen, Verified or Certified");

public:
    /// @throws std::invalid_argument if a cost is negative, `trials` outside of [0, 1] or `piece`
    /// 0.
    explicit Metered(Detector detector, const MeterOptions& options = {})
        : Detector(std::move(detector)), options_(options)
    {
        detail::validate(options);
    }

    [[nodiscard]] const MeterOptions& metering() const noexcept { return options_; }

private:
    MeterOptions options_;
};

}  // namespace ricochet
