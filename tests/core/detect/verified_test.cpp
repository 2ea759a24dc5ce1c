#include "ricochet/gates.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "ricochet/integrate.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/systems/bouncing_ball.hpp"

namespace ricochet::verified_test {
namespace {

using X = std::array<double, 2>;
using BallRun = ricochet::Run<X>;

/// A 2-8-1 network for the ball with weights from `next`.
template <class Next>
Model model_of(Next next)
{
    Model model;
    model.system = "bouncing-ball";
    model.recipe = "ballistic";
    model.offset = {0, 0};
    model.scale = {1, 1};
    model.step_min = 1e-300;
    model.step_max = 1e300;
    model.layers = {{.inputs = 2, .outputs = 8, .weight = {}, .bias = {}},
                    {.inputs = 8, .outputs = 1, .weight = {}, .bias = {}}};
    for (auto& layer : model.layers) {
        for (std::size_t i = 0; i < layer.inputs * layer.outputs; ++i) {
            layer.weight.push_back(next());
        }
        for (std::size_t i = 0; i < layer.outputs; ++i) {
            layer.bias.push_back(next());
        }
    }
    return model;
}

const Options usual{.t_end = 20.5, .step = 0.05};

template <class Stepping, class Detector>
BallRun run(const Detector& detector, const Options& options = usual)
{
    return integrate(BouncingBall(), {10.0, 0.0}, options, Stepping{}, detector);
}

/// `a` verified, `b` by the exact detector.
void expect_same(const BallRun& a, const BallRun& b)
{
    ASSERT_EQ(a.events.size(), b.events.size());
    for (std::size_t i = 0; i < a.events.size(); ++i) {
        ASSERT_EQ(a.events[i].t, b.events[i].t);
        ASSERT_EQ(a.events[i].before, b.events[i].before);
        ASSERT_EQ(a.events[i].after, b.events[i].after);
        ASSERT_EQ(a.events[i].bracket.lo, b.events[i].bracket.lo);
    }
    ASSERT_EQ(a.t, b.t);
    ASSERT_EQ(a.x, b.x);
    ASSERT_EQ(a.statistics.steps, b.statistics.steps);
    // The features of the network read the guard once a step.
    ASSERT_EQ(a.statistics.guard_calls, b.statistics.guard_calls + a.statistics.network_calls);
}

template <class Stepping>
void expect_unmoved_by(const Model& model, const Options& options = usual)
{
    expect_same(run<Stepping>(Verified<Extremum>{BareNetwork(model)}, options),
                run<Stepping>(Extremum{}, options));
    expect_same(run<Stepping>(Verified<Ends>{BareNetwork(model), Ends{}}, options),
                run<Stepping>(Ends{}, options));
}

TEST(Verified, AThousandRandomNetworksChangeNoBit)
{
    std::mt19937_64 random(20230605);
    constexpr std::array steps{0.0037, 0.01, 0.05, 0.1, 0.37};
    constexpr std::array tolerances{1e-4, 1e-6, 1e-8, 1e-10};
    for (std::size_t i = 0; i < 1000; ++i) {
        Options options = usual;
        options.step = steps[i % steps.size()];
        options.rtol = options.atol = tolerances[i % tolerances.size()];
        const double size = std::pow(10.0, static_cast<double>(random() % 7) - 3);
        const Model model =
            model_of([&] { return size * (static_cast<double>(random() >> 11U) * 0x1p-52 - 1); });
        expect_unmoved_by<FixedStep<Rk4>>(model, options);
        expect_unmoved_by<ErrorControlled<Dopri5>>(model, options);
    }
}

TEST(Verified, WeightsThatAreNotNumbersChangeNoBit)
{
    for (const double weight :
         {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
          -std::numeric_limits<double>::infinity()}) {
        const Model model = model_of([=] { return weight; });
        expect_unmoved_by<FixedStep<Rk4>>(model);
        expect_unmoved_by<ErrorControlled<Dopri5>>(model);
    }
}

TEST(Verified, ANetworkThatAlwaysClearsMissesNothing)
{
    Model model = model_of([] { return 0.0; });
    model.threshold = 1;  // the logit is 0
    expect_unmoved_by<FixedStep<Rk4>>(model);
    expect_unmoved_by<ErrorControlled<Dopri5>>(model);
    const auto verified = run<FixedStep<Rk4>>(Verified<>{BareNetwork(model)});
    EXPECT_EQ(verified.statistics.missed_events, 13u);
    EXPECT_EQ(verified.statistics.late_events, 0u);
    EXPECT_EQ(verified.statistics.false_alarms, 0u);
}

TEST(Verified, ANetworkThatNeverClearsOnlyCostsTime)
{
    Model model = model_of([] { return 0.0; });
    model.threshold = -1;
    expect_unmoved_by<FixedStep<Rk4>>(model);
    const auto verified = run<FixedStep<Rk4>>(Verified<>{BareNetwork(model)});
    EXPECT_EQ(verified.statistics.missed_events, 0u);
    EXPECT_EQ(verified.statistics.false_alarms + 13, verified.statistics.steps);
}

TEST(Verified, WithoutABoundNoCheckIsDeferred)
{
    const auto verified = run<FixedStep<Rk4>>(
        Verified<>{BareNetwork(load_model(RICOCHET_MODELS "/bouncing-ball.safetensors"))});
    EXPECT_EQ(verified.statistics.checks_deferred, 0u);
    EXPECT_EQ(verified.statistics.network_calls, verified.statistics.steps);
    EXPECT_EQ(verified.statistics.evidence.checked + 13, verified.statistics.steps);
}

}  // namespace
}  // namespace ricochet::verified_test
