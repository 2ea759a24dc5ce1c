// A system whose flow, guard and reset are networks, for tests and benchmarks of gradients.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "ricochet/nn/model.hpp"
#include "ricochet/sensitivity/network.hpp"
#include "ricochet/sensitivity/pullback.hpp"

namespace ricochet::test {

/// A network with normally distributed numbers of this size.
[[nodiscard]] inline Model random_model(const std::vector<std::size_t>& widths,
                                        Activation activation, double size, std::mt19937_64& random)
{
    std::normal_distribution<double> normal(0, size);
    Model model;
    model.activation = activation;
    model.precision = Precision::f64;
    for (std::size_t k = 0; k + 1 < widths.size(); ++k) {
        DenseLayer layer{widths[k], widths[k + 1], {}, {}};
        for (std::size_t i = 0; i < layer.inputs * layer.outputs; ++i) {
            layer.weight.push_back(normal(random));
        }
        for (std::size_t j = 0; j < layer.outputs; ++j) layer.bias.push_back(normal(random));
        model.layers.push_back(std::move(layer));
    }
    return model;
}

/// State (y, v): y' = v, v' = -9.8 + a(y, v); an event where y + g(y, v) falls through zero, with
/// the reset v+ = -s(r(v)) v, where s is the logistic function.
class NetworkSystem {
public:
    using State = std::array<double, 2>;

    NetworkSystem(DifferentiableMlp flow, DifferentiableMlp guard, DifferentiableMlp reset)
        : flow_(std::move(flow)), guard_(std::move(guard)), reset_(std::move(reset))
    {
    }
    /// Networks 2-32-32-1, 2-32-32-1 and 1-16-16-1.
    [[nodiscard]] static NetworkSystem random(unsigned seed)
    {
        std::mt19937_64 random(seed);
        const auto network = [&](std::size_t inputs, std::size_t width) {
            return DifferentiableMlp(
                random_model({inputs, width, width, 1}, Activation::tanh, 0.15, random));
        };
        DifferentiableMlp flow = network(2, 32), guard = network(2, 32), reset = network(1, 16);
        return {std::move(flow), std::move(guard), std::move(reset)};
    }

    [[nodiscard]] std::array<std::size_t, 3> sizes() const
    {
        return {flow_.parameters(), guard_.parameters(), reset_.parameters()};
    }
    [[nodiscard]] std::size_t parameter_count() const
    {
        return flow_.parameters() + guard_.parameters() + reset_.parameters();
    }
    [[nodiscard]] std::vector<double> values() const
    {
        std::vector<double> out;
        for (const DifferentiableMlp* network : {&flow_, &guard_, &reset_}) {
            const std::vector<double> values = network->values();
            out.insert(out.end(), values.begin(), values.end());
        }
        return out;
    }
    [[nodiscard]] NetworkSystem with(std::span<const double> p) const
    {
        const auto [a, g, r] = sizes();
        return {flow_.with(p.first(a)), guard_.with(p.subspan(a, g)), reset_.with(p.last(r))};
    }

    void flow(double, const State& x, State& dxdt) const
    {
        double a;
        flow_.forward(x.data(), &a);
        dxdt = {x[1], -9.8 + a};
    }
    void flow_vjp(double, const State& x, const State& w, const Cotangent& to) const
    {
        to.x[1] += w[0];
        flow_.vjp(x.data(), &w[1], to.x.data(), to.p.data());
    }

    [[nodiscard]] double guard(double, const State& x) const
    {
        double g;
        guard_.forward(x.data(), &g);
        return x[0] + g;
    }
    void guard_vjp(double, const State& x, double w, const Cotangent& to) const
    {
        to.x[0] += w;
        guard_.vjp(x.data(), &w, to.x.data(), to.p.data() + flow_.parameters());
    }

    void reset(double, State& x) const { x[1] *= -kept(x[1]); }
    void reset_vjp(double, const State& x, const State& w, const Cotangent& to) const
    {
        const double s = kept(x[1]);
        const double by_r = -w[1] * x[1] * s * (1 - s);
        to.x[0] += w[0];
        to.x[1] += -w[1] * s;
        reset_.vjp(&x[1], &by_r, &to.x[1], to.p.data() + flow_.parameters() + guard_.parameters());
    }

private:
    /// The fraction of the speed that an event leaves.
    [[nodiscard]] double kept(double v) const
    {
        double r;
        reset_.forward(&v, &r);
        return 1 / (1 + std::exp(-r));
    }

    DifferentiableMlp flow_, guard_, reset_;
};

}  // namespace ricochet::test
