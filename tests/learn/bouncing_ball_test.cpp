#include "ricochet/learn/classifier.hpp"

#include <array>
#include <cmath>
#include <filesystem>
#include <stdexcept>
#include <string>

#include <gtest/gtest.h>

#include "ricochet/base/random.hpp"
#include "ricochet/detail/features.hpp"
#include "ricochet/nn/mlp.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/systems/bouncing_ball.hpp"

namespace ricochet::learn::bouncing_ball_test {
namespace {

using State = BouncingBall::State;

/// A stored model, evaluated on states of a ball.
class Stored {
public:
    explicit Stored(const std::string& file)
        : classifier_(load_model(std::filesystem::path(RICOCHET_MODELS) / file)),
          recipe_(ricochet::detail::recipe_named(classifier_.model().recipe))
    {
    }

    [[nodiscard]] bool alarm(const BouncingBall& ball, const State& x, double h) const
    {
        std::array<double, 2> row{};
        ricochet::detail::features(recipe_, ball, x, h, row.data());
        return classifier_.alarm(classifier_.logit(row.data()));
    }

    [[nodiscard]] bool in_domain(const State& x) const { return classifier_.in_domain(x.data()); }
    [[nodiscard]] const Model& model() const { return classifier_.model(); }

private:
    Classifier classifier_;
    ricochet::detail::Recipe recipe_;
};

const Stored& fixed_step()
{
    static const Stored model("bouncing-ball-step-0.01.safetensors");
    return model;
}

const Stored& any_step()
{
    static const Stored model("bouncing-ball.safetensors");
    return model;
}

State fall(const BouncingBall& ball, const State& x, double t)
{
    return {x[0] + t * (x[1] - 0.5 * ball.gravity() * t), x[1] - ball.gravity() * t};
}

/// a from slog(a): 1 + 2 |a| = 2^e m, where e + m - 1 is the magnitude of slog.
double slog_inverse(double value)
{
    const double e = std::floor(std::abs(value));
    const double m = 1 + std::abs(value) - e;
    return std::copysign((std::ldexp(m, static_cast<int>(e)) - 1) / 2, value);
}

struct Counts {
    int impacts = 0;
    int misses = 0;
    int false_alarms = 0;
};

/// Bounces in exact parabolas with steps of h that restart at each impact, and
/// counts how the model's answers compare with the end of each step.
Counts bounce(const Stored& model, const BouncingBall& ball, double height, double t_end, double h)
{
    Counts counts;
    double t_impact = 0;
    State start{height, 0};
    for (int k = 0; t_impact + k * h < t_end;) {
        const State x = fall(ball, start, k * h);
        const bool alarm = model.alarm(ball, x, h);
        if (fall(ball, start, (k + 1) * h)[0] > 0) {
            counts.false_alarms += alarm ? 1 : 0;
            ++k;
            continue;
        }
        t_impact += ball.first_impact(start[0], start[1]);
        if (t_impact > t_end) break;
        ++counts.impacts;
        counts.misses += alarm ? 0 : 1;
        const double flight = ball.first_impact(start[0], start[1]);
        start = {0, -ball.restitution() * fall(ball, start, flight)[1]};
        k = 0;
    }
    return counts;
}

TEST(BallTraining, KindsAreFoundByTheirNames)
{
    EXPECT_EQ(ball_model_named("fixed-step"), BallModel::fixed_step);
    EXPECT_EQ(ball_model_named("any-step"), BallModel::any_step);
    EXPECT_THROW((void)ball_model_named("paper"), std::invalid_argument);
}

TEST(BallTraining, LabelsOfAnyStepAreThoseOfTheLine)
{
    // Features with a relative error of 1e-15 are logarithms up to 48, so ratios are
    // recovered within 1e-13, and a state with a relative margin above 1e-9 is on its
    // side of the line.
    const SurfaceSample sample =
        sample_ball(BallModel::any_step, ball_training(BallModel::any_step), 5000, 5000, 1, true);
    std::size_t decided = 0;
    for (std::size_t i = 0; i < sample.data.size(); ++i) {
        const double a = slog_inverse(sample.data.row(i)[0]);
        const double b = slog_inverse(sample.data.row(i)[1]);
        if (std::abs(sample.data.margins[i]) < 1e-9) continue;
        ++decided;
        EXPECT_EQ(sample.data.labels[i] != 0, a + b <= 0.5) << a << ' ' << b;
    }
    EXPECT_GT(decided, 9000U);
}

TEST(BallTraining, FixedStepSamplesFillTheBoxOfThePapersRun)
{
    const SurfaceSample sample = sample_ball(
        BallModel::fixed_step, ball_training(BallModel::fixed_step), 5000, 5000, 1, false);
    double highest = 0;
    double fastest = 0;
    for (std::size_t i = 0; i < sample.data.size(); ++i) {
        highest = std::max(highest, sample.data.row(i)[0]);
        fastest = std::max(fastest, std::abs(sample.data.row(i)[1]));
    }
    EXPECT_GT(highest, 10);
    EXPECT_GT(fastest, std::sqrt(2 * 9.81 * 10));
}

TEST(BallTraining, ShortTrainingMissesNothing)
{
    BallTraining training = ball_training(BallModel::any_step);
    training.states = 40'000;
    training.fresh_events = 3000;
    training.training.iterations = 15'000;
    const Trained trained = train_bouncing_ball(BallModel::any_step, training);
    EXPECT_TRUE(trained.misses_none());
    ASSERT_TRUE(trained.report.fresh.has_value());
    EXPECT_GT(trained.report.fresh->cleared_share, 0.9);
    EXPECT_GT(trained.report.band, 0U);
    EXPECT_EQ(trained.model.system, "bouncing-ball");
    EXPECT_EQ(trained.model.recipe, "ballistic");
    EXPECT_NO_THROW((void)to_safetensors(trained.model));
}

TEST(BallTraining, RefusesAWorldWithoutGravity)
{
    BallTraining training = ball_training(BallModel::fixed_step);
    training.gravity = 0;
    EXPECT_THROW((void)train_bouncing_ball(BallModel::fixed_step, training), std::invalid_argument);
}

TEST(StoredFixedStep, SaysWhatItIsFor)
{
    const Model& model = fixed_step().model();
    EXPECT_EQ(model.system, "bouncing-ball");
    EXPECT_EQ(model.recipe, "state");
    EXPECT_EQ(model.parameters.at("gravity"), 9.81);
    EXPECT_EQ(model.step_min, 0.01);
    EXPECT_EQ(model.step_max, 0.01);
    ASSERT_EQ(model.layers.size(), 6U);
    for (std::size_t k = 0; k < 5; ++k) EXPECT_EQ(model.layers[k].outputs, 16U);
}

TEST(StoredFixedStep, MissesNoneAndAlarmsFalselyOnNoneOfItsTestSet)
{
    const BallTraining training = ball_training(BallModel::fixed_step);
    const std::size_t half = training.states / 2;
    const SurfaceSample sample =
        sample_ball(BallModel::fixed_step, training, half, half, training.seed, false);
    const Split parts = split(sample.data, training.training.test_share, training.seed);
    const Assessment a = assess(fixed_step().model(), parts.held_out);
    EXPECT_EQ(a.confusion.detected, half / 10);
    EXPECT_EQ(a.confusion.missed, 0U);
    EXPECT_EQ(a.confusion.false_alarms, 0U);
}

TEST(StoredFixedStep, MissesNoneOf40000FreshEvents)
{
    const SurfaceSample fresh = sample_ball(
        BallModel::fixed_step, ball_training(BallModel::fixed_step), 40'000, 40'000, 987, true);
    const Assessment a = assess(fixed_step().model(), fresh.data);
    EXPECT_EQ(a.confusion.missed, 0U);
    EXPECT_GE(a.cleared_share, 0.999);
}

TEST(StoredFixedStep, FindsThe13ImpactsOfThePapersRun)
{
    const Counts counts = bounce(fixed_step(), BouncingBall{}, 10, 20.5, 0.01);
    EXPECT_EQ(counts.impacts, 13);
    EXPECT_EQ(counts.misses, 0);
    EXPECT_LE(counts.false_alarms, 13);  // at most those inside the band; there are 2056 steps
}

TEST(StoredFixedStep, AlarmsOnTheExactBoundaryOfItsBox)
{
    const BouncingBall ball;
    for (double v = -15.4; v <= 15.4; v += 1e-3) {
        const State x{0.01 * (0.005 * ball.gravity() - v), v};
        if (!fixed_step().in_domain(x)) continue;
        ASSERT_TRUE(fixed_step().alarm(ball, x, 0.01)) << v;
    }
}

TEST(StoredAnyStep, IsSmallAndForEveryStepInItsRange)
{
    const Model& model = any_step().model();
    EXPECT_EQ(model.system, "bouncing-ball");
    EXPECT_EQ(model.recipe, "ballistic");
    EXPECT_TRUE(model.parameters.empty());
    EXPECT_LE(model.step_min, 1e-6);
    EXPECT_GE(model.step_max, 1e2);
    EXPECT_LE(model.layers.size(), 3U);
    for (const DenseLayer& layer : model.layers) EXPECT_LE(layer.outputs, 16U);
}

TEST(StoredAnyStep, MissesNoneOf30000EventsOverTenDecadesAndClearsWhatIsClear)
{
    // a = u / (g h^2) is log-uniform over ten decades; b = v / (g h) puts the state
    // on either side of the line a + b = 1/2, near to it or far.
    Random random(2024);
    int events = 0;
    int misses = 0;
    int well_clear = 0;
    int cleared = 0;
    while (events < 30'000) {
        const BouncingBall ball({.gravity = random.log_uniform(0.1, 100)});
        const double h = random.log_uniform(1e-6, 1e2);
        const double a = random.log_uniform(1e-4, 1e6);
        const double away = (random.chance(0.5) ? 1 : -1) * random.log_uniform(1e-6, 3) * (a + 0.5);
        const State x{a * ball.gravity() * h * h, (0.5 - a + away) * ball.gravity() * h};
        const double fallen = 0.5 * ball.gravity() * h * h;
        const double end = x[0] + x[1] * h - fallen;
        const bool alarm = any_step().alarm(ball, x, h);
        if (end <= 0) {
            ++events;
            misses += alarm ? 0 : 1;
        } else if (end > 0.1 * (x[0] + std::abs(x[1]) * h + fallen)) {
            ++well_clear;
            cleared += alarm ? 0 : 1;
        }
    }
    EXPECT_EQ(misses, 0);
    EXPECT_GT(well_clear, 5000);
    EXPECT_GE(cleared, 0.95 * well_clear);
}

TEST(StoredAnyStep, MissesNoneOf40000FreshEvents)
{
    const SurfaceSample fresh = sample_ball(BallModel::any_step, ball_training(BallModel::any_step),
                                            40'000, 40'000, 987, true);
    const Assessment a = assess(any_step().model(), fresh.data);
    EXPECT_EQ(a.confusion.missed, 0U);
    EXPECT_GE(a.cleared_share, 0.99);
}

TEST(StoredAnyStep, AlarmsOnTheExactBoundaryWhereverItIsAndBelowTheFloor)
{
    const BouncingBall ball({.gravity = 1});
    for (double b = 1e-6; b < 9e13; b *= 1.01) {
        ASSERT_TRUE(any_step().alarm(ball, {0.5 - b, b}, 1)) << b;
        ASSERT_TRUE(any_step().alarm(ball, {0.5 + b, -b}, 1)) << -b;
        ASSERT_TRUE(any_step().alarm(ball, {-b, -b}, 1)) << b;
        ASSERT_TRUE(any_step().alarm(ball, {0, -b}, 1)) << b;
    }
}

TEST(StoredAnyStep, ClearsTheStartOfAFlightLongerThanAStep)
{
    // From the floor with v / (g h) = b: b > 1/2 is clear, with margin
    // (b - 1/2) / (b + 1/2), which is 10 % at b = 11/18.
    const BouncingBall ball({.gravity = 1});
    for (double b = 11.0 / 18; b < 9e13; b *= 1.01) {
        ASSERT_FALSE(any_step().alarm(ball, {0, b}, 1)) << b;
        ASSERT_FALSE(any_step().alarm(ball, {-1e-13, b}, 1)) << b;
    }
}

TEST(StoredAnyStep, FindsEveryImpactAtEveryStep)
{
    for (const double h : {1e-4, 3e-4, 1e-3, 0.01, 0.03, 0.1, 0.3, 0.7, 1.0}) {
        const Counts first = bounce(any_step(), BouncingBall({.restitution = 0.9}), 10, 20.5, h);
        EXPECT_EQ(first.impacts, 13) << h;
        EXPECT_EQ(first.misses, 0) << h;
        const Counts second = bounce(any_step(), BouncingBall({.restitution = 0.7}), 1, 2.3, h);
        EXPECT_EQ(second.impacts, 6) << h;
        EXPECT_EQ(second.misses, 0) << h;
        const Counts third = bounce(any_step(), BouncingBall({.restitution = 0.9}), 1, 2.7, h);
        EXPECT_EQ(third.impacts, 4) << h;
        EXPECT_EQ(third.misses, 0) << h;
    }
}

}  // namespace
}  // namespace ricochet::learn::bouncing_ball_test
