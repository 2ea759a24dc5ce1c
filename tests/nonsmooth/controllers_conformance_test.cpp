// Applies the common suite to every step controller.
#include "conformance/controllers.hpp"

#include <memory>

#include "ricochet/nonsmooth/step_controllers.hpp"

namespace ricochet::test::controllers_conformance_test {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

template <class Rule>
std::function<StepController(double)> always(const Rule& rule)
{
    return [=](double /*unit*/) { return rule; };
}

Range around(double error, double relative = 1e-6)
{
    return {error * (1 - relative), error * (1 + relative)};
}

/// Where factor error^(-1/order) is 1: the root comes from a table, within 5.5e-4 for order 2 and
/// 3.1e-4 for order 3 (core/integrate/step_control_test.cpp).
Range around_power(double factor, int order)
{
    return around(std::pow(factor, order), order * (order == 2 ? 5.5e-4 : 3.1e-4));
}

/// A filter of order 1: accepted while error^(-beta1 / 2) is at least 0.8.
ControllerCase filtered(const std::string& name, const FilteredStep& rule)
{
    return {.name = name,
            .make = always(rule),
            .accepts = std::pow(rule.least, -2 / rule.beta1),
            .next = {rule.least, rule.most},
            .retry = {rule.down, rule.down},
            .order = 2,
            .settles = around(1)};
}

/// The classical rule times e^log_factor.
ControllerCase learned(const std::string& name, double log_factor)
{
    std::vector<double> weights(step_policy_weights, 0.0);
    weights.back() = log_factor;
    const auto policy = std::make_shared<const StepPolicy>(
        step_policy_model(StepLayout{.system = "any", .state = {}}, weights));
    return {
        .name = name,
        .make = always(LearnedStep{.policy = policy}),
        .accepts = 100,
        .next = {0.2 * std::exp(log_factor) * (1 - 1e-15), 10 * std::exp(log_factor) * (1 + 1e-15)},
        .retry = {0.2, 0.2},
        .order = 3,
        .settles = around_power(0.9 * std::exp(log_factor), 3),
        .refused = {LearnedStep{}, LearnedStep{.policy = policy, .plain = {.order = 0}}}};
}

std::vector<ControllerCase> all()
{
    const auto prescribed = [](std::vector<double> lengths) {
        return PrescribedSteps{std::make_shared<const std::vector<double>>(std::move(lengths))};
    };
    FilteredStep not_finite;
    not_finite.alpha = nan;
    std::vector<ControllerCase> cases{
        {.name = "Constant", .make = always(ConstantStep{}), .next = {1, 1}},
        // 0.9 error^(-1/2) is 1 at 0.81.
        {.name = "Error",
         .make = always(ErrorStep{.order = 2}),
         .accepts = 1,
         .next = {0.9, 10},
         .retry = {0.2, 0.9},
         .settles = around_power(0.9, 2),
         .refused = {ErrorStep{.order = 0}, ErrorStep{.reject_above = 0.5}}},
        {.name = "ErrorThatRejectsLate",
         .make = always(ErrorStep{.order = 3, .reject_above = 100}),
         .accepts = 100,
         .next = {0.2, 10},
         .retry = {0.2, 0.2},
         .order = 3,
         .settles = around_power(0.9, 3)},
        {.name = "Heuristic",
         .make = always(HeuristicStep{}),
         .accepts = 1,
         .next = {1, 2},
         .retry = {0, 1},
         .settles = around(1),
         .refused = {HeuristicStep{.order = 0}, HeuristicStep{.up = 0.5},
                     HeuristicStep{.down = 1}}},
        {.name = "HeuristicOfOrderFive",
         .make = always(HeuristicStep{.order = 5}),
         .accepts = 1,
         .next = {1, 2},
         .retry = {0, 1},
         .order = 6,
         .settles = around(1)},
        // 0.9 error^-0.35 error^-0.2 is 1 at 0.83, but a loop that rejects a step on its way there
        // cycles around it forever, with errors of 0.38, 0.70 and 1.07.
        {.name = "Classic",
         .make = always(ClassicStep{}),
         .accepts = 1,
         .next = {0.6, 2},
         .retry = {0.6, 0.6},
         .settles = {0.36, 1.1},
         .refused = {ClassicStep{.down = 1.5}, ClassicStep{.down = 0}}},
        // error^-3 is 1.8. The error does not converge to a value.
        {.name = "PrintedPi",
         .make = always(PrintedPiStep{}),
         .accepts = std::pow(1.8, -1.0 / 3),
         .next = {1.8, 2.2},
         .retry = {0, 0.6},
         .refused = {PrintedPiStep{.gamma1 = 0}, PrintedPiStep{.gamma2 = 0}}},
        {.name = "Prescribed",
         .make =
             [=](double unit) {
                 return prescribed({0.01 * unit, 0.25 * unit, 0.125 * unit});
             },
         .next = {12.5, 25},  // for the requested steps of 0.01
         .refused = {PrescribedSteps{}, prescribed({}), prescribed({0.1, 0}), prescribed({0.1, -1}),
                     prescribed({0.1, nan})}},
        learned("LearnedOfNothing", 0),
        learned("LearnedToLengthen", 0.05),
        filtered("FilterH211b", FilteredStep::h211b(4)),
        filtered("FilterH211pi", FilteredStep::h211pi()),
        filtered("FilterPi3040", FilteredStep::pi3040()),
        filtered("FilterPi3333", FilteredStep::pi3333()),
        filtered("FilterPi4020", FilteredStep::pi4020()),
        filtered("FilterElementary", FilteredStep::elementary())};
    cases.back().refused = {FilteredStep{.most = 0.9}, FilteredStep{.least = 0},
                            FilteredStep{.down = 1}, not_finite};
    return cases;
}

INSTANTIATE_TEST_SUITE_P(All, ControllerSuite, testing::ValuesIn(all()),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace ricochet::test::controllers_conformance_test
