#include "ricochet/nn/mlp.hpp"

#include "nn_models.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace ricochet::mlp_test {
namespace {

using Widths = std::vector<std::size_t>;

/// The common shapes, no hidden layer, and widths on both sides of every block,
/// register and chain boundary.
const std::vector<Widths> shapes{
    {4, 8, 1},       {1, 16, 16, 1}, {2, 16, 1},       {2, 16, 16, 16, 16, 16, 1},
    {9, 64, 64, 1},  {1, 1},         {5, 1},           {3, 2},
    {256, 256, 256}, {255, 255, 1},  {1, 1, 1},        {2, 3, 5, 1},
    {3, 7, 9, 4},    {4, 8, 8},      {5, 15, 17, 8},   {6, 24, 12, 3},
    {7, 31, 33, 9},  {8, 40, 48, 1}, {17, 65, 100, 1}, {2, 4, 4, 4, 4, 4, 4, 4, 4, 2},
};

const std::vector<InstructionSet> all_sets{InstructionSet::baseline, InstructionSet::x86_64_v3,
                                           InstructionSet::x86_64_v4};

template <class T>
std::vector<T> random_inputs(std::size_t count, std::uint64_t seed)
{
    std::mt19937_64 bits(seed);
    std::vector<T> values(count);
    for (T& value : values) {
        value = static_cast<T>(static_cast<double>(bits() >> 11) * 0x1p-51 - 2);  // [-2, 2)
    }
    return values;
}

template <class T>
std::vector<T> forward(const Mlp<T>& mlp, const std::vector<T>& in)
{
    std::vector<T> out(mlp.outputs());
    mlp.forward(in.data(), out.data());
    return out;
}

template <class T>
bool same_bits(const std::vector<T>& a, const std::vector<T>& b)
{
    return a.size() == b.size() &&
           (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

/// The message of a constructor that refuses, or nothing.
std::optional<std::string> refusal(const Model& model)
{
    try {
        const Mlp<float> mlp(model);
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return std::nullopt;
}

template <class T>
class MlpTest : public testing::Test {
};

using Types = testing::Types<float, double>;
TYPED_TEST_SUITE(MlpTest, Types);

TYPED_TEST(MlpTest, AgreesWithTheFormulaWithinTheBoundOfRounding)
{
    for (const Activation activation : {Activation::relu, Activation::tanh}) {
        for (const Widths& widths : shapes) {
            const Model model = random_model(widths, activation, 1);
            const Mlp<TypeParam> mlp(model);
            for (std::uint64_t seed = 0; seed < 8; ++seed) {
                const auto in = random_inputs<TypeParam>(widths.front(), seed);
                const auto out = forward(mlp, in);
                const Reference expected =
                    evaluate_by_formula(model, {in.begin(), in.end()}, unit_roundoff<TypeParam>);
                for (std::size_t j = 0; j < out.size(); ++j) {
                    EXPECT_LE(std::abs(out[j] - expected.value[j]), expected.bound[j]);
                }
            }
        }
    }
}

TYPED_TEST(MlpTest, EveryInstructionSetAndInstanceReturnsTheSameBits)
{
    for (const Activation activation : {Activation::relu, Activation::tanh}) {
        for (const Widths& widths : shapes) {
            const Model model = random_model(widths, activation, 2);
            const Mlp<TypeParam> plain(model, {InstructionSet::baseline, false});
            for (const InstructionSet set : all_sets) {
                if (!supported(set)) {
                    std::printf("not supported here: %s\n", std::string(name(set)).c_str());
                    continue;
                }
                for (const bool common_shapes : {false, true}) {
                    const Mlp<TypeParam> mlp(model, {set, common_shapes});
                    for (std::uint64_t seed = 0; seed < 64; ++seed) {
                        const auto in = random_inputs<TypeParam>(widths.front(), seed);
                        EXPECT_TRUE(same_bits(forward(mlp, in), forward(plain, in)))
                            << name(set) << ", " << widths.size() << " widths";
                    }
                }
            }
        }
    }
}

TYPED_TEST(MlpTest, EverySetOfInputsOfACommonShapeReturnsTheSameBits)
{
    // The instances for common shapes take any number of inputs.
    for (std::size_t inputs = 1; inputs <= 20; ++inputs) {
        const Model model = random_model({inputs, 16, 16, 1}, Activation::relu, 3);
        const auto in = random_inputs<TypeParam>(inputs, inputs);
        const auto expected = forward(Mlp<TypeParam>(model, {.common_shapes = false}), in);
        EXPECT_TRUE(same_bits(forward(Mlp<TypeParam>(model), in), expected)) << inputs;
    }
}

TYPED_TEST(MlpTest, ABatchReturnsTheBitsOfItsSamplesOneByOne)
{
    for (const Widths& widths : shapes) {
        const Mlp<TypeParam> mlp(random_model(widths, Activation::relu, 4));
        for (const std::size_t samples : Widths{0, 1, 2, 7, 64}) {
            const auto in = random_inputs<TypeParam>(samples * mlp.inputs(), samples);
            std::vector<TypeParam> batch(samples * mlp.outputs());
            mlp.forward_batch(in.data(), samples, batch.data());
            std::vector<TypeParam> single(batch.size());
            for (std::size_t i = 0; i < samples; ++i) {
                mlp.forward(in.data() + i * mlp.inputs(), single.data() + i * mlp.outputs());
            }
            EXPECT_TRUE(same_bits(batch, single));
        }
    }
}

TYPED_TEST(MlpTest, ANanInOneInputMakesEveryOutputNan)
{
    // Every weight is nonzero, and max(0, x) and tanh keep a NaN.
    for (const Activation activation : {Activation::relu, Activation::tanh}) {
        for (const Widths& widths : shapes) {
            const Model model = random_model(widths, activation, 5);
            for (const InstructionSet set : all_sets) {
                if (!supported(set)) continue;
                auto in = random_inputs<TypeParam>(widths.front(), 5);
                in.back() = std::numeric_limits<TypeParam>::quiet_NaN();
                for (const TypeParam y : forward(Mlp<TypeParam>(model, {set}), in)) {
                    EXPECT_TRUE(std::isnan(y)) << name(set);
                }
            }
        }
    }
}

TYPED_TEST(MlpTest, InfiniteActivationsDoNotMeetThePadding)
{
    // Each of 5 hidden values is infinite and has a positive weight, so the output
    // is infinite; 0 * infinity in one lane beyond them would make it NaN.
    Model model = random_model({1, 5, 5, 1}, Activation::relu, 6);
    for (DenseLayer& layer : model.layers) {
        for (double& w : layer.weight) w = 1;
    }
    const std::vector<TypeParam> in{std::numeric_limits<TypeParam>::infinity()};
    for (const InstructionSet set : all_sets) {
        if (!supported(set)) continue;
        EXPECT_EQ(forward(Mlp<TypeParam>(model, {set}), in)[0], in[0]) << name(set);
    }
}

/// x -> tanh(x): one hidden value, weights 1, biases 0.
Model bare_tanh()
{
    Model model = random_model({1, 1, 1}, Activation::tanh, 7);
    for (DenseLayer& layer : model.layers) {
        layer.weight = {1};
        layer.bias = {0};
    }
    return model;
}

TYPED_TEST(MlpTest, TanhIsWithinFiveUlp)
{
    // An ulp of the result is 2 u times its power of two. The arguments are evenly
    // spread over the representable numbers from 2^-30 to 32, so that exponents count
    // as much as mantissas.
    const Mlp<TypeParam> mlp(bare_tanh());
    using Bits = std::conditional_t<sizeof(TypeParam) == 4, std::uint32_t, std::uint64_t>;
    const auto first = std::bit_cast<Bits>(static_cast<TypeParam>(0x1p-30));
    const auto last = std::bit_cast<Bits>(static_cast<TypeParam>(32));
    const Bits stride = (last - first) / 200000;
    long double worst = 0;
    for (Bits bits = first; bits < last; bits += stride) {
        const auto x = std::bit_cast<TypeParam>(bits);
        TypeParam y = 0;
        mlp.forward(&x, &y);
        const long double exact = std::tanh(static_cast<long double>(x));
        const long double ulp = std::ldexp(2 * unit_roundoff<TypeParam>, std::ilogb(exact));
        worst = std::max(worst, std::abs(y - exact) / ulp);
    }
    this->RecordProperty("worst_ulp", std::to_string(static_cast<double>(worst)));
    EXPECT_LE(worst, 5);
}

TYPED_TEST(MlpTest, TanhIsOddAndSaturates)
{
    const Mlp<TypeParam> mlp(bare_tanh());
    const auto at = [&](TypeParam x) { return forward(mlp, {x})[0]; };
    for (const TypeParam x : random_inputs<TypeParam>(1000, 8)) {
        EXPECT_EQ(at(4 * x), -at(-4 * x));
    }
    EXPECT_EQ(at(0), 0);
    // 1 - tanh(20) = 8.5e-18 is less than half an ulp below 1, in float and double.
    for (const TypeParam x : {TypeParam(20.5), std::numeric_limits<TypeParam>::max(),
                              std::numeric_limits<TypeParam>::infinity()}) {
        EXPECT_EQ(at(x), 1);
        EXPECT_EQ(at(-x), -1);
    }
    EXPECT_TRUE(std::isnan(at(std::numeric_limits<TypeParam>::quiet_NaN())));
}

TYPED_TEST(MlpTest, FourThreadsShareOneNetwork)
{
    const Mlp<TypeParam> mlp(random_model({4, 16, 16, 1}, Activation::tanh, 9));
    const auto in = random_inputs<TypeParam>(4 * 1000, 9);
    std::vector<TypeParam> expected(1000);
    mlp.forward_batch(in.data(), 1000, expected.data());

    std::vector<std::vector<TypeParam>> found(4, std::vector<TypeParam>(1000));
    std::vector<std::thread> threads;
    for (auto& out : found) {
        threads.emplace_back([&] {
            for (std::size_t i = 0; i < 1000; ++i) mlp.forward(&in[4 * i], &out[i]);
        });
    }
    for (std::thread& thread : threads) thread.join();
    for (const auto& out : found) EXPECT_TRUE(same_bits(out, expected));
}

TYPED_TEST(MlpTest, ACopyOutlivesTheOriginal)
{
    const auto in = random_inputs<TypeParam>(4, 10);
    std::optional<Mlp<TypeParam>> original(random_model({4, 8, 1}, Activation::relu, 10));
    const auto expected = forward(*original, in);
    const Mlp<TypeParam> copy = *original;
    original.reset();
    EXPECT_TRUE(same_bits(forward(copy, in), expected));
}

TYPED_TEST(MlpTest, AnInputMayBeOverwrittenByTheOutput)
{
    const Mlp<TypeParam> mlp(random_model({4, 16, 4}, Activation::relu, 11));
    auto values = random_inputs<TypeParam>(4, 11);
    const auto expected = forward(mlp, values);
    mlp.forward(values.data(), values.data());
    EXPECT_TRUE(same_bits(values, expected));
}

TEST(Mlp, RefusesAModelWithoutLayers)
{
    EXPECT_EQ(refusal(Model{}), "Mlp: expected 1 to 64 layers, found 0");
}

TEST(Mlp, RefusesMoreThan64Layers)
{
    EXPECT_EQ(refusal(random_model(Widths(66, 1), Activation::relu, 0)),
              "Mlp: expected 1 to 64 layers, found 65");
}

TEST(Mlp, RefusesALayerWiderThan256)
{
    EXPECT_EQ(refusal(random_model({1, 257, 1}, Activation::relu, 0)),
              "Mlp: layer 0: expected a width from 1 to 256, found 257");
}

TEST(Mlp, RefusesALayerWithoutOutputs)
{
    EXPECT_EQ(refusal(random_model({1, 0}, Activation::relu, 0)),
              "Mlp: layer 0: expected a width from 1 to 256, found 0");
}

TEST(Mlp, RefusesLayersThatDoNotFitTogether)
{
    Model model = random_model({2, 3, 1}, Activation::relu, 0);
    model.layers[1] = random_model({4, 1}, Activation::relu, 0).layers[0];
    EXPECT_EQ(refusal(model),
              "Mlp: layer 1: expected 3 inputs, as many as the layer before has outputs, found 4");
}

TEST(Mlp, RefusesTooFewWeights)
{
    Model model = random_model({2, 3, 1}, Activation::relu, 0);
    model.layers[0].weight.pop_back();
    EXPECT_EQ(refusal(model), "Mlp: layer 0: expected 3 x 2 weights, found 5");
}

TEST(Mlp, RefusesTooManyBiases)
{
    Model model = random_model({2, 3, 1}, Activation::relu, 0);
    model.layers[0].bias.push_back(0);
    EXPECT_EQ(refusal(model), "Mlp: layer 0: expected 3 biases, found 4");
}

TEST(InstructionSet, TheBaselineIsAlwaysSupportedAndTheBestIsSupported)
{
    EXPECT_TRUE(supported(InstructionSet::baseline));
    EXPECT_TRUE(supported(best_instruction_set()));
    std::printf("best here: %s\n", std::string(name(best_instruction_set())).c_str());
}

TEST(InstructionSet, AnUnsupportedOneIsRefused)
{
    for (const InstructionSet set : all_sets) {
        if (supported(set)) continue;
        EXPECT_THROW(Mlp<float>(random_model({1, 1}, Activation::relu, 0), {set}),
                     std::invalid_argument);
    }
}

}  // namespace
}  // namespace ricochet::mlp_test
