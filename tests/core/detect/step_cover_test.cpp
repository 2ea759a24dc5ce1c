// Guards with true bounds whose events no step of the method resolves.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "ricochet/bernstein.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/planned.hpp"
#include "ricochet/rosenbrock.hpp"

namespace ricochet::step_cover_test {
namespace {

using X = std::array<double, 2>;

/// The time, and a guard of it that is 1 but for narrow dips.
struct Dips {
    using State = X;
    struct Dip {
        double at;     ///< [s]
        double slope;  ///< [1/s] of both of its sides
        double depth;  ///< below the surface; negative: it stays above
    };
    std::vector<Dip> dips;
    double factor = 1;  ///< of the bound to the largest rate
    Crossing crossing = Crossing::falling;
    bool acts = false;

    void flow(double, const X&, X& dxdt) const { dxdt = {1, 0}; }
    [[nodiscard]] GuardInfo guard_info() const { return {.crossing = crossing, .resets = acts}; }
    template <class V>
    [[nodiscard]] double guard(double, const V& x) const
    {
        double least = 1;
        for (const Dip& dip : dips) {
            least = std::min(least, dip.slope * std::fabs(x[0] - dip.at) - dip.depth);
        }
        return least;
    }
    template <class V, class D>
    [[nodiscard]] double guard_rate(double t, const V& x, const D& dxdt) const
    {
        const double value = guard(t, x);
        for (const Dip& dip : dips) {
            const double there = dip.slope * std::fabs(x[0] - dip.at) - dip.depth;
            if (there == value) return (x[0] < dip.at ? -dip.slope : dip.slope) * dxdt[0];
        }
        return 0;
    }
    void reset(double, X& x) const { x[1] += 1; }
    [[nodiscard]] double speed_bound(double, const X&) const
    {
        double steepest = 0;
        for (const Dip& dip : dips) steepest = std::max(steepest, dip.slope);
        return factor * steepest;
    }

    /// Times [s] of all events, ascending.
    [[nodiscard]] std::vector<double> exact() const
    {
        std::vector<double> times;
        for (const Dip& dip : dips) {
            if (!(dip.depth > 0)) continue;
            const double half = dip.depth / dip.slope;
            if (crossing != Crossing::rising) times.push_back(dip.at - half);
            if (crossing != Crossing::falling) times.push_back(dip.at + half);
        }
        std::sort(times.begin(), times.end());
        return times;
    }
};

struct Counts {
    std::size_t events = 0;
    std::uint64_t calls = 0;
};

/// Every event is found where it is, and none beside them.
template <class Stepping, class Detector, class Locator>
Counts expect_exact(const Dips& dips, const Options& options)
{
    const auto run = integrate(dips, X{0, 0}, options, Stepping{}, Detector{}, Locator{});
    const std::vector<double> exact = dips.exact();
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.statistics.unresolved_steps, 0u);
    EXPECT_EQ(run.events.size(), exact.size());
    for (std::size_t k = 0; k < std::min(run.events.size(), exact.size()); ++k) {
        // A guard with bounds is located within 1e-10 of a step, and steps are 1 s at most.
        EXPECT_NEAR(run.events[k].t, exact[k], 1e-10) << k;
    }
    if (dips.acts) {
        EXPECT_EQ(run.x[1], static_cast<double>(exact.size()));
    }
    return {exact.size(), run.statistics.guard_calls};
}

template <class Detector, class Locator>
Counts expect_exact_by_every_method(const Dips& dips)
{
    using Rk = FixedStep<Rk4>;
    Counts sum;
    const auto add = [&](const Counts& more) {
        sum.events += more.events;
        sum.calls += more.calls;
    };
    add(expect_exact<ErrorControlled<Dopri5>, Detector, Locator>(dips, {.t_end = 1}));
    add(expect_exact<ErrorControlled<Fehlberg78>, Detector, Locator>(dips, {.t_end = 1}));
    add(expect_exact<ErrorControlled<Rosenbrock4>, Detector, Locator>(dips, {.t_end = 1}));
    add(expect_exact<Rk, Detector, Locator>(dips, {.t_end = 1, .step = 0.3}));
    add(expect_exact<Rk, Detector, Locator>(dips, {.t_end = 1, .step = 0.1}));
    return sum;
}

TEST(StepCover, TheDipOfAnUncutStepIsFound)
{
    // It lasts for 4e-5 s, and the guard is 1 in 0.96 of the time.
    for (const bool acts : {false, true}) {
        Dips dips{.dips = {{0.37, 50, 1e-3}}, .acts = acts};
        for (const Crossing crossing : {Crossing::falling, Crossing::rising, Crossing::either}) {
            SCOPED_TRACE(static_cast<int>(crossing));
            dips.crossing = crossing;
            expect_exact_by_every_method<Planned<>, Newton>(dips);
            expect_exact_by_every_method<Planned<>, Bisection>(dips);
            expect_exact_by_every_method<Planned<>, Toms748>(dips);
            expect_exact_by_every_method<Planned<Ends>, Newton>(dips);
            expect_exact_by_every_method<Planned<Bernstein>, Newton>(dips);
        }
    }
}

/// Up to six dips, a hundredth of the run apart, of widths down to 1e-9 s. Their slopes are within
/// a factor of ten, and of the bound, so that a step takes less than 4096 parts; and so steep that
/// the guard is no cubic from one dip to the next.
Dips random_dips(std::mt19937_64& random)
{
    const auto uniform = [&](double a, double b) {
        return std::uniform_real_distribution<double>(a, b)(random);
    };
    Dips dips;
    const double steepest = std::exp(uniform(std::log(200), std::log(1e3)));
    const std::size_t count = 1 + random() % 6;
    while (dips.dips.size() < count) {
        const double at = uniform(0.02, 0.98);
        const bool apart = std::all_of(dips.dips.begin(), dips.dips.end(), [&](const auto& dip) {
            return std::fabs(dip.at - at) > 0.012;
        });
        if (!apart) continue;
        const double half = std::exp(uniform(std::log(1e-9), std::log(1e-3)));
        const double slope = steepest * uniform(0.1, 1);
        const double sign = random() % 4 == 0 ? -1 : 1;
        dips.dips.push_back({at, slope, sign * slope * half});
    }
    dips.factor = random() % 2 ? 1 : uniform(1, 2);
    constexpr std::array crossings = {Crossing::falling, Crossing::rising, Crossing::either};
    dips.crossing = crossings[random() % 3];
    dips.acts = dips.crossing != Crossing::either && random() % 2;
    return dips;
}

TEST(StepCover, NoDipWithinATrueBoundIsLost)
{
    std::mt19937_64 random(71);
    Counts sum;
    const auto add = [&](const Counts& more) {
        sum.events += more.events;
        sum.calls += more.calls;
    };
    for (int i = 0; i < 400 && !HasFailure(); ++i) {
        SCOPED_TRACE(i);
        const Dips dips = random_dips(random);
        add(expect_exact_by_every_method<Planned<>, Newton>(dips));
        add(expect_exact_by_every_method<Planned<>, Bisection>(dips));
        add(expect_exact_by_every_method<Planned<>, Toms748>(dips));
        if (i % 4 == 0) add(expect_exact_by_every_method<Planned<Ends>, Newton>(dips));
        if (i % 4 == 0) add(expect_exact_by_every_method<Planned<Bernstein>, Toms748>(dips));
    }
    RecordProperty("calls", std::to_string(sum.calls));
    RecordProperty("events", std::to_string(sum.events));
    EXPECT_GT(sum.events, 10000u);
}

}  // namespace
}  // namespace ricochet::step_cover_test
