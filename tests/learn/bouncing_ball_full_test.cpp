// The complete trainings of the stored models: less than a minute on one core.
#include <gtest/gtest.h>

#include "ricochet/learn/classifier.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::learn::bouncing_ball_full_test {
namespace {

TEST(BallTrainingInFull, FixedStepIsRightOnItsWholeTestSetAndMissesNoFreshEvent)
{
    const Trained trained =
        train_bouncing_ball(BallModel::fixed_step, ball_training(BallModel::fixed_step));
    EXPECT_EQ(trained.report.outcome, TrainingOutcome::finished);
    EXPECT_EQ(trained.report.held_out.confusion.missed, 0U);
    EXPECT_EQ(trained.report.held_out.confusion.false_alarms, 0U);
    EXPECT_EQ(trained.report.fresh->confusion.missed, 0U);
    EXPECT_LE(trained.report.fresh->miss_bound, 1e-4);
}

TEST(BallTrainingInFull, AnyStepMissesNoFreshEventFromAnySeedAndTakesLessThanAMinute)
{
    for (const std::uint64_t seed : {1U, 2U, 3U}) {
        BallTraining training = ball_training(BallModel::any_step);
        training.seed = seed;
        const Trained trained = train_bouncing_ball(BallModel::any_step, training);
        EXPECT_EQ(trained.report.outcome, TrainingOutcome::finished) << seed;
        EXPECT_EQ(trained.report.fresh->confusion.missed, 0U) << seed;
        EXPECT_LE(trained.report.fresh->miss_bound, 1e-4) << seed;
        EXPECT_GE(trained.report.fresh->cleared_share, 0.95) << seed;
        EXPECT_LE(trained.report.seconds, 60) << seed;
        if (seed != ball_training(BallModel::any_step).seed) continue;
        const Model stored = load_model(RICOCHET_MODELS "/bouncing-ball.safetensors");
        EXPECT_EQ(to_safetensors(trained.model), to_safetensors(stored));
    }
}

}  // namespace
}  // namespace ricochet::learn::bouncing_ball_full_test
