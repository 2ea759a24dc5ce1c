// A clock: its state is the time, and its guards are functions of the time with known roots. A step
// of any method of order one is exact.
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <vector>

#include "ricochet/guard.hpp"

namespace ricochet::test {

struct Clock {
    using State = std::array<double, 1>;
    struct Guard {
        std::function<double(double)> value;
        std::function<double(double)> rate;
        GuardInfo info{};
    };
    std::vector<Guard> guards;

    void flow(double, const State&, State& dxdt) const { dxdt = {1}; }
    [[nodiscard]] std::size_t guard_count() const { return guards.size(); }
    [[nodiscard]] GuardInfo guard_info(std::size_t i) const { return guards[i].info; }
    template <class V>
    [[nodiscard]] double guard(std::size_t i, double, const V& x) const
    {
        return guards[i].value(x[0]);
    }
    template <class V, class D>
    [[nodiscard]] double guard_rate(std::size_t i, double, const V& x, const D& dxdt) const
    {
        return guards[i].rate(x[0]) * dxdt[0];
    }
    void reset(std::size_t, double, State&) const {}
};

/// slope (t - root)
inline Clock::Guard line(double root, double slope = -1, const GuardInfo& info = {})
{
    return {[=](double t) { return slope * (t - root); }, [=](double) { return slope; }, info};
}
/// (t - middle)² - half²: leaves its side at middle - half, and returns at middle + half.
inline Clock::Guard dip(double middle, double half, const GuardInfo& info = {})
{
    return {[=](double t) { return (t - middle) * (t - middle) - half * half; },
            [=](double t) { return 2 * (t - middle); }, info};
}
/// 1, but -1 from `from` to `to`; only its sign has a meaning.
inline Clock::Guard pulse(double from, double to)
{
    return {[=](double t) { return t >= from && t < to ? -1.0 : 1.0; },
            [](double) { return 0.0; },
            {.crossing = Crossing::either, .boolean = true}};
}

}  // namespace ricochet::test
