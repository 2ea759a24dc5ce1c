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
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <string_view>

#include "ricochet/detail/classifier.hpp"
#include "ricochet/detail/features.hpp"
#include "ricochet/detect/extremum.hpp"

namespace ricochet {

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
class Network {
public:
    static constexpr bool uses_rates = false;
    static constexpr Screening screening = Screening::ends;
    static constexpr Evidence evidence = Evidence::assumed;  ///< evidence for a step not suspected
    static constexpr bool checks_every_step = false;
    static constexpr std::size_t max_features = 16;

    /// @throws std::invalid_argument if the model names an unknown recipe or has
    /// more features than `max_features`.
    explicit Network(Model model);

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
        detail::check_model_features(model(), recipe_, dimension(recipe_, x.size()),
                                     offers<System, X>(recipe_));
        detail::check_model_step(model(), smallest, largest);
    }

    /// Whether the step is predicted to be free of events. Always false for a step shorter
    /// or longer than the network was trained for, and outside its domain.
    template <class Guard, class Step>
    [[nodiscard]] bool clears(const Guard& guard, const Step& step) const noexcept
    {
        if (!(step.h() >= model().step_min && step.h() <= model().step_max)) return false;
        std::array<double, max_features> input;
        if (recipe_ == Recipe::ballistic) guard.count();
        const StepAhead start{step.time(0), step.x0(), step.rate0(), step.h()};
        features(recipe_, guard.system(), start, input.data());
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

    [[nodiscard]] Finding examine(GuardPath& probe, Watch& watch) const
    {
        return detail::examine_prediction(probe, watch);
    }

private:
    std::shared_ptr<const Classifier> classifier_;
    Recipe recipe_;
};

}  // namespace ricochet
