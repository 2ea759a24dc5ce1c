#include "measure_trainers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <ctime>
#include <functional>
#include <numbers>
#include <span>
#include <string>
#include <vector>

#include "ricochet/detail/random.hpp"
#include "ricochet/learn/policies.hpp"
#include "ricochet/nn/mlp.hpp"

namespace ricochet::bench {

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
    Regulators world(1, 0);
    double cost = 0;
    double optimum = 0;
    for (double start = -1; start <= 1; start += 0.25) {
        world.start(start);
        double weight = 1;
        for (int k = 0; k < 200; ++k, weight *= discount) {
            const auto in = static_cast<float>(world.x());
            float out = 0;
            network.forward(&in, &out);
            cost -= weight * world.step(std::tanh(static_cast<double>(out)));
        }
        optimum += p * start * start;
    }
    return cost / optimum;
}

using Train =
    std::function<learn::TrainedPolicy(const learn::Environment&, const learn::PolicyTraining&)>;

/// The median of five seeds, with its line of output.
double median_cost(const std::string& name, const Train& train, Measured& out)
{
    std::vector<double> costs;
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
        Regulators world(1, 10);
        const learn::TrainedPolicy trained =
            train(world.environment(),
                  {.steps = 10'000, .batch = 128, .discount = discount, .seed = seed});
        costs.push_back(relative_cost(trained.policy));
    }
    std::ranges::sort(costs);
    out.details.push_back(fmt::format("{}: {:.4f} to {:.4f}, median {:.4f}", name, costs.front(),
                                      costs.back(), costs[2]));
    return costs[2];
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
double mean_return(const std::function<double(const std::vector<double>&)>& act)
{
    Pendulum pendulum;
    const learn::Environment world = pendulum.environment();
    std::vector<double> observation(3);
    double sum = 0;
    for (std::uint64_t episode = 0; episode < 100; ++episode) {
        world.reset(1000 + episode, observation);
        for (bool over = false; !over;) {
            const double action = act(observation);
            const learn::Reaction reaction = world.step(std::span(&action, 1), observation);
            sum += reaction.reward;
            over = reaction.truncated;
        }
    }
    return sum / 100;
}

double mean_return(const Model& policy)
{
    const Mlp<float> network(policy);
    return mean_return([&network](const std::vector<double>& observation) {
        const std::vector<float> in(observation.begin(), observation.end());
        float out = 0;
        network.forward(in.data(), &out);
        return std::tanh(static_cast<double>(out));
    });
}

}  // namespace

Measured time_of_tqc()
{
    Regulators world(9, 50);
    const std::clock_t start = std::clock();
    const learn::TrainedPolicy trained =
        learn::train_tqc(world.environment(), {.training = {.steps = 20'000, .threads = 2}});
    const double processor = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    const bool done = trained.outcome == learn::PolicyOutcome::finished;
    // The time of both threads together: it exceeds that of two cores that are otherwise idle.
    return {
        .pass = done && processor <= 90,
        .text = fmt::format("{:.1f} s of processor time of two threads, {:.1f} s on the clock ({})",
                            processor, trained.seconds, name(best_instruction_set()))};
}

Measured cost_over_optimum()
{
    Measured out;
    const double tqc = median_cost(
        "TQC",
        [](const learn::Environment& environment, const learn::PolicyTraining& training) {
            return learn::train_tqc(environment, {.training = training,
                                                  .actor = {32, 32},
                                                  .critic = {32, 32},
                                                  .critics = 2,
                                                  .rate = 1e-3});
        },
        out);
    const double td3 = median_cost(
        "TD3",
        [](const learn::Environment& environment, const learn::PolicyTraining& training) {
            return learn::train_td3(environment,
                                    {.training = training, .actor = {32, 32}, .critic = {32, 32}});
        },
        out);
    out.pass = std::max(tqc, td3) <= 1.1 && std::min(tqc, td3) >= 1 - 1e-6;
    out.text = fmt::format("TQC {:.4f}, TD3 {:.4f}", tqc, td3);
    return out;
}

Measured swing_up()
{
    Pendulum pendulum;
    const learn::Environment world = pendulum.environment();
    const learn::PolicyTraining training{.steps = 8000};
    const double idle = mean_return([](const std::vector<double>&) { return 0.0; });
    const double tqc =
        mean_return(learn::train_tqc(world, {.training = training, .rate = 1e-3}).policy);
    const double td3 = mean_return(learn::train_td3(world, {.training = training}).policy);
    return {.pass = std::min(tqc, td3) >= -200,
            .text = fmt::format("TQC {:.1f}, TD3 {:.1f}; without acting {:.1f}", tqc, td3, idle)};
}

}  // namespace ricochet::bench
