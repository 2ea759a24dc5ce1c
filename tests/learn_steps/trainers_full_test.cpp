// Both trainers of policies on a linear-quadratic regulator and on a pendulum that must be swung
// up, and the time of the published networks.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <ctime>
#include <functional>
#include <numbers>
#include <span>
#include <vector>

#include "ricochet/base/random.hpp"
#include "ricochet/learn_steps/policies.hpp"
#include "ricochet/nn/mlp.hpp"

namespace ricochet::trainers_full_test {
namespace {

constexpr double discount = 0.9;

/// Several systems x⁺ = x + a / 2 under one common action, with all states observed and a reward
/// of minus the mean of x^2 + a^2 / 2. Episodes are cut after `length` steps; 0: never.
class Regulators {
public:
    Regulators(std::size_t n, int length) : x_(n), length_(length) {}

    [[nodiscard]] learn::Environment environment()
    {
        return {.observations = x_.size(),
                .actions = 1,
                .reset =
                    [this](std::uint64_t seed, std::span<double> observation) {
                        learn::Random random(seed);
                        for (double& x : x_) x = random.uniform(-1, 1);
                        steps_ = 0;
                        std::ranges::copy(x_, observation.begin());
                    },
                .step =
                    [this](std::span<const double> action, std::span<double> observation) {
                        const double reward = step(action[0]);
                        std::ranges::copy(x_, observation.begin());
                        return learn::Reaction{.reward = reward, .truncated = steps_ == length_};
                    }};
    }

    double step(double a)
    {
        double cost = a * a / 2;
        for (double& x : x_) {
            cost += x * x / static_cast<double>(x_.size());
            x += a / 2;
        }
        ++steps_;
        return -cost;
    }

    void start(double x)
    {
        std::ranges::fill(x_, x);
        steps_ = 0;
    }

    [[nodiscard]] double x() const { return x_.front(); }

private:
    std::vector<double> x_;
    int length_;
    int steps_ = 0;
};

/// Discounted cost of one regulator relative to the optimal law.
double relative_cost(const Model& policy)
{
    // P of the discounted algebraic Riccati equation with b = r = 1/2.
    constexpr double a2 = discount / 4;
    constexpr double a1 = 0.5 - discount / 4 - discount / 2;
    const double p = (-a1 + std::sqrt(a1 * a1 + 2 * a2)) / (2 * a2);
    const Mlp<float> network(policy);
    Regulators regulator(1, 0);
    double cost = 0;
    double optimum = 0;
    for (double start = -1; start <= 1; start += 0.25) {
        regulator.start(start);
        double weight = 1;
        for (int k = 0; k < 200; ++k, weight *= discount) {
            const auto in = static_cast<float>(regulator.x());
            float out = 0;
            network.forward(&in, &out);
            cost -= weight * regulator.step(std::tanh(static_cast<double>(out)));
        }
        optimum += p * start * start;
    }
    return cost / optimum;
}

using Train =
    std::function<learn::TrainedPolicy(const learn::Environment&, const learn::PolicyTraining&)>;

/// Of five seeds, ascending.
std::vector<double> costs(const Train& train)
{
    std::vector<double> out;
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
        Regulators regulator(1, 10);
        const learn::TrainedPolicy trained =
            train(regulator.environment(),
                  {.steps = 10'000, .batch = 128, .discount = discount, .seed = seed});
        out.push_back(relative_cost(trained.policy));
    }
    std::ranges::sort(out);
    return out;
}

/// Gymnasium's Pendulum-v1, reimplemented: angle th from upright and rate w,
///
///     reward -(th^2 + w^2 / 10 + u^2 / 1000),  w' = 15 sin(th) + 3 u,  |u| <= 2,  |w| <= 8,
///
/// 200 steps of 0.05 s, each of which updates the rate first; cos th, sin th and w are observed.
class Pendulum {
public:
    [[nodiscard]] learn::Environment environment()
    {
        return {.observations = 3,
                .actions = 1,
                .reset =
                    [this](std::uint64_t seed, std::span<double> observation) {
                        learn::Random random(seed);
                        angle_ = random.uniform(-std::numbers::pi, std::numbers::pi);
                        rate_ = random.uniform(-1, 1);
                        steps_ = 0;
                        observe(observation);
                    },
                .step =
                    [this](std::span<const double> action, std::span<double> observation) {
                        const double reward = step(2 * action[0]);
                        observe(observation);
                        return learn::Reaction{.reward = reward, .truncated = steps_ == 200};
                    }};
    }

private:
    double step(double u)
    {
        const double angle = std::remainder(angle_, 2 * std::numbers::pi);
        const double cost = angle * angle + rate_ * rate_ / 10 + u * u / 1000;
        rate_ = std::clamp(rate_ + 0.05 * (15 * std::sin(angle_) + 3 * u), -8.0, 8.0);
        angle_ += 0.05 * rate_;
        ++steps_;
        return -cost;
    }

    void observe(std::span<double> o) const
    {
        o[0] = std::cos(angle_);
        o[1] = std::sin(angle_);
        o[2] = rate_;
    }

    double angle_ = 0;
    double rate_ = 0;
    int steps_ = 0;
};

/// The mean of 100 episodes outside the training.
double mean_return(const Model& policy)
{
    const Mlp<float> network(policy);
    Pendulum pendulum;
    const learn::Environment environment = pendulum.environment();
    std::vector<double> observation(3);
    double sum = 0;
    for (std::uint64_t episode = 0; episode < 100; ++episode) {
        environment.reset(1000 + episode, observation);
        for (bool over = false; !over;) {
            const std::vector<float> in(observation.begin(), observation.end());
            float out = 0;
            network.forward(in.data(), &out);
            const double action = std::tanh(static_cast<double>(out));
            const learn::Reaction reaction = environment.step(std::span(&action, 1), observation);
            sum += reaction.reward;
            over = reaction.truncated;
        }
    }
    return sum / 100;
}

TEST(TrainersInFull, LearnTheOptimalRegulatorToATenth)
{
    for (const auto& found :
         {costs([](const learn::Environment&environment, const learn::PolicyTraining&training) {
              return learn::train_tqc(environment, {.training = training,
                                                    .actor = {32, 32},
                                                    .critic = {32, 32},
                                                    .critics = 2,
                                                    .rate = 1e-3});
          }),
          costs([](const learn::Environment&environment, const learn::PolicyTraining&training) {
              return learn::train_td3(
                  environment, {.training = training, .actor = {32, 32}, .critic = {32, 32}});
          })}) {
        EXPECT_GE(found.front(), 1 - 1e-6);  // nothing is better
        EXPECT_LE(found[2], 1.1);
    }
}

TEST(TrainersInFull, SwingUpAPendulum)
{
    Pendulum pendulum;
    const learn::Environment environment = pendulum.environment();
    const learn::PolicyTraining training{.steps = 8000};
    EXPECT_GE(
        mean_return(learn::train_tqc(environment, {.training = training, .rate = 1e-3}).policy),
        -200);
    EXPECT_GE(mean_return(learn::train_td3(environment, {.training = training}).policy), -200);
}

TEST(TrainersInFull, TwentyThousandStepsOfThePublishedNetworksTakeAMinuteAndAHalf)
{
    Regulators regulators(9, 50);
    const std::clock_t start = std::clock();
    const learn::TrainedPolicy trained =
        learn::train_tqc(regulators.environment(), {.training = {.steps = 20'000, .threads = 2}});
    EXPECT_EQ(trained.outcome, learn::PolicyOutcome::finished);
    // Processor time of both threads.
    EXPECT_LE(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC, 90);
}

}  // namespace
}  // namespace ricochet::trainers_full_test
