// The derivatives of networks, and gradients of a system that consists of them.

#include "ricochet/sensitivity/network.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <random>
#include <stdexcept>
#include <vector>

#include "network_system.hpp"
#include "ricochet/sensitivity/adjoint.hpp"

namespace ricochet::network_test {
namespace {

using test::NetworkSystem;
using test::random_model;

TEST(DifferentiableMlp, HasTheBitsOfMlpAndTheDerivativesOfDifferences)
{
    std::mt19937_64 random(5);
    std::normal_distribution<double> normal;
    for (const Activation activation : {Activation::tanh, Activation::relu}) {
        for (const auto& widths : std::vector<std::vector<std::size_t>>{
                 {3, 2}, {1, 5, 1}, {4, 17, 3}, {2, 32, 32, 1}, {5, 7, 9, 11, 2}}) {
            const Model model = random_model(widths, activation, 0.5, random);
            const DifferentiableMlp network(model);
            const std::size_t n = network.inputs(), m = network.outputs();
            std::vector<double> x(n), w(m), out(m), expected(m);
            for (double& each : x) each = normal(random);
            for (double& each : w) each = normal(random);
            network.forward(x.data(), out.data());
            Mlp<double>(model).forward(x.data(), expected.data());
            EXPECT_EQ(out, expected);

            std::vector<double> by_x(n, 0.0), by_p(network.parameters(), 0.0);
            network.vjp(x.data(), w.data(), by_x.data(), by_p.data());
            const auto value = [&](const DifferentiableMlp& of, const std::vector<double>& at) {
                std::vector<double> y(m);
                of.forward(at.data(), y.data());
                double sum = 0;
                for (std::size_t i = 0; i < m; ++i) sum += w[i] * y[i];
                return sum;
            };
            // Central differences of size h: h^2 / 6 of the third derivative, which is of size
            // one, and rounding 1e-16 / h. Of ReLU, exact unless a kink is met within h.
            constexpr double h = 1e-5;
            for (std::size_t i = 0; i < n; ++i) {
                std::vector<double> up = x, down = x;
                up[i] += h;
                down[i] -= h;
                EXPECT_NEAR(by_x[i], (value(network, up) - value(network, down)) / (2 * h), 1e-8);
            }
            const std::vector<double> p = network.values();
            ASSERT_EQ(p.size(), network.parameters());
            for (std::size_t j = 0; j < p.size(); j += 1 + p.size() / 50) {
                std::vector<double> up = p, down = p;
                up[j] += h;
                down[j] -= h;
                const double difference =
                    (value(network.with(up), x) - value(network.with(down), x)) / (2 * h);
                EXPECT_NEAR(by_p[j], difference, 1e-8) << j;
            }
        }
    }
}

TEST(DifferentiableMlp, AddsToWhatIsThere)
{
    std::mt19937_64 random(6);
    const DifferentiableMlp network(random_model({2, 4, 1}, Activation::tanh, 0.5, random));
    const std::array<double, 2> x{0.3, -0.2};
    const double one = 1;
    std::vector<double> a(2, 0.0), p(network.parameters(), 0.0);
    network.vjp(x.data(), &one, a.data(), p.data());
    std::vector<double> b(2, 1.0), q(network.parameters(), 2.0);
    network.vjp(x.data(), &one, b.data(), q.data());
    for (std::size_t i = 0; i < 2; ++i) EXPECT_DOUBLE_EQ(b[i], a[i] + 1);
    for (std::size_t j = 0; j < p.size(); ++j) EXPECT_DOUBLE_EQ(q[j], p[j] + 2);
}

TEST(DifferentiableMlp, RefusesAnotherNumberOfParameters)
{
    std::mt19937_64 random(6);
    const DifferentiableMlp network(random_model({2, 4, 1}, Activation::tanh, 0.5, random));
    EXPECT_THROW((void)network.with(std::vector<double>(3)), std::invalid_argument);
}

// y' = v, v' = -9.8 + a(y, v); an event where y + g(y, v) falls through zero; v+ = -s(r(v)) v with
// s the logistic function. Each of a, g and r is a network: 2691 weights in all.
TEST(Adjoint, FlowGuardAndResetMayBeNetworks)
{
    const NetworkSystem system = NetworkSystem::random(3);
    ASSERT_EQ(system.parameter_count(), 2691u);
    Options options{.t_end = 6, .step = 0.02};
    for (int i = 1; i <= 40; ++i) options.sample_times.push_back(0.15 * i);
    const Loss<test::NetworkSystem::State> loss{
        .sample = [](std::size_t k, double, const auto& x, auto& slope) {
            const double off = x[0] - (3 + std::sin(static_cast<double>(k + 1)));
            slope[0] = 2 * off;
            return off * off;
        }};
    const std::array<double, 2> start{10, 0};
    const auto run = adjoint(system, start, options, FixedStep<Rk4>{});
    ASSERT_GE(run.run().events.size(), 2u);
    ASSERT_FALSE(run.undefined_at());
    const Gradient by = run.gradient(loss);

    // Along a random direction in the weights of each network: steps of fixed length, so that
    // differences are those of the same numbers. With h = 1e-4 the error of the five points is
    // h^4 / 30 of the fifth derivative, and rounding 1e-13 / h of a loss of size 1000.
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal;
    const std::vector<double> p = system.values();
    std::size_t at = 0;
    for (const std::size_t size : system.sizes()) {
        std::vector<double> direction(p.size(), 0.0);
        double along = 0;
        for (std::size_t j = at; j < at + size; ++j) {
            direction[j] = normal(random) / std::sqrt(static_cast<double>(size));
            along += direction[j] * by.parameters[j];
        }
        const auto value = [&](double h) {
            std::vector<double> moved = p;
            for (std::size_t j = 0; j < p.size(); ++j) moved[j] += h * direction[j];
            const auto other = adjoint(system.with(moved), start, options, FixedStep<Rk4>{});
            return other.gradient(loss).value;
        };
        constexpr double h = 1e-4;
        const double difference =
            (8 * (value(h) - value(-h)) - (value(2 * h) - value(-2 * h))) / (12 * h);
        EXPECT_NEAR(along, difference, 1e-8 * (1 + std::fabs(difference)));
        EXPECT_GT(std::fabs(difference), 1e-3);
        at += size;
    }
}

}  // namespace
}  // namespace ricochet::network_test
