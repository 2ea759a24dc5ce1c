#include "measure_trainers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <ctime>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "ricochet/learn/random.hpp"
#include "ricochet/learn/td3.hpp"
#include "ricochet/learn/tqc.hpp"
#include "ricochet/nn/mlp.hpp"

namespace ricochet::bench {

namespace {

constexpr double discount = 0.9;

/// Several x⁺ = x + a / 2 with one action, all of them seen, and
/// a reward of minus the mean of x^2 + a^2 / 2. Cut after `length` steps, 0 for never.
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

/// Of one regulator, discounted, over that of the optimal law.
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

/// The median of five seeds, and its line.
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

}  // namespace

Measured time_of_tqc()
{
    Regulators world(9, 50);
    const std::clock_t start = std::clock();
    const learn::TrainedPolicy trained =
        learn::train_tqc(world.environment(), {.training = {.steps = 20'000, .threads = 2}});
    const double processor = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    const bool done = trained.outcome == learn::PolicyOutcome::finished;
    // Of both threads together: more than two cores take that have nothing else to do.
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

}  // namespace ricochet::bench
