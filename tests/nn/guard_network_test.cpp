#include "ricochet/nn/guard_network.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "nn_models.hpp"
#include "ricochet/dual.hpp"
#include "ricochet/enclosure.hpp"
#include "ricochet/nn/mlp.hpp"

namespace ricochet::guard_network_test {
namespace {

constexpr std::array activations{Activation::relu, Activation::tanh, Activation::softplus,
                                 Activation::silu, Activation::sine};

/// A guard with residual layers wherever the widths allow it.
Model guard_model(const std::vector<std::size_t>& widths, Activation activation, std::uint64_t seed)
{
    Model model = random_model(widths, activation, seed);
    model.kind = "guard";
    model.precision = Precision::f64;
    for (std::size_t k = 1; k + 2 < widths.size(); ++k) {
        if (widths[k] == widths[k + 1] && seed % 2 == 0) model.residual.push_back(k);
    }
    for (std::size_t i = 0; i < widths.front(); ++i) {
        model.offset[i] = 0.1 * static_cast<double>(i);
        model.scale[i] = 1 - 0.25 * static_cast<double>(i % 3);
    }
    return model;
}

/// The network by its formula.
double formula(const Model& model, const std::vector<double>& input)
{
    std::vector<long double> x(input.begin(), input.end());
    for (std::size_t i = 0; i < x.size(); ++i) x[i] = (x[i] - model.offset[i]) * model.scale[i];
    for (std::size_t k = 0; k < model.layers.size(); ++k) {
        const DenseLayer& layer = model.layers[k];
        std::vector<long double> y(layer.bias.begin(), layer.bias.end());
        for (std::size_t j = 0; j < layer.outputs; ++j) {
            for (std::size_t i = 0; i < layer.inputs; ++i) {
                y[j] += x[i] * layer.weight[j * layer.inputs + i];
            }
            if (k + 1 == model.layers.size()) continue;
            const long double z = y[j];
            switch (model.activation) {
                case Activation::relu: y[j] = std::max(z, 0.0L); break;
                case Activation::tanh: y[j] = std::tanh(z); break;
                case Activation::softplus: y[j] = std::log1p(std::exp(z)); break;
                case Activation::silu: y[j] = z / (1 + std::exp(-z)); break;
                case Activation::sine: y[j] = std::sin(z); break;
            }
        }
        for (const std::size_t residual : model.residual) {
            if (residual != k) continue;
            for (std::size_t j = 0; j < layer.outputs; ++j) y[j] += x[j];
        }
        x = y;
    }
    return static_cast<double>(x[0]);
}

[[nodiscard]] detail::GuardRange range_of(const GuardNetwork& guard,
                                          const std::vector<Enclosure>& x)
{
    std::vector<double> centre, slope, radius;
    for (const Enclosure& of : x) {
        centre.push_back(of.centre);
        slope.push_back(of.slope);
        radius.push_back(of.radius);
    }
    return guard.range(centre.data(), slope.data(), radius.data());
}

/// Networks of every activation, with widths that are and are not multiples of a register.
std::vector<Model> models()
{
    const std::vector<std::vector<std::size_t>> shapes{
        {1, 1}, {3, 5, 1}, {2, 64, 64, 1}, {6, 33, 33, 33, 1}, {4, 16, 16, 7, 1}, {9, 130, 1}};
    std::vector<Model> all;
    for (const auto& shape : shapes) {
        for (const Activation activation : activations) {
            for (std::uint64_t seed = 1; seed <= 2; ++seed) {
                all.push_back(guard_model(shape, activation, seed));
            }
        }
    }
    return all;
}

class GuardNetworkTest : public testing::Test {
protected:
    [[nodiscard]] double any() { return uniform_(random_); }
    [[nodiscard]] std::vector<double> point(std::size_t n, double size = 1)
    {
        std::vector<double> x(n);
        for (double& value : x) value = size * any();
        return x;
    }

private:
    std::mt19937_64 random_{1};
    std::uniform_real_distribution<double> uniform_{-1, 1};
};

TEST_F(GuardNetworkTest, ValueIsThatOfTheFormula)
{
    // Sums of up to 130 products of numbers of order 1, in four layers: 1e-13 is 4 times that.
    for (const Model& model : models()) {
        const GuardNetwork guard(model);
        for (int k = 0; k < 10; ++k) {
            const auto x = point(guard.inputs(), 2);
            const double expected = formula(model, x);
            EXPECT_NEAR(guard.value(x.data()), expected, 1e-13 * (1 + std::fabs(expected)));
        }
    }
}

TEST_F(GuardNetworkTest, RateAndGradientAreTheDifferencesOfTheValue)
{
    // Central differences over 1e-5 have a truncation of 1e-10 times the third derivative, and
    // rounding of 1e-11. A kink of a ReLU lies inside one in 1000 of them or so, and is left out.
    int kinks = 0;
    for (const Model& model : models()) {
        const GuardNetwork guard(model);
        const std::size_t n = guard.inputs();
        for (int k = 0; k < 5; ++k) {
            const auto x = point(n), dx = point(n);
            double rate = 0;
            std::vector<double> gradient(n);
            const double value = guard.value(x.data());
            EXPECT_EQ(guard.value_and_rate(x.data(), dx.data(), rate), value);
            EXPECT_EQ(guard.value_and_gradient(x.data(), gradient.data()), value);
            double sum = 0;
            for (std::size_t i = 0; i < n; ++i) sum += gradient[i] * dx[i];
            EXPECT_NEAR(sum, rate, 1e-12 * (1 + std::fabs(rate)));
            auto ahead = x, behind = x;
            for (std::size_t i = 0; i < n; ++i) {
                ahead[i] += 1e-5 * dx[i];
                behind[i] -= 1e-5 * dx[i];
            }
            const double difference =
                (guard.value(ahead.data()) - guard.value(behind.data())) / 2e-5;
            if (std::fabs(difference - rate) <= 1e-7) continue;
            EXPECT_EQ(model.activation, Activation::relu) << difference << " and " << rate;
            ++kinks;
        }
    }
    EXPECT_LE(kinks, 6);
}

TEST_F(GuardNetworkTest, RangeHoldsEveryValueOnTheInterval)
{
    for (const Model& model : models()) {
        const GuardNetwork guard(model);
        const std::size_t n = guard.inputs();
        for (int k = 0; k < 12; ++k) {
            const double size = std::pow(10.0, -6 + k % 7);
            std::vector<Enclosure> interval(n);
            for (Enclosure& x : interval) {
                x = {any(), size * any(), k % 2 == 0 ? 0 : 0.1 * size * std::fabs(any())};
            }
            const auto range = range_of(guard, interval);
            for (int m = 0; m < 12; ++m) {
                const double tau = m == 0 ? -1 : m == 1 ? 1 : any();
                std::vector<double> x(n);
                for (std::size_t i = 0; i < n; ++i) {
                    x[i] = interval[i].centre + interval[i].slope * tau +
                           0.9999 * interval[i].radius *
                               (m % 3 == 0  ? any()
                                : any() > 0 ? 1
                                            : -1);
                }
                // The input is rounded, by 1e-16 times a gradient below 100.
                EXPECT_LE(std::fabs(guard.value(x.data()) - (range.centre + range.slope * tau)),
                          range.radius + 1e-14 * (1 + std::fabs(range.slope)));
            }
        }
    }
}

TEST_F(GuardNetworkTest, RangeOfASmoothNetworkIsOfSecondOrder)
{
    // Halving an interval divides the radius by 4, up to terms of third order.
    const GuardNetwork guard(guard_model({2, 16, 16, 1}, Activation::tanh, 1));
    const auto radius = [&](double w) {
        return guard(Enclosure{0.3, w, 0}, Enclosure{-0.2, 0.5 * w, 0}).radius;
    };
    EXPECT_NEAR(radius(2e-3) / radius(1e-3), 4, 0.1);
}

TEST_F(GuardNetworkTest, OneCallServesNumbersDualsAndEnclosures)
{
    const GuardNetwork guard(guard_model({2, 16, 1}, Activation::silu, 2));
    const double value = guard(0.25, -0.5);
    const Dual<1> dual = guard(Dual<1>(0.25, {1}), Dual<1>(-0.5, {2}));
    const Dual<2> both = guard(Dual<2>(0.25, {1, 0}), Dual<2>(-0.5, {0, 1}));
    EXPECT_EQ(dual.value, value);
    EXPECT_NEAR(dual.slope[0], both.slope[0] + 2 * both.slope[1], 1e-14);
    const Enclosure range = guard(Enclosure(0.25), Enclosure(-0.5));
    EXPECT_NEAR(range.centre, value, range.radius);
    EXPECT_LT(range.radius, 1e-12);
    // Second derivatives, by the formula: the mixed one is that of differences of the gradient.
    using Second = Dual<1, Dual<1>>;
    const Second second = guard(Second(Dual<1>(0.25, {1}), {Dual<1>(1)}), Second(-0.5));
    const auto slope = [&](double x) { return guard(Dual<1>(x, {1}), Dual<1>(-0.5)).slope[0]; };
    EXPECT_NEAR(second.slope[0].slope[0], (slope(0.2501) - slope(0.2499)) / 2e-4, 1e-6);
}

TEST_F(GuardNetworkTest, NormalIsTheGradientOfUnitLength)
{
    const GuardNetwork guard(guard_model({2, 16, 1}, Activation::tanh, 1));
    std::array<double, 2> x{0.3, 0.4}, gradient{};
    static_cast<void>(guard.value_and_gradient(x.data(), gradient.data()));
    const auto normal = guard.normal(0.3, 0.4);
    EXPECT_NEAR(std::hypot(normal[0], normal[1]), 1, 1e-15);
    EXPECT_NEAR(normal[0] * gradient[1], normal[1] * gradient[0], 1e-15);
    EXPECT_GT(normal[0] * gradient[0], 0);
}

TEST_F(GuardNetworkTest, KeepsItsBitsInAFile)
{
    const std::string path = testing::TempDir() + "guard_network_test.safetensors";
    for (const Activation activation : activations) {
        Model model = guard_model({3, 512, 512, 1}, activation, 2);
        save_model(model, path);
        const Model read = load_model(path);
        EXPECT_EQ(read.kind, "guard");
        EXPECT_EQ(read.activation, activation);
        EXPECT_EQ(read.residual, model.residual);
        const auto x = point(3);
        EXPECT_EQ(GuardNetwork(read).value(x.data()), GuardNetwork(model).value(x.data()));
    }
    std::filesystem::remove(path);
}

template <class Change>
std::string refusal(const Change& change)
{
    Model model = guard_model({2, 8, 8, 1}, Activation::tanh, 2);
    change(model);
    try {
        const GuardNetwork guard(model);
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return "accepted";
}

TEST_F(GuardNetworkTest, RefusesWhatIsNoGuard)
{
    EXPECT_EQ(refusal([](Model&) {}), "accepted");
    EXPECT_EQ(refusal([](Model& m) {
                  m = random_model({2, 513, 1}, Activation::relu, 1);
              }),
              "GuardNetwork: layer 0: expected a width from 1 to 512, found 513");
    EXPECT_EQ(refusal([](Model& m) {
                  m = random_model({2, 5, 2}, Activation::relu, 1);
              }),
              "GuardNetwork: expected 1 output, found 2");
    EXPECT_EQ(refusal([](Model& m) { m.residual = {0}; }),
              "GuardNetwork: residual layer 0: expected as many outputs as inputs, found 8 and 2");
    EXPECT_EQ(refusal([](Model& m) { m.residual = {2}; }),
              "GuardNetwork: expected residual layers before the last of 3, found 2");
    EXPECT_EQ(refusal([](Model& m) { m.layers[1].weight[3] = std::nan(""); }),
              "GuardNetwork: layer 1: expected finite weights and biases, found one that is not");
    EXPECT_EQ(refusal([](Model& m) { m.layers[1].bias.pop_back(); }),
              "GuardNetwork: layer 1: expected 8 biases, found 7");
    const GuardNetwork guard(guard_model({2, 8, 1}, Activation::tanh, 1));
    EXPECT_THROW(static_cast<void>(guard(0.1, 0.2, 0.3)), std::invalid_argument);
}

TEST_F(GuardNetworkTest, OtherNetworksRefuseItsActivations)
{
    Model model = random_model({2, 8, 1}, Activation::silu, 1);
    EXPECT_THROW(Mlp<double>{model}, std::invalid_argument);
    EXPECT_THROW(static_cast<void>(to_safetensors(model)), ModelError);
    model.kind = "guard";
    EXPECT_NO_THROW(static_cast<void>(to_safetensors(model)));
}

}  // namespace
}  // namespace ricochet::guard_network_test
