#include "ricochet/gates.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

#include "ricochet/integrate.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/systems/bouncing_ball.hpp"

namespace ricochet::network_test {
namespace {

Model paper_model()
{
    return load_model(RICOCHET_MODELS "/bouncing-ball-step-0.01.safetensors");
}

/// A network without hidden layers: weight . (u, v) + bias >= 0 announces an event.
Model linear_model(double weight_u, double weight_v, double bias)
{
    Model model;
    model.system = "bouncing-ball";
    model.recipe = "state";
    model.offset = {0, 0};
    model.scale = {1, 1};
    model.step_min = model.step_max = 0.01;
    model.layers = {{.inputs = 2, .outputs = 1, .weight = {weight_u, weight_v}, .bias = {bias}}};
    return model;
}

Run<std::array<double, 2>> run_with(const BareNetwork& network, double step = 0.01)
{
    return integrate(BouncingBall(), {10.0, 0.0}, {.t_end = 20.5, .step = step}, FixedStep<Rk4>{},
                     network);
}

TEST(Network, FindsThePapersThirteenImpactsAtItsOwnStep)
{
    const BouncingBall ball;
    const auto run = run_with(BareNetwork(paper_model()));
    ASSERT_EQ(run.events.size(), 13u);
    for (int i = 0; i < 13; ++i) {
        // The bound that the exact detectors meet too.
        EXPECT_NEAR(run.events[static_cast<std::size_t>(i)].t, ball.impact_time(i, 10), 2e-14);
    }
    EXPECT_EQ(run.statistics.late_events, 0u);
    EXPECT_GT(run.statistics.evidence.assumed, 1800u);
}

TEST(Network, IsAskedOncePerStepAndSavesTheGuard)
{
    const auto run = run_with(BareNetwork(paper_model()));
    EXPECT_EQ(run.statistics.network_calls, run.statistics.steps);
    EXPECT_LT(run.statistics.guard_calls, run.statistics.steps / 5);
}

TEST(Network, AFalseAlarmIsCountedAndChangesNothing)
{
    const auto exact = integrate(BouncingBall(), {10.0, 0.0}, {.t_end = 20.5, .step = 0.01},
                                 FixedStep<Rk4>{}, Ends{});
    const auto run = run_with(BareNetwork(linear_model(0, 0, 1)));  // always "event"
    ASSERT_EQ(run.events.size(), exact.events.size());
    for (std::size_t i = 0; i < run.events.size(); ++i) {
        EXPECT_EQ(run.events[i].t, exact.events[i].t);
    }
    EXPECT_EQ(run.statistics.false_alarms, run.statistics.steps - 13);
}

TEST(Network, AMissedEventIsFoundLateAndMarked)
{
    // Announces an event only once the ball is already below the floor.
    const auto run = run_with(BareNetwork(linear_model(-1, 0, 0)));
    ASSERT_GT(run.events.size(), 0u);
    EXPECT_EQ(run.statistics.late_events, run.events.size());
    const auto& first = run.events[0];
    EXPECT_TRUE(first.late);
    EXPECT_LT(first.before[0], 0);
    // 1.42784 s lies in the step that ends at 1.43 s.
    EXPECT_NEAR(first.t, 1.43, 1e-12);
}

TEST(Network, ANetworkThatNeverSpeaksLetsTheBallFall)
{
    Model silent = linear_model(0, 0, -1);
    silent.step_min = 0;  // the last step is shorter
    const auto run = run_with(BareNetwork(silent));
    EXPECT_EQ(run.events.size(), 0u);
    EXPECT_LT(run.x[0], -1000);
    EXPECT_EQ(run.statistics.guard_calls, 1u);  // when it was armed
}

TEST(Network, NaNWeightsAnnounceAnEventAtEveryStep)
{
    const auto run = run_with(BareNetwork(linear_model(std::nan(""), 0, 0)));
    EXPECT_EQ(run.events.size(), 13u);
    EXPECT_EQ(run.statistics.evidence.assumed, run.statistics.false_alarms);
}

// --- one model for every ball and every step ---

Model any_step_model()
{
    return load_model(RICOCHET_MODELS "/bouncing-ball.safetensors");
}

struct KnownRun {
    double restitution, height, t_end;
    std::size_t impacts;
};

// B1 is the source paper's run; B2 and B3 fall from 1 m.
constexpr KnownRun known_runs[] = {{0.9, 10, 20.5, 13}, {0.7, 1, 2.25, 6}, {0.9, 1, 3, 4}};

template <class Stepping>
void expect_all_impacts(const KnownRun& known, const Options& options, const BareNetwork& network)
{
    const BouncingBall ball({.gravity = 9.81, .restitution = known.restitution});
    const auto run = integrate(ball, {known.height, 0.0}, options, Stepping{}, network);
    ASSERT_EQ(run.events.size(), known.impacts) << options.step;
    for (std::size_t i = 0; i < run.events.size(); ++i) {
        EXPECT_NEAR(run.events[i].t, ball.impact_time(static_cast<int>(i), known.height), 5e-14);
    }
    EXPECT_EQ(run.statistics.missed_events, 0u) << options.step;
}

TEST(Network, OneModelServesEveryBallAtEveryFixedStep)
{
    const BareNetwork network(any_step_model());
    for (const KnownRun& known : known_runs) {
        for (const double h :
             {1e-4, 3e-4, 1e-3, 3.7e-3, 0.01, 0.037, 0.05, 0.1, 0.3, 0.37, 0.7, 1.0}) {
            expect_all_impacts<FixedStep<Rk4>>(known, {.t_end = known.t_end, .step = h}, network);
        }
    }
}

TEST(Network, OneModelServesEveryBallUnderErrorControl)
{
    const BareNetwork network(any_step_model());
    for (const KnownRun& known : known_runs) {
        for (const double rtol : {1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10, 1e-12}) {
            const Options options{.t_end = known.t_end, .rtol = rtol, .atol = rtol / 100};
            expect_all_impacts<ErrorControlled<Dopri5>>(known, options, network);
            expect_all_impacts<ErrorControlled<Fehlberg78>>(known, options, network);
        }
    }
}

TEST(Network, AStepOutsideItsRangeIsNeverCleared)
{
    // Trained for 0.01 s only: the last step, 0.004 s, is examined.
    const BareNetwork network(linear_model(0, 0, -1));  // never "event"
    const auto run = integrate(BouncingBall(), {10.0, 0.0}, {.t_end = 0.104, .step = 0.01},
                               FixedStep<Rk4>{}, network);
    EXPECT_EQ(run.statistics.checks_deferred, 10u);
    EXPECT_EQ(run.statistics.false_alarms, 1u);
}

std::string refusal(const Model& model, double step = 0.01)
{
    try {
        (void)run_with(BareNetwork(model), step);
        return "accepted";
    } catch (const std::invalid_argument& reason) {
        return reason.what();
    }
}

TEST(Network, AnotherStepThanItWasTrainedForIsRefused)
{
    EXPECT_EQ(refusal(linear_model(0, 0, 1), 0.02),
              "Network: the model for bouncing-ball is trained for steps in [0.01, 0.01] s, "
              "got [0.02, 0.02]");
}

TEST(Network, AModelForAnotherSystemIsRefused)
{
    Model model = linear_model(0, 0, 1);
    model.system = "pendulum";
    EXPECT_EQ(refusal(model), "Network: the model is for pendulum, this system is bouncing-ball");

    struct Nameless {
        using State = std::array<double, 2>;
        static constexpr bool resets() { return false; }
        void flow(double, const State& x, State& dxdt) const { dxdt = {x[1], -x[0]}; }
        [[nodiscard]] double guard(double, const State& x) const { return x[0]; }
    };
    EXPECT_THROW((void)integrate(Nameless{}, {0.0, 1.0}, {.t_end = 1, .step = 0.01},
                                 FixedStep<Rk4>{}, BareNetwork(paper_model())),
                 std::invalid_argument);
}

TEST(Network, AModelForAnotherGravityIsRefused)
{
    try {
        (void)integrate(BouncingBall({.gravity = 1.62, .restitution = 0.9}), {10.0, 0.0},
                        {.t_end = 1, .step = 0.01}, FixedStep<Rk4>{}, BareNetwork(paper_model()));
        FAIL() << "accepted";
    } catch (const std::invalid_argument& reason) {
        EXPECT_STREQ(
            reason.what(),
            "Network: the model for bouncing-ball is trained for gravity = 9.81, got 1.62");
    }
}

TEST(Network, AModelForOneStepIsRefusedUnderErrorControl)
{
    EXPECT_THROW((void)integrate(BouncingBall(), {10.0, 0.0}, {.t_end = 1},
                                 ErrorControlled<Dopri5>{}, BareNetwork(paper_model())),
                 std::invalid_argument);
}

TEST(Network, OutsideItsDomainNothingIsCleared)
{
    // The model covers heights up to some 12 m; a ball from 1000 m is examined until
    // it has come down that far, and by then it is too fast.
    const auto run = integrate(BouncingBall(), {1000.0, 0.0}, {.t_end = 14, .step = 0.01},
                               FixedStep<Rk4>{}, BareNetwork(paper_model()));
    EXPECT_EQ(run.statistics.checks_deferred, 0u);
}

TEST(Network, AnUnknownRecipeIsRefused)
{
    Model model = linear_model(0, 0, 1);
    model.recipe = "entrails";
    EXPECT_NE(refusal(model).find("entrails"), std::string::npos);
}

TEST(Network, FeaturesThatDoNotFitTheStateAreRefused)
{
    Model model = linear_model(0, 0, 1);
    model.offset = model.scale = {1, 1, 1};
    model.layers[0].inputs = 3;
    model.layers[0].weight = {1, 1, 1};
    EXPECT_EQ(refusal(model),
              "Network: the model for bouncing-ball takes 3 features, but 'state' of this state "
              "are 2");
}

}  // namespace
}  // namespace ricochet::network_test
