#include "ricochet/learn_steps/policies.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <ostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "ricochet/base/random.hpp"
#include "ricochet/nn/mlp.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::learn::policy_training_test {
namespace {

/// A trainer with small networks.
struct Trainer {
    std::string name;
    std::function<TrainedPolicy(const Environment&, const PolicyTraining&, const PolicyCallback&)>
        train;
    // NOLINTNEXTLINE(readability-identifier-naming): the name that GoogleTest looks for
    friend void PrintTo(const Trainer& trainer, std::ostream* out) { *out << trainer.name; }
};

TrainedPolicy small_tqc(const Environment& environment, const PolicyTraining& training,
                        const PolicyCallback& progress)
{
    return train_tqc(environment,
                     {.training = training,
                      .actor = {32, 32},
                      .critic = {32, 32},
                      .critics = 2,
                      .quantiles = 8,
                      .dropped = 1,
                      .rate = 2e-3,
                      .first_temperature = 0.1},
                     progress);
}

TrainedPolicy small_td3(const Environment& environment, const PolicyTraining& training,
                        const PolicyCallback& progress)
{
    return train_td3(environment,
                     {.training = training, .actor = {32, 32}, .critic = {32, 32}, .rate = 2e-3},
                     progress);
}

class PolicyTrainingWith : public testing::TestWithParam<Trainer> {
protected:
    static TrainedPolicy train(const Environment& environment, const PolicyTraining& training,
                               const PolicyCallback& progress = {})
    {
        return GetParam().train(environment, training, progress);
    }

    static std::filesystem::path scratch(const std::string& name)
    {
        return std::filesystem::temp_directory_path() /
               ("ricochet_" + GetParam().name + "_" + name);
    }
};

INSTANTIATE_TEST_SUITE_P(Both, PolicyTrainingWith,
                         testing::Values(Trainer{"tqc", small_tqc}, Trainer{"td3", small_td3}),
                         [](const auto& parameter) { return parameter.param.name; });

double act(const Mlp<float>& policy, double observation)
{
    const auto in = static_cast<float>(observation);
    float out = 0;
    policy.forward(&in, &out);
    return std::tanh(static_cast<double>(out));
}

/// One step: observe s in [-1, 1], act, and lose the square of the distance to s / 2.
Environment bandit()
{
    const auto s = std::make_shared<double>();
    return {.observations = 1,
            .actions = 1,
            .reset =
                [s](std::uint64_t seed, std::span<double> observation) {
                    *s = observation[0] = Random(seed).uniform(-1, 1);
                },
            .step =
                [s](std::span<const double> action, std::span<double> observation) {
                    observation[0] = *s;
                    const double miss = action[0] - *s / 2;
                    return Reaction{.reward = -miss * miss, .terminal = true};
                }};
}

/// x⁺ = x + a / 2, reward -(x^2 + a^2 / 2), from x in [-1, 1], cut after ten steps.
struct Regulator {
    static constexpr double discount = 0.9;
    double x = 0;
    int steps = 0;

    double step(double a)
    {
        const double reward = -(x * x + a * a / 2);
        x += a / 2;
        ++steps;
        return reward;
    }
};

Environment regulator()
{
    const auto state = std::make_shared<Regulator>();
    return {.observations = 1,
            .actions = 1,
            .reset =
                [state](std::uint64_t seed, std::span<double> observation) {
                    *state = {.x = Random(seed).uniform(-1, 1)};
                    observation[0] = state->x;
                },
            .step =
                [state](std::span<const double> action, std::span<double> observation) {
                    const double reward = state->step(action[0]);
                    observation[0] = state->x;
                    return Reaction{.reward = reward, .truncated = state->steps == 10};
                }};
}

void expect_same_layers(const Model& a, const Model& b)
{
    ASSERT_EQ(a.layers.size(), b.layers.size());
    for (std::size_t k = 0; k < a.layers.size(); ++k) {
        EXPECT_EQ(a.layers[k].weight, b.layers[k].weight) << "layer " << k;
        EXPECT_EQ(a.layers[k].bias, b.layers[k].bias) << "layer " << k;
    }
}

/// Root mean square of the distance from the best action of the bandit.
double miss(const TrainedPolicy& trained)
{
    const Mlp<float> policy(trained.policy);
    double squares = 0;
    for (double s = -1; s <= 1; s += 0.125) {
        squares += (act(policy, s) - s / 2) * (act(policy, s) - s / 2) / 17;
    }
    return std::sqrt(squares);
}

TEST_P(PolicyTrainingWith, FindsTheBestActionOfABandit)
{
    const TrainedPolicy trained =
        train(bandit(), {.steps = 3000, .random_steps = 200, .batch = 64, .polyak = 0.02});
    ASSERT_EQ(trained.outcome, PolicyOutcome::finished) << trained.message;
    EXPECT_EQ(trained.episodes, 3000U);
    // The best constant misses by 0.31 in the mean square. Eight seeds of each trainer left
    // 0.006 to 0.045 of that; bits, and so the luck of a seed, differ between instruction sets.
    EXPECT_LT(miss(trained), 0.08);
}

TEST_P(PolicyTrainingWith, NearsTheOptimalReturnOfALinearQuadraticRegulator)
{
    // The cost to go is P x^2 with P = 1 + g P - g^2 P^2 b^2 / (r + g b^2 P), b = r = 1/2, and the
    // optimal action -K x with K = g b P / (r + g b^2 P) = 0.93 stays inside [-1, 1]. The episodes
    // are cut, not terminal: a trainer that treated them as terminal would learn another P.
    constexpr double g = Regulator::discount;
    constexpr double a2 = g / 4;
    constexpr double a1 = 0.5 - g / 4 - g / 2;
    const double p = (-a1 + std::sqrt(a1 * a1 + 2 * a2)) / (2 * a2);
    EXPECT_NEAR(p, 1 + g * p - g * g * p * p / 4 / (0.5 + g * p / 4), 1e-12);

    std::vector<double> costs;
    for (const std::uint64_t seed : {1U, 2U, 3U}) {
        const TrainedPolicy trained = train(regulator(), {.steps = 4000,
                                                          .random_steps = 200,
                                                          .batch = 64,
                                                          .discount = g,
                                                          .polyak = 0.02,
                                                          .seed = seed});
        ASSERT_EQ(trained.outcome, PolicyOutcome::finished) << trained.message;
        const Mlp<float> policy(trained.policy);
        double cost = 0;
        double optimum = 0;
        for (double start = -1; start <= 1; start += 0.25) {
            Regulator world{.x = start};
            double weight = 1;
            for (int k = 0; k < 200; ++k, weight *= g) {
                cost -= weight * world.step(act(policy, world.x));
            }
            optimum += p * start * start;
        }
        costs.push_back(cost / optimum);
    }
    std::ranges::sort(costs);
    EXPECT_GT(costs.front(), 1 - 1e-6);  // nothing is better
    // Eight seeds cost 1.001 to 1.025 times the optimum with TQC, 1.01 to 1.10 with TD3. Zero
    // action costs 10 x^2, five times as much. The median is tested because bits
    // differ between instruction sets.
    EXPECT_LT(costs[1], 1.12);
}

TEST_P(PolicyTrainingWith, HasTheSameBitsOnOneThreadAndOnThree)
{
    // 100 rows are two parts.
    const PolicyTraining options{.steps = 150, .random_steps = 50, .batch = 100, .threads = 1};
    PolicyTraining more = options;
    more.threads = 3;
    expect_same_layers(train(regulator(), options).policy, train(regulator(), more).policy);
}

TEST_P(PolicyTrainingWith, ResumesToTheSameBitsInTheMiddleOfAnEpisode)
{
    const std::filesystem::path file = scratch("training.checkpoint");
    PolicyTraining options{
        .steps = 400, .random_steps = 50, .batch = 32, .buffer = 150, .report_every = 37};
    const TrainedPolicy whole = train(regulator(), options);

    options.checkpoint = file;
    const TrainedPolicy part =
        train(regulator(), options,
              [](const PolicyProgress& p, const Model&) { return p.step < 5 * 37; });
    EXPECT_EQ(part.outcome, PolicyOutcome::stopped);
    EXPECT_EQ(part.steps, 185U);  // the fifth step of an episode of ten
    options.resume = true;
    const TrainedPolicy rest = train(regulator(), options);
    EXPECT_EQ(rest.outcome, PolicyOutcome::finished);
    expect_same_layers(rest.policy, whole.policy);
    ASSERT_EQ(rest.curve.size(), whole.curve.size());
    for (std::size_t i = 0; i < whole.curve.size(); ++i) {
        EXPECT_EQ(rest.curve[i].step, whole.curve[i].step);
        EXPECT_EQ(rest.curve[i].episodes, whole.curve[i].episodes);
        EXPECT_EQ(rest.curve[i].mean_return, whole.curve[i].mean_return);
        if (i > 0) {  // no update before the first
            EXPECT_EQ(rest.curve[i].critic_loss, whole.curve[i].critic_loss);
            EXPECT_EQ(rest.curve[i].actor_loss, whole.curve[i].actor_loss);
            EXPECT_EQ(rest.curve[i].temperature, whole.curve[i].temperature);
        }
    }
    std::filesystem::remove(file);
}

TEST_P(PolicyTrainingWith, GoesOnWithMoreStepsAsIfThereHadBeenMoreFromTheStart)
{
    const std::filesystem::path file = scratch("longer.checkpoint");
    PolicyTraining options{.steps = 120, .random_steps = 50, .batch = 32, .checkpoint = file};
    (void)train(regulator(), options);
    options.steps = 200;
    const TrainedPolicy whole = train(regulator(), {.steps = 200, .random_steps = 50, .batch = 32});
    options.resume = true;
    expect_same_layers(train(regulator(), options).policy, whole.policy);
    std::filesystem::remove(file);
}

TEST_P(PolicyTrainingWith, StartsFromTheNetworksOfAnother)
{
    const std::filesystem::path file = scratch("first.checkpoint");
    const TrainedPolicy first = train(
        bandit(),
        {.steps = 2000, .random_steps = 200, .batch = 64, .polyak = 0.02, .checkpoint = file});
    // Fifty updates from other transitions change little; without initial networks they teach
    // little.
    PolicyTraining options{.steps = 100, .random_steps = 50, .batch = 64, .seed = 9};
    const TrainedPolicy fresh = train(bandit(), options);
    options.start_from = file;
    const TrainedPolicy second = train(bandit(), options);
    EXPECT_EQ(second.steps, 100U);
    EXPECT_EQ(second.curve.size(), 1U);
    EXPECT_LT(miss(second), miss(first) + 0.1);
    EXPECT_GT(miss(fresh), 2 * miss(second));

    Environment wider = bandit();
    wider.observations = 2;
    EXPECT_THROW((void)train(wider, options), std::runtime_error);
    std::filesystem::remove(file);
}

TEST_P(PolicyTrainingWith, RefusesTheCheckpointOfAnotherTraining)
{
    const std::filesystem::path file = scratch("other.checkpoint");
    PolicyTraining options{.steps = 60, .random_steps = 50, .batch = 32, .checkpoint = file};
    (void)train(regulator(), options);
    options.resume = true;
    options.seed = 2;
    EXPECT_THROW((void)train(regulator(), options), std::runtime_error);
    options.seed = 1;
    // The same, except for the start.
    Environment other = regulator();
    other.reset = [reset = other.reset](std::uint64_t seed, std::span<double> observation) {
        reset(seed + 1, observation);
    };
    EXPECT_THROW((void)train(other, options), std::runtime_error);
    std::filesystem::remove(file);
}

TEST_P(PolicyTrainingWith, EndsAtARewardThatIsNaNAndKeepsWhatWasLearnt)
{
    Environment environment = regulator();
    int steps = 0;
    environment.step = [&, step = environment.step](auto action, auto observation) {
        Reaction reaction = step(action, observation);
        if (++steps == 153) reaction.reward = std::numeric_limits<double>::quiet_NaN();
        return reaction;
    };
    const PolicyTraining options{.steps = 400, .random_steps = 50, .batch = 32};
    const TrainedPolicy trained = train(environment, options);
    EXPECT_EQ(trained.outcome, PolicyOutcome::non_finite);
    EXPECT_EQ(trained.steps, 152U);
    EXPECT_NE(trained.message.find("the reward is nan at step 153, which is step 3 of the episode"),
              std::string::npos)
        << trained.message;
    PolicyTraining until = options;
    until.steps = 152;
    expect_same_layers(trained.policy, train(regulator(), until).policy);
}

TEST_P(PolicyTrainingWith, EndsAtAnObservationThatIsInfinite)
{
    Environment environment = bandit();
    environment.observations = 3;
    environment.reset = [](std::uint64_t, std::span<double> o) { std::ranges::fill(o, 0.0); };
    environment.step = [](std::span<const double>, std::span<double> o) {
        o[2] = std::numeric_limits<double>::infinity();
        return Reaction{};
    };
    const TrainedPolicy trained = train(environment, {.steps = 400});
    EXPECT_EQ(trained.outcome, PolicyOutcome::non_finite);
    EXPECT_NE(trained.message.find("component 2 of the observation is inf at step 1"),
              std::string::npos)
        << trained.message;

    environment.reset = [](std::uint64_t, std::span<double> o) { std::ranges::fill(o, 1e300); };
    EXPECT_EQ(train(environment, {.steps = 400}).outcome, PolicyOutcome::non_finite);
}

TEST_P(PolicyTrainingWith, StopsAtTheTimeAllowed)
{
    const TrainedPolicy trained = train(bandit(), {.steps = 1000, .max_seconds = 1e-9});
    EXPECT_EQ(trained.outcome, PolicyOutcome::max_seconds);
    EXPECT_EQ(trained.steps, 1U);
}

TEST_P(PolicyTrainingWith, GivesAModelThatCanBeStored)
{
    TrainedPolicy trained = train(bandit(), {.steps = 80, .random_steps = 50, .batch = 32});
    ASSERT_EQ(trained.policy.domain.size(), 1U);
    EXPECT_LT(trained.policy.domain[0].lower, -0.8);
    EXPECT_GT(trained.policy.domain[0].upper, 0.8);
    const std::filesystem::path file = scratch("policy.safetensors");
    trained.policy.system = "bandit";
    trained.policy.recipe = "state";
    save_model(trained.policy, file);
    const Mlp<float> stored(load_model(file));
    const Mlp<float> learnt(trained.policy);
    for (const double s : {-0.7, 0.0, 0.4}) EXPECT_EQ(act(stored, s), act(learnt, s));
    std::filesystem::remove(file);
}

TEST_P(PolicyTrainingWith, RefusesAWrongSetUp)
{
    const auto refuses = [](const Environment& environment, const PolicyTraining& options) {
        EXPECT_THROW((void)train(environment, options), std::invalid_argument);
    };
    refuses({}, {});
    Environment incomplete = bandit();
    incomplete.step = nullptr;
    refuses(incomplete, {});
    refuses(bandit(), {.steps = 0});
    refuses(bandit(), {.batch = 0});
    refuses(bandit(), {.discount = 1.5});
    refuses(bandit(), {.polyak = 0});
    refuses(bandit(), {.threads = 0});
    refuses(bandit(), {.resume = true});
}

TEST(PolicyTraining, ResumesToTheSameBitsBetweenTwoDrawsOfTheNoise)
{
    const std::filesystem::path file =
        std::filesystem::temp_directory_path() / "ricochet_tqc_noise.checkpoint";
    TqcOptions options{
        .training = {.steps = 150, .random_steps = 50, .batch = 32, .report_every = 74},
        .actor = {8},
        .critic = {8},
        .noise_interval = 5};
    const TrainedPolicy whole = train_tqc(regulator(), options);
    options.training.checkpoint = file;
    const TrainedPolicy part =
        train_tqc(regulator(), options, [](const PolicyProgress&, const Model&) { return false; });
    EXPECT_EQ(part.steps, 74U);  // 24 with noise
    options.training.resume = true;
    expect_same_layers(train_tqc(regulator(), options).policy, whole.policy);
    std::filesystem::remove(file);
}

TEST(PolicyTraining, KeepsFiniteWeightsWhenItDiverges)
{
    const TrainedPolicy trained =
        train_tqc(bandit(), {.training = {.steps = 400, .random_steps = 50, .batch = 32},
                             .actor = {8},
                             .critic = {8},
                             .rate = 1e30});
    EXPECT_EQ(trained.outcome, PolicyOutcome::diverged);
    EXPECT_FALSE(trained.message.empty());
    for (const DenseLayer& layer : trained.policy.layers) {
        for (const double weight : layer.weight) EXPECT_TRUE(std::isfinite(weight));
    }
}

TEST(PolicyTraining, RefusesOptionsOfATrainerOutOfRange)
{
    const Environment environment = bandit();
    EXPECT_THROW((void)train_tqc(environment, {.actor = {}}), std::invalid_argument);
    EXPECT_THROW((void)train_tqc(environment, {.critics = 0}), std::invalid_argument);
    EXPECT_THROW((void)train_tqc(environment, {.dropped = 25}), std::invalid_argument);
    EXPECT_THROW((void)train_tqc(environment, {.rate = 0}), std::invalid_argument);
    EXPECT_THROW((void)train_tqc(environment, {.first_temperature = -1}), std::invalid_argument);
    EXPECT_THROW((void)train_td3(environment, {.critic = {0}}), std::invalid_argument);
    EXPECT_THROW((void)train_td3(environment, {.exploration = -1}), std::invalid_argument);
    EXPECT_THROW((void)train_td3(environment, {.delay = 0}), std::invalid_argument);
}

}  // namespace
}  // namespace ricochet::learn::policy_training_test
