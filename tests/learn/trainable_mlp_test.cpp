#include "learn/trainable_mlp.hpp"

#include <cmath>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "ricochet/nn/mlp.hpp"

namespace ricochet::learn::trainable_mlp_test {
namespace {

struct Batch {
    std::vector<double> states;
    std::vector<std::uint8_t> labels;
};

Batch random_batch(std::size_t n, std::size_t width, Random& random)
{
    Batch batch;
    for (std::size_t i = 0; i < n * width; ++i) batch.states.push_back(random.uniform(-2, 2));
    for (std::size_t i = 0; i < n; ++i) batch.labels.push_back(random.chance(0.5) ? 1 : 0);
    return batch;
}

class Gradient : public testing::TestWithParam<const char*> {
protected:
    static Activation activation()
    {
        return std::string_view(GetParam()) == "relu" ? Activation::relu : Activation::tanh;
    }
};

TEST_P(Gradient, EqualsTheFourthOrderDifferenceOfTheLoss)
{
    // Central differences with e = 1e-3 have an error of order e^4 = 1e-12 and
    // rounding of 1e-16 / e = 1e-13, relative to a loss of order one. A kink of a
    // ReLU within 2 e of a state would spoil the difference; this seed has none.
    Random random(3);
    const std::vector<std::size_t> hidden{7, 5, 6};
    TrainableMlp network(3, hidden, activation(), random);
    for (double& p : network.parameters()) p += random.uniform(-0.1, 0.1);  // biases too
    const Batch batch = random_batch(13, 3, random);  // not a multiple of the block
    const std::size_t n = network.parameters().size();
    std::vector<double> gradient(n);
    std::vector<double> ignored(n);
    network.loss_and_gradient(batch.states, batch.labels, gradient);

    double norm = 0;
    for (const double g : gradient) norm = std::max(norm, std::abs(g));
    const double e = 1e-3;
    for (std::size_t i = 0; i < n; ++i) {
        const auto loss = [&](double offset) {
            const double before = network.parameters()[i];
            network.parameters()[i] = before + offset;
            const double value = network.loss_and_gradient(batch.states, batch.labels, ignored);
            network.parameters()[i] = before;
            return value;
        };
        const double difference =
            (8 * (loss(e) - loss(-e)) - (loss(2 * e) - loss(-2 * e))) / (12 * e);
        EXPECT_NEAR(gradient[i], difference, 1e-6 * std::max(std::abs(gradient[i]), 1e-3 * norm))
            << "parameter " << i;
    }
}

INSTANTIATE_TEST_SUITE_P(Activations, Gradient, testing::Values("relu", "tanh"),
                         [](const auto& instance) { return std::string(instance.param); });

TEST(TrainableMlp, LossIsTheMeanCrossEntropyOfItsLogits)
{
    Random random(5);
    TrainableMlp network(2, std::vector<std::size_t>{4}, Activation::tanh, random);
    const Batch batch = random_batch(21, 2, random);
    std::vector<double> logits(21);
    network.evaluate(batch.states, logits);
    double expected = 0;
    for (std::size_t i = 0; i < 21; ++i) {
        const double p = 1 / (1 + std::exp(-logits[i]));
        expected -= std::log(batch.labels[i] != 0 ? p : 1 - p) / 21;
    }
    std::vector<double> gradient(network.parameters().size());
    EXPECT_NEAR(network.loss_and_gradient(batch.states, batch.labels, gradient), expected, 1e-14);
}

TEST(TrainableMlp, CrossEntropyDoesNotOverflow)
{
    EXPECT_EQ(cross_entropy(1e4, true), 0);
    EXPECT_EQ(cross_entropy(1e4, false), 1e4);
    EXPECT_EQ(cross_entropy(-1e4, true), 1e4);
    EXPECT_NEAR(cross_entropy(0, true), std::log(2), 1e-16);
}

TEST(TrainableMlp, LayersMakeAModelWithTheSameLogits)
{
    Random random(9);
    const std::vector<std::size_t> hidden{6, 5};
    TrainableMlp network(3, hidden, Activation::relu, random);
    const Batch batch = random_batch(300, 3, random);  // more than one piece
    std::vector<double> logits(300);
    network.evaluate(batch.states, logits);

    Model model;
    model.offset = {0, 0, 0};
    model.scale = {1, 1, 1};
    model.precision = Precision::f64;
    model.layers = network.layers();
    const Classifier classifier(model);
    for (std::size_t i = 0; i < 300; ++i) {
        // Sums of at most six products of order one, in another order.
        EXPECT_NEAR(classifier.logit(batch.states.data() + 3 * i), logits[i], 1e-13);
    }
}

TEST(TrainableMlp, RefusesALayerOfNoWidth)
{
    Random random(1);
    EXPECT_THROW(TrainableMlp(2, std::vector<std::size_t>{4, 0}, Activation::relu, random),
                 std::invalid_argument);
    EXPECT_THROW(TrainableMlp(0, std::vector<std::size_t>{4}, Activation::relu, random),
                 std::invalid_argument);
}

TEST(Random, RepeatsItsStreamFromAStoredState)
{
    Random first(42);
    for (int i = 0; i < 100; ++i) first.bits();
    Random second(first.state());
    for (int i = 0; i < 100; ++i) EXPECT_EQ(first.bits(), second.bits());
}

TEST(Random, IsUniform)
{
    // Mean 1/2 and variance 1/12; the mean of n = 1e5 deviates by 1 / sqrt(12 n) =
    // 0.0009, so 0.005 is more than five deviations.
    Random random(42);
    double sum = 0;
    for (int i = 0; i < 100'000; ++i) {
        const double value = random.uniform();
        ASSERT_GE(value, 0);
        ASSERT_LT(value, 1);
        sum += value;
    }
    EXPECT_NEAR(sum / 100'000, 0.5, 0.005);
}

}  // namespace
}  // namespace ricochet::learn::trainable_mlp_test
