// Built with -O3 -march=native where the compiler supports it, as users build header-only
// code, and linked with a library built for the baseline.
#include "ricochet/nn/mlp.hpp"

#include "nn_models.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

namespace ricochet::static_mlp_test {
namespace {

template <Activation activation, class T, std::size_t... Widths>
void expect_bits_of_mlp()
{
    const Model model = random_model({Widths...}, activation, 1);
    const BasicStaticMlp<activation, T, Widths...> fixed(model);
    const Mlp<T> mlp(model, {InstructionSet::baseline, false});
    std::mt19937_64 bits(1);
    std::vector<T> in(64 * fixed.inputs());
    for (T& x : in) x = static_cast<T>(static_cast<double>(bits() >> 11) * 0x1p-51 - 2);

    std::vector<T> expected(64 * fixed.outputs());
    mlp.forward_batch(in.data(), 64, expected.data());
    std::vector<T> batch(expected.size());
    fixed.forward_batch(in.data(), 64, batch.data());
    std::vector<T> single(expected.size());
    for (std::size_t i = 0; i < 64; ++i) {
        fixed.forward(&in[i * fixed.inputs()], &single[i * fixed.outputs()]);
    }
    const std::size_t bytes = expected.size() * sizeof(T);
    EXPECT_EQ(std::memcmp(batch.data(), expected.data(), bytes), 0);
    EXPECT_EQ(std::memcmp(single.data(), expected.data(), bytes), 0);
}

template <Activation activation, class T>
void expect_bits_of_mlp_in_all_shapes()
{
    expect_bits_of_mlp<activation, T, 4, 8, 1>();
    expect_bits_of_mlp<activation, T, 4, 16, 16, 1>();
    expect_bits_of_mlp<activation, T, 4, 16, 16, 16, 16, 16, 1>();
    expect_bits_of_mlp<activation, T, 4, 64, 64, 1>();
    expect_bits_of_mlp<activation, T, 1, 1>();
    expect_bits_of_mlp<activation, T, 5, 1>();
    expect_bits_of_mlp<activation, T, 3, 2>();
    expect_bits_of_mlp<activation, T, 3, 7, 9, 4>();
    expect_bits_of_mlp<activation, T, 7, 31, 33, 9>();
    expect_bits_of_mlp<activation, T, 16, 16, 16, 8>();
}

TEST(StaticMlp, ReturnsTheBitsOfTheCompiledKernelsWithRelu)
{
    expect_bits_of_mlp_in_all_shapes<Activation::relu, float>();
    expect_bits_of_mlp_in_all_shapes<Activation::relu, double>();
}

TEST(StaticMlp, ReturnsTheBitsOfTheCompiledKernelsWithTanh)
{
    expect_bits_of_mlp_in_all_shapes<Activation::tanh, float>();
    expect_bits_of_mlp_in_all_shapes<Activation::tanh, double>();
}

template <class Network>
std::string refusal(const Model& model)
{
    try {
        const Network network(model);
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return "";
}

TEST(StaticMlp, RefusesAModelOfAnotherShape)
{
    const Model model = random_model({4, 8, 1}, Activation::relu, 0);
    EXPECT_EQ((refusal<StaticMlp<float, 4, 16, 1>>(model)),
              "StaticMlp: expected layer 0 of shape 16 x 4, found 8 x 4");
    EXPECT_EQ((refusal<StaticMlp<float, 4, 8, 8, 1>>(model)),
              "StaticMlp: expected 3 layers, found 2");
}

TEST(StaticMlp, RefusesAModelOfAnotherActivation)
{
    const Model model = random_model({4, 8, 1}, Activation::relu, 0);
    EXPECT_EQ((refusal<StaticTanhMlp<float, 4, 8, 1>>(model)),
              "StaticMlp: the model has another activation");
}

TEST(StaticMlp, RefusesTooFewWeights)
{
    Model model = random_model({4, 8, 1}, Activation::relu, 0);
    model.layers[1].weight.pop_back();
    EXPECT_EQ((refusal<StaticMlp<float, 4, 8, 1>>(model)),
              "StaticMlp: layer 1: expected 1 x 8 weights, found 7");
}

}  // namespace
}  // namespace ricochet::static_mlp_test
