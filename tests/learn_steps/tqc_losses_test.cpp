#include "learn_steps/tqc_losses.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <vector>

#include "gradient_check.hpp"
#include "ricochet/nn/mlp.hpp"

namespace ricochet::learn::tqc_losses_test {
namespace {

/// Networks of random parameters, and a batch of nine transitions in parts of four.
class SmallTqc {
public:
    SmallTqc()
        : losses({.observations = 3,
                  .actions = 2,
                  .actor = {5, 4},
                  .critic = {6, 5},
                  .critics = 3,
                  .quantiles = 4,
                  .dropped = 1}),
          actor(losses.actor().size()),
          critics(losses.critics_size()),
          targets(losses.critics_size()),
          noise(losses.actor().noise())
    {
        Random random(11);
        losses.actor().initialise(actor.data(), random);
        for (std::size_t c = 0; c < losses.shape().critics; ++c) {
            losses.critic().initialise(critics.data() + c * losses.critic().size(), random);
            losses.critic().initialise(targets.data() + c * losses.critic().size(), random);
        }
        losses.actor().draw(noise, random);
        // Noise large enough for its part of the gradient to be visible.
        for (std::size_t j = 0; j < 4; ++j) {
            for (std::size_t a = 0; a < 2; ++a) {
                actor[losses.actor().deviation_offset() + j * padded<double>(2) + a] =
                    random.uniform(-1, 0.5);
            }
        }
        for (std::size_t i = 0; i < batch; ++i) {
            for (int k = 0; k < 10; ++k) {
                transitions.push_back(static_cast<float>(random.uniform(-1.5, 1.5)));
            }
            transitions.back() = i % 4 == 3 ? 1.0F : 0.0F;
        }
    }

    double critic_loss(std::vector<double>* gradient)
    {
        return over_parts(gradient, critics.size(), [&](auto& p, auto& work, double* out) {
            return losses.critic_part(p, work, true, out);
        });
    }

    double actor_loss(std::vector<double>* gradient)
    {
        return over_parts(gradient, actor.size(), [&](auto& p, auto& work, double* out) {
            return losses.actor_part(p, work, out).loss;
        });
    }

    using Losses = TqcLosses<double>;
    static constexpr std::size_t batch = 9;
    Losses losses;
    Buffer<double> actor, critics, targets;
    GaussianActor<double>::Noise noise;
    std::vector<float> transitions;

private:
    template <class Part>
    double over_parts(std::vector<double>* gradient, std::size_t n, const Part& part)
    {
        Buffer<double> transposed(losses.critics_transposed_size());
        for (std::size_t c = 0; c < losses.shape().critics; ++c) {
            losses.critic().transpose(critics.data() + c * losses.critic().size(),
                                      transposed.data() + c * losses.critic().transposed_size());
        }
        losses.actor().prepare(actor.data(), noise);
        const Losses::Parameters p{.actor = actor.data(),
                                   .critics = critics.data(),
                                   .critics_transposed = transposed.data(),
                                   .targets = targets.data(),
                                   .noise = &noise,
                                   .temperature = 0.3,
                                   .discount = 0.9,
                                   .batch = batch};
        Losses::Work work = losses.work(4);
        Buffer<double> share(n);
        std::vector<double> sum(n, 0.0);
        double loss = 0;
        for (std::size_t first = 0; first < batch; first += 4) {
            work.batch.rows = std::min<std::size_t>(4, batch - first);
            for (std::size_t i = 0; i < work.batch.rows; ++i) {
                work.batch.set(i, transitions.data() + 10 * (first + i));
            }
            loss += part(p, work, share.data());
            for (std::size_t i = 0; i < n; ++i) sum[i] += share[i];
        }
        if (gradient) *gradient = sum;
        return loss;
    }
};

TEST(TqcLosses, CriticGradientIsThatOfFiniteDifferences)
{
    SmallTqc tqc;
    std::vector<double> gradient;
    tqc.critic_loss(&gradient);
    expect_gradient(gradient, tqc.critics, [&] { return tqc.critic_loss(nullptr); });
}

TEST(TqcLosses, ActorGradientIsThatOfFiniteDifferences)
{
    // Through clamp, noise, tanh and its density, and through the critics.
    SmallTqc tqc;
    std::vector<double> gradient;
    tqc.actor_loss(&gradient);
    expect_gradient(gradient, tqc.actor, [&] { return tqc.actor_loss(nullptr); });
}

TEST(TqcLosses, ActorGradientStopsWhereItsMeanIsClamped)
{
    SmallTqc tqc;
    const std::size_t bias = tqc.losses.actor().trunk().size() + 4 * padded<double>(2);
    tqc.actor[bias] = 10;
    std::vector<double> gradient;
    tqc.actor_loss(&gradient);
    EXPECT_EQ(gradient[bias], 0);
    EXPECT_NE(gradient[bias + 1], 0);
    expect_gradient(gradient, tqc.actor, [&] { return tqc.actor_loss(nullptr); });
}

TEST(TqcLosses, LayersOfTheActorGiveItsClampedMean)
{
    SmallTqc tqc;
    const std::size_t bias = tqc.losses.actor().trunk().size() + 4 * padded<double>(2);
    tqc.actor[bias] = 1.9;  // near the bound, so that some are beyond it
    tqc.losses.actor().prepare(tqc.actor.data(), tqc.noise);
    auto work = tqc.losses.actor().work(1);
    Model model;
    model.layers = tqc.losses.actor().layers(tqc.actor.data());
    const Mlp<double> policy(model);
    Buffer<double> state(padded<double>(3));
    Random random(4);
    for (int k = 0; k < 20; ++k) {
        for (std::size_t i = 0; i < 3; ++i) state[i] = random.uniform(-2, 2);
        tqc.losses.actor().forward(tqc.actor.data(), tqc.noise, {state.data(), state.size()}, 1,
                                   work);
        std::vector<double> found(2);
        policy.forward(state.data(), found.data());
        // Sums of some ten terms of order one.
        for (std::size_t a = 0; a < 2; ++a) {
            EXPECT_NEAR(found[a], std::clamp(work.mean.values.back()[a], -2.0, 2.0), 1e-14);
        }
    }
}

TEST(TqcLosses, QuantileHuberLossIsThatComputedByHand)
{
    // Two quantiles, at levels 1/4 and 3/4, worth 0 and 1, and the targets 3 and 0.5.
    //   d:          3 - 0 = 3, 3 - 1 = 2, 0.5 - 0 = 0.5, 0.5 - 1 = -0.5
    //   huber:      2.5,       1.5,       0.125,         0.125
    //   weight:     1/4,       3/4,       1/4,           1 - 3/4
    //   their sum   0.625 + 1.125 + 0.03125 + 0.03125 = 1.8125
    //   slopes      -(1/4 + 1/4 0.5) = -0.375,  -(3/4 - 1/4 0.5) = -0.625
    Buffer<double> quantiles(8), above(8), below(8), slopes(8);
    quantiles[1] = 1;
    above[0] = 0.25, above[1] = 0.75;
    below[0] = 0.75, below[1] = 0.25;
    const std::vector<double> targets{3, 0.5};
    const QuantileHuber<double> problem{.quantiles = quantiles.data(),
                                        .targets = targets.data(),
                                        .above = above.data(),
                                        .below = below.data(),
                                        .slopes = slopes.data(),
                                        .n = 8,
                                        .m = 2,
                                        .scale = 0.25};
    // All numbers are multiples of powers of two: exact.
    EXPECT_EQ(dense_kernels<double>().quantile_loss(problem), 1.8125 / 4);
    dense_kernels<double>().quantile_slopes(problem);
    EXPECT_EQ(slopes[0], -0.375 / 4);
    EXPECT_EQ(slopes[1], -0.625 / 4);
    EXPECT_EQ(slopes[2], 0);
}

TEST(TqcLosses, DropsTheTopQuantilesOfAllCriticsTogether)
{
    // One hidden unit that is always off, so that the quantiles are the biases of the last layer:
    // 1 2 and 7 8. Of these four, two are dropped: both of the second critic. With no
    // temperature and a current critic at zero, above 1: loss of d is d - 1/2.
    TqcLosses<double> losses({.observations = 1,
                              .actions = 1,
                              .actor = {1},
                              .critic = {1},
                              .critics = 2,
                              .quantiles = 2,
                              .dropped = 1});
    const std::size_t size = losses.critic().size();
    Buffer<double> actor(losses.actor().size()), critics(2 * size), targets(2 * size);
    Buffer<double> transposed(losses.critics_transposed_size()), gradient(2 * size);
    const std::size_t bias = size - padded<double>(2);
    targets[bias] = 2, targets[bias + 1] = 1;
    targets[size + bias] = 7, targets[size + bias + 1] = 8;
    auto noise = losses.actor().noise();
    losses.actor().prepare(actor.data(), noise);
    auto work = losses.work(1);
    work.batch.rows = 1;
    const std::vector<float> transition{0, 0, 0, 0.5F, 0};  // reward 1/2
    work.batch.set(0, transition.data());
    const double loss = losses.critic_part({.actor = actor.data(),
                                            .critics = critics.data(),
                                            .critics_transposed = transposed.data(),
                                            .targets = targets.data(),
                                            .noise = &noise,
                                            .temperature = 0,
                                            .discount = 1,
                                            .batch = 1},
                                           work, true, gradient.data());
    // Targets 1.5 and 2.5, losses 1 and 2; weights 1/4 and 3/4, two critics, a mean of 8.
    EXPECT_DOUBLE_EQ(loss, 2 * (0.25 + 0.75) * (1 + 2) / 8);
}

template <class T>
void expect_same_products(InstructionSet set, double tolerance)
{
    // 13 x 21 times 21 x 16, and its outer product: odd sizes, with whole blocks and remainders.
    if (!supported(set)) GTEST_SKIP() << "not on this processor";
    Random random(5);
    const auto fill = [&](std::size_t n) {
        Buffer<T> out(n);
        for (T& value : out) value = static_cast<T>(random.uniform(-1, 1));
        return out;
    };
    const Buffer<T> a = fill(13 * 32), b = fill(21 * 16), mask = fill(13 * 16), bias = fill(16);
    Buffer<T> c(13 * 16), outer(21 * 16), sums(16);
    const auto& kernels = dense_kernels<T>(set);
    kernels.product({.a = a.data(),
                     .a_stride = 32,
                     .b = b.data(),
                     .b_stride = 16,
                     .c = c.data(),
                     .c_stride = 16,
                     .rows = 13,
                     .inner = 21,
                     .columns = 16,
                     .bias = bias.data(),
                     .mask = mask.data()},
                    After::mask);
    kernels.outer_product({.a = a.data(),
                           .a_stride = 32,
                           .b = mask.data(),
                           .b_stride = 16,
                           .c = outer.data(),
                           .c_stride = 16,
                           .rows = 13,
                           .left = 21,
                           .columns = 16,
                           .sums = sums.data()});
    for (std::size_t j = 0; j < 16; ++j) {
        for (std::size_t i = 0; i < 13; ++i) {
            double sum = static_cast<double>(bias[j]);
            for (std::size_t k = 0; k < 21; ++k) {
                sum += static_cast<double>(a[i * 32 + k]) * static_cast<double>(b[k * 16 + j]);
            }
            const bool on = mask[i * 16 + j] > 0;
            EXPECT_NEAR(static_cast<double>(c[i * 16 + j]), on ? sum : 0.0, tolerance);
        }
        double column = 0;
        for (std::size_t i = 0; i < 13; ++i) column += static_cast<double>(mask[i * 16 + j]);
        EXPECT_NEAR(static_cast<double>(sums[j]), column, tolerance);
        for (std::size_t k = 0; k < 21; ++k) {
            double sum = 0;
            for (std::size_t i = 0; i < 13; ++i) {
                sum += static_cast<double>(a[i * 32 + k]) * static_cast<double>(mask[i * 16 + j]);
            }
            EXPECT_NEAR(static_cast<double>(outer[k * 16 + j]), sum, tolerance);
        }
    }
}

// Sums of 22 terms below one: at most 22^2 / 2 roundings of half an ulp of one.
class DenseKernelsOf : public testing::TestWithParam<InstructionSet> {};

TEST_P(DenseKernelsOf, MultiplyAsTheFormulaDoesInFloat)
{
    expect_same_products<float>(GetParam(), 242 * 0x1p-24);
}

TEST_P(DenseKernelsOf, MultiplyAsTheFormulaDoesInDouble)
{
    expect_same_products<double>(GetParam(), 242 * 0x1p-52);
}

INSTANTIATE_TEST_SUITE_P(Sets, DenseKernelsOf,
                         testing::Values(InstructionSet::baseline, InstructionSet::x86_64_v3,
                                         InstructionSet::x86_64_v4));

}  // namespace
}  // namespace ricochet::learn::tqc_losses_test
