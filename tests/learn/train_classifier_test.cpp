#include "ricochet/learn/train.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "ricochet/systems/bouncing_ball.hpp"

namespace ricochet::learn::train_classifier_test {
namespace {

using X = std::array<double, 2>;

/// A pendulum that bounces off a wall on its right.
struct WallPendulum {
    using State = X;
    static constexpr const char* name = "wall-pendulum";
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -9.81 * std::sin(x[0])}; }
    [[nodiscard]] double guard(double, const X& x) const { return 0.3 - x[0]; }
    void reset(double, X& x) const { x[1] *= -0.95; }
};

ClassifierTraining small_training()
{
    ClassifierTraining training;
    training.step = 0.02;
    training.surface_points = 400;
    training.states = 10'000;
    training.fresh_states = 6'000;
    training.trial_events = 200;
    training.training.hidden = {16, 16};
    training.training.iterations = 3000;
    return training;
}

TEST(Rivals, TheVerdictSaysWhatTakesWhichTimeAndWhatIsLost)
{
    // Checking every 8 steps is faster, but loses an event, and does not count.
    std::vector<Rival> rivals{
        {.name = "every step", .guard_calls = 5000, .seconds = 2, .events = 203},
        {.name = "every 8 steps", .guard_calls = 600, .seconds = 0.04, .events = 202},
        {.name = "the network", .guard_calls = 1000, .seconds = 0.1, .events = 203}};
    EXPECT_EQ(describe(rivals),
              "the network is the fastest of 2 ways to check that lose no more events: with the "
              "network a run takes 0.05 of the time of checking every step with Extremum (0 of 203 "
              "events lost)");
    // 0.08 s more for 4000 calls fewer.
    rivals[2].seconds = 2.08;
    EXPECT_EQ(describe(rivals),
              "the network is not the fastest of 2 ways to check that lose no more events: with "
              "the network a run takes 1.04 of the time of checking every step with Extremum (0 of "
              "203 events lost); checking every step takes 1.00 (0 of 203 lost); the network is "
              "the fastest from a guard whose calls take 20 us longer each");
    // A network that loses two events is compared with all that lose two at most.
    rivals[2].events = 201;
    EXPECT_EQ(describe(rivals),
              "the network is not the fastest of 3 ways to check that lose no more events: with "
              "the network a run takes 1.04 of the time of checking every step with Extremum (2 of "
              "203 events lost); checking every 8 steps takes 0.02 (1 of 203 lost); at no price of "
              "the guard is the network the fastest, since it spares no calls");
}

TEST(ClassifierTrial, HasOneVerdict)
{
    ClassifierTrial trial{.events = 100, .exact_seconds = 1, .network_seconds = 2};
    EXPECT_NE(trial.describe().find("a check of the end of every step is faster"),
              std::string::npos);
    // On the runs of the rivals it was the other way round.
    trial.rivals = {{.name = "every step", .seconds = 2, .events = 10},
                    {.name = "the end of every step", .seconds = 1.5, .events = 10},
                    {.name = "the network", .seconds = 1, .events = 10}};
    EXPECT_EQ(trial.describe().find("the network is the fastest of 3 ways"), 0U)
        << trial.describe();
    EXPECT_EQ(trial.describe().find("faster"), std::string::npos) << trial.describe();
}

TEST(TrainClassifier, AnySystemGetsANetworkFromItsOwnRuns)
{
    const WallPendulum system;
    const auto starts = from_box(X{-1, -2}, X{0.25, 2});
    const TrainedClassifier trained =
        train_classifier(system, starts, FixedStep<Rk4>{}, {}, small_training());
    EXPECT_EQ(trained.model.system, "wall-pendulum");
    EXPECT_EQ(trained.model.recipe, "state");
    EXPECT_EQ(trained.model.step_min, 0.02);
    ASSERT_TRUE(trained.report.fresh.has_value());
    // The network has learned: nearly all events are predicted, and most clear states are cleared.
    const Assessment& fresh = *trained.report.fresh;
    EXPECT_LT(fresh.miss_bound, 0.02);
    EXPECT_GT(fresh.cleared_share, 0.7);
    EXPECT_GE(trained.trial.events, 200u);
    EXPECT_LT(trained.trial.network_calls, trained.trial.exact_calls / 2);
    EXPECT_LE(50 * trained.trial.missed, trained.trial.events);
    EXPECT_GT(trained.trial.exact_seconds, 0);
    EXPECT_GT(trained.trial.network_seconds, 0);
    EXPECT_EQ(trained.trial.describe().find(describe(trained.trial.rivals)), 0U)
        << trained.trial.describe();
    // Without rivals the sentence follows the times, which a busy machine may turn around.
    ClassifierTrial trial = trained.trial;
    trial.rivals.clear();
    trial.network_seconds = 2 * trial.exact_seconds;
    EXPECT_FALSE(trial.pays());
    EXPECT_NE(trial.describe().find("a check of the end of every step is faster"),
              std::string::npos)
        << trial.describe();
    trial.network_seconds = trial.exact_seconds / 2;
    EXPECT_TRUE(trial.pays());
    EXPECT_NE(trial.describe().find("a run takes 0.50 of the time"), std::string::npos)
        << trial.describe();
    ASSERT_EQ(trained.trial.rivals.size(), 6u);
    const Rival& exact = trained.trial.rivals.front();
    EXPECT_GE(exact.events, 200u);
    for (const Rival& rival : trained.trial.rivals) {
        EXPECT_GT(rival.guard_calls, 0u) << rival.name;
        EXPECT_GT(rival.seconds, 0) << rival.name;
        EXPECT_LE(rival.events, exact.events) << rival.name;
    }
}

TEST(TrainClassifier, TheSameSeedGivesTheSameNetwork)
{
    const BouncingBall ball;
    ClassifierTraining training = small_training();
    training.training.iterations = 200;
    training.states = 2000;
    training.fresh_states = 200;
    training.trial_events = 20;
    const auto starts = from_box(X{0.1, -5}, X{10, 5});
    const auto one = train_classifier(ball, starts, FixedStep<Rk4>{}, {}, training);
    const auto two = train_classifier(ball, starts, FixedStep<Rk4>{}, {}, training);
    ASSERT_EQ(one.model.layers.size(), two.model.layers.size());
    for (std::size_t k = 0; k < one.model.layers.size(); ++k) {
        EXPECT_EQ(one.model.layers[k].weight, two.model.layers[k].weight);
    }
    EXPECT_EQ(one.trial.missed, two.trial.missed);
}

TEST(TrainClassifier, RefusesWhatCannotBeTrained)
{
    const BouncingBall ball;
    const auto starts = from_box(X{0.1, -5}, X{10, 5});
    const auto refused = [&](const ClassifierTraining& training, const char* word) {
        try {
            (void)train_classifier(ball, starts, FixedStep<Rk4>{}, {}, training);
            ADD_FAILURE() << word;
        } catch (const std::invalid_argument& error) {
            EXPECT_NE(std::string(error.what()).find(word), std::string::npos) << error.what();
        }
    };
    ClassifierTraining training = small_training();
    training.step = 0;
    refused(training, "step");
    training = small_training();
    training.run_length = 0.001;
    refused(training, "run_length");
    training = small_training();
    training.margin = 1;
    refused(training, "margin");
    training = small_training();
    training.states = 3;
    refused(training, "states");
    struct Quiet {
        static constexpr bool resets() { return false; }
        void flow(double, const X&, X& dxdt) const { dxdt = {0, 0}; }
        [[nodiscard]] double guard(double, const X& x) const { return 100 + x[0]; }
    };
    training = small_training();
    training.most_steps = 10'000;
    EXPECT_THROW(
        (void)train_classifier(Quiet{}, from_box(X{0, 0}, X{1, 1}), FixedStep<Rk4>{}, {}, training),
        std::invalid_argument);
}

}  // namespace
}  // namespace ricochet::learn::train_classifier_test
