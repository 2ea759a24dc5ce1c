// Times of gradients through events: of a system whose flow, guard and reset are networks, by the
// adjoint, and of the ball's 13 impacts, by the adjoint and in forward mode.
//
// Before anything is timed the gradients are compared with differences and closed forms.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <random>
#include <span>
#include <vector>

#include "network_system.hpp"
#include "ricochet/sensitivity/adjoint.hpp"
#include "timing.hpp"

namespace {

using namespace ricochet;
using X2 = std::array<double, 2>;

/// The bouncing ball as a template over the scalar of its parameters.
template <class P>
struct Ball {
    using State = X2;
    static constexpr bool unilateral = true;
    P gravity, restitution;
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -gravity;
    }
    template <class S>
    constexpr S guard(const S& /*t*/, const std::array<S, 2>& x) const
    {
        return x[0];
    }
    template <class S>
    constexpr void reset(const S& /*t*/, std::array<S, 2>& x) const
    {
        x[0] = 0;
        x[1] = -restitution * x[1];
    }
};

void print(const char* name, const bench::Work& work, double error, const char* of)
{
    const bench::Timing timing = bench::time_alone(work);
    std::printf("%-44s %9.4f ms   error %.1e of %s\n", name, 1e3 * timing.median, error, of);
}

void networks()
{
    const test::NetworkSystem system = test::NetworkSystem::random(3);
    Options options{.t_end = 6};
    for (int i = 1; i <= 40; ++i) options.sample_times.push_back(0.15 * i);
    const Loss<X2> loss{.sample = [](std::size_t k, double, const X2& x, X2& slope) {
        const double off = x[0] - (3 + std::sin(static_cast<double>(k + 1)));
        slope[0] = 2 * off;
        return off * off;
    }};
    const X2 start{10, 0};
    const auto taken = [&] { return adjoint(system, start, options); };
    const auto run = taken();
    std::printf("networks: %zu weights, %zu events, %zu steps, %zu bytes of states\n",
                run.parameters(), run.run().events.size(),
                static_cast<std::size_t>(run.run().statistics.steps), run.bytes());

    // Along a random direction, with steps under a tight error control.
    Options tight = options;
    tight.rtol = tight.atol = 1e-12;
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal;
    const std::vector<double> p = system.values();
    std::vector<double> direction(p.size());
    for (double& each : direction) {
        each = normal(random) / std::sqrt(static_cast<double>(p.size()));
    }
    const auto value = [&](double h) {
        std::vector<double> moved = p;
        for (std::size_t j = 0; j < p.size(); ++j) moved[j] += h * direction[j];
        return adjoint(system.with(moved), start, tight).gradient(loss).value;
    };
    constexpr double h = 1e-4;
    const double difference =
        (8 * (value(h) - value(-h)) - (value(2 * h) - value(-2 * h))) / (12 * h);
    const auto along = [&](const Gradient& by) {
        double sum = 0;
        for (std::size_t j = 0; j < p.size(); ++j) sum += direction[j] * by.parameters[j];
        return std::fabs(sum / difference - 1);
    };
    print("networks/run alone",
          bench::repeated([&] { return integrate(system, start, options).t; }), 0, "nothing");
    print("networks/value and gradient",
          bench::repeated([&] { return taken().gradient(loss).value; }), along(run.gradient(loss)),
          "differences");
}

void ball()
{
    const Family family{[](auto p) {
                            return Ball<typename decltype(p)::value_type>{p[0], p[1]};
                        },
                        {9.81, 0.9}};
    const X2 start{10, 0};
    const Options options{.t_end = 20.5, .rtol = 1e-10, .atol = 1e-10};
    const LossSlopes<X2> last{.events = {{.event = 12, .t = 1}}};
    const auto run = adjoint(family, start, options);
    const double t1 = std::sqrt(20 / 9.81);
    double sum = 1, by_restitution = 0;
    for (int k = 1; k <= 12; ++k) {
        sum += 2 * std::pow(0.9, k);
        by_restitution += 2 * k * std::pow(0.9, k - 1);
    }
    const double t13 = t1 * sum;
    const auto error = [&](const Gradient& by) {
        return std::max({std::fabs(by.start[0] / (t13 / 20) - 1),
                         std::fabs(by.parameters[0] / (-t13 / (2 * 9.81)) - 1),
                         std::fabs(by.parameters[1] / (t1 * by_restitution) - 1)});
    };
    print("ball/13 impacts/adjoint",
          bench::repeated([&] { return adjoint(family, start, options).gradient(last).start[0]; }),
          error(run.gradient(last)), "the closed form");
    const auto gravity = parameter<Ball<double>>(
        [](auto p) {
            return Ball<decltype(p)>{p, decltype(p)(0.9)};
        },
        9.81);
    const auto restitution = parameter<Ball<double>>(
        [](auto p) {
            return Ball<decltype(p)>{decltype(p)(9.81), p};
        },
        0.9);
    const auto forward = [&] {
        return sensitivities(Ball<double>{9.81, 0.9}, start, {.parameters = {gravity, restitution}},
                             options);
    };
    const auto s = forward();
    const auto& dt = s.events[12].dt;
    print("ball/13 impacts/forward mode", bench::repeated([&] { return forward().state(0, 0); }),
          error({0, {dt[0], dt[1]}, {dt[2], dt[3]}, 0}), "the closed form");
}

}  // namespace

int main(int argc, char** argv)
{
    CLI::App app("Times of gradients through events.");
    CLI11_PARSE(app, argc, argv);
    networks();
    ball();
}
