// A step of a host integrator: the data that the host would offer to the detectors and
// locators. The state is (s, g(s)) of a function g given in closed form.
#pragma once

#include <array>
#include <cstdint>
#include <functional>

#include "ricochet/detail/guard_view.hpp"
#include "ricochet/step_probe.hpp"

namespace ricochet::test {

using detail::Finding;
using detail::Watch;

using HostState = std::array<double, 2>;

/// The guard is the second component of the state.
struct HostSystem {
    using State = HostState;
    static constexpr bool resets = false;

    Crossing crossing = Crossing::falling;

    void flow(double, const State&, State& dxdt) const { dxdt = {1, 0}; }
    [[nodiscard]] double guard(double, const State& x) const { return x[1]; }
    [[nodiscard]] double guard_rate(double, const State&, const State& dxdt) const
    {
        return dxdt[1];
    }
};

/// The step from time 100 over [0, h] along g, with rate g'; with direction -1 backward in time.
class HostStep {
public:
    HostStep(double h, std::function<double(double)> g, std::function<double(double)> rate,
             int direction = 1)
        : h_(h), direction_(direction), g_(std::move(g)), rate_(std::move(rate))
    {
        x0_ = at(0);
        x1_ = at(h);
        rate0_ = {1, rate_(0)};
        rate1_ = {1, rate_(h)};
    }

    [[nodiscard]] double time(double s) const { return 100 + direction_ * s; }
    [[nodiscard]] bool backward() const { return direction_ < 0; }
    [[nodiscard]] double h() const { return h_; }
    [[nodiscard]] const HostState& x0() const { return x0_; }
    [[nodiscard]] const HostState& x1() const { return x1_; }
    [[nodiscard]] const HostState& rate0() const { return rate0_; }
    [[nodiscard]] const HostState& rate1() const { return rate1_; }
    [[nodiscard]] int order() const { return 4; }

    void interpolate(double s, HostState& x) const { x = at(s); }
    void restep(double s, HostState& x) const
    {
        ++resteps;
        x = at(s);
    }
    void restep(double s, HostState& x, HostState& dxdt) const
    {
        restep(s, x);
        dxdt = {1, rate_(s)};
    }
    void flow(double s, const HostState&, HostState& dxdt) const { dxdt = {1, rate_(s)}; }

    mutable int resteps = 0;

private:
    [[nodiscard]] HostState at(double s) const { return {s, g_(s)}; }

    double h_;
    int direction_;
    std::function<double(double)> g_, rate_;
    HostState x0_, x1_, rate0_, rate1_;
};

static_assert(MethodStep<HostStep, HostState>);

/// One check of a detector at a step with a watch whose side is set.
template <class Detector>
[[nodiscard]] Finding look(const Detector& detector, const HostStep& step, Watch& watch,
                           Crossing crossing, std::uint64_t* guard_calls = nullptr)
{
    std::uint64_t calls = 0;
    const HostSystem system{crossing};
    const detail::GuardView<HostSystem, HostState> guard(system, calls,
                                                         {.backward = step.backward()}, crossing);
    watch.start = {.s = 0, .value = step.x0()[1], .rate = step.rate0()[1]};
    const Finding finding = examine_step(detector, guard, step, watch);
    if (guard_calls) *guard_calls = calls;
    return finding;
}

/// One check of a detector at a step of a guard armed on `side`.
template <class Detector>
[[nodiscard]] Finding look(const Detector& detector, const HostStep& step, Side side,
                           Crossing crossing, std::uint64_t* guard_calls = nullptr)
{
    Watch watch{.side = side, .start = {}, .end = {}};
    return look(detector, step, watch, crossing, guard_calls);
}

}  // namespace ricochet::test
