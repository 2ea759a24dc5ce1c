// A ball rebounds from a surface that a network has learned. The network is the guard, its gradient
// the normal of the surface, and `Enclosed` proves for every interval of the flight that no impact
// is lost.

#include <array>
#include <cmath>
#include <cstdio>

#include "ricochet/nn/guard_network.hpp"
#include "ricochet/ricochet.hpp"

namespace {

/// A network that is nearly the signed distance from a disc of radius 1: with the n directions e_k,
/// the mean of |e_k . x| is 2 / pi times the length of x, and |z| is the sum of two ReLUs.
ricochet::Model disc()
{
    constexpr std::size_t n = 32;
    constexpr double pi = 3.14159265358979323846;
    ricochet::DenseLayer hidden, last;
    hidden.inputs = 2;
    hidden.outputs = last.inputs = 2 * n;
    last.outputs = 1;
    last.bias = {-1};
    for (std::size_t k = 0; k < 2 * n; ++k) {
        const double angle = pi * static_cast<double>(k) / n;  // opposite directions, too
        hidden.weight.insert(hidden.weight.end(), {std::cos(angle), std::sin(angle)});
        hidden.bias.push_back(0);
        last.weight.push_back(pi / 2 / n);
    }
    ricochet::Model model;
    model.kind = "guard";
    model.activation = ricochet::Activation::relu;
    model.layers = {hidden, last};
    return model;
}

/// A ball on a spring towards the origin, outside a disc at the origin.
struct Ball {
    using State = std::array<double, 4>;  // position [m], velocity [m/s]
    ricochet::GuardNetwork surface{disc()};

    template <class S>
    void flow(const S&, const std::array<S, 4>& x, std::array<S, 4>& dxdt) const
    {
        dxdt = {x[2], x[3], -x[0], -x[1]};
    }
    template <class S>
    [[nodiscard]] S guard(const S&, const std::array<S, 4>& x) const
    {
        return surface(x[0], x[1]);
    }
    void reset(double, State& x) const
    {
        const auto normal = surface.normal(x[0], x[1]);
        const double speed = x[2] * normal[0] + x[3] * normal[1];
        if (speed >= 0) return;
        x[2] -= 2 * speed * normal[0];
        x[3] -= 2 * speed * normal[1];
    }
};

}  // namespace

int main()
{
    using namespace ricochet;
    const Ball ball;
    const auto run = integrate(ball, {2, 0.3, 0, 0.2}, {.t_end = 50, .step = 0.01},
                               FixedStep<Rk4>{}, Enclosed{});
    const auto& counts = run.statistics;
    std::printf("%zu impacts in %g s, the first at %.9f s\n", run.events.size(), run.t,
                run.events.front().t);
    std::printf("%llu of %llu steps proved, by %llu enclosures and %llu calls of the network\n",
                static_cast<unsigned long long>(counts.evidence.proved),
                static_cast<unsigned long long>(counts.steps),
                static_cast<unsigned long long>(counts.bound_calls),
                static_cast<unsigned long long>(counts.guard_calls));
    // The rebounds are elastic, and all impacts are on the learned surface.
    const double energy =
        run.x[0] * run.x[0] + run.x[1] * run.x[1] + run.x[2] * run.x[2] + run.x[3] * run.x[3];
    bool on_surface = true;
    for (const auto& event : run.events) {
        on_surface =
            on_surface && std::fabs(ball.surface(event.before[0], event.before[1])) < 1e-12;
    }
    const bool conserved = std::fabs(energy - (4 + 0.09 + 0.04)) < 1e-6;
    return on_surface && conserved && 10 * counts.evidence.proved > 9 * counts.steps ? 0 : 1;
}
