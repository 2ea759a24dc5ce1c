// Networks that choose steps: refusals, and steps left to the classical rule.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "refusal.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/nonsmooth/set_valued_motion.hpp"
#include "ricochet/nonsmooth/step_controllers.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/sliding_mode.hpp"

namespace ricochet::step_policy_test {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

using PolicyPointer = std::shared_ptr<const StepPolicy>;

PolicyPointer policy(const StepLayout& layout, const std::vector<double>& weights = {})
{
    return std::make_shared<const StepPolicy>(step_policy_model(layout, weights));
}

/// A network that always returns `value`.
std::vector<double> always(double value)
{
    std::vector<double> weights(step_policy_weights, 0.0);
    weights.back() = value;
    return weights;
}

void expect_names(const std::string& text, const std::vector<std::string>& parts)
{
    for (const std::string& part : parts) {
        EXPECT_NE(text.find(part), std::string::npos) << '"' << text << "\" without " << part;
    }
}

BatheOptions learned(PolicyPointer policy, double rtol = 1e-2)
{
    return {.controller = LearnedStep{.policy = std::move(policy)},
            .estimate = ErrorEstimate::embedded,
            .rtol = rtol};
}

BatheOptions classical(double rtol = 1e-2)
{
    return {.controller = ErrorStep{.order = 3, .reject_above = 100},
            .estimate = ErrorEstimate::embedded,
            .rtol = rtol};
}

Rupture rupture(const BatheOptions& options, int elements = 2)
{
    return simulate(StrikeSlipFault({.elements = elements}),
                    {.t_end = 30, .step = 0.125, .polynomial_bound = 1e-3, .max_steps = 20'000},
                    options);
}

SetValuedOptions circuit_options(const StepController& controller)
{
    return {.t_end = 5,
            .step = 0.01,
            .controller = controller,
            .estimate = ErrorEstimate::embedded,
            .fields = {{.first = 0, .count = 3, .rtol = 1e-3, .floor = 10}}};
}

TEST(StepPolicy, SurvivesItsFile)
{
    std::vector<double> weights;
    for (std::size_t i = 0; i < step_policy_weights; ++i) {
        weights.push_back(std::sin(static_cast<double>(i)));
    }
    Model model = step_policy_model(fault_step_layout(), weights);
    model.domain.assign(StepPolicy::inputs, {-20, 20});
    const Model back = parse_model(to_safetensors(model), "p.safetensors");
    const StepPolicy one(model);
    const StepPolicy other(back);
    StepRanges::Inputs inputs{};
    inputs.fill(0.3);
    ASSERT_TRUE(one.factor(inputs));
    EXPECT_EQ(*one.factor(inputs), *other.factor(inputs));
    EXPECT_EQ(refusal([&] { other.require(fault_step_layout()); }), "accepted");
}

TEST(StepPolicy, OfAnotherSystemIsRefusedNamingBoth)
{
    expect_names(refusal([] { (void)rupture(learned(policy(SlidingMode::step_layout()))); }),
                 {"sliding-mode", "fault"});
    expect_names(refusal([] {
                     SetValuedMotion<DiodeCircuit> motion(
                         DiodeCircuit{}, DiodeCircuit::start(),
                         circuit_options(LearnedStep{.policy = policy(fault_step_layout())}));
                 }),
                 {"diode-circuit", "fault"});
}

TEST(StepPolicy, OfAnotherLayoutIsRefusedNamingBoth)
{
    StepLayout other = fault_step_layout();
    other.version = 2;
    expect_names(refusal([&] { (void)rupture(learned(policy(other))); }),
                 {"step-inputs-1", "step-inputs-2"});
    other = fault_step_layout();
    other.state[2].name = "moon_phase";
    expect_names(refusal([&] { (void)rupture(learned(policy(other))); }),
                 {"moon_phase", other.state[1].name.data()});
}

TEST(StepPolicy, WhatIsNoPolicyIsRefused)
{
    Model gate = step_policy_model(fault_step_layout(), {});
    gate.kind = "event-classifier";
    expect_names(refusal([&] { StepPolicy{gate}; }), {"step-policy", "event-classifier"});
    Model narrow = step_policy_model(fault_step_layout(), {});
    narrow.layers.front().inputs = 3;
    narrow.layers.front().weight.resize(3 * 8);
    expect_names(refusal([&] { StepPolicy{narrow}; }), {"10 inputs", "3"});
    expect_names(refusal([] {
                     (void)step_policy_model(fault_step_layout(), {1, 2});
                 }),
                 {std::to_string(step_policy_weights), "2"});
    expect_names(refusal([] { (void)rupture(learned(nullptr)); }), {"policy"});
    BatheOptions doubling = learned(policy(fault_step_layout()));
    doubling.estimate = ErrorEstimate::doubling;
    expect_names(refusal([&] { (void)rupture(doubling); }), {"embedded"});
}

TEST(StepPolicy, ThatReturnsZeroIsTheClassicalRule)
{
    const Rupture with = rupture(learned(policy(fault_step_layout())));
    const Rupture without = rupture(classical());
    EXPECT_EQ(with.mean_slip, without.mean_slip);
    EXPECT_EQ(with.times, without.times);
    EXPECT_EQ(with.statistics.iterations, without.statistics.iterations);
    EXPECT_GT(with.statistics.asked, 0U);

    const auto end_of = [](const StepController& controller) {
        SetValuedMotion<DiodeCircuit> motion(DiodeCircuit{}, DiodeCircuit::start(),
                                             circuit_options(controller));
        EXPECT_EQ(motion.run(), Outcome::reached_end);
        return motion.state().w;
    };
    EXPECT_EQ(end_of(LearnedStep{.policy = policy(DiodeCircuit::step_layout())}),
              end_of(ErrorStep{.order = 3, .reject_above = 100}));
}

TEST(StepPolicy, FactorIsHeldWithinItsBounds)
{
    StepRanges::Inputs inputs{};
    for (const double value : {-50.0, -1.0, 0.5, 50.0}) {
        const StepPolicy p(step_policy_model(fault_step_layout(), always(value)));
        ASSERT_TRUE(p.factor(inputs));
        EXPECT_DOUBLE_EQ(*p.factor(inputs), std::exp(std::clamp(value, -2.0, 2.0)));
    }
}

TEST(StepPolicy, InputsOutsideOfTheDomainAreTheClassicalRules)
{
    Model model = step_policy_model(fault_step_layout(), always(1));
    model.domain.assign(StepPolicy::inputs, {-1e6, 1e6});
    model.domain[1] = {std::log(1e-4), std::log(1e-3)};  // of the tolerance
    const auto narrow = std::make_shared<const StepPolicy>(model);
    const Rupture outside = rupture(learned(narrow, 1e-2));
    EXPECT_EQ(outside.statistics.handed_over, outside.statistics.asked);
    EXPECT_EQ(outside.mean_slip, rupture(classical(1e-2)).mean_slip);
    const Rupture inside = rupture(learned(narrow, 5e-4));
    EXPECT_LT(inside.statistics.handed_over, inside.statistics.asked);
}

TEST(StepPolicy, NanIsTheClassicalRules)
{
    const Rupture plain = rupture(classical());
    for (const std::size_t which : {std::size_t{3}, step_policy_weights - 1}) {
        std::vector<double> weights(step_policy_weights, 0.1);
        weights[which] = nan;
        const Rupture run = rupture(learned(policy(fault_step_layout(), weights)));
        EXPECT_EQ(run.statistics.handed_over, run.statistics.asked);
        EXPECT_EQ(run.mean_slip, plain.mean_slip);
    }
    LearnedStep rule{.policy = policy(fault_step_layout(), always(1))};
    Model model = step_policy_model(fault_step_layout(), always(1));
    model.domain.assign(StepPolicy::inputs, {-1e6, 1e6});
    rule.policy = std::make_shared<const StepPolicy>(model);
    StepView view;
    view.state[4] = nan;
    EXPECT_EQ(rule.judge(0.5, 0.1, view).factor, rule.plain.judge(0.5, 0.1).factor);
    EXPECT_EQ(rule.handed_over, 1U);
}

TEST(StepPolicy, StepsThatAreTooWrongAreRepeatedByTheClassicalRule)
{
    LearnedStep rule{.policy = policy(fault_step_layout(), always(2))};
    const StepVerdict verdict = rule.judge(101, 0.1, StepView{});
    EXPECT_FALSE(verdict.accepted);
    EXPECT_EQ(verdict.factor, rule.plain.judge(101, 0.1).factor);
    EXPECT_EQ(rule.handed_over, 1U);
    EXPECT_TRUE(rule.judge(99, 0.1, StepView{}).accepted);
}

// For any weights the run ends, exactly at its end, and the slip is that of the fault: with
// every error at most 100 times the tolerance of 1e-3 per step, to a tenth.
TEST(StepPolicy, AnyWeightsEndTheRun)
{
    const double slip = rupture(classical(1e-4)).mean_slip;
    for (int k = 0; k < 6; ++k) {
        std::vector<double> weights;
        for (std::size_t i = 0; i < step_policy_weights; ++i) {
            weights.push_back(5 * std::sin(static_cast<double>((k + 1) * (i + 1))));
        }
        const Rupture run = rupture(learned(policy(fault_step_layout(), weights), 1e-3));
        EXPECT_TRUE(run.outcome == Outcome::at_rest || run.outcome == Outcome::reached_end)
            << describe(run.outcome);
        EXPECT_EQ(run.t, 30.0);
        EXPECT_NEAR(run.mean_slip / slip, 1, 0.1);
    }
}

TEST(StepPolicy, TheSameRunGivesTheSameBits)
{
    std::vector<double> weights;
    for (std::size_t i = 0; i < step_policy_weights; ++i) {
        weights.push_back(0.3 * std::cos(static_cast<double>(i)));
    }
    const auto one = policy(fault_step_layout(), weights);
    EXPECT_EQ(rupture(learned(one)).times, rupture(learned(one)).times);
    const StrikeSlipFault fault({.elements = 2});
    BatheRuns runs(fault, 1e-3);
    const RuptureOptions options{.t_end = 30, .step = 0.125, .max_steps = 20'000};
    (void)runs.simulate(options, classical());
    const Rupture again = runs.simulate(options, learned(one));
    const Rupture first = rupture(learned(one));
    EXPECT_EQ(again.times, first.times);
    EXPECT_EQ(again.mean_slip, first.mean_slip);
    EXPECT_EQ(again.statistics.products, first.statistics.products);
}

TEST(StepPolicy, SlidingModeEndsWhereItShould)
{
    SetValuedOptions options{
        .t_end = 0.5,
        .step = 1e-3,
        .controller = LearnedStep{.policy = policy(SlidingMode::step_layout(), always(0.3))},
        .estimate = ErrorEstimate::embedded,
        .fields = {{.first = 0, .count = 1, .rtol = 1e-3, .floor = 0.15}}};
    options.scheme.first_stage = FirstStage::switch_aware;
    SetValuedMotion<SlidingMode> motion(SlidingMode{}, SlidingMode::Vector::Constant(0.15),
                                        options);
    EXPECT_EQ(motion.run(), Outcome::reached_end);
    EXPECT_EQ(motion.state().t, 0.5);
    EXPECT_EQ(motion.state().w[0], 0.0);
    EXPECT_GT(std::get<LearnedStep>(motion.controller()).asked, 0U);
}

// A tolerance relative to a field: the same motion in other units takes the same steps, and a
// lower limit far above the field makes the tolerance absolute.
TEST(ErrorFields, AreMeasuredByTheirNorms)
{
    const auto steps = [](double scale, double rtol, double floor) {
        SetValuedOptions options{
            .t_end = 5,
            .step = 0.01,
            .controller = ErrorStep{.reject_above = 100},
            .estimate = ErrorEstimate::embedded,
            .fields = {{.first = 0, .count = 3, .rtol = rtol, .floor = floor}}};
        DiodeCircuit::Parameters parameters;
        parameters.current *= scale;
        SetValuedMotion<DiodeCircuit> motion(DiodeCircuit(parameters),
                                             scale * DiodeCircuit::start(), options);
        EXPECT_EQ(motion.run(), Outcome::reached_end);
        return motion.statistics().accepted;
    };
    // A power of two changes no digit of the state.
    EXPECT_EQ(steps(1, 1e-3, 0), steps(1024, 1e-3, 0));
    EXPECT_EQ(steps(1, 1e-3, 1e4), steps(1, 1e-2, 1e3));
    EXPECT_LT(steps(1, 1e-3, 1e4), steps(1, 1e-3, 0));
}

TEST(ErrorFields, OutsideOfTheStateAreRefused)
{
    const auto with = [](const ErrorField& field) {
        return refusal([&] {
            SetValuedOptions options = circuit_options(ErrorStep{});
            options.fields = {field};
            SetValuedMotion<DiodeCircuit> motion(DiodeCircuit{}, DiodeCircuit::start(), options);
        });
    };
    expect_names(with({.first = 1, .count = 3}), {"field 0", "3 components"});
    expect_names(with({.first = 0, .count = 0}), {"field 0"});
    expect_names(with({.first = 0, .count = 3, .rtol = 0}), {"rtol"});
    expect_names(with({.first = 0, .count = 3, .floor = nan}), {"floor"});
}

}  // namespace
}  // namespace ricochet::step_policy_test
