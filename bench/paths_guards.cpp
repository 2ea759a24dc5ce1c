// Paths through guards: networks, plans of expensive guards, the monitor in a host, callbacks in C.
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include "networks.hpp"
#include "paths.hpp"
#include "problems/cave_body.hpp"
#include "problems/cavern.hpp"
#include "problems/planar_arm.hpp"
#include "problems/zones.hpp"
#include "report/problems.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/monitor.hpp"
#include "ricochet/nn/mlp.hpp"
#include "ricochet/planned.hpp"
#include "ricochet/ricochet.h"
#include "timing.hpp"

namespace ricochet::bench {

namespace {

/// Answers of a network of four inputs, each of which depends on the last.
Path answers(const std::vector<std::size_t>& widths)
{
    const Mlp<float> network(random_network(widths, Activation::relu));
    return [=] {
        std::array<float, 4> x{0.1F, -0.2F, 0.3F, 0.7F};
        float y = 0;
        for (int i = 0; i < 1000; ++i) {
            network.forward(x.data(), &y);
            for (std::size_t k = 0; k < 4; ++k) x[k] = y * 1e-3F * static_cast<float>(k + 1);
        }
        keep(y);
    };
}

template <class System>
Path planned(const System& system, double t_end, double step)
{
    const auto shared = std::make_shared<const System>(system);
    return [=] {
        auto result = integrate(*shared, shared->start(), {.t_end = t_end, .step = step},
                                FixedStep<Rk4>{}, Planned<>({.check_bounds = false}));
        keep(result);
    };
}

// --- the monitor ---

/// A rotation, as a host program at no cost: exact, by a constant matrix.
template <class X>
class RotatingHost {
public:
    explicit RotatingHost(const X& x) : x0_(x), x1_(x), rate0_(x), rate1_(x) { rate(x1_, rate1_); }

    void step(double /*t_stop*/)
    {
        t0_ += h();
        std::swap(x0_, x1_);
        std::swap(rate0_, rate1_);
        x1_[0] = cos_ * x0_[0] + sin_ * x0_[1];
        x1_[1] = cos_ * x0_[1] - sin_ * x0_[0];
        rate(x1_, rate1_);
    }
    static constexpr bool is_cubic = true;
    [[nodiscard]] double t0() const noexcept { return t0_; }
    [[nodiscard]] double h() const noexcept { return 0.01; }
    [[nodiscard]] const X& x0() const noexcept { return x0_; }
    [[nodiscard]] const X& x1() const noexcept { return x1_; }
    [[nodiscard]] const X& rate0() const noexcept { return rate0_; }
    [[nodiscard]] const X& rate1() const noexcept { return rate1_; }
    void interpolate(double s, std::span<double> x) const noexcept { path().interpolate(s, x); }
    void interpolate_rate(double s, std::span<double> dxdt) const noexcept
    {
        path().interpolate_rate(s, dxdt);
    }

private:
    static void rate(const X& x, X& dxdt) noexcept
    {
        dxdt[0] = x[1];
        dxdt[1] = -x[0];
    }
    [[nodiscard]] HermiteStep path() const noexcept
    {
        return {{t0_, 0}, h(), x0_, x1_, rate0_, rate1_};
    }

    double cos_ = std::cos(0.01), sin_ = std::sin(0.01);
    double t0_ = -0.01;
    X x0_, x1_, rate0_, rate1_;
};

template <class X>
struct FarGuards {
    using State = X;
    static constexpr bool resets = false;
    std::size_t guard_count;

    void flow(double /*t*/, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -x[0];
    }
    void guards(double /*t*/, const X& x, std::span<double> g) const
    {
        for (std::size_t i = 0; i < g.size(); ++i) g[i] = 2 + static_cast<double>(i) - x[0];
    }
    void guard_rates(double /*t*/, const X& /*x*/, const X& dxdt, std::span<double> rates) const
    {
        for (double& rate : rates) rate = -dxdt[0];
    }
};

struct FarGuard {
    using State = report::Two;
    static constexpr bool resets = false;

    [[nodiscard]] static GuardInfo guard_info(std::size_t /*which*/) { return {.degree = 1}; }
    void flow(double /*t*/, const State& x, State& dxdt) const { dxdt = {x[1], -x[0]}; }
    template <class X>
    [[nodiscard]] double guard(double /*t*/, const X& x) const
    {
        return 2 - x[0];
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(double /*t*/, const X& /*x*/, const D& dxdt) const
    {
        return -dxdt[0];
    }
};

/// Steps of a host without an event.
template <class System>
Path examined(const System& system)
{
    const typename System::State x0{1, 0};
    return [=] {
        RotatingHost host(x0);
        EventMonitor monitor(system, x0);
        (void)monitor.start({0}, x0, host.h());
        for (int i = 0; i < 1000; ++i) {
            host.step(0);
            Verdict verdict = monitor.examine(host);
            keep(verdict);
        }
    };
}

// --- callbacks in C ---

extern "C" {

int c_ball_flow(void* user, rc_mode, double, const double* x, double* dxdt, size_t)
{
    dxdt[0] = x[1];
    dxdt[1] = -static_cast<const double*>(user)[0];
    return 0;
}
int c_ball_guard(void*, size_t, rc_mode, double, const double* x, size_t, double* g)
{
    *g = x[0];
    return 0;
}
int c_ball_rate(void*, size_t, rc_mode, double, const double*, const double* dxdt, size_t,
                double* rate)
{
    *rate = dxdt[0];
    return 0;
}
int c_ball_reset(void* user, size_t, rc_mode*, double, double* x, size_t)
{
    x[0] = 0;
    x[1] *= -static_cast<const double*>(user)[1];
    return 0;
}
int c_ball_rest(void*, size_t, rc_mode*, double, double* x, size_t)
{
    x[0] = x[1] = 0;
    return 0;
}
}

void require(rc_status status)
{
    if (status != RC_OK) throw std::runtime_error(rc_last_error());
}

/// As "ball, dopri5".
Path ball_in_c()
{
    return [] {
        double ball[2] = {9.81, 0.9};
        rc_guard_info floor{};
        floor.size = sizeof floor;
        floor.unilateral = 1;
        rc_callbacks callbacks{};
        callbacks.size = sizeof callbacks;
        callbacks.dimension = 2;
        callbacks.guard_count = 1;
        callbacks.user = ball;
        callbacks.guard_infos = &floor;
        callbacks.flow = c_ball_flow;
        callbacks.guard = c_ball_guard;
        callbacks.guard_rate = c_ball_rate;
        callbacks.reset = c_ball_reset;
        callbacks.rest = c_ball_rest;
        rc_system* system = nullptr;
        require(rc_system_new(&callbacks, &system));
        rc_options options;
        require(rc_options_default(&options, sizeof options));
        options.t_end = 20.5;
        options.rtol = options.atol = 1e-12;
        const double x0[2] = {10, 0};
        rc_simulation* simulation = nullptr;
        require(rc_simulation_new(system, x0, 2, &options, &simulation));
        require(rc_run(simulation));
        std::size_t events = rc_event_count(simulation);
        keep(events);
        require(rc_simulation_free(simulation));
        rc_system_free(system);
    };
}

}  // namespace

std::vector<Named> paths_of_guards()
{
    return {
        {"network of 2 x 64, 1000 answers",
         [] {
             return answers({4, 64, 64, 1});
         }},
        {"network of 1 x 16, 1000 answers",
         [] {
             return answers({4, 16, 1});
         }},
        {"cavern of 10000 segments, planned", [] { return planned(Cavern{}, 2, 1e-3); }},
        {"cave body, planned", [] { return planned(CaveBody{}, 1, 2e-3); }},
        {"arm of 4 joints, planned",
         [] { return planned(PlanarArm<4>({.obstacles = 8}), 2, 1e-3); }},
        {"256 zones, planned", [] { return planned(Zones{}, 2, 1e-3); }},
        {"monitor, 1000 steps", [] { return examined(FarGuard{}); }},
        {"monitor, 1000 steps, 100 guards",
         [] { return examined(FarGuards<std::vector<double>>{100}); }},
        {"ball, dopri5 by C", ball_in_c},
    };
}

}  // namespace ricochet::bench
